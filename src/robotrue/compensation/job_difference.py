"""Two jobs file by file: what one changes of the other, and what the model expects of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell, frame_table
from robotrue.compensation.difference import Difference, difference
from robotrue.compensation.process_force import DescribedForce
from robotrue.compensation.stated_force import state_forces
from robotrue.core.arrays import Array
from robotrue.errors import ModelMismatchError
from robotrue.program.formats import read_job
from robotrue.program.program import FrameTable


def compare_jobs(
    before: Sequence[Path],
    after: Sequence[Path],
    cell: Cell | None,
    model: ErrorModel | None,
    force: Array | DescribedForce,
    home: Array,
) -> list[tuple[str, Difference]]:
    """Returns name and difference of each file of two jobs.

    Args:
        before: Programs as CAM made them.
        after: The same with other numbers.
        cell: Frames, tools and payload; None to compare numbers alone.
        model: For predicted errors; None without.
        force: (6,) N, N m on the tool for all targets, empty for none; or a description.
        home: (6,) rad, start posture; empty where none is stated.

    Raises:
        ModelMismatchError: Jobs of another number of files, or other programs.
    """
    frames = FrameTable() if cell is None else frame_table(cell)
    jobs = read_job(before, frames), read_job(after, frames)
    if len(jobs[0]) != len(jobs[1]):
        raise ModelMismatchError(
            f"{before[0].name} is a job of {len(jobs[0])} files, {after[0].name} of "
            f"{len(jobs[1])}.",
            source=after[0],
            hint="put the companions of both programs beside them.",
        )
    if cell is None:
        return [(a.name, difference(a, b)) for a, b in zip(*jobs, strict=True)]
    found = []
    for a, b, stated in zip(*jobs, state_forces(force, jobs[0]), strict=True):
        wrench = np.atleast_2d(stated.wrench) if stated.wrench.size else cell.payload.wrench
        load = replace(cell.payload, wrench=wrench)
        found.append((a.name, difference(a, b, model=model, load=load, home=home)))
    return found
