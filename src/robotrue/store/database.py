"""The connection to a workspace's database: SQLite in its folder, or PostgreSQL by URL."""

from __future__ import annotations

import os
import sqlite3
from importlib.util import find_spec
from pathlib import Path
from typing import Final
from urllib.parse import quote

from sqlalchemy import URL, Connection, Engine, create_engine, event, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError
from sqlalchemy.pool import NullPool

from robotrue.errors import ConfigurationError, DatabaseDownError, MissingExtraError

FILE: Final = "robotrue.db"
BUSY_MS: Final = 60_000
"""How long a writer waits for another one."""
WRITING: Final = "robotrue_writing"
"""Execution option of connections that will write."""


def engine_at(folder: Path, url: str | None) -> Engine:
    """Returns the engine of the workspace in a folder; ``url`` names another database than its own.

    Raises:
        ConfigurationError: Not a URL of SQLite or PostgreSQL.
        MissingExtraError: The driver of PostgreSQL is not installed.
    """
    stated = URL.create("sqlite", database=str(folder / FILE)) if url is None else _url(url)
    if stated.get_backend_name() == "sqlite":
        file = Path(stated.database or "")
        writable = not file.exists() or (may_write(file) and may_write(file.absolute().parent))
        if writable:
            engine = create_engine(stated)
        else:
            engine = create_engine(stated, creator=lambda: _read_only(file), poolclass=NullPool)
        _as_sqlite(engine, writable=writable)
        return engine
    if stated.get_driver_name() == "psycopg" and find_spec("psycopg") is None:
        raise MissingExtraError(
            "a PostgreSQL database was named, and the package psycopg is not installed.",
            hint="pip install 'robotrue[postgres]'.",
        )
    return create_engine(stated, pool_pre_ping=True)


def _url(text: str) -> URL:
    try:
        url = make_url(text)
    except ArgumentError:
        url = None
    if url is None or url.drivername not in ("postgresql+psycopg", "sqlite"):
        # The text may hold a password: it is not repeated.
        raise ConfigurationError(
            "the URL of the database is not one of postgresql+psycopg or sqlite.",
            hint="ROBOTRUE_DB=postgresql+psycopg://user@host/database",
        )
    return url


def may_write(path: Path) -> bool:
    """Returns whether this process may write to a file, or make files in a folder."""
    return os.access(path, os.W_OK, effective_ids=os.access in os.supports_effective_ids)


def _read_only(file: Path) -> sqlite3.Connection:
    """Opens a database next to which SQLite cannot create the files of its log.

    While another process has it open, the files exist and are used. If they do not exist, it is not
    open elsewhere: only then may SQLite treat it as an immutable file.
    """
    log = file.with_name(f"{file.name}-wal")
    options = "mode=ro" if log.exists() else "mode=ro&immutable=1"
    address = f"file:{quote(str(file.absolute()))}?{options}"
    return sqlite3.connect(address, uri=True, check_same_thread=False)


def _as_sqlite(engine: Engine, *, writable: bool) -> None:
    """Configures SQLite: readers never wait for a writer, a started writer never fails half-way."""

    @event.listens_for(engine, "connect")
    def _set_pragmas(connection: sqlite3.Connection, _record: object) -> None:
        connection.isolation_level = None  # transactions begin as said below, not by the driver
        cursor = connection.cursor()
        for pragma in (
            f"busy_timeout={BUSY_MS}",
            "journal_mode=WAL" if writable else "query_only=ON",
            "synchronous=FULL",
            "foreign_keys=ON",
            "trusted_schema=OFF",
        ):
            cursor.execute(f"PRAGMA {pragma}")
        cursor.close()

    @event.listens_for(engine, "begin")
    def _begin(connection: Connection) -> None:
        writing = connection.get_execution_options().get(WRITING, False)
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writing else "BEGIN")


def read_only(folder: Path) -> ConfigurationError:
    """Returns the error for a change in a workspace that this user may only read."""
    return ConfigurationError(
        "the workspace is read-only for this user.",
        source=folder,
        hint="write access to the folder and to all in it.",
    )


def unreachable(cause: DBAPIError, folder: Path) -> ConfigurationError:
    """Returns the error for a database that does not answer, or may only be read; it has no URL."""
    if "readonly database" in str(cause.orig):
        return read_only(folder)
    said = str(cause.orig).strip() or "it does not say why"
    return DatabaseDownError(
        f"the database does not answer ({said.splitlines()[0]}).",
        source=folder,
        hint="check that it runs, and the value of ROBOTRUE_DB.",
    )
