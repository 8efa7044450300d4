"""APT data and CSV paths as programs: points rewritten in place."""

from __future__ import annotations

import numpy as np
import pytest
from path_samples import APT, CSV, RULE, moved, read

from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Program, Reason

TILT = matrix_from_abc(np.array([0.0, 0.0, 0.1]) * DEG)


def apt(text: str, table: FrameTable | None = None) -> Program:
    data = f"UNITS/MM\nMULTAX\n{text}\nFINI\n".encode()
    return read("apt", data, table or FrameTable(orientation=RULE))


def reasons(program: Program) -> list[Reason]:
    return [Reason(each) for each in program.reason.tolist()]


def written(
    program: Program, shift: list[list[float]], turn: np.ndarray | None = None
) -> list[str]:
    change = moved(program, np.array(shift) * 1e-6, np.eye(3) if turn is None else turn)
    return find_language(program.dialect).write(program, change).decode().split("\n")


def test_points_of_a_real_list() -> None:
    program = read("apt", APT)
    line = dict(zip(program.line.tolist(), reasons(program), strict=True))
    assert [line[k] for k in (7, 9, 11, 13, 17)] == [Reason.NONE] * 4 + [Reason.EXPRESSION]
    assert line[12] == Reason.RELATIVE  # GODLTA
    assert line[15] == Reason.EXPRESSION  # inside CYCLE
    assert line[19] == Reason.EXPRESSION  # the end of CIRCLE, and its start in line 17
    assert line[20] == Reason.NONE
    assert line[22] == Reason.UNKNOWN_FRAME  # behind TRANS
    np.testing.assert_allclose(program.position[1] / MM, [11.5, 20.0, -0.5])


def test_axes_are_kept_until_the_next() -> None:
    program = apt("GOTO/1,2,3,0,0.6,0.8\nGOTO/4,5,6\nGOTO/7,8,9,0,0,1")
    axes = RULE.axes_of(program.rotation)
    np.testing.assert_allclose(axes, [[0, 0.6, 0.8], [0, 0.6, 0.8], [0, 0, 1]], atol=1e-15)
    assert reasons(apt("GOTO/1,2,3,0,0.6,0.9")) == [Reason.INCOMPLETE]
    silent = apt("GOTO/1,2,3,0,0,1", FrameTable())
    assert reasons(silent) == [Reason.INCOMPLETE]
    assert any("spin_deg" in note for note in silent.notes)
    tilted = apt("TLAXIS/0,0.6,0.8\nGOTO/1,2,3")
    np.testing.assert_allclose(RULE.axes_of(tilted.rotation)[0], [0, 0.6, 0.8], atol=1e-15)


@pytest.mark.parametrize("word", ["FROM/9,9,9,0,0.6,0.8", "GODLTA/1,0,0,0,0.6,0.8"])
def test_an_axis_is_kept_from_a_start_and_a_step(word: str) -> None:
    program = apt(f"GOTO/1,2,3,0,0,1\n{word}\nGOTO/4,5,6")
    np.testing.assert_allclose(RULE.axes_of(program.rotation)[-1], [0, 0.6, 0.8], atol=1e-15)


def test_a_locked_axis_keeps_its_numbers_and_takes_none() -> None:
    program = apt("GOTO/1,2,3,0,0.6,0.8\nMULTAX/OFF\nGOTO/4.000,5,6\nGOTO/7.000,8,9,0,0.6,0.8")
    assert reasons(program) == [Reason.NONE] * 3
    lines = written(program, [[100, 0, 0]] * 3, TILT)
    assert lines[4:6] == ["GOTO/4.100,5,6", "GOTO/7.100,8,9,0,0.6,0.8"]
    change = moved(program, np.zeros((3, 3)), TILT)
    (told,) = find_language("apt").losses(program, change)
    assert told.worst == pytest.approx(0.1, rel=1e-3)
    unlocked = apt("GOTO/1,2,3,0,0.6,0.8\nMULTAX/OFF\nGOTO/4.000,5,6\nMULTAX/ON\nGOTO/7.000,8,9")
    assert written(unlocked, [[100, 0, 0]] * 3, TILT)[6].startswith("GOTO/7.100,8,9")


