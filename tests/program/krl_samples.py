"""Small KRL programs and replacements for the tests of the dialect."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.program.formats import read_job
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Program, Replacement

HEAD = "DEF part()\n$BASE={X 800,Y -100,Z 450,A 15,B 0,C 0}\n$TOOL={X 0,Y 0,Z 215.5,A 0,B 30,C 0}\n"


def read(text: str | bytes, frames: FrameTable | None = None, name: str = "part.src") -> Program:
    data = text if isinstance(text, bytes) else text.encode("latin-1")
    return find_language("krl").read(data, name=name, frames=frames or FrameTable())


def body(text: str, frames: FrameTable | None = None) -> Program:
    return read(HEAD + text + "\nEND\n", frames)


def job(folder: Path, src: str, dat: str, frames: FrameTable | None = None) -> tuple[Program, ...]:
    (folder / "part.src").write_bytes(src.encode("latin-1"))
    (folder / "part.dat").write_bytes(dat.encode("latin-1"))
    return read_job(folder / "part.src", frames)


def replacement(
    program: Program,
    *,
    by_mm: tuple[float, float, float] = (0.0, 0.0, 0.0),
    rotation: np.ndarray | None = None,
    rows: list[int] | None = None,
) -> Replacement:
    """A shift of every compensable row, or of ``rows``; nothing else changes."""
    changed = program.reason == 0
    if rows is not None:
        changed = np.isin(np.arange(len(program)), rows)
    return Replacement(
        changed=changed,
        position=program.position + np.array(by_mm) * 1e-3,
        rotation=program.rotation if rotation is None else program.rotation @ rotation,
        axes=program.axes,
        words=np.full_like(program.words, NO_WORD),
    )


def write(program: Program, change: Replacement) -> str:
    return find_language("krl").write(program, change).decode("latin-1")


def changed_lines(program: Program, change: Replacement) -> list[str]:
    before = program.data.decode("latin-1").splitlines()
    after = write(program, change).splitlines()
    assert len(before) == len(after)
    return [new for old, new in zip(before, after, strict=True) if old != new]
