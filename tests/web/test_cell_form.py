"""A cell from a preset, its text as versions, names and notes changed where they stand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from serving import Watched, serving, watching
from web_shop import Client, Served, unpacked

from robotrue.app.workbench.arm_body import choose_posture
from robotrue.cell.config import parse_cell
from robotrue.cell.obstacles import Box, HalfSpace
from robotrue.cell.robot_table import robot_table
from robotrue.cell.toml_edit import write_toml
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset
from robotrue.robot.ur_calibration import kinematics_yaml
from robotrue.robot.urdf import to_urdf
from robotrue.robot.urdf_writer import joint_origins, xyz_rpy

NUMBERS = {
    "tool_x_mm": "12,5", "tool_z_mm": 300, "tool_b_deg": "−30", "mass_kg": "45", "centre_z_mm": 120,
    "repeatability_mm": 0.05, "sigma_um": 10, "sigma_um_per_m": 3,
}  # fmt: skip

BOX = {
    f"box1_{side}_{axis}_mm": value
    for side, value in (("low", -200), ("high", 400))
    for axis in "xyz"
}


def described(made: Any, numbers: dict[str, Any], robot: str = "KUKA KR160 R1570") -> Any:
    answer = made.post("/api/cells/form", json={"robot": robot, "numbers": numbers})
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_what_the_form_says_is_what_the_cell_is(client: Client) -> None:
    made = client()
    found = described(made, NUMBERS)
    assert found["faults"] == {}
    cell = parse_cell(found["text"].encode(), "cell.toml")
    assert cell.robot.name == "KUKA KR160 R1570"
    wanted = pose_from_xyz_abc(np.array([0.0125, 0.0, 0.3]), np.radians([0.0, -30.0, 0.0]))
    np.testing.assert_allclose(cell.robot.T_flange_tool, wanted, atol=1e-12)
    assert cell.payload.mass[0] == 45.0
    np.testing.assert_allclose(cell.payload.com[0], [0.0, 0.0, 0.12])
    assert cell.repeatability == pytest.approx(5e-5)
    sigma = (cell.tracker.range_bound, cell.tracker.range_bound_per_m)
    assert np.array(sigma) / cell.tracker.divisor == pytest.approx([10e-6, 3e-6])
    kept = made.post("/api/cells/text", json={"text": found["text"], "name": "Formed"})
    assert kept.status_code == 201
    assert made.get(f"/api/cells/{kept.json()['id']}/text").text == found["text"]


@pytest.mark.parametrize("frame", ["base", "unknown"])
def test_reflector_place_obstacles_and_stiffness_reach_the_cell(client: Client, frame: str) -> None:
    stiffness = {f"stiffness_{joint}_MNm_per_rad": 0.5 + joint for joint in range(1, 7)}
    points = {"reflector_x_mm": 0, "reflector_y_mm": 12.5, "reflector_z_mm": 50}
    instrument = {"tracker_x_mm": 3000, "tracker_y_mm": "-500", "tracker_z_mm": 700}
    numbers = {**BOX, **stiffness, **points, **instrument, "floor_z_mm": -15}
    stated = {"robot": "KUKA KR160 R1570", "frame": frame, "numbers": numbers}
    made = client()
    found = made.post("/api/cells/form", json=stated).json()
    assert found["faults"] == {}
    cell = parse_cell(found["text"].encode(), "cell.toml")
    np.testing.assert_allclose(cell.T_flange_target[:3, 3], [0.0, 0.0125, 0.05])
    np.testing.assert_allclose(1.0 / cell.compliance_prior, 1e6 * np.arange(1.5, 7.0))
    floor, box = cell.obstacles
    assert isinstance(floor, HalfSpace)
    np.testing.assert_allclose((floor.point, floor.normal), [[0, 0, -0.015], [0, 0, 1]])
    assert isinstance(box, Box)
    np.testing.assert_allclose((box.low, box.high), [[-0.2] * 3, [0.4] * 3])
    np.testing.assert_allclose(cell.tracker_place, [3.0, -0.5, 0.7])
    id = made.post("/api/cells/text", json={"text": found["text"], "name": "Floor"}).json()["id"]
    drawn = made.get(f"/api/scenes/cell/{id}").json()
    bodies = drawn.get("scene", drawn)["obstacles"]
    assert [each["name"] for each in bodies] == ["floor", "box 1"]
    assert bodies[1]["high"] == [0.4, 0.4, 0.4]


def test_an_empty_form_is_a_usual_cell(client: Client) -> None:
    made = client()
    names = [each["name"] for each in made.get("/api/presets").json()["presets"]]
    assert len(names) == 11
    for name in names:
        text = described(made, {}, name)["text"]
        cell = parse_cell(text.encode(), "cell.toml")
        assert cell.robot.name == name
        assert cell.tracker.range_bound / cell.tracker.divisor == pytest.approx(7.5e-6)


def dh_table(robot: RobotModel) -> str:
    assert robot.controller is not None
    columns = {
        "theta_deg": robot.theta / DEG, "alpha_deg": robot.alpha / DEG, "d_mm": robot.d / MM,
        "a_mm": robot.a / MM, "axes_sign": robot.controller.sign,
        "axes_offset_deg": robot.controller.offset / DEG,
    }  # fmt: skip
    rows = zip(*columns.values(), strict=True)
    text = "\n".join(";".join(f"{v:.9g}".replace(".", ",") for v in row) for row in rows)
    return f"{';'.join(columns)}\n{text}\n"


def arm_files(robot: RobotModel) -> dict[str, str]:
    """The same arm in each form that the form of a cell takes."""
    unknown = np.full(robot.dof, np.nan)
    table = robot_table(replace(robot, name="bench"), unknown, None)
    named = {key: table[key] for key in ("convention", "dh", "axes_sign", "axes_offset_deg")}
    return {
        "arm.csv": dh_table(robot),
        "arm.toml": write_toml(named),
        "whole.toml": write_toml({"robot": named}),
        "arm.urdf": to_urdf(robot),
    }


@pytest.mark.parametrize("name", ["arm.csv", "arm.toml", "whole.toml", "arm.urdf"])
def test_an_arm_comes_from_a_file(client: Client, name: str) -> None:
    made, arm = client(), preset("KUKA KR160 R1570").nominal()
    sent = made.post(f"/api/files?name={name}", content=arm_files(arm)[name].encode()).json()
    maker = "" if name == "arm.urdf" else "kuka"  # a URDF counts axes as ROS does
    form = {"robot": "", "arm": sent["id"], "convention": arm.convention, "maker": maker}
    numbers = {f"stiffness_{joint}_MNm_per_rad": 1.0 for joint in range(1, 7)}
    found = made.post("/api/cells/form", json={**form, "numbers": numbers}).json()
    assert found["faults"] == {}
    assert found["joints"] == 6
    assert found["arm_files"] == (["arm.urdf"] if name == "arm.urdf" else [])
    stated = {"text": found["text"], "name": "Own arm", "uploads": [sent["id"]]}
    kept = made.post("/api/cells/text", json=stated)
    assert kept.status_code == 201, kept.text
    drawn = made.get(f"/api/scenes/cell/{kept.json()['id']}").json()
    assert "robot" in drawn, drawn
    assert drawn["robot"]["reach_m"] == pytest.approx(arm.reach, abs=1e-6)
    if name != "arm.urdf":  # it states limits, the others none
        free = replace(arm, limits=np.tile([-np.pi, np.pi], (6, 1)))
        expected = forward(arm, choose_posture(free)[None])[0, :3, 3]
        np.testing.assert_allclose(unpacked(drawn["robot"]["tool"])[0, 0], expected, atol=1e-5)
    assert ('maker = "kuka"' in found["text"]) is (maker == "kuka")


def test_a_factory_calibration_of_a_ur_arm_makes_a_cell(client: Client) -> None:
    made, arm = client(), preset("UR5")
    rows = np.array([xyz_rpy(origin) for origin in joint_origins(arm)[0]])
    rows[2, 0] -= 1.5 * MM
    text = kinematics_yaml(rows).encode()
    sent = made.post("/api/files?name=arm.yaml", content=text).json()
    form = {"robot": "", "arm": sent["id"], "numbers": {}}
    found = made.post("/api/cells/form", json=form).json()
    assert (found["faults"], found["arm_files"]) == ({}, ["arm.yaml"])
    assert 'preset = "UR5"\nur_calibration = "arm.yaml"' in found["text"]
    stated = {"text": found["text"], "name": "Own arm", "uploads": [sent["id"]]}
    id = made.post("/api/cells/text", json=stated).json()["id"]
    drawn = made.get(f"/api/scenes/cell/{id}").json()
    assert drawn["robot"]["reach_m"] == pytest.approx(arm.reach + 1.5 * MM)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("arm.csv", "theta_deg,d_mm\n0,1\n", "no column 'alpha_deg', 'a_mm'"),
        ("arm.csv", "theta_deg,alpha_deg,d_mm,a_mm\n0,-90,0.5,0.3\n", "metres"),
        ("arm.toml", 'maker = "kuka"\n', "no DH table"),
        ("arm.urdf", "<robot", "arm.urdf"),
        ("arm.yaml", "kinematics:\n", "arm.yaml: shoulder has no x"),
        ("arm.step", "ISO-10303-21;", "expected .toml, .csv, .urdf, .xml or .yaml"),
    ],
)
def test_a_file_of_no_arm_is_refused_beside_its_field(
    client: Client, name: str, text: str, words: str
) -> None:
    made = client()
    sent = made.post(f"/api/files?name={name}", content=text.encode()).json()
    form = {"robot": "", "arm": sent["id"]}
    faults = made.post("/api/cells/form", json={**form, "numbers": {}}).json()["faults"]
    assert list(faults) == ["arm"]
    assert words in faults["arm"]["text"]


@pytest.mark.parametrize(
    ("numbers", "field", "kind"),
    [
        ({"mass_kg": "heavy"}, "mass_kg", "number"),
        ({"mass_kg": -1}, "mass_kg", "range"),
        ({"tool_z_mm": "1e9"}, "tool_z_mm", "range"),
        ({"repeatability_mm": "nan"}, "repeatability_mm", "range"),
        ({"sigma_um": 0, "sigma_um_per_m": 0}, "sigma_um", "exact"),
        ({"centre_z_mm": 100}, "mass_kg", "massless"),
        ({"floor_z_mm": "low"}, "floor_z_mm", "number"),
        ({"reflector_x_mm": 1, "reflector_y_mm": 2}, "reflector_z_mm", "incomplete"),
        ({**BOX, "box1_high_y_mm": -300}, "box1_high_y_mm", "flat"),
    ],
)
def test_a_refusal_stands_beside_its_field(
    client: Client, numbers: dict[str, Any], field: str, kind: str
) -> None:
    found = described(client(), numbers)
    assert {name: each["kind"] for name, each in found["faults"].items()} == {field: kind}
    assert not found["text"]


def test_more_than_the_rated_load_is_said_and_an_unknown_robot_refused(client: Client) -> None:
    made = client()
    assert described(made, {"mass_kg": 200})["cautions"]["mass_kg"]["most"] == 160.0
    assert described(made, {}, "KUKA KR 9000")["faults"] == {"robot": {"kind": "preset"}}


def test_a_changed_text_is_a_version_and_two_do_not_overwrite_each_other(client: Client) -> None:
    made = client()
    text = described(made, {})["text"]
    id = made.post("/api/cells/text", json={"text": text, "name": "Versions"}).json()["id"]
    second = text.replace("mm = 0.06", "mm = 0.08")
    assert second != text
    where = f"/api/cells/{id}/text"
    assert made.post(where, json={"text": second, "version": 1}).json()["version"] == 2
    late = made.post(where, json={"text": text, "version": 1})
    assert late.status_code == 409
    assert "at version 2, not 1" in late.json()["detail"]
    wrong = made.post(where, json={"text": second.replace("mm =", "millimetre ="), "version": 2})
    assert wrong.status_code == 400
    assert wrong.json()["line"] > 1
    assert made.get(where).text == second
    assert made.get(f"{where}?version=1").text == text


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with serving(tmp_path_factory.mktemp("cells") / "shop") as found:
        yield found


@pytest.fixture
def watched(browser: Any, fresh: Served) -> Iterator[Watched]:
    with watching(browser, fresh) as found:
        yield found


def test_from_the_form_to_the_second_version(watched: Watched, fresh: Served) -> None:
    watched.provoked = ("status of 4",)
    page = watched.page
    page.goto("/")
    watched.find("next-step").click()  # an empty project begins with its cell
    watched.find("cell-preview").get_by_text("preset =").wait_for()
    watched.find("cell-robot").select_option("UR10")
    watched.find("cell-mass_kg").fill("lots")
    watched.find("wrong-mass_kg").wait_for()
    assert watched.find("cell-keep").is_disabled()
    watched.find("cell-mass_kg").fill("2.5")
    watched.find("wrong-mass_kg").wait_for(state="detached")
    watched.find("cell-preview").get_by_text("mass_kg = 2.5").wait_for()
    watched.find("cell-name").fill("Bench <2>")
    page.locator('[data-testid="cell-keep"]:enabled').click()
    watched.find("scene").and_(page.locator('[data-state="ready"]')).wait_for()
    assert "Bench <2>" in watched.find("cell-card").inner_text()

    watched.find("open-text").click()
    area = watched.find("cell-text-area")
    page.wait_for_function("document.querySelector('[data-testid=cell-text-area]')?.value")
    text = area.input_value()
    area.fill(text.replace('preset = "UR10"', 'preset = "UR 9000"'))
    watched.find("cell-text-keep").click()
    assert "no robot preset" in watched.find("cell-text-fault").inner_text()
    area.fill(text.replace("mass_kg = 2.5", "mass_kg = 3.5"))
    watched.find("cell-text-keep").click()
    watched.find("cell-versions").get_by_text("v2").wait_for()

    watched.find("rename").click()
    watched.find("naming-name").fill("Bench two")
    watched.find("naming-note").fill("moved in <June>")
    watched.find("naming-keep").click()
    page.get_by_text("moved in <June>").wait_for()
    assert page.locator("h1").inner_text() == "Bench two"
    watched.find("rename").click()
    watched.find("naming-before").click()
    page.get_by_text("moved in <June>").wait_for(state="detached")
    assert page.locator("h1").inner_text() == "Bench <2>"
    found = httpx.get(f"{fresh.address}/api/items/cell").json()["items"]
    assert [(each["name"], each["version"]) for each in found] == [("Bench <2>", 4)]
    for width in (1280, 820):
        page.set_viewport_size({"width": width, "height": 1000})
        for address in (f"/?cell={found[0]['id']}&edit=1", "/?new=1", "/"):
            page.goto(address)
            page.locator("#sheet").wait_for()
            assert page.evaluate("document.documentElement.scrollWidth") <= width, address


def test_an_arm_from_a_file_and_the_corners_of_a_box(watched: Watched, tmp_path: Path) -> None:
    page, arm = watched.page, preset("UR10").nominal()
    path = tmp_path / "bench.csv"
    path.write_text(dh_table(arm))
    page.goto("/cell?new=1")
    watched.find("cell-preview").get_by_text("preset =").wait_for()
    watched.find("cell-robot").select_option("")
    watched.find("cell-arm").set_input_files(path)
    watched.find("cell-preview").get_by_text('convention = "dh"').wait_for()
    watched.find("cell-convention").select_option("mdh")
    watched.find("cell-preview").get_by_text('convention = "mdh"').wait_for()
    watched.find("group-surroundings").locator("summary").click()
    watched.find("add-box").click()
    low, high = (
        watched.find(f"cell-box1_{corner}_y_mm").bounding_box() for corner in ("low", "high")
    )
    assert low is not None
    assert high is not None
    assert low["x"] == high["x"]
    assert low["y"] < high["y"]
    page.locator('[data-testid="cell-keep"]:enabled').click()
    watched.find("scene").and_(page.locator('[data-state="ready"]')).wait_for()
    assert page.locator("h2", has_text="bench").count()


def test_the_note_of_a_model_s_set_is_changed_where_it_stands(
    watched: Watched, fresh: Served, tmp_path: Path
) -> None:
    program = tmp_path / "part.src"
    program.write_text("DEF part()\nEND\n")
    sent = httpx.post(f"{fresh.address}/api/files?name=part.src", content=program.read_bytes())
    made = httpx.post(
        f"{fresh.address}/api/programs", json={"uploads": [sent.json()["id"]]}, timeout=60.0
    )
    watched.provoked = ("status of 4",)
    watched.page.goto(f"/programs?id={made.json()['id']}")
    watched.find("rename").click()
    watched.find("naming-name").fill("  ")
    watched.find("naming-keep").click()
    watched.page.get_by_text("expected 1 to 200").wait_for()
    watched.find("naming-name").fill("Roughing")
    watched.page.keyboard.press("Enter")
    watched.page.locator("h1", has_text="Roughing").wait_for()
