"""Databases of every schema so far open, with everything in them; the tables are what is said."""

from __future__ import annotations

import json
import shutil
import sqlite3
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import insert, text

from robotrue.errors import ArchiveError, ConfigurationError, MissingExtraError
from robotrue.store import documents, items, jobs, journal, migrate, workspace
from robotrue.store.database import engine_at
from robotrue.store.nouns import DOCUMENT, ROBOT
from robotrue.store.records import ItemQuery
from robotrue.store.schema import Base, WorkspaceRow
from robotrue.store.workspace import Workspace, now, writing

NewUrl = Callable[[], str | None]
FIRST = Path(__file__).parents[1] / "archives" / "workspace_0001.sql"
SECOND = """
import sqlalchemy as sa
from alembic import op

revision, down_revision, branch_labels, depends_on = "0002", "0001", None, None

def upgrade():
    with op.batch_alter_table("documents") as table:
        table.add_column(sa.Column("language", sa.String(8), nullable=False, server_default="en"))
"""


def of_first_schema(folder: Path) -> Path:
    """A workspace folder as the first schema left it."""
    folder.mkdir()
    with closing(sqlite3.connect(folder / "robotrue.db")) as database:
        database.executescript(FIRST.read_text())
        (id,) = database.execute("SELECT id FROM workspace").fetchone()
    mark = {"format": "robotrue-workspace", "format_version": 1, "id": id}
    (folder / "workspace.json").write_text(json.dumps(mark))
    return folder


def require_content(opened: Workspace) -> None:
    page = items.search(opened, DOCUMENT, ItemQuery())
    assert [(each.name, each.version) for each in page.items] == [("to the customer, signed", 2)]
    (plan,) = page.items[0].refs("plan")
    gone = items.versions(opened, DOCUMENT, plan.id)
    assert [(each.deleted, each.detail) for each in gone] == [
        (False, {"poses": 30}),
        (True, {"poses": 30}),
    ]
    assert items.undo(opened, DOCUMENT, plan.id).note == "cold"
    assert items.search(opened, ROBOT, ItemQuery(where={"dof": 6})).total == 1
    assert jobs.search(opened, state="queued").items[0].parameters["poses"] == 30
    assert journal.entries(opened).total == 7


def test_the_first_schema_opens(tmp_path: Path) -> None:
    with Workspace.open(of_first_schema(tmp_path / "old")) as opened:
        require_content(opened)
        assert documents.add(opened, "plan", name="new").version == 1


def test_the_tables_are_those_of_the_migrations(workspace: Workspace) -> None:
    with workspace.engine.connect() as connection:
        assert migrate.revision_of(connection) == migrate.HEAD
        assert compare_metadata(MigrationContext.configure(connection), Base.metadata) == []


@pytest.fixture
def newer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A robotrue that has one schema more."""
    package = tmp_path / "package"
    shutil.copytree(Path(migrate.__file__).parent / "migrations", package / "migrations")
    (package / "migrations" / "versions" / "second.py").write_text(SECOND)
    monkeypatch.setattr(migrate, "files", lambda _: package)
    for module in (migrate, workspace):
        monkeypatch.setattr(module, "HEAD", "0002")
    monkeypatch.setattr(migrate.migrate, "__defaults__", ("0002",))


@pytest.mark.usefixtures("newer")
def test_an_older_schema_is_brought_up_to_date_once(tmp_path: Path) -> None:
    folder = of_first_schema(tmp_path / "old")
    faults: list[BaseException] = []

    def open_it() -> None:
        try:
            Workspace.open(folder).close()
        except BaseException as fault:
            faults.append(fault)

    threads = [threading.Thread(target=open_it) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert faults == []
    with Workspace.open(folder) as opened:
        with opened.engine.connect() as connection:
            found = connection.execute(text("SELECT language FROM documents")).scalars().all()
        assert found == ["en"] * 4


@pytest.mark.usefixtures("newer")
def test_an_older_schema_on_either_database(tmp_path: Path, new_url: NewUrl) -> None:
    url = new_url()
    engine = engine_at(tmp_path, url)
    with writing(engine) as connection:
        migrate.migrate(connection, "0001")
        row = {"id": "5d633ed4", "created": now(), "made_by": "0.1.0"}
        connection.execute(insert(WorkspaceRow), row)
    engine.dispose()
    mark = {"format": "robotrue-workspace", "format_version": 1, "id": "5d633ed4"}
    (tmp_path / "workspace.json").write_text(json.dumps(mark))
    with Workspace.open(tmp_path, url) as opened:
        with opened.engine.connect() as connection:
            assert migrate.revision_of(connection) == "0002"


def test_a_newer_schema_is_refused(own_workspace: Workspace) -> None:
    with own_workspace.engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    with pytest.raises(ArchiveError, match="schema 9999, this robotrue reads up to 0001"):
        Workspace.open(own_workspace.folder, own_workspace.url)


@pytest.mark.parametrize(
    ("mark", "message"),
    [
        ("{", "mark of the workspace is damaged"),
        ('{"format": "robotrue-workspace", "format_version": 2, "id": "x"}', "format 2"),
        ('{"format": "other", "format_version": 1, "id": "x"}', "format 1"),
    ],
)
def test_a_damaged_mark_is_refused(tmp_path: Path, mark: str, message: str) -> None:
    folder = of_first_schema(tmp_path / "old")
    (folder / "workspace.json").write_text(mark)
    with pytest.raises(ArchiveError, match=message):
        Workspace.open(folder)


def test_urls_are_checked_and_never_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = of_first_schema(tmp_path / "old")
    for url in ("mysql://me:secret@host/db", "secret nonsense"):
        with pytest.raises(ConfigurationError, match="not one of postgresql") as caught:
            Workspace.open(folder, url)
        assert "secret" not in str(caught.value)
    dead = "postgresql+psycopg://me:secret@127.0.0.1:9/db?connect_timeout=2"
    with pytest.raises(ConfigurationError, match="does not answer") as caught:
        Workspace.open(folder, dead)
    assert "secret" not in str(caught.value)
    monkeypatch.setenv("ROBOTRUE_DB", dead)
    with pytest.raises(ConfigurationError, match="does not answer"):
        Workspace.open(folder)
    monkeypatch.setattr("robotrue.store.database.find_spec", lambda _: None)
    with pytest.raises(MissingExtraError, match="psycopg is not installed"):
        Workspace.open(folder)
