"""A workspace as one file: what goes out comes in, what is damaged or hostile does not."""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from test_items import some_poses

from robotrue.errors import ArchiveError, ModelMismatchError
from robotrue.store import documents, exchange_import, items, jobs, journal, measurements
from robotrue.store.exchange import export_project
from robotrue.store.exchange_import import import_project
from robotrue.store.nouns import DOCUMENT, MEASUREMENT
from robotrue.store.records import ItemQuery, Link
from robotrue.store.verify import verify
from robotrue.store.workspace import Workspace

Other = Callable[[], Workspace]
Members = dict[str, bytes]


def filled(workspace: Workspace, folder: Path) -> str:
    """Puts a little of everything into a workspace; returns the id of a document."""
    (folder / "a.csv").write_text("a" * 100)
    data = measurements.add(workspace, some_poses(), name="grid", raw=[folder / "a.csv"])
    about = [Link(role="data", to=data.ref)]
    made = documents.add(workspace, "plan", name="p", files=[folder / "a.csv"], about=about)
    items.change(workspace, DOCUMENT, made.id, name="q")
    items.delete(workspace, MEASUREMENT, data.id)
    jobs.submit(workspace, "plan", {})
    jobs.cancel(workspace, jobs.submit(workspace, "plan", {"cell": "left"}))
    return made.id


def told(workspace: Workspace) -> list[Any]:
    found: list[Any] = [
        items.versions(workspace, DOCUMENT, each.id)
        for each in items.search(workspace, DOCUMENT, ItemQuery(sort="id")).items
    ]
    deleted = items.search(workspace, MEASUREMENT, ItemQuery(deleted=True)).items
    found += [measurements.rows_of(workspace, each).sources for each in deleted]
    found += [deleted, jobs.search(workspace, state="cancelled").items]
    return found


@pytest.fixture
def exported(workspace: Workspace, tmp_path: Path) -> tuple[Path, str]:
    id = filled(workspace, tmp_path)
    export_project(workspace, tmp_path / "project.zip")
    return tmp_path / "project.zip", id


def test_what_goes_out_comes_in(
    workspace: Workspace, exported: tuple[Path, str], tmp_path: Path
) -> None:
    path, id = exported
    with Workspace.create(tmp_path / "other") as other:
        carried = import_project(other, path)
        assert (carried.files, carried.rows["jobs"], carried.rows["documents"]) == (2, 1, 2)
        assert told(other) == told(workspace)
        assert jobs.search(other, state="queued").total == 0
        assert verify(other).faults == verify(other).unnamed == ()
        actions = [entry.action for entry in journal.entries(other).items]
        assert actions[0] == "imported"
        assert actions.count("added") == 2

        again = import_project(other, path)
        assert sum(again.rows.values()) == 0
        newer = items.change(other, DOCUMENT, id, name="r")
        import_project(other, path)
        assert items.get(other, DOCUMENT, id) == newer

        export_project(other, tmp_path / "back.zip")
        import_project(workspace, tmp_path / "back.zip")
        assert items.get(workspace, DOCUMENT, id) == newer
        assert [each.latest for each in items.versions(workspace, DOCUMENT, id)] == [
            False,
            False,
            True,
        ]
        assert verify(workspace).faults == ()

        items.change(workspace, DOCUMENT, id, name="here")
        items.change(other, DOCUMENT, id, name="there")
        export_project(other, tmp_path / "parted.zip")
        before = told(workspace)
        with pytest.raises(ModelMismatchError, match="with other content"):
            import_project(workspace, tmp_path / "parted.zip")
        assert told(workspace) == before


