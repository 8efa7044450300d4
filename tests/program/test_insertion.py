"""Targets put into programs: which moves may get them, what is written, and what stays."""

from __future__ import annotations

import difflib

import insert_cases as cases
import numpy as np
import pytest

from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ShapeError
from robotrue.program.insertion import Insertion, Moves, Obstacle, job_rows
from robotrue.program.lang import find_inserter, find_language
from robotrue.program.program import FrameTable

FRAME = pose_from_xyz_abc(np.array([900.0, -200.0, 300.0]) * MM, np.array([15.0, -4.0, 8.0]) * DEG)
TOOL = pose_from_xyz_abc(np.array([120.0, -35.0, 260.0]) * MM, np.array([30.0, 80.0, -15.0]) * DEG)
MIDDLE = pose_from_xyz_abc(
    np.array([1600.0, 100.0, 1300.0]) * MM, np.array([150.0, 62.0, 97.0]) * DEG
)
PATH = cases.poses(MIDDLE)


def case(name: str):
    files = cases.files_of(name, PATH, FRAME, TOOL)
    read = cases.reader(name, files, FRAME, TOOL)
    return files, read, read()


def base_positions(job) -> np.ndarray:
    out = []
    for program in job:
        T = program.T_base_frame[program.frame]
        out.append(np.einsum("nij,nj->ni", T[:, :3, :3], program.position) + T[:, :3, 3])
    return np.concatenate(out)


@pytest.mark.parametrize("name", cases.DIALECTS)
def test_moves_are_those_of_the_path(name):
    _, _, job = case(name)
    moves = find_inserter(name).moves(job)
    assert moves.circular.tolist() == [False, False, False, True, False]
    place = base_positions(job)
    wanted = PATH[:, :3, 3]
    assert np.abs(place[moves.start] - wanted[[0, 1, 2, 3, 5]]).max() < 1e-7
    assert np.abs(place[moves.end] - wanted[[1, 2, 3, 5, 6]]).max() < 1e-7
    assert np.abs(place[moves.via[3]] - wanted[4]).max() < 1e-7
    last = {"krl": Obstacle.NONE, "jbi": Obstacle.EVENT}.get(name, Obstacle.TIMED)
    # A point before a MOVC would begin another arc.
    third = Obstacle.FORM if name == "jbi" else Obstacle.NONE
    assert moves.obstacle.tolist() == [0, 0, third, 0, last]


@pytest.mark.parametrize("name", cases.DIALECTS)
def test_what_is_put_in_is_read_where_it_was_put(name):
    _, read, job = case(name)
    language, insertion = find_inserter(name), cases.halves(name, job)
    moves = language.moves(job)
    written = language.insert(job, moves, insertion)
    again = read({p.name: data for p, data in zip(job, written, strict=True)})
    found = language.moves(again)
    assert len(found) == len(moves) + len(insertion) - 1  # the arc's two are one move
    place = base_positions(again)
    parts = np.isin(np.arange(len(moves)), insertion.move) + 1
    ends = found.end[np.cumsum(parts) - 1]  # of the moves that were there
    assert np.abs(place[ends] - base_positions(job)[moves.end]).max() < 1e-9
    new = found.end[(np.cumsum(parts) - 2)[parts == 2]]
    rows = np.flatnonzero(insertion.motion != 2)
    T = FRAME if name != "urscript" else np.eye(4)
    assert np.abs(place[new] - (insertion.position[rows] @ T[:3, :3].T + T[:3, 3])).max() < 1e-7
    assert (np.diff(found.start[1:]) != 0).all()
    said = [{note.partition(": ")[2] for p in each for note in p.notes} for each in (job, again)]
    assert said[0] == said[1]


