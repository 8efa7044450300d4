"""A dry run, a hole and a spindle axis on files of a user: numbers made by hand, refusals."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import shop
from typer.testing import CliRunner

from robotrue.cli.main import app
from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG
from robotrue.errors import RobotrueError
from robotrue.robot.forward import forward
from robotrue.robot.statics import deflect_arm


def call(*arguments: object) -> dict:
    done = CliRunner().invoke(app, [*map(str, arguments), "--json"])
    if isinstance(done.exception, RobotrueError):
        raise done.exception
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


def write(path: Path, points: Array, names: bool = False) -> Path:
    head = ("point," if names else "") + "x_mm,y_mm,z_mm"
    rows = [",".join(repr(float(v)) for v in row) for row in points]
    if names:
        rows = [f"{k + 1},{row}" for k, row in enumerate(rows)]
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


PROGRAM = """DEF part()
$BASE={X 10,Y 0,Z 0,A 0,B 0,C 0}
$TOOL={X 60,Y 40,Z 250,A 0,B 0,C 0}
PTP {A1 0,A2 -80,A3 80,A4 0,A5 40,A6 0}
%sEND
"""


@pytest.fixture
def sheet(tmp_path: Path) -> Path:
    """A sheet of five points along 400 mm, with nine targets 50 mm apart."""
    lines = "".join(
        f"LIN {{X 1200.0,Y {y}.0,Z 900.0,A 0,B 120,C 0}}\n" for y in range(200, -201, -50)
    )
    (tmp_path / "part.src").write_text(PROGRAM % lines)
    out = call("dry-run-plan", tmp_path / "part.src", "--points", 5, "-o", tmp_path / "points.csv")
    assert out["points"] == 5
    assert [out["way_mm"], *out["step_mm"]] == pytest.approx([400.0, 100.0, 100.0])
    return tmp_path / "points.csv"


def test_a_dry_run_is_the_statistics_of_its_points(sheet: Path, tmp_path: Path) -> None:
    lines = sheet.read_text().splitlines()
    assert [row.split(",")[2] for row in lines[1:]] == ["5", "7", "9", "11", "13"]
    wanted = np.array([[1210.0, y, 900.0] for y in (200, 100, 0, -100, -200)])
    error = np.random.default_rng(1).normal([0.3, -0.1, 0.2], 0.2, (5, 3))
    out = call("dry-run", sheet, write(tmp_path / "b.csv", wanted + error, True),
               write(tmp_path / "a.csv", (wanted + 0.1 * error)[:4], True))  # fmt: skip
    size = np.sqrt((error**2).sum(axis=1))
    before = out["before"]
    hand = {
        "mean": size.mean(),
        "max": size.max(),
        "sd": np.sqrt(((size - size.mean()) ** 2).sum() / 4),
    }
    assert before["length_mm"] == pytest.approx(hand, abs=1e-9)
    for k, axis in enumerate("xyz"):
        assert before[f"{axis}_mm"]["mean"] == pytest.approx(np.abs(error[:, k]).mean(), abs=1e-9)
        assert before["bias_mm"][k] == pytest.approx(error[:, k].mean(), abs=1e-9)
    assert before["in_band_95"] is None
    assert out["after"]["points"] == 4
    assert out["after"]["not_measured"] == ["5"]


def test_the_models_band_stands_beside(sheet: Path, tmp_path: Path) -> None:
    lines = sheet.read_text().splitlines()
    head = ",".join(f"{n}_{a}_mm" for n in ("predicted_before", "sigma") for a in "xyz")
    rows = [f"{row},0.3,0,0,0.1,0.1,0.1" for row in lines[1:]]
    rows[4] = f"{lines[5]},,,,,,"
    sheet.write_text("\n".join([f"{lines[0]},{head}", *rows]) + "\n")
    wanted = np.array([[1210.0, y, 900.0] for y in (200, 100, 0, -100, -200)])
    wanted[:, 0] += [0.3, 0.49, 0.11, 0.5, 0.9]
    out = call("dry-run", sheet, write(tmp_path / "b.csv", wanted, True))
    assert out["before"]["in_band_95"] == 0.75


def test_points_that_cannot_be_are_refused_with_their_line(sheet: Path, tmp_path: Path) -> None:
    wanted = np.array([[1210.0, y, 900.0] for y in (200, 100, 0, -100, -200)])
    for points, said, line in (
        (wanted / 1000.0, r"point '1' is 15\d\d\.\d mm from its target", 2),
        (np.vstack([wanted, wanted[:1]]), "point '6' was not planned", 7),
    ):
        with pytest.raises(RobotrueError, match=said) as caught:
            call("dry-run", sheet, write(tmp_path / "b.csv", points, True))
        assert caught.value.line == line
    twice = write(tmp_path / "b.csv", wanted, True)
    twice.write_text(twice.read_text().replace("\n2,", "\n1,"))
    with pytest.raises(RobotrueError, match="point '1' is measured twice"):
        call("dry-run", sheet, twice)
    with pytest.raises(RobotrueError, match="1 points, at least 2"):
        call("dry-run-plan", sheet.with_name("part.src"), "--points", 1, "-o", tmp_path / "p.csv")


def wall(radius: Array, centre: tuple[float, float], turn: Array) -> Array:
    ring = np.column_stack([centre[0] + radius * np.cos(turn), centre[1] + radius * np.sin(turn)])
    return np.vstack([np.column_stack([ring, np.full(len(turn), z)]) for z in (0.0, -2.0, -4.0)])


def test_a_hole_made_by_hand_comes_back_to_a_nanometre(tmp_path: Path) -> None:
    turn = np.arange(24) * np.pi / 12.0
    lobes = 0.03 * np.cos(3.0 * turn)  # orthogonal to centre and radius on whole turns
    points = write(tmp_path / "h.csv", wall(5.1 + lobes, (40.144, 29.702), turn))
    found = call("hole", points, "--diameter-mm", 10, "--centre-mm", "40,30")["hole"]
    size = np.tile(np.abs(0.1 + lobes), 3)
    hand = {
        "x_mm": 0.144, "y_mm": -0.298, "position_mm": np.hypot(0.144, 0.298), "diameter_mm": 10.2,
        "contour_mean_mm": size.mean(), "contour_max_mm": 0.13, "contour_sd_mm": size.std(ddof=1),
    }  # fmt: skip
    assert {k: found[k] for k in hand} == pytest.approx(hand, abs=2e-6)  # lobes couple at 2nd order
    assert found["roundness_mm"] == pytest.approx(0.06, abs=2e-6)
    round_hole = write(tmp_path / "r.csv", wall(np.full(24, 5.1), (40.144, 29.702), turn))
    exact = call("hole", round_hole, "--diameter-mm", 10, "--centre-mm", "40,30")["hole"]
    hand |= {"contour_mean_mm": 0.1, "contour_max_mm": 0.1, "contour_sd_mm": 0.0}
    hand["roundness_mm"] = 0.0
    assert {k: exact[k] for k in hand} == pytest.approx(hand, abs=1e-9)
    # 72 even points of 10 um over a tall hole: the axis is known best at mid-height, z = -2 mm
    slope = 0.010 * np.sqrt(2.0 / (24 * 8.0))
    centre = 0.010 * np.sqrt(2.0 / 72)
    assert exact["sigma_diameter_mm"] == pytest.approx(2.0 * 0.010 / np.sqrt(72), rel=1e-6)
    assert exact["sigma_x_mm"] == pytest.approx(np.hypot(centre, 2.0 * slope), rel=1e-6)


def test_the_uncertainty_of_a_hole_is_its_scatter_over_many(tmp_path: Path) -> None:
    turn, random = np.arange(12) * np.pi / 6.0, np.random.default_rng(3)
    off, said = [], []
    for _ in range(60):
        radius = 5.0 + random.normal(0.0, 0.01, 12)
        found = call("hole", write(tmp_path / "h.csv", wall(radius, (0, 0), turn)[:12]),
                     "--diameter-mm", 10)["hole"]  # fmt: skip
        off.append(found["x_mm"])
        said.append(found["sigma_x_mm"])
    assert np.std(off) == pytest.approx(np.mean(said), rel=0.25)


def test_a_scan_is_taken_near_the_wall(tmp_path: Path) -> None:
    turn = np.arange(36) * np.pi / 18.0
    points = wall(np.full(36, 5.1), (1.0, 2.0), turn)
    low, high = points[:36], points[-36:]
    far = high * [4.0, 4.0, 1.0]
    facets = [(low[k], high[k], low[(k + 1) % 36]) for k in range(36)]
    facets += [(high[k], high[(k + 1) % 36], far[k]) for k in range(36)]
    text = "solid scan\n"
    for facet in facets:
        vertices = "".join("vertex " + " ".join(f"{c:.9f}" for c in v) + "\n" for v in facet)
        text += f"facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet\n"
    (tmp_path / "scan.stl").write_text(text + "endsolid scan\n")
    found = call("hole", tmp_path / "scan.stl", "--diameter-mm", 10, "--centre-mm", "1,2")["hole"]
    assert found["points"] == 72
    assert found["diameter_mm"] == pytest.approx(10.2, abs=1e-6)


def test_part_of_a_hole_and_another_unit_are_refused(tmp_path: Path) -> None:
    arc = np.linspace(0.0, 100.0 * DEG, 20)
    part = write(tmp_path / "h.csv", wall(np.full(20, 5.0), (0, 0), arc))
    with pytest.raises(RobotrueError, match="100 deg of the turn, at least 120 deg"):
        call("hole", part, "--diameter-mm", 10)
    turn = np.arange(24) * np.pi / 12.0
    inches = write(tmp_path / "h.csv", wall(np.full(24, 5.0), (0, 0), turn) / 25.4)
    with pytest.raises(RobotrueError, match=r"a hole of 0\.394 mm, nominal are 10 mm"):
        call("hole", inches, "--diameter-mm", 10)


def turned(turn: Array, noise: float = 0.0, seed: int = 0) -> Array:
    """A reflector 40 mm off the axis through (60, 40, 250) mm along (.6, 0, .8)."""
    x, y = np.array([0.8, 0.0, -0.6]), np.array([0.0, 1.0, 0.0])
    circle = 40.0 * (np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * y)
    scatter = np.random.default_rng(seed).normal(0.0, noise, (len(turn), 3)) if noise else 0.0
    return np.array([60.0, 40.0, 250.0]) + circle + scatter


def test_the_spindle_axis_of_an_exact_circle(tmp_path: Path) -> None:
    points = write(tmp_path / "t.csv", turned(np.arange(5) * 0.9))
    out = call("spindle-axis", points, "--length-mm", 100)
    np.testing.assert_allclose(out["direction"], [0.6, 0.0, 0.8], atol=1e-12)
    np.testing.assert_allclose(out["point_mm"], [60.0, 40.0, 250.0], atol=1e-9)
    np.testing.assert_allclose(out["tool"]["xyz_mm"], [120.0, 40.0, 330.0], atol=1e-6)
    z = matrix_from_abc(np.array(out["tool"]["abc_deg"]) * DEG)[:, 2]
    np.testing.assert_allclose(z, [0.6, 0.0, 0.8], atol=1e-9)


def test_the_uncertainty_of_the_axis_is_its_scatter_over_many(tmp_path: Path) -> None:
    from robotrue.cell.spindle_axis import fit_spindle_axis

    turn = np.arange(8) * np.pi / 4.0
    found = [fit_spindle_axis(turned(turn, 0.01, s) * 1e-3, 5e-6) for s in range(400)]
    across = np.array([f.direction @ [0.8, 0.0, -0.6] for f in found])
    stated = np.sqrt(np.mean([f.covariance_direction[0, 0] / 0.64 for f in found]))
    assert np.std(across) == pytest.approx(stated, rel=0.1)
    place = np.array([f.centre[1] for f in found])
    said = np.sqrt(np.mean([f.covariance_centre[1, 1] for f in found]))
    assert np.std(place) == pytest.approx(said, rel=0.1)


def test_points_in_base_go_through_the_robot_into_a_cell(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(shop.CELL)
    joints = np.array([10.0, -80.0, 95.0, 20.0, 60.0, -30.0])
    robot = shop.nominal()
    T = forward(robot, joints[None] * DEG)[0] @ np.linalg.inv(robot.T_flange_tool)
    points = turned(np.arange(8) * np.pi / 4.0) @ T[:3, :3].T + 1e3 * T[:3, 3]
    out = call("spindle-axis", write(tmp_path / "t.csv", points), "--robot", tmp_path / "cell.toml",
               "--joints-deg", ",".join(map(str, joints)), "--cell", tmp_path / "cell.toml",
               "-o", tmp_path / "new.toml")  # fmt: skip
    np.testing.assert_allclose(out["direction"], [0.6, 0.0, 0.8], atol=1e-9)
    text = (tmp_path / "new.toml").read_text()
    assert "xyz_mm = [60.0, 40.0, 250.0]" in text
    assert "abc_deg = [0.0, 36.8698" in text
    assert call("inspect", tmp_path / "new.toml")


def test_a_calibrated_robot_gives_the_axis_that_the_nominal_one_misses(work: Path) -> None:
    joints = shop.postures(1, seed=8)
    tools = [pose(np.eye(3), at) for at in (np.zeros(3), *np.eye(3))]
    arms = [shop.actual().with_tool(tool) for tool in tools]  # gravity and drives included
    o, *ends = (deflect_arm(arm, joints, shop.PAYLOAD)[0].position[0] for arm in arms)
    R = np.column_stack([end - o for end in ends])
    points = write(work / "t.csv", turned(np.arange(8) * np.pi / 4.0) @ R.T + 1e3 * o)
    off = {}
    for robot in ("model.rtm", "cell.toml"):
        out = call("spindle-axis", points, "--robot", work / robot, "--joints-deg",
                   ",".join(map(str, joints[0] / DEG)))  # fmt: skip
        place = np.linalg.norm(np.array(out["point_mm"]) - [60.0, 40.0, 250.0])
        angle = np.degrees(np.linalg.norm(np.cross(out["direction"], [0.6, 0.0, 0.8])))
        off[robot] = np.array([place, angle])
    assert off["cell.toml"][0] > 0.5  # mm beside the true axis
    assert off["model.rtm"][0] < 0.2 * off["cell.toml"][0]
    assert off["model.rtm"][1] < 0.03


@pytest.mark.parametrize(
    ("points", "said"),
    [
        (turned(np.arange(4) * 1.5), "4 points of the reflector, at least 5"),
        (turned(np.linspace(0.0, 100.0 * DEG, 9)), "cover 100 deg of the turn, at least 120 deg"),
        (turned(np.arange(8) * 0.7) + np.eye(8)[:, :3] * 3.0, "off a circle"),
        (np.outer(np.arange(8.0), [1, 2, 3]), "the points lie on a line"),
    ],
)
def test_points_that_tell_no_axis_are_refused(points: Array, said: str, tmp_path: Path) -> None:
    with pytest.raises(RobotrueError, match=said):
        call("spindle-axis", write(tmp_path / "t.csv", points))
