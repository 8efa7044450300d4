"""Touches of a simulated block for the tests of the estimate from touches."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.probing import (
    ProbingSettings,
)
from robotrue.core.arrays import Array
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.surfaces import Plane
from robotrue.core.units import MM
from robotrue.measurement.probing_set import ProbingSet
from robotrue_reproductions.feng2018.machining_cell import (
    FACES,
    CellSizes,
    FengCell,
    Posture,
    feng_cell,
    touch,
    touch_points,
)

EXACT = CellSizes(arm=0.0, tip=0.0, touch=0.0, repeatability=0.0)
SETTINGS = ProbingSettings(touch_sigma=0.1 * MM, tool_sigma=0.3 * MM)
FACE: dict[Posture, Plane] = {
    posture: Plane(
        point=np.where(np.arange(3) == axis, level, 0.0),
        normal=(1.0 if level > 0.0 else -1.0) * np.eye(3)[axis],
    )
    for posture, (axis, level) in FACES.items()
}
"""The faces of the block as planes."""


def known_arm(cell: FengCell) -> CalibratedModel:
    """A model that knows the arm without any doubt."""
    actual = cell.robot.actual
    size = len(actual.errors)
    nominal = actual.nominal()
    return CalibratedModel(
        robot=nominal,
        errors=actual.errors,
        covariance=np.zeros((size, size)),
        repeatability=0.0,
        white=0.0,
    )


@cache
def cell(seed: int) -> FengCell:
    return feng_cell(seed)


def touched(
    where: FengCell, count: int, *, seed: int = 0, postures: tuple[Posture, ...] = ("R", "L", "T")
) -> ProbingSet:
    """``count`` touches of feature points in every posture."""
    rng = np.random.default_rng([seed, where.seed])
    points = [touch_points(p, count, rng) for p in postures]
    joints = [touch(where, x, p, rng) for x, p in zip(points, postures, strict=True)]
    return of(np.concatenate(points), np.concatenate(joints))


def of(point: Array, joints: Array) -> ProbingSet:
    names = tuple(f"p{i + 1}" for i in range(len(point)))
    return ProbingSet(names=names, point=point, joints=joints, source="simulated")


def spoilt(touches: ProbingSet, rows: list[int], by: float) -> ProbingSet:
    """The set with some nominal points moved: the probe touched something else."""
    point = touches.point.copy()
    rng = np.random.default_rng(9)
    away = rng.normal(size=(len(rows), 3))
    point[rows] += by * away / np.linalg.norm(away, axis=1)[:, None]
    return replace(touches, point=point)


def frame_error(found: Array, true: Array) -> Array:
    turn = rotation_vector_from_matrix(found[:3, :3] @ true[:3, :3].T)
    return np.concatenate([found[:3, 3] - true[:3, 3], turn])
