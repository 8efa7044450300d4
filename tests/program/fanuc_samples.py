"""Small Fanuc LS programs for the tests of the dialect."""

from __future__ import annotations

import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Program, Replacement

TABLE = FrameTable(tools={"1": np.eye(4)}, bases={"1": np.eye(4)})
POSE = (
    "    UF : {uf}, UT : {ut},        CONFIG : '{config}',\n"
    "\tX =   800.000  mm,\tY =  -100.000  mm,\tZ =   448.750  mm,\n"
    "\tW =   180.000 deg,\tP =    -0.000 deg,\tR =    15.000 deg{more}\n"
)
JOINTS = (
    "    UF : {uf}, UT : {ut},\n"
    "\tJ1=    10.000 deg,\tJ2=   -70.000 deg,\tJ3=   100.000 deg,\n"
    "\tJ4=     5.000 deg,\tJ5=    60.000 deg,\tJ6=   -20.000 deg{more}\n"
)


def record(
    number: int,
    form: str = POSE,
    *,
    uf: str = "1",
    ut: str = "1",
    config: str = "N U T, 0, 0, 0",
    more: str = "",
    name: str = "",
) -> str:
    """One position record, without the blank line end of the last."""
    body = form.format(uf=uf, ut=ut, config=config, more=more)
    return f"P[{number}{name}]{{\n   GP1:\n{body}}};\n"


def text(records: str, statements: str) -> str:
    """A whole program around statements (one per line) and its records."""
    lines = [f"{i:4d}:{line}" for i, line in enumerate(statements.strip("\n").split("\n"), 1)]
    return (
        f"/PROG  TEST\n/ATTR\nOWNER\t\t= MNEDITOR;\nLINE_COUNT\t= {len(lines)};\n"
        "DEFAULT_GROUP\t= 1,*,*,*,*;\n/MN\n" + "\n".join(lines) + f"\n/POS\n{records}/END\n"
    )


def read(program: str | bytes, frames: FrameTable = TABLE) -> Program:
    data = program if isinstance(program, bytes) else program.encode("latin-1")
    return find_language("fanuc_ls").read(data, name="test.ls", frames=frames)


def body(records: str, statements: str, frames: FrameTable = TABLE) -> Program:
    return read(text(records, statements), frames)


def shifted(program: Program, by_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Replacement:
    return Replacement(
        changed=program.reason == 0,
        position=program.position + np.array(by_mm) * 1e-3,
        rotation=program.rotation,
        axes=program.axes,
        words=np.full_like(program.words, NO_WORD),
    )


def changed_lines(program: Program, change: Replacement) -> list[str]:
    before = program.data.decode("latin-1").splitlines()
    after = find_language("fanuc_ls").write(program, change).decode("latin-1").splitlines()
    assert len(before) == len(after)
    return [new for old, new in zip(before, after, strict=True) if old != new]
