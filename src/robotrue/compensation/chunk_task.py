"""One chunk of a program file, from its bytes to the compensated bytes; the same in any process."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robotrue.calibration.archive import open_model
from robotrue.compensation.arm_state import ArmState
from robotrue.compensation.compensate import compensate_targets
from robotrue.compensation.result import Compensation, Tally
from robotrue.compensation.row_notes import row_note
from robotrue.compensation.setup import CompensationSetup
from robotrue.core.archive import archive_from
from robotrue.core.progress import Progress, unheard
from robotrue.program.program import Program, Reason
from robotrue.program.program_chunk import ChunkLines, ChunkRules
from robotrue.program.program_file import read_chunk, write_chunk
from robotrue.robot.statics import Load

_INCOMPLETE = -1
"""Place of the note on targets that leave something out: before all others."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkJob:
    """What every chunk of a file needs; sent to a worker once. Arrays and plain values.

    Attributes:
        name: File name.
        setup: What compensation takes; a worker's has no model, see :func:`with_model`.
        archive: The model file's bytes where covariances are requested of workers, else empty.
        content: Of the file; a worker's is never a program that is held whole.
    """

    name: str
    setup: CompensationSetup
    archive: bytes
    content: Program | ChunkRules


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkTask:
    """One chunk to be compensated.

    Attributes:
        number: Place of the chunk.
        lines: Where it is in the file.
        data: Its bytes.
        lead: Lines before it, to be driven through first; None where ``state`` is exact.
        lead_data: Their bytes.
        load: One row, or one per target of the chunk.
        state: Where the arm is before the lead or the chunk.
    """

    number: int
    lines: ChunkLines
    data: bytes
    lead: ChunkLines | None
    lead_data: bytes
    load: Load
    state: ArmState


@dataclass(frozen=True, slots=True, kw_only=True)
class CompensatedChunk:
    """A chunk that has been compensated.

    Attributes:
        data: Its bytes.
        start: Where the arm was taken to be before its first target.
        end: Where it is after the last.
        tally: Sums over its targets.
        held: What became of every target of a file that is held whole; None of a part of a file.
    """

    data: bytes
    start: ArmState
    end: ArmState
    tally: Tally
    held: Compensation | None


def with_model(job: ChunkJob) -> ChunkJob:
    """Returns the job with the model that its archive holds, if it holds one."""
    if not job.archive:
        return job
    return replace(job, setup=replace(job.setup, model=open_model(archive_from(job.archive))))


def compensate_chunk(
    job: ChunkJob, task: ChunkTask, progress: Progress = unheard
) -> CompensatedChunk:
    """Returns the compensated chunk: a function of the content of job and task alone."""
    state = task.state.copy()
    if task.lead is not None:
        drive_through(job, task.lead, task.lead_data, state)
    start = state.copy()
    chunk = read_chunk(task.data, task.lines, job.content)
    program, held = chunk.program, isinstance(job.content, Program)
    result = compensate_targets(job.setup, program, task.load, state, progress)
    tally = result.tally(program)
    incomplete = np.flatnonzero(program.reason == Reason.INCOMPLETE)
    if len(incomplete) and not held:
        text = "components are left out, and what the targets inherit is not known."
        note = row_note(program, incomplete, text, rank=_INCOMPLETE)
        tally = replace(tally, notes=(note, *tally.notes))
    return CompensatedChunk(
        data=write_chunk(chunk, result.replacement),
        start=start,
        end=state,
        tally=tally,
        held=result if held else None,
    )


def drive_through(
    job: ChunkJob, lines: ChunkLines, data: bytes, state: ArmState, *, alike: float = np.inf
) -> None:
    """Moves ``state`` over the targets of some lines; nothing else comes of it.

    Whether a guessed configuration matters is found by the chunk itself, under its load; ``alike``
    is for a first look.
    """
    program = read_chunk(data, lines, job.content).program
    settings = replace(job.setup.settings, alike=alike, covariance=False)
    setup = replace(job.setup, settings=settings, model=None)
    compensate_targets(setup, program, Load(), state)
