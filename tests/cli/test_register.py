"""``robotrue register``: the contract, the routes, what it writes and what programs do with it."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
import touched

from robotrue.calibration.model import identity_of
from robotrue.calibration.nominal import NominalModel
from robotrue.cell.config import read_cell
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.store.model_file import read_model

BEGUN = ("--start", "0,-80,80,0,40,0")
KEYS = {"xyz_mm", "abc_deg", "residual_mm", "rms_mm", "outliers", "covariance", "verdict"}


def found_pose(document: dict) -> np.ndarray:
    xyz, abc = (np.array(document[key]) for key in ("xyz_mm", "abc_deg"))
    return pose_from_xyz_abc(xyz * 1e-3, np.deg2rad(abc))


def apart(a: np.ndarray, b: np.ndarray, lever: float = 0.3) -> float:
    """mm: distance of the origins and of a turn at the size of the part."""
    turn = np.linalg.norm(rotation_vector_from_matrix(a[:3, :3].T @ b[:3, :3]))
    return 1e3 * float(np.linalg.norm(a[:3, 3] - b[:3, 3]) + lever * turn)


@pytest.fixture
def points(work: Path) -> Path:
    """Eight feature points measured in base, 0.1 mm per axis."""
    return touched.write(
        work / "points.csv", touched.POINTS, position=touched.in_base(touched.POINTS)
    )


def test_the_contract(cli, work: Path, points: Path) -> None:
    got = cli("register", work / "cell.toml", points, "-o", work / "out.toml", "--json")
    assert got.code == 0, got.err
    document = got.document
    assert set(document) >= KEYS
    assert apart(found_pose(document), touched.T_BASE_PART) < 0.3
    assert list(document["residual_mm"]) == list(touched.NAMES)
    assert 0.02 < document["rms_mm"] < 0.3
    assert document["rms_mm"] == pytest.approx(
        np.sqrt(np.mean(np.square(list(document["residual_mm"].values()))))
    )
    covariance = np.array(document["covariance"])
    assert covariance.shape == (6, 6)
    np.testing.assert_array_equal(covariance, covariance.T)
    assert np.linalg.eigvalsh(covariance).min() > 0.0
    assert (document["outliers"], document["verdict"]) == ([], "GO")


def test_exact_points_give_the_exact_frame(cli, work: Path) -> None:
    path = touched.write(
        work / "p.csv", touched.POINTS, position=touched.in_base(touched.POINTS, noise=0.0)
    )
    got = cli("register", work / "cell.toml", path, "-o", work / "out.toml", "--json")
    np.testing.assert_allclose(got.document["xyz_mm"], [1100.0, -200.0, 500.0], atol=1e-5)
    np.testing.assert_allclose(got.document["abc_deg"], [10.0, -5.0, 3.0], atol=1e-6)
    assert any("better than touching allows" in doubt for doubt in got.document["doubts"])


def test_wrong_touches_are_named_and_not_fitted(cli, work: Path) -> None:
    position = touched.in_base(touched.POINTS)
    position[[3, 5, 6]] += [[0.0, 0.0, 0.005], [-0.01, 0.0, 0.0], [0.0, 0.004, 0.0]]
    path = touched.write(work / "p.csv", touched.POINTS, position=position)
    document = cli("register", work / "cell.toml", path, "-o", work / "o.toml", "--json").document
    assert document["outliers"] == ["K4", "K6", "K7"]
    assert document["residual_mm"]["K6"] > 9.0
    assert apart(found_pose(document), touched.T_BASE_PART) < 0.4
    assert any("K4" in doubt and "probe again" in doubt for doubt in document["doubts"])


def test_the_written_cell_is_the_cell_and_its_part(cli, work: Path, points: Path) -> None:
    document = cli("register", work / "cell.toml", points, "-o", work / "o.toml", "--json").document
    before = (work / "cell.toml").read_text()
    text = (work / "o.toml").read_text()
    assert text.startswith(before.rstrip())
    cell = read_cell(work / "o.toml")
    assert cell.part is not None
    frame = cell.part.frame()
    np.testing.assert_allclose(frame.T_base_part, found_pose(document), atol=1e-12)
    np.testing.assert_array_equal(frame.covariance, document["covariance"])
    np.testing.assert_array_equal(cell.T_base_frame, frame.T_base_part)
    assert cell.part.identity.same(identity_of(NominalModel(robot=cell.robot)))
    assert cell.part.points_file == "points.csv"


def test_the_same_touches_give_the_same_bytes(cli, work: Path, points: Path) -> None:
    for name in ("a.toml", "b.toml"):
        assert cli("register", work / "cell.toml", points, "-o", work / name).code == 0
    assert (work / "a.toml").read_bytes() == (work / "b.toml").read_bytes()
    # Registered again, a registered cell keeps one part: the new one.
    assert cli("register", work / "a.toml", points, "-o", work / "c.toml").code == 0
    assert (work / "c.toml").read_bytes() == (work / "a.toml").read_bytes()


def test_normals_fix_one_direction_each(cli, work: Path) -> None:
    points, normals = touched.on_block(18)
    # The tip slid by millimetres along the faces; only the normals count.
    slid = np.random.default_rng(2).uniform(-0.004, 0.004, points.shape) * (normals == 0.0)
    path = touched.write(
        work / "p.csv",
        points,
        position=touched.in_base(points + slid, noise=2e-5),
        normal=normals,
        names=[f"S{i}" for i in range(18)],
    )
    document = cli("register", work / "cell.toml", path, "-o", work / "o.toml", "--json").document
    assert apart(found_pose(document), touched.T_BASE_PART) < 0.3
    assert document["rms_mm"] < 0.05
    mesh = touched.block(work / "part.stl")
    same = cli(
        "register", work / "cell.toml", path, "-o", work / "m.toml", "--mesh", mesh, "--json"
    )
    assert apart(found_pose(same.document), found_pose(document)) < 1e-3


def test_feature_points_and_normals_in_one_file(cli, work: Path) -> None:
    on_face, normals = touched.on_block(9)
    points = np.vstack([touched.POINTS[:2], on_face])
    path = touched.write(
        work / "p.csv",
        points,
        position=touched.in_base(points, noise=2e-5),
        normal=np.vstack([np.full((2, 3), np.nan), normals]),
        names=[f"S{i}" for i in range(11)],
    )
    document = cli("register", work / "cell.toml", path, "-o", work / "o.toml", "--json").document
    assert apart(found_pose(document), touched.T_BASE_PART) < 0.15


def test_a_model_and_joints_give_frame_and_refined_model(cli, work: Path) -> None:
    points, joints = touched.by_joints(15)
    names = [f"Q{i}" for i in range(15)]
    path = touched.write(work / "p.csv", points, joints_deg=np.rad2deg(joints), names=names)
    got = cli("register", work / "model.rtm", path, "-o", work / "o.toml", "--json")
    document = got.document
    assert document["route"] == "joint"
    assert document["refined_model"] == str(work / "o_model.robotrue")
    assert "probing changed the arm by" in got.err
    assert apart(found_pose(document), touched.T_BASE_PART) < 0.15
    cell = read_cell(work / "o.toml")
    assert cell.part is not None
    assert cell.part.model_file == "o_model.robotrue"
    assert cell.part.identity.same(identity_of(read_model(work / "o_model.robotrue").model))
    assert cell.part.identity.document() == document["model"]
    nominal = cli("register", work / "cell.toml", path, "-o", work / "n.toml", "--json").document
    assert apart(found_pose(nominal), touched.T_BASE_PART) > 3.0 * apart(
        found_pose(document), touched.T_BASE_PART
    )


def test_a_model_left_as_it_is(cli, work: Path) -> None:
    points, joints = touched.by_joints(8)
    path = touched.write(work / "p.csv", points, joints_deg=np.rad2deg(joints))
    args = ("register", work / "model.rtm", path, "-o", work / "o.toml", "--fit", "frame", "--json")
    document = cli(*args).document
    assert (document["route"], document["refined_model"]) == ("frame", None)
    assert document["model"] == identity_of(read_model(work / "model.rtm").model).document()
    assert tomllib.loads((work / "o.toml").read_text())["registration"]["model"]["file"] == (
        "model.rtm"
    )
    assert not (work / "o_model.robotrue").exists()
    assert apart(found_pose(document), touched.T_BASE_PART) < 0.15


def test_few_touches_of_a_nominal_arm_say_what_the_frame_costs(cli, work: Path) -> None:
    points, joints = touched.by_joints(8)
    path = touched.write(work / "p.csv", points, joints_deg=np.rad2deg(joints))
    document = cli("register", work / "cell.toml", path, "-o", work / "o.toml", "--json").document
    assert document["route"] == "frame"
    assert document["model"]["kind"] == "nominal"
    assert any("1.4 mm on another side" in doubt for doubt in document["doubts"])


def test_many_touches_calibrate_a_nominal_arm(cli, work: Path) -> None:
    points, joints = touched.by_joints(30)
    names = [f"Q{i}" for i in range(30)]
    path = touched.write(work / "p.csv", points, joints_deg=np.rad2deg(joints), names=names)
    document = cli("register", work / "cell.toml", path, "-o", work / "o.toml", "--json").document
    assert (document["route"], document["model"]["kind"]) == ("joint", "calibrated")
    assert document["moved_mm"] > 0.3
    assert document["touched_with"]["kind"] == "nominal"
    # The refined arm is the better one at postures it has not touched.
    new = cli("validate", work / "o_model.robotrue", work / "test.csv", "--json").document
    assert new["mean_mm"] < 0.6 * new["before"]["mean_mm"]


def test_one_frame_per_side(cli, work: Path) -> None:
    position = touched.in_base(np.vstack([touched.POINTS, touched.POINTS]))
    position[8:] += [0.0, 0.003, 0.0]
    position[10] += [0.0, 0.0, 0.008]
    path = touched.write(
        work / "p.csv",
        np.vstack([touched.POINTS, touched.POINTS]),
        position=position,
        names=touched.NAMES * 2,
        part=["front"] * 8 + ["back"] * 8,
    )
    document = cli("register", work / "cell.toml", path, "-o", work / "o.toml", "--json").document
    front, back = document["parts"]
    assert (front["part"], back["part"]) == ("front", "back")
    shift = np.array(back["xyz_mm"]) - front["xyz_mm"]
    np.testing.assert_allclose(shift, [0.0, 3.0, 0.0], atol=0.3)
    assert document["xyz_mm"] == front["xyz_mm"]
    assert list(document["residual_mm"])[8:10] == ["back/K1", "back/K2"]
    assert (front["outliers"], back["outliers"]) == ([], ["K3"])
    assert document["outliers"] == ["back/K3"]
    assert any(doubt.startswith("back: Not used: K3") for doubt in document["doubts"])
    cell = read_cell(work / "o.toml")
    assert cell.part is not None
    assert cell.part.names == ("front", "back")


@pytest.mark.parametrize(("form", "line"), [
    ("krl", "$BASE={X 1100.0000,Y -200.0000,Z 500.0000,A 10.000000,B -5.000000,C 3.000000}"),
    ("rapid", 'PERS wobjdata w_part:=[FALSE,TRUE,"",[[1100.0000,-200.0000,500.0000],['),
    ("fanuc", "W: 3.000000  P: -5.000000  R: 10.000000"),
    ("yaskawa", "Rx: 3.000000  Ry: -5.000000  Rz: 10.000000"),
    ("ur", "part = p[1.1000000, -0.2000000, 0.5000000, "),
    ("g54", "G54 X1100.0000 Y-200.0000 Z500.0000 A3.000000 B-5.000000 C10.000000"),
])  # fmt: skip
def test_the_frame_for_controllers(cli, work: Path, form: str, line: str) -> None:
    path = touched.write(
        work / "p.csv", touched.POINTS, position=touched.in_base(touched.POINTS, noise=0.0)
    )
    args = ("register", work / "cell.toml", path, "-o", work / "o.toml", "--frame-format", form)
    assert line in cli(*args).out
    (frame,) = cli(*args, "--json").document["frames"]
    assert line in frame["text"]
    assert frame["order"]


def test_a_tolerance_decides(cli, work: Path, points: Path) -> None:
    args = ("register", work / "cell.toml", points, "-o", work / "o.toml", "--json")
    assert cli(*args, "--tolerance-mm", "2").document["verdict"] == "GO"
    document = cli(*args, "--tolerance-mm", "0.05").document
    assert document["verdict"] == "NO-GO"
    assert "the tolerance is 0.050 mm" in document["reasons"][0]
    assert read_cell(work / "o.toml").part.frame().verdict == "NO-GO"  # type: ignore[union-attr]


PROGRAM = """&ACCESS RVP
DEF job()
$TOOL={X 60,Y 40,Z 250,A 0,B 0,C 0}
LIN {X 100.0,Y 50.0,Z 400.0,A 0,B 120,C 0}
LIN {X 300.0,Y 50.0,Z 400.0,A 0,B 120,C 0}
END
"""


@pytest.fixture
def registered(cli, work: Path) -> Path:
    """Cells registered with the model (m.toml) and with the nominal arm (n.toml), and a program."""
    points, joints = touched.by_joints(8)
    path = touched.write(work / "p.csv", points, joints_deg=np.rad2deg(joints))
    for source, out in (("model.rtm", "m.toml"), ("cell.toml", "n.toml")):
        args = ("register", work / source, path, "-o", work / out, "--fit", "frame")
        assert cli(*args).code == 0
    (work / "job.src").write_bytes(PROGRAM.encode())
    return work


def test_programs_without_a_frame_run_in_the_part(cli, registered: Path) -> None:
    work = registered
    got = cli("compensate", work / "m.toml", work / "job.src", "-o", work / "a.src", "--json",
              *BEGUN)  # fmt: skip
    assert got.code == 0, got.err
    assert got.document["compensated"] == 2
    assert got.document["part"]["name"] == "part"
    by_option = cli("compensate", work / "model.rtm", work / "job.src", "-o", work / "b.src",
                    "--cell", work / "m.toml", *BEGUN)  # fmt: skip
    assert by_option.code == 0, by_option.err
    assert (work / "a.src").read_bytes() == (work / "b.src").read_bytes()
    # The same program with the found frame written into it comes out the same.
    T = read_cell(work / "m.toml").T_base_frame
    x, y, z = T[:3, 3] * 1e3
    a, b, c = got.document["part"]["abc_deg"]
    base = f"$BASE={{X {x:.9f},Y {y:.9f},Z {z:.9f},A {a:.9f},B {b:.9f},C {c:.9f}}}\n"
    (work / "own.src").write_text(PROGRAM.replace("$TOOL", base + "$TOOL"))
    cli("compensate", work / "model.rtm", work / "own.src", "-o", work / "c.src", *BEGUN)
    targets = [line for line in (work / "c.src").read_text().split("\n") if "LIN" in line]
    assert targets == [line for line in (work / "a.src").read_text().split("\n") if "LIN" in line]


@pytest.mark.parametrize(("model", "cell", "cost"), [
    ("cell.toml", "m.toml", "machining with the nominal arm leaves 1.15 mm rms"),
    ("model.rtm", "n.toml", "machining with a calibrated arm leaves 1.12 mm rms"),
    ("other.rtm", "m.toml", "1.12 to 1.15 mm rms"),
])  # fmt: skip
def test_mixed_models_are_refused(cli, registered: Path, model: str, cell: str, cost: str) -> None:
    work = registered
    if model == "other.rtm":
        args = ("calibrate", work / "cell.toml", work / "test.csv", "-o", work / model)
        assert cli(*args, "--method", "geometric").code == 0
    got = cli("compensate", work / model, work / "job.src", "-o", work / "a.src",
              "--cell", work / cell, "--json")  # fmt: skip
    assert got.code == 1
    assert got.fault["kind"] == "ModelMismatchError"
    assert cost in got.fault["message"]
    assert "0.19 mm (nominal) or 0.09 mm (calibrated)" in got.fault["message"]
    assert not list(work.glob("a.src*"))


def test_a_model_file_that_changed_or_went_is_refused(cli, registered: Path) -> None:
    work = registered
    model = (work / "model.rtm").read_bytes()
    (work / "model.rtm").unlink()
    got = cli("compensate", work / "m.toml", work / "job.src", "-o", work / "a.src")
    assert got.code == 1
    assert "model.rtm is not there" in got.err
    (work / "model.rtm").write_bytes(model)
    cli("calibrate", work / "cell.toml", work / "test.csv", "-o", work / "model.rtm",
        "--method", "geometric")  # fmt: skip
    got = cli("compensate", work / "m.toml", work / "job.src", "-o", work / "a.src")
    assert got.code == 1
    assert "1.12 to 1.15 mm rms" in got.err


def test_programs_carry_the_identity(cli, registered: Path) -> None:
    work = registered
    assert cli("compensate", work / "m.toml", work / "job.src", "-o", work / "a.src").code == 0
    made = json.loads((work / "a.src.identity.json").read_text())
    assert made["compensated"] is True
    assert made["model"] == identity_of(read_model(work / "model.rtm").model).document()
    again = cli("compensate", work / "m.toml", work / "a.src", "-o", work / "b.src")
    assert again.code == 1
    assert "compensated already" in again.err
    assert "Try: compensate job.src." in again.err
    # A program of the nominal registration may not be compensated with the calibrated arm.
    same = cli("compensate", work / "n.toml", work / "job.src", "-o", work / "c.src")
    assert same.code == 0
    assert (work / "c.src").read_bytes() == PROGRAM.encode()
    mixed = cli("compensate", work / "model.rtm", work / "c.src", "-o", work / "d.src")
    assert mixed.code == 1
    assert "the program was made with the nominal" in mixed.err
    # Edited by hand, it is nobody's.
    (work / "c.src").write_text(PROGRAM + "; edited\n")
    again = cli("compensate", work / "model.rtm", work / "c.src", "-o", work / "d.src",
                "--allow-steps")  # fmt: skip
    assert again.code == 0


def test_a_frame_of_its_own_and_no_go_are_told(cli, registered: Path) -> None:
    work = registered
    own = PROGRAM.replace("$TOOL", "$BASE={X 1000,Y 0,Z 500,A 0,B 0,C 0}\n$TOOL")
    (work / "own.src").write_text(own)
    text = (work / "m.toml").read_text().replace('"GO"', '"NO-GO"')
    (work / "m.toml").write_text(text)
    got = cli("compensate", work / "m.toml", work / "own.src", "-o", work / "a.src")
    assert got.code == 0
    assert "sets a work frame" in got.err
    assert "part frame 'part' is NO-GO" in got.err


def test_a_side_must_be_named_where_there_are_several(cli, work: Path) -> None:
    twice = np.vstack([touched.POINTS, touched.POINTS])
    path = touched.write(
        work / "p.csv", twice, position=touched.in_base(twice), names=touched.NAMES * 2,
        part=["front"] * 8 + ["back"] * 8,
    )  # fmt: skip
    assert cli("register", work / "cell.toml", path, "-o", work / "o.toml").code == 0
    (work / "job.src").write_bytes(PROGRAM.encode())
    args = ("compensate", work / "o.toml", work / "job.src", "-o", work / "a.src")
    assert "2 part frames: front, back. Try: --part front" in cli(*args).err
    assert "no part 'top' in the cell; it has front, back" in cli(*args, "--part", "top").err
    assert cli(*args, "--part", "back").code == 0


def test_inspect_tells_part_and_model(cli, registered: Path) -> None:
    document = cli("inspect", registered / "m.toml", "--json").document
    assert document["part"]["model"]["kind"] == "calibrated"
    assert document["part"]["frames"][0]["name"] == "part"
    cli("compensate", registered / "m.toml", registered / "job.src", "-o", registered / "a.src")
    document = cli("inspect", registered / "a.src", "--json").document
    assert document["identity"]["compensated"] is True
    assert document["identity"]["model"]["kind"] == "calibrated"


def test_a_registered_cell_brings_its_model_to_the_next_registration(cli, registered: Path) -> None:
    work = registered
    path = touched.write(
        work / "q.csv", touched.POINTS, position=touched.in_base(touched.POINTS, noise=2e-5)
    )
    (work / "next").mkdir()
    got = cli("register", work / "m.toml", path, "-o", work / "next" / "r.toml", "--json")
    assert got.code == 0, got.err
    model = identity_of(read_model(work / "model.rtm").model)
    assert got.document["model"] == model.document()
    stated = tomllib.loads((work / "next" / "r.toml").read_text())["registration"]["model"]
    assert stated["file"] == "../model.rtm"
    again = cli("compensate", work / "next" / "r.toml", work / "job.src", "-o", work / "a.src")
    assert again.code == 0, again.err
