"""Workspaces on SQLite and on a real PostgreSQL, for the same tests."""

from __future__ import annotations

import importlib.util
import os
import shutil
import sys
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from sqlalchemy import create_engine, make_url, text

from robotrue.store.schema import Base
from robotrue.store.workspace import Workspace

sys.path.insert(0, str(Path(__file__).parent))

_AT = Path(__file__).resolve().parents[2] / "scripts" / "temporary_postgres.py"
_SPEC = importlib.util.spec_from_file_location("temporary_postgres", _AT)
assert _SPEC is not None
assert _SPEC.loader is not None
temporary_postgres = importlib.util.module_from_spec(_SPEC)
sys.modules[_SPEC.name] = temporary_postgres
_SPEC.loader.exec_module(temporary_postgres)

os.environ.pop("ROBOTRUE_DB", None)  # a developer's own is left alone
NewUrl = Callable[[], str | None]
ENGINES = ("sqlite", "postgresql")


@pytest.fixture(scope="session")
def server() -> Iterator[str]:
    try:
        temporary_postgres.programs()
    except temporary_postgres.NotInstalled as missing:
        pytest.skip(str(missing))
    with temporary_postgres.running() as url:
        yield url


def database(server: str) -> str:
    """Returns the URL of a new database."""
    name = f"w{uuid.uuid4().hex}"
    engine = create_engine(server, isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(text(f"CREATE DATABASE {name}"))
    engine.dispose()
    return make_url(server).set(database=name).render_as_string(hide_password=False)


@pytest.fixture(params=ENGINES)
def new_url(request: pytest.FixtureRequest) -> NewUrl:
    """Makes the URL of an empty database; None is the one in the folder."""
    if request.param == "sqlite":
        return lambda: None
    server = request.getfixturevalue("server")
    return lambda: database(server)


@pytest.fixture(scope="session")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, str | None]]:
    """Workspaces that were just made, to be copied or emptied: making one takes longer."""
    return {}


@pytest.fixture(params=ENGINES)
def workspace(
    request: pytest.FixtureRequest,
    tmp_path: Path,
    tmp_path_factory: pytest.TempPathFactory,
    fresh: dict[str, tuple[Path, str | None]],
) -> Iterator[Workspace]:
    """An empty workspace; its schema must stay as it is."""
    server = None if request.param == "sqlite" else request.getfixturevalue("server")
    if request.param not in fresh:
        folder = tmp_path_factory.mktemp("fresh") / "shop"
        url = None if server is None else database(server)
        Workspace.create(folder, url).close()
        fresh[request.param] = (folder, url)
    folder, url = fresh[request.param]
    shutil.copytree(folder, tmp_path / "shop")
    with Workspace.open(tmp_path / "shop", url) as opened:
        if url is not None:
            names = [each for each in Base.metadata.tables if each != "workspace"]
            with opened.engine.begin() as connection:
                connection.execute(text(f"TRUNCATE {', '.join(names)} RESTART IDENTITY"))
        yield opened


@pytest.fixture
def own_workspace(tmp_path: Path, new_url: NewUrl) -> Iterator[Workspace]:
    """A workspace with a database of its own."""
    with Workspace.create(tmp_path / "own", new_url()) as made:
        yield made
