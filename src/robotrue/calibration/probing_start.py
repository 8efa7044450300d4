"""Rough frames of the parts: one for each from the touches alone, or the reason against it.

Nominal points go to the tips predicted by the arm, by a rigid fit that is robust to wrong touches.
Everything that would end in a wrong frame without a word is refused here: too few or collinear
points, a surface pattern that leaves a motion free, another unit, a mirrored part.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from robotrue.calibration.arm import prepare_arm
from robotrue.calibration.belief import Belief
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.observable import check_motions
from robotrue.core.poses import apply, check_mirror, fit_rigid, inverse, pose
from robotrue.core.robust import GAUSS_POINT, agreeing
from robotrue.core.units import MM
from robotrue.errors import ConvergenceError, ImplausibleDataError, ObservabilityError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.statics import Load

ROBOT: Final = 0.5 * MM
"""Error of an unmeasured arm beyond a rigid motion of the part, per axis."""
FLAT: Final = 1e-3
"""Points closer to one line than this part of their length fix no rotation about it."""
UNIT_STEP: Final = 30.0
"""Patterns this many times larger or smaller than one another are in different units."""
FEWEST_ROBUST: Final = 5
"""Fewest points from which a wrong one can be identified."""


def tips(belief: Belief, joints: Array, payload: Load) -> Array:
    """Returns where a belief predicts the tip, (n, 3) m in base, its smooth residual included."""
    arm = prepare_arm(belief.actual, terms=belief.terms, values=belief.values)
    return arm.linearise(joints, payload).tip


def start_frames(
    touches: ProbingSet, in_base: Array, stated: Mapping[int, Array], *, robust: bool
) -> dict[int, Array]:
    """Returns the rough frame of each part, ``T_base_part`` (4, 4) by part number.

    Args:
        touches: Of all parts.
        in_base: (n, 3) m, the tips.
        stated: Frames the user gave; used as they are.
        robust: Let wrong touches disagree.

    Raises:
        ObservabilityError: A part with too few touches, on one line, or with a motion left free.
        ImplausibleDataError: Patterns in different units, or mirrored.
    """
    out = {}
    for k in touches.parts:
        mine = np.flatnonzero(touches.part == k)
        if k in touches.sockets:
            out[k] = pose(np.eye(3), np.median(in_base[mine], axis=0))
        elif k in stated:
            out[k] = np.asarray(stated[k], dtype=np.float64)
        else:
            out[k] = _fit_frame(touches, in_base, mine, robust)
        if k not in touches.sockets:
            check_held(touches, in_base, mine, out[k])
    return out


def check_held(touches: ProbingSet, in_base: Array, mine: IntArray, T_base_part: Array) -> None:
    """Passes if the chosen touches of one part fix all six directions of its frame.

    Raises:
        ObservabilityError: They do not; names the undetermined directions, in part axes.
    """
    labels = touches.labels
    full = mine[touches.full[mine]]
    along = mine[~touches.full[mine]]
    if not len(along):
        check_pattern(touches.point[full], tuple(labels[i] for i in full))
        return
    normal = normals(touches, in_base, T_base_part)[along] @ T_base_part[:3, :3].T
    check_motions(
        np.concatenate([np.repeat(in_base[full], 3, axis=0), in_base[along]]),
        np.concatenate([np.tile(np.eye(3), (len(full), 1)), normal]),
        T_base_part,
    )


def normals(touches: ProbingSet, in_base: Array, T_base_part: Array) -> Array:
    """Returns the surface normals (n, 3) in part at the touches; NaN at full points."""
    out = touches.normal.copy()
    in_part = apply(inverse(T_base_part), in_base)
    for index, surface in enumerate(touches.surfaces):
        mine = touches.touched == index
        if mine.any():
            out[mine] = surface.nearest(in_part[mine])[1]
    return out


def check_pattern(points: Array, labels: tuple[str, ...]) -> None:
    """Passes if feature points fix a frame.

    Args:
        points: (n, 3) m.
        labels: (n) of the points.

    Raises:
        ObservabilityError: Fewer than three places, or all on one line; names the touches.
    """
    named = ", ".join(labels[:8]) + (", ..." if len(labels) > 8 else "")
    places = np.unique(np.round(points, 7), axis=0)
    if len(places) < 3:
        raise ObservabilityError(
            f"touches {named} are at {len(places)} different places of the part, its frame needs 3 "
            "that are not on one line.",
            hint="touch more feature points, far apart.",
        )
    _, size, axes = np.linalg.svd(places - places.mean(axis=0), full_matrices=False)
    if size[1] <= FLAT * size[0]:
        x, y, z = axes[0]
        raise ObservabilityError(
            f"touches {named} lie on one line of the part, along ({x:+.2f}, {y:+.2f}, {z:+.2f}); "
            "the turn about it is not observable.",
            hint="touch a point to the side of that line.",
        )


def _fit_frame(touches: ProbingSet, in_base: Array, mine: IntArray, robust: bool) -> Array:
    """Rigid fit of one part's nominal points to the tips."""
    labels = touches.labels
    full = mine[touches.full[mine]]
    try:
        check_pattern(touches.point[full], tuple(labels[i] for i in full))
        rows = full
    except ObservabilityError:
        # Too few feature points: touches on surfaces know roughly where they were aimed.
        rows = mine
        check_pattern(touches.point[rows], tuple(labels[i] for i in rows))
    part, base = touches.point[rows], in_base[rows]
    _check_units(part, base)
    if touches.full[rows].all():
        check_mirror(part, base)
    keep = np.ones(len(rows), dtype=bool)
    if robust and len(rows) >= FEWEST_ROBUST:
        keep = _agreeing(part, base, GAUSS_POINT * _loose(part, base))
    return fit_rigid(part[keep], base[keep])


def _loose(part: Array, base: Array) -> float:
    """Returns the largest error of a good touch, m per axis, for an unmeasured arm."""
    typical = np.median(np.linalg.norm(apply(fit_rigid(part, base), part) - base, axis=1))
    # At the start a bound that is too tight would cut through an arm that errs more than most.
    return float(min(max(ROBOT, 0.2 * typical), 10.0 * ROBOT))


def _agreeing(part: Array, base: Array, bound: float) -> BoolArray:
    def off(weights: Array) -> Array:
        T = fit_rigid(part, base, weights)
        return np.asarray(np.linalg.norm(apply(T, part) - base, axis=1))

    everyone = np.ones(len(part), dtype=bool)
    try:
        keep = agreeing(off, len(part), bound)
        check_pattern(part[keep], tuple(str(i) for i in np.flatnonzero(keep)))
    except (ConvergenceError, ObservabilityError):
        return everyone
    return keep if 2 * int(keep.sum()) > len(keep) else everyone


def _check_units(part: Array, base: Array) -> None:
    sizes = [float(np.ptp(p, axis=0).max()) for p in (part, base)]
    if not 1.0 / UNIT_STEP < sizes[1] / sizes[0] < UNIT_STEP:
        raise ImplausibleDataError(
            f"the nominal points span {sizes[0] / MM:.6g} mm and the tips that touched them "
            f"{sizes[1] / MM:.6g} mm.",
            hint="one of the two is in another unit: points are in mm in files, joints in deg.",
        )
