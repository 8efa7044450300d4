"""Long RAPID modules and UR scripts read in blocks: the targets and bytes of the whole."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.program.formats import file_survey, read_job, write_program
from robotrue.program.program import FrameTable, Program, Reason, Replacement
from robotrue.program.program_chunk import Whole
from robotrue.program.program_file import ProgramFile, outline_job, read_chunk, write_chunk

FAR = 90
"""Number of a target beyond the reach of any arm, the first of its stretch."""


def target(k: int) -> str:
    return (
        f"[[{(2e6 if k == FAR else 800) + k % 97:.3f},{-50 + 0.25 * k:.3f},{500 - k % 31:.3f}],"
        f"[0.5,{'-' if k % 2 else ''}0.5,0.5,0.5],[0,-1,{k % 3},0],[9E9,9E+09,9E9,9E9,9E9,0]]"
    )


def moves(count: int, tail: str = "tool1\\WObj:=wobj1", first: int = 0) -> list[str]:
    out = []
    for k in range(first, first + count):
        if k % 13 == 4:
            out += ["", f"    ! side {k}; MoveL {target(k)}"]
        if k % 19 == 6:
            out.append(f"  MoveC {target(k)}, {target(k + 1)}, v100, z10, {tail};")
        elif k % 11 == 2:
            out.append(f"  movej {target(k)},[100,500,5000,1000],fine,{tail}; ! joint")
        else:
            out.append(f"    MoveL {target(k)},v100\\V:=50,z1,{tail};")
    return out


RAPID = [
    "%%%", "  VERSION:1", "  LANGUAGE:ENGLISH", "%%%", "MODULE m",
    "PERS tooldata tool1:=[TRUE,[[0,0,200],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];",
    'PERS wobjdata wobj1:=[FALSE,TRUE,"",[[500,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];',
    "PROC main()", "  ConfL\\Off;",
    "MoveAbsJ [[0,10,-20,0,40,5],[9E9,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs,v50,fine,tool1;",
    *moves(60), "SetDO spindle, 1;", *moves(30, first=60),
    *moves(60, "Tool1", FAR), *moves(30, "tool1 \\WObj:=wobj1", 150), "IF go THEN",
    "  wobj1.oframe.trans.x:=7;", *moves(20, first=180), "ENDIF", *moves(50, first=200),
    *moves(30, "tool9\\WObj:=wobj1", 250), "ENDPROC", "ENDMODULE",
]  # fmt: skip


def script() -> list[str]:
    def pose(k: int) -> str:
        place = (
            f"{(2e3 if k == FAR + 1 else 0.4) + k * 1e-4:.6f}, {-0.1 + k % 7 * 1e-3:.6f},0.30000"
        )
        return f"p[{place},0.0,3.141593,{k * 1e-3:.4f}]"

    out = [
        "def p():",
        "  set_tcp(p[0,0,0.2,0,0,0])",
        "  plane = p[0.5,0,0.1,0,0,0.3]",
        "  movej([0.0,-1.57,1.57,-1.2,-1.57,0],a=1.4,v=1)",
    ]
    for k in range(300):
        if k == FAR:
            out += ["  # next tool", "  set_tcp(p[0,0,0.25,0,0,0.1])"]
        if k == 180:
            out += ["  while go:", "    set_tcp(frame)"]
        if k == 220:
            out += ["  end", "  set_tcp(p[0,0,0.25,0,0,0.1])"]
        if 40 < k < 60:
            out.append(f"  movel(pose_trans(plane,{pose(k)}),a=1.2,v=0.05)")
        elif k % 17 == 5:
            out.append(f"  movec({pose(k)},{pose(k + 1)},a=1.2,v=0.05,r=0.001)")
        else:
            out.append(
                f"  move{'lp'[k % 2]}({pose(k)},a=1.2,v=0.05,r=0.001)" + " # x" * (k % 5 == 0)
            )
    return [*out, "end"]


def shift(program: Program) -> Replacement:
    return Replacement(
        changed=program.reason == Reason.NONE,
        position=program.position + np.array([1.25e-4, -2.5e-4, 0.0]),
        rotation=program.rotation,
        axes=program.axes,
        words=np.full_like(program.words, -1),
    )


def outline(path: Path) -> ProgramFile | Whole:
    files = outline_job(path, FrameTable(), targets=25)
    return files if isinstance(files, Whole) else files[0]


def require_same(path: Path) -> ProgramFile:
    found = outline(path)
    assert isinstance(found, ProgramFile), found
    (whole,) = read_job(path, FrameTable())
    chunks = [
        read_chunk(whole.data[c.lines.start : c.lines.end], c.lines, found.content)
        for c in found.chunks
    ]
    parts = [chunk.program for chunk in chunks]
    assert [len(p) for p in parts] == [b.targets for b in found.chunks]
    for name in ("position", "rotation", "axes", "motion", "reason", "words", "line"):
        joined = np.concatenate([getattr(p, name) for p in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name), err_msg=name)
    for index, table in (("frame", "T_base_frame"), ("tool", "T_flange_tool")):
        joined = np.concatenate([getattr(p, table)[getattr(p, index)] for p in parts])
        np.testing.assert_array_equal(joined, getattr(whole, table)[getattr(whole, index)])
    written = b"".join(write_chunk(chunk, shift(chunk.program)) for chunk in chunks)
    assert written == write_program(whole, shift(whole))
    assert written != whole.data
    return found


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize(("name", "lines"), [("m.mod", RAPID), ("p.script", script())])
def test_blocks_are_the_whole(tmp_path: Path, name: str, lines: list[str], end: str) -> None:
    path = tmp_path / name
    path.write_bytes(end.join([*lines, ""]).encode())
    found = require_same(path)
    assert len(found.chunks) > 10
    assert len(found.content.program) > 4
    assert set(found.content.program.reason.tolist()) >= {Reason.NONE, Reason.UNKNOWN_FRAME}
    (whole,) = read_job(path, FrameTable())
    far = (np.abs(whole.position) > 1e3).any(axis=1)
    assert far.any()
    assert (whole.reason[far] == Reason.OUT_OF_REACH).all()


def test_windows_do_not_show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "m.mod"
    path.write_bytes("\r\n".join([*RAPID, ""]).encode())
    one = outline(path)
    monkeypatch.setattr(file_survey, "WINDOW", 700)
    other = require_same(path)
    assert isinstance(one, ProgramFile)
    assert [b.lines.start for b in one.chunks] == [b.lines.start for b in other.chunks]


@pytest.mark.parametrize(
    ("name", "line", "why"),
    [
        ("m.mod", f"  MoveL Offs({target(1)},0,0,1),v100,fine,tool1;", "line 8: a target"),
        ("m.mod", f"  MoveL {target(1)[:-2]}5]],v100,fine,tool1;", "line 8: a target"),
        ("m.mod", f"  MoveL {target(1)},v100,fine,tool1; MoveL {target(2)},v1,fine,tool1;", "line"),
        ("p.script", "  movel(pose_trans(p[0,0,1,0,0,0],q))", "line 3: a target"),
    ],
)
def test_what_must_be_read_whole_says_why(tmp_path: Path, name: str, line: str, why: str) -> None:
    lines = RAPID if name == "m.mod" else script()
    at = 7 if name == "m.mod" else 2
    path = tmp_path / name
    path.write_text("\n".join([*lines[:at], line, *lines[at:], ""]))
    found = outline(path)
    if isinstance(found, ProgramFile):  # refused by the reader, too
        require_same(path)
    else:
        assert isinstance(found, Whole)
        assert why in str(found)