@pytest.mark.parametrize("name", cases.DIALECTS)
def test_nothing_put_in_changes_no_byte(name):
    files, _, job = case(name)
    language = find_inserter(name)
    words = job[0].words.shape[1]
    nothing = Insertion(
        move=np.empty(0, np.int64),
        motion=np.empty(0, np.int64),
        position=np.empty((0, 3)),
        rotation=np.empty((0, 3, 3)),
        words=np.empty((0, words), np.int64),
    )
    assert list(language.insert(job, language.moves(job), nothing)) == list(files.values())


@pytest.mark.parametrize("name", cases.DIALECTS)
def test_every_line_that_stood_there_stands_there_still(name):
    files, _, job = case(name)
    language, insertion = find_inserter(name), cases.halves(name, job)
    written = language.insert(job, language.moves(job), insertion)
    for before, after in zip(files.values(), written, strict=True):
        old, new = before.decode().splitlines(True), after.decode().splitlines(True)
        gone = [line for line in difflib.ndiff(old, new) if line.startswith("- ")]
        # Counts and line numbers go on; a KRL target gets the numbers it left out.
        if name == "krl":
            assert all("LIN {X" in line for line in gone)
            assert len(gone) <= 1
        elif name == "jbi":
            assert [line.strip() for line in gone] == ["- ///NPOS 7,0,0,1,0,0"]
        elif name == "fanuc_ls":
            assert all(":" in line or "LINE_COUNT" in line for line in gone)
        else:
            assert not gone


def text_of(name: str) -> str:
    _, _, job = case(name)
    language = find_inserter(name)
    return language.insert(job, language.moves(job), cases.halves(name, job))[0].decode()


def test_krl_copies_say_what_the_move_says_and_run_through():
    lines = text_of("krl").split("\r\n")
    assert sum(line.endswith("C_DIS") for line in lines) == 7
    assert next(line for line in lines if "; cut" in line).endswith("C_DIS ; cut")
    stop = next(i for i, line in enumerate(lines) if line.startswith("$VEL")) - 1
    assert not lines[stop].endswith("C_DIS")
    assert lines[stop - 1].startswith("  LIN {X")
    assert lines[stop - 1].endswith("} C_DIS")
    stored = lines.index("LIN XP3 C_DIS")
    assert lines[stored - 1].startswith("LIN {X")
    assert "S 2,T 35,E1 0.0,E2 0.0} C_DIS" in lines[stored - 1]
    assert "A " in lines[-3]  # the last target, which left its angles out


def test_rapid_copies_pass_where_the_move_stops():
    lines = text_of("rapid").splitlines()
    stop = next(i for i, line in enumerate(lines) if "! hold" in line)
    assert ",fine," in lines[stop]
    assert lines[stop - 1].endswith("v100,z0,cutter\\WObj:=fix;")
    assert lines[stop - 1].startswith("  MoveL [[")
    arc = lines.index("  MoveC a{1},a{2},v100,fine,cutter\\WObj:=fix;")
    assert lines[arc - 1].startswith("  MoveC [[")
    assert ",z0," in lines[arc - 1]
    assert "CONST robtarget a{2}:=" in "\n".join(lines)


def test_ur_copies_blend_within_their_parts():
    lines = text_of("urscript").splitlines()
    stop = next(i for i, line in enumerate(lines) if "# stop" in line)
    assert lines[stop - 1].endswith("a=1.2, v=0.25, r=0.00100)")
    assert lines[stop - 2].endswith("r=0.002)")
    assert lines[stop - 3].endswith("r=0.00200)")
    assert lines[stop + 1].endswith(", 1.2, 0.25, 0, 0.00100)")


def test_ur_blend_beyond_half_a_part_is_refused():
    files = {"part.script": case("urscript")[0]["part.script"].replace(b"r=0.002", b"r=0.090")}
    job = cases.reader("urscript", files, FRAME, TOOL)()
    language = find_inserter("urscript")
    with pytest.raises(ConfigurationError, match=r"part.script:5: the blend of 90 mm reaches bey"):
        language.insert(job, language.moves(job), cases.halves("urscript", job))


