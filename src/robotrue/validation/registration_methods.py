"""The ways to make a frame of the touches of one part, each with what errors of touches do to it.

``touches`` counts every touch and names wrong ones. ``feng2018`` builds the frame of three points
with a right angle at the first (Feng, Liang, Xi 2018, eq. 9-12), ``three-two-one`` lays the part
on three, two and one touch of three faces: shop practice, with nothing or little to spare.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final, Literal, TypeAlias, get_args

import numpy as np

from robotrue.cell.registration.baselines import (
    feature_frame,
    feature_frame_gain,
    fit_feature_frame,
    fit_three_two_one,
)
from robotrue.cell.registration.fit import Noise, Registration
from robotrue.cell.registration.touches import fit_touches, touch_gain
from robotrue.core.arrays import Array, IntArray
from robotrue.core.surfaces import Plane
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError, ObservabilityError
from robotrue.measurement.probing_set import ProbingSet

Method: TypeAlias = Literal["touches", "feng2018", "three-two-one"]
ONE_FACE: Final = 10.0 * DEG
"""Normals closer together than this are of one face."""


def fit_by_method(
    method: Method, touches: ProbingSet, in_base: Array, *, noise: Noise
) -> tuple[Registration, Array]:
    """Returns the frame of one part and its step (6, 3n) per error of the touches.

    Args:
        method: Of :data:`Method`.
        touches: Of one part.
        in_base: (n, 3) m, where the tip was.
        noise: Of touch and robot.

    Raises:
        ConfigurationError: No such method, or touches that it has no use for.
        ObservabilityError: The touches leave a motion free.
        ImplausibleDataError: Touches of another pattern, swapped or mirrored ones.
    """
    if method == "feng2018":
        return _three_points(touches, in_base, noise)
    if method == "three-two-one":
        return _three_faces(touches, in_base, noise)
    if method != "touches":
        raise ConfigurationError(
            f"method {method!r}, expected {', '.join(get_args(Method))}.", hint="--method touches"
        )
    fit = fit_touches(touches, in_base, noise=noise)
    return fit, touch_gain(touches, in_base, fit.T_base_part, fit.believed)


def _three_points(touches: ProbingSet, in_base: Array, noise: Noise) -> tuple[Registration, Array]:
    """K (the corner), L, M: K counts as exact, L gives a direction, M a plane."""
    if len(touches) != 3 or not touches.full.all():
        blank = int((~touches.full).sum())
        raise ConfigurationError(
            f"{len(touches)} touches, {blank} of them with a normal; method feng2018 takes three "
            "feature points: the corner with the right angle first, then one along each edge.",
            hint="--method touches takes any number of touches, and uses all of them.",
        )
    even = fit_touches(touches, in_base, noise=noise)  # refuses the points of another part
    fit = fit_feature_frame(touches.point, in_base, sigma=noise.sigma, names=touches.labels)
    square = float((even.distances**2).sum())
    gain = feature_frame_gain(in_base, feature_frame(touches.point))
    return replace(fit, least_squares=square), gain


def _three_faces(touches: ProbingSet, in_base: Array, noise: Noise) -> tuple[Registration, Array]:
    """Six touches with normals, in any order: 3, 2 and 1 of the same."""
    groups = group_faces(touches)
    counts = [len(rows) for rows in groups]
    if counts != [3, 2, 1]:
        found = " and ".join(map(str, counts)) or "none"
        raise ObservabilityError(
            f"the touches with a normal are {found} to a face, three-two-one needs 3, 2 and 1 on "
            "three faces.",
            hint="six rows with nx, ny, nz: three of one normal, two of another, one of a third.",
        )
    order = np.concatenate(groups)
    names = tuple(touches.labels[i] for i in order)
    planes = [
        Plane(point=touches.point[rows].mean(axis=0), normal=_mean_normal(touches, rows))
        for rows in groups
    ]
    faces = (planes[0], planes[1], planes[2])
    laid = fit_three_two_one(
        faces, in_base[order], sigma=noise.sigma, radius=touches.radius, names=names
    )
    back = np.argsort(order)
    fit = replace(laid, names=touches.labels, residuals=laid.residuals[back], sigma_source="stated")
    return fit, touch_gain(touches, in_base, fit.T_base_part, fit.believed)


def group_faces(touches: ProbingSet) -> list[IntArray]:
    """Returns the rows of each face by their normals, the face with most touches first.

    Touches without a normal are one group.
    """
    groups: list[list[int]] = []
    for row in np.flatnonzero(~touches.full).tolist():
        normal = touches.normal[row]
        for group in groups:
            if normal @ touches.normal[group[0]] > np.cos(ONE_FACE):
                group.append(row)
                break
        else:
            groups.append([row])
    if touches.full.any():
        groups.append(np.flatnonzero(touches.full).tolist())
    return [np.array(group, dtype=np.int64) for group in sorted(groups, key=len, reverse=True)]


def _mean_normal(touches: ProbingSet, rows: IntArray) -> Array:
    normal = touches.normal[rows].mean(axis=0)
    return np.asarray(normal / np.linalg.norm(normal))
