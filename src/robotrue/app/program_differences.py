"""Two jobs of the robot compared target by target, each program under the force on it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell
from robotrue.cell.frame_table import frame_table
from robotrue.compensation.difference import Difference, difference
from robotrue.compensation.process_force import DescribedForce
from robotrue.compensation.stated_force import StatedForce, state_forces
from robotrue.core.arrays import Array
from robotrue.errors import ModelMismatchError
from robotrue.program.formats import read_job
from robotrue.program.program import FrameTable
from robotrue.robot.statics import Load


def differences(
    first: Path,
    second: Path,
    cell: Cell | None,
    model: ErrorModel | None,
    force: Array | DescribedForce,
    home: Array,
) -> list[tuple[str, Difference]]:
    """Returns name and difference of each file of two jobs.

    Args:
        first: Program as CAM made it.
        second: The same with other numbers.
        cell: Frames, tools and payload; None to compare numbers alone.
        model: For predicted errors; None without.
        force: From :func:`robotrue.app.force_options.read_force_options`.
        home: (6,) rad, start posture; empty where none is stated.

    Raises:
        ModelMismatchError: Jobs of another number of files, or other programs.
    """
    frames = FrameTable() if cell is None else frame_table(cell)
    jobs = read_job(first, frames), read_job(second, frames)
    if len(jobs[0]) != len(jobs[1]):
        raise ModelMismatchError(
            f"{first.name} is a job of {len(jobs[0])} files, {second.name} of {len(jobs[1])}.",
            source=second,
            hint="put the companions of both programs beside them.",
        )
    if cell is None:
        return [(a.name, difference(a, b)) for a, b in zip(*jobs, strict=True)]
    forces = state_forces(force, jobs[0])
    return [
        (a.name, difference(a, b, model=model, load=_load(cell.payload, pushed), home=home))
        for a, b, pushed in zip(*jobs, forces, strict=True)
    ]


def _load(payload: Load, force: StatedForce) -> Load:
    wrench = np.atleast_2d(force.wrench) if force.wrench.size else payload.wrench
    return replace(payload, wrench=wrench)
