"""Generated VAL3 applications: in blocks they are the whole, byte for byte."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "fuzz"))

from val3_programs import val3_arrays
from written import Pen

from robotrue.compensation.status import Status
from robotrue.compensation.steps import job_steps, join_steps, steps_of
from robotrue.errors import FormatError
from robotrue.program.formats import file_survey, read_job, write_program
from robotrue.program.program import FrameTable, Motion, Program, Reason, Replacement
from robotrue.program.program_chunk import Whole
from robotrue.program.program_file import ProgramFile, outline_job, read_chunk, write_chunk

SEEDS = 20


def shift(program: Program) -> Replacement:
    """Every compensable target moved by what depends on its numbers alone."""
    with np.errstate(invalid="ignore"):
        move = np.sin(1e3 * program.position) * 2e-4
    return Replacement(
        changed=program.reason == Reason.NONE,
        position=program.position + move,
        rotation=program.rotation,
        axes=program.axes,
        words=np.full_like(program.words, -1),
    )


def require_same(whole: Program, found: ProgramFile) -> list[Program]:
    """The chunks of a file are the program that is read whole, and are written as it is."""
    assert found.held is None
    assert (found.name, found.targets, found.size) == (whole.name, len(whole), len(whole.data))
    chunks = [
        read_chunk(whole.data[c.lines.start : c.lines.end], c.lines, found.content)
        for c in found.chunks
    ]
    parts = [chunk.program for chunk in chunks]
    assert [len(p) for p in parts] == [c.targets for c in found.chunks]
    for name in ("position", "rotation", "axes", "motion", "reason", "words", "line"):
        joined = np.concatenate([getattr(p, name) for p in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name), err_msg=name)
    for index, table in (("frame", "T_base_frame"), ("tool", "T_flange_tool")):
        joined = np.concatenate([getattr(p, table)[getattr(p, index)] for p in parts])
        expected = getattr(whole, table)[getattr(whole, index)]
        np.testing.assert_array_equal(joined, expected)
    assert {note.split(": ")[-1] for note in found.notes} == {
        note.split(": ")[-1] for note in whole.notes
    }
    written = b"".join(write_chunk(chunk, shift(chunk.program)) for chunk in chunks)
    assert written == write_program(whole, shift(whole))
    return parts


def require_same_steps(whole: Sequence[Program], parts: Sequence[Program]) -> None:
    """The moves between chunks are those of the whole, where one end is left alone, too."""
    expected = job_steps([with_status(program) for program in whole])
    found = join_steps([steps_of([with_status(part)]) for part in parts])
    assert (found.count, found.largest) == (expected.count, expected.largest)
    np.testing.assert_allclose(
        [found.length, found.corrected], [expected.length, expected.corrected], rtol=1e-12
    )


def with_status(program: Program) -> tuple[Program, np.ndarray, np.ndarray]:
    """A program with every target compensated that can be."""
    done = program.reason == Reason.NONE
    status = np.where(done, int(Status.COMPENSATED), int(Status.UNCHANGED_SOURCE))
    return program, status, np.where(done[:, None], 1e-2 * program.position, 0.0)


def compare(folder: Path, seed: int, targets: int) -> str:
    """Compares one application in blocks with the whole; what became of it."""
    job = val3_arrays(Pen.of([seed]))
    for name, data in job.files:
        (folder / name).write_bytes(data)
    path = folder / job.files[0][0]
    if len(job.files) > 1 and seed % 2:
        path = write_project(folder, [name for name, _ in job.files])
    found = outline_job(path, FrameTable(), targets=targets)
    if isinstance(found, Whole):
        return found.why
    whole = read_job(path, FrameTable())
    assert [each.name for each in found] == [each.name for each in whole]
    parts = [require_same(program, file) for program, file in zip(whole, found, strict=True)]
    require_same_steps(whole, [part for file in parts for part in file])
    return f"{min(max(len(file.chunks) for file in found), 3)} blocks"


def write_project(folder: Path, names: Sequence[str]) -> Path:
    """A project of some files, and of one more program, which moves to no point."""
    space = "http://www.staubli.com/robotics/VAL3/"
    code = "<Program name='b'><Code><![CDATA[begin\ncall a()\nend]]></Code></Program></Programs>"
    (folder / "start.pgx").write_text(f"<Programs xmlns='{space}Program/2'>\n{code}\n")
    rows = [f'<File file="{name}" />' for name in (*names, "start.pgx")]
    lines = [f"<Project xmlns='{space}Project/3'>", *rows, "</Project>", ""]
    (folder / "cell.pjx").write_text("\n".join(lines))
    return folder / "cell.pjx"


@pytest.mark.parametrize("window", [60, 400, 1 << 20])
def test_blocks_are_the_whole(tmp_path: Path, window: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(file_survey, "WINDOW", window)
    done = []
    for seed in range(SEEDS):
        folder = tmp_path / str(seed)
        folder.mkdir()
        done += [compare(folder, seed, targets) for targets in (1, 4)]
    assert sum(each == "3 blocks" for each in done) > SEEDS


def application(folder: Path, data: list[str], code: list[str]) -> Path:
    """The two files of an application whose array p has 40 elements."""
    rows = [
        f'<Value key="{k}" x="{k}.5" y="1" z="2" rx="0" ry="0" rz="0" fatherId="world[0]"/>'
        for k in range(40)
    ]
    space = "http://www.staubli.com/robotics/VAL3/"
    lines = [f"<Database xmlns='{space}Data/2'>", "<Data name='t' type='tool'>"]
    lines += ["<Value key='0' fatherId='flange[0]'/>", "</Data>", "<Data name='p' type='pointRx'>"]
    text = "\n".join([*lines, *rows, *data, "</Data>", "</Database>", ""])
    (folder / "job.dtx").write_text(text)
    moves = [f"movel(p[{k}],t,mNom)" for k in range(40)]
    head, foot = "<Program name='a'><Code><![CDATA[begin", "end]]></Code></Program></Programs>"
    text = "\n".join([f"<Programs xmlns='{space}Program/2'>", head, *moves, *code, foot, ""])
    (folder / "job.pgx").write_text(text)
    return folder / "job.pgx"


@pytest.mark.parametrize(
    ("data", "code", "why"),
    [
        ([], ["movel(p[3],t,mNom)"], "in their order"),
        ([], ["movel(appro(p[3],{0,0,9,0,0,0}),t,mNom)"], "in their order"),
        (["<!-- two", "lines -->"], [], "line 46: a comment that is not one line"),
        (["<Value key='77' x='1' fatherId='world[0]'/>"], [], "has its own clauses"),
    ],
)
def test_applications_that_are_held_whole(
    tmp_path: Path, data: list[str], code: list[str], why: str
) -> None:
    refused = outline_job(application(tmp_path, data, code), FrameTable(), targets=8)
    assert isinstance(refused, Whole)
    assert why in str(refused)


def test_an_element_given_twice_is_refused_as_in_the_whole(tmp_path: Path) -> None:
    same = '<Value key="7" x="0" y="1" z="2" rx="0" ry="0" rz="0" fatherId="world[0]"/>'
    path = application(tmp_path, [same], [])
    refused = outline_job(path, FrameTable(), targets=8)
    assert isinstance(refused, Whole)
    with pytest.raises(FormatError, match="occurs twice"):
        read_job(path, FrameTable())


def test_elements_that_other_statements_name_are_judged_apart(tmp_path: Path) -> None:
    path = application(tmp_path, [], [])
    text = path.read_text().replace("movel(p[9],t,mNom)", "movej(p[9], t, mNom) // x")
    path.write_text(text.replace("movel(p[20],t", "movel(p[20],lost"))
    found = outline_job(path, FrameTable(), targets=8)
    assert not isinstance(found, Whole)
    whole = read_job(path, FrameTable())
    parts = [require_same(program, file) for program, file in zip(whole, found, strict=True)]
    assert len(parts[1]) == 5
    assert found[1].content.program.motion.tolist().count(Motion.PTP) == 1
    assert np.flatnonzero(whole[1].reason == Reason.UNKNOWN_FRAME).tolist() == [20]


@pytest.mark.parametrize(("statement", "left"), [("t.trsf={0,0,9,0,0,0}", 40), ("x=1", 0)])
def test_a_tool_that_another_program_changes(tmp_path: Path, statement: str, left: int) -> None:
    path = application(tmp_path, [], [])
    code = f"<Program name='b'><Code><![CDATA[begin\n{statement}\nend]]></Code></Program>"
    path.write_text(path.read_text().replace("</Programs>", f"\n{code}\n</Programs>"))
    found, whole = outline_job(path, FrameTable(), targets=8), read_job(path, FrameTable())
    assert not isinstance(found, Whole), found
    parts = [require_same(program, file) for program, file in zip(whole, found, strict=True)]
    reasons = np.concatenate([part.reason for file in parts for part in file])
    assert (reasons == Reason.UNKNOWN_FRAME).sum() == left


def test_a_file_of_computed_motions_alone_has_steps(tmp_path: Path) -> None:
    code, points = read_job(application(tmp_path, [], ["movel(p[nI],t,mNom)"]), FrameTable())
    assert (len(code), code.path[:, 1].tolist()) == (0, [-43])
    found = job_steps([with_status(code), with_status(points)])
    assert (found.count, found.first[0].before, found.first[0].after) == (
        1,
        "job.dtx:45",
        "job.pgx:43",
    )