def test_an_axis_nobody_wrote_is_put_in_as_finely_as_it_is_printed() -> None:
    program = apt("FROM/9,9,9,0,0.6,0.8\nGOTO/1.000,2,3\nGOTO/4.000,5,6")
    turns = np.stack([matrix_from_abc(np.array([0.0, 0.0, k]) * DEG) for k in (0.10, 0.12)])
    change = moved(program, np.zeros((2, 3)), turns)
    lines = find_language("apt").write(program, change).decode().split("\n")
    assert lines[3] != "GOTO/1.000,2,3"
    assert lines[4] != "GOTO/4.000,5,6"  # 0.02 deg apart from the one before


def test_the_start_of_an_arc_of_an_unread_record_stays() -> None:
    program = apt("GOTO/1,2,3\nGOTO/4,5,6\nMOVARC/5,5,6,0,0,1,1,ANGLE,90\nGOTO/5,6,6")
    assert reasons(program)[:2] == [Reason.NONE, Reason.EXPRESSION]


def test_tools_of_a_table_are_those_of_the_cell() -> None:
    table = FrameTable(tools={"T1": np.eye(4)}, orientation=RULE)
    text = b"x_mm,y_mm,z_mm,tool\n1.0,2.0,3.0,T1\n4.0,5.0,6.0,\n7.0,8.0,9.0,T2\n"
    program = read("toolpath_csv", text, table)
    assert reasons(program) == [Reason.NONE, Reason.NONE, Reason.UNKNOWN_FRAME]
    assert program.tool.tolist() == [1, 1, 0]
    assert any("tool T2 is not in the frame table" in note for note in program.notes)
    one = text.replace(b"T2", b"T1")
    assert reasons(read("toolpath_csv", one, FrameTable(orientation=RULE))) == [Reason.NONE] * 3


def test_numbers_are_rewritten_in_place() -> None:
    program = apt("GOTO  /  1.000,  2.000,\t3.000 $$ a\nGOTO/4.5,$\n 5.0, -.25000,0,0.0,1.00000")
    assert written(program, [[100, 0, 0], [0, 30, 30]])[2:5] == [
        "GOTO  /  1.100,  2.000,\t3.000 $$ a",
        "GOTO/4.5,$",
        " 5.030, -.22000,0,0.0,1.00000",
    ]


def test_an_axis_that_was_left_out_is_inserted_where_it_differs() -> None:
    program = apt("GOTO/1,2,3,0.00000,0.00000,1.00000\nGOTO/4,5,6 $$ a")
    change = moved(program, np.zeros(3), np.eye(3))
    rotation = np.array(program.rotation)
    rotation[1] = rotation[1] @ TILT
    change = type(change)(
        changed=change.changed, position=change.position, rotation=rotation, axes=change.axes,
        words=change.words,
    )  # fmt: skip
    out = find_language("apt").write(program, change).decode().split("\n")
    assert out[2:4] == [
        "GOTO/1,2,3,0.00000,0.00000,1.00000",
        "GOTO/4,5,6,-0.00060,-0.00164,1.00000 $$ a",
    ]


def test_units_and_axis_systems() -> None:
    inch = read("apt", b"UNITS/INCHES\nGOTO/1,2,3\nGOTO/2,2,3\n", FrameTable(orientation=RULE))
    np.testing.assert_allclose(inch.position[0], [0.0254, 0.0508, 0.0762])
    untold = read("apt", b"GOTO/1,2,3\n", FrameTable(orientation=RULE))
    assert any("UNITS/" in note for note in untold.notes)
    system = "$$*CATIA0\n$$ AXIS1\n$$ 1 0 0 10\n$$ 0 1 0 20\n$$ 0 0 1 30\n"
    other = system.replace("30", "40")
    one = apt(system + "GOTO/1,2,3")
    assert reasons(one) == [Reason.NONE]
    assert any("axis system" in note for note in one.notes)
    assert reasons(apt(f"{system}GOTO/1,2,3\n{other}GOTO/4,5,6")) == [
        Reason.NONE,
        Reason.UNKNOWN_FRAME,
    ]
    assert reasons(apt("GOTO/1,2,3\nMSYS/1,2,3,1,0,0,0,1,0\nGOTO/1,2,3"))[1] == Reason.UNKNOWN_FRAME