def test_yaskawa_counts_and_headers_stay_true():
    lines = text_of("jbi").split("\r\n")
    assert lines[3] == "///NPOS 11,0,0,1,0,0"
    points = [line for line in lines if line.startswith("C0")]
    assert [int(line[1:6]) for line in points] == list(range(11))
    assert lines.index("///POSTYPE PULSE") == lines.index(points[-1]) + 1
    moves = [line for line in lines if line.startswith("MOV")]
    named = [int(line.split()[1][1:]) for line in moves]
    assert sorted(named) == list(range(11))
    assert moves[3] == "MOVL C00008 V=20.0 PL=1"  # before the stop at PL=0
    assert moves[6:9] == [
        "MOVC C00009 V=20.0 PL=1", "MOVC C00010 V=20.0 PL=1", "MOVC C00004 V=20.0 PL=1 'over it",
    ]  # fmt: skip


def test_yaskawa_points_get_the_headers_of_their_own_move():
    data = case("jbi")[0]["part.jbi"]
    data = data.replace(b"C00002=", b"///TOOL 1\r\n///RCONF 1,0,0,0,0,0,0,0\r\nC00002=")
    data = data.replace(b"C00003=", b"///RCONF 0,0,0,0,0,0,0,0\r\nC00003=")
    read = cases.reader("jbi", {"part.jbi": data}, FRAME, TOOL)
    job, language = read(), find_inserter("jbi")
    (written,) = language.insert(job, language.moves(job), cases.halves("jbi", job))
    (again,) = read({"part.jbi": written})
    by_name = dict(zip([p[:6] for p in written.split(b"\r\n") if p[:2] == b"C0"],
                       again.words[:, 0].tolist(), strict=False))  # fmt: skip
    assert by_name[b"C00007"] == 0
    assert by_name[b"C00008"] == 1  # before C00002
    assert by_name[b"C00009"] == 0


def test_yaskawa_points_stand_behind_one_that_is_not_read():
    data = case("jbi")[0]["part.jbi"]
    at = data.index(b"C00006=")
    data = data[:at] + b"C00006=1.0,2.0,3.0,4.0,5.0,6.0,7.0" + data[data.index(b"\r\n", at) :]
    read = cases.reader("jbi", {"part.jbi": data}, FRAME, TOOL)
    job, language = read(), find_inserter("jbi")
    (written,) = language.insert(job, language.moves(job), cases.halves("jbi", job))
    lines = written.split(b"\r\n")
    assert lines.index(b"C00006=1.0,2.0,3.0,4.0,5.0,6.0,7.0") + 1 == next(
        i for i, line in enumerate(lines) if line.startswith(b"C00007=")
    )
    assert len(language.moves(read({"part.jbi": written}))) == 8


def test_fanuc_lines_and_positions_count_on():
    lines = text_of("fanuc_ls").splitlines()
    assert lines[2] == "LINE_COUNT\t= 13;"
    numbered = [line for line in lines[4 : lines.index("/POS")] if ":" in line]
    assert [int(line.split(":")[0]) for line in numbered] == list(range(1, 14))
    assert "   5:L P[9] 200mm/sec CNT100 ;" in lines  # before the stop
    assert "   6:L P[3] 200mm/sec FINE ;" in lines
    records = [int(line[2:-2]) for line in lines if line.startswith("P[") and line.endswith("{")]
    assert records == list(range(1, 13))
    assert lines[-1] == "/END"


