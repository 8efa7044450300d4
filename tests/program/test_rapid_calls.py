"""RAPID routines that conditions, names, other modules and a new cycle start."""

from __future__ import annotations

import numpy as np
import pytest
from rapid_samples import FRAMES, move, read, target

from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Program, Reason

SHIFT = "PDispSet [[0,0,50],[1,0,0,0]];\n"
FUNCTION = f"FUNC num ask()\n{SHIFT}IF di1=1 RETURN 1;\nRETURN 2;\nENDFUNC\n"


def read_task(part: str, **beside: str) -> Program:
    """The first module, which declares the frames, read with others."""
    files = {"part": FRAMES.removeprefix("MODULE part\n") + part, **beside}
    job = [(f"{n}.mod", f"MODULE {n}\n{text}\nENDMODULE".encode()) for n, text in files.items()]
    return find_language("rapid").read_job(job, frames=FrameTable())[0]


def read_heights(program: Program) -> list[float | None]:
    """By how many mm each target is displaced; None: it is left alone, being unknown."""
    z = program.T_base_frame[program.frame][:, 2, 3] * 1e3 - 460.0
    unknown = np.isin(program.reason, (Reason.UNKNOWN_FRAME, Reason.RELATIVE))
    return [None if lost else round(up) for lost, up in zip(unknown, z.tolist(), strict=True)]


@pytest.mark.parametrize(
    ("text", "heights"),
    [
        ("IF di2=1 THEN\n{0}ELSEIF ask()=1 THEN\n{1}ELSE\n{2}ENDIF\n{3}", [0, 50, 50, None]),
        ("WHILE ask()=1 DO\n{0}PDispOff;\nENDWHILE\n{1}", [50, None]),
        ("IF ask()=1 {0}{1}", [50, 50]),
        ("IF di2=1 OR ask()=1 {0}{1}", [None, None]),  # not called where it does not decide
        ("IF di2=1 THEN\n{0}ELSEIF di3=1 OR ask()=1 THEN\n{1}ENDIF\n", [0, None]),
    ],
)
def test_functions_in_conditions_run_before_every_alternative(
    text: str, heights: list[float | None]
) -> None:
    body = text.format(*(move(target(k)) for k in range(4)))
    program = read(f"{FRAMES}PROC main()\nPDispOff;\n{body}PDispOff;\nENDPROC\n{FUNCTION}ENDMODULE")
    assert read_heights(program) == heights


@pytest.mark.parametrize(
    ("call", "behind", "inside"),
    [
        ("sub;", 0, 50),
        ('%"sub"%;', 0, 50),
        ('%"part:sub"%;', 0, 50),
        ('%"su"+name%;', None, 50),
        ('CallByVar "su",n;', None, 50),
    ],
)
def test_a_routine_called_by_name_begins_with_what_is_in_force(
    call: str, behind: int | None, inside: int
) -> None:
    end = move(target(1)) + "PDispOff;\n"
    main = f"PROC main()\nPDispOff;\n{SHIFT}{call}\n{end}ENDPROC\n"
    sub = f"PROC sub()\n{move(target(2))}PDispOff;\nENDPROC\n"
    assert read_heights(read(f"{FRAMES}{main}{sub}ENDMODULE")) == [behind, inside]


@pytest.mark.parametrize(
    ("helper", "sub", "height"),
    [
        ("PROC help()\nsub;\nENDPROC", SHIFT, None),
        ("PROC help()\nsub;\nENDPROC", "", 0),
        ("PROC help()\nstep;\nENDPROC\nLOCAL PROC step()\nIF ask()=1 RETURN;\nENDPROC\n"
         "FUNC num ask()\nsub;\nENDFUNC", SHIFT, None),
        ("PROC help()\ndeep;\nENDPROC", "", None),
        ("PROC help()\nvendor 1;\nENDPROC", "", None),
        ('PROC help()\n%"sub"%;\nENDPROC', SHIFT, None),
        ("PROC help()\nfixture:=other;\nENDPROC", "", None),
        ("PROC help()\nEOffsOff;\nENDPROC\nPROC no()\nfixture:=other;\nENDPROC", "", 0),
    ],
)  # fmt: skip
def test_routines_of_other_modules_do_all_that_they_call(
    helper: str, sub: str, height: int | None
) -> None:
    main = f"PROC main()\nPDispOff;\nhelp;\n{move(target(1))}PDispOff;\nENDPROC\n"
    deep = f"PROC deep()\n{SHIFT}ENDPROC"
    program = read_task(f"{main}PROC sub()\n{sub}ENDPROC", a=helper, b=deep)
    assert read_heights(program) == [height]
    assert any("vendor is in no file given" in n for n in program.notes) == ("vendor" in helper)


