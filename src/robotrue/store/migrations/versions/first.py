"""The first tables."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects.postgresql import JSONB

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

ID, HASH, NAME, WORD = sa.String(36), sa.String(64), sa.String(200), sa.String(40)
DOCUMENT = sa.JSON().with_variant(JSONB(), "postgresql")
TIME = sa.DateTime(timezone=True)


def upgrade() -> None:
    """Makes all tables."""
    _ground()
    _create_versioned("robots", _text("maker"), _whole("dof"), _text("identity", HASH))
    _create_versioned("tools", _text("identity", HASH))
    _create_versioned("cells", _text("digest", HASH), _text("robot", NAME), _text("frame"))
    _create_versioned(
        "measurement_sets",
        _text("frame"),
        _whole("poses"),
        _whole("dof"),
        _whole("full_poses"),
        _text("data", HASH),
        sa.Column("samples", HASH, sa.ForeignKey("blobs.sha256"), nullable=False),
    )
    _create_versioned(
        "models",
        _text("kind"),
        _text("method"),
        _text("robot", NAME),
        _text("identity", HASH),
        _text("made_by"),
        sa.Column("settings", DOCUMENT, nullable=False),
    )
    _create_versioned(
        "registrations",
        _text("method"),
        _text("verdict"),
        _whole("frames"),
        _text("identity", HASH),
    )
    _create_versioned(
        "programs",
        _text("stage"),
        _text("dialect"),
        _whole("file_count"),
        sa.Column("bytes", sa.BigInteger(), nullable=False),
    )
    _create_versioned("documents", _text("kind"))
    _create_versioned(
        "drift_checks", _whole("poses"), _real("statistic"), _real("p_value"), _text("verdict")
    )
    for table, column in (
        ("robots", "identity"),
        ("tools", "identity"),
        ("measurement_sets", "data"),
        ("models", "identity"),
    ):
        op.create_index(f"ix_{table}_{column}", table, [column])
    _jobs()
    _journal()


def _ground() -> None:
    op.create_table(
        "workspace",
        sa.Column("id", ID, primary_key=True),
        _time("created"),
        _text("made_by"),
    )
    op.create_table(
        "blobs",
        sa.Column("sha256", HASH, primary_key=True),
        _text("place"),
        sa.Column("size", sa.BigInteger(), nullable=False),
        _time("created"),
    )
    op.create_table("items", sa.Column("id", ID, primary_key=True), _text("noun"), _time("created"))
    op.create_table(
        "links",
        *_of_version(),
        sa.Column("to_id", ID, sa.ForeignKey("items.id"), nullable=False),
        _whole("to_version"),
    )
    op.create_index("ix_links_to", "links", ["to_id", "role"])
    op.create_table(
        "attachments",
        *_of_version(),
        _text("name", NAME),
        sa.Column("sha256", HASH, sa.ForeignKey("blobs.sha256"), nullable=False),
    )
    op.create_index("ix_attachments_sha256", "attachments", ["sha256"])


def _of_version() -> tuple[sa.Column[object], ...]:
    return (
        sa.Column("id", ID, sa.ForeignKey("items.id"), primary_key=True),
        sa.Column("version", sa.Integer(), primary_key=True, autoincrement=False),
        sa.Column("role", WORD, primary_key=True),
        sa.Column("position", sa.Integer(), primary_key=True, autoincrement=False),
    )


def _create_versioned(name: str, *columns: sa.Column[object]) -> None:
    op.create_table(
        name,
        sa.Column("id", ID, nullable=False),
        sa.Column("version", sa.Integer(), nullable=False, autoincrement=False),
        sa.Column("latest", sa.Boolean(), nullable=False),
        sa.Column("deleted", sa.Boolean(), nullable=False),
        _text("name", NAME),
        sa.Column("note", sa.Text(), nullable=False),
        _time("created"),
        sa.Column("detail", DOCUMENT, nullable=False),
        *columns,
        sa.PrimaryKeyConstraint("id", "version"),
        sa.ForeignKeyConstraint(["id"], ["items.id"], name=f"fk_{name}_id"),
    )
    op.create_index(f"ix_{name}_newest", name, ["latest", "deleted", "created", "id"])


def _jobs() -> None:
    op.create_table(
        "jobs",
        sa.Column("id", ID, primary_key=True),
        _text("kind"),
        sa.Column("parameters", DOCUMENT, nullable=False),
        _text("state"),
        _real("progress"),
        sa.Column("text", sa.Text(), nullable=False),
        sa.Column("remarks", DOCUMENT, nullable=False),
        sa.Column("result", DOCUMENT, nullable=True),
        sa.Column("error", DOCUMENT, nullable=True),
        _whole("attempts"),
        _whole("attempts_allowed"),
        sa.Column("cancel", sa.Boolean(), nullable=False),
        _text("worker", NAME),
        _real("heartbeat"),
        _time("submitted"),
        sa.Column("started", TIME, nullable=True),
        sa.Column("finished", TIME, nullable=True),
    )
    op.create_index("ix_jobs_state", "jobs", ["state", "submitted"])
    op.create_index("ix_jobs_submitted", "jobs", ["submitted", "id"])


def _journal() -> None:
    op.create_table(
        "journal",
        sa.Column("number", sa.Integer(), primary_key=True, autoincrement=True),
        sa.Column("entry", ID, nullable=False, unique=True),
        _time("at"),
        _text("action"),
        _text("noun"),
        _text("item", ID),
        _whole("version"),
        sa.Column("detail", DOCUMENT, nullable=False),
    )
    op.create_index("ix_journal_item", "journal", ["item"])


def _text(name: str, kind: sa.String = WORD) -> sa.Column[object]:
    return sa.Column(name, kind, nullable=False)


def _whole(name: str) -> sa.Column[object]:
    return sa.Column(name, sa.Integer(), nullable=False)


def _real(name: str) -> sa.Column[object]:
    return sa.Column(name, sa.Float(), nullable=False)


def _time(name: str) -> sa.Column[object]:
    return sa.Column(name, TIME, nullable=False)
