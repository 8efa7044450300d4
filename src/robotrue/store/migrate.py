"""The schema of a database brought up to date, from any version on."""

from __future__ import annotations

import logging
from importlib.resources import as_file, files
from typing import Final

from sqlalchemy import Connection, inspect, text

from robotrue.errors import ArchiveError

HEAD: Final = "0001"
"""The newest revision in ``migrations/versions``."""
_LOCK: Final = 0x726F626F  # any number, the same in every robotrue


def revision_of(connection: Connection) -> str | None:
    """Returns the revision of the schema; None where there is none yet."""
    if not inspect(connection).has_table("alembic_version"):
        return None
    found = connection.execute(text("SELECT version_num FROM alembic_version")).scalar()
    return None if found is None else str(found)


def migrate(connection: Connection, to: str = HEAD) -> None:
    """Brings the schema to a revision, all of it or nothing, within the caller's transaction.

    Raises:
        ArchiveError: The schema is newer than this robotrue.
    """
    if connection.dialect.name == "postgresql":
        connection.execute(text("SELECT pg_advisory_xact_lock(:number)"), {"number": _LOCK})
    found = revision_of(connection)
    if found == to:
        return
    require_known(found)
    from alembic import command
    from alembic.config import Config

    logging.getLogger("alembic").setLevel(logging.WARNING)
    with as_file(files("robotrue.store") / "migrations") as folder:
        config = Config()
        config.set_main_option("script_location", str(folder).replace("%", "%%"))
        config.attributes["connection"] = connection
        command.upgrade(config, to)


def require_known(revision: str | None) -> None:
    """Passes if this robotrue can read a schema.

    Raises:
        ArchiveError: It is newer.
    """
    if revision is not None and revision > HEAD:
        raise ArchiveError(
            f"the workspace has schema {revision}, this robotrue reads up to {HEAD}.",
            hint="update robotrue.",
        )
