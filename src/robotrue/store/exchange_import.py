"""Import of a workspace from one file, checked completely before anything is written.

The file is untrusted until it is checked. Rows are read into a separate database, of the schema
they were written with, migrated there, and only then merged. Ids stay; existing rows stay as they
are. Names other than those an export writes, sizes or hashes other than the manifest's, and more
data than the disk holds are refused before anything is read into a workspace.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
import shutil
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, BinaryIO, Final, cast

from sqlalchemy import Connection, DateTime, MetaData, Table, func, insert, select, tuple_, update
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from robotrue.core.document_decoder import decode
from robotrue.errors import ArchiveError, ConfigurationError, ModelMismatchError
from robotrue.store import journal
from robotrue.store.blobs import CHUNK
from robotrue.store.database import engine_at
from robotrue.store.exchange import (
    FORMAT,
    FORMAT_VERSION,
    MANIFEST,
    ExchangeTotals,
    source_of,
    tables,
)
from robotrue.store.jobs import OVER
from robotrue.store.layout import require_name
from robotrue.store.migrate import migrate, require_known
from robotrue.store.nouns import NOUNS
from robotrue.store.schema import Base
from robotrue.store.workspace import Workspace, writing

MOST: Final = 64 << 30
"""Bytes a project may have."""
EXPANSION: Final = 200
"""Times its own size a file may expand to, from ``SMALL`` on."""
SMALL: Final = 100 << 20
_MANIFEST_MOST: Final = 256 << 20
_MANIFEST_SMALL: Final = 1 << 20
_MANIFEST_EXPANSION: Final = 20
"""Times its packed size a manifest may expand to, beyond ``_MANIFEST_SMALL``; hashes do not pack to
less than a quarter, and the objects that JSON makes of it take many times its size."""
_LINE_MOST: Final = 64 << 20
_MEMBER: Final = re.compile(r"tables/[a-z_]{1,40}\.jsonl|(blobs|samples)/[0-9a-f]{64}")
BROKEN: Final = (
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
    struct.error,
    OSError,
    EOFError,
    RuntimeError,  # encrypted
    NotImplementedError,
    UnicodeDecodeError,
)
"""What a damaged zip makes of its reader."""
_SCHEMA: Final = re.compile(r"[0-9]{4}")
_ID: Final = re.compile(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")
_BATCH: Final = 500


def import_project(
    workspace: Workspace, path: str | Path | BinaryIO, *, most: int = MOST
) -> ExchangeTotals:
    """Imports a file that an export wrote, all of it or nothing; returns the totals.

    Args:
        workspace: Into which; items it has already stay as they are.
        path: The file.
        most: Bytes it may expand to.

    Raises:
        ArchiveError: Not an export, damaged, of a newer robotrue, or more than may be.
        ModelMismatchError: The same version of an item differs here.
        FormatError: The workspace cannot be written to.
    """
    source = source_of(path)
    try:
        with zipfile.ZipFile(path) as bundle:
            manifest = manifest_of(bundle, source)
            require_members(bundle, manifest.members, source, most, workspace.folder)
            with tempfile.TemporaryDirectory(dir=workspace.folder) as folder:
                return _import(workspace, bundle, manifest, source, Path(folder))
    except BROKEN as cause:
        raise damage_error(source, str(cause)) from cause


def _import(
    workspace: Workspace,
    bundle: zipfile.ZipFile,
    manifest: Manifest,
    source: str,
    folder: Path,
) -> ExchangeTotals:
    members = manifest.members
    engine = engine_at(folder, None)
    try:
        with writing(engine) as connection:
            migrate(connection, manifest.schema)
            _read_tables(bundle, members, connection, source)
            migrate(connection)
            _require_sound(connection, members, source)
        with workspace.write() as into:
            files = [name for name in members if not name.startswith("tables/")]
            for name in files:
                place, _, _ = name.partition("/")
                with member(bundle, name, members[name], source) as stream:
                    into.keep(cast(BinaryIO, stream), place=place)
            with engine.connect() as connection:
                rows = _merge(into.session, connection, source)
            detail = {"from": manifest.workspace, "rows": rows, "files": len(files)}
            journal.record(into, "imported", "workspace", workspace.id, detail=detail)
    except SQLAlchemyError as cause:
        raise damage_error(
            source, f"its rows do not fit together: {type(cause).__name__}"
        ) from cause
    finally:
        engine.dispose()
    size = sum(members[name].size for name in files)
    return ExchangeTotals(rows=rows, files=len(files), bytes=size)


def _read_tables(
    bundle: zipfile.ZipFile, members: Mapping[str, Member], connection: Connection, source: str
) -> None:
    """Fills a database of the schema the rows were written with."""
    found = MetaData()
    found.reflect(connection)
    stated = {name[7:-6] for name in members if name.startswith("tables/")}
    order = [each for each in found.sorted_tables if each.name in stated]
    if len(order) != len(stated):
        raise damage_error(source, "it holds a table that is none")
    for table in order:
        name = f"tables/{table.name}.jsonl"
        with member(bundle, name, members[name], source) as stream:
            batch: list[dict[str, object]] = []
            while line := stream.readline():
                batch.append(_row(table, line, source))
                if len(batch) == _BATCH:
                    connection.execute(insert(table), batch)
                    batch = []
            if batch:
                connection.execute(insert(table), batch)


def _row(table: Table, line: bytes, source: str) -> dict[str, object]:
    try:
        stated = json.loads(line)
        if not isinstance(stated, dict) or set(stated) != set(table.columns.keys()):
            raise ValueError("columns")
        for column in table.columns:
            value = stated[column.name]
            if isinstance(column.type, DateTime) and value is not None:
                at = datetime.fromisoformat(value).astimezone(UTC)
                stated[column.name] = at.replace(tzinfo=None)
    except (ValueError, TypeError, RecursionError) as cause:
        raise damage_error(source, f"a row of {table.name} is none ({cause})") from cause
    return stated


def _require_sound(connection: Connection, members: Mapping[str, Member], source: str) -> None:
    """Refuses rows that no robotrue writes, whatever their hash."""
    held = Base.metadata.tables
    blobs = {f"{r.place}/{r.sha256}" for r in connection.execute(select(held["blobs"]))}
    if blobs != {name for name in members if not name.startswith("tables/")}:
        raise damage_error(source, "its files are not those its rows name")
    jobs = connection.execute(select(held["jobs"].c.id, held["jobs"].c.state)).all()
    items = connection.execute(select(held["items"].c.id, held["items"].c.noun)).all()
    if any(state not in OVER for _, state in jobs) or any(noun not in NOUNS for _, noun in items):
        raise damage_error(source, "it holds a job that is not over, or a noun that is none")
    if not all(_ID.fullmatch(row.id) for row in (*jobs, *items)):
        raise damage_error(source, "it holds an id that is none")
    try:
        for (name,) in connection.execute(select(held["attachments"].c.name)):
            require_name(name)
    except ConfigurationError as cause:
        raise damage_error(source, cause.message) from cause


def _merge(session: Session, staged: Connection, source: str) -> dict[str, int]:
    """Adds missing data; returns the number of rows of each table."""
    counts: dict[str, int] = {}
    for table in tables():
        if table.name == "blobs":  # their rows came with the files
            continue
        counts[table.name] = 0
        key = [table.c.entry] if table.name == "journal" else list(table.primary_key.columns)
        chosen = select(table).order_by(*table.primary_key.columns)
        for batch in staged.execute(chosen).mappings().partitions(_BATCH):
            rows = [dict(row) for row in batch]
            new = _new(session, table, [column.name for column in key], rows, source)
            if table.name == "journal":
                new = [{k: v for k, v in row.items() if k != "number"} for row in new]
            if new:
                session.execute(insert(table), new)
            counts[table.name] += len(new)
        if "latest" in table.c:
            _only_one_latest(session, table)
    return counts


def _new(
    session: Session, table: Table, key: list[str], rows: list[dict[str, object]], source: str
) -> list[dict[str, object]]:
    columns = tuple_(*(table.c[name] for name in key))
    keys = [tuple(row[name] for name in key) for row in rows]
    there = {
        tuple(row[name] for name in key): row
        for row in session.execute(select(table).where(columns.in_(keys))).mappings()
    }
    new = []
    for each, row in zip(keys, rows, strict=True):
        if each not in there:
            new.append(row)
            continue
        own = there[each]
        differing = [k for k in row if k not in ("latest", "number") and own[k] != row[k]]
        if differing:
            raise ModelMismatchError(
                f"{table.name} {each[0]} is here already with other content ({differing[0]}): "
                "both were changed since the export.",
                source=source,
                hint="import it into a separate workspace.",
            )
    return new


def _only_one_latest(session: Session, table: Table) -> None:
    """Marks only the highest version of each item as latest, whichever side had more versions."""
    newest = select(table.c.id, func.max(table.c.version).label("version")).group_by(table.c.id)
    last = newest.subquery()
    wrong = select(table.c.id, table.c.version, last.c.version.label("last")).join(
        last, table.c.id == last.c.id
    )
    for row in session.execute(
        wrong.where(table.c.latest != (table.c.version == last.c.version))
    ).all():
        session.execute(
            update(table)
            .where(table.c.id == row.id, table.c.version == row.version)
            .values(latest=row.version == row.last)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """A file of an export.

    Attributes:
        sha256: Of its bytes.
        size: In bytes.
    """

    sha256: str
    size: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """Manifest of an export.

    Attributes:
        format_version: Of the export.
        schema: Of the database its rows are from.
        members: Its files by name.
        workspace: It was made of.
    """

    format_version: int
    schema: str
    members: Mapping[str, Member]
    workspace: str | None = None


def manifest_of(bundle: zipfile.ZipFile, source: str) -> Manifest:
    """Returns the manifest.

    Raises:
        ArchiveError: There is none, it is damaged, or of a newer robotrue.
    """
    try:
        info = bundle.getinfo(MANIFEST)
        packed = max(_MANIFEST_SMALL, _MANIFEST_EXPANSION * info.compress_size)
        if info.file_size > min(_MANIFEST_MOST, packed):
            raise damage_error(source, "its manifest is too long")
        stated = json.loads(bundle.read(MANIFEST))
        if stated.get("format") != FORMAT:
            raise ArchiveError("a zip file, but not an export of robotrue.", source=source)
        manifest = decode(Manifest, stated)
        if manifest.format_version > FORMAT_VERSION:
            raise ArchiveError(
                f"an export of format {manifest.format_version}, this robotrue reads up to "
                f"{FORMAT_VERSION}.",
                source=source,
                hint="update robotrue.",
            )
        if not _SCHEMA.fullmatch(manifest.schema):
            raise ValueError("schema")
        require_known(manifest.schema)
        for entry in manifest.members.values():
            if not re.fullmatch("[0-9a-f]{64}", entry.sha256) or not 0 <= entry.size:
                raise ValueError("a member's hash or size")
    except (KeyError, ValueError, TypeError, AttributeError, RecursionError) as cause:
        raise damage_error(source, f"its manifest is none ({cause})") from cause
    return manifest


def require_members(
    bundle: zipfile.ZipFile, members: Mapping[str, Member], source: str, most: int, folder: Path
) -> None:
    """Passes if the members are those of the manifest, and no more than may be.

    Raises:
        ArchiveError: They are not; or they expand to more than is allowed or the disk holds.
    """
    names = [info.filename for info in bundle.infolist()]
    if len(names) != len(set(names)) or set(names) != {MANIFEST, *members}:
        raise damage_error(source, "its members are not those of its manifest")
    for info in bundle.infolist():
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise damage_error(source, f"{info.filename[:60]} is packed in a way no export is")
        if info.filename == MANIFEST:
            continue
        if not _MEMBER.fullmatch(info.filename):
            raise damage_error(source, f"a member is called {info.filename[:60]!r}")
        if info.file_size != members[info.filename].size:
            raise damage_error(source, f"{info.filename} has another length than in the manifest")
        name = info.filename.partition("/")[2]
        if not info.filename.startswith("tables/") and members[info.filename].sha256 != name:
            raise damage_error(source, f"{info.filename} is not named by its hash")
    expanded = sum(info.file_size for info in bundle.infolist())
    packed = sum(info.compress_size for info in bundle.infolist())
    allowed = min(most, shutil.disk_usage(folder).free, max(SMALL, EXPANSION * packed))
    if expanded > allowed:
        raise ArchiveError(
            f"expands to {expanded / 2**20:.0f} MiB, allowed are {allowed / 2**20:.0f} MiB.",
            source=source,
            hint="see where the file came from, and the free space.",
        )


class Checked:
    """A member that is read no further than it should be, and whose hash is what it should be."""

    def __init__(self, stream: IO[bytes], name: str, entry: Member, source: str) -> None:
        self._stream, self._name, self._entry, self._source = stream, name, entry, source
        self._digest, self._size = hashlib.sha256(), 0

    def read(self, size: int = CHUNK) -> bytes:
        """Returns the next bytes; at the end the hash must agree."""
        piece = self._stream.read(size)
        return self._check(piece)

    def readline(self) -> bytes:
        """Returns the next line."""
        line = self._stream.readline(_LINE_MOST)
        return self._check(line)

    def _check(self, piece: bytes) -> bytes:
        self._digest.update(piece)
        self._size += len(piece)
        whole = self._size == self._entry.size
        if self._size > self._entry.size or (not piece and not whole):
            raise damage_error(
                self._source, f"{self._name} has another length than in the manifest"
            )
        if whole and self._digest.hexdigest() != self._entry.sha256:
            raise damage_error(self._source, f"{self._name} does not match its hash")
        return piece


@contextlib.contextmanager
def member(bundle: zipfile.ZipFile, name: str, entry: Member, source: str) -> Iterator[Checked]:
    """Gives a member to read.

    Raises:
        ArchiveError: It differs from the manifest.
    """
    try:
        with bundle.open(name) as stream:
            yield Checked(stream, name, entry, source)
    except BROKEN as cause:
        raise damage_error(source, str(cause)) from cause


def damage_error(source: str, what: str) -> ArchiveError:
    """Returns the error for a file that no export wrote as it is."""
    return ArchiveError(
        f"not an export of robotrue, or damaged: {what}.",
        source=source,
        hint="export it again, or fetch it from its backup.",
    )
