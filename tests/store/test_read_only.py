"""A workspace that this user may only read: listed, verified, and not changed."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from robotrue.errors import ConfigurationError
from robotrue.store import documents, items
from robotrue.store.nouns import DOCUMENT
from robotrue.store.records import ItemQuery
from robotrue.store.verify import verify
from robotrue.store.workspace import Workspace

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs users and modes of POSIX")
NOBODY = 65534


@pytest.fixture
def folder() -> Iterator[Path]:
    """A place that other users can reach, unlike those of pytest."""
    with tempfile.TemporaryDirectory() as place:
        Path(place).chmod(0o755)
        yield Path(place) / "a shop?"


@contextlib.contextmanager
def reading_only(folder: Path) -> Iterator[None]:
    """Nothing in the folder may be written to; root may always, so it becomes somebody else."""
    every = [folder, *folder.rglob("*")]
    modes = {each: each.stat().st_mode for each in every}
    for each in every:
        each.chmod(0o555 if each.is_dir() else 0o444)
    root = os.geteuid() == 0
    try:
        if root:
            os.seteuid(NOBODY)
        yield
    finally:
        if root:
            os.seteuid(0)
        for each, mode in modes.items():
            if each.exists():
                each.chmod(mode)


def names(folder: Path) -> list[str]:
    with Workspace.open(folder) as workspace:
        return [each.name for each in items.search(workspace, DOCUMENT, ItemQuery()).items]


def test_a_workspace_is_read_where_it_cannot_be_written(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "part.txt").write_text("content")
    with Workspace.create(folder) as workspace:
        documents.add(workspace, "note", name="first", files=[tmp_path / "part.txt"])
    before = sorted(each.name for each in folder.rglob("*"))
    with reading_only(folder):
        assert names(folder) == ["first"]
        with Workspace.open(folder) as workspace:
            assert verify(workspace).faults == ()
            for files in ([], [__file__]):
                with pytest.raises(ConfigurationError, match="read-only for this user"):
                    documents.add(workspace, "note", name="second", files=list(map(Path, files)))
    assert sorted(each.name for each in folder.rglob("*")) == before
    with Workspace.open(folder) as workspace:
        documents.add(workspace, "note", name="second")


def test_what_another_process_writes_meanwhile_is_seen(folder: Path) -> None:
    with Workspace.create(folder) as workspace:
        documents.add(workspace, "note", name="first")
        with reading_only(folder):
            assert names(folder) == ["first"]
        documents.add(workspace, "note", name="second")
        with reading_only(folder):
            assert sorted(names(folder)) == ["first", "second"]


def test_an_older_workspace_is_not_brought_up_to_date(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Workspace.create(folder).close()
    monkeypatch.setattr("robotrue.store.workspace.HEAD", "newer")
    with (
        reading_only(folder),
        pytest.raises(ConfigurationError, match="of an older robotrue, and read-only"),
    ):
        Workspace.open(folder)
