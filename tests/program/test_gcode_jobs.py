"""G-code and conversational programs of one job: offsets set, and shifts in force at a call."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.units import DEG
from robotrue.program.lang import find_language
from robotrue.program.orientation import OrientationRule
from robotrue.program.program import FrameTable, Reason

TABLE = FrameTable(
    bases={name: np.eye(4) for name in ("G54", "G55", "G505", "G54.1 P3", "0")},
    tools={"T1": np.eye(4), "T2": np.eye(4)},
    orientation=OrientationRule(angles="rpy", spin=20.0 * DEG),
)
POINT = "G1 X1. Y2. Z3. A0. B0. C0. F100.\n"
HEAD = {
    "sinumerik": "T1 D1\nG710 G90 G54 TRAORI\n",
    "fanuc_gcode": "O7\nT1 M6\nG21 G90 G54 G43.4 H1\n",
}
SUFFIX = {"sinumerik": "mpf", "fanuc_gcode": "nc"}


def reason_of_called(language: str, name: str, caller: str, called: str) -> tuple[list[int], str]:
    """Reasons and notes of the second program, with the files in either order."""
    files = [(f"main.{name.partition('.')[2]}", caller.encode()), (name, called.encode())]
    one, other = (
        next(
            (each.reason.tolist(), "\n".join(each.notes))
            for each in find_language(language).read_job(order, frames=TABLE)
            if each.name == name
        )
        for order in (files, files[::-1])
    )
    assert one == other
    return one


@pytest.mark.parametrize(
    ("language", "line", "named"),
    [
        ("sinumerik", "$P_UIFR[1]=CTRANS(X,10)", "G54"),
        ("sinumerik", "$P_UIFR[R1]=CTRANS(X,10)", "G54"),
        ("sinumerik", "$P_UIFR[5]=CTRANS(X,10)", "G505"),
        ("sinumerik", "$P_UIFR[2]=CTRANS(X,10)", ""),
        ("sinumerik", "; $P_UIFR[1]=CTRANS(X,10)", ""),
        ("fanuc_gcode", "G90 G10 L2 P1 X10.", "G54"),
        ("fanuc_gcode", "G90 G10 L2 P0 X10.", "G54"),
        ("fanuc_gcode", "G90 G10 L20 P3 X10.", "G54.1 P3"),
        ("fanuc_gcode", "G90 G10 L2 P2 X10.", ""),
    ],
)
def test_an_offset_that_another_program_changes(language: str, line: str, named: str) -> None:
    frame = named or "G54"
    called = HEAD[language].replace("G54", frame) + POINT + "M30\n"
    caller = HEAD[language].replace("O7", "O8") + line + "\n" + POINT + "M30\n"
    reason, notes = reason_of_called(language, f"part.{SUFFIX[language]}", caller, called)
    assert reason == [Reason.UNKNOWN_FRAME if named else Reason.NONE]
    told = f"work frame {frame} is changed by main.{SUFFIX[language]} in line 3"
    assert (told in notes.replace("in line 4", "in line 3")) == bool(named)


@pytest.mark.parametrize(
    ("language", "lines", "shifted"),
    [
        ("sinumerik", "TRANS X10\nPART", True),
        ("sinumerik", "ROT Z30\nOTHER\nPART", True),
        ("sinumerik", "TRANS X10\nTRANS\nPART", False),
        ("sinumerik", "TRANS X10\nOTHER\nTRANS", False),
        ("sinumerik", "PART\nTRANS X10", False),
        ("fanuc_gcode", "G68 X0. Y0. R30.\nM98 P7", True),
        ("fanuc_gcode", "G68 X0. Y0. R30.\nM98 P0007", True),
        ("fanuc_gcode", "G68 X0. Y0. R30.\nM98 P30007", True),
        ("fanuc_gcode", "G68 X0. Y0. R30.\nM98 P17", False),
        ("fanuc_gcode", "G68 X0. Y0. R30.\nG69\nM98 P7", False),
        ("fanuc_gcode", "G52 X10. Y0. Z0.\nM98 P7", True),
        ("fanuc_gcode", "G52 X10. Y0. Z0.\nG52 X0. Y0. Z0.\nM98 P7", False),
    ],
)
def test_a_program_that_is_called_while_coordinates_are_shifted(
    language: str, lines: str, shifted: bool
) -> None:
    caller = HEAD[language].replace("O7", "O8") + POINT + lines + "\nM30\n"
    called = HEAD[language] + POINT + "TRANS\n" * (language == "sinumerik") + POINT + "M30\n"
    reason, notes = reason_of_called(language, f"part.{SUFFIX[language]}", caller, called)
    assert reason == [Reason.UNKNOWN_FRAME if shifted else Reason.NONE] * 2
    assert ("while the coordinates are moved, turned or scaled" in notes) == shifted


@pytest.mark.parametrize(("shift", "shifted"), [("10", True), ("0", False)])
def test_a_conversational_program_that_is_called_behind_a_datum_shift(
    shift: str, shifted: bool
) -> None:
    caller = (
        "0 BEGIN PGM MAIN MM\n1 CYCL DEF 7.0 DATUM SHIFT\n2 CYCL DEF 7.1 X+" + shift
        + "\n3 CYCL DEF 7.2 Y+0\n4 CYCL DEF 7.3 Z+0\n5 CALL PGM PART\n6 END PGM MAIN MM\n"
    )  # fmt: skip
    called = (
        "0 BEGIN PGM PART MM\n1 TOOL CALL 1 Z S5000\n2 M128\n"
        "3 L X+1 Y+2 Z+3 A+0 B+0 C+0 R0 FMAX\n4 END PGM PART MM\n"
    )
    reason, notes = reason_of_called("heidenhain", "part.h", caller, called)
    assert reason == [Reason.UNKNOWN_FRAME if shifted else Reason.NONE]
    assert ("main.h may call it in line 6" in notes) == shifted
