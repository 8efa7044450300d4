"""The tables of a workspace, the same on SQLite and PostgreSQL; of each noun, see ``nouns``.

Everything a user names is an item with an id that never changes. Its content is in rows of its
noun's table, one row per version; a row is never altered except for ``latest``, which only marks
the newest. Deleting is a new version marked deleted. Files are next to the database under their
SHA-256; a row names them. Jobs are the exception: their row is their current state.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Final

from sqlalchemy import (
    JSON,
    BigInteger,
    Boolean,
    DateTime,
    Dialect,
    Float,
    ForeignKey,
    ForeignKeyConstraint,
    Index,
    Integer,
    String,
    Text,
    TypeDecorator,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, declared_attr, mapped_column
from sqlalchemy.types import TypeEngine

ID: Final = String(36)
HASH: Final = String(64)
NAME: Final = String(200)
WORD: Final = String(40)


class UtcDateTime(TypeDecorator[datetime]):
    """Times with their zone in Python, UTC in the database."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Returns the time as the database keeps it."""
        return None if value is None else value.astimezone(UTC)

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Returns the time with its zone."""
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


class Document(TypeDecorator[object]):
    """JSON values; on PostgreSQL as it keeps them best, whose types are loaded only for it."""

    impl = JSON
    cache_ok = True
    should_evaluate_none = True  # as JSON itself: None is a value, too

    def load_dialect_impl(self, dialect: Dialect) -> TypeEngine[object]:
        """Returns the type of one database."""
        if dialect.name != "postgresql":
            return dialect.type_descriptor(JSON())
        from sqlalchemy.dialects.postgresql import JSONB

        return dialect.type_descriptor(JSONB())


DOCUMENT: Final = Document()


class Base(DeclarativeBase):
    """All tables."""


class WorkspaceRow(Base):
    """The one row that identifies the workspace of this database."""

    __tablename__ = "workspace"
    id: Mapped[str] = mapped_column(ID, primary_key=True)
    created: Mapped[datetime] = mapped_column(UtcDateTime)
    made_by: Mapped[str] = mapped_column(WORD)


class BlobRow(Base):
    """A file next to the database, by the SHA-256 of its content."""

    __tablename__ = "blobs"
    sha256: Mapped[str] = mapped_column(HASH, primary_key=True)
    place: Mapped[str] = mapped_column(WORD)
    size: Mapped[int] = mapped_column(BigInteger)
    created: Mapped[datetime] = mapped_column(UtcDateTime)


class ItemRow(Base):
    """An id and its noun."""

    __tablename__ = "items"
    id: Mapped[str] = mapped_column(ID, primary_key=True)
    noun: Mapped[str] = mapped_column(WORD)
    created: Mapped[datetime] = mapped_column(UtcDateTime)


class LinkRow(Base):
    """Dependency of one version on another: a model on its data, a program on its model."""

    __tablename__ = "links"
    id: Mapped[str] = mapped_column(ID, ForeignKey("items.id"), primary_key=True)
    version: Mapped[int] = mapped_column(Integer, primary_key=True)
    role: Mapped[str] = mapped_column(WORD, primary_key=True)
    position: Mapped[int] = mapped_column(Integer, primary_key=True)
    to_id: Mapped[str] = mapped_column(ID, ForeignKey("items.id"))
    to_version: Mapped[int] = mapped_column(Integer)
    __table_args__ = (Index("ix_links_to", "to_id", "role"),)


class AttachmentRow(Base):
    """A file that belongs to a version, under the name it came with."""

    __tablename__ = "attachments"
    id: Mapped[str] = mapped_column(ID, ForeignKey("items.id"), primary_key=True)
    version: Mapped[int] = mapped_column(Integer, primary_key=True)
    role: Mapped[str] = mapped_column(WORD, primary_key=True)
    position: Mapped[int] = mapped_column(Integer, primary_key=True)
    name: Mapped[str] = mapped_column(NAME)
    sha256: Mapped[str] = mapped_column(HASH, ForeignKey("blobs.sha256"))
    __table_args__ = (Index("ix_attachments_sha256", "sha256"),)


class Versioned(Base):
    """Columns that all nouns share; one row is one version."""

    __abstract__ = True

    id: Mapped[str] = mapped_column(ID, primary_key=True)
    version: Mapped[int] = mapped_column(Integer, primary_key=True)
    latest: Mapped[bool] = mapped_column(Boolean)
    deleted: Mapped[bool] = mapped_column(Boolean)
    name: Mapped[str] = mapped_column(NAME)
    note: Mapped[str] = mapped_column(Text)
    created: Mapped[datetime] = mapped_column(UtcDateTime)
    detail: Mapped[dict[str, object]] = mapped_column(DOCUMENT)

    @declared_attr.directive
    @classmethod
    def __table_args__(cls) -> tuple[object, ...]:
        """The id is an item's; the page of the newest is read from one index."""
        return (
            ForeignKeyConstraint(["id"], ["items.id"], name=f"fk_{cls.__tablename__}_id"),
            Index(f"ix_{cls.__tablename__}_newest", "latest", "deleted", "created", "id"),
        )


class JobRow(Base):
    """Queued or running job and its progress."""

    __tablename__ = "jobs"
    id: Mapped[str] = mapped_column(ID, primary_key=True)
    kind: Mapped[str] = mapped_column(WORD)
    parameters: Mapped[dict[str, object]] = mapped_column(DOCUMENT)
    state: Mapped[str] = mapped_column(WORD)
    progress: Mapped[float] = mapped_column(Float)
    text: Mapped[str] = mapped_column(Text)
    remarks: Mapped[list[str]] = mapped_column(DOCUMENT)
    result: Mapped[dict[str, object] | None] = mapped_column(DOCUMENT)
    error: Mapped[dict[str, object] | None] = mapped_column(DOCUMENT)
    attempts: Mapped[int] = mapped_column(Integer)
    attempts_allowed: Mapped[int] = mapped_column(Integer)
    cancel: Mapped[bool] = mapped_column(Boolean)
    worker: Mapped[str] = mapped_column(NAME)
    heartbeat: Mapped[float] = mapped_column(Float)
    submitted: Mapped[datetime] = mapped_column(UtcDateTime)
    started: Mapped[datetime | None] = mapped_column(UtcDateTime)
    finished: Mapped[datetime | None] = mapped_column(UtcDateTime)
    __table_args__ = (
        Index("ix_jobs_state", "state", "submitted"),
        Index("ix_jobs_submitted", "submitted", "id"),
    )


class JournalRow(Base):
    """Entry of the journal; rows are only ever added."""

    __tablename__ = "journal"
    number: Mapped[int] = mapped_column(Integer, primary_key=True, autoincrement=True)
    entry: Mapped[str] = mapped_column(ID, unique=True)
    at: Mapped[datetime] = mapped_column(UtcDateTime)
    action: Mapped[str] = mapped_column(WORD)
    noun: Mapped[str] = mapped_column(WORD)
    item: Mapped[str] = mapped_column(ID, index=True)
    version: Mapped[int] = mapped_column(Integer)
    detail: Mapped[dict[str, object]] = mapped_column(DOCUMENT)
