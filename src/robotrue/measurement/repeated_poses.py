"""Shots of one pose that was measured again: their mean, and the repeatability they show."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.units import DEG, UM
from robotrue.measurement.measurement_set import MeasurementSet

SAME_POSE: Final = 1e-3 * DEG
"""rad; joints nearer to one another than this were commanded alike."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RepeatedPoses:
    """Poses, each with the mean of its shots.

    Attributes:
        mean: One row per pose, its covariance that of the mean; lines of the first shot.
        shots: (k,) of each pose.
        deviation: (n, 3) m, every shot minus the mean of its pose, rows of the set as it came.
        scatter: m, one sd per axis of one shot, pooled over poses; NaN without repeated shots.
        repeatability: m, the part of it that the instrument does not explain.
        freedom: Shots beyond the first of each pose.
    """

    mean: MeasurementSet
    shots: IntArray
    deviation: Array
    scatter: float
    repeatability: float
    freedom: int


def average_repeats(measurements: MeasurementSet) -> RepeatedPoses:
    """Returns the mean shot of each pose, and the scatter of shots of one pose.

    Shots belong to one pose if joints, reflector, set-up, load and set are the same. The model
    contains the repeatability of the robot: where the robot returned for every shot, the covariance
    of a mean is conservative.

    Args:
        measurements: In any order.
    """
    pose = _number_poses(measurements)
    first = np.unique(pose, return_index=True)[1]
    shots = np.bincount(pose)
    weight = 1.0 / shots[pose]
    position = np.zeros((len(first), 3))
    covariance = np.zeros((len(first), 3, 3))
    np.add.at(position, pose, weight[:, None] * measurements.position)
    np.add.at(covariance, pose, weight[:, None, None] ** 2 * measurements.covariance)
    deviation = measurements.position - position[pose]
    freedom = int((shots - 1).sum())
    scatter = repeatability = float("nan")
    if freedom:
        variance = float((deviation**2).sum()) / (3.0 * freedom)
        again = shots[pose] > 1
        diagonal = np.diagonal(measurements.covariance[again], axis1=1, axis2=2)
        scatter = float(np.sqrt(variance))
        repeatability = float(np.sqrt(max(variance - float(diagonal.mean()), 0.0)))
    rows = measurements.subset(first)
    return RepeatedPoses(
        mean=replace(
            rows,
            position=position,
            covariance=covariance,
            rotation=_mean_rotation(measurements, pose, rows),
        ),
        shots=shots,
        deviation=deviation,
        scatter=scatter,
        repeatability=repeatability,
        freedom=freedom,
    )


def _number_poses(measurements: MeasurementSet) -> IntArray:
    """Number (n,) of the pose of each row, in the order of their first shots."""
    key = np.column_stack(
        [
            np.round(measurements.joints / SAME_POSE),
            measurements.target,
            measurements.station,
            measurements.group,
            measurements.wrench,
            np.nan_to_num(measurements.payload_mass, nan=-1.0),
            measurements.has_rotation,
        ]
    )
    _, first, number = np.unique(key, axis=0, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    poses: IntArray = rank[number.ravel()]
    return poses


def _mean_rotation(measurements: MeasurementSet, pose: IntArray, rows: MeasurementSet) -> Array:
    """Chordal mean (k, 3, 3) of the orientations of each pose; NaN where there are none."""
    total = np.zeros((len(rows), 3, 3))
    known = measurements.has_rotation
    np.add.at(total, pose[known], measurements.rotation[known])
    rotation = rows.rotation.copy()
    posed = rows.has_rotation
    left, _, right = np.linalg.svd(total[posed])
    left[:, :, 2] *= np.linalg.det(left @ right)[:, None]
    rotation[posed] = left @ right
    return rotation


def describe_repeats(poses: RepeatedPoses) -> tuple[str, ...]:
    """Returns what repeated shots show, as one sentence; nothing without any."""
    if not poses.freedom:
        return ()
    again = poses.shots[poses.shots > 1]
    many = "pose was" if len(again) == 1 else "poses were"
    times = f"{again.min()}" if again.min() == again.max() else f"{again.min()} to {again.max()}"
    return (
        f"{len(again)} {many} shot {times} times: one shot scatters by {poses.scatter / UM:.1f} um "
        f"per axis ({poses.freedom} repeat{'s' * (poses.freedom > 1)}), "
        f"{poses.repeatability / UM:.1f} um of it beyond the instrument",
    )
