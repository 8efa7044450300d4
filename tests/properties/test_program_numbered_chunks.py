"""Fanuc LS programs and Yaskawa jobs of any lines: in blocks they are the whole, byte for byte."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "fuzz"))

from languages import LANGUAGES
from test_program_path_chunks import shift
from written import TABLE, Pen

from robotrue.core.arm_words import NO_WORD
from robotrue.program.formats import file_survey, read_job, write_program
from robotrue.program.program import Motion, Program, Replacement
from robotrue.program.program_chunk import Whole
from robotrue.program.program_file import ProgramFile, outline_job, read_chunk, write_chunk

SEEDS = 40
NAMES = ("fanuc_ls", "jbi")
COUNT = re.compile(r"\b\d+ (?=targets|points|positions)")
STATEMENTS = {
    "fanuc_ls": [
        "DO[1]=ON", "WAIT .50(sec)", "CALL SUB", "!  P[1]", "IF R[1]=1,JMP LBL[1]", "LBL[1]",
        "UFRAME_NUM=1", "UTOOL_NUM=2", "R[2]=R[1]+1", "PAYLOAD[1]", "//L P[1] 5% FINE",
    ],
    "jbi": ["DOUT OT#(1) ON", "TIMER T=0.50", "*L1", "'MOVL C00001", "CALL JOB:SUB", "SET B001 1"],
}  # fmt: skip
RARE = {
    "fanuc_ls": ["PR[1]=P[3]", "R[2]=P[2,1]", "Touch Offset PR[1]", "L PR[1] 5mm/sec FINE",
                 "L P[R[1]] 5mm/sec FINE", "L P[9999] 2mm/sec FINE", "L P[1] 2mm/sec FINE INC"],
    "jbi": ["SET P001 P002", "SFTON P001", "IMOV P001 V=5.0", "SETUFRAME UF#(1) P001",
            "MOVL P001 V=5.0", "MOVL C00001 V=5.0", "+MOVJ EC00001", "GETPOS PX001 STEP#(1)",
            "+SFTON3D P001"],
}  # fmt: skip


def fanuc_point(pen: Pen, k: int) -> tuple[str, str]:
    """A move and a record."""
    verb, tail = pen.pick(*"LLLLLLJS"), pen.pick(*["200mm/sec CNT100"] * 20, "5% FINE INC", "x%")
    verb = pen.pick(*[verb] * 12, "A")
    name = pen.pick(*[""] * 9, ':"a b"')
    config = pen.pick(*["N U T, 0, 0, 0"] * 5, "F U T, 0, 0, 1", "odd", "")
    frame, more = pen.pick(*"11111112F"), pen.pick(*[""] * 40, ",\n E1 = 0.0 mm", ",\n E1 = 2.0 mm")
    values = [f"{n} = {pen.place()} mm" for n in "XYZ"] + [
        f"{n} = {pen.angle()} deg" for n in "WPR"
    ]
    if pen.chance(0.03):
        values = [f"J{n}= {pen.angle()} deg" for n in range(1, 7)]
    elif pen.chance(0.02):
        values[2] = "Z = ******** mm"
    quoted = f" CONFIG : '{config}'," if config else ""
    head = f"P[{k}{name}]{{\n   GP1:\n\tUF : {frame}, UT : 1,{quoted}\n\t"
    return f"{verb} P[{k}{name}] {tail}", head + ", ".join(values) + more + "\n};"


def jbi_point(pen: Pen, k: int) -> tuple[str, str]:
    """A move and a point with the lines before it."""
    verb, tail = (
        pen.pick(*"LLLLLLJSCC"),
        pen.pick(*["V=200.0"] * 9, "V=1 'C1", "VJ=2.0 +MOVJ EC00001"),
    )
    words = "///RCONF " + ",".join(str(pen.whole(0, 1)) for _ in range(8)) + "\n"
    head = pen.pick(*[""] * 20, "///USER 2\n", "///TOOL 2\n", "///POSTYPE BASE\n///RECTAN\n",
                    "///POSTYPE PULSE\n///PULSE\n", "///POSTYPE TOOL\n///RECTAN\n",
                    "'c C1\n", "\n")  # fmt: skip
    values = [pen.place() for _ in range(3)] + [pen.angle() for _ in range(3 - pen.chance(0.02))]
    point = head + words * pen.chance(0.8) + f"C{k:05d}=" + pen.pick(",", ",", " , ").join(values)
    return f"MOV{verb} C{k:05d} {tail}", point


def written(pen: Pen, name: str) -> bytes:
    """A program whose moves go to its points in their order, for the most part."""
    fanuc, count = name == "fanuc_ls", pen.whole(3, 60)
    moves, points = zip(*((fanuc_point if fanuc else jbi_point)(pen, k)
                          for k in range(1, count + 1)), strict=True)  # fmt: skip
    body: list[str] = []
    for move in moves:
        body += [move] * (not pen.chance(0.05)) + [pen.pick(*STATEMENTS[name])] * pen.chance(0.1)
        if fanuc and pen.chance(0.03) and len(body) > 1 and body[-1][:3] == body[-2][:3] == "L P":
            via, last = body[-2].split(" ")[1], body.pop()
            body[-1] = f"C {via}\n    {last[2:]}"
    while pen.chance(0.25):
        body.insert(pen.whole(0, len(body)), pen.pick(*RARE[name]))
    if fanuc:
        lines = [f"{i:4d}:{pen.pick('', '  ')}{each} ;" for i, each in enumerate(body, 1)]
        head = ["/PROG  PART", "/ATTR", "LINE_COUNT = 1;", "/MN"]
        return pen.encode([*head, *lines, "/POS", *points, "/END"], mark=False)
    counted = f"///NPOS {pen.pick(str(count), '7')},0,1,1,0,0"
    others = ["EC00001=1.0", "P00001=1.0,2.0,3.0,4.0,5.0,6.0"]
    head = ["/JOB", "//NAME PART", "//POS", counted, "///TOOL 1", *others]
    head += ["///USER 1", "///POSTYPE USER", "///RECTAN"]
    lines = [*head, *points, "//INST", "///ATTR SC,RW", "NOP", *body, "END"]
    return pen.encode(lines, mark=False)


def rewritten(program: Program) -> Replacement:
    """Every compensable target moved and some turned to other words, by its numbers alone."""
    change = shift(program)
    odd = np.sin(7e3 * np.nan_to_num(program.position[:, :1])) > 0.3
    other = np.where(program.words == 0, 1, 0)
    words = np.where(odd & (program.words != NO_WORD) & change.changed[:, None], other, NO_WORD)
    return replace(change, words=words)


def require_same(path: Path, whole: Program, found: ProgramFile) -> None:
    """The chunks are the program that is read whole, and are written as it is."""
    chunks = [
        read_chunk(whole.data[c.lines.start : c.lines.end], c.lines, found.content)
        for c in found.chunks
    ]
    parts = [chunk.program for chunk in chunks]
    assert [len(p) for p in parts] == [c.targets for c in found.chunks]
    assert [c.first for c in found.chunks] == np.cumsum([0, *map(len, parts[:-1])]).tolist()
    assert found.targets == len(whole)
    for name in ("position", "rotation", "axes", "motion", "reason", "words", "line"):
        joined = np.concatenate([getattr(p, name) for p in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name), err_msg=name)
    for index, table in (("frame", "T_base_frame"), ("tool", "T_flange_tool")):
        joined = np.concatenate([getattr(p, table)[getattr(p, index)] for p in parts])
        np.testing.assert_array_equal(joined, getattr(whole, table)[getattr(whole, index)])
    moved = np.flatnonzero(whole.motion != Motion.UNUSED)  # so are steps between blocks measured
    assert whole.path[:, 1].tolist() == moved.tolist()
    assert ((whole.path[:, 2] == Motion.PTP) == (whole.motion[moved] == Motion.PTP)).all()
    assert set(found.notes) == {COUNT.sub("", note) for note in whole.notes}
    assert b"".join(write_chunk(c, rewritten(c.program)) for c in chunks) == write_program(
        whole, rewritten(whole)
    )


def compare(path: Path, name: str, seed: int, targets: int) -> str:
    """Compares one program in blocks with the whole; returns what became of it."""
    path.write_bytes(written(Pen.of([seed, len(name)]), name))
    (whole,) = read_job(path, TABLE)
    found = outline_job(path, TABLE, targets=targets)
    if isinstance(found, Whole):
        return found.why
    require_same(path, whole, found[0])
    return f"{min(len(found[0].chunks), 5)} blocks"


@pytest.mark.parametrize("name", NAMES)
def test_blocks_are_the_whole(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / LANGUAGES[name].name
    monkeypatch.setattr(file_survey, "LONGEST_CHUNK", 1000)
    done = []
    for seed in range(SEEDS):
        monkeypatch.setattr(file_survey, "WINDOW", (60, 200, 1 << 20)[seed % 3])
        done += [compare(path, name, seed, targets) for targets in (1, 4)]
    assert sum(each in ("3 blocks", "4 blocks", "5 blocks") for each in done) > SEEDS // 2
