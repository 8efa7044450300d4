"""Small Yaskawa jobs for the tests of the dialect."""

from __future__ import annotations

import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Program, Replacement

TABLE = FrameTable(tools={"1": np.eye(4)}, bases={"2": np.eye(4)})
HEAD = "///TOOL 1\n///POSTYPE BASE\n///RECTAN\n///RCONF 1,0,0,0,0,0,0,0\n"
P = "800.000,-100.000,448.750,180.0000,-0.0000,15.0000"


def text(points: str, moves: str, *, groups: str = "RB1", attributes: str = "") -> str:
    """A whole job around its points and moves; NPOS counts them."""
    lines = points.strip().split("\n")
    counts = [
        sum(line.startswith(kind) and line[len(kind)].isdigit() for line in lines)
        for kind in ("C", "BC", "EC", "P", "BP", "EX")
    ]
    return (
        f"/JOB\n//NAME TEST\n//POS\n///NPOS {','.join(map(str, counts))}\n{points.strip()}\n"
        f"//INST\n///DATE 2026/11/21 08:11\n///ATTR SC,RW,RJ\n{attributes}///GROUP1 {groups}\n"
        f"NOP\n{moves.strip()}\nEND\n"
    )


def read(job: str | bytes, frames: FrameTable = TABLE) -> Program:
    data = job if isinstance(job, bytes) else job.encode("latin-1")
    return find_language("jbi").read(data, name="test.jbi", frames=frames)


def body(points: str, moves: str, frames: FrameTable = TABLE, **more: str) -> Program:
    return read(text(points, moves, **more), frames)


def shifted(program: Program, by_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Replacement:
    return Replacement(
        changed=program.reason == 0,
        position=program.position + np.array(by_mm) * 1e-3,
        rotation=program.rotation,
        axes=program.axes,
        words=np.full_like(program.words, NO_WORD),
    )


def written(program: Program, change: Replacement) -> list[str]:
    return find_language("jbi").write(program, change).decode("latin-1").splitlines()
