"""Points put into G-code, APT and CSV paths."""

from __future__ import annotations

import re

import insert_cases as cases
import numpy as np
import pytest

from robotrue.core.arm_words import NO_WORD
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError
from robotrue.program.insertion import Insertion, Obstacle
from robotrue.program.lang import find_inserter, find_language
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
    "sinumerik": [0, 0, 0, Obstacle.EVENT, 0, 0, 0],
    "fanuc_gcode": [0, 0, 0, Obstacle.EVENT, 0, 0, 0],
    "apt": [0, 0, 0, Obstacle.EVENT],
    "toolpath_csv": [0, 0, 0],
}


def read(name: str, data: bytes):
    return find_language(name).read_job([("part", data)], frames=TABLE)


@pytest.mark.parametrize("name", PROGRAMS)
def test_moves_from_row_to_row(name):
    job = read(name, PROGRAMS[name])
    assert not (job[0].reason != 0).any(), job[0].notes
    found = find_inserter(name).moves(job)
    if name in ("sinumerik", "fanuc_gcode") and job[0].motion[0] == 1:
        assert found.obstacle[0] == Obstacle.START  # where the program begins
        found = found.obstacle[1:]
    else:
        found = found.obstacle[found.obstacle != Obstacle.START]
    assert found.tolist() == [int(each) for each in OBSTACLES[name]]


@pytest.mark.parametrize("name", PROGRAMS)
def test_thirds_of_lines_are_read_where_they_were_put(name):
    job = read(name, PROGRAMS[name])
    language, program = find_inserter(name), job[0]
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
    language = find_inserter(name)
    new = language.insert(job, language.moves(job), halves(name, job))[0].splitlines()
    at = 0
    for line in PROGRAMS[name].splitlines():  # in order; a block may say words it left out
        words = re.compile(rb".*".join(re.escape(word) for word in re.split(rb"[ (]", line)))
        while not words.match(new[at]):
            at += 1
        at += 1


def halves(name: str, job) -> Insertion:
    del name
    moves = find_inserter(job[0].dialect).moves(job)
    rows = np.flatnonzero((moves.obstacle == 0) & (moves.via < 0))
    middle = (job[0].position[moves.start[rows]] + job[0].position[moves.end[rows]]) / 2.0
    return Insertion(
        move=rows,
        motion=np.ones(len(rows), dtype=np.int64),
        position=middle,
        rotation=job[0].rotation[moves.end[rows]],
        words=np.full((len(rows), job[0].words.shape[1]), NO_WORD),
    )


ARCS = {
    "sinumerik": b"N1 G17 G710 G90\nN2 T1 D1\nN3 G54\nN4 TRAORI\n"
    b"N5 G1 X0.000 Y0.000 Z5.000 A=10.0 B=0.0 C=0.0 F800.0\nN6 G3 X10.000 Y10.000 I0.000 J10.000\n"
    b"N7 X0.000 Y20.000 I-10.000 J0.000\nN8 X-10.000 Y10.000 CR=10.000\n"
    b"N9 G2 X-20.000 Y20.000 CR=10.000 F500.0\nN10 CIP X-30.0 Y30.0 Z5.0 I1=-22.0 J1=28.0 K1=5.0\n"
    b"N11 G1 X0.0 Y0.0 Z9.0\nN12 M30\n",
    "fanuc_gcode": b"%\nO1\nN1 G21 G17 G90\nN2 T1 M6\nN3 G54\nN4 G43.4 H1\n"
    b"N5 G1 X0. Y0. Z5. A10. B0. C0. F800.\nN6 G03 X10. Y10. I0. J10.\nN7 X0. Y20. R10.\n"
    b"N8 X-10. Y10. R10. (HALF)\nN9 G02 X-20. Y20. R10. F500.\nN11 G1 X0. Y0. Z9.\nN12 M30\n%\n",
}


@pytest.mark.parametrize("name", ARCS)
@pytest.mark.parametrize("chosen", [[0], [1], [0, 1], [2, 3], [0, 1, 2, 3]])
def test_arcs_of_a_plane_become_lines(name, chosen):
    """Each in three parts; arcs that are left whole stay the arcs they were."""
    job = read(name, ARCS[name])
    program, language = job[0], find_inserter(name)
    assert not (program.reason != 0).any(), program.notes
    moves = language.moves(job)
    arcs = np.flatnonzero(moves.across == 2)
    assert len(arcs) == 4
    assert (moves.obstacle[arcs] == 0).all()
    assert moves.bending.sum() == (name == "sinumerik")  # CIP goes through any three points
    rows, ends = arcs[chosen], program.position[moves.end[arcs[chosen]]]
    centre = np.array([[0.0, 10.0]] * 3 + [[-20.0, 10.0]])[chosen] * 1e-3
    first = program.position[moves.start[rows], :2] - centre
    turn = (np.where(np.array(chosen) == 3, -1.0, 1.0) * np.pi / 2.0)[:, None] * [1 / 3, 2 / 3]
    if 3 in chosen:  # three quarters or one: the shorter one, about the other centre
        k = chosen.index(3)
        centre[k] = [-0.010, 0.020]
        first[k] = program.position[moves.start[rows[k]], :2] - centre[k]
        turn[k] = -np.pi / 2.0 * np.array([1 / 3, 2 / 3])
    c, s = np.cos(turn), np.sin(turn)
    place = np.stack([c * first[:, :1] - s * first[:, 1:], s * first[:, :1] + c * first[:, 1:]], -1)
    place = np.concatenate([place + centre[:, None], np.full((len(rows), 2, 1), 0.005)], axis=2)
    insertion = Insertion(
        move=np.repeat(rows, 2),
        motion=np.ones(2 * len(rows), dtype=np.int64),
        position=place.reshape(-1, 3),
        rotation=np.repeat(program.rotation[moves.end[rows]], 2, axis=0),
        words=np.full((2 * len(rows), program.words.shape[1]), NO_WORD),
    )
    (written,) = language.insert(job, moves, insertion)
    (again,) = read(name, written)
    assert not (again.reason != 0).any(), again.notes
    found = language.moves((again,))
    parts = np.where(np.isin(np.arange(len(moves)), rows), 3, 1)
    assert len(found) == parts.sum()
    last = np.cumsum(parts) - 1
    assert np.abs(again.position[found.end[last]] - program.position[moves.end]).max() < 1e-9
    assert (found.via[np.repeat(np.isin(np.arange(len(moves)), rows), parts)] == -1).all()
    whole = np.setdiff1d(np.flatnonzero(moves.via >= 0), rows)
    kept = found.via[last[whole]]
    assert np.abs(again.position[kept] - program.position[moves.via[whole]]).max(initial=0) < 1e-9
    assert len(ends) == len(rows)


def test_blocks_say_what_they_need_and_no_more():
    job = read("sinumerik", PROGRAMS["sinumerik"])
    language = find_inserter("sinumerik")
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
        find_inserter("heidenhain")
    assert "krl" in cases.DIALECTS
