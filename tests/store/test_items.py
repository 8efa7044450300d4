"""Items of a workspace: added, listed, changed, deleted, brought back, on both databases."""

from __future__ import annotations

import threading
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from robotrue.core.conditions import Rail
from robotrue.errors import ArchiveError, ConfigurationError, ImplausibleDataError, RobotrueError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.store import (
    cells,
    documents,
    items,
    jobs,
    journal,
    measurements,
    programs,
    registrations,
)
from robotrue.store.measurements import RowQuery
from robotrue.store.nouns import CELL, DOCUMENT, DRIFT_CHECK, MEASUREMENT, PROGRAM, ROBOT, TOOL
from robotrue.store.records import ItemQuery, Link, Ref, links_to
from robotrue.store.verify import verify
from robotrue.store.workspace import Workspace

CELL_TEXT = """schema = 1
[robot]
preset = "KUKA KR160 R1570"
[tool]
xyz_mm = [60, 40, 250]
[tracker]
frame = "base"
sigma_um = 5
"""
PROGRAM_TEXT = "DEF part()\nPTP {A1 0,A2 -80,A3 80,A4 0,A5 40,A6 0}\nEND\n"


def some_poses(n: int = 20, seed: int = 1) -> MeasurementSet:
    rng = np.random.default_rng(seed)
    covariance = np.broadcast_to(np.eye(3) * 1e-10, (n, 3, 3))
    rotation = np.full((n, 3, 3), np.nan)
    rotation[::2] = np.eye(3)
    return MeasurementSet(
        joints=rng.random((n, 6)),
        position=rng.random((n, 3)),
        covariance=covariance,
        rotation=rotation,
        station=np.arange(n) % 3,
        group=np.arange(n) % 2,
        group_names=("a.csv", "b.csv"),
        sources=("a.csv sha256:ab", "b.csv sha256:cd"),
    )


def a_document(workspace: Workspace, name: str, **more: object) -> str:
    return documents.add(workspace, "plan", name=name, **more).id  # type: ignore[arg-type]


def test_what_is_stored_can_be_read_by_all_and_written_by_nobody(
    workspace: Workspace, tmp_path: Path
) -> None:
    (tmp_path / "notes.txt").write_text("measured twice")
    record = items.get(
        workspace, DOCUMENT, a_document(workspace, "Notes", files=[tmp_path / "notes.txt"])
    )
    stored = workspace.path_of(record.files("file")[0].sha256)
    assert stored.read_text() == "measured twice"
    assert stored.stat().st_mode & 0o777 == 0o444


def test_measurements_come_back_bit_for_bit(workspace: Workspace, tmp_path: Path) -> None:
    raw = tmp_path / "grid.csv"
    raw.write_bytes(b"1,2,3\n")
    poses = some_poses()
    made = measurements.add(workspace, poses, name="grid", raw=[raw], note="warm")
    assert (made.poses, made.dof, made.full_poses, made.frame) == (20, 6, 10, "base")
    assert workspace.content(made.files("raw")[0].sha256) == b"1,2,3\n"
    back = measurements.rows_of(workspace, items.get(workspace, MEASUREMENT, made.id))
    for field in fields(MeasurementSet):
        expected, found = getattr(poses, field.name), getattr(back, field.name)
        if isinstance(expected, np.ndarray):
            np.testing.assert_array_equal(found, expected, err_msg=field.name)
            assert found.dtype == expected.dtype
        else:
            assert found == expected


def test_conditions_and_a_rail_come_back(workspace: Workspace) -> None:
    poses = some_poses()
    rail = Rail(number=1, direction=np.array([0.0, 1.0, 0.0]), at=0.25)
    external = np.full((len(poses), 6), np.nan)
    external[:, 0] = np.linspace(0.0, 3.0, len(poses))
    told = replace(poses, external=external, rail=rail, time=np.arange(20.0))
    made = measurements.add(workspace, told, name="rail")
    back = measurements.rows_of(workspace, items.get(workspace, MEASUREMENT, made.id))
    np.testing.assert_array_equal(back.external, external)
    np.testing.assert_array_equal(back.time, told.time)
    assert back.rail is not None
    assert back.rail.document() == rail.document()


