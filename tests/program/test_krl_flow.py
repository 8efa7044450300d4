"""Frames through subprograms, jumps, loops and calls out of the program."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from krl_samples import changed_lines, read, replacement, write

from robotrue.core.poses import pose
from robotrue.core.units import MM
from robotrue.program.program import FrameTable, Program, Reason

P = "LIN {X 12.500,Y -0.375,Z -1.250,A 0.500,B 0.250,C 180.000}"


def at_x(x_mm: float) -> np.ndarray:
    return pose(np.eye(3), np.array([x_mm, 0.0, 0.0]) * MM)


TABLE = FrameTable(
    bases={str(i): at_x(i) for i in range(1, 10)}, tools={str(i): at_x(i) for i in range(1, 10)}
)


def bases(text: str) -> list[float | None]:
    """x of the base of every target in mm, None where it is not known; ``/`` ends a line."""
    program = read(text.replace("/", "\n").replace("P!", P), TABLE)
    use = program.reason != Reason.UNUSED
    assert set(program.reason[use].tolist()) <= {Reason.NONE, Reason.UNKNOWN_FRAME}
    return [
        None if why else round(float(program.T_base_frame[base][0, 3] / MM), 6)
        for why, base in zip(program.reason[use].tolist(), program.frame[use].tolist(), strict=True)
    ]


def tools(program: Program) -> list[float]:
    return [round(float(program.T_flange_tool[i][0, 3] / MM), 6) for i in program.tool.tolist()]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        # A subprogram that sets the base: its caller goes on with it.
        ("DEF p()/BAS(#BASE,1)/P!/s()/P!/END/DEF s()/BAS(#BASE,2)/P!/END", [1, 2, 2]),
        ("DEF p()/BAS(#BASE,1)/s( )/P!/END/DEF s()/t()/END/DEF t()/$BASE=BASE_DATA[3]/END", [3]),
        # One that sets it on one way only.
        ("DEF p()/BAS(#BASE,1)/s()/P!/END/DEF s()/IF x THEN/BAS(#BASE,2)/ENDIF/END", [None]),
        # One that leaves it alone, called in two frames: each caller keeps its own.
        ("DEF p()/BAS(#BASE,1)/s()/P!/BAS(#BASE,2)/s()/P!/END/DEF s()/P!/END", [1, 2, None]),
        # Defined in the wrong order, and recursive.
        ("DEF p()/BAS(#BASE,4)/b()/END/DEF a()/P!/END/DEF b()/a()/END", [4]),
        ("DEF p()/BAS(#BASE,4)/a()/P!/END/DEF a()/P!/IF x THEN/a()/ENDIF/P!/END", [4, 4, 4]),
        ("DEF p()/BAS(#BASE,1)/x=f(1)/P!/END/DEFFCT INT f(a:IN)/BAS(#BASE,2)/RETURN 1/ENDFCT", [2]),
        # One in the condition of a loop begins with what the turn before has left.
        ("DEF p()/BAS(#BASE,1)/WHILE f()/BAS(#BASE,2)/ENDWHILE/END/"
         "DEFFCT BOOL f()/P!/RETURN TRUE/ENDFCT", [None]),
        # Frames handed over by reference, and set by a trigger.
        ("DEF p()/BAS(#BASE,1)/s(1,$BASE)/P!/BAS(#BASE,1)/P!/END/DEF s(a:IN,b:OUT)/END", [None, 1]),
        ("DEF p()/BAS(#BASE,1)/x=INV_POS($BASE)/P!/END", [1]),
        ("DEF p()/BAS(#BASE,1)/TRIGGER WHEN PATH=0 DELAY=0 DO $BASE=BASE_DATA[2]/P!/END", [None]),
        # RETURN on one way.
        ("DEF p()/BAS(#BASE,1)/s()/P!/END/DEF s()/IF x THEN/RETURN/ENDIF/BAS(#BASE,2)/END", [None]),
        # GOTO, forward and backward, with equal and with different frames.
        ("DEF p()/BAS(#BASE,1)/IF x THEN/GOTO a/ENDIF/BAS(#BASE,2)/P!/a:/P!/END", [2, None]),
        ("DEF p()/BAS(#BASE,1)/IF x THEN/GOTO a/ENDIF/BAS(#BASE,1)/a:/P!/END", [1]),
        ("DEF p()/BAS(#BASE,1)/a:/P!/BAS(#BASE,2)/P!/GOTO A/END", [None, 2]),
        ("DEF p()/BAS(#BASE,1)/a:/P!/BAS(#TOOL,2)/GOTO a/END", [None]),
        ("DEF p()/GOTO a/BAS(#BASE,1)/P!/a:/P!/END", [None, 0]),
        # A loop that changes the base after it changed the tool.
        ("DEF p()/BAS(#BASE,1)/LOOP/BAS(#TOOL,3)/P!/BAS(#BASE,2)/P!/ENDLOOP/END", [None, 2]),
        ("DEF p()/BAS(#BASE,1)/LOOP/s()/BAS(#BASE,2)/ENDLOOP/END/DEF s()/P!/END", [None]),
        ("DEF p()/BAS(#BASE,1)/LOOP/IF x THEN/EXIT/ENDIF/BAS(#BASE,2)/ENDLOOP/P!/END", [None]),
        # A loop that sets it first.
        ("DEF p()/BAS(#BASE,9)/FOR i=1 TO 3/BAS(#BASE,1)/P!/BAS(#BASE,2)/P!/ENDFOR/END", [1, 2]),
        # FDAT_ACT of either branch.
        ("DEF p()/IF x THEN/FDAT_ACT={TOOL_NO 1,BASE_NO 1,IPO_FRAME #BASE}/ELSE/"
         "FDAT_ACT={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE}/ENDIF/BAS(#FRAMES)/P!/END", [None]),
        # Base data and frame variables written on one branch.
        ("DEF p()/IF x THEN/BASE_DATA[1]={X 5,Y 0,Z 0,A 0,B 0,C 0}/ENDIF/BAS(#BASE,1)/P!/END",
         [None]),
        ("DEF p()/IF x THEN/BASE_DATA[1]={X 1,Y 0,Z 0,A 0,B 0,C 0}/ENDIF/BAS(#BASE,1)/P!/END", [1]),
        ("DEF p()/f={X 5,Y 0,Z 0,A 0,B 0,C 0}/IF x THEN/f={X 6,Y 0,Z 0,A 0,B 0,C 0}/ENDIF/"
         "$BASE=f/P!/END", [None]),
        # A handler runs at any line.
        ("DEF p()/INTERRUPT DECL 3 WHEN $IN[1]==TRUE DO h()/BAS(#BASE,1)/P!/END/"
         "DEF h()/P!/BAS(#BASE,2)/BAS(#TOOL,2)/P!/END", [1, None, 2]),
        # a routine that only calls itself is never entered, and what it sets reaches no other
        ("DEF p()/BAS(#BASE,1)/s()/END/DEF d()/BAS(#BASE,2)/s()/d()/END/DEF s()/P!/END", [1]),
    ],
)  # fmt: skip
def test_the_base_on_every_way(text: str, expected: list[float | None]) -> None:
    assert bases(text) == expected


def test_a_subprogram_that_sets_the_tool_only() -> None:
    text = f"DEF p()\nBAS(#BASE,1)\nBAS(#TOOL,1)\ns()\n{P}\nEND\nDEF s()\nBAS(#TOOL,5)\nEND\n"
    program = read(text, TABLE)
    assert tools(program) == [5.0]
    assert program.reason.tolist() == [Reason.NONE]
    assert program.notes == ()


def test_the_note_says_where_the_ways_part() -> None:
    program = read(f"DEF p()\nBAS(#BASE,1)\na:\n{P}\nBAS(#BASE,2)\nGOTO a\nEND\n", TABLE)
    assert program.notes == (
        "part.src:3: the base differs between the paths to this label; set it again "
        "after this line.",
    )


def test_a_handler_that_changes_frames_is_named() -> None:
    head = f"DEF p()\nINTERRUPT DECL 3 WHEN $IN[1]==TRUE DO h()\n{P}\nEND\nDEF h()\n"
    assert read(head + "$OUT[1]=TRUE\nEND\n", TABLE).notes == ()
    assert read(head + "BAS(#BASE,2)\nEND\n", TABLE).notes == (
        "part.src: h, which an interrupt or trigger starts, changes base or tool; targets that "
        "may come after it are compensated as if it had not run.",
    )


def test_targets_behind_an_unknown_routine_are_left_alone_until_both_frames_are_set() -> None:
    text = (
        f"DEF p()\nBAS(#BASE,1)\n{P}\nSpindle_On(9000)\n{P}\nBAS(#TOOL,1)\n{P}\nBAS(#BASE,2)\n{P}\n"
    )
    program = read(text + f"CUT()\n{P}\nEND\n", TABLE)
    unknown = Reason.UNKNOWN_FRAME
    assert program.reason.tolist() == [Reason.NONE, unknown, unknown, Reason.NONE, unknown]
    assert program.notes == (
        "part.src:4: Spindle_On is in no file given and may change base or tool: 2 targets after "
        "it are not compensated, until both are set again. Give its file, too; if it changes none "
        "of them, state in the cell: [controller] harmless_routines = "
        '["Spindle_On"].',
        "part.src:10: CUT is in no file given and may change base or tool: 1 targets after it are "
        "not compensated, until both are set again. Give its file, too; if it changes none of "
        'them, state in the cell: [controller] harmless_routines = ["CUT"].',
    )
    table = replace(TABLE, harmless_routines=("spindle_on", "cut"))
    assert read(text + f"CUT()\n{P}\nEND\n", table).reason.tolist() == [Reason.NONE] * 5


@pytest.mark.parametrize("declared", ["", "AXIS "])
def test_a_stored_point_used_before_and_behind_an_unknown_routine_is_left_alone(
    declared: str,
) -> None:
    axes = "A1 0,A2 -90,A3 90,A4 0,A5 5,A6 0"
    stored = f"a={{{axes}}}\n" if declared else f"a={P[4:]}\n"
    move = "PTP a\n" if declared else "LIN a\n"
    head = f"DEF p()\n{'DECL AXIS a' if declared else ''}\n{stored}"
    head += f"BAS(#BASE,1)\nBAS(#TOOL,1)\n{move}"
    again = read(f"{head}Spindle_On(9)\n{move}END\n", TABLE)
    assert again.reason.tolist() == [Reason.UNKNOWN_FRAME]
    assert again.notes[0].startswith("part.src:7: Spindle_On is in no file given and may change")
    assert "1 targets after it are not compensated" in again.notes[0]
    once = Reason.JOINT_TARGET if declared else Reason.NONE
    assert read(f"{head}{move}END\n", TABLE).reason.tolist() == [once]
    table = replace(TABLE, harmless_routines=("spindle_on",))
    assert read(f"{head}Spindle_On(9)\n{move}END\n", table).reason.tolist() == [once]


def test_an_unknown_routine_that_a_trigger_or_a_subprogram_starts() -> None:
    late = f"TRIGGER WHEN DISTANCE=0 DELAY=0 DO Glue(1) PRIO=-1\n{P}"
    assert read(f"DEF p()\n{late}\nEND\n", TABLE).reason.tolist() == [Reason.UNKNOWN_FRAME]
    sub = f"DEF p()\ns()\n{P}\nEND\nDEF s()\nGlue(1)\nEND\n"
    assert read(sub, TABLE).reason.tolist() == [Reason.UNKNOWN_FRAME]
    one_way = f"DEF p()\nIF $IN[1] THEN\nGlue(1)\nENDIF\n{P}\nEND\n"
    assert read(one_way, TABLE).reason.tolist() == [Reason.UNKNOWN_FRAME]


def test_interrupts_of_routines_in_no_file() -> None:
    head = "DEF p()\nGLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )\n"
    assert read(f"{head}BAS(#INITMOV,0)\n{P}\nEND\n", TABLE).notes == ()
    program = read(f"DEF p()\nINTERRUPT DECL 9 WHEN $IN[1] DO Retreat()\n{P}\nEND\n", TABLE)
    assert program.reason.tolist() == [Reason.NONE]
    assert program.notes == (
        "part.src: Retreat, which an interrupt starts, is in no file given; targets are "
        "compensated as if it changed neither base nor tool.",
    )


@pytest.mark.parametrize(
    "after",
    [
        f"BAS(#BASE,1)\nBAS(#TOOL,1)\n{P}",
        f"FDAT_ACT={{TOOL_NO 1,BASE_NO 1,IPO_FRAME #BASE}}\nBAS(#CP_PARAMS,1)\n{P}",
        "BAS(#BASE,1)",
    ],
)
def test_an_unknown_routine_before_frames_are_set_is_no_matter(after: str) -> None:
    assert read(f"DEF p()\n{P}\nspindle_on()\n{after}\nEND\n", TABLE).notes == ()


@pytest.mark.parametrize(
    "call", ["WAIT SEC (0.5)", "BAS(#VEL_PTP,50)", "x=SIN(a)", "IF (a AND (b)) THEN\nENDIF"]
)
def test_the_controllers_own_routines_leave_frames_alone(call: str) -> None:
    assert read(f"DEF p()\n{call}\n{P}\nEND\n", TABLE).notes == ()


def test_a_flagged_target_does_not_move_with_its_neighbour() -> None:
    """What it inherits is known: the old values are written into it."""
    still = P.replace("}", ",E1 0.0}")
    text = (
        f"DEF p()\n{still}\nLIN {{X 20.0,E1 5.0}}\n{still}\nLIN {{Z 5.0,E1 5.0}}\n"
        "LIN {X 7.0,Y 8.0,E1 5.0}\nEND\n"
    )
    program = read(text)
    assert program.reason.tolist() == [0, Reason.EXTERNAL_AXIS, 0, *[Reason.EXTERNAL_AXIS] * 2]
    assert changed_lines(program, replacement(program, by_mm=(0.1, 0.1, 0.1))) == [
        still.replace("12.5", "12.6").replace("-0.375", "-0.275").replace("-1.25", "-1.15"),
        "LIN {X 20.0,E1 5.0,Y -0.3750,Z -1.2500}",
        still.replace("12.5", "12.6").replace("-0.375", "-0.275").replace("-1.25", "-1.15"),
        "LIN {Z 5.0,E1 5.0,X 12.5000,Y -0.3750}",
    ]


def test_an_incomplete_target_keeps_what_it_is_known_to_inherit() -> None:
    """X, Y and Z are known from the lines before, A, B and C are not."""
    text = f"DEF p()\n{P}\nsub()\nLIN {{X 1.0,Y 2.0,Z 3.0}}\nLIN {{X 9.0}}\nEND\n"
    program = read(text)
    assert program.reason.tolist() == [0, Reason.INCOMPLETE, Reason.INCOMPLETE]
    change = replacement(program, by_mm=(0.1, 0.1, 0.1))
    assert changed_lines(program, change)[0].startswith("LIN {X 12.600")
    assert write(program, change).splitlines()[3:] == text.splitlines()[3:]
    assert any("follow the previous target where it is" in note for note in program.notes)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        # Points kept behind a GOTO or RETURN to be taught: what is set there holds for them.
        ("DEF p()/BAS(#BASE,1)/GOTO e/P!/BAS(#BASE,2)/BAS(#TOOL,1)/P!/e:/P!/END", [None, 2, 1]),
        (
            "DEF p()/BAS(#BASE,1)/P!/RETURN/IF x THEN/BAS(#BASE,2)/BAS(#TOOL,1)/P!/ENDIF/P!/END",
            [1, 2, None],
        ),
        (
            "DEF p()/BAS(#BASE,1)/GOTO e/BAS(#BASE,2)/BAS(#TOOL,1)/LOOP/P!/ENDLOOP/e:/P!/END",
            [None, 1],
        ),
        ("DEF p()/RETURN/s()/P!/END/DEF s()/BAS(#BASE,2)/BAS(#TOOL,1)/P!/END", [2, 2]),
    ],
)
def test_lines_that_no_way_leads_to(text: str, expected: list[float | None]) -> None:
    assert bases(text) == expected


def test_what_is_said_of_a_line_that_no_way_leads_to() -> None:
    program = read(f"DEF p()\nBAS(#BASE,1)\nRETURN\n{P}\nEND\n", TABLE)
    (note, _) = program.notes
    assert note.startswith("part.src:3: the base is unknown: no path through the program")
    assert not any("#TCP" in note for note in program.notes)


def test_what_stands_behind_a_routine_that_never_returns() -> None:
    program = read(f"DEF p()\nEND\nDEF d()\nd()\n{P}\nEND")
    assert program.reason.tolist() == [Reason.UNKNOWN_FRAME]
    assert "part.src:4: the base is unknown: no path through the program leads here" in "".join(
        program.notes
    )


def test_a_point_that_is_set_on_two_branches_is_corrected_on_both() -> None:
    other = P[4:].replace("X ", "X 1")
    text = f"DEF p()\nIF $IN[1] THEN\na={P[4:]}\nELSE\na={other}\nENDIF\nLIN a\nEND\n"
    assert read(text, TABLE).reason.tolist() == [Reason.NONE, Reason.NONE]


def test_a_point_that_a_loop_carries_into_its_next_turn_is_moved_to_there() -> None:
    other = P[4:].replace("X ", "X 1")
    text = f"DEF p()\na={P[4:]}\nWHILE $IN[1]\nLIN a\na={other}\nBAS(#BASE,1)\nENDWHILE\n"
    program = read(f"{text}BAS(#BASE,2)\nLIN a\nEND\n", TABLE)
    assert program.reason.tolist() == [Reason.UNKNOWN_FRAME, Reason.UNKNOWN_FRAME]
