"""A whole workspace from one file, checked before anything of it stands.

The file is a stranger's until it is proven. Rows are read into a database of their own, of the
schema they were written with, brought up to date there, and only then merged. Ids stay; what is
there already stays as it is.
"""

from __future__ import annotations

import json
import re
import tempfile
import zipfile
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO, Final, cast

from sqlalchemy import (
    Connection,
    DateTime,
    MetaData,
    Table,
    func,
    insert,
    select,
    tuple_,
    update,
)
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.store import journal
from robotrue.store.database import engine_at
from robotrue.store.exchange import Carried, source_of, tables
from robotrue.store.exchange_archive import (
    BROKEN,
    MOST,
    damaged,
    manifest_of,
    member,
    require_members,
)
from robotrue.store.jobs import OVER
from robotrue.store.layout import require_name
from robotrue.store.migrate import migrate
from robotrue.store.nouns import NOUNS
from robotrue.store.schema import Base
from robotrue.store.workspace import Workspace, writing

_ID: Final = re.compile(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")
_BATCH: Final = 500


def import_project(
    workspace: Workspace, path: str | Path | BinaryIO, *, most: int = MOST
) -> Carried:
    """Returns what was taken in from a file that an export wrote; all of it or nothing.

    Args:
        workspace: Into which; items it has already stay as they are.
        path: The file.
        most: Bytes it may expand to.

    Raises:
        ArchiveError: Not an export, damaged, of a newer robotrue, or more than may be.
        ModelMismatchError: The same version of an item says something else here.
        FormatError: The workspace cannot be written to.
    """
    source = source_of(path)
    try:
        with zipfile.ZipFile(path) as bundle:
            manifest = manifest_of(bundle, source)
            require_members(bundle, manifest["members"], source, most, workspace.folder)
            with tempfile.TemporaryDirectory(dir=workspace.folder) as folder:
                return _taken(workspace, bundle, manifest, source, Path(folder))
    except BROKEN as cause:
        raise damaged(source, str(cause)) from cause


def _taken(
    workspace: Workspace,
    bundle: zipfile.ZipFile,
    manifest: Mapping[str, Any],
    source: str,
    folder: Path,
) -> Carried:
    members = manifest["members"]
    engine = engine_at(folder, None)
    try:
        with writing(engine) as connection:
            migrate(connection, manifest["schema"])
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
                rows = _merged(into.session, connection, source)
            detail = {"from": manifest.get("workspace"), "rows": rows, "files": len(files)}
            journal.record(into, "imported", "workspace", workspace.id, detail=detail)
    except SQLAlchemyError as cause:
        raise damaged(source, f"its rows do not fit together: {type(cause).__name__}") from cause
    finally:
        engine.dispose()
    size = sum(members[name]["size"] for name in files)
    return Carried(rows=rows, files=len(files), bytes=size)


def _read_tables(
    bundle: zipfile.ZipFile, members: Mapping[str, Any], connection: Connection, source: str
) -> None:
    """Fills a database of the schema the rows were written with."""
    found = MetaData()
    found.reflect(connection)
    stated = {name[7:-6] for name in members if name.startswith("tables/")}
    order = [each for each in found.sorted_tables if each.name in stated]
    if len(order) != len(stated):
        raise damaged(source, "it holds a table that is none")
    for table in order:
        name = f"tables/{table.name}.jsonl"
        with member(bundle, name, members[name], source) as stream:
            batch: list[dict[str, Any]] = []
            while line := stream.readline():
                batch.append(_row(table, line, source))
                if len(batch) == _BATCH:
                    connection.execute(insert(table), batch)
                    batch = []
            if batch:
                connection.execute(insert(table), batch)


def _row(table: Table, line: bytes, source: str) -> dict[str, Any]:
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
        raise damaged(source, f"a row of {table.name} is none ({cause})") from cause
    return stated


def _require_sound(connection: Connection, members: Mapping[str, Any], source: str) -> None:
    """Refuses rows that no robotrue writes, whatever their hash."""
    held = Base.metadata.tables
    blobs = {f"{r.place}/{r.sha256}" for r in connection.execute(select(held["blobs"]))}
    if blobs != {name for name in members if not name.startswith("tables/")}:
        raise damaged(source, "its files are not those its rows name")
    jobs = connection.execute(select(held["jobs"].c.id, held["jobs"].c.state)).all()
    items = connection.execute(select(held["items"].c.id, held["items"].c.noun)).all()
    if any(state not in OVER for _, state in jobs) or any(noun not in NOUNS for _, noun in items):
        raise damaged(source, "it holds a job that is not over, or a noun that is none")
    if not all(_ID.fullmatch(row.id) for row in (*jobs, *items)):
        raise damaged(source, "it holds an id that is none")
    try:
        for (name,) in connection.execute(select(held["attachments"].c.name)):
            require_name(name)
    except ConfigurationError as cause:
        raise damaged(source, cause.message) from cause


def _merged(session: Session, staged: Connection, source: str) -> dict[str, int]:
    """Adds what is not there; returns how many rows of each table."""
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
    session: Session, table: Table, key: list[str], rows: list[dict[str, Any]], source: str
) -> list[dict[str, Any]]:
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
                f"{table.name} {each[0]} is here already and says something else "
                f"({differing[0]}): both were changed since they were one.",
                source=source,
                hint="import it into a workspace of its own.",
            )
    return new


def _only_one_latest(session: Session, table: Table) -> None:
    """Of an item that came with more versions than were here, or with fewer, the last is latest."""
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
