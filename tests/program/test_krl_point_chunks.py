"""Arrays of points in long ``.dat`` files, read in blocks: the targets of the whole job."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.program.formats import read_job, write_program
from robotrue.program.program import FrameTable, Motion, Reason, Replacement
from robotrue.program.program_chunk import Whole
from robotrue.program.program_file import ProgramFile, outline_job, read_chunk

SRC = """&ACCESS RVP
DEF part ( )
$BASE={X 100,Y 0,Z 50,A 0,B 0,C 0}
$TOOL={X 0,Y 0,Z 200,A 0,B 0,C 0}
FOR i=1 TO 300
LIN gf[i] C_VEL
ENDFOR
$BASE={X 200,Y 0,Z 50,A 0,B 0,C 0}
PTP XHOME
FOR i=1 TO 100
PTP ga[ i ]
LIN gs[i].fCnC
ENDFOR
END
"""


def point(k: int) -> str:
    return f"X {800 + k % 97:.4f},Y {-50 + 0.25 * k:.4f},Z {500 - k % 31:.4f},A 1.0,B 80.0,C 0.0"


def dat(first: int = 300) -> list[str]:
    lines = ["&ACCESS RVP", "DEFDAT part PUBLIC", "EXT BAS(BAS_COMMAND :IN,REAL :IN)"]
    lines += [f"DECL GLOBAL FRAME gf[{first}]", "DECL LOAD l={M 5,CM {X 1,Y 2,Z 3,A 4,B 5,C 6}}"]
    lines += [f"gf[{k + 1:<5d}]={{{point(k)}}}" for k in range(first)]
    lines += ["; axes", "DECL E6POS XHOME={X 900,Y 0,Z 900,A 0,B 90,C 0,S 2,T 10}", "REAL r=1.5"]
    lines += [f"ga[{k + 1}]={{A1 {0.1 * k:.3f},A2 -80,A3 80,A4 0,A5 40,A6 0}}" for k in range(100)]
    lines += [f"gs[{k + 1}] = {{fCnC {{{point(k)}}}, feed {3000 + k}}}" for k in range(100)]
    return [*lines, "BASE_DATA[1]={X 1,Y 2,Z 3,A 4,B 5,C 6}", "ENDDAT"]


def job(folder: Path, lines: list[str], src: str | None = SRC, end: str = "\r\n") -> Path:
    (folder / "part.dat").write_bytes(end.join([*lines, ""]).encode())
    if src is None:
        return folder / "part.dat"
    (folder / "part.src").write_text(src)
    return folder / "part.src"


def outline(path: Path, targets: int = 40) -> ProgramFile | Whole:
    files = outline_job(path, FrameTable(), targets=targets)
    return files if isinstance(files, Whole) else next(f for f in files if f.held is None)


def require_same(path: Path, place: int = 1) -> ProgramFile:
    found = outline(path)
    assert isinstance(found, ProgramFile), found
    programs = read_job(path, FrameTable())
    whole = programs[place]
    assert (found.name, found.targets) == (whole.name, len(whole)) == ("part.dat", len(whole))
    parts = []
    for block in found.chunks:
        data = whole.data[block.lines.start : block.lines.end]
        parts.append(read_chunk(data, block.lines, found.content).program)
        assert len(parts[-1]) == block.targets
    for name in ("position", "rotation", "axes", "motion", "reason", "words", "line"):
        joined = np.concatenate([getattr(p, name) for p in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name), err_msg=name)
    for index, table in (("frame", "T_base_frame"), ("tool", "T_flange_tool")):
        joined = np.concatenate([getattr(p, table)[getattr(p, index)] for p in parts])
        expected = getattr(whole, table)[getattr(whole, index)]
        used = whole.motion != Motion.UNUSED
        np.testing.assert_array_equal(joined[used], expected[used])
    files = outline_job(path, FrameTable(), targets=40)
    assert [f.name for f in files] == [p.name for p in programs]
    written = [_written(p) for p in parts]
    assert b"".join(written) == _written(whole)
    return found


def _written(program) -> bytes:
    shift = np.array([0.123e-3, -0.2e-3, 0.0])
    change = Replacement(
        changed=program.reason == Reason.NONE,
        position=program.position + shift,
        rotation=program.rotation,
        axes=program.axes,
        words=np.full_like(program.words, -1),
    )
    return write_program(program, change)


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_blocks_are_the_whole(tmp_path: Path, end: str) -> None:
    found = require_same(job(tmp_path, dat(), end=end))
    assert found.targets == 501
    assert len(found.chunks) == 13
    assert len(found.content.program) == 7


def test_points_without_their_program(tmp_path: Path) -> None:
    found = require_same(job(tmp_path, dat(), src=None), place=0)
    assert (found.content.program.motion == Motion.LIN).all()


def test_what_the_program_does_with_them_is_judged(tmp_path: Path) -> None:
    src = SRC.replace("LIN gf[i] C_VEL", "LIN gf[i] C_VEL\ngf[i].X=gf[i].X+1\nPTP gf[i+1]")
    found = require_same(job(tmp_path, dat(), src=src.replace("$BASE={X 200", "$BASE=y;{X 200")))
    assert Reason.EXPRESSION in found.content.program.reason
    assert Reason.UNKNOWN_FRAME in found.content.program.reason
    assert Motion.PTP in found.content.program.motion
    unused = require_same(job(tmp_path, dat(), src=SRC.replace("LIN gf[i] C_VEL", "HALT")))
    assert unused.content.program.motion[0] == Motion.UNUSED


@pytest.mark.parametrize("window", [300, 1111])
def test_windows_do_not_show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, window: int) -> None:
    from robotrue.program.formats import file_survey

    path = job(tmp_path, dat())
    one = outline(path)
    monkeypatch.setattr(file_survey, "WINDOW", window)
    other = require_same(path)
    assert isinstance(one, ProgramFile)
    assert [b.lines.start for b in one.chunks] == [b.lines.start for b in other.chunks]
    np.testing.assert_array_equal(one.content.program.line, other.content.program.line)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda lines, src: (lines, src.replace("XHOME", "gf[7]")), "gf is named by its number"),
        (lambda lines, src: (lines[:8] + lines[6:], src), "gf is given twice"),
        (lambda lines, src: ([*lines[:9], "gf[900]={X 1,Y 2}", *lines[9:]], src), "stored or has"),
        (lambda lines, src: ([x.replace("C 0.0}", "C 0.0,E1 5}") for x in lines], src), "external"),
    ],
)
def test_what_must_be_read_whole_says_why(tmp_path: Path, change, why: str) -> None:
    lines, src = change(dat(), SRC)
    found = outline(job(tmp_path, lines, src))
    assert isinstance(found, Whole)
    assert why in str(found)
