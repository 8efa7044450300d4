"""RAPID routines that errors end early, and functions that set more than their value."""

from __future__ import annotations

import numpy as np
import pytest
from rapid_samples import FRAMES, move, read, target

from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Program, Reason


@pytest.mark.parametrize(
    ("end", "in_main", "main", "sub"),
    [
        ("TRYNEXT;", True, False, True),  # sub may have ended before its PDispSet, or behind it
        ("IF ERRNO=1 THEN\nWaitTime 1;\nENDIF\nTRYNEXT;", True, False, True),
        ("RETRY;", True, False, False),  # and begins again
        ("RETURN;", False, False, True),
        ("IF ERRNO=1 THEN\nTRYNEXT;\nENDIF", False, False, True),
        ("TRYNEXT;", False, True, True),  # the next motion of sub
        ("RETRY;", False, True, True),
    ],
)
def test_what_a_routine_that_an_error_ends_early_has_set_is_unknown(
    end: str, in_main: bool, main: bool, sub: bool
) -> None:
    handler = f"ERROR\n{end}\n"
    shift = f"{move(target(2))}PDispSet [[0,0,5],[1,0,0,0]];\n{move(target(3))}PDispOff;\n"

    def read_with(between: str) -> Program:
        text = f"PDispOff;\nsub;\n{between}{move(target(1))}{handler if in_main else ''}"
        text += f"ENDPROC\nPROC sub()\n{shift}{'' if in_main else handler}ENDPROC\n"
        return read(f"{FRAMES}PROC main()\n{text}ENDMODULE")

    program = read_with("")
    assert (program.reason == Reason.NONE).tolist() == [main, sub, True]
    assert any("an error may end sub early" in note for note in program.notes) == (not main)
    assert read_with("PDispOff;\n").reason[0] == Reason.NONE


def test_errors_reach_through_routines_without_a_handler_and_leave_others_alone() -> None:
    sub = f"PROC sub()\n{move(target(2))}fixture.uframe:=[[9,0,0],[1,0,0,0]];\nENDPROC\n"
    main = "PROC main()\nfixture.uframe:=[[5,0,0],[1,0,0,0]];\nmid;\n" + move(target(1))
    mid = "ENDPROC\nPROC mid()\nsub;\nENDPROC\n"
    reached = read(f"{FRAMES}{main}ERROR\nTRYNEXT;\n{mid}{sub}ENDMODULE")
    assert reached.reason[0] == Reason.UNKNOWN_FRAME
    other = "PROC other()\nWaitTime 1;\nERROR\nTRYNEXT;\nENDPROC\n"
    assert read(f"{FRAMES}{main}{mid}{sub}{other}ENDMODULE").reason[0] == Reason.NONE


def test_errors_that_another_module_handles() -> None:
    shift = f"PDispSet [[0,0,5],[1,0,0,0]];\n{move(target(2))}PDispOff;\n"
    part = f"{FRAMES}PROC sub()\n{shift}ENDPROC\nPROC two()\n{move(target(1))}ENDPROC\nENDMODULE"
    for handler, expected in (("", Reason.NONE), ("ERROR\nTRYNEXT;\n", Reason.RELATIVE)):
        main = f"MODULE top\nPROC main()\nsub;\ntwo;\n{handler}ENDPROC\nENDMODULE"
        files = [("part.mod", part.encode()), ("top.mod", main.encode())]
        program = find_language("rapid").read_job(files, frames=FrameTable())[0]
        assert program.reason.tolist() == [Reason.NONE, expected]


@pytest.mark.parametrize(
    ("statement", "z"),
    [
        ("", 43),
        ("k:=count();\n", 53),
        ("WaitTime count();\n", 53),
        ("IF count()=1 THEN\nWaitTime 1;\nENDIF\n", 53),
        (f"MoveJ Offs(p,0,0,count()),v1,z1,spindle\\WObj:=fixture;\n{'PDispOff;'}\n", 43),
        ("IF count()=1 k:=1;\n", 53),
        ("IF k=1 OR count()=1 k:=1;\n", None),  # on one way only
    ],
)
def test_functions_of_the_module_change_what_they_set(statement: str, z: float | None) -> None:
    text = (
        f"{FRAMES}VAR num k;\nCONST robtarget p:={target()};\nPROC main()\nPDispOff;\n"
        f"{statement}{move('Offs(p,0,0,40)')}ENDPROC\n"
        "FUNC num count()\nPDispSet [[0,0,10],[1,0,0,0]];\nRETURN 1;\nENDFUNC\nENDMODULE"
    )
    program = read(text)
    assert program.reason[-1] == (Reason.RELATIVE if z is None else Reason.NONE)
    at = program.T_base_frame[program.frame[-1]] @ np.append(program.position[-1], 1.0)
    if z is not None:
        assert at[2] * 1e3 == pytest.approx(460 + z)


def test_functions_of_the_module_change_variables() -> None:
    text = (
        f"{FRAMES}VAR num h:=5;\nCONST robtarget p:={target()};\nPROC main()\nh:=40;\n"
        f"WaitTime count();\n{move('Offs(p,0,0,h)')}ENDPROC\n"
        "FUNC num count()\nh:=h+1;\nRETURN 1;\nENDFUNC\nENDMODULE"
    )
    program = read(text)
    assert program.reason[-1] == Reason.NONE
    assert program.position[-1, 2] * 1e3 == pytest.approx(44)


@pytest.mark.parametrize(("body", "moved"), [("PDispSet [[0,0,10],[1,0,0,0]];", True), ("", False)])
def test_functions_of_another_module_may_change_what_is_in_force(body: str, moved: bool) -> None:
    main = (
        f"{FRAMES}VAR num k;\nCONST robtarget p:={target()};\nPROC main()\nPDispOff;\n"
        f"{move('p')}k:=count();\n{move('p')}ENDPROC\nENDMODULE"
    )
    other = f"MODULE b\nFUNC num count()\n{body}\nRETURN 1;\nENDFUNC\nENDMODULE"
    files = [("a.mod", main.encode()), ("b.mod", other.encode())]
    program = find_language("rapid").read_job(files, frames=FrameTable())[0]
    assert program.reason.tolist() == [Reason.RELATIVE if moved else Reason.NONE]
    assert any("count" in note for note in program.notes) == moved


def test_an_error_handler_outside_routines_belongs_to_none() -> None:
    text = (
        f"{FRAMES}VAR num h:=5;\nERROR\nTRYNEXT;\nERROR\nPROC main()\nh:=40;\n"
        f"{move(f'Offs({target()},0,0,h)')}ENDPROC\nENDMODULE"
    )
    assert read(text).reason.tolist() == [Reason.NONE]
