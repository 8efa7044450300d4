"""Repeated visits in a check: what accuracy and repeatability can be stated from, and no more."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.validation.iso9283 import PoseCharacteristics, pose_characteristics

CYCLES: Final = 30
"""Cycles ISO 9283 asks for at each pose; with fewer its symbols are not used."""
SAME: Final = 1e-6
"""rad; joints that differ by less were commanded alike (0.001 mm at 1 m)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RepeatedPose:
    """One pose visited several times.

    Attributes:
        rows: Rows of the check.
        joints: (dof,) rad, commanded.
        characteristics: Of the visits, against the nominal arm.
        compensated: m, distance of the mean from where the model said; NaN without predictions.
    """

    rows: IntArray
    joints: Array
    characteristics: PoseCharacteristics
    compensated: float

    @property
    def is_standard(self) -> bool:
        """Whether there are as many cycles as ISO 9283 asks for."""
        return len(self.rows) >= CYCLES


def repeated_poses(
    robot: RobotModel, measured: MeasurementSet, after: Array, *, least: int = 2
) -> tuple[RepeatedPose, ...]:
    """Returns every pose that was visited ``least`` times or more, in the order of first visits.

    Visits of one pose have the same joints, payload and wrench.

    Args:
        robot: The nominal arm with the measured tool.
        measured: Rows in base.
        after: (n, 3) m, measured minus predicted.
        least: Visits.
    """
    key = np.column_stack(
        [
            np.round(measured.joints / SAME),
            np.nan_to_num(measured.payload_mass, nan=-1.0),
            measured.wrench,
        ]
    )
    _, first, group = np.unique(key, axis=0, return_index=True, return_inverse=True)
    found = []
    for g in np.argsort(first, kind="stable"):
        rows = np.flatnonzero(group.ravel() == g)
        if len(rows) < least:
            continue
        joints = measured.joints[rows[0]]
        commanded = forward(robot.nominal(), joints[None])[0, :3, 3]
        found.append(
            RepeatedPose(
                rows=rows,
                joints=joints,
                characteristics=pose_characteristics(commanded, measured.position[rows]),
                compensated=float(np.linalg.norm(after[rows].mean(axis=0))),
            )
        )
    return tuple(found)
