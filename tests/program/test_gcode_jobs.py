"""G-code and conversational programs of one job: offsets set, and shifts in force at a call."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.units import DEG, MM
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
        ("fanuc_gcode", "G68 X0. Y0. R30.\n/2 M98 P7", True),
        ("sinumerik", "TRANS X10\n/PART", True),
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


PLAIN = "G1 X1. Y2. Z3. F100.\n"


@pytest.mark.parametrize(
    ("lines", "frame", "reason"),
    [
        ("G55\nM98 P7", "G55", Reason.NONE),
        ("G55 M98 P7", "G55", Reason.NONE),
        ("G54.1 P3\nM98 P7", "G54.1 P3", Reason.NONE),
        ("G55\nM98 P9\nM98 P7", "G55", Reason.NONE),  # P9 is not in the job: it changes nothing
        ("G55\nM98 P7\nG54\nM98 P7", "", Reason.INCOMPLETE),
        ("G55\nM98 P9\nG54 G90 G1 X1. Y1. Z1.\nM98 P7", "G54", Reason.NONE),
        ("G55\nM98 P7\nG55\nM98 P7", "G55", Reason.NONE),
        ("IF [#1 EQ 1] GOTO 10\nG55\nN10\nM98 P7", "", Reason.INCOMPLETE),
        ("G91\nM98 P7", "G54", Reason.RELATIVE),
        ("G20\nM98 P7", "G54", Reason.NONE),
        ("T2 M6\nM98 P7", "G54", Reason.NONE),
    ],
)
def test_a_called_program_has_the_states_of_its_caller(
    lines: str, frame: str, reason: Reason
) -> None:
    files = [
        ("part.nc", f"O7\n{PLAIN}M99\n".encode()),
        ("main.nc", f"O8\nT1 M6\nG21 G90 G54\n{PLAIN}{lines}\nM30\n".encode()),
    ]
    tables = {name: np.eye(4) for name in TABLE.bases}
    for k, matrix in enumerate(tables.values()):
        matrix[0, 3] = k + 1.0
    tools = {"T1": np.eye(4), "T2": np.diag([1.0, -1.0, -1.0, 1.0])}
    given = FrameTable(bases=tables, tools=tools, orientation=TABLE.orientation)
    part, _ = find_language("fanuc_gcode").read_job(files, frames=given)
    assert part.reason.tolist() == [reason]
    if reason == Reason.NONE:
        np.testing.assert_array_equal(part.T_base_frame[part.frame[0]], tables[frame])
        np.testing.assert_array_equal(
            part.T_flange_tool[part.tool[0]], tools["T2" if "T2" in lines else "T1"]
        )
        inch = 25.4 if "G20" in lines else 1.0
        np.testing.assert_allclose(part.position[0], np.array([1.0, 2.0, 3.0]) * inch * MM)
    if lines.count("P7") == 2 and not frame:
        assert "part.nc:1: called in different modal states by main.nc:" in "\n".join(part.notes)


def test_states_go_on_to_programs_that_a_called_one_calls() -> None:
    files = [
        ("inner.nc", f"O6\n{PLAIN}M99\n".encode()),
        ("part.nc", f"O7\nM98 P6\n{PLAIN}M99\n".encode()),
        ("main.nc", f"O8\nT1 M6\nG21 G90 G55\n{PLAIN}M98 P7\nM30\n".encode()),
    ]
    bases = {"G55": np.diag([-1.0, -1.0, 1.0, 1.0])}
    given = FrameTable(bases=bases, tools=TABLE.tools, orientation=TABLE.orientation)
    inner = find_language("fanuc_gcode").read_job(files, frames=given)[0]
    np.testing.assert_array_equal(inner.T_base_frame[inner.frame[0]], bases["G55"])


@pytest.mark.parametrize(
    ("language", "jump", "known"),
    [
        ("fanuc_gcode", "IF [#1 EQ 1] GOTO 10", False),
        ("fanuc_gcode", "IF [#1 EQ 1] GOTO 20", True),
        ("fanuc_gcode", "IF [#1 EQ 1] GOTO #2", False),
        ("fanuc_gcode", "/GOTO 10", False),
        ("sinumerik", "IF R1==1 GOTOF N10", False),
        ("sinumerik", "IF R1==1 GOTOF N20", True),
    ],
)
def test_a_block_number_that_is_jumped_to(language: str, jump: str, known: bool) -> None:
    other = HEAD[language].replace("G54", "G55")
    text = f"{HEAD[language]}{POINT}{jump}\n{other}{POINT}N10 {POINT}N20\nM30\n"
    (program,) = find_language(language).read_job([("a.nc", text.encode())], frames=TABLE)
    assert program.reason.tolist()[0] == Reason.NONE
    assert any("work frame is not certain" in note for note in program.notes) != known


@pytest.mark.parametrize(
    ("language", "call", "once"),
    [
        ("fanuc_gcode", "M98 P7", True),
        ("fanuc_gcode", "M98 P7 L2", False),
        ("fanuc_gcode", "M98 P20007", False),
        ("sinumerik", "PART", True),
        ("sinumerik", "PART P2", False),
        ("sinumerik", 'CALL "PART" P=R1', False),
    ],
)
@pytest.mark.parametrize("change", ["T2 M6", "G55", "G68 X0. Y0. R5.", "/T2 M6", "/M6"])
def test_a_program_that_runs_again_begins_as_it_ended(
    language: str, call: str, once: bool, change: str
) -> None:
    change = "TRANS X5" if language == "sinumerik" and change[:3] == "G68" else change
    number = "O7\n" * (language == "fanuc_gcode")
    head = "" if change == "/M6" else POINT
    called = f"{number}{POINT}{change}\n{head}M99\n".replace("M99", "M99" if number else "M17")
    caller = HEAD[language].replace("O7", "O8") + f"T2\nT1 M6\nT2\n{POINT}{call}\nM30\n"
    reason, _ = reason_of_called(language, f"part.{SUFFIX[language]}", caller, called)
    if number or change != "/M6":  # Sinumerik's T loads at once here
        assert (reason[0] == Reason.NONE) == once


def test_a_program_is_called_behind_one_that_sets_or_shifts() -> None:
    for before, reason in (("G55", Reason.INCOMPLETE), (f"{POINT}TRANS X5", Reason.UNKNOWN_FRAME)):
        files = [
            ("main.mpf", f"{HEAD['sinumerik']}{POINT}FIRST\nPART\nM30\n".encode()),
            ("first.spf", f"{before} G90\n{POINT}M17\n".encode()),
            ("part.spf", f"{POINT}M17\n".encode()),
        ]
        for order in (files, files[::-1]):
            job = find_language("sinumerik").read_job(order, frames=TABLE)
            part = next(each for each in job if each.name == "part.spf")
            assert part.reason.tolist() == [reason]


@pytest.mark.parametrize("end", ["M30", "M99"])
def test_a_second_program_of_a_file_does_not_continue_the_first(end: str) -> None:
    head = "G90 G17 G21 G40 G54\nG69\nT1\nG43.4 H1"
    text = f"O1\n{head}\n{POINT}M98 P2\n{head}\n{POINT}{end}\nO2\n{head}\nG1 X5.\nM99\n"
    bare = text.replace("O2\nG90 G17 G21 G40 G54\nG69\n", "O2\nG90 G17 G21 G40 G54\n")
    (program,) = find_language("fanuc_gcode").read_job([("a.nc", bare.encode())], frames=TABLE)
    assert program.reason.tolist() == [Reason.INCOMPLETE] * 3
    assert np.isnan(program.position[2, 1:]).all()
    stated = text.replace("G1 X5.\n", POINT)
    (program,) = find_language("fanuc_gcode").read_job([("a.nc", stated.encode())], frames=TABLE)
    assert program.reason.tolist() == [Reason.NONE] * 3


def test_words_are_not_left_out_across_a_new_place_of_the_work_frame() -> None:
    for language, new in (
        ("sinumerik", "$P_UIFR[1]=CTRANS(X,10)"),
        ("fanuc_gcode", "G10 L2 P1 X9."),
    ):
        text = f"{HEAD[language]}{POINT}{{}}\nG90 G54\nG1 Z5. A0. B0. C0.\nM30\n"
        kept, moved = (
            find_language(language).read_job([("a.nc", text.format(each).encode())], frames=TABLE)[
                0
            ]
            for each in ("", new)
        )
        assert kept.reason[1] == Reason.NONE
        assert moved.reason[1] != Reason.NONE


def test_a_tool_behind_a_call_is_not_certain() -> None:
    text = f"{HEAD['fanuc_gcode']}{POINT}M98 P9\nG21 G90 G54 G43.4 H1 G17 G40\n{POINT}M30\n"
    (program,) = find_language("fanuc_gcode").read_job([("a.nc", text.encode())], frames=TABLE)
    assert program.reason.tolist()[0] == Reason.NONE != program.reason[1]
    assert "tool is not certain behind a call" in "\n".join(program.notes)


def test_a_block_that_may_be_skipped_gets_no_words() -> None:
    """Were Y and Z inserted in it, the block behind it would take them from it, or not."""
    head = f"{HEAD['fanuc_gcode']}{POINT}"
    text = f"{head}X10. Y1. Z2.\n/X11.\nX12. Y1. Z2. A0. B0. C0.\n"
    (program,) = find_language("fanuc_gcode").read_job([("a.nc", text.encode())], frames=TABLE)
    # the target before it stays, since its words go through the block
    assert program.reason.tolist() == [Reason.NONE, *[Reason.INCOMPLETE] * 2, Reason.NONE]


_FULL = "G1 X5. Y6. Z7. A1. B0. C0.\n"
_CALLED = "O9\nG1 Z-5.\nM99\n"
KEPT, FINE, LOST = Reason.INCOMPLETE, Reason.NONE, Reason.UNKNOWN_FRAME


@pytest.mark.parametrize(
    ("language", "text", "called", "expected"),
    [
        # a cycle goes to its holes at the height of the point before it
        ("fanuc_gcode", f"{POINT}G81 X5. Y6. Z-5. R2. A0. B0. C0.\nG80\n", "",
         [KEPT, Reason.EXPRESSION]),
        # a called program takes over X and Y, and the program behind a call what that ends with
        ("fanuc_gcode", f"{POINT}M98 P9\n", _CALLED, [KEPT]),
        ("fanuc_gcode", f"{POINT}M98 P9\n", f"O9\n{_FULL}M99\n", [FINE]),
        ("fanuc_gcode", f"{POINT}M98 P9\nM30\n{_CALLED}", "", [KEPT] * 2),
        # a block moves before it calls
        ("fanuc_gcode", f"{POINT}X5. Y6. M98 P9\n", f"O9\n{_FULL}M99\n", [FINE] * 2),
        # a jump leads past the point before in the text
        ("fanuc_gcode", f"{POINT}IF [#1 EQ 1] GOTO 50\n{_FULL}N50 X7.\n", "", [KEPT] * 3),
        ("fanuc_gcode", f"{POINT}IF [#1 EQ 1] GOTO 50\n{_FULL}N50 {_FULL}", "", [FINE] * 3),
        # a switch skips the point before
        ("fanuc_gcode", f"{POINT}/{_FULL}X7.\n", "", [KEPT] * 3),
        ("fanuc_gcode", f"{POINT}/G1 X7. C5.\nX8. Y1. Z1.\n{_FULL}", "", [KEPT, KEPT, KEPT, FINE]),
        # the zero is put where the robot is
        ("fanuc_gcode", f"{POINT}G92 X0. Y0. Z0.\n{_FULL}", "", [KEPT, LOST]),
        # programs called at every point
        ("fanuc_gcode", f"{POINT}G66 P9\nG90\n{_FULL}G67\n{_FULL}", f"O9\nG91\n{_FULL}M99\n",
         [FINE, KEPT, KEPT]),
        ("sinumerik", f"{POINT}MCALL CYCLE81(50,0,2,-9)\n{_FULL}MCALL\n{_FULL}", "",
         [FINE, LOST, FINE]),
        # nobody knows where axis values lead to
        ("sinumerik", f"{POINT}G0 JT1=1 JT2=2 JT3=3 JT4=4 JT5=5 JT6=6\nG1 X5.\n{_FULL}", "",
         [FINE, KEPT, KEPT, FINE]),
        # offsets stay for the next run
        ("sinumerik", f"{POINT}$P_UIFR[1]=CTRANS(X,10)\nG54\n{_FULL}", "", [LOST, FINE]),
        ("fanuc_gcode", f"{POINT}G10 L2 P1 X10.\n", "", [LOST]),
        ("fanuc_gcode", f"{POINT}G10 L2 P2 X10.\n", "", [FINE]),
        # a main program that ends with M99 begins again as it is
        ("fanuc_gcode", f"{POINT}G52 X1. Y1. Z1.\nM99\n", "", [LOST]),
        ("fanuc_gcode", f"{POINT}G52 X1. Y1. Z1.\nG52 X0. Y0. Z0.\nM99\n", "", [FINE]),
        # a transformation is called, and the coordinates are still moved behind the label
        ("sinumerik", f"{POINT}TRANS X5\nL1:\nTRAORI\nG90 G54 T1\n{_FULL}", "", [FINE, KEPT]),
        # states that have one value keep it behind a label
        ("sinumerik", f"{POINT}L1:\n{_FULL}IF R1==1 GOTOB L1\n{_FULL}", "", [FINE] * 3),
        # what a word calls may be anything
        ("sinumerik", f"{POINT}OTHER\n{_FULL}", "", [FINE, KEPT]),
        # coordinates beside the call of a work offset lead on
        ("fanuc_gcode", f"G54.1 P3\n{POINT}G54.1 P3 X9.\nZ5.\n", "", [FINE] * 3),
    ],
)  # fmt: skip
def test_what_a_point_left_alone_takes_over(
    language: str, text: str, called: str, expected: list[Reason]
) -> None:
    files = [("a.nc", f"{HEAD[language]}{text}M30\n".encode())]
    files += [("O9.nc", called.encode())] if called else []
    program = find_language(language).read_job(files, frames=TABLE)[0]
    assert program.reason.tolist() == expected


def test_a_shift_below_a_call_in_a_loop() -> None:
    loop = f"AGAIN:\nSUB1\nTRANS X5\n{POINT}IF R1==1 GOTOB AGAIN\n"
    files = [("a.mpf", f"{HEAD['sinumerik']}{loop}M30\n".encode()), ("SUB1.spf", _FULL.encode())]
    program = find_language("sinumerik").read_job(files, frames=TABLE)[1]
    assert program.reason.tolist() == [Reason.UNKNOWN_FRAME]


def test_a_shift_that_a_called_program_begins_may_be_in_force_behind_the_call() -> None:
    full = b"L X+1.0 Y+2.0 Z+3.0 A+0.0 B+0.0 C+0.0 R0"
    again = b"TOOL CALL 1 Z\nM128\nCYCL DEF 247 Q339=+2\nTRANS DATUM RESET\n"
    table = FrameTable(
        bases={"preset 2": np.eye(4)}, tools={"1": np.eye(4)}, orientation=TABLE.orientation
    )
    for tilt, reason in (b"PLANE SPATIAL SPA+9 SPB+0 SPC+0 STAY\n", Reason.INCOMPLETE), (b"", 0):
        main = b"BEGIN PGM A MM\nCALL PGM SUB\n" + again + full + b"\nEND PGM A MM\n"
        sub = b"BEGIN PGM SUB MM\n" + tilt + full + b"\nEND PGM SUB MM\n"
        files = (("a.h", main), ("sub.h", sub))
        program, _ = find_language("heidenhain").read_job(files, frames=table)
        assert program.reason.tolist() == [reason]
