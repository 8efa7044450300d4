"""The HTTP interface: items, files, jobs, scenes; nothing asked of it is a fault of its own."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest
import shop
from web_shop import POSES, SEED, Client, Shop, unpacked

from robotrue.app.job_kinds import job_kinds
from robotrue.store import items
from robotrue.store.nouns import CELL
from robotrue.web import uploads
from robotrue.web.static_files import STATIC_ROOT
from robotrue.web.uploads import FOLDER, safe_name


def test_items_are_listed_filtered_and_looked_at(client: Client, filled: Shop) -> None:
    here = client()
    found = here.get("/api/items/measurement", params={"text": "track"}).json()
    assert (found["total"], found["items"][0]["name"]) == (1, "Tracker")
    assert here.get("/api/items/measurement", params={"text": "100%"}).json()["total"] == 0
    one = here.get(f"/api/items/model/{filled.model.id}").json()
    assert {link["role"] for link in one["links"]} == {"data", "cell"}
    assert here.get(f"/api/items/model/{filled.model.id}/versions").json()["total"] == 1


def test_a_file_comes_back_as_it_went_in(client: Client, filled: Shop) -> None:
    here = client()
    one = here.get(f"/api/items/program/{filled.program.id}").json()["attachments"][0]
    answer = here.get(one["href"])
    assert answer.content == (filled.folder / "part.src").read_bytes()
    assert 'filename="part.src"' in answer.headers["content-disposition"]
    other = here.get(f"/api/items/cell/{filled.cell.id}/files/{one['sha256']}")
    assert other.status_code == 404  # a file of another item


def test_refusals_say_what_was_wrong_and_what_to_try(client: Client, filled: Shop) -> None:
    here = client()
    sent = here.post("/api/files?name=bad.csv", content=b"a,b\n1,2\n").json()["id"]
    answer = here.post("/api/measurements", json={"uploads": [sent], "cell": filled.cell.id})
    assert answer.status_code == 400
    assert answer.headers["content-type"] == "application/problem+json"
    body = answer.json()
    assert body["title"] == "format error"
    assert body["detail"] == "columns of no known layout: a, b."
    assert (body["source"], body["line"]) == ("bad.csv", 1)
    assert "j1_deg" in body["hint"]
    assert here.delete(f"/api/files/{sent}").status_code == 204
    assert here.delete(f"/api/files/{sent}").status_code == 404


@pytest.mark.parametrize(
    "path",
    [
        "/api/items/nothing",
        "/api/items/cell/none",
        "/api/items/cell/none/versions",
        "/api/items/cell/none/files/" + "0" * 64,
        "/api/scenes/model/none",
        "/api/scenes/cell/none",
        "/api/programs/none/judgement?model=none",
        "/api/jobs/none",
        "/api/files/../../etc/passwd",
        "/reports/model/none/" + "0" * 64,
        f"{STATIC_ROOT}/../../server.py",
        f"{STATIC_ROOT}/%2e%2e/server.py",
    ],
)
def test_what_is_not_there_is_not_found(client: Client, path: str) -> None:
    answer = client().get(path)
    assert answer.status_code in (404, 405), answer.text
    assert "import" not in answer.text


def test_numbers_beyond_all_bounds_are_refused(client: Client) -> None:
    here = client()
    for query in (
        "limit=0",
        "limit=1e9",
        "offset=-1",
        "offset=99999999999999999999",
        "sort=' or 1",
    ):
        code = here.get(f"/api/items/cell?{query}").status_code
        assert 400 <= code < 500, query
    for tolerance in ("0", "-1", "nan", "inf", "1e400"):
        code = here.get(f"/api/programs/a/judgement?model=b&tolerance_mm={tolerance}").status_code
        assert 400 <= code < 500, tolerance


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("../../etc/passwd", "passwd"),
        ("C:\\data\\tracker.csv", "tracker.csv"),
        ("..", "file"),
        ("=cmd|calc.csv", "=cmd_calc.csv"),
        ("a\x00b\n.csv", "a_b_.csv"),
        ("测量 3.csv", "测量 3.csv"),
        ("x" * 300 + ".csv", "x" * 108 + ".csv"),
    ],
)
def test_names_of_files_lead_nowhere(name: str, kept: str) -> None:
    assert safe_name(name) == kept


def test_an_empty_file_and_one_cut_off_leave_nothing(client: Client, filled: Shop) -> None:
    here = client(upload_limit=50_000, upload_total=10**9)
    incoming = filled.workspace.folder / FOLDER
    before = set(incoming.iterdir()) if incoming.is_dir() else set()
    assert here.post("/api/files?name=a.csv", content=b"").status_code == 400
    assert here.post("/api/files?name=a.csv", content=iter([b"x" * 60_000])).status_code == 413
    assert set(incoming.iterdir()) == before


def test_an_archive_that_would_fill_the_memory_is_refused(
    client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uploads, "UNPACKED", 1_000_000)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as bundle:
        for k in range(10):
            bundle.writestr(f"xl/{k}.xml", bytes(100_001))
    assert len(buffer.getvalue()) < 10_000
    answer = client().post("/api/files?name=poses.xlsx", content=buffer.getvalue())
    assert answer.status_code == 400
    assert answer.json()["detail"] == "1 MB when unpacked, at most 1 MB are."


def test_cell_measurements_and_program_come_in(client: Client, filled: Shop) -> None:
    here = client()

    def sent(name: str) -> str:
        content = (filled.folder / name).read_bytes()
        return str(here.post(f"/api/files?name={name}", content=content).json()["id"])

    cell = here.post("/api/cells", json={"uploads": [sent("cell.toml")], "name": "Second"}).json()
    assert cell["robot"] == "KUKA KR160 R1570"
    asked = {"uploads": [sent("simulated.csv")], "cell": cell["id"]}
    measured = here.post("/api/measurements", json=asked).json()
    assert (measured["poses"], measured["frame"]) == (POSES, "base")
    assert measured["data"] == filled.measured.data  # the same rows, bit for bit
    program = here.post("/api/programs", json={"uploads": [sent("part.src")]}).json()
    assert (program["dialect"], program["stage"]) == ("krl", "before")
    for noun, made in (("cell", cell), ("measurement", measured), ("program", program)):
        assert here.delete(f"/api/items/{noun}/{made['id']}").json()["deleted"] is True
        assert here.post(f"/api/items/{noun}/{made['id']}/undo?version=1").status_code == 409
        back = here.post(f"/api/items/{noun}/{made['id']}/undo?version=2").json()
        assert (back["deleted"], back["version"]) == (False, 3)
        here.delete(f"/api/items/{noun}/{made['id']}")


def test_columns_of_other_names_are_read_as_they_are_said_to_be(
    client: Client, filled: Shop
) -> None:
    joints = shop.postures(12, SEED)
    path = filled.folder / "simulated other.csv"
    shop.write_csv(path, joints, shop.points(joints))
    text = path.read_text().replace("x_mm,y_mm,z_mm", "Px,Py,Pz").replace("j1_deg", "Axis 1")
    here = client()
    sent = here.post("/api/files?name=other.csv", content=text.encode()).json()["id"]
    mapping = {
        "joints": ["Axis 1", *(f"j{k}_deg" for k in range(2, 7))],
        "position": ["Px", "Py", "Pz"],
    }
    asked = {"uploads": [sent], "cell": filled.cell.id, "mapping": mapping}
    assert here.post("/api/measurements", json=asked).json()["poses"] == 12


def test_a_scene_holds_what_was_measured(client: Client, filled: Shop) -> None:
    found = client().get(f"/api/scenes/model/{filled.model.id}").json()
    joints = shop.postures(POSES, SEED)
    wanted = shop.points(joints, noise_seed=SEED)
    np.testing.assert_allclose(unpacked(found["points"]["position"]), wanted, atol=1e-6)
    before = unpacked(found["points"]["before"])
    np.testing.assert_allclose(before, wanted - shop.commanded(joints), atol=1e-6)
    after = np.linalg.norm(unpacked(found["points"]["after"]), axis=1)
    assert after.max() < 1e-4 < np.linalg.norm(before, axis=1).mean()
    assert found["simulated"] is True
    robot = found["robot"]
    last, links = robot["shapes"][-1], unpacked(robot["links"])[:, -1]
    tip = links[:, 0] + np.einsum("nij,i->nj", links[:, 1:], np.array(last["end"]))
    np.testing.assert_allclose(tip, shop.commanded(joints), atol=1e-6)  # the tool ends there


def test_a_program_is_judged_by_predicted_error_and_its_bound(client: Client, filled: Shop) -> None:
    here = client()
    asked = {"model": filled.model.id}
    address = f"/api/programs/{filled.program.id}/judgement"
    close = here.get(address, params={**asked, "tolerance_mm": 0.01}).json()
    assert close["go"] is False
    assert close["states"]["fails"] == 3
    assert close["states"]["unknown"] == 1  # out of reach: not waved through
    assert (close["targets"], close["axis_targets"]) == (4, 1)  # states no place: listed apart
    wide = here.get(address, params={**asked, "tolerance_mm": 500}).json()
    assert wide["states"]["conforms"] == 3
    assert wide["go"] is False
    first, second = close["worst"][:2]
    assert first["after_m"] is None  # what nothing is known of stands first
    assert second["after_m"] == close["after_m"]["max"]
    every = here.get(address, params={**asked, "tolerance_mm": 500, "strict": True}).json()
    assert (every["targets"], every["states"]["unknown"]) == (5, 2)


def test_a_job_is_asked_for_watched_and_cancelled(client: Client, filled: Shop) -> None:
    here = client(kinds=job_kinds())
    unknown = here.post("/api/jobs", json={"kind": "dance", "parameters": {}})
    assert (unknown.status_code, "calibrate" in unknown.json()["detail"]) == (400, True)


def test_what_names_a_user_gave_is_kept_as_text(client: Client, filled: Shop) -> None:
    found = items.get(filled.workspace, CELL, filled.cell.id)
    assert found.name == "Cell <3>"
    assert client().get(f"/api/items/cell/{found.id}").json()["name"] == "Cell <3>"


def test_the_interface_describes_itself(client: Client) -> None:
    document = client().get("/api/openapi.json").json()
    paths = document["paths"]
    assert {"/api/items/{noun}", "/api/files", "/api/jobs", "/api/measurements"} <= set(paths)
    assert not [p for p in paths if not p.startswith("/api")]
    for path, methods in paths.items():
        for method, what in methods.items():
            assert what.get("description"), f"{method} {path} says nothing"
