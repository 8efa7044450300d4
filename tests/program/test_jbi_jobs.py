"""Yaskawa jobs that call each other: P points, shifts and frames belong to the controller."""

from __future__ import annotations

import re

import pytest
from jbi_samples import HEAD, TABLE, P, text

from robotrue.program.lang import find_language
from robotrue.program.program import Motion, Program, Reason

C_POINT, P_POINT = f"{HEAD}C00000={P}", f"{HEAD}P00001={P}"
FREE, SHIFTED = Reason.NONE, Reason.RELATIVE


def read_jobs(*jobs: tuple[str, str], points: str, attributes: str = "") -> tuple[Program, ...]:
    """Jobs MAIN and SUB, as points and moves."""
    files = []
    for name, (own, moves) in zip(("MAIN", "SUB"), jobs, strict=True):
        job = text(own or points, moves, attributes=attributes if name == "SUB" else "")
        files.append((f"{name.lower()}.jbi", re.sub("NAME .*", f"NAME {name}", job).encode()))
    return find_language("jbi").read_job(files, frames=TABLE)


@pytest.mark.parametrize(
    ("main", "sub", "left"),
    [
        ("MOVL P001\nCALL JOB:SUB", "MOVL P001", False),
        ("MOVL P001\nCALL JOB:SUB", "MOVL P001\nCALL JOB:MAIN", False),
        ("MOVL P001\nCALL JOB:SUB", "MOVL P001\nSET P002 P003", False),
        ("SETE P001 (3) D000\nCALL JOB:SUB", "MOVL P001", True),
        ("MOVL P001\nCALL JOB:SUB", "ADD P001 P009", True),
        ("MOVL P001\nCALL JOB:SUB", "IMOV P001 V=1.0 BF", True),
        ("MOVL P001\nCALL JOB:SUB", "SET P[I000] P002", True),
        ("MOVL P001\nCALL JOB:SUB", "MOVL C00000 V=1.0 +MOVL P001 V=1.0", True),
        ("MOVL P001\nSFTON P009\nCALL JOB:SUB\nSFTOF", "MOVL P001", True),
        ("MOVL P001\nCALL JOB:SUB", "CALL JOB:GONE", True),
    ],
)
def test_a_p_point_is_left_alone_if_another_job_sets_or_shifts_it(
    main: str, sub: str, left: bool
) -> None:
    both = f"{C_POINT}\nP00001={P}"
    for points in (both, ""), ("", both), (both, both):  # files may name points they do not hold
        programs = read_jobs((points[0], main), (points[1], sub), points=C_POINT)
        reasons = [program.reason[1] for program in programs if len(program) > 1]
        assert all((reason != FREE) == left for reason in reasons)


def test_a_p_point_has_the_same_fate_in_every_file_that_may_be_loaded_last() -> None:
    arc = f"{HEAD}P00001={P}\n///TOOL 7\nC00000={P}\nC00001={P}"
    moves = "MOVC P001\nMOVC C00000\nMOVC C00001\nCALL JOB:SUB"
    main, sub = read_jobs((arc, moves), (P_POINT, "MOVL P001"), points="")
    assert main.reason.tolist() == [Reason.UNKNOWN_FRAME] * 3
    assert sub.reason.tolist() == [Reason.UNKNOWN_FRAME]
    main, sub = read_jobs(("", "CALL JOB:SUB"), ("", "MOVJ P001"), points=P_POINT)
    assert (main.reason.tolist(), sub.reason.tolist()) == ([FREE], [FREE])
    assert main.motion.tolist() == [Motion.PTP]


@pytest.mark.parametrize(
    ("main", "sub", "reasons"),
    [
        ("SFTON P009\nCALL JOB:SUB\nSFTOF\nMOVL C00000", "MOVL C00000", (FREE, SHIFTED)),
        ("MOVL C00000\nSFTON P009\nJUMP JOB:SUB", "SFTOF\nMOVL C00000", (FREE, FREE)),
        ("MOVL C00000\nSFTON P009\nJUMP JOB:SUB", "MOVL C00000", (SHIFTED, SHIFTED)),
        ("CALL JOB:SUB\nMOVL C00000", "MOVL C00000\nSFTON P009", (SHIFTED, SHIFTED)),
        ("CALL JOB:SUB\nSFTOF\nMOVL C00000", "MOVL C00000\nSFTON P009", (FREE, FREE)),
        ("MOVL C00000\nCALL JOB:SUB IF B000=1", "SFTON P009", (SHIFTED, Reason.UNUSED)),
        ("CALL JOB:SUB\nMOVL C00000", "SFTON P009\nRET IF B000=1\nSFTOF\nMOVL C00000",
         (SHIFTED, FREE)),
        ("CALL JOB:SUB\nMOVL C00000", "SFTON P009\nSFTOF\nMOVL C00000", (FREE, FREE)),
        ("CALL JOB:SUB\nMOVL C00000", "MOVL C00000\nSFTON P009\nJUMP JOB:GONE\nSFTOF",
         (SHIFTED, SHIFTED)),
        ("SFTON P009\nCALL B000\nSFTOF\nMOVL C00000", "MOVL C00000", (FREE, SHIFTED)),
        ("IFTHENEXP B000=1\nSFTON P009\nELSE\nMOVL C00000\nENDIF\nCALL JOB:SUB\nSFTOF",
         "MOVL C00000", (FREE, SHIFTED)),
        ("SWITCH B000\nCASE 1\nSFTON P009\nDEFAULT\nSFTOF\nENDSWITCH\nCALL JOB:SUB\nSFTOF\n"
         "MOVL C00000", "MOVL C00000", (FREE, SHIFTED)),
        ("FOR I000 START= 1 TO 2\nMOVL C00000\nSFTON P009\nNEXT I000\nSFTOF\nCALL JOB:SUB",
         "MOVL C00000", (SHIFTED, FREE)),
        ("*A\nMOVL C00000\nSFTON P009\nJUMP LABEL:B000 IF B000=1\nSFTOF", "MOVL C00000",
         (SHIFTED, FREE)),
    ],
)  # fmt: skip
def test_a_shift_lasts_over_jobs_and_runs(
    main: str, sub: str, reasons: tuple[Reason, Reason]
) -> None:
    programs = read_jobs(("", main), ("", sub), points=C_POINT)
    assert tuple(program.reason[0] for program in programs) == reasons
    for program in programs:
        assert bool(program.reason[0] == SHIFTED) <= ("shift" in "".join(program.notes))


@pytest.mark.parametrize(("number", "reason"), [("2", FREE), ("3", Reason.UNKNOWN_FRAME)])
def test_a_relative_job_that_is_called_with_another_frame(number: str, reason: Reason) -> None:
    points = f"///USER 2\n///TOOL 1\n///POSTYPE USER\n///RECTAN\nC00000={P}"
    calls = (C_POINT, f"CALL JOB:SUB UF#({number})"), (points, "MOVL C00000")
    assert read_jobs(*calls, points="", attributes="////FRAME USER 2\n")[1].reason[0] == reason
    assert read_jobs(*calls, points="")[1].reason[0] == FREE