OBSTACLES = [
    ("krl", "FOR i=1 TO 3\r\nLIN {p}\r\nLIN {q}\r\nENDFOR", [Obstacle.LOOP] * 2),
    ("krl", "LIN {p}\r\nLIN XP3\r\nLIN {q}\r\nLIN XP3", [0, Obstacle.SHARED, 0, Obstacle.SHARED]),
    ("krl", "LIN gf[i]\r\nLIN {p}", [Obstacle.COMPUTED, Obstacle.START]),
    ("krl", "LIN {p}\r\nDRILL(3)\r\nLIN {q}\r\nLIN {p}", [0, Obstacle.START, 0]),
    ("krl", "TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE\r\nLIN {p}\r\nLIN {q}",
     [Obstacle.EVENT, 0]),
    ("krl", "LIN {p} #BASE\r\nLIN {q}", [Obstacle.FORM, 0]),
    ("krl", "IF x THEN\r\nLIN {p}\r\nENDIF\r\nLIN {q}", [Obstacle.START] * 2),
    ("rapid", "WHILE TRUE DO\nMoveL {p},v1,z1,t0;\nENDWHILE", [Obstacle.LOOP]),
    ("rapid", "TriggL {p},v1,trg,z1,t0;\nMoveL {q},v1,z1,t0;", [Obstacle.EVENT, 0]),
    ("rapid", "MoveL a{i},v1,z1,t0;\nMoveL {p},v1,z1,t0;", [Obstacle.COMPUTED, Obstacle.START]),
    ("rapid", "MoveL {p},v1\\T:=3,z1,t0;", [Obstacle.TIMED]),
    ("rapid", "MoveL {p},v1,z1\\Inpos:=i50,t0;", [Obstacle.FORM]),
    ("rapid", "Drill 3;\nMoveL {p},v1,z1,t0;\nWaitTime 1;\nMoveL {q},v1,z1,t0;",
     [Obstacle.START, 0]),
    ("urscript", "  while True:\n    movel({p}, r=0.001)\n  end", [Obstacle.LOOP]),
    ("urscript", "  x = {p}\n  x = {q}\n  movel(x)\n  movel({q})",
     [Obstacle.COMPUTED, Obstacle.START]),
    ("urscript", "  movel({p}, 1, 1, 2)\n  drill()\n  movel({q})",
     [Obstacle.TIMED, Obstacle.START]),
]  # fmt: skip


@pytest.mark.parametrize(("name", "moves", "wanted"), OBSTACLES)
def test_moves_that_are_not_split(name, moves, wanted):
    given = {
        "krl": ("{X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}", "{X 9.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}"),
        "rapid": tuple(
            f"[[{x},2.0,3.0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]" for x in (1.0, 9.0)
        ),
        "urscript": tuple(f"p[0.{x}, 0.2, 0.3, 0.0, 0.0, 0.0]" for x in (1, 2)),
    }[name]
    body = moves.replace("{p}", given[0]).replace("{q}", given[1])
    high = given[0].replace("0.3" if name == "urscript" else "3.0", "0.8")
    tool = "PERS tooldata t0:=[TRUE,[[0,0,0],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];"
    text = {
        "krl": f"DEF a()\r\nPTP {high}\r\n{body}\r\nEND\r\n",
        "rapid": f"MODULE a\n{tool}\nPROC main()\nMoveJ {high},v1,z1,t0;\n{body}\nENDPROC\n"
        "ENDMODULE\n",
        "urscript": f"def a():\n  movej(get_inverse_kin({high}))\n{body}\nend\n",
    }[name]
    files = {"a.src" if name == "krl" else "a": text.encode()}
    if name == "krl" and "XP3" in moves:
        files["a.dat"] = f"DEFDAT a\r\nDECL FRAME XP3={given[1]}\r\nENDDAT\r\n".encode()
    job = find_language(name).read_job(list(files.items()), frames=FrameTable())
    assert find_inserter(name).moves(job).obstacle.tolist() == [int(each) for each in wanted]


def test_an_arc_by_angle_stays_whole():
    text = "DEF a()\r\nPTP {X 1,Y 0,Z 0,A 0,B 0,C 0}\r\nCIRC {X 2,Y 1,Z 0,A 0,B 0,C 0},"
    text += "{X 3,Y 0,Z 0,A 0,B 0,C 0},CA 90.0\r\nLIN {X 9,Y 0,Z 0,A 0,B 0,C 0}\r\nEND\r\n"
    job = find_language("krl").read_job([("a.src", text.encode())], frames=FrameTable())
    assert (find_inserter("krl").moves(job).obstacle != 0).all()