def test_several_tools_have_to_be_known() -> None:
    text = "LOADTL/1\nGOTO/1,2,3\nLOADTL/2\nGOTO/1,2,3"
    assert reasons(apt(text)) == [Reason.UNKNOWN_FRAME] * 2
    table = FrameTable(tools={"1": np.eye(4), "2": np.eye(4)}, orientation=RULE)
    assert reasons(apt(text, table)) == [Reason.NONE] * 2
    assert reasons(apt("LOADTL/1\nGOTO/1,2,3")) == [Reason.NONE]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("GODLTA/1,0,0", Reason.RELATIVE),
        ("MODE/INCR\nGOTO/1,2,3", Reason.RELATIVE),
        (
            "INDIRV/1,0,0\nTLON,GOFWD/ (CIRCLE/ 1,2,3,$\n5),ON,(LINE/ 1,2,3,4,5,6)",
            Reason.EXPRESSION,
        ),
        ("CYCLE/DRILL,5\nGOTO/1,2,3", Reason.EXPRESSION),
        ("CUTCOM/LEFT\nGOTO/1,2,3", Reason.EXPRESSION),
        ("GOTO/P1", Reason.EXPRESSION),
        ("GOTO/1.5D+02,2,3", Reason.EXPRESSION),
        ("GOTO/1,2,3,4", Reason.EXPRESSION),
        ("ORIGIN/1,2,3\nGOTO/1,2,3", Reason.UNKNOWN_FRAME),
        ("COPY/1,TRANSL,1,2,3,2\nGOTO/1,2,3", Reason.UNKNOWN_FRAME),
    ],
)
def test_what_is_not_compensated(text: str, reason: Reason) -> None:
    program = apt(f"GOTO/9,9,9,0,0,1\n{text}")
    assert reasons(program)[-1] == reason
    assert any("part.nc:" in note for note in program.notes)


def test_cells_keep_separators_quotes_and_decimals() -> None:
    program = read("toolpath_csv", CSV)
    assert reasons(program) == [Reason.NONE] * 3
    assert program.line.tolist() == [3, 4, 5]
    assert written(program, [[100, 20, 0], [0, 30, 40], [1, 0, 0]])[2:5] == [
        '1.100;"2.520" ;3;0;0;1;1',
        "1.500;2.530;.340;0;0.1;.994987;0",
        "2.501; 3.5 ;-0.30;0;0.1;.994987;",
    ]


def test_a_table_without_axes_keeps_one_orientation() -> None:
    data = b"rapid,z_mm,y_mm,x_mm\n0,3.000,2.000,1.000\n"
    program = read("toolpath_csv", data)
    np.testing.assert_allclose(RULE.axes_of(program.rotation)[0], [0, 0, 1], atol=1e-15)
    assert written(program, [[100, 0, 0]], TILT)[1] == "0,3.000,2.000,1.100"
    assert reasons(read("toolpath_csv", data, FrameTable())) == [Reason.INCOMPLETE]


@pytest.mark.parametrize("blank", ["\x1c", "\xa0", "\u2003"])
def test_blanks_around_names_are_those_of_text(blank: str) -> None:
    plain = "x_mm;y_mm;z_mm\n1.0;2.0;3.0\n1.5;2.5;3.5\n"
    odd = f"{blank}\n" + plain.replace("y_mm", f"{blank}y_mm{blank}")
    rows = [read("toolpath_csv", text.encode()) for text in (plain, odd)]
    np.testing.assert_array_equal(rows[0].position, rows[1].position)
    assert reasons(rows[0]) == reasons(rows[1])


def test_refused() -> None:
    for name, data, line in (
        ("apt", b"UNITS/MM\nFINI\n", 1),
        ("apt", b"UNITS/FEET\nGOTO/1,2,3\n", 1),
        ("apt", b"GOTO/1,2,$\n", 1),
        ("toolpath_csv", b"x_mm,y_mm,z_mm\n", 1),
        ("toolpath_csv", b"x_mm,y_mm,z_mm\n1,2,a\n", 2),
        ("toolpath_csv", b"x_mm,y_mm,z_mm,rapd\n1,2,3,1\n", 1),
    ):
        with pytest.raises(FormatError) as refused:
            read(name, data)
        assert refused.value.line == line
