"""One block of a long program, from its bytes to the compensated bytes; the same in any process."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from robotrue.calibration.archive import open_model
from robotrue.calibration.model import ErrorModel
from robotrue.compensation.chunks import Standing
from robotrue.compensation.compensate import compensate_part, replaced
from robotrue.compensation.pack import Pack
from robotrue.compensation.row_notes import row_note
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.tally import Tally, tally
from robotrue.core.archive import archive_from
from robotrue.core.arrays import Array, BoolArray
from robotrue.program.program import Reason
from robotrue.program.stream import Judged, Piece, read_piece, write_piece
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load

_INCOMPLETE = -1
"""Place of the note on targets that leave something out: before all others."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """What every block needs; sent to a worker once. Arrays and plain values only.

    Attributes:
        judged: What reading takes.
        robot: The nominal arm.
        pack: The mean of the model, for the tools of the program.
        measured: (t,) which of them is the measured tool.
        settings: Guards and tolerances; its loads are not used.
        archive: The model file's bytes where covariances are asked for, else empty.
    """

    judged: Judged
    robot: RobotModel
    pack: Pack
    measured: BoolArray
    settings: CompensationSettings
    archive: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One block.

    Attributes:
        number: Place of the block.
        piece: Where it stands.
        data: Its bytes.
        lead: Lines before it, to be driven through first; None where ``standing`` is exact.
        lead_data: Their bytes.
        mass: kg, of one row or one per target.
        com: (1 or n, 3) m.
        wrench: (1 or n, 6) N, N m.
        standing: Where the arm is before the lead or the block.
    """

    number: int
    piece: Piece
    data: bytes
    lead: Piece | None
    lead_data: bytes
    mass: Array
    com: Array
    wrench: Array
    standing: Standing


@dataclass(frozen=True, slots=True, kw_only=True)
class Done:
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
    start: Standing
    end: Standing
    tally: Tally = field(repr=False)


def model_of(work: Work) -> ErrorModel | None:
    """Returns the model to ask for covariances, rebuilt from its file's bytes."""
    return open_model(archive_from(work.archive)) if work.archive else None


def solve_block(work: Work, model: ErrorModel | None, task: Task) -> Done:
    """Returns the compensated block: a function of the task's content alone."""
    standing = task.standing.copy()
    if task.lead is not None:
        drive_through(work, task.lead, task.lead_data, standing)
    start = standing.copy()
    program = read_piece(task.data, task.piece, work.judged)
    load = Load(mass=task.mass, com=task.com, wrench=task.wrench)
    plan, outcome, stance = compensate_part(
        model, work.robot, work.pack, work.measured, program, work.settings, load, standing
    )
    replacement, notes = replaced(work.robot, program, plan, work.settings, outcome)
    lacking = np.flatnonzero(program.reason == Reason.INCOMPLETE)
    if len(lacking):
        text = "components are left out, and what the targets inherit is not known."
        notes = (row_note(program, lacking, text, rank=_INCOMPLETE), *notes)
    return Done(
        number=task.number,
        data=write_piece(program, replacement),
        start=start,
        end=standing,
        tally=tally(program, outcome, notes, stance),
    )


def drive_through(
    work: Work, piece: Piece, data: bytes, standing: Standing, *, alike: float = np.inf
) -> None:
    """Moves ``standing`` over the targets of a piece; nothing else comes of it.

    Whether a guessed configuration matters is told by the block itself, under its load; ``alike``
    is for a first look.
    """
    program = read_piece(data, piece, work.judged)
    settings = CompensationSettings(
        axis_targets=work.settings.axis_targets,
        approach=work.settings.approach,
        max_joint_step=work.settings.max_joint_step,
        home=work.settings.home,
        alike=alike,
    )
    compensate_part(None, work.robot, work.pack, work.measured, program, settings, Load(), standing)
