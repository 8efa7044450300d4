"""The process force on the programs of a job: one wrench for all targets, or as described."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.compensation.process_force import DescribedForce, Use, require_one_file
from robotrue.core.arrays import Array
from robotrue.errors import ConfigurationError
from robotrue.program.cut_path import CutPath, cut_path
from robotrue.program.formats.stated_feeds import stated_feeds
from robotrue.program.program import Program
from robotrue.robot.statics import NO_LOAD


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedForce:
    """What one program of a job is pushed with.

    Attributes:
        wrench: (1, 6) or (n, 6) N, N m on the tool in base axes; empty if none was stated.
        uses: Which part of a description holds where.
    """

    wrench: Array = field(default_factory=lambda: np.empty(0))
    uses: tuple[Use, ...] = ()

    def document(self) -> list[dict[str, Any]]:
        """Returns JSON values: every part, its targets, lines and sizes."""
        return [
            {
                "name": use.name,
                "targets": use.targets,
                "lines": [use.first_line, use.last_line],
                "force_N": {"min": use.force[0], "max": use.force[1]},
            }
            for use in self.uses
        ]

    def sentences(self) -> list[str]:
        """Returns one sentence for every part."""
        return [
            f"force {use.name!r}: {use.targets} targets in lines {use.first_line} to "
            f"{use.last_line}, {_newtons(use.force)} N"
            for use in self.uses
        ]


def note_rigid_model(force: StatedForce, model: ErrorModel | None) -> list[str]:
    """Returns a note if a force was stated and the model does not bend under any."""
    if not force.wrench.any() or (model is not None and not _rigid(model)):
        return []
    return [
        "the model knows no compliance: the process force changes nothing. Calibrate with "
        "--method elastic, ripple or gp."
    ]


def _rigid(model: ErrorModel) -> bool:
    tables = model.mean_tables(NO_LOAD)
    return tables is not None and not tables.robot.error("compliance").any()


def _newtons(size: tuple[float, float]) -> str:
    low, high = (f"{value:.4g}" for value in size)
    return high if low == high else f"{low} to {high}"


def state_forces(force: Array | DescribedForce, job: Sequence[Program]) -> list[StatedForce]:
    """Returns the force on every program of a job.

    Raises:
        ConfigurationError: A description that does not fit the job.
        FormatError: A table that does not fit its program.
    """
    if not isinstance(force, DescribedForce):
        return [StatedForce(wrench=force) for _ in job]
    carrying = [program.name for program in job if program.held.any()]
    if carrying:
        raise ConfigurationError(
            "the robot carries the part to the tool: a force along the path is not known there.",
            source=carrying[0],
            hint="--wrench, what the tool does to the part, in base axes.",
        )
    paths: list[CutPath] = [
        cut_path(program, cutter=force.cutter, feed=stated_feeds(program)) for program in job
    ]
    require_one_file(force, paths)
    found = [force.apply(path) for path in paths]
    if not any(uses for _, uses in found):
        raise ConfigurationError(
            "the force holds nowhere: no straight move, arc or spline to a known target.",
            hint="joint moves and rapids carry no force.",
        )
    return [StatedForce(wrench=wrench, uses=uses) for wrench, uses in found]
