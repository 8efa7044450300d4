"""robotrue program: from CL data and an STL to a program, plain and compensated."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import shop

from robotrue.cell.part import PartFrame, PartTable, part_tables
from robotrue.cell.toml_edit import write_toml
from robotrue.core.poses import apply, pose, pose_from_xyz_abc
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM, UM
from robotrue.program.formats import read_job, read_program
from robotrue.program.identity import read_identity
from robotrue.program.posts import FOLDER
from robotrue.program.program import FrameTable, Motion
from robotrue.robot.model import nominal_identity
from robotrue.robot.presets import preset
from robotrue.store.model_file import read_model

PART = pose(matrix_from_abc(np.array([3.0, 0.5, -0.7]) * DEG), np.array([0.95, -0.1, 0.45]))
BASE = "[base]\nxyz_mm = [950, -100, 450]\nabc_deg = [3, 0.5, -0.7]\n"
SIZE = (300.0, 200.0, 100.0)


def apt(points: np.ndarray, *, head: str = "UNITS/MM\nFEDRAT/1200,MMPM\n") -> str:
    return head + "".join(f"GOTO/{x:.4f},{y:.4f},{z:.4f}\n" for x, y, z in points) + "FINI\n"


def raster(*, over: float = 0.0, x: float = 0.0, z: float = 100.0) -> np.ndarray:
    line = np.linspace(20 - over, 280 + over, 14) + x
    rows = [(line[:: 1 - 2 * (k % 2)], np.full(14, 20.0 + 40 * k)) for k in range(5)]
    return np.concatenate([np.stack([*row, np.full(14, z)], axis=1) for row in rows])


def stl(path: Path) -> None:
    """A block of SIZE mm with its corner at the origin, as binary STL."""
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)]) * SIZE
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    data = b"\0" * 80 + struct.pack("<I", len(faces))
    for face in faces:
        data += struct.pack("<12fH", 0, 0, 0, *corners[list(face)].ravel(), 0)
    path.write_bytes(data)


def register(cell: Path, *, identity=None, names=("block",), verdict="GO", model_file="") -> None:
    """Adds part frames to a cell file, as ``robotrue register`` does."""
    identity = identity or nominal_identity(preset("KUKA KR160 R1570"))
    frames = tuple(
        PartFrame(
            name=name,
            T_base_part=PART @ pose(np.eye(3), np.array([k * 1e-3, 0, 0])),
            covariance=np.eye(6) * 1e-8,
            touches=12,
            rms=5e-5,
            verdict=verdict,
        )
        for k, name in enumerate(names)
    )
    table = PartTable(frames=frames, identity=identity, method="points", model_file=model_file)
    cell.write_text(cell.read_text() + "\n" + write_toml(part_tables(table)))


@pytest.fixture
def bench(work: Path) -> Path:
    """The shop with a tool that points away from the flange and one tool path."""
    work.joinpath("top.apt").write_text(apt(raster()))
    return work


def program_points(path: Path) -> tuple[np.ndarray, np.ndarray]:
    program = read_program(path, FrameTable())
    lin = np.flatnonzero(program.motion == Motion.LIN)
    return apply(program.T_base_frame[program.frame[lin]], program.position[lin]), program.line[lin]


def test_a_cl_file_becomes_a_program_in_the_registered_frame(cli, bench: Path) -> None:
    register(bench / "cell.toml")
    got = cli("program", bench / "cell.toml", bench / "top.apt", "-o", bench / "job.src", "--json",
              "--report", bench / "job.html")  # fmt: skip
    assert got.code == 0, got.err
    points, _ = program_points(bench / "job.src")
    want = apply(PART, raster() * MM)
    assert len(points) == len(want) + 2  # the lifts
    assert np.linalg.norm(points[1:-1] - want, axis=1).max() < 1 * UM
    document = got.document
    side = document["sides"][0]
    assert document["output"] == str(bench / "job.src")
    assert document["compensation"] is None
    assert side["name"] == "top"
    assert side["part"] == "block"
    assert side["points"] == 72
    assert side["cut_mm"] == pytest.approx(5 * 260 + 4 * 40 + 100, abs=1)  # and down from the lift
    assert side["duration_s"] > side["cut_mm"] / 20.0 - 5.0
    assert {"limit_margin_deg", "wrist_angle_deg", "spin_deg", "branch", "operations"} <= set(side)
    data = (bench / "job.src").read_bytes()
    made = read_identity(bench / "job.src", data)
    assert made is not None
    assert made.part == "block"
    assert not made.compensated
    assert made.made_from == "top.apt"
    page = (bench / "job.html").read_text()
    assert "all within reach" in page
    assert "top" in page


def test_the_mesh_keeps_points_inside_its_largest_contour(cli, bench: Path) -> None:
    stl(bench / "part.stl")
    (bench / "wide.apt").write_text(apt(raster(over=60.0)))
    register(bench / "cell.toml")
    command = ("program", bench / "cell.toml", bench / "wide.apt", "-o", bench / "job.src",
               "--mesh", bench / "part.stl", "--json")  # fmt: skip
    got = cli(*command)
    assert got.code == 0, got.err
    inside = (raster(over=60.0)[:, 0] >= 0) & (raster(over=60.0)[:, 0] <= 300)
    assert any(f"{inside.sum()} of 70 cutting points" in note for note in got.document["notes"])
    side = got.document["sides"][0]
    assert side["points"] - side["rapid_points"] == inside.sum()
    points, _ = program_points(bench / "job.src")
    in_part = apply(np.linalg.inv(PART), points) / MM
    assert in_part[:, 0].min() > -1e-3
    assert in_part[:, 0].max() < 300 + 1e-3
    wide = cli(*command, "--margin-mm", 61).document["sides"][0]
    assert wide["points"] - wide["rapid_points"] == 70


def test_with_a_model_the_program_is_what_compensate_makes_of_it(cli, bench: Path) -> None:
    model, cell = bench / "model.rtm", bench / "cell.toml"
    cell.write_text(cell.read_text() + BASE)
    assert cli("program", cell, bench / "top.apt", "-o", bench / "plain.src").code == 0
    assert cli("compensate", model, bench / "plain.src", "-o", bench / "a.src").code == 0
    got = cli("program", cell, bench / "top.apt", "-o", bench / "b.src", "--model", model, "--json")
    assert got.code == 0, got.err
    plain, lines = program_points(bench / "plain.src")
    moved, _ = program_points(bench / "b.src")
    assert got.document["compensation"]["compensated"] == len(lines)
    assert (bench / "a.src").read_bytes().split(b"\n", 3)[3] == (
        bench / "b.src"
    ).read_bytes().split(b"\n", 3)[3]
    shift = np.linalg.norm(moved - plain, axis=1)
    assert 0.1 * MM < shift.mean() < 5 * MM
    again = cli("compensate", model, bench / "b.src", "-o", bench / "c.src")
    assert again.code == 1
    assert "compensated already" in again.err


def test_a_frame_registered_with_a_model_asks_for_that_model(cli, bench: Path) -> None:
    from robotrue.calibration.model import identity_of

    identity = identity_of(read_model(bench / "model.rtm").model)
    register(bench / "cell.toml", identity=identity, model_file="model.rtm")
    command = ("program", bench / "cell.toml", bench / "top.apt", "-o", bench / "job.src")
    got = cli(*command, "--json")
    assert any("only a program compensated by that model" in n for n in got.document["notes"])
    assert cli(*command, "--model", bench / "model.rtm").code == 0
    joints = shop.postures(40, seed=9)
    shop.write_csv(bench / "other.csv", joints, shop.points(joints, noise_seed=5))
    done = cli("calibrate", bench / "cell.toml", bench / "other.csv", "-o", bench / "other.rtm",
               "--method", "elastic")  # fmt: skip
    assert done.code == 0, done.err
    before = (bench / "job.src").read_bytes()
    mixed = cli(*command, "--model", bench / "other.rtm", "--json")
    assert mixed.code == 1
    assert mixed.fault["kind"] == "ModelMismatchError"
    assert (bench / "job.src").read_bytes() == before


def test_sides_find_the_part_frame_of_their_name(cli, bench: Path) -> None:
    (bench / "back.apt").write_text(apt(raster(z=101.0)))
    register(bench / "cell.toml", names=("back", "top"))
    command = ("program", bench / "cell.toml", bench / "top.apt", bench / "back.apt", "-o",
               bench / "job.src", "--json")  # fmt: skip
    got = cli(*command)
    assert got.code == 0, got.err
    assert [side["part"] for side in got.document["sides"]] == ["top", "back"]
    named = cli(*command, "--part", "back", "--part", "top").document
    assert [side["part"] for side in named["sides"]] == ["back", "top"]
    bases = read_job(bench / "job.src", FrameTable())[0].T_base_frame[1:]
    assert np.abs(bases[0] - PART).max() < 1e-9
    wrong = cli(*command, "--part", "left")
    assert wrong.fault["message"].startswith("no part 'left' in the cell")
    three = cli(*command, "--part", "top", "--part", "top", "--part", "top")
    assert "--part is given 3 times for 2 tool paths" in three.fault["message"]


def test_a_cell_that_is_not_registered_lends_its_base_and_says_so(cli, bench: Path) -> None:
    cell = bench / "cell.toml"
    cell.write_text(cell.read_text() + BASE)
    got = cli("program", cell, bench / "top.apt", "-o", bench / "job.src", "--json")
    assert "the cell is not registered; its [base] is used" in got.document["notes"][0]
    points, _ = program_points(bench / "job.src")
    base = pose_from_xyz_abc(np.array([0.95, -0.1, 0.45]), np.array([3, 0.5, -0.7]) * DEG)
    np.testing.assert_allclose(points[1:-1], apply(base, raster() * MM), atol=1 * UM)
    refused = cli("program", cell, bench / "top.apt", "-o", bench / "j.src", "--part", "block")
    assert "the cell is not registered" in refused.err
    assert not (bench / "j.src").exists()


def test_a_no_go_frame_is_said(cli, bench: Path) -> None:
    register(bench / "cell.toml", verdict="NO-GO")
    got = cli("program", bench / "cell.toml", bench / "top.apt", "-o", bench / "job.src", "--json")
    assert "part frame 'block' is NO-GO: do not cut" in got.document["notes"][0]


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("far.apt", apt(raster(x=2000.0)), "far.apt:3: out of reach at every"),
        ("cut.apt", "UNITS/MM\nGOTO/1,2,3\nCUTCOM/LEFT\n", "cut.apt:3: CUTCOM/ moves the path"),
        ("slow.apt", apt(raster(), head="UNITS/MM\n"), "slow.apt:2: this point cuts and no feed"),
        ("two.apt", "LOADTL/1\nLOADTL/2\n" + apt(raster()), "two.apt:2: tool '2' is loaded after"),
        ("row.csv", "x_mm,y_mm,z_mm\n1,2,x\n", "row.csv:2: z_mm is 'x'"),
        ("krl.txt", "LIN {X 1,Y 2,Z 3}\n", "krl.txt:1: neither APT or CL data"),
    ],
)
def test_what_is_wrong_is_named_with_file_and_line(cli, bench: Path, name, text, says) -> None:
    register(bench / "cell.toml")
    (bench / name).write_text(text)
    got = cli("program", bench / "cell.toml", bench / name, "-o", bench / "job.src", "--json")
    assert got.code == 1
    assert says in f"{Path(got.fault['source']).name}:{got.fault['line']}: {got.fault['message']}"
    assert not (bench / "job.src").exists()
    assert "Traceback" not in got.err


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--cutter", "w"), "expected x, y, z, -x, -y or -z"),
        (("--home-deg", "1,2,3"), "expected six angles"),
        (("--margin-mm", "-1"), "expected 0 or more"),
        (("--lift-mm", "-1"), "the lift is -1 mm"),
        (("--rapid-mm-per-s", "0"), "rapid 0 mm/s"),
        (("--mesh", "cell.toml"), "no mesh could be read"),
        (
            ("-o", "top.apt"),
            "ends in .apt, as APT or CL data does; a robot program is written (.src, .mod,",
        ),
        (("-o", "1.src"), "program name '1'"),
    ],
)
def test_options_that_cannot_be(cli, bench: Path, monkeypatch, options, says) -> None:
    monkeypatch.chdir(bench)
    got = cli("program", "cell.toml", "top.apt", "-o", "job.src", *options, "--json")
    assert got.code == 1, got.out
    assert says in got.fault["message"]


def test_an_axis_that_is_not_plainly_the_cutter_s_must_be_stated(cli, bench: Path) -> None:
    cell = bench / "cell.toml"
    register(cell)
    text = cell.read_text().replace(
        "xyz_mm = [60, 40, 250]", "xyz_mm = [0, 0, 250]\nabc_deg = [0, -90, 0]"
    )
    cell.write_text(text)
    command = ("program", cell, bench / "top.apt", "-o", bench / "job.src", "--json")
    refused = cli(*command)
    assert "points 90 deg away" in refused.fault["message"]
    assert "--cutter x" in refused.fault["hint"]
    got = cli(*command, "--cutter", "x")
    assert got.code == 0, got.err
    program = read_program(bench / "job.src", FrameTable())
    lin = program.motion == Motion.LIN
    np.testing.assert_allclose(
        program.rotation[lin][:, :, 0], np.tile([0, 0, -1.0], (72, 1)), atol=1e-6
    )


def test_another_maker_s_arm_gets_no_krl(cli, bench: Path) -> None:
    (bench / "ur.toml").write_text('schema = 1\n[robot]\npreset = "UR5"\n')
    got = cli("program", bench / "ur.toml", bench / "top.apt", "-o", bench / "job.src")
    assert got.code == 1
    assert "post 'krl' writes KRL, for arms of kuka" in got.err


def test_a_universal_robot_gets_ur_script_that_reads_back(cli, tmp_path: Path) -> None:
    tmp_path.joinpath("top.apt").write_text(apt(raster()))
    cell = tmp_path / "cell.toml"
    cell.write_text('schema = 1\n[robot]\npreset = "UR10"\n[tool]\nxyz_mm = [0, 0, 150]\n')
    place = pose(np.eye(3), np.array([0.6, -0.1, 0.1]))
    frame = PartFrame(
        name="block", T_base_part=place, covariance=np.eye(6) * 1e-8, touches=12, rms=5e-5,
        verdict="GO",
    )  # fmt: skip
    table = PartTable(frames=(frame,), identity=nominal_identity(preset("UR10")), method="points")
    cell.write_text(cell.read_text() + "\n" + write_toml(part_tables(table)))
    got = cli("program", cell, tmp_path / "top.apt", "-o", tmp_path / "job.script")
    assert got.code == 0, got.err
    points, _ = program_points(tmp_path / "job.script")
    wanted = apply(place, raster() * MM)
    np.testing.assert_allclose(points[1:-1], wanted, atol=1 * UM)


def test_a_post_of_the_user_and_a_compensated_program_in_another_language(cli, bench: Path) -> None:
    from robotrue.calibration.model import identity_of

    cell = bench / "cell.toml"
    cell.write_text(cell.read_text() + '\n[controller]\nangles = "rpy"\n')
    identity = identity_of(read_model(bench / "model.rtm").model)
    register(cell, identity=identity, model_file="model.rtm")
    own = bench / "own.toml"
    own.write_bytes((FOLDER / "krl.toml").read_bytes().replace(b'"HALT"', b'"; HALT"'))
    for options, name in (
        (("--post", own), "a.src"),
        ((), "b.src"),
        (("--language", "krl"), "c.src"),
    ):
        got = cli("program", cell, bench / "top.apt", "-o", bench / name, *options)
        assert got.code == 0, got.err
    texts = {(bench / name).read_bytes().split(b"\n", 2)[2] for name in ("a.src", "b.src", "c.src")}
    assert len(texts) == 1
    command = ("program", cell, bench / "top.apt", "-o", bench / "job.mpf", "--json")
    plain = cli(*command)
    assert plain.code == 0, plain.err
    assert any("writes its work frames to G54" in note for note in plain.document["notes"])
    before, lines = program_points(bench / "job.mpf")
    got = cli(*command, "--model", bench / "model.rtm")
    assert got.code == 0, got.err
    assert got.document["compensation"]["compensated"] == len(lines)
    moved, _ = program_points(bench / "job.mpf")
    assert 0.1 * MM < np.linalg.norm(moved - before, axis=1).mean() < 5 * MM
    wrong = cli("program", cell, bench / "top.apt", "-o", bench / "job.mod")
    assert "post 'rapid' writes RAPID, for arms of abb" in wrong.err


@pytest.mark.parametrize(
    ("arm", "name", "beside"),
    [
        ("ABB IRB 6660-205/1.9", "job.mod", ()),
        ("Fanuc R-2000iC/165F", "job.ls", ("SYSFRAME.VA",)),
        ("Yaskawa GP225", "job.jbi", ("UFRAME.CND", "TOOL.CND")),
    ],
)
def test_other_makers_arms_get_programs_in_their_language(
    cli, bench: Path, arm: str, name: str, beside: tuple[str, ...]
) -> None:
    """Read back with what was written beside it: the points of the tool path in the part frame."""
    base = BASE.replace("950, -100, 450", "1250, -100, 650")
    (bench / "arm.toml").write_text(
        f'schema = 1\n[robot]\npreset = "{arm}"\n[tool]\nxyz_mm = [200, 10, 200]\n'
        f"abc_deg = [1, 60, -2]\n{base}"
    )
    folder = bench / "out"
    folder.mkdir()
    got = cli("program", bench / "arm.toml", bench / "top.apt", "-o", folder / name, "--json")
    assert got.code == 0, got.err
    assert sorted(path.name for path in folder.iterdir()) == sorted((name, *beside))
    points, _ = program_points(folder / name)
    found = pose_from_xyz_abc(np.array([1.25, -0.1, 0.65]), np.array([3, 0.5, -0.7]) * DEG)
    np.testing.assert_allclose(points[1:-1], apply(found, raster() * MM), atol=1 * UM)
    if beside:
        (folder / beside[0]).write_text("//UFRAME 1\nmine\n")
        refused = cli("program", bench / "arm.toml", bench / "top.apt", "-o", folder / name)
        assert f"{beside[0]} beside the program is not of it" in refused.err


def test_the_table_and_the_notes(cli, bench: Path) -> None:
    register(bench / "cell.toml")
    head = "UNITS/MM\nWOBBLE/ON\nFEDRAT/1200,MMPM\n"
    (bench / "top.apt").write_text(apt(raster(), head=head))
    got = cli("program", bench / "cell.toml", bench / "top.apt", "-o", bench / "job.src")
    assert got.code == 0
    row = next(line.split() for line in got.out.splitlines() if line.strip().startswith("top"))
    assert row[1] == "72"
    assert "top.apt:2: WOBBLE is unknown" in got.err
    assert "1 side, " in got.err
    assert b"; 2: WOBBLE/ON" in (bench / "job.src").read_bytes()
    assert json.loads((bench / "job.src.identity.json").read_text())["compensated"] is False
