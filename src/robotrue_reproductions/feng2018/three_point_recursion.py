"""Recursive adjustment of the CAM model's pose until the run trajectory meets the touched points.

Feng, Liang, Xi 2018 (J. Xiamen Univ. Nat. Sci. 57(5), 722-728), section 1, with the equations read
as they must be. The recursion repeats the robot's own error, so its stop values measure the
agreement of robot and model with each other, not with the world. The residual after many passes is
reported in two parts: the floor, the distortion of the triangle by this robot, present after one
pass, and the oscillation, caused by the touching. At the machine it runs in rounds:
:mod:`robotrue.cell.registration.rounds`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Final, Literal, TypeAlias

import numpy as np
from scipy.stats import chi2

from robotrue.cell.registration.baselines import check_corner, feature_frame, fit_feature_frame
from robotrue.cell.registration.rounds import Adjustment, Pass, side_lengths, summarise
from robotrue.core.arrays import Array, frozen
from robotrue.core.poses import apply, pose
from robotrue.core.rotations import (
    abc_from_matrix,
    matrix_from_abc,
    rotation_vector_from_matrix,
)
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError

Probe: TypeAlias = Callable[[Array], Array]
"""From commanded points K, L, M (3, 3) m in base to the part's points touched there, as the robot
reads them (3, 3) m. Implemented by a virtual cell, a real robot or a file."""
Correction: TypeAlias = Callable[[Array, Array], tuple[Array, Array]]
"""From run and touched K, L, M (3, 3) m in base to angles (3,) rad, which turn the model about its
z, y, x in that order, and the shift (3,) m of K in base."""
Verdict: TypeAlias = Literal["within tolerance", "nothing more to gain", "diverges", "not settled"]

ANGLE_TOLERANCE: Final = 0.02 * DEG
POSITION_TOLERANCE: Final = 0.2 * MM
_CERTAIN: Final = 0.95
_WORSE: Final = 1.5
"""An error this many times the one before, three times in a row, is a divergence."""


def feature_correction(run: Array, touched: Array) -> tuple[Array, Array]:
    """Returns the correction that maps the run feature frame to the touched one, eq. 9-15.

    Eq. 13: touched = run Rz(gamma) Ry(beta) Rx(alpha), both attitudes feature in base.

    Args:
        run: (3, 3) m, K, L, M of the model.
        touched: (3, 3) m, the same on the part.

    Raises:
        ObservabilityError: Points on one line.
    """
    between = feature_frame(run)[:3, :3].T @ feature_frame(touched)[:3, :3]
    return abc_from_matrix(between), touched[0] - run[0]


def adjust_recursively(
    in_part: Array,
    T_base_part: Array,
    probe: Probe,
    *,
    sigma: float,
    correct: Correction = feature_correction,
    angle_tolerance: float = ANGLE_TOLERANCE,
    position_tolerance: float = POSITION_TOLERANCE,
    settled: int = 3,
    most: int = 20,
) -> Adjustment:
    """Returns the model's pose after recursive adjustment, and what the passes show.

    Each pass runs K, L, M as the model has them, touches the part's own, turns the model about
    its z, y, x at K and shifts K onto the touched K. It ends within the tolerances; or when the
    correction has been below its own uncertainty ``settled`` times in a row; or when the error
    grows.

    Args:
        in_part: (3, 3) m, K (the right angle), L, M in part.
        T_base_part: (4, 4) the model's pose to begin with.
        probe: The touching.
        sigma: m per axis of one touch, with the robot's repeatability and what another tilt of the
            wrist changes (tilt times tip and arm error); 0 if there is none. Too small a value
            never settles.
        correct: The correction of one pass.
        angle_tolerance: rad.
        position_tolerance: m, of the worst point.
        settled: Passes without gain before it ends. One is enough to stop; three show the
            oscillation.
        most: Passes at most.

    Raises:
        ConfigurationError: Counts below one, a negative sigma or tolerance.
        ObservabilityError: Points on one line.
        ImplausibleDataError: No right angle at K.
    """
    _check(sigma, angle_tolerance, position_tolerance, settled, most)
    part: Array = frozen(in_part, (3, 3), "in_part")
    T: Array = np.array(T_base_part, dtype=np.float64)
    check_corner(part, ("K", "L", "M"))
    limit = float(chi2.ppf(_CERTAIN, 6))
    own = _touching(part, sigma)
    passes: list[Pass] = []
    lengths: list[Array] = []
    quiet = 0
    verdict: Verdict = "not settled"
    while True:
        run = apply(T, part)
        touched: Array = frozen(probe(run), (3, 3), "touched points")
        angles, shift = correct(run, touched)
        significance = _significance(run, touched, angles, own * min(len(passes) + 1, 2))
        passes.append(
            Pass(deviation=touched - run, angles=angles, shift=shift, significance=significance)
        )
        lengths.append(side_lengths(touched) - side_lengths(part))
        now = passes[-1]
        if now.worst <= position_tolerance and now.angle <= angle_tolerance:
            verdict = "within tolerance"
            break
        quiet = quiet + 1 if now.significance <= limit else 0
        if quiet >= settled:
            verdict = "nothing more to gain"
            break
        if _diverges(passes, limit):
            verdict = "diverges"
            break
        if len(passes) > most:
            break
        T = _apply_correction(T, run, angles, shift)
    covariance = fit_feature_frame(part, touched, sigma=sigma, right_angle=np.inf).covariance
    # Settled: from the last significant correction on; what it left is the first settled error.
    large = [i for i, p in enumerate(passes) if p.significance > limit]
    first = large[-1] + 1 if large else 0
    return summarise(T, covariance, passes, lengths, verdict, first=first)


def _apply_correction(T: Array, run: Array, angles: Array, shift: Array) -> Array:
    """Returns the model's pose (4, 4) turned about its own axes at K and shifted."""
    axes = feature_frame(run)[:3, :3]
    about_k = axes @ matrix_from_abc(angles) @ axes.T
    return pose(about_k @ T[:3, :3], about_k @ (T[:3, 3] - run[0]) + run[0] + shift)


def _touching(part: Array, sigma: float) -> Array:
    """Returns the covariance (6, 6) of a correction, in feature axes at K, from its touches."""
    local = (part - part[0]) @ feature_frame(part)[:3, :3]
    return fit_feature_frame(local, local, sigma=sigma, right_angle=np.inf).covariance


def _significance(run: Array, touched: Array, angles: Array, covariance: Array) -> float:
    """Returns the squared length of the correction over a covariance; inf without noise."""
    axes = feature_frame(run)[:3, :3]
    step = np.concatenate(
        [axes.T @ (touched[0] - run[0]), rotation_vector_from_matrix(matrix_from_abc(angles))]
    )
    if not covariance.any():
        return 0.0 if np.linalg.norm(step) < 1e-12 else np.inf
    return float(step @ np.linalg.solve(covariance, step))


def _diverges(passes: list[Pass], limit: float) -> bool:
    worst = [p.worst for p in passes[-4:]]
    growing = [b > _WORSE * a for a, b in itertools.pairwise(worst)]
    # Touching alone may grow three times in a row; its corrections stay insignificant.
    real = all(p.significance > limit for p in passes[-3:])
    return real and len(growing) == 3 and all(growing)


def _check(sigma: float, angle: float, position: float, settled: int, most: int) -> None:
    if min(sigma, angle, position) < 0.0:
        raise ConfigurationError(
            f"sigma {sigma:g} m, tolerances {angle:g} rad and {position:g} m: none may be negative."
        )
    if settled < 1 or most < 1:
        raise ConfigurationError(f"settled {settled} and most {most} passes, expected 1 or more.")
