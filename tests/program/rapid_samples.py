"""Small RAPID modules for the tests of the dialect."""

from __future__ import annotations

import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Program, Replacement

REST = "[9E9,9E9,9E9,9E9,9E9,9E9]"
FRAMES = """MODULE part
  PERS tooldata spindle:=[TRUE,[[0,0,215.5],[0.96592583,0,0.25881905,0]],[2,[0,0,15],[1,0,0,0],0,0,0]];
  TASK PERS wobjdata fixture:=[FALSE,TRUE,"",[[800,-100,450],[0.99144486,0,0,0.13052619]],[[0,0,10],[1,0,0,0]]];
"""  # noqa: E501
T_FIXTURE = np.array(
    [
        [np.cos(np.pi / 12), -np.sin(np.pi / 12), 0, 0.8],
        [np.sin(np.pi / 12), np.cos(np.pi / 12), 0, -0.1],
        [0, 0, 1, 0.46],
        [0, 0, 0, 1],
    ]
)


def target(x: float = 1.0, y: float = 2.0, z: float = 3.0, external: str = REST) -> str:
    return f"[[{x:.3f},{y:.3f},{z:.3f}],[0.00000000,1.00000000,0.00000000,0.00000000],[0,0,-1,0],{external}]"  # noqa: E501


def read(text: str | bytes, frames: FrameTable | None = None, name: str = "part.mod") -> Program:
    data = text if isinstance(text, bytes) else text.encode("latin-1")
    return find_language("rapid").read(data, name=name, frames=frames or FrameTable())


def module(motions: str, data: str = "", frames: FrameTable | None = None) -> Program:
    return read(f"{FRAMES}{data}\nPROC main()\n{motions}\nENDPROC\nENDMODULE\n", frames)


def move(what: str, how: str = "MoveL") -> str:
    return f"{how} {what},v100,z1,spindle\\WObj:=fixture;\n"


def replacement(
    program: Program,
    *,
    by_mm: tuple[float, float, float] = (0.0, 0.0, 0.0),
    rotation: np.ndarray | None = None,
    words: np.ndarray | None = None,
    axes: np.ndarray | None = None,
    changed: np.ndarray | None = None,
) -> Replacement:
    return Replacement(
        changed=program.reason == 0 if changed is None else changed,
        position=program.position + np.array(by_mm) * 1e-3,
        rotation=program.rotation if rotation is None else program.rotation @ rotation,
        axes=program.axes if axes is None else axes,
        words=np.full_like(program.words, NO_WORD) if words is None else words,
    )


def write(program: Program, change: Replacement) -> str:
    return find_language("rapid").write(program, change).decode("latin-1")


def changed_lines(program: Program, change: Replacement) -> list[str]:
    before = program.data.decode("latin-1").splitlines()
    after = write(program, change).splitlines()
    assert len(before) == len(after)
    return [new for old, new in zip(before, after, strict=True) if old != new]
