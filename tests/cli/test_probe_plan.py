"""robotrue probe-plan: files written, keys, warnings, and messages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shop

from robotrue.core.arrays import Array
from robotrue.core.poses import apply, inverse, pose, pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.measurement.formats.part_points import read_points
from robotrue.robot.configuration import axis_relation
from robotrue.robot.forward import forward
from robotrue.robot.inverse import inverse_batch

FRAME = "1000,-200,500,10,-5,3"
T_BASE_PART = pose_from_xyz_abc(np.array([1.0, -0.2, 0.5]), np.deg2rad([10.0, -5.0, 3.0]))
CORNERS = np.array([[x, y, 0.1] for x in (0.0, 200.0, 400.0) for y in (0.0, 300.0)])
DOWN = pose(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
SIDEWAYS = pose(np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]), np.zeros(3))


def posed(points: Array, turn: Array) -> Array:
    """Joints (n, 6) rad with the tool on points of the part, turned as said in base."""
    wanted = pose(np.broadcast_to(turn[:3, :3], (len(points), 3, 3)), apply(T_BASE_PART, points))
    joints = inverse_batch(shop.nominal(), wanted)
    assert np.isfinite(joints).all()
    return joints


@pytest.fixture
def shop_floor(work: Path) -> Path:
    """The folder of the shop, with features on top of a part, and postures from above."""
    rows = [f"T{k},{x:g},{y:g},{z:g},0,0,1" for k, (x, y, z) in enumerate(CORNERS)]
    (work / "features.csv").write_text("\n".join(["name,px_mm,py_mm,pz_mm,ax,ay,az", *rows]) + "\n")
    write_postures(work / "top.csv", "top", DOWN)
    return work


def write_postures(path: Path, name: str, turn: Array) -> None:
    points = np.add(CORNERS, [10.0, 10.0, -5.0]) * MM
    joints = posed(points, turn) / DEG
    lines = ["name,px_mm,py_mm,pz_mm," + ",".join(f"j{i}_deg" for i in range(1, 7))]
    for p, q in zip(points / MM, joints, strict=True):
        lines.append(f"{name}," + ",".join(f"{v:.9f}" for v in (*p, *q)))
    path.write_text("\n".join(lines) + "\n")


def test_touches_a_page_a_picture_and_the_keys(cli, shop_floor: Path) -> None:
    touches, page, picture = (shop_floor / n for n in ("t.csv", "t.html", "t.png"))
    got = cli("probe-plan", shop_floor / "cell.toml", "--part", shop_floor / "features.csv",
              "--machined", shop_floor / "top.csv", "--frame", FRAME, "-n", 8, "-o", touches,
              "--report", page, "--picture", picture, "--json")  # fmt: skip
    assert got.code == 0, got.err
    document = got.document
    assert document["touches"] == 8
    for key in ("expected_rms_mm", "expected_worst_mm", "spread_rms_mm"):
        assert len(document[key]) == 9
    assert document["expected_rms_mm"][-1] <= document["spread_rms_mm"][-1]
    assert document["tried"] == document["candidates"] + sum(document["rejected"].values())
    (group,) = document["groups"]
    assert (group["name"], group["postures"], group["covered"]) == ("top", 6, True)
    assert group["rms_mm"] < group["radius_95_mm"] < 3.0 * group["worst_mm"]
    assert len(document["machined"]) == 6
    assert document["warnings"] == []
    assert any("priors" in note for note in document["notes"])
    early = cli("register", shop_floor / "cell.toml", touches, "-o", shop_floor / "out.toml")
    assert early.code == 1
    assert "t.csv:1: its joints are planned ones, nothing was touched yet." in early.err
    first, rest = touches.read_text().split("\n", 1)
    assert first.startswith("# planned joints, nothing was touched yet")
    touches.write_text(rest)
    back = read_points(touches, axis_relation(shop.nominal())).touches
    assert "a6_deg" in rest
    assert "j1_deg" not in rest
    assert list(back.names) == document["names"]
    np.testing.assert_allclose(back.joints / DEG, document["joints_deg"], atol=1e-5)
    tip = forward(shop.nominal(), back.joints)[:, :3, 3]
    np.testing.assert_allclose(apply(inverse(T_BASE_PART), tip), back.point, atol=1e-7)
    assert "<svg" in page.read_text(encoding="utf-8")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "put the joints at each touch in place of the planned ones" in got.err


def test_a_side_nobody_can_touch_is_warned_of_by_name(cli, shop_floor: Path) -> None:
    write_postures(shop_floor / "end.csv", "end face", SIDEWAYS)
    got = cli("probe-plan", shop_floor / "cell.toml", "--part", shop_floor / "features.csv",
              "--machined", shop_floor / "top.csv", "--machined", shop_floor / "end.csv",
              "--frame", FRAME, "-n", 8, "-o", shop_floor / "t.csv")  # fmt: skip
    assert got.code == 0, got.err
    assert "warning: no touch covers 'end face': expected uncertainty of its points" in got.err
    rows = {line.split()[0]: line.split() for line in got.out.splitlines() if line.strip()}
    assert rows["top"][-1] == "yes"
    assert rows["end"][-1] == "NO"


def test_a_calibrated_model_knows_more(cli, shop_floor: Path) -> None:
    args = ("--part", shop_floor / "features.csv", "--machined", shop_floor / "top.csv", "--frame",
            FRAME, "-n", 5, "-o", shop_floor / "t.csv", "--json")  # fmt: skip
    nominal = cli("probe-plan", shop_floor / "cell.toml", *args).document
    model = cli("probe-plan", shop_floor / "model.rtm", *args).document
    assert model["expected_rms_mm"][-1] < nominal["expected_rms_mm"][-1]
    assert not any("priors" in note for note in model["notes"])
    loose = cli("probe-plan", shop_floor / "model.rtm", *args, "--tool-sigma-mm", 2).document
    assert loose["expected_rms_mm"][-1] > model["expected_rms_mm"][-1]
    unchanged = cli("probe-plan", shop_floor / "model.rtm", *args, "--run", "unchanged").document
    assert unchanged["expected_rms_mm"][:3] == [None, None, None]
    assert not any("compensated by the model" in note for note in unchanged["notes"])


def test_it_stops_below_the_tolerance(cli, shop_floor: Path) -> None:
    got = cli("probe-plan", shop_floor / "model.rtm", "--part", shop_floor / "features.csv",
              "--machined", shop_floor / "top.csv", "--frame", FRAME, "-n", 12, "-o",
              shop_floor / "t.csv", "--tolerance-mm", 0.5, "--json")  # fmt: skip
    assert got.document["stopped"]
    assert got.document["touches"] < 12
    assert got.document["expected_rms_mm"][-1] <= 0.5
    assert "below the tolerance of 0.5 mm" in got.err


def test_a_tool_path_and_a_program_are_machined_too(cli, shop_floor: Path) -> None:
    rows = [f"{x + 10:g},{y + 10:g},{z:g},0,0,1" for x, y, z in CORNERS]
    (shop_floor / "pocket.csv").write_text("\n".join(["x_mm,y_mm,z_mm,i,j,k", *rows]) + "\n")
    got = cli("probe-plan", shop_floor / "cell.toml", "--part", shop_floor / "features.csv",
              "--machined", shop_floor / "pocket.csv", "--machined", shop_floor / "part.src",
              "--frame", FRAME, "-n", 6, "-o", shop_floor / "t.csv", "--json")  # fmt: skip
    assert got.code == 0, got.err
    names = [group["name"] for group in got.document["groups"]]
    assert names[0] == "pocket"
    assert names[1].startswith("part")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("--frame", "1,2,3"), "frame '1,2,3', expected X,Y,Z,A,B,C in mm and deg."),
        (("--run", "fast"), "--run 'fast', expected compensated or unchanged."),
        (("--goal", "least"), "--goal 'least', expected mean or worst."),
        (("--tip-axis", "w"), "axis 'w', expected one of +x, -x, +y, -y, +z, -z."),
        (("--touch-sigma-mm", "-1"), "--touch-sigma-mm -1, expected 0 to 100."),
        (("--frame", "9000,0,0,0,0,0"), "touches of 6 features can be made (out of reach"),
        (("-n", "2"), "2 touches do not fix the frame of part 0"),
        (("-n", "100000"), "100000 touches are requested, there are"),
    ],
)
def test_refusals_write_nothing(cli, shop_floor: Path, change, message: str) -> None:
    out = shop_floor / "t.csv"
    got = cli("probe-plan", shop_floor / "cell.toml", "--part", shop_floor / "features.csv",
              "--machined", shop_floor / "top.csv", "--frame", FRAME, "-n", 8, "-o", out,
              *change)  # fmt: skip
    assert got.code == 1
    assert message in got.err
    assert not out.exists()


def test_nothing_says_where_the_part_stands(cli, shop_floor: Path) -> None:
    got = cli("probe-plan", shop_floor / "cell.toml", "--part", shop_floor / "features.csv",
              "--machined", shop_floor / "top.csv", "-o", shop_floor / "t.csv")  # fmt: skip
    assert got.code == 1
    assert "the rough place of the part in the base is not known" in got.err


def test_a_part_that_has_no_features(cli, shop_floor: Path) -> None:
    text = (shop_floor / "top.csv").read_text().splitlines()
    lines = [text[0] + ",part", *(line + ",lid" for line in text[1:])]
    (shop_floor / "top.csv").write_text("\n".join(lines) + "\n")
    got = cli("probe-plan", shop_floor / "cell.toml", "--part", shop_floor / "features.csv",
              "--machined", shop_floor / "top.csv", "--frame", FRAME, "-o",
              shop_floor / "t.csv")  # fmt: skip
    assert got.code == 1
    assert "part 'lid' has no features; those are of part." in got.err