@pytest.mark.parametrize("workspace", ["sqlite"], indirect=True)
def test_every_flipped_or_missing_byte_is_noticed(
    workspace: Workspace, exported: tuple[Path, str], tmp_path: Path
) -> None:
    data = exported[0].read_bytes()
    broken = tmp_path / "broken.zip"
    refused = 0
    with Workspace.create(tmp_path / "other") as other:
        nothing, everything = told(other), told(workspace)
        for at in range(1, len(data), len(data) // 12):
            broken.write_bytes(data[:at])
            with pytest.raises(ArchiveError):
                import_project(other, broken)
            assert told(other) == nothing
        for at in range(0, len(data), len(data) // 20):
            broken.write_bytes(data[:at] + bytes([data[at] ^ 0x55]) + data[at + 1 :])
            try:
                import_project(other, broken)
            except ArchiveError:
                refused += 1
                assert told(other) in (nothing, everything)
            else:  # a byte that says nothing: a date in the zip
                assert told(other) == everything
    assert refused > 12


def rewritten(path: Path, target: Path, change: Callable[[Members, dict[str, Any]], None]) -> Path:
    """The export with other members; the manifest agrees unless the change says otherwise."""
    with zipfile.ZipFile(path) as bundle:
        members = {name: bundle.read(name) for name in bundle.namelist()}
    manifest = json.loads(members.pop("manifest.json"))
    change(members, manifest)
    for name, content in members.items():
        entry = {"sha256": hashlib.sha256(content).hexdigest(), "size": len(content)}
        manifest["members"].setdefault(name, entry)
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as bundle:
        for name, content in members.items():
            bundle.writestr(name, content)
        bundle.writestr("manifest.json", json.dumps(manifest))
    return target


def _row(table: str, old: bytes, new: bytes) -> Callable[[Members, dict[str, Any]], None]:
    def change(members: Members, manifest: dict[str, Any]) -> None:
        name = f"tables/{table}.jsonl"
        assert old in members[name]
        members[name] = members[name].replace(old, new)
        del manifest["members"][name]

    return change


def _climbing(members: Members, manifest: dict[str, Any]) -> None:
    members["blobs/../../evil"] = b"x"


def _unnamed_table(members: Members, manifest: dict[str, Any]) -> None:
    members["tables/sqlite_master.jsonl"] = b"{}\n"


def _foreign_file(members: Members, manifest: dict[str, Any]) -> None:
    members[f"blobs/{hashlib.sha256(b'x').hexdigest()}"] = b"x"


def _wrong_hash(members: Members, manifest: dict[str, Any]) -> None:
    members[f"blobs/{'0' * 64}"] = b"x"


def _lost_file(members: Members, manifest: dict[str, Any]) -> None:
    name = next(name for name in members if name.startswith("samples/"))
    del members[name], manifest["members"][name]


def _future(members: Members, manifest: dict[str, Any]) -> None:
    manifest["schema"] = "9999"


def _future_format(members: Members, manifest: dict[str, Any]) -> None:
    manifest["format_version"] = 2


def _of_others(members: Members, manifest: dict[str, Any]) -> None:
    manifest["format"] = "other"


def _too_short(members: Members, manifest: dict[str, Any]) -> None:
    next(iter(manifest["members"].values()))["size"] = 1


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, Workspace]]:
    """An export, and a workspace that takes nothing of what is made of it."""
    folder = tmp_path_factory.mktemp("once")
    with Workspace.create(folder / "shop") as made:
        filled(made, folder)
        export_project(made, folder / "project.zip")
    with Workspace.create(folder / "other") as other:
        yield folder / "project.zip", other


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_climbing, "a member is called"),
        (_unnamed_table, "a table that is none"),
        (_foreign_file, "not those its rows name"),
        (_wrong_hash, "not named by its hash"),
        (_lost_file, "not those its rows name"),
        (_future, "schema 9999"),
        (_future_format, "an export of format 2"),
        (_of_others, "not an export"),
        (_too_short, "has another length"),
        (_row("attachments", b'"a.csv"', b'"../../a.csv"'), "is no file name"),
        (_row("jobs", b'"cancelled"', b'"queued"'), "a job that is not over"),
        (_row("items", b'"document"', b'"nonsense"'), "a noun that is none"),
        (_row("documents", b'"kind"', b'"kind "'), "a row of documents is none"),
        (_row("documents", b'"version": 1', b'"version": 2'), "do not fit together"),
        (_row("blobs", b'"blobs"', b'"../.."'), "not those its rows name"),
        (_row("links", b'"id": "', b'"id": "0'), "do not fit together"),
    ],
)
def test_hostile_exports_are_refused(
    once: tuple[Path, Workspace], tmp_path: Path, change: Any, message: str
) -> None:
    path, other = once
    hostile = rewritten(path, tmp_path / "hostile.zip", change)
    with pytest.raises(ArchiveError, match=message):
        import_project(other, hostile)
    assert items.search(other, DOCUMENT, ItemQuery()).total == 0
    assert journal.entries(other).total == 0
    assert not list(other.folder.rglob("evil")) + list(path.parent.glob("evil"))


@pytest.mark.parametrize("workspace", ["sqlite"], indirect=True)
def test_a_zip_bomb_is_refused_before_it_expands(
    exported: tuple[Path, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def bomb(members: Members, manifest: dict[str, Any]) -> None:
        content = b"\0" * (4 << 20)
        members[f"blobs/{hashlib.sha256(content).hexdigest()}"] = content

    hostile = rewritten(exported[0], tmp_path / "bomb.zip", bomb)
    monkeypatch.setattr(exchange_import, "SMALL", 1 << 20)
    with Workspace.create(tmp_path / "other") as other:
        with pytest.raises(ArchiveError, match="expands to 4 MiB, allowed are"):
            import_project(other, hostile)
        with pytest.raises(ArchiveError, match="allowed are 0 MiB"):
            import_project(other, exported[0], most=1000)


@pytest.mark.parametrize("content", [b"", b"PK", b"no zip at all", b"PK\x05\x06" + b"\0" * 18])
def test_what_is_no_export_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.zip").write_bytes(content)
    with Workspace.create(tmp_path / "other") as other:
        with pytest.raises(ArchiveError, match="not an export"):
            import_project(other, tmp_path / "x.zip")


def test_verify_says_what_is_wrong(workspace: Workspace, tmp_path: Path) -> None:
    filled(workspace, tmp_path)
    assert verify(workspace).faults == ()
    assert (verify(workspace).files, verify(workspace).items) == (2, 2)
    blob = next(p for p in (workspace.folder / "blobs").rglob("*") if p.is_file())
    blob.chmod(0o644)
    blob.write_bytes(b"b" * 100)
    (workspace.folder / "blobs" / "stray").write_bytes(b"")
    found = verify(workspace)
    assert "altered or damaged" in found.faults[0]
    assert found.unnamed == ("blobs/stray",)
    with pytest.raises(ArchiveError, match="altered or damaged"):
        export_project(workspace, tmp_path / "project.zip")
    assert not (tmp_path / "project.zip").exists()
