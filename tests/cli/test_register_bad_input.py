"""``robotrue register`` on touches that cannot be right: named, and nothing is written."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import touched

POINTS, NAMES = touched.POINTS, touched.NAMES
ALL = ", ".join(NAMES)


@pytest.fixture
def refused(cli, work: Path) -> Callable[..., str]:
    """Runs a registration that must fail and returns its message; nothing may be left behind."""

    def run(kind: str, *args: object, source: str = "cell.toml") -> str:
        before = {path.name: path.read_bytes() for path in work.iterdir()}
        got = cli("register", work / source, *args, "-o", work / "out.toml", "--json")
        assert got.code == 1, got.out
        assert got.fault["kind"] == kind, got.err
        assert {path.name: path.read_bytes() for path in work.iterdir()} == before
        return str(got.fault["message"])

    return run


def test_points_on_one_line(refused, work: Path) -> None:
    line = np.linspace(0.0, 0.4, 6)[:, None] * [1.0, 0.5, 0.0]
    path = touched.write(work / "p.csv", line, position=touched.in_base(line))
    message = refused("ObservabilityError", path)
    assert "points K1, K2, K3, K4, K5, K6 lie on one line" in message
    assert "rotation about it is not observable" in message


def test_points_at_one_place(refused, work: Path) -> None:
    same = np.tile([0.1, 0.2, 0.3], (5, 1))
    path = touched.write(work / "p.csv", same, position=touched.in_base(same))
    assert "points K1, K2, K3, K4, K5 coincide" in refused("ObservabilityError", path)


def test_too_few_points(refused, work: Path) -> None:
    path = touched.write(work / "p.csv", POINTS[:2], position=touched.in_base(POINTS[:2]))
    assert "2 points (K1, K2), a frame needs 3" in refused("ObservabilityError", path)


def test_a_face_that_was_not_touched(refused, work: Path) -> None:
    flat = np.column_stack([POINTS[:, :2], np.zeros(8)])
    path = touched.write(
        work / "p.csv",
        flat,
        position=touched.in_base(flat),
        normal=np.tile([0.0, 0.0, 1.0], (8, 1)),
    )
    message = refused("ObservabilityError", path)
    assert "8 touches do not locate the part. Undetermined, in part axes: shift along" in message
    assert f"Touches: {ALL}." in message


def test_too_few_for_what_is_asked(refused, work: Path) -> None:
    points, joints = touched.by_joints(3)
    path = touched.write(work / "p.csv", points, joints_deg=np.rad2deg(joints))
    message = refused("ObservabilityError", path, "--fit", "joint")
    assert "touches K1, K2, K3 give 9 numbers" in message
    assert "ask for 12" in message
    measured = touched.write(work / "q.csv", POINTS, position=touched.in_base(POINTS))
    message = refused("ObservabilityError", measured, "--fit", "joint")
    assert f"touches {ALL} have no joints" in message


def test_exchanged_names(refused, work: Path) -> None:
    position = touched.in_base(POINTS)[[1, 0, 2, 3, 4, 5, 6, 7]]
    path = touched.write(work / "p.csv", POINTS, position=position)
    message = refused("ImplausibleDataError", path)
    assert "if names are exchanged (K1 is K2, K2 is K1)" in message


def test_exchanged_names_beside_a_wrong_touch(refused, work: Path) -> None:
    position = touched.in_base(POINTS)[[0, 4, 2, 3, 1, 5, 6, 7]]
    position[6] += 0.03
    path = touched.write(work / "p.csv", POINTS, position=position)
    message = refused("ImplausibleDataError", path)
    assert "K2 was touched at K5, K5 was touched at K2" in message


def test_a_pattern_that_fits_two_ways_is_told(cli, work: Path) -> None:
    square = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.4, 0.2, 0.0], [0.0, 0.2, 0.0]])
    path = touched.write(work / "p.csv", square, position=touched.in_base(square))
    got = cli("register", work / "cell.toml", path, "-o", work / "o.toml", "--json")
    (told,) = [doubt for doubt in got.document["doubts"] if "The pattern fits" in doubt]
    assert "The pattern fits 4 ways" in told
    assert "K1 for K3" in told or "K1 for K2" in told or "K1 for K4" in told
    assert "Probe one point that breaks the symmetry." in told
    assert any("K1, K2, K3, K4 lie in one plane" in doubt for doubt in got.document["doubts"])


@pytest.mark.parametrize("wrong", [(), (2,)])
def test_a_mirrored_part(refused, work: Path, wrong: tuple[int, ...]) -> None:
    position = touched.in_base(POINTS)
    position[list(wrong)] += 0.01
    path = touched.write(work / "p.csv", POINTS * [1.0, -1.0, 1.0], position=position)
    message = refused("ImplausibleDataError", path)
    assert f"the touched points {ALL} are the mirror image of the part" in message


@pytest.mark.parametrize(("nominal", "measured", "what"), [
    (1e-3, 1.0, "the nominal points are in metres"),
    (1.0, 1e-3, "the touched points are in metres"),
    (1 / 25.4, 1.0, "the nominal points are in inches"),
    (1.0, 1 / 25.4, "the touched points are in inches"),
    (1.0, 1.3, "another part, another scale, or names of other points"),
])  # fmt: skip
def test_wrong_units_of_length(
    refused, work: Path, nominal: float, measured: float, what: str
) -> None:
    position = touched.in_base(POINTS) * measured
    path = touched.write(work / "p.csv", POINTS * nominal, position=position)
    message = refused("ImplausibleDataError", path)
    assert what in message
    assert ALL in message


@pytest.mark.parametrize("source", ["cell.toml", "model.rtm"])
def test_radians_for_degrees(refused, work: Path, source: str) -> None:
    points, joints = touched.by_joints(8)
    path = touched.write(work / "p.csv", points, joints_deg=joints)
    message = refused("ImplausibleDataError", path, source=source)
    assert f"joints of {ALL} reach" in message
    metres = touched.write(work / "q.csv", points * 1e-3, joints_deg=np.rad2deg(joints))
    message = refused("ImplausibleDataError", metres, source=source)
    assert "the nominal points are in metres" in message


def test_half_of_the_touches_against_the_rest(refused, work: Path) -> None:
    position = touched.in_base(POINTS)
    position[::2] += 0.02 * np.random.default_rng(4).standard_normal((4, 3))
    path = touched.write(work / "p.csv", POINTS, position=position)
    message = refused("ImplausibleDataError", path)
    assert "4 of 8 touches disagree with the others" in message
    assert "K1 (" in message


def test_three_points_that_contradict_each_other(refused, work: Path) -> None:
    position = touched.in_base(POINTS[:3])
    position[1] += 0.01
    path = touched.write(work / "p.csv", POINTS[:3], position=position)
    message = refused("ImplausibleDataError", path)
    assert "3 touches contradict each other" in message
    assert "K1 (" in message


def test_a_mesh_with_a_hole_or_without_normals(refused, work: Path) -> None:
    points, normals = touched.on_block(12)
    path = touched.write(
        work / "p.csv",
        points,
        position=touched.in_base(points),
        normal=normals,
        names=[f"S{i}" for i in range(12)],
    )
    open_ = touched.block(work / "open.stl", hole=True)
    message = refused("ImplausibleDataError", path, "--mesh", open_)
    assert "the mesh of 11 triangles has 3 open edges, a hole; the first is at (" in message
    cloud = work / "cloud.ply"
    cloud.write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n0 0 0\n1 0 0\n0 1 0\n"
    )
    message = refused("FormatError", path, "--mesh", cloud)
    assert "holds no triangles: points alone have no normals" in message


def test_points_and_normals_off_the_part(refused, work: Path) -> None:
    points, normals = touched.on_block(12)
    names = [f"S{i}" for i in range(12)]
    mesh = touched.block(work / "part.stl")
    off = points.copy()
    off[4] -= 0.01 * normals[4]
    off[7] += 0.02 * normals[7]
    path = touched.write(
        work / "p.csv", off, position=touched.in_base(points), normal=normals, names=names
    )
    message = refused("ImplausibleDataError", path, "--mesh", mesh)
    assert "off the part by more than 0.20 mm: S4 (-10.00 mm), S7 (+20.00 mm)" in message
    normals[3] *= -1.0
    path = touched.write(
        work / "p.csv", points, position=touched.in_base(points), normal=normals, names=names
    )
    message = refused("ImplausibleDataError", path, "--mesh", mesh)
    assert "normals that are not those of the part: S3 (off by 180 deg)" in message


def test_a_side_at_fault_is_named(refused, work: Path) -> None:
    line = np.linspace(0.0, 0.4, 8)[:, None] * [1.0, 0.5, 0.0]
    both = np.vstack([POINTS, line])
    path = touched.write(
        work / "p.csv", both, position=touched.in_base(both), names=NAMES * 2,
        part=["front"] * 8 + ["back"] * 8,
    )  # fmt: skip
    message = refused("ObservabilityError", path)
    assert message.startswith("part 'back': points K1,")


def test_more_sides_than_the_controller_has_frames(refused, work: Path) -> None:
    both = np.vstack([POINTS, POINTS])
    path = touched.write(
        work / "p.csv", both, position=touched.in_base(both), names=NAMES * 2,
        part=["front"] * 8 + ["back"] * 8,
    )  # fmt: skip
    options = ("--frame-format", "g54", "--frame-number", "6")
    message = refused("ConfigurationError", path, *options)
    assert message == "frame number 7 of g54, allowed 1 to 6."


def test_another_robot(refused, work: Path) -> None:
    rows = ["name,px_mm,py_mm,pz_mm," + ",".join(f"j{i}_deg" for i in range(1, 8))]
    rows += [f"K{i},{i},{i * i},0,1,2,3,4,5,6,7" for i in range(4)]
    (work / "p.csv").write_text("\n".join(rows) + "\n")
    message = refused("ModelMismatchError", work / "p.csv")
    assert message == "7 joint columns, KUKA KR160 R1570 has 6 joints."


HEAD = "name,px_mm,py_mm,pz_mm,x_mm,y_mm,z_mm"


@pytest.mark.parametrize(("text", "line", "message"), [
    ("name,px_mm,py_mm,x_mm,y_mm,z_mm\na,1,2,3,4,5\n", 1, "no column pz_mm"),
    ("name,px_mm,py_mm,pz_mm\na,1,2,3\n", 1, "no column a1_deg.., j1_deg.. or x_mm, y_mm, z_mm"),
    ("name,px_mm,py_mm,pz_mm,x_mm,y_mm,z_mm,q\na,1,2,3,4,5,6,7\n", 1, "unknown column 'q'"),
    (f"{HEAD},nx,ny\na,1,2,3,4,5,6,0,1\n", 1, "no column nz"),
    (f"{HEAD}\na,1,2,3,4,5,6\nb,1,nan,3,4,5,6\n", 3, "py_mm of 'b' is nan"),
    (f"{HEAD}\na,1,2,3,4,5,6\nb,1,,3,4,5,6\n", 3, "py_mm of 'b' is blank"),
    (f"{HEAD}\na,1,2,3,4,5,6\n,1,2,3,4,5,6\n", 3, "column 'name' is blank"),
    (f"{HEAD},nx,ny,nz\na,1,2,3,4,5,6,0,0,400\n", 2, "normal of 'a' has length 400"),
])  # fmt: skip
def test_files_that_are_no_points(cli, work: Path, text: str, line: int, message: str) -> None:
    (work / "p.csv").write_text(text)
    got = cli("register", work / "cell.toml", work / "p.csv", "-o", work / "o.toml", "--json")
    assert got.code == 1
    assert (got.fault["kind"], got.fault["line"]) == ("FormatError", line)
    assert message in got.fault["message"]
    assert not (work / "o.toml").exists()


@pytest.mark.parametrize(("options", "message"), [
    (("--frame-format", "siemens"), "frame format 'siemens', expected krl, rapid"),
    (("--frame-format", "g54", "--frame-number", "7"), "frame number 7 of g54, allowed 1 to 6"),
    (("--fit", "both"), "--fit 'both', expected auto, frame or joint"),
    (("--touch-sigma-mm", "0"), "touch is 0 mm, expected above 0 to 100 mm"),
    (("--tolerance-mm", "-1"), "tolerance is -1 mm"),
    (("--probe-radius-mm", "-3"), "--probe-radius-mm is -3 mm"),
    (("--mesh", "gone.stl", "--mesh-unit", "furlong"), "--mesh-unit 'furlong'"),
])  # fmt: skip
def test_options_that_cannot_be(
    refused, work: Path, options: tuple[str, ...], message: str
) -> None:
    path = touched.write(work / "p.csv", POINTS, position=touched.in_base(POINTS))
    assert message in refused("ConfigurationError", path, *options)


def test_an_output_that_is_read(cli, work: Path) -> None:
    path = touched.write(work / "p.csv", POINTS, position=touched.in_base(POINTS))
    before = (work / "cell.toml").read_bytes()
    got = cli("register", work / "cell.toml", path, "-o", work / "cell.toml")
    assert got.code == 1
    assert "the output is cell.toml, which is an input" in got.err
    assert (work / "cell.toml").read_bytes() == before


def test_no_such_folder(cli, work: Path) -> None:
    path = touched.write(work / "p.csv", POINTS, position=touched.in_base(POINTS))
    out = work / "nowhere" / "o.toml"
    got = cli("register", work / "cell.toml", path, "-o", out)
    assert got.code == 1
    assert f"{out}: cannot write: the folder {out.parent} does not exist." in got.err


def test_a_full_disk_leaves_the_old_cell_and_model(
    cli, work: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    points, joints = touched.by_joints(8)
    path = touched.write(work / "p.csv", points, joints_deg=np.rad2deg(joints))
    args = ("register", work / "model.rtm", path, "-o", work / "o.toml")
    assert cli(*args).code == 0
    before = {path.name: path.read_bytes() for path in work.iterdir()}

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    got = cli(*args, "--touch-sigma-mm", "0.2")
    assert got.code == 1
    assert "cannot write: No space left on device." in got.err
    assert {path.name: path.read_bytes() for path in work.iterdir()} == before


URDF = """<robot name="arm"><link name="l0"/>{}</robot>"""
JOINT = (
    '<joint name="j{0}" type="revolute"><origin xyz="0 0 0.4" rpy="{2} 0 0"/><parent link="l{1}"/>'
    '<child link="l{0}"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/>'
    '</joint><link name="l{0}"/>'
)


def test_a_urdf_is_found_from_the_new_cell(cli, work: Path) -> None:
    joints = "".join(JOINT.format(i, i - 1, 1.5707963267948966 * (i == 2)) for i in (1, 2, 3))
    (work / "cells").mkdir()
    (work / "out").mkdir()
    (work / "cells" / "arm.urdf").write_text(URDF.format(joints))
    (work / "cells" / "c.toml").write_text("schema = 1\n[robot]\nurdf = 'arm.urdf'\n")
    path = touched.write(work / "p.csv", POINTS, position=touched.in_base(POINTS))
    got = cli("register", work / "cells" / "c.toml", path, "-o", work / "out" / "r.toml")
    assert got.code == 0, got.err
    assert 'urdf = "../cells/arm.urdf"' in (work / "out" / "r.toml").read_text()
    assert cli("inspect", work / "out" / "r.toml", "--json").document["robot"] == "arm"
