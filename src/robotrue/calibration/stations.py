"""Measurements of a tracker whose place an estimate knows, taken to base."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import apply, inverse
from robotrue.errors import ModelMismatchError
from robotrue.measurement.measurement_set import MeasurementSet


def take_to_base(
    measurements: MeasurementSet, T_tracker_base: Mapping[int, Array]
) -> MeasurementSet:
    """Returns the set with positions, orientations and covariances in base.

    Args:
        measurements: In tracker frames; a set in base comes back as it is.
        T_tracker_base: (4, 4) of every set-up that is known.

    Raises:
        ModelMismatchError: A station that is not known.
    """
    if measurements.frame == "base":
        return measurements
    unknown = sorted(set(measurements.station.tolist()) - set(T_tracker_base))
    if unknown:
        raise ModelMismatchError(
            f"tracker station {unknown[0]} is not in the model, which knows "
            f"{sorted(T_tracker_base)}.",
            hint="calibrate with rows of that station, or register it first.",
        )
    T = inverse(np.stack([T_tracker_base[int(k)] for k in measurements.station]))
    turn = T[:, :3, :3]
    back = np.swapaxes(turn, 1, 2)
    return replace(
        measurements,
        frame="base",
        position=apply(T, measurements.position),
        covariance=turn @ measurements.covariance @ back,
        rotation=turn @ measurements.rotation,
        rotation_covariance=turn @ measurements.rotation_covariance @ back,
    )