def test_a_routine_that_another_module_calls_back_begins_with_what_is_in_force() -> None:
    main = f"PROC main()\nPDispOff;\n{SHIFT}help;\nPDispOff;\nENDPROC\n"
    sub = f"PROC sub()\n{move(target(2))}ENDPROC"
    assert read_heights(read_task(main + sub, a="PROC help()\nsub;\nENDPROC")) == [50]
    trap = read_task(main + sub, a="PROC help()\nENDPROC\nTRAP stop\nsub;\nENDTRAP")
    assert read_heights(trap) == [None]


def test_traps_of_other_modules_that_change_frames_are_reported() -> None:
    main = f"PROC main()\n{move(target(1))}ENDPROC"
    changing = read_task(main, a=f"TRAP stop\n{SHIFT}ENDTRAP")
    assert any("stop, which an interrupt or an error starts" in n for n in changing.notes)
    assert not read_task(main, a="TRAP stop\nk:=1;\nENDTRAP").notes


@pytest.mark.parametrize(
    ("statement", "first"),
    [
        ("IF di1=1 ExitCycle;", None),
        ("IF di1=1 THEN\nExitCycle;\nENDIF", None),
        ("sub;", None),
        ("IF di1=1 EXIT;", 0),  # the displacement ends with the program
        ("IF di1=1 RETURN;", None),
        ("", 0),
    ],
)
def test_a_cycle_that_ends_early_leaves_its_displacement_to_the_next(
    statement: str, first: int | None
) -> None:
    main = (
        f"PROC main()\n{move(target(1))}{SHIFT}{statement}\n{move(target(2))}PDispOff;\nENDPROC\n"
    )
    sub = "PROC sub()\nIF di1=1 THEN\nExitCycle;\nENDIF\nENDPROC\n"
    assert read_heights(read(f"{FRAMES}{main}{sub}ENDMODULE")) == [first, 50]


def test_work_objects_outlive_the_program() -> None:
    main = f"PROC main()\n{move(target(1))}fixture.uframe:=[[9,0,0],[1,0,0,0]];\nIF di1=1 EXIT;\n"
    back = "fixture.uframe:=[[800,-100,450],[0.99144486,0,0,0.13052619]];\nENDPROC\nENDMODULE"
    assert read(FRAMES + main + back).reason.tolist() == [Reason.UNKNOWN_FRAME]
    assert read(FRAMES + main.replace("EXIT", "Stop") + back).reason.tolist() == [Reason.NONE]


def test_local_frames_of_other_modules_mean_nothing_here() -> None:
    text = f"MODULE part\nPROC main()\n{move(target())}ENDPROC\nENDMODULE"
    data = FRAMES.replace("TASK ", "")
    one = data.replace("part", "one").replace("PERS", "LOCAL PERS") + "ENDMODULE"
    two = data.replace("part", "two").replace("[800,-100,450]", "[800,-100,500]") + "ENDMODULE"
    files = [("part.mod", text.encode()), ("one.mod", one.encode()), ("two.mod", two.encode())]
    assert read_heights(find_language("rapid").read_job(files, frames=FrameTable())[0]) == [50]


def test_routines_in_no_file_may_change_what_the_module_computes_with() -> None:
    data = f"VAR num k;\nLOCAL VAR num m;\nCONST robtarget p:={target()};\n"
    main = f"PROC main()\nk:=5;\nm:=5;\nvendor;\nPDispOff;\n{move('Offs(p,0,0,k)')}"
    main += f"{move('Offs(p,0,0,m)')}ENDPROC\nENDMODULE"
    known = FrameTable(harmless_routines=("vendor",))
    frames = FRAMES.replace("TASK PERS", "PERS").replace("PERS", "LOCAL PERS")
    assert read(frames + data + main).reason.tolist()[1:] == [Reason.RELATIVE, Reason.NONE]
    assert read(frames + data + main, known).reason.tolist()[1:] == [Reason.NONE, Reason.NONE]