FANUC_AND_YASKAWA = [
    ("fanuc_ls", b"   4:L P[3] 200mm/sec FINE ;", b"   4:  CALL SUB ;", [0, Obstacle.START]),
    (
        "fanuc_ls",
        b"   3:L P[2] 200mm/sec CNT60 ;",
        b"   3:L P[2] R[4]sec CNT60 ;",
        [Obstacle.TIMED],
    ),
    ("fanuc_ls", b"CNT60 ;", b"CNT60 TA  0.10sec,CALL OUT ;", [Obstacle.TIMED]),
    ("fanuc_ls", b"CNT60 ;", b"CNT60 DB 2.0mm,DO[1]=ON ;", [Obstacle.EVENT]),
    ("fanuc_ls", b"   2:  !hello ;", b"   2:  LBL[1] ;", [Obstacle.START, 0]),
    ("jbi", b"DOUT OT#(1) ON", b"CALL JOB:SUB", [0, 0, Obstacle.FORM]),
    ("jbi", b"MOVL C00001 V=20.0 PL=1", b"MOVL C00001 BC00001 V=20.0", [Obstacle.EXTERNAL]),
    ("jbi", b"MOVL C00001 V=20.0 PL=1", b"*again\r\nMOVL C00001 V=20.0", [Obstacle.START, 0]),
]


@pytest.mark.parametrize(("name", "old", "new", "wanted"), FANUC_AND_YASKAWA)
def test_numbered_moves_that_are_not_split(name, old, new, wanted):
    files, _, _ = case(name)
    ((key, data),) = files.items()
    job = cases.reader(name, {key: data.replace(old, new, 1)}, FRAME, TOOL)()
    assert find_inserter(name).moves(job).obstacle.tolist()[: len(wanted)] == [
        int(o) for o in wanted
    ]


def test_obstacles_are_refused_with_their_line():
    _, _, job = case("rapid")
    moves, insertion = find_inserter("rapid").moves(job), cases.halves("rapid", job)
    whole = Moves(
        start=moves.start, via=moves.via, end=moves.end, line=moves.line,
        obstacle=np.full(len(moves), int(Obstacle.LOOP)), spans=moves.spans,
    )  # fmt: skip
    with pytest.raises(ShapeError, match=r"line 8 cannot be split: it is in a loop"):
        find_inserter("rapid").insert(job, whole, insertion)
    arc = cases.shifted(insertion, motion=np.full(len(insertion), 1))
    with pytest.raises(ShapeError, match="line 12 do not suit it"):
        find_inserter("rapid").insert(job, moves, arc)


def test_a_dialect_without_insertion_is_named():
    with pytest.raises(ConfigurationError, match=r"moves of a morse program are not split"):
        find_inserter("morse")
    with pytest.raises(ConfigurationError, match=r"those of apt, fanuc_gcode, fanuc_ls, jbi, krl"):
        find_inserter("heidenhain")


def test_insertions_are_checked():
    row = {
        "motion": np.array([1, 1]), "position": np.zeros((2, 3)),
        "rotation": np.zeros((2, 3, 3)), "words": np.zeros((2, 0), np.int64),
    }  # fmt: skip
    with pytest.raises(ShapeError, match="the moves of an insertion fall"):
        Insertion(move=np.array([1, 0]), **row)
    with pytest.raises(ShapeError, match="LIN, ARC_VIA and ARC_END"):
        Insertion(move=np.array([0, 1]), **(row | {"motion": np.array([0, 1])}))


def test_job_rows_count_through_the_programs():
    _, _, job = case("krl")
    assert job_rows(job).tolist() == [0, 5, 7]
