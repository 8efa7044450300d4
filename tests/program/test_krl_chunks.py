"""Long KRL programs read in blocks: the targets of the whole file, or a refusal that says why."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.program.formats import read_job
from robotrue.program.program import FrameTable, Reason
from robotrue.program.program_chunk import Whole
from robotrue.program.program_file import CHUNK, ProgramFile, outline_job, read_chunk

AXES = "{A1 0,A2 0,A3 0,A4 0,A5 0,A6 0}"
HEAD = ("&ACCESS RVP", "DEF part ( )", ";FOLD INI", "BAS (#INITMOV,0)", ";ENDFOLD")


def pose(k: int) -> str:
    return (
        f"{{X {800 + k % 97:.3f},Y {-50 + 0.25 * k:.3f},Z {500 - k % 31:.3f},"
        f"A {k % 11:.3f},B {80 + 0.1 * (k % 7):.3f},C 0.000}}"
    )


def lines(count: int, start: int = 0) -> list[str]:
    """Motions with speeds, comments and folds between them, as a CAM system writes them."""
    out = []
    for k in range(start, start + count):
        if k % 10 == 3:
            out.append(f"$VEL.CP={0.01 + k * 1e-4:.4f} ; m/s")
        if k % 17 == 5:
            out += ["", f";FOLD LIN P{k} {pose(k)}"]
        if k % 23 == 7:
            out.append(f"CIRC {pose(k)},{pose(k + 1)}{', CA 90 C_DIS' if k % 2 else ''}")
        elif k % 31 == 8:
            out.append(f"SLIN {pose(k)} C_SPL WITH $VEL.CP=0.2, $ORI_TYPE=#VAR ; fast")
        elif k % 29 == 9:
            out.append(f"PTP {pose(k)[:-1]},S 2,T 35}} C_PTP")
        else:
            out.append(f"{'LIN' if k % 3 else 'lin'} {pose(k)} C_DIS")
    return out


def file(folder: Path, body: list[str], end: str = "\r\n") -> Path:
    path = folder / "part.src"
    path.write_bytes(end.join([*HEAD, *body, "END", ""]).encode("latin-1"))
    return path


def outline(path: Path, frames: FrameTable, targets: int = CHUNK) -> ProgramFile | Whole:
    files = outline_job(path, frames, targets=targets)
    return files if isinstance(files, Whole) else next(f for f in files if f.held is None)


def pieces(found: ProgramFile, path: Path) -> list:
    data = path.read_bytes()
    return [
        read_chunk(data[c.lines.start : c.lines.end], c.lines, found.content).program
        for c in found.chunks
    ]


def require_same(path: Path, frames: FrameTable | None = None, targets: int = 40) -> ProgramFile:
    frames = frames or FrameTable()
    found = outline(path, frames, targets=targets)
    assert isinstance(found, ProgramFile), found
    (whole, *_) = read_job(path, frames)
    parts = pieces(found, path)
    assert found.chunks[0].lines.start == 0
    assert found.chunks[-1].lines.end == found.size == len(whole.data)
    assert b"".join(p.data for p in parts) == whole.data
    assert [b.first for b in found.chunks] == np.cumsum([0, *map(len, parts)])[:-1].tolist()
    for name in ("position", "rotation", "axes", "motion", "reason", "words", "line"):
        joined = np.concatenate([getattr(p, name) for p in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name), err_msg=name)
    for index, table in (("frame", "T_base_frame"), ("tool", "T_flange_tool")):
        joined = np.concatenate([getattr(p, table)[getattr(p, index)] for p in parts])
        np.testing.assert_array_equal(joined, getattr(whole, table)[getattr(whole, index)])
    return found


def test_blocks_are_the_whole_file(tmp_path: Path) -> None:
    path = file(tmp_path, ["$BASE={X 100,Y 0,Z 50,A 0,B 0,C 0}", *lines(500)])
    found = require_same(path)
    assert len(found.chunks) == found.targets // 40 + 1
    assert all(b.targets >= 40 for b in found.chunks[:-1])
    assert len(found.content.program) == 1
    again = outline(path, FrameTable(), targets=10**6)
    assert len(again.chunks) == 1


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_frames_and_ways_are_judged_as_in_the_whole(tmp_path: Path, end: str) -> None:
    body = [
        "PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}",
        "$TOOL={X 0,Y 0,Z 215.5,A 0,B 30,C 0}",
        *lines(60),
        "$BASE={X 900,Y -100,Z 450,A 15,B 0,C 0}",
        *lines(33, 60),
        "IF $IN[1] THEN",
        "$BASE=BASE_DATA[2]",
        *lines(20, 100),
        "ELSE",
        *lines(20, 120),
        "ENDIF",
        *lines(50, 140),
        "$BASE={X 1,Y 2,Z 3,A 4,B 5,C 6}",
        "FOR i=1 TO 3",
        *lines(70, 200),
        "$TOOL={X 0,Y 0,Z 100,A 0,B 0,C 0}",
        "ENDFOR",
        "SPINDLE_ON(18000)",
        f"LIN {pose(1)}",
        "$BASE=$NULLFRAME",
        "$TOOL={X 0,Y 0,Z 90,A 0,B 0,C 0}",
        *lines(45, 300),
    ]
    path = file(tmp_path, body, end)
    found = require_same(path)
    (whole, *_) = read_job(path, FrameTable())
    assert set(whole.reason.tolist()) >= {Reason.NONE, Reason.JOINT_TARGET, Reason.UNKNOWN_FRAME}
    assert [n for n in found.notes if "BASE_DATA" in n or "number 2" in n]
    firsts = [note.split(": ")[0] for note in whole.notes]
    assert [note.split(": ")[0] for note in found.notes] == firsts


def test_left_out_components_stay_within_a_block(tmp_path: Path) -> None:
    body = []
    for k in range(400):
        body.append(f"LIN {pose(k)}" if k % 9 == 0 else f"LIN {{X {800 + k:.3f},Y {k:.2f}}} C_DIS")
    path = file(tmp_path, body)
    require_same(path)


def test_points_of_the_dat_are_read_beside(tmp_path: Path) -> None:
    path = file(tmp_path, ["PTP XHOME", *lines(90), "PTP XHOME", *lines(90, 90)])
    dat = "DEFDAT part\r\nDECL E6POS XHOME={X 900,Y 0,Z 800,A 0,B 90,C 0,S 2,T 2}\r\nENDDAT\r\n"
    (tmp_path / "part.dat").write_text(dat)
    require_same(path)
    _, beside = outline_job(path, FrameTable())
    assert beside.name == "part.dat"
    (_, point) = read_job(path, FrameTable())
    np.testing.assert_array_equal(beside.held.position, point.position)
    np.testing.assert_array_equal(beside.held.motion, point.motion)


@pytest.mark.parametrize(
    ("body", "why", "line"),
    [
        ([*lines(50), "LIN {X 1}", "$BASE=$WORLD", "LIN {X 2}"], "leaves components out", -1),
        ([*lines(50), f"LIN {pose(3)} WITH $BASE=$WORLD"], "stored or has its own clauses", -1),
        ([*lines(50), f"p={{POS: {pose(3)[1:]}", "PTP p"], "stored or has its own clauses", -2),
        ([*lines(50), f"CIRC {AXES},{pose(1)}"], "an arc through axis", -1),
        ([*lines(50), f"LIN {pose(1)[:-1]},E1 5.0}}"], "external axes are away from zero", 0),
        (["WAIT SEC 1"], "no targets", 0),
        ([f"LIN {pose(1)}", *["LIN {X 1}"] * 400], "without a complete one", 1),
    ],
)  # fmt: skip
def test_what_must_be_read_whole_says_why(
    tmp_path: Path, body: list[str], why: str, line: int
) -> None:
    path = file(tmp_path, body)
    found = outline(path, FrameTable(), targets=40)
    assert isinstance(found, Whole)
    assert why in str(found)
    assert found.line == (len(HEAD) + len(body) + line + 1 if line < 0 else line)
    read_job(path, FrameTable())


def test_computed_targets_and_axes_at_rest(tmp_path: Path) -> None:
    body = []
    for k in range(200):
        body.append(f"LIN {pose(k)[:-1]},E1 0.0,E2 850.0}}")
        if k % 50 == 9:
            body.append("LIN {X xx+1,Y 0,Z 0,A 0,B 0,C 0,E1 0.0,E2 850.0}")
    path = file(tmp_path, body)
    require_same(path, FrameTable(external_axes_at_rest=True))
    assert isinstance(outline(path, FrameTable()), Whole)


def test_a_damaged_line_is_named_as_in_the_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from robotrue.errors import FormatError
    from robotrue.program.formats import file_survey

    monkeypatch.setattr(file_survey, "WINDOW", 4096)
    path = file(tmp_path, [*lines(300), "LIN {X 1.2.3,Y 0,Z 0,A 0,B 0,C 0}", *lines(20)])
    with pytest.raises(FormatError) as whole:
        read_job(path, FrameTable())
    with pytest.raises(FormatError) as streamed:
        outline(path, FrameTable())
    assert str(streamed.value) == str(whole.value)


@pytest.mark.parametrize("window", [257, 1000, 4096])
def test_windows_do_not_show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, window: int) -> None:
    from robotrue.program.formats import file_survey

    path = file(
        tmp_path,
        [*lines(150), "$BASE={X 9,Y 0,Z 0,A 0,B 0,C 0}", *lines(90, 150), "HALT", *lines(60, 9)],
    )
    one = outline(path, FrameTable(), targets=40)
    monkeypatch.setattr(file_survey, "WINDOW", window)
    other = require_same(path)
    assert isinstance(one, ProgramFile)
    assert [b.lines.start for b in one.chunks] == [b.lines.start for b in other.chunks]
    assert one.sha256 == other.sha256
