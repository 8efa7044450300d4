"""The connection to a workspace's database: SQLite in its folder, or PostgreSQL by URL."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from sqlalchemy import URL, Connection, Engine, create_engine, event, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError

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
        engine = create_engine(stated)
        _as_sqlite(engine)
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


def _as_sqlite(engine: Engine) -> None:
    """Readers never wait for a writer, a writer that has begun never fails half-way."""

    @event.listens_for(engine, "connect")
    def _connected(connection: Any, _record: object) -> None:
        connection.isolation_level = None  # transactions begin as said below, not by the driver
        cursor = connection.cursor()
        for pragma in (
            f"busy_timeout={BUSY_MS}",
            "journal_mode=WAL",
            "synchronous=FULL",
            "foreign_keys=ON",
            "trusted_schema=OFF",
        ):
            cursor.execute(f"PRAGMA {pragma}")
        cursor.close()

    @event.listens_for(engine, "begin")
    def _begun(connection: Connection) -> None:
        writing = connection.get_execution_options().get(WRITING, False)
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writing else "BEGIN")


def unreachable(cause: DBAPIError, folder: Path) -> DatabaseDownError:
    """Returns the error for a database that does not answer, without its URL."""
    said = str(cause.orig).strip() or "it does not say why"
    return DatabaseDownError(
        f"the database does not answer ({said.splitlines()[0]}).",
        source=folder,
        hint="see that it runs, and what ROBOTRUE_DB says.",
    )
