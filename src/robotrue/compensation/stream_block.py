"""One block of a long program, from its bytes to the compensated bytes; the same in any process."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from robotrue.calibration.archive import open_model
from robotrue.compensation.arm_state import ArmState
from robotrue.compensation.compensate import compensate_targets
from robotrue.compensation.result import Tally
from robotrue.compensation.row_notes import row_note
from robotrue.compensation.setup import CompensationSetup
from robotrue.compensation.steps import steps_of
from robotrue.core.archive import archive_from
from robotrue.program.program import Reason
from robotrue.program.stream import Judged, Piece, read_piece, write_piece
from robotrue.robot.statics import Load

_INCOMPLETE = -1
"""Place of the note on targets that leave something out: before all others."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamJob:
    """What every block of a long program needs; sent to a worker once. Arrays and plain values.

    Attributes:
        judged: What reading takes.
        setup: What compensation takes; a worker's has no model, see :func:`with_model`.
        archive: The model file's bytes where covariances are requested, else empty.
    """

    judged: Judged
    setup: CompensationSetup
    archive: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockTask:
    """One block to be compensated.

    Attributes:
        number: Place of the block.
        piece: Where it is in the file.
        data: Its bytes.
        lead: Lines before it, to be driven through first; None where ``state`` is exact.
        lead_data: Their bytes.
        load: One row, or one per target of the block.
        state: Where the arm is before the lead or the block.
    """

    number: int
    piece: Piece
    data: bytes
    lead: Piece | None
    lead_data: bytes
    load: Load
    state: ArmState


@dataclass(frozen=True, slots=True, kw_only=True)
class SolvedBlock:
    """A block that has been compensated.

    Attributes:
        number: Place of the block.
        data: Its bytes.
        start: Where the arm was taken to be before its first target.
        end: Where it is after the last.
        tally: Sums over its targets.
    """

    number: int
    data: bytes
    start: ArmState
    end: ArmState
    tally: Tally = field(repr=False)


def with_model(job: StreamJob) -> StreamJob:
    """Returns the job with the model that its archive holds, if it holds one."""
    model = open_model(archive_from(job.archive)) if job.archive else None
    return replace(job, setup=replace(job.setup, model=model))


def solve_block(job: StreamJob, task: BlockTask) -> SolvedBlock:
    """Returns the compensated block: a function of the content of job and task alone."""
    state = task.state.copy()
    if task.lead is not None:
        drive_through(job, task.lead, task.lead_data, state)
    start = state.copy()
    program = read_piece(task.data, task.piece, job.judged)
    result = compensate_targets(job.setup, program, task.load, state)
    notes = result.row_notes
    incomplete = np.flatnonzero(program.reason == Reason.INCOMPLETE)
    if len(incomplete):
        text = "components are left out, and what the targets inherit is not known."
        notes = (row_note(program, incomplete, text, rank=_INCOMPLETE), *notes)
    steps = steps_of([(program, result.status, result.shift)])
    return SolvedBlock(
        number=task.number,
        data=write_piece(program, result.replacement),
        start=start,
        end=state,
        tally=replace(result.tally(), notes=notes, steps=steps),
    )


def drive_through(
    job: StreamJob, piece: Piece, data: bytes, state: ArmState, *, alike: float = np.inf
) -> None:
    """Moves ``state`` over the targets of a piece; nothing else comes of it.

    Whether a guessed configuration matters is found by the block itself, under its load; ``alike``
    is for a first look.
    """
    program = read_piece(data, piece, job.judged)
    settings = replace(job.setup.settings, alike=alike, covariance=False)
    setup = replace(job.setup, settings=settings, model=None)
    compensate_targets(setup, program, Load(), state)
