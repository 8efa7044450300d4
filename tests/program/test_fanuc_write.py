"""What is rewritten in Fanuc LS programs, how, and what never is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fanuc_samples import JOINTS, POSE, body, changed_lines, read, record, shifted, text
from krl_samples import body as krl_body

from robotrue.core.arm_words import NO_WORD
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG
from robotrue.errors import ShapeError
from robotrue.program.lang import find_language

MOVE = "L P[1] 800.000mm/sec FINE ;"


def test_only_the_numbers_of_used_positions_change_and_stay_in_their_column() -> None:
    program = body(record(1) + record(2), MOVE)
    assert changed_lines(program, shifted(program, (199.9999, 99.99, -0.0001))) == [
        "\tX =  1000.000  mm,\tY =    -0.010  mm,\tZ =   448.750  mm,"
    ]
    assert find_language("fanuc_ls").write(program, shifted(program)) == program.data


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("X =   800.000  mm", "X =   800.031  mm"),
        ("X =800.0mm", "X =800.031mm"),
        ("X = 800 mm", "X = 800.031 mm"),
        ("X =\t800.000000\tmm", "X =\t800.031200\tmm"),
        ("X =     -.020  mm", "X =      .011  mm"),
    ],
)
def test_the_form_of_the_number(old: str, new: str) -> None:
    program = body(record(1).replace("X =   800.000  mm", old), MOVE)
    line = "\t{},\tY =  -100.000  mm,\tZ =   448.750  mm,"
    assert changed_lines(program, shifted(program, (0.0312, 0, 0))) == [line.format(new)]


def test_the_triple_nearest_to_the_printed_one() -> None:
    pose = POSE.replace("180.000", "170.000").replace("-0.000", "10.000")
    program = body(record(1, pose.replace("  15.000", "-180.000")), MOVE)
    turn = matrix_from_abc(np.array([0.0, 0.0, 0.1 * DEG]))
    change = replace(shifted(program), rotation=program.rotation @ turn)
    lines = ["\tW =   170.100 deg,\tP =    10.000 deg,\tR =  -180.000 deg"]
    assert changed_lines(program, change) == lines


def test_configurations_change_where_they_are_told_to() -> None:
    records = record(1, config="N U T, 0, 0, 0") + record(2, config="F D B, 0, -1, 0")
    program = body(records + record(3, config=""), MOVE + "\nL P[2] 5mm/sec FINE ;")
    words = np.full_like(program.words, NO_WORD)
    words[0] = [1, NO_WORD, 0, -1, 0, NO_WORD]
    words[1] = [0, 0, 1, 0, 0, 0]
    words[2] = 1
    change = replace(shifted(program), words=words, changed=np.ones(3, dtype=bool))
    expected = ["F U B, -1, 0, 0", "N D T, 0, 0, 0"]
    line = "    UF : 1, UT : 1,        CONFIG : '{}',"
    assert changed_lines(program, change) == [line.format(each) for each in expected]
    again = read(find_language("fanuc_ls").write(program, change))
    assert again.words[:2].tolist() == [[1, 1, 0, -1, 0, 0], [0, 0, 1, 0, 0, 0]]
    back = np.where(words == NO_WORD, NO_WORD, program.words)
    undone = replace(shifted(again), words=back)
    assert find_language("fanuc_ls").write(again, undone) == program.data


def test_axis_values() -> None:
    program = body(record(1, JOINTS), "J P[1] 5% FINE ;")
    axes = program.axes + np.array([0.5, 0, 0, 0, 0, 30]) * DEG
    change = replace(shifted(program), changed=np.ones(1, dtype=bool), axes=axes)
    assert changed_lines(program, change) == [
        "\tJ1=    10.500 deg,\tJ2=   -70.000 deg,\tJ3=   100.000 deg,",
        "\tJ4=     5.000 deg,\tJ5=    60.000 deg,\tJ6=    10.000 deg",
    ]


def test_external_axes_and_other_groups_are_never_rewritten() -> None:
    more = ",\n\tE1=   800.000  mm\n   GP2:\n    UF : 1, UT : 1,\n\tJ1=   800.000  mm"
    program = body(record(1, more=more), MOVE)
    every = replace(shifted(program, (1.0, 1.0, 1.0)), changed=np.ones(1, dtype=bool))
    assert changed_lines(program, every) == [
        "\tX =   801.000  mm,\tY =   -99.000  mm,\tZ =   449.750  mm,"
    ]


def test_dos_line_ends_are_kept() -> None:
    program = read(text(record(1), MOVE).replace("\n", "\r\n"))
    out = find_language("fanuc_ls").write(program, shifted(program, (1, 0, 0)))
    assert out == program.data.replace(b"X =   800.000", b"X =   801.000")


def test_what_cannot_be_written() -> None:
    program = body(record(1), MOVE)
    with pytest.raises(ShapeError, match=r"test\.ls:9: the new target is \[nan"):
        changed_lines(program, shifted(program, (np.nan, 0, 0)))
    other = krl_body("LIN {X 1,Y 2,Z 3,A 4,B 5,C 6}")
    with pytest.raises(ShapeError, match="was not read by the fanuc_ls dialect"):
        find_language("fanuc_ls").write(other, shifted(other))


@pytest.mark.parametrize(
    "records",
    [
        "p[1]{GP1:UF:1,UT:1,X=1mm,Y=2mm,Z=3mm,W=4deg,P=5deg,R=6deg};\n",
        "P[3]{GP1:UF:1,UT:1,X=9mm,Y=2mm,Z=3mm,W=4deg,P=5deg,R=6deg};"
        "P[1]{GP1:UF:1,UT:1,X=1mm,Y=2mm,Z=3mm,W=4deg,P=5deg,R=6deg};\n",
    ],
)
def test_a_target_that_is_also_read_gets_a_record_of_its_own(records: str) -> None:
    moves = "1:PR[1]=P[1] ;\n2:L P[1] 5mm/sec FINE ;\n3:J P[7] 5% FINE ;\n"
    program = read(f"/PROG A\n/MN\n{moves}/POS\n{records}/END\n")
    moved = find_language("fanuc_ls").write(program, shifted(program, (1.0, 0.0, 0.0)))
    again = read(moved)
    assert b"2:L P[8] 5mm/sec" in moved
    assert b"J P[7]" in moved
    assert moved.count(b"X=1mm") == 1
    assert again.spans.scan.number.tolist() == [*program.spans.scan.number.tolist(), 8]


def test_a_number_of_any_length_names_a_register() -> None:
    digits = "7" * 5000
    program = body(record(1), f"R[{digits}]=R[{digits}]+1 ;\n   2:{MOVE}")
    assert find_language("fanuc_ls").write(program, shifted(program)) == program.data
