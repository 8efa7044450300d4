"""Programs of every post, read back by our own reader and by a small parser written here."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotrue.core.arm_words import WORDS
from robotrue.core.poses import inverse, pose
from robotrue.core.rotations import (
    matrix_from_abc,
    matrix_from_quat_wxyz,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
)
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError, FormatError
from robotrue.program.formats import read_job
from robotrue.program.formats.stated_feeds import stated_feeds
from robotrue.program.lang import languages
from robotrue.program.orientation import OrientationRule
from robotrue.program.posts import choose_post, read_posts
from robotrue.program.posts.machining_moves import (
    JobSpeeds,
    JointMoves,
    MachiningMoves,
    SideMoves,
)
from robotrue.program.posts.post_description import read_post
from robotrue.program.posts.post_writer import WrittenProgram, write_machining
from robotrue.program.program import FrameTable, Motion, Reason
from robotrue.program.toolpath import Remark, Toolpath

TOOL = pose(matrix_from_abc(np.array([11.0, 60.0, -2.0]) * DEG), np.array([0.2, 0.01, 0.2]))
PARTS = (
    pose(matrix_from_abc(np.array([1.5, 0.3, -0.4]) * DEG), np.array([0.9123, -0.1, 0.5])),
    pose(matrix_from_abc(np.array([1.6, 0.2, -0.4]) * DEG), np.array([0.9133, -0.1, 0.5])),
)
POSTS = tuple(read_posts())
ANGLE = 1e-5 * DEG
REMARKS = (
    Remark(before=2, line=20, text="STOP", known=True),
    Remark(before=4, line=30, text="DELAY/ 2.5", known=True),
    Remark(before=5, line=40, text="SPINDL/12000,RPM,CLW; ]]>", known=True),
)


def _side(T_base_part: np.ndarray, seed: int, words: int, *, points: int = 7) -> SideMoves:
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=(points, 3))
    path = Toolpath(
        name=f"side{seed}",
        source=f"side{seed}.apt",
        position=rng.uniform(-0.3, 0.3, (points, 3)),
        axis=axis / np.linalg.norm(axis, axis=1, keepdims=True),
        feed=np.repeat([0.02, 0.05], [3, points - 3]),
        rapid=np.arange(points) % (points - 1) == 0,
        line=np.arange(points) + 5,
        operation=np.zeros(points, dtype=int),
        operations=("finish",),
        remarks=REMARKS,
    )
    return SideMoves(
        before=_joints(seed, words),
        path=path,
        rotation=matrix_from_rotation_vector(rng.normal(size=(points, 3))),
        words=np.tile([1, 0, 1, 0, 0, 0][:words], (points, 1)),
        T_base_part=T_base_part,
    )


def _joints(seed: int, words: int) -> JointMoves:
    rng = np.random.default_rng(100 + seed)
    turn = matrix_from_rotation_vector(rng.normal(size=(2, 3)))
    return JointMoves(
        axes=rng.uniform(-1.5, 1.5, (2, 6)),
        T_base_tool=pose(turn, rng.uniform(-1, 1, (2, 3))),
        words=np.tile([0, 1, 1, 0, 0, 0][:words], (2, 1)),
    )


def moves_for(name: str) -> MachiningMoves:
    """Two sides with joint moves; of one work frame where the language has no more."""
    post = read_posts()[name]
    words = WORDS[post.words_of]
    parts = PARTS[:1] * 2 if post.stated.one_frame else PARTS
    return MachiningMoves(
        name="job",
        T_flange_tool=TOOL,
        sides=tuple(_side(T, seed, words) for seed, T in enumerate(parts)),
        after=_joints(9, words),
        words_of=post.words_of,
        speeds=JobSpeeds(rapid=0.2),
        remarks=("drive it once slowly",),
    )


def write(name: str, **changes: object) -> WrittenProgram:
    return write_machining(read_posts()[name], replace(moves_for(name), **changes))


def save(program: WrittenProgram, folder: Path) -> Path:
    for name, data in program.files.items():
        (folder / name).write_bytes(data)
    return folder / next(iter(program.files))


def path_poses(job: MachiningMoves) -> np.ndarray:
    """T_base_tool (n, 4, 4) of all points of all paths."""
    return np.concatenate(
        [side.T_base_part @ pose(side.rotation, side.path.position) for side in job.sides]
    )


def path_feeds(job: MachiningMoves) -> np.ndarray:
    return np.concatenate([np.where(s.path.rapid, 0.2, s.path.feed) for s in job.sides])


def require_same(found: np.ndarray, wanted: np.ndarray) -> None:
    """Poses within 1 um and 1e-5 deg."""
    assert found.shape == wanted.shape
    assert np.linalg.norm(found[:, :3, 3] - wanted[:, :3, 3], axis=1).max() < 1 * UM
    apart = np.swapaxes(found[:, :3, :3], 1, 2) @ wanted[:, :3, :3]
    assert np.linalg.norm(rotation_vector_from_matrix(apart), axis=1).max() < 1.2 * ANGLE


@pytest.mark.parametrize("name", POSTS)
def test_our_own_reader_finds_the_same_points_feeds_frames_and_tool(name, tmp_path):
    post, job = read_posts()[name], moves_for(name)
    path = save(write(name), tmp_path)
    frames = FrameTable(
        T_flange_tool=TOOL, T_base_frame=PARTS[0], orientation=OrientationRule(angles="rpy")
    )
    if name not in ("sinumerik", "heidenhain"):  # these two leave tool, or frame, to the control
        frames = FrameTable()
    programs = read_job(path, frames)
    assert programs[0].dialect == post.stated.language
    program = next(each for each in programs if len(each))
    rows = np.flatnonzero(program.motion == Motion.LIN)
    if post.stated.straight_between_sides:  # FMAX lines to the postures of the joint moves
        rapids = np.isinf(stated_feeds(program)[rows])
        wanted = np.concatenate([s.before.T_base_tool for s in job.sides] + [job.after.T_base_tool])
        fast = rows[rapids]
        require_same(PARTS[0] @ pose(program.rotation[fast], program.position[fast]), wanted)
        rows = rows[~rapids]
    T_base_frame = program.T_base_frame[program.frame[rows]]
    tool = program.T_flange_tool[program.tool[rows]]
    require_same(
        T_base_frame @ pose(program.rotation[rows], program.position[rows]), path_poses(job)
    )
    np.testing.assert_allclose(tool, np.broadcast_to(TOOL, tool.shape), atol=1e-9)
    wanted = np.repeat([side.T_base_part for side in job.sides], 7, axis=0)
    np.testing.assert_allclose(T_base_frame, wanted, atol=1e-9)
    assert (program.reason[rows] == Reason.NONE).all()
    if name != "val3":  # speeds are in variables, see the parser below
        np.testing.assert_allclose(stated_feeds(program)[rows], path_feeds(job), rtol=1e-3)
    if post.words_of:
        wanted = np.concatenate([side.words for side in job.sides])
        np.testing.assert_array_equal(program.words[rows], wanted)
    joint = np.flatnonzero(program.motion == Motion.PTP)
    axes = np.concatenate([s.before.axes for s in job.sides] + [job.after.axes])
    if np.isfinite(program.axes[joint]).any():
        np.testing.assert_allclose(program.axes[joint], axes, atol=1e-6)
    elif name == "jbi":
        wanted = np.concatenate([s.before.T_base_tool for s in job.sides] + [job.after.T_base_tool])
        found = pose(program.rotation[joint], program.position[joint])
        require_same(PARTS[0] @ found, wanted)
    else:
        assert name == "heidenhain"


NUMBER = r"([-+]?\d+\.\d+)"


def numbers_of(pattern: str, text: str) -> np.ndarray:
    return np.array([[float(each) for each in row] for row in re.findall(pattern, text)])


def plain(name: str) -> dict[str, str]:
    return {file: data.decode("ascii") for file, data in write(name).files.items()}


def parse_rapid() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    (text,) = plain("rapid").values()
    row = numbers_of(
        rf"MoveL \[\[{','.join([NUMBER] * 3)}\],\[{','.join([NUMBER] * 4)}\],\[[^]]*\],\[[^]]*\]\],"
        rf"v1000\\V:={NUMBER},",
        text,
    )
    assert text.count("t_job\\WObj:=w_job_1;") == text.count("t_job\\WObj:=w_job_2;") == 7
    return row[:, :3] * MM, matrix_from_quat_wxyz(row[:, 3:7]), row[:, 7] * MM


def parse_krl() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    (text,) = plain("krl").values()
    feed, out, speed = 0.0, [], []
    for line in text.splitlines():
        if line.startswith("$VEL.CP="):
            feed = float(line[8:])
        elif line.startswith("LIN "):
            out.append([float(v) for v in re.findall(r"[XYZABC] (\S+?)[,}]", line)])
            speed.append(feed)
    row = np.array(out)
    return row[:, :3] * MM, matrix_from_abc(row[:, 3:] * DEG), np.array(speed)


def parse_urscript() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    (text,) = plain("urscript").values()
    row = numbers_of(
        rf"movel\(pose_trans\(part_\d, p\[{', '.join([NUMBER] * 6)}\]\), a=0\.5, v={NUMBER}", text
    )
    return row[:, :3], matrix_from_rotation_vector(row[:, 3:6]), row[:, 6]


def parse_jbi() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    files = plain("jbi")
    text = files["job.jbi"]
    points = {k: v for k, *v in re.findall(r"^(C\d+)=([^,]+),([^,]+),([^,]+),([^,]+),([^,]+),(\S+)",
                                           text, re.M)}  # fmt: skip
    moves = re.findall(r"^MOVL (C\d+) V=(\S+)", text, re.M)
    row = np.array([[float(v) for v in points[k]] for k, _ in moves])
    assert "///NPOS 20,0,0,0,0,0" in text
    assert len(points) == 20
    assert list(files) == ["job.jbi", "UFRAME.CND", "TOOL.CND"]
    feed = np.array([float(v) for _, v in moves])
    return row[:, :3] * MM, matrix_from_abc(row[:, :2:-1] * DEG), feed * MM


def parse_fanuc() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    text = plain("fanuc_ls")["job.ls"]
    points = dict(re.findall(r"P\[(\d+)\]\{(.*?)\};", text, re.S))
    moves = re.findall(r":L P\[(\d+)\] (\S+)mm/sec", text)
    row = np.array([
        [float(re.search(rf"\b{letter} = (\S+)", points[k])[1]) for letter in "XYZRPW"]
        for k, _ in moves
    ])  # fmt: skip
    assert [re.search(r"UF : (\d)", points[k])[1] for k, _ in moves] == ["1"] * 7 + ["2"] * 7
    assert "'F D T, 0, 0, 0'" in points[moves[0][0]]
    lines = re.findall(r"^ *(\d+):", text, re.M)
    assert f"LINE_COUNT\t= {len(lines)};" in text
    assert [int(line) for line in lines] == list(range(1, len(lines) + 1))
    feed = np.array([float(v) for _, v in moves])
    return row[:, :3] * MM, matrix_from_abc(row[:, 3:] * DEG), feed * MM


def parse_val3() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    from xml.etree import ElementTree

    files = plain("val3")
    tree = ElementTree.fromstring(files["job.dtx"])  # noqa: S314  written here
    (data,) = [each for each in tree.iter() if each.get("name") == "pPath"]
    row = np.array([[float(v.get(k)) for k in ("x", "y", "z", "rx", "ry", "rz")] for v in data])
    turn = np.eye(3)
    for column, axis in zip((3, 4, 5), np.eye(3), strict=True):
        turn = turn @ matrix_from_rotation_vector(row[:, column, None] * DEG * axis)
    feed, speed = 0.0, {}
    for line in files["job.pgx"].splitlines():
        if line.strip().startswith("mStop.tvel="):
            feed = float(line.partition("=")[2])
        elif "movel" in line:
            speed[int(re.search(r"pPath\[(\d+)\]", line)[1])] = feed
    return row[:, :3] * MM, turn, np.array([speed[k] for k in range(14)]) * MM


def parse_g_code(name: str, pattern: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    (text,) = plain(name).values()
    row = numbers_of(pattern, text)
    return row[:, :3] * MM, matrix_from_abc(row[:, 5:2:-1] * DEG), row[:, 6] * MM / 60.0


def parse_sinumerik() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    words = " ".join(f"{letter}{NUMBER}" for letter in ("X", "Y", "Z", "A=", "B=", "C=", "F"))
    return parse_g_code("sinumerik", rf"G1 {words}")


def parse_heidenhain() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    (text,) = plain("heidenhain").values()
    numbers = [int(line.split()[0]) for line in text.splitlines()]
    assert numbers == list(range(len(numbers)))
    words = " ".join(f"{letter}{NUMBER}" for letter in ("X", "Y", "Z", "A", "B", "C"))
    return parse_g_code("heidenhain", rf"L {words} R0 F{NUMBER}")


@pytest.mark.parametrize(
    ("name", "parse"),
    [
        ("krl", parse_krl),
        ("rapid", parse_rapid),
        ("urscript", parse_urscript),
        ("jbi", parse_jbi),
        ("fanuc_ls", parse_fanuc),
        ("val3", parse_val3),
        ("sinumerik", parse_sinumerik),
        ("heidenhain", parse_heidenhain),
    ],
)
def test_a_parser_that_knows_nothing_of_ours_finds_the_same(name, parse):
    job = moves_for(name)
    position, rotation, feed = parse()
    frames = np.repeat([side.T_base_part for side in job.sides], 7, axis=0)
    require_same(pose(rotation, position), inverse(frames) @ path_poses(job))
    np.testing.assert_allclose(feed, path_feeds(job), rtol=1e-3)


def test_every_post_has_a_parser_of_its_own():
    assert set(POSTS) == {
        "krl", "rapid", "urscript", "jbi", "fanuc_ls", "val3", "sinumerik", "heidenhain",
    }  # fmt: skip
    assert {read_posts()[name].stated.language for name in POSTS} <= set(languages())


@pytest.mark.parametrize(
    ("name", "stop", "wait"),
    [
        ("rapid", "Stop;", "WaitTime 2.500;"),
        ("urscript", 'popup("STOP", blocking=True)', "sleep(2.500)"),
        ("jbi", "PAUSE", "TIMER T=2.50"),
        ("fanuc_ls", "PAUSE ;", "WAIT 2.50(sec) ;"),
        ("val3", "wait(bGo)", "delay(2.500)"),
        ("sinumerik", "M0", "G4 F2.500"),
        ("heidenhain", "STOP", "CYCL DEF 9.1 DWELL 2.500"),
    ],
)
def test_a_stop_halts_a_delay_waits_and_comments_end_nothing(name, stop, wait):
    text = next(iter(plain(name).values()))
    lines = [re.sub(r"^ *\d+[: ]", "", line).strip() for line in text.splitlines()]
    assert lines.count(stop) == lines.count(wait) == 2
    spindle = [line for line in lines if "SPINDL/12000" in line]
    assert len(spindle) == 2
    assert "]]>" not in spindle[0] or name != "val3"
    assert spindle[0].count(";") <= 1 or name != "fanuc_ls"
    if name in ("sinumerik", "heidenhain"):
        assert any("S12000" in line for line in lines)
        assert "M30" in lines


def test_without_blending_every_point_is_an_exact_stop():
    for name, passed in (("rapid", "z0\\Z"), ("jbi", "PL=1"), ("fanuc_ls", "CNT10"),
                         ("val3", "mPass)"), ("krl", "C_DIS")):  # fmt: skip
        some = next(iter(plain(name).values()))
        none = next(iter(write(name, speeds=JobSpeeds(blend=0.0)).files.values())).decode()
        assert passed in some
        assert passed not in none.replace("$APO.CDIS", "")


def test_what_the_controller_needs_is_said_with_its_numbers():
    assert "set UFRAME[2] to X 913.3000" in write("fanuc_ls").at_controller[1]
    assert "load UFRAME.CND and TOOL.CND" in write("jbi").at_controller[0]
    assert write("heidenhain").at_controller[-1].startswith("between sides the tool moves on str")


def test_two_work_frames_are_refused_where_a_program_has_one():
    job = replace(moves_for("jbi"), sides=(_side(PARTS[0], 0, 6), _side(PARTS[1], 1, 6)))
    with pytest.raises(ConfigurationError, match="2 part frames; a JBI job by the post 'jbi'"):
        write_machining(read_posts()["jbi"], job)


def test_a_feed_too_slow_for_its_digits_is_refused():
    side = _side(PARTS[0], 0, 6)
    slow = replace(side, path=replace(side.path, feed=np.full(7, 1e-5)))
    with pytest.raises(FormatError, match=r"side0.apt:6: the feed of this point is 0.01 mm/s"):
        write("jbi", sides=(slow,))


OWN = (Path(__file__).parents[2] / "src/robotrue/program/posts/krl.toml").read_text()


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("{x:.4f}", "{xx:.4f}", 21, "moves.linear: no field {xx} here; allowed are PROGRAM, a,"),
        ("{x:.4f}", "{x:.4q}", 21, "moves.linear: field {x} has the form '.4q', expected .4f"),
        ("{x:.4f}", "{x}", 21, "moves.linear: field {x} has the form '', expected .4f, .9t or d"),
        ("LIN {{X", "LIN {X", 21, "moves.linear: "),
        ("stop =", "halt =", 23, "unknown key moves.halt; allowed are line_number, first_line"),
        ('makers = ["kuka"]', 'makers = ["cuca"]', 5, "makers[1] is 'cuca', expected"),
        ('title = "KRL"', "title = 3", 4, "title is 3, expected text in quotation marks"),
        ("HALT", "HALT \u00fc", 23, "moves.stop has letters that are not ASCII"),
        ('language = "krl"', 'language = "cobol"', 3, "language is 'cobol', expected one of apt"),
        ("[moves]", 'configuration = "abb"\n[moves]', 8, "expected makers = ['abb']"),
        ("[moves]", '[words]\nfoo = ["a", "b"]\n[moves]', 9, "words.foo is ['a', 'b'], expected"),
        ("linear =", "blended2 =", None, "blended2"),
    ],
)
def test_a_mistake_in_a_description_names_file_line_key_and_what_is_allowed(
    tmp_path, old, new, line, says
):
    path = tmp_path / "own.toml"
    path.write_text(OWN.replace(old, new), encoding="utf-8")
    with pytest.raises(ConfigurationError) as caught:
        read_post(path)
    assert says in str(caught.value)
    assert caught.value.source == str(path)
    assert line is None or caught.value.line == line


def test_the_suffix_chooses_the_post_and_ambiguity_is_named(tmp_path):
    assert choose_post(Path("a.JBI")).stated.name == "jbi"
    assert choose_post(Path("a.modx")).stated.name == "rapid"
    with pytest.raises(ConfigurationError, match=r"job.xyz: no program in any language has the su"):
        choose_post(Path("job.xyz"))
    with pytest.raises(ConfigurationError, match="no post is called 'cobol'; there are "):
        choose_post(Path("job.src"), name="cobol")
    with pytest.raises(ConfigurationError, match=r"no program in KRL has the suffix .mod"):
        choose_post(Path("job.mod"), name="krl")
    own = tmp_path / "own.toml"
    own.write_text(OWN.replace('".src"', '".txt"'))
    assert choose_post(Path("job.txt"), file=own).source == own
