"""The bin: only what was deleted, is old enough and carries nothing goes; the rest stays whole."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path

import pytest
from sqlalchemy import update
from test_items import some_poses

from robotrue.errors import ConfigurationError
from robotrue.store import bin as store_bin
from robotrue.store import documents, items, jobs, journal, measurements
from robotrue.store.bin import empty_bin, in_bin
from robotrue.store.locks import POSIX, hold_shared
from robotrue.store.nouns import DOCUMENT, MEASUREMENT
from robotrue.store.records import Link
from robotrue.store.verify import verify
from robotrue.store.workspace import LOCK, Workspace, now

pytestmark = pytest.mark.skipif(not POSIX, reason="needs locks of files: Linux or macOS")


def a_file(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text)
    return folder / name


def aged(workspace: Workspace, days: float) -> None:
    """Makes everything in the workspace older."""
    with workspace.write() as into:
        for table in (DOCUMENT.table, MEASUREMENT.table):
            into.session.execute(update(table).values(created=now() - timedelta(days=days)))


def names(found: tuple[store_bin.Discarded, ...]) -> set[str]:
    return {each.name for each in found}


def test_what_nothing_rests_on_goes_with_its_files(workspace: Workspace, tmp_path: Path) -> None:
    both = a_file(tmp_path, "both.csv", "shared")
    own = a_file(tmp_path, "own.csv", "own")
    old = documents.add(workspace, "plan", name="old", files=[own, both])
    documents.add(workspace, "plan", name="old again", files=[own], id=old.id)
    kept = documents.add(workspace, "plan", name="kept", files=[both])
    items.delete(workspace, DOCUMENT, old.id)
    aged(workspace, 31.0)
    recent = documents.add(workspace, "plan", name="recent")
    items.delete(workspace, DOCUMENT, recent.id)
    listed = in_bin(workspace, days=30.0)
    assert names(listed.items) == {"old again"}
    assert (listed.files, listed.bytes) == (1, 3)
    assert empty_bin(workspace, days=30.0) == listed
    with pytest.raises(ConfigurationError, match="there is no document"):
        items.get(workspace, DOCUMENT, old.id)
    assert items.get(workspace, DOCUMENT, recent.id).deleted
    assert [f.name for f in items.get(workspace, DOCUMENT, kept.id).attachments] == ["both.csv"]
    found = verify(workspace)
    assert (found.faults, found.unnamed, found.files) == ((), (), 1)
    assert journal.entries(workspace, item=old.id).items[0].action == "discarded"
    assert empty_bin(workspace, days=30.0).items == ()


def test_what_a_lineage_or_a_job_needs_stays(workspace: Workspace, tmp_path: Path) -> None:
    raw = a_file(tmp_path, "a.csv", "raw")
    data = measurements.add(workspace, some_poses(), name="data", raw=[raw])
    between = documents.add(workspace, "x", name="between", about=[Link(role="data", to=data.ref)])
    living = documents.add(workspace, "x", name="living", about=[Link(role="x", to=between.ref)])
    asked = documents.add(workspace, "x", name="asked for")
    for noun, id in ((MEASUREMENT, data.id), (DOCUMENT, between.id), (DOCUMENT, asked.id)):
        items.delete(workspace, noun, id)
    job = jobs.submit(workspace, "any", {"about": [asked.id[:8]]})
    aged(workspace, 1.0)
    found = empty_bin(workspace, days=0.5)
    assert found.items == ()
    assert names(found.needed) == {"data", "between", "asked for"}
    items.delete(workspace, DOCUMENT, living.id)
    jobs.cancel(workspace, job)
    assert names(empty_bin(workspace, days=0.0).items) == {"data", "between", "asked for", "living"}
    found_whole = verify(workspace)
    assert (found_whole.faults, found_whole.unnamed, found_whole.files) == ((), (), 0)


def test_one_that_is_killed_in_it_leaves_all_or_what_is_swept(
    workspace: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = documents.add(workspace, "x", name="old", files=[a_file(tmp_path, "o.csv", "o")])
    items.delete(workspace, DOCUMENT, old.id)

    def killed(*_: object, **__: object) -> int:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(store_bin.journal, "record", killed)  # before the rows are gone
        with pytest.raises(KeyboardInterrupt):
            empty_bin(workspace, days=0.0)
    Workspace.open(workspace.folder, workspace.url).close()
    assert verify(workspace).faults == ()
    assert items.get(workspace, DOCUMENT, old.id).deleted
    with monkeypatch.context() as patched:
        patched.setattr(store_bin, "sweep", killed)  # before the files are
        with pytest.raises(KeyboardInterrupt):
            empty_bin(workspace, days=0.0)
    assert len(verify(workspace).unnamed) == 1
    Workspace.open(workspace.folder, workspace.url).close()
    found = verify(workspace)
    assert (found.faults, found.unnamed, found.files) == ((), (), 0)


@contextmanager
def somebody_writes(workspace: Workspace) -> Iterator[None]:
    with hold_shared(workspace.folder / LOCK):
        yield


def test_it_waits_for_nobody_and_takes_no_odd_days(workspace: Workspace) -> None:
    with (
        somebody_writes(workspace),
        pytest.raises(ConfigurationError, match="another process is importing files"),
    ):
        empty_bin(workspace, days=0.0)
    for days in (-1.0, float("nan"), 1e9):
        with pytest.raises(ConfigurationError, match="days since the deletion"):
            in_bin(workspace, days=days)
