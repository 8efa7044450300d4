"""Points put into G-code, APT and CSV paths."""

from __future__ import annotations

import re

import insert_cases as cases
import numpy as np
import pytest

from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.core.units import DEG
from robotrue.core.words import NO_WORD
from robotrue.errors import ConfigurationError
from robotrue.program.formats import dialect, inserter
from robotrue.program.insertion import Insertion, Obstacle
from robotrue.program.orientation import OrientationRule
from robotrue.program.program import FrameTable

TABLE = FrameTable(
    bases={"G54": np.eye(4)},
    tools={"T1": np.eye(4)},
    orientation=OrientationRule(angles="rpy", spin=20.0 * DEG),
)
PROGRAMS = {
    "sinumerik": b"N10 G17 G710 G90\r\nN20 T1 D1\r\nN30 G54 G64\r\nN40 TRAORI\r\n"
    b"N50 G0 X10.000 Y-.7694 Z5.000 A=179.7 B=-30.25 C=0.000\r\nN60 G1 Z-11.250 F1000.0 ; down\r\n"
    b"N70 Y21.2911\r\nN80 X20.5 A=178.5\r\nN90 X30.5 M8\r\nN100 X40.5\r\n"
    b"N110 G2 X45.5 Y26.2911 CR=5.000\r\nN120 G1 Y40.0\r\nN130 M30\r\n",
    "fanuc_gcode": b"%\nO1000\nN10 G21 G17 G90\nN20 T1 M6\nN30 G54\nN40 G43.5 H1\n"
    b"N50 G0 X10. Y-.7694 Z5. I0. J0. K1.\nN60 G1 Z-11.25 F1000.\nN70 Y21.2911(HERE)\n"
    b"N80 X20.5 I.1 J0. K.994987\nN90 X30.5 M8\nN100 X40.5\n"
    b"N110 G2 X45.5 Y26.2911 R5.\nN120 G1 Y40.\nN130 M30\n%\n",
    "apt": b"PARTNO A\nUNITS/MM\nMULTAX/ON\nLOADTL/1\n"
    b"GOTO/ 10.00000, 0.00000, 5.00000, 0.0, 0.0, 1.0\n"
    b"GOTO/ 10.00000, 0.00000,-11.25000, 0.0, 0.0, 1.0\nFEDRAT/100.0,MMPM\n"
    b"GOTO/ 10.00000, 20.00000,-11.25000\nGOTO/ 20.50000, 20.00000,-11.25000,$\n"
    b" 0.1, 0.0, 0.994987\nRAPID\nGOTO/ 20.5, 20.0, 30.0\nFINI\n",
    "toolpath_csv": b"x_mm,y_mm,z_mm,i,j,k\n10.0,0.0,5.0,0,0,1\n10.0,0.0,-11.25,0,0,1\n"
    b"10.0,20.0,-11.25,0,0,1\n20.5,20.0,-11.25,0.1,0,0.994987\n",
}
OBSTACLES = {
    # G0; down; across; turning; M8; plain; arc; behind an arc
    "sinumerik": [0, 0, 0, Obstacle.EVENT, 0, Obstacle.FORM, 0],
    "fanuc_gcode": [0, 0, 0, Obstacle.EVENT, 0, Obstacle.FORM, 0],
    "apt": [0, 0, 0, Obstacle.EVENT],
    "toolpath_csv": [0, 0, 0],
}


def read(name: str, data: bytes):
    return dialect(name).read_job([("part", data)], frames=TABLE)


@pytest.mark.parametrize("name", PROGRAMS)
def test_moves_from_row_to_row(name):
    job = read(name, PROGRAMS[name])
    assert not (job[0].reason != 0).any(), job[0].notes
    found = inserter(name).moves(job)
    if name in ("sinumerik", "fanuc_gcode") and job[0].motion[0] == 1:
        assert found.obstacle[0] == Obstacle.START  # where the program begins
        found = found.obstacle[1:]
    else:
        found = found.obstacle[found.obstacle != Obstacle.START]
    assert found.tolist() == [int(each) for each in OBSTACLES[name]]


