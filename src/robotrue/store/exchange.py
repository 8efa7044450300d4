"""A whole workspace as one file: written here, read by :mod:`robotrue.store.exchange_import`.

A zip of ``manifest.json``, one ``tables/NAME.jsonl`` per table and every file under its SHA-256.
The manifest names schema, size and SHA-256 of each member. Unfinished jobs are not exported.
"""

from __future__ import annotations

import hashlib
import json
import zipfile
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import IO, BinaryIO, Final

from sqlalchemy import Connection, Table, select

from robotrue.core.files import atomic_stream
from robotrue.store.blobs import CHUNK, require_whole, stored_path
from robotrue.store.jobs import OVER
from robotrue.store.migrate import HEAD
from robotrue.store.schema import Base, WorkspaceRow
from robotrue.store.workspace import Workspace, now
from robotrue.version import __version__

FORMAT: Final = "robotrue-project"
FORMAT_VERSION: Final = 1
MANIFEST: Final = "manifest.json"
_EPOCH: Final = (1980, 1, 1, 0, 0, 0)
_ROWS: Final = 1000
LEFT_OUT: Final = frozenset({WorkspaceRow.__tablename__})


@dataclass(frozen=True, slots=True, kw_only=True)
class ExchangeTotals:
    """Number of rows, files and bytes transferred.

    Attributes:
        rows: Per table.
        files: Beside the database.
        bytes: Of those files.
    """

    rows: dict[str, int]
    files: int
    bytes: int


def export_project(workspace: Workspace, path: str | Path) -> ExchangeTotals:
    """Writes everything in a workspace to one file, whole or not at all; returns the totals.

    Others may write meanwhile: the file holds the state of one moment.

    Raises:
        ArchiveError: A file of the workspace is missing or was altered.
        FormatError: The file cannot be written.
    """
    with atomic_stream(path) as stream, zipfile.ZipFile(stream, "w", allowZip64=True) as bundle:
        return _write(workspace, bundle)


def _write(workspace: Workspace, bundle: zipfile.ZipFile) -> ExchangeTotals:
    members: dict[str, dict[str, object]] = {}
    rows: dict[str, int] = {}
    files = size = 0
    engine = workspace.engine
    if engine.dialect.name == "postgresql":
        engine = engine.execution_options(isolation_level="REPEATABLE READ")
    with engine.connect() as connection, connection.begin():
        for table in tables():
            name = f"tables/{table.name}.jsonl"
            with bundle.open(_entry(name, zipfile.ZIP_DEFLATED), "w", force_zip64=True) as out:
                rows[table.name], members[name] = _table(connection, table, out)
        for sha256, place, length in _blobs(connection):
            name = f"{place}/{sha256}"
            source = stored_path(workspace.folder, place, sha256)
            require_whole(source, sha256)
            kind = zipfile.ZIP_STORED if place == "samples" else zipfile.ZIP_DEFLATED
            with bundle.open(_entry(name, kind), "w", force_zip64=True) as out:
                with source.open("rb") as stream:
                    while piece := stream.read(CHUNK):
                        out.write(piece)
            members[name] = {"sha256": sha256, "size": length}
            files, size = files + 1, size + length
    manifest = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "schema": HEAD,
        "workspace": workspace.id,
        "made_by": __version__,
        "created": now().isoformat(),
        "members": members,
    }
    bundle.writestr(_entry(MANIFEST, zipfile.ZIP_DEFLATED), json.dumps(manifest, indent=1))
    return ExchangeTotals(rows=rows, files=files, bytes=size)


def tables() -> list[Table]:
    """Returns the tables that go over, those that others refer to first."""
    return [each for each in Base.metadata.sorted_tables if each.name not in LEFT_OUT]


def _table(connection: Connection, table: Table, out: IO[bytes]) -> tuple[int, dict[str, object]]:
    digest, size, count = hashlib.sha256(), 0, 0
    chosen = select(table).order_by(*table.primary_key.columns)
    if table.name == "jobs":
        chosen = chosen.where(table.c.state.in_(sorted(OVER)))
    with connection.execution_options(yield_per=_ROWS).execute(chosen) as rows:
        for row in rows.mappings():
            line = (json.dumps(dict(row), default=_plain, sort_keys=True) + "\n").encode()
            digest.update(line)
            size += len(line)
            count += 1
            out.write(line)
    return count, {"sha256": digest.hexdigest(), "size": size}


def _blobs(connection: Connection) -> list[tuple[str, str, int]]:
    table = Base.metadata.tables["blobs"]
    rows = connection.execute(select(table).order_by(table.c.sha256)).all()
    return [(row.sha256, row.place, row.size) for row in rows]


def _plain(value: object) -> str:
    if isinstance(value, datetime):
        return value.isoformat()
    raise TypeError(f"{type(value).__name__} has no JSON form")


def _entry(name: str, kind: int) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name, _EPOCH)
    info.compress_type = kind
    return info


def source_of(path: str | Path | BinaryIO) -> str:
    """Returns what messages call a file."""
    return str(getattr(path, "name", path))
