"""Workspaces on SQLite and on a real PostgreSQL, for the same tests."""

from __future__ import annotations

import importlib.util
import sys
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from sqlalchemy import create_engine, make_url, text

from robotrue.store.workspace import Workspace

sys.path.insert(0, str(Path(__file__).parent))

_AT = Path(__file__).resolve().parents[2] / "scripts" / "temporary_postgres.py"
_SPEC = importlib.util.spec_from_file_location("temporary_postgres", _AT)
assert _SPEC is not None
assert _SPEC.loader is not None
temporary_postgres = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(temporary_postgres)

NewUrl = Callable[[], str | None]


@pytest.fixture(scope="session")
def server() -> Iterator[str]:
    try:
        temporary_postgres.programs()
    except temporary_postgres.NotInstalled as missing:
        pytest.skip(str(missing))
    with temporary_postgres.running() as url:
        yield url


@pytest.fixture(params=["sqlite", "postgresql"])
def new_url(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> NewUrl:
    """Makes the URL of an empty database; None is the one in the folder."""
    monkeypatch.delenv("ROBOTRUE_DB", raising=False)
    if request.param == "sqlite":
        return lambda: None
    server = make_url(request.getfixturevalue("server"))

    def made() -> str:
        name = f"w{uuid.uuid4().hex}"
        engine = create_engine(server, isolation_level="AUTOCOMMIT")
        with engine.connect() as connection:
            connection.execute(text(f"CREATE DATABASE {name}"))
        engine.dispose()
        return server.set(database=name).render_as_string(hide_password=False)

    return made


@pytest.fixture
def url(new_url: NewUrl) -> str | None:
    return new_url()


@pytest.fixture
def workspace(tmp_path: Path, url: str | None) -> Iterator[Workspace]:
    with Workspace.create(tmp_path / "shop", url) as made:
        yield made