def test_rows_are_filtered_sorted_and_paged(workspace: Workspace) -> None:
    poses = some_poses(50)
    made = measurements.add(workspace, poses, name="grid")
    query = RowQuery(where=(("station", "==", 1.0),), sort="-position_x", offset=2, limit=5)
    page = measurements.some_rows(workspace, made, query)
    expected = np.flatnonzero(poses.station == 1)
    expected = expected[np.argsort(-poses.position[expected, 0])]
    assert page.total == len(expected)
    np.testing.assert_array_equal(page.index, expected[2:7])
    np.testing.assert_array_equal(page.columns["joints_3"], poses.joints[expected[2:7], 2])
    with pytest.raises(ConfigurationError, match="no column 'nonsense'"):
        measurements.some_rows(workspace, made, RowQuery(columns=("nonsense",)))


def test_an_empty_set_is_refused(workspace: Workspace) -> None:
    with pytest.raises(ImplausibleDataError, match="without rows"):
        measurements.add(workspace, some_poses().subset(np.zeros(20, dtype=bool)), name="none")


def test_a_cell_brings_its_arm_and_tool_once(workspace: Workspace, tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(CELL_TEXT)
    first = cells.add(workspace, path, name="left")
    second = cells.add(workspace, path, name="right")
    assert items.search(workspace, CELL, ItemQuery(sort="name")).total == 2
    assert items.search(workspace, ROBOT, ItemQuery()).items[0].name == "KUKA KR160 R1570"
    assert items.search(workspace, TOOL, ItemQuery()).total == 1
    assert first.refs("robot") == second.refs("robot")
    (tmp_path / "out").mkdir()
    assert cells.copy_cell(workspace, first, tmp_path / "out").read_text() == CELL_TEXT
    changed = cells.add(workspace, path, name="left again", id=first.id)
    assert (changed.version, changed.name) == (2, "left again")
    assert [each.name for each in items.versions(workspace, CELL, first.id)] == [
        "left",
        "left again",
    ]


def test_a_cells_files_come_along_wherever_they_lie(workspace: Workspace, tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    config = b"DEFDAT $CONFIG PUBLIC\nBASE_DATA[1]={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n"
    (tmp_path / "b" / "$config.dat").write_bytes(config)
    text = CELL_TEXT + '[controller]\nfiles = ["../b/$config.dat"]\n'
    (tmp_path / "a" / "cell.toml").write_text(text)
    made = cells.add(workspace, tmp_path / "a" / "cell.toml")
    (tmp_path / "out").mkdir()
    path = cells.copy_cell(workspace, made, tmp_path / "out")
    assert 'files = ["$config.dat"]' in path.read_text()
    assert (tmp_path / "out" / "$config.dat").read_bytes() == config


def test_programs_before_and_after(workspace: Workspace, tmp_path: Path) -> None:
    path = tmp_path / "part.src"
    path.write_text(PROGRAM_TEXT)
    before = programs.add(workspace, [path])
    assert (before.stage, before.dialect, before.file_count) == ("before", "krl", 1)
    after = programs.add_after(workspace, [path], before=before.ref, model=None, detail={"n": 1})
    assert items.search(workspace, PROGRAM, ItemQuery(where={"stage": "after"})).items == (after,)
    assert items.search(workspace, PROGRAM, ItemQuery(linked=("before", before.id))).total == 1
    with pytest.raises(ConfigurationError, match="of different names"):
        programs.add(workspace, [path, path])


def test_delete_and_undo_keep_every_version(workspace: Workspace) -> None:
    id = a_document(workspace, "plan", detail={"poses": 30})
    assert items.delete(workspace, DOCUMENT, id).deleted
    assert items.search(workspace, DOCUMENT, ItemQuery()).total == 0
    assert items.search(workspace, DOCUMENT, ItemQuery(deleted=True)).total == 1
    with pytest.raises(ConfigurationError, match="is deleted"):
        items.delete(workspace, DOCUMENT, id)
    with pytest.raises(ConfigurationError, match="is deleted"):
        items.change(workspace, DOCUMENT, id, name="x")
    back = items.undo(workspace, DOCUMENT, id)
    assert (back.version, back.deleted, back.detail) == (3, False, {"poses": 30})
    assert [each.deleted for each in items.versions(workspace, DOCUMENT, id)] == [
        False,
        True,
        False,
    ]
    actions = [entry.action for entry in journal.entries(workspace, item=id).items]
    assert actions == ["restored", "deleted", "added"]


def test_undo_brings_the_earlier_content_back(workspace: Workspace) -> None:
    id = a_document(workspace, "old")
    items.change(workspace, DOCUMENT, id, name="new", note="why")
    assert items.undo(workspace, DOCUMENT, id).name == "old"
    assert items.undo(workspace, DOCUMENT, id).name == "new"
    only = a_document(workspace, "only")
    with pytest.raises(ConfigurationError, match="nothing to undo"):
        items.undo(workspace, DOCUMENT, only)


def test_links_and_files_stay_with_every_version(workspace: Workspace, tmp_path: Path) -> None:
    (tmp_path / "plan.csv").write_text("a")
    data = measurements.add(workspace, some_poses(), name="grid")
    about = [Link(role="data", to=data.ref)]
    made = documents.add(workspace, "plan", name="p", files=[tmp_path / "plan.csv"], about=about)
    changed = items.change(workspace, DOCUMENT, made.id, name="q")
    assert changed.links == made.links
    assert changed.attachments == made.attachments
    lost = [Link(role="data", to=Ref(id=data.id, version=7))]
    with pytest.raises(ConfigurationError, match="no version 7 of measurement"):
        documents.add(workspace, "plan", name="p", about=lost)
    with pytest.raises(ConfigurationError, match="not in this workspace"):
        documents.add(
            workspace, "plan", name="p", about=[Link(role="data", to=Ref(id="x", version=1))]
        )


def test_lists_are_filtered_sorted_and_paged(workspace: Workspace) -> None:
    for k in range(25):
        documents.add(workspace, "plan" if k % 2 else "report", name=f"Item {k:02d}")
    page = items.search(workspace, DOCUMENT, ItemQuery(sort="-name", offset=5, limit=3))
    assert [each.name for each in page.items] == ["Item 19", "Item 18", "Item 17"]
    assert page.total == 25
    assert items.search(workspace, DOCUMENT, ItemQuery(text="item 0")).total == 10
    assert items.search(workspace, DOCUMENT, ItemQuery(text="item_0")).total == 0
    assert items.search(workspace, DOCUMENT, ItemQuery(where={"kind": "plan"})).total == 12
    newest = items.search(workspace, DOCUMENT, ItemQuery(limit=1)).items[0]
    assert newest.name == "Item 24"


@pytest.mark.parametrize(
    ("query", "message"),
    [
        (ItemQuery(sort="nonsense"), "no field 'nonsense'"),
        (ItemQuery(sort="detail"), "no field 'detail'"),
        (ItemQuery(where={"__class__": 1}), "no field '__class__'"),
        (ItemQuery(limit=0), "expected 0 or more and 1 to 1000"),
        (ItemQuery(limit=100_000), "expected 0 or more and 1 to 1000"),
        (ItemQuery(offset=-1), "expected 0 or more"),
    ],
)
def test_what_cannot_be_listed_is_refused(
    workspace: Workspace, query: ItemQuery, message: str
) -> None:
    with pytest.raises(ConfigurationError, match=message):
        items.search(workspace, DOCUMENT, query)


def test_items_are_found_by_id_its_beginning_or_name(workspace: Workspace) -> None:
    id = a_document(workspace, "the plan")
    for text in (id, id[:8], id[:8].upper(), "the plan"):
        assert items.resolve(workspace, text) == ("document", id)
    a_document(workspace, "the plan")
    with pytest.raises(ConfigurationError, match="more than one"):
        items.resolve(workspace, "the plan")
    for text in ("%", "____", "nothing"):
        with pytest.raises(ConfigurationError, match="no item"):
            items.resolve(workspace, text)


@pytest.mark.parametrize("name", ["", "   ", "x" * 201])
def test_names_are_checked(workspace: Workspace, name: str) -> None:
    with pytest.raises(ConfigurationError, match="a name of"):
        a_document(workspace, name)


def test_a_transaction_stands_whole_or_not_at_all(workspace: Workspace, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("content")

    def half() -> None:
        with workspace.write() as into:
            documents.add(into, "plan", name="one", files=[tmp_path / "a.csv"])
            jobs.submit(into, "plan", {})
            raise ConfigurationError("half-way")

    with pytest.raises(ConfigurationError, match="half-way"):
        half()
    assert items.search(workspace, DOCUMENT, ItemQuery()).total == 0
    assert jobs.search(workspace).total == 0
    assert journal.entries(workspace).total == 0
    workspace.close()
    with Workspace.open(workspace.folder, workspace.url) as again:
        assert again.swept == 1
        assert not [p for p in (again.folder / "blobs").rglob("*") if p.is_file()]


def test_altered_files_are_noticed(workspace: Workspace, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("content")
    made = documents.add(workspace, "plan", name="one", files=[tmp_path / "a.csv"])
    path = workspace.path_of(made.attachments[0].sha256)
    path.chmod(0o644)
    path.write_text("c0ntent")
    with pytest.raises(ArchiveError, match="altered or damaged"):
        workspace.content(made.attachments[0].sha256)
    path.unlink()
    with pytest.raises(ArchiveError, match="missing"):
        workspace.content(made.attachments[0].sha256)


def test_folder_and_database_belong_together(workspace: Workspace, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="is a workspace already"):
        Workspace.create(workspace.folder, workspace.url)
    with pytest.raises(ConfigurationError, match="no workspace"):
        Workspace.open(tmp_path / "elsewhere")
    if workspace.url is not None:
        with pytest.raises(RobotrueError, match="belongs to workspace"):
            Workspace.create(tmp_path / "second", workspace.url)
        with Workspace.create(tmp_path / "third") as third:
            pass
        with pytest.raises(RobotrueError, match="its database that of"):
            Workspace.open(third.folder, workspace.url)


def test_jobs_are_submitted_listed_and_cancelled(workspace: Workspace) -> None:
    id = jobs.submit(workspace, "calibrate", {"cell": "abc"})
    found = jobs.status(workspace, id)
    assert (found.state, found.progress, found.parameters) == ("queued", 0.0, {"cell": "abc"})
    assert jobs.search(workspace, state="queued").total == 1
    assert jobs.cancel(workspace, id[:8]).state == "cancelled"
    assert jobs.cancel(workspace, id).state == "cancelled"
    with pytest.raises(ConfigurationError, match="no job"):
        jobs.status(workspace, "0000")
    with pytest.raises(ConfigurationError, match="no JSON values"):
        jobs.submit(workspace, "calibrate", {"x": float("nan")})


def test_a_damaged_file_heals_when_it_is_taken_in_again(
    workspace: Workspace, tmp_path: Path
) -> None:
    (tmp_path / "a.csv").write_text("content")
    made = documents.add(workspace, "plan", name="one", files=[tmp_path / "a.csv"])
    path = workspace.path_of(made.attachments[0].sha256)
    path.chmod(0o644)
    path.write_text("c0ntent")
    documents.add(workspace, "plan", name="two", files=[tmp_path / "a.csv"])
    assert workspace.content(made.attachments[0].sha256) == b"content"


def test_two_writers_may_bring_the_same_files(workspace: Workspace, tmp_path: Path) -> None:
    """Each in its own order, at once: nobody waits for ever, every row and file stands once."""
    paths = [tmp_path / f"{k}.csv" for k in range(8)]
    for path in paths:
        path.write_text(path.name)
    faults: list[BaseException] = []

    def bring(order: list[Path]) -> None:
        try:
            with Workspace.open(workspace.folder, workspace.url) as mine:
                for _ in range(3):
                    documents.add(mine, "plan", name="same", files=order)
        except BaseException as fault:
            faults.append(fault)

    threads = [threading.Thread(target=bring, args=(way,)) for way in (paths, paths[::-1])]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert faults == []
    assert items.search(workspace, DOCUMENT, ItemQuery()).total == 6
    found = verify(workspace)
    assert (found.files, found.faults, found.unnamed) == (8, (), ())


def test_versions_follow_each_other_whoever_writes(workspace: Workspace) -> None:
    id = a_document(workspace, "start")

    def rename(word: str) -> None:
        with Workspace.open(workspace.folder, workspace.url) as mine:
            for k in range(5):
                items.change(mine, DOCUMENT, id, name=f"{word}{k}")

    threads = [threading.Thread(target=rename, args=(word,)) for word in "ab"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    versions = items.versions(workspace, DOCUMENT, id)
    assert [each.version for each in versions] == list(range(1, 12))
    assert [each.latest for each in versions] == [False] * 10 + [True]


@pytest.mark.parametrize("text", ["a\0b", "\0", "\ud800"])
def test_nul_characters_are_refused(workspace: Workspace, text: str) -> None:
    for detail, note in (({"x": text}, ""), ({}, text)):
        with pytest.raises(ConfigurationError, match="NUL character"):
            documents.add(workspace, "plan", name="p", detail=detail, note=note)


def test_numbers_that_are_not_finite_are_kept_as_none(workspace: Workspace) -> None:
    made = documents.add(workspace, "plan", name="p", detail={"a": float("nan"), "b": (1, 2.5)})
    assert made.detail == {"a": None, "b": [1, 2.5]}


def test_registrations_and_drift_checks(workspace: Workspace, tmp_path: Path) -> None:
    path, points = tmp_path / "cell.toml", tmp_path / "points.csv"
    path.write_text(CELL_TEXT)
    points.write_text("name\n")
    cell = cells.add(workspace, path)
    with pytest.raises(ConfigurationError, match="not registered"):
        registrations.add(workspace, path, points, name="r", cell=cell.ref)
    data = measurements.add(workspace, some_poses(), name="check")
    made = items.add(
        workspace, DRIFT_CHECK, name="d", links=links_to(model=cell.ref, data=data.ref), poses=7,
        statistic=12.5, p_value=0.3, verdict="keep",
    )  # fmt: skip
    found = items.search(workspace, DRIFT_CHECK, ItemQuery(where={"verdict": "keep"})).items
    assert found == (made,)


def test_totals_are_known_on_and_beyond_the_last_page(workspace: Workspace) -> None:
    for k in range(5):
        a_document(workspace, f"Item {k}")
    for query in (ItemQuery(text="item"), ItemQuery(where={"kind": "plan"}), ItemQuery()):
        for offset, names in ((0, 3), (3, 2), (6, 0)):
            page = items.search(
                workspace, DOCUMENT, replace(query, sort="name", offset=offset, limit=3)
            )
            assert (page.total, len(page.items)) == (5, names)
            expected = [f"Item {k}" for k in range(offset, offset + names)]
            assert [each.name for each in page.items] == expected
    assert items.search(workspace, DOCUMENT, ItemQuery(text="nothing")).total == 0
