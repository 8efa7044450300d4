"""Touches as rows of a measurement set: every part is the set-up of a tracker."""

from __future__ import annotations

import numpy as np

from robotrue.errors import ShapeError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.probing_set import ProbingSet


def touched_rows(touches: ProbingSet, *, sigma: float) -> MeasurementSet:
    """Returns full points touched by the robot as measurements, so that every method fits them.

    A part is a tracker frame that is not known yet, its nominal points are what that tracker saw; a
    socket is a place that only shifts. Known distances have no row and do not come along.

    Args:
        touches: With joints.
        sigma: m per axis of one touch, without the robot.

    Raises:
        ShapeError: Touches without joints, or on surfaces: those fix one direction each.
    """
    if not touches.has_joints or not touches.full.all():
        raise ShapeError(
            f"{int((~touches.full).sum())} of {len(touches)} touches fix one direction only, "
            f"{touches.joints.shape[1]} joints; rows of a measurement set need joints and full "
            "points."
        )
    n = len(touches)
    parts = touches.parts
    return MeasurementSet(
        joints=touches.joints,
        position=touches.point,
        covariance=np.tile(sigma**2 * np.eye(3), (n, 1, 1)),
        frame="tracker",
        station=touches.part,
        group=np.searchsorted(parts, touches.part),
        group_names=tuple(f"part {k}" for k in parts),
        source_row=touches.lines,
        sources=(touches.source,) if touches.source else (),
        provenance=touches.provenance,
    )