@pytest.mark.parametrize("name", PROGRAMS)
def test_thirds_of_lines_are_read_where_they_were_put(name):
    job = read(name, PROGRAMS[name])
    language, program = inserter(name), job[0]
    moves = language.moves(job)
    rows = np.flatnonzero((moves.obstacle == 0) & (moves.via < 0))
    start, end = moves.start[rows], moves.end[rows]
    places, turns = [], []
    for share in (1.0 / 3.0, 2.0 / 3.0):
        places.append(program.position[start] + share * (program.position[end]
                                                         - program.position[start]))  # fmt: skip
        way = rotation_vector_from_matrix(
            np.swapaxes(program.rotation[start], 1, 2) @ program.rotation[end]
        )
        turns.append(program.rotation[start] @ matrix_from_rotation_vector(share * way))
    insertion = Insertion(
        move=np.repeat(rows, 2),
        motion=np.ones(2 * len(rows), dtype=np.int64),
        position=np.stack(places, axis=1).reshape(-1, 3),
        rotation=np.stack(turns, axis=1).reshape(-1, 3, 3),
        words=np.full((2 * len(rows), program.words.shape[1]), NO_WORD),
    )
    (written,) = language.insert(job, moves, insertion)
    (again,) = read(name, written)
    found = language.moves((again,))
    assert len(found) == len(moves) + len(insertion)
    parts = np.where(np.isin(np.arange(len(moves)), rows), 3, 1)
    last = np.cumsum(parts) - 1
    assert np.abs(again.position[found.end[last]] - program.position[moves.end]).max() < 1e-9
    assert np.abs(again.rotation[found.end[last]] - program.rotation[moves.end]).max() < 1e-6
    new = np.sort(np.concatenate([last[parts == 3] - 2, last[parts == 3] - 1]))
    assert np.abs(again.position[found.end[new]] - insertion.position).max() < 1e-7
    assert np.abs(again.rotation[found.end[new]] - insertion.rotation).max() < 2e-6
    assert not (again.reason != 0).any()


@pytest.mark.parametrize("name", PROGRAMS)
def test_what_stood_there_stands_there_still(name):
    job = read(name, PROGRAMS[name])
    language = inserter(name)
    new = language.insert(job, language.moves(job), halves(name, job))[0].splitlines()
    at = 0
    for line in PROGRAMS[name].splitlines():  # in order; a block may say words it left out
        words = re.compile(rb".*".join(re.escape(word) for word in re.split(rb"[ (]", line)))
        while not words.match(new[at]):
            at += 1
        at += 1


def halves(name: str, job) -> Insertion:
    del name
    moves = inserter(job[0].dialect).moves(job)
    rows = np.flatnonzero((moves.obstacle == 0) & (moves.via < 0))
    middle = (job[0].position[moves.start[rows]] + job[0].position[moves.end[rows]]) / 2.0
    return Insertion(
        move=rows,
        motion=np.ones(len(rows), dtype=np.int64),
        position=middle,
        rotation=job[0].rotation[moves.end[rows]],
        words=np.full((len(rows), job[0].words.shape[1]), NO_WORD),
    )


def test_blocks_say_what_they_need_and_no_more():
    job = read("sinumerik", PROGRAMS["sinumerik"])
    language = inserter("sinumerik")
    lines = language.insert(job, language.moves(job), halves("", job))[0].split(b"\r\n")
    down = next(i for i, line in enumerate(lines) if b"; down" in line)
    assert (
        lines[down - 1] == b"G1 X10.0000 Y-0.7694 Z-3.1250 A=179.7000 B=-30.2500 C=0.0000 F1000.0"
    )
    assert lines[down].startswith(b"N60 G1 Z-11.250 X10.000000 Y-0.769400 A=179.700000 B=")
    assert lines[down].endswith(b" F1000.0 ; down")
    assert lines[down + 1].startswith(b"X10.0000 Y10.2608 Z-11.2500 A=")
    assert sum(b"M8" in line for line in lines) == 1


def test_heidenhain_is_refused_by_name():
    with pytest.raises(ConfigurationError, match="moves of a heidenhain program are not split"):
        inserter("heidenhain")
    assert "krl" in cases.DIALECTS
