"""Programs of words of any lines: in blocks they are the whole, byte for byte."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "fuzz"))

from languages import LANGUAGES
from path_programs import PATHS
from written import Pen

from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.errors import ConfigurationError
from robotrue.program.formats import (
    file_survey,
    read_job,
    splice_chunks,
    write_program,
)
from robotrue.program.line_note import join_notes
from robotrue.program.program import Program, Reason, Replacement
from robotrue.program.program_chunk import Whole
from robotrue.program.program_file import ProgramFile, outline_job, read_chunk, write_chunk

SEEDS = 20
NAMES = ("sinumerik", "fanuc_gcode", "heidenhain", "apt", "toolpath_csv")


def complete_point(pen: Pen, name: str, text: str) -> str:
    """A point that leaves nothing out, or of the orientation all."""
    x, y, z = pen.place(), pen.place(), pen.place()
    a, b, c = pen.angle(), pen.angle(), pen.angle()
    v = pen.rng.normal(size=3) * [0.3, 0.3, 0.0] + [0.0, 0.0, 1.0]
    i, j, k = (f"{value:.6f}" for value in v / np.linalg.norm(v))
    plus = [each if each[0] in "+-" else "+" + each for each in (x, y, z, a, b, c, i, j, k)]
    if name == "apt":
        return f"GOTO/{x},{y},{z}" + pen.pick(f",{i},{j},{k}", f",{i},{j},{k}", "")
    if name == "heidenhain":
        p = "X{} Y{} Z{} ".format(*plus[:3])
        angles, axis = "A{} B{} C{}".format(*plus[3:6]), "TX{} TY{} TZ{}".format(*plus[6:])
        return pen.pick("9 L " + p + angles, "9 LN " + p + axis, "9 L " + p)
    p, go = f"X{x} Y{y} Z{z}", pen.pick("G1 ", "G0 ", "", "")
    if name == "sinumerik":
        return go + p + pen.pick(f" A={a} B={b} C={c}", f" A3={i} B3={j} C3={k}", "")
    word = f" I{i} J{j} K{k}" if "G43.5" in text else f" A{a} B{b} C{c}"
    return go + p + pen.pick(word, word, "")


def lengthen(pen: Pen, name: str, data: bytes) -> bytes:
    """A program with runs of complete points between its lines."""
    if name == "toolpath_csv":
        return data
    end, text = b"\r\n" if b"\r\n" in data else b"\n", data.decode("latin-1")
    lines = data.split(end)
    for at in sorted(pen.rng.integers(5, max(len(lines) - 3, 6), pen.whole(1, 6)).tolist())[::-1]:
        if not lines[at - 1].rstrip().endswith(b"$"):
            run = [complete_point(pen, name, text) for _ in range(pen.whole(1, 6))]
            lines[at:at] = [line.encode() for line in run]
    return end.join(lines)


def shift(program: Program) -> Replacement:
    """Every compensable target moved by what depends on its numbers alone."""
    with np.errstate(invalid="ignore"):
        move = np.sin(1e3 * program.position) * 2e-4
    return Replacement(
        changed=program.reason == Reason.NONE,
        position=program.position + move,
        rotation=program.rotation @ matrix_from_rotation_vector(5.0 * np.nan_to_num(move)),
        axes=program.axes,
        words=np.full_like(program.words, -1),
    )


def require_same(path: Path, whole: Program, found: ProgramFile) -> None:
    """The chunks are the program that is read whole, and are written as it is."""
    skeleton = found.content.program
    chunks = [
        read_chunk(whole.data[c.lines.start : c.lines.end], c.lines, found.content)
        for c in found.chunks
    ]
    parts = [chunk.program for chunk in chunks]
    assert [len(p) for p in parts] == [c.targets for c in found.chunks]
    assert found.targets == len(whole)
    for name in ("position", "rotation", "axes", "motion", "reason", "words", "line"):
        joined = np.concatenate([getattr(p, name) for p in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name), err_msg=name)
    for index, table in (("frame", "T_base_frame"), ("tool", "T_flange_tool")):
        expected = getattr(whole, table)[getattr(whole, index)]
        for given in ([getattr(p, table) for p in parts], [getattr(skeleton, table)] * len(parts)):
            pairs = zip(given, parts, strict=True)
            joined = np.concatenate([T[getattr(p, index)] for T, p in pairs])
            np.testing.assert_array_equal(joined, expected)
    noted = join_notes(each for p in parts for each in p.noted)
    assert {*found.notes, *(each.sentence(found.name) for each in noted)} == set(whole.notes)
    moves = [p.path if len(p.path) else _rows_of(p) for p in parts]
    shifts = [np.array([c.first, c.first, 0]) for c in found.chunks]
    moves = [move + by for move, by in zip(moves, shifts, strict=True)]
    expected = whole.path if len(whole.path) else _rows_of(whole)
    np.testing.assert_array_equal(np.concatenate(moves), expected)
    try:
        expected = write_program(whole, shift(whole))
    except ConfigurationError:  # an arc that is none any more
        return
    assert b"".join(write_chunk(chunk, shift(chunk.program)) for chunk in chunks) == expected


def _rows_of(program: Program) -> np.ndarray:
    row = np.arange(len(program))
    return np.stack([row, row, program.motion], axis=1)


def compare(path: Path, name: str, seed: int, targets: int) -> str:
    """Compares one program in blocks with the whole; what became of it."""
    pen = Pen.of([seed, len(name)])
    job = LANGUAGES[name].writer(pen)
    path.write_bytes(lengthen(pen, name, job.files[0][1]))
    (whole,) = read_job(path, PATHS)
    found = outline_job(path, PATHS, targets=targets)
    if isinstance(found, Whole):
        return found.why
    require_same(path, whole, found[0])
    return f"{min(len(found[0].chunks), 5)} blocks"


@pytest.mark.parametrize("name", NAMES)
def test_blocks_are_the_whole(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(splice_chunks, "_FIRST", 2)
    path = tmp_path / LANGUAGES[name].name
    monkeypatch.setattr(file_survey, "LONGEST_CHUNK", 1000)
    monkeypatch.setattr(splice_chunks, "LONGEST_CHUNK", 1000)
    done = []
    for seed in range(SEEDS):
        monkeypatch.setattr(file_survey, "WINDOW", (60, 200, 1 << 20)[seed % 3])
        done += [compare(path, name, seed, targets) for targets in (1, 4)]
    assert sum(each in ("3 blocks", "4 blocks", "5 blocks") for each in done) > SEEDS // 2


def test_a_number_beyond_all_coordinates_is_read_as_in_the_whole(tmp_path: Path) -> None:
    rows = [f"GOTO/{k}.5,1.0,2.0,0.0,{0.6 if k % 2 else -0.6},0.8" for k in range(300)]
    rows[150] = "GOTO/" + 300 * "9" + ",1.0,2.0,0.6,0.0,0.8"
    path = tmp_path / "part.apt"
    path.write_text("\n".join(["UNITS/MM", *rows, "FINI", ""]))
    (whole,) = read_job(path, PATHS)
    (found,) = outline_job(path, PATHS, targets=40)
    assert len(found.chunks) > 5
    require_same(path, whole, found)
