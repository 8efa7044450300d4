"""Sessions at the part over HTTP: nothing lost, nobody overwritten, the same as on the console."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_plan_page import done
from touch_shop import CELL, Bench, touch_bench, write_touch_files
from typer.testing import CliRunner
from web_shop import Client, Shop

from robotrue.app.workbench.model_views import from_simulation
from robotrue.cell.config import parse_cell
from robotrue.cli.main import app
from robotrue.store import items, models
from robotrue.store.nouns import MODEL, REGISTRATION, RegistrationRecord

TOP = """&ACCESS RVP
DEF top()
PTP {A1 0,A2 -80,A3 80,A4 0,A5 40,A6 0}
LIN {X 40,Y 40,Z 400,A 0,B 90,C 0}
LIN {X 360,Y 40,Z 400,A 0,B 90,C 0}
LIN {X 360,Y 160,Z 400,A 0,B 90,C 0}
END
"""


def posted(made: Any, path: str, body: dict[str, Any], status: int = 201) -> Any:
    answer = made.post(path, json=body)
    assert answer.status_code == status, answer.text
    return answer.json()


def begun(made: Any, folder: Path, **settings: Any) -> str:
    write_touch_files(folder)
    cell = made.post("/api/files?name=cell.toml", content=(folder / "cell.toml").read_bytes())
    kept = posted(made, "/api/cells", {"uploads": [cell.json()["id"]], "name": "Milling"})
    table = folder / "block simulated.csv"
    sent = made.post(f"/api/files?name={table.name}", content=table.read_bytes()).json()
    body = {
        "uploads": [sent["id"]],
        "cell": kept["id"],
        "tolerance_mm": 1.0,
        "rough_mm": 50.0,
        **settings,
    }
    return str(posted(made, "/api/touching", body)["id"])


def touch(made: Any, id: str, bench: Bench, *, at: int | None = None) -> dict[str, Any]:
    """Touches what is proposed; ``at`` touches another feature and says it was that one."""
    seen = made.get(f"/api/touching/{id}").json()
    feature = seen["next"]["feature"]
    point = seen["features"][feature if at is None else at]["point_mm"]
    line = bench.line(point, seen["next"]["joints_deg"])
    body = {"version": seen["version"], "feature": feature, "text": line}
    return dict(posted(made, f"/api/touching/{id}/readings", body))


def last(record: dict[str, Any]) -> dict[str, Any]:
    return dict(record["detail"]["session"]["readings"][-1])


def test_a_session_ends_where_register_ends(client: Client, filled: Shop, tmp_path: Path) -> None:
    made, bench = client(), touch_bench()
    id = begun(made, tmp_path, name="Block", fit="joint", tolerance_mm=2.0)
    for _ in range(6):
        record = touch(made, id, bench)
        assert last(record)["state"] == "kept"
        assert last(record)["sigmas"] < 4.0
    seen = made.get(f"/api/touching/{id}").json()
    assert seen["simulated"]
    assert (np.diff(seen["curve_mm"]) < 0.0).all()
    assert seen["fit"]["verdict"] == "GO"
    body = {"version": seen["version"], "name": "Block, first side"}
    kept = posted(made, f"/api/touching/{id}/registration", body)

    sent = made.get(f"/api/touching/{id}/readings.csv")
    name = sent.headers["content-disposition"].split('"')[1]
    (tmp_path / name).write_bytes(sent.content)
    command = [
        "register", str(tmp_path / "cell.toml"), str(tmp_path / name), "-o",
        str(tmp_path / "registered.toml"), "--tolerance-mm", "2.0", "--fit", "joint", "--json",
    ]  # fmt: skip
    answer = CliRunner().invoke(app, command)
    assert answer.exit_code == 0, answer.output
    theirs = parse_cell((tmp_path / "registered.toml").read_bytes(), "registered.toml").part
    record = items.get(filled.workspace, REGISTRATION, kept["id"])
    (file,) = record.files("cell")
    ours = parse_cell(filled.workspace.content(file.sha256), "registered.toml").part
    assert theirs is not None
    assert ours is not None
    a, b = ours.frames[0], theirs.frames[0]
    np.testing.assert_allclose(a.T_base_part, b.T_base_part, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-9, atol=1e-18)
    assert (a.verdict, a.outliers, a.touches) == (b.verdict, b.outliers, b.touches)
    assert ours.identity == theirs.identity
    assert {each.role for each in record.links} == {"cell", "model", "session"}
    (refined,) = record.refs("model")
    held = models.model_of(filled.workspace, items.get(filled.workspace, MODEL, refined.id))
    assert from_simulation(held.model)
    report = next(each for each in record.attachments if each.name == "report.html")
    page = made.get(f"/reports/registration/{record.id}/{report.sha256}")
    assert page.status_code == 200
    assert "simulated" in page.text.lower()
    assert made.get(f"/api/touching/{id}").json()["result"] == record.id
    _check_program_in_part(made, filled, record, refined.id)


def _check_program_in_part(made: Any, shop: Shop, record: RegistrationRecord, model: str) -> None:
    """The registered part is used in the pages: offered, compensated in, drawn and checked."""
    english = {"accept-language": "en"}
    assert shop.model.name in made.get("/programs").text  # in use as before: nothing was switched
    page = made.get(f"/registration?registration={record.id}", headers=english).text
    assert f"/programs?registration={record.id}&amp;model={model}" in page
    assert "Verdict against 2 mm" in page
    assert page.count('class="spread"') == 6
    sent = made.post("/api/files?name=top.src", content=TOP.encode()).json()
    program = posted(made, "/api/programs", {"uploads": [sent["id"]]})["id"]
    chosen = f"/programs?id={program}&registration={record.id}&model={model}"
    form = made.get(chosen, headers=english).text
    assert f'<option value="{record.id}" selected>' in form
    asked = {"program": program, "model": model, "registration": record.id, "part": "part"}
    job = done(shop, "compensate", asked)
    assert job.result is not None, job.error
    assert job.result["compensated"] == 3
    after = job.result["program"]["id"]
    seen = made.get(f"/programs?id={after}&part=judged", headers=english).text
    assert "Part frame part: the standard uncertainty of its origin is" in seen
    assert "State your tolerance" in seen
    assert "GO</b>" not in seen
    assert "GO</b>" in made.get(f"/programs?id={after}&part=judged&tolerance_mm=9").text


def test_a_wrong_touch_waits_and_is_explained(client: Client, tmp_path: Path) -> None:
    made, bench = client(), touch_bench()
    id = begun(made, tmp_path)
    for _ in range(3):
        touch(made, id, bench)
    seen = made.get(f"/api/touching/{id}").json()
    other = next(
        k for k, each in enumerate(seen["features"])
        if each["state"] == "open" and k != seen["next"]["feature"]
        and each["name"][:3] == seen["features"][seen["next"]["feature"]]["name"][:3]
    )  # fmt: skip
    record = touch(made, id, bench, at=other)
    assert last(record)["state"] == "held"
    (why,) = last(record)["suspicions"]
    assert (why["kind"], why["name"]) == ("feature", seen["features"][other]["name"])
    version = record["version"]
    body = {"version": version, "feature": other, "text": "1 2 3 4 5 6"}
    refused = posted(made, f"/api/touching/{id}/readings", body, 400)
    assert "waits for a decision" in refused["detail"]
    body = {"version": version, "name": "too early"}
    posted(made, f"/api/touching/{id}/registration", body, 400)
    kept = posted(made, f"/api/touching/{id}/decisions", {"version": version, "decision": "retake"})
    assert last(kept)["state"] == "dropped"
    again = made.get(f"/api/touching/{id}").json()
    assert again["next"]["feature"] == seen["next"]["feature"]
    assert again["kept"] == 3


def test_two_at_one_session_do_not_overwrite_each_other(client: Client, tmp_path: Path) -> None:
    made, bench = client(), touch_bench()
    id = begun(made, tmp_path)
    before = made.get(f"/api/touching/{id}").json()
    touch(made, id, bench)
    body = {"version": before["version"], "decision": "skip", "feature": 3}
    refused = posted(made, f"/api/touching/{id}/decisions", body, 409)
    assert "at version 2, not 1" in refused["detail"]
    now = made.get(f"/api/touching/{id}").json()
    assert now["kept"] == 1
    body = {"version": now["version"], "decision": "undo"}
    posted(made, f"/api/touching/{id}/decisions", body)
    after = made.get(f"/api/touching/{id}").json()
    assert after["kept"] == 0
    assert [each["state"] for each in after["readings"]] == ["undone"]
    body = {"version": after["version"], "decision": "undo"}
    assert "nothing to undo" in posted(made, f"/api/touching/{id}/decisions", body, 400)["detail"]


def test_readings_of_a_file_are_taken_in_and_wrong_ones_set_aside(
    client: Client, tmp_path: Path
) -> None:
    made, bench = client(), touch_bench()
    id = begun(made, tmp_path)
    seen = made.get(f"/api/touching/{id}").json()
    rows = ["name,px_mm,py_mm,pz_mm," + ",".join(f"j{k}_deg" for k in range(1, 7))]
    for k, each in enumerate(seen["features"][:6]):
        plan = made.get(f"/api/touching/{id}?feature={k}").json()["next"]["joints_deg"]
        controller = bench.cell.nominal.controller
        assert controller is not None
        planned = np.degrees(controller.to_model(np.radians(plan)))
        where = each["point_mm"] if k != 4 else [p + 6.0 for p in each["point_mm"]]
        joints = bench.joints(where, planned.tolist())
        rows.append(",".join([each["name"], *map(str, each["point_mm"]), *map(str, joints)]))
    path = tmp_path / "afternoon.csv"
    path.write_text("\n".join(rows) + "\n")
    sent = made.post(f"/api/files?name={path.name}", content=path.read_bytes()).json()
    body = {"version": seen["version"], "uploads": [sent["id"]]}
    record = posted(made, f"/api/touching/{id}/files", body)
    states = [each["state"] for each in record["detail"]["session"]["readings"]]
    assert states == ["kept"] * 4 + ["dropped", "kept"]


def test_a_plan_of_touches_says_where_the_part_is(client: Client, tmp_path: Path) -> None:
    made, bench = client(), touch_bench()
    id = begun(made, tmp_path)
    seen = made.get(f"/api/touching/{id}").json()
    rows = ["# planned joints, nothing was touched yet: put the joints ..."]
    rows.append("name,px_mm,py_mm,pz_mm," + ",".join(f"j{k}_deg" for k in range(1, 7)))
    controller = bench.cell.nominal.controller
    assert controller is not None
    for k, each in enumerate(seen["features"]):
        axes = made.get(f"/api/touching/{id}?feature={k}").json()["next"]["joints_deg"]
        joints = np.degrees(controller.to_model(np.radians(axes)))
        rows.append(",".join([each["name"], *map(str, each["point_mm"]), *map(str, joints)]))
    sent = made.post("/api/files?name=touches.csv", content="\n".join(rows).encode()).json()
    bare = CELL.replace("[base]\nxyz_mm = [800, -100, 400]\n", "")
    file = made.post("/api/files?name=cell.toml", content=bare.encode()).json()
    cell = posted(made, "/api/cells", {"uploads": [file["id"]], "name": "Bare"})
    body = {"uploads": [sent["id"]], "cell": cell["id"], "name": "planned"}
    session = posted(made, "/api/touching", body)["detail"]["session"]
    np.testing.assert_allclose(np.array(session["rough"][0])[:3, 3], [0.8, -0.1, 0.4], atol=1e-4)
    assert [len(each["postures_deg"]) for each in session["features"]] == [1] * 10


@pytest.mark.parametrize(
    ("table", "settings", "told"),
    [
        ("name,px_mm\nA,1\n", {}, "no column px_mm, py_mm, pz_mm|no column"),
        ("name,px_mm,py_mm,pz_mm\nA,1,2,3\n", {"frame": "1,2,3"}, "expected X, Y, Z, A, B, C"),
        ("name,px_mm,py_mm,pz_mm\nA,1,2,3\n", {"frame": "9000,0,0,0,0,0"}, "cannot touch 'A'"),
        ("name,px_mm,py_mm,pz_mm\nA,1e300,2,3\n", {}, "more than 50 m from the part's origin"),
        ("name,px_mm,py_mm,pz_mm\nA,1,2,3\n", {"frame": "1e300,0,0,0,0,0"}, "expected X, Y, Z"),
    ],
)
def test_what_cannot_begin_is_refused_in_plain_words(
    client: Client, tmp_path: Path, table: str, settings: dict[str, Any], told: str
) -> None:
    made = client()
    write_touch_files(tmp_path)
    cell = made.post("/api/files?name=cell.toml", content=CELL.encode()).json()
    kept = posted(made, "/api/cells", {"uploads": [cell["id"]]})
    sent = made.post("/api/files?name=points.csv", content=table.encode()).json()
    body = {"uploads": [sent["id"]], "cell": kept["id"], **settings}
    answer = made.post("/api/touching", json=body)
    assert 400 <= answer.status_code < 500
    import re

    assert re.search(told, answer.json()["detail"]), answer.json()


def test_positions_are_read_where_no_joints_are_shown(client: Client, tmp_path: Path) -> None:
    made, bench = client(), touch_bench()
    id = begun(made, tmp_path, reads="position")
    place = bench.cell.T_base_part
    for _ in range(4):
        seen = made.get(f"/api/touching/{id}").json()
        feature = seen["next"]["feature"]
        tip = place[:3, :3] @ np.array(seen["features"][feature]["point_mm"]) + 1e3 * place[:3, 3]
        text = "X {:.3f}, Y {:.3f}, Z {:.3f}".format(*tip)
        body = {"version": seen["version"], "feature": feature, "text": text}
        assert last(posted(made, f"/api/touching/{id}/readings", body))["state"] == "kept"
    seen = made.get(f"/api/touching/{id}").json()
    np.testing.assert_allclose(seen["fit"]["frames"][0]["xyz_mm"], 1e3 * place[:3, 3], atol=0.01)
    feature = seen["next"]["feature"]
    tip = (
        place[:3, :3] @ np.array(seen["features"][feature]["point_mm"]) + 1e3 * place[:3, 3]
    ) / 25.4
    text = " ".join(f"{v:.5f}" for v in tip)
    body = {"version": seen["version"], "feature": feature, "text": text}
    held = last(posted(made, f"/api/touching/{id}/readings", body))
    assert held["state"] == "held"
    assert held["suspicions"][0]["name"] == "inch"
    assert json.dumps(held)
    shutil.rmtree(tmp_path)
