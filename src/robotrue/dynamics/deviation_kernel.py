"""Covariance between windows beyond the bending of the stated arm, with sizes by evidence.

::

    cov = X S X^T                                      factors on the joints, offset, scale
        + a1^2 exp(-|dq|^2 / 2 l1^2)                   depends on the pose, in every pass
        + [same pass] a2^2 exp(-|dp|^2 / 2 l2^2)       changes along one pass only
        + [same pass] (d^2 + t t' r^2) C C^T           zero of the dynamometer in that pass
        + w^2                                          from window to window

t is the part of its pass at which a window lies: the zero is set where a pass begins, and drifts.
Each pass has its own constant and slope, drawn with deviations d and r N. The drift of the
dynamometer (r) is learned from the passes; where its zero was read before and after the cut and
subtracted, the residual of both is known and small. Neighbouring windows share their error;
treating it as white makes the factors of a single pass look determined when they are not, and
transfers them wrongly to other poses.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.calibration.learners.posterior import Solved, solve
from robotrue.calibration.learners.search import search_theta
from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.units import MM, UM

NAMES: Final = ("pose_m", "pose_length_rad", "pass_m", "pass_length_m", "white_m", "drift_N")
"""a1, l1, a2, l2, w, r."""
DRIFT: Final = 0.45
"""N, median of the prior of r."""
CENTRE: Final = np.log([0.5 * UM, 0.3, 1.0 * UM, 30 * MM, 0.5 * UM, DRIFT])
SPREAD: Final = np.array([1.0, 0.7, 1.0, 1.0, 1.0, 0.5])
"""Weak log-normal prior of the six."""
SEARCHED: Final = 250
"""Windows that the six are learned from, at most."""
_NO_DRIFT: Final = 1e-9
"""N; less is none."""
BOUNDS: Final = np.log(
    [
        [0.01 * UM, 50 * UM],
        [0.03, 3.0],
        [0.01 * UM, 50 * UM],
        [2 * MM, 1.0],
        [0.02 * UM, 50 * UM],
        [0.02, 10.0],
    ]
)


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowRows(Columns):
    """Windows as inputs of the covariance.

    Attributes:
        basis: (n, q) columns X.
        joints: (n, dof) rad.
        place: (n, 3) m.
        member: (n,) number of the pass.
        way: (n,) t, from 0 where the pass began to 1 where it ended.
        zero: (n, 6) m, C d, and C t r where the zero was subtracted and r is known.
        lever: (n, 3) m/N, C t where the drift of the zero is unbounded.
    """

    basis: Annotated[Array, Column("n q")]
    joints: Annotated[Array, Column("n dof", unit="rad")]
    place: Annotated[Array, Column("n 3", unit="m")]
    member: Annotated[IntArray, Column("n")]
    way: Annotated[Array, Column("n")]
    zero: Annotated[Array, Column("n 6", unit="m")]
    lever: Annotated[Array, Column("n 3", unit="m/N")]


def part_of_pass(place: Array, member: IntArray, known: WindowRows | None) -> Array:
    """Returns the part (n,) of its pass at which each window lies, by the length of the path.

    Args:
        place: (n, 3) m, tool points in the order they were cut.
        member: (n,) number of the pass.
        known: Windows learned from; a window of their passes has the part of the nearest of them.

    A single window may be anywhere on its pass: it counts as the last.
    """
    out = np.ones(len(place))
    for which in np.unique(member):
        own = np.flatnonzero(member == which)
        old = np.zeros(0, dtype=np.int64) if known is None else known.member == which
        if known is not None and np.any(old):
            nearest = _squared_distance(place[own], known.place[old]).argmin(axis=1)
            out[own] = known.way[old][nearest]
        elif len(own) > 1:
            steps = np.linalg.norm(np.diff(place[own], axis=0), axis=1)
            length = np.concatenate([[0.0], np.cumsum(steps)])
            out[own] = length / length[-1] if length[-1] > 0.0 else 1.0
    return out


def pose_covariance(one: WindowRows, two: WindowRows, theta: Array) -> Array:
    """Returns the pose part of the covariance between windows (n, m)."""
    amplitude, length = np.exp(theta[0]), np.exp(theta[1])
    return np.asarray(
        amplitude**2 * np.exp(-0.5 * _squared_distance(one.joints, two.joints) / length**2)
    )


def covariance(one: WindowRows, two: WindowRows, theta: Array, prior: Array) -> Array:
    """Returns the covariance between windows (n, m) m^2, white noise left out.

    Args:
        one: n windows.
        two: m windows.
        theta: (6,) logarithms of :data:`NAMES`.
        prior: (q,) variance of each factor.
    """
    same = one.member[:, None] == two.member
    along = np.exp(
        2.0 * theta[2] - 0.5 * _squared_distance(one.place, two.place) / np.exp(2.0 * theta[3])
    )
    out = (one.basis * prior) @ two.basis.T + pose_covariance(one, two, theta)
    drifted = np.exp(2.0 * theta[5]) * (one.lever @ two.lever.T)
    out += same * (along + one.zero @ two.zero.T + drifted)
    return np.asarray(out)


def variance(rows: WindowRows, theta: Array, prior: Array) -> Array:
    """Returns the diagonal of :func:`covariance` of windows with themselves (n,)."""
    drift = np.einsum("ij,ij->i", rows.zero, rows.zero)
    drift += np.exp(2.0 * theta[5]) * np.einsum("ij,ij->i", rows.lever, rows.lever)
    level = np.exp(2.0 * theta[0]) + np.exp(2.0 * theta[2])
    return np.asarray(rows.basis**2 @ prior + drift + level)


def solve_windows(rows: WindowRows, values: Array, theta: Array, prior: Array) -> Solved:
    """Returns values (n,) solved against their covariance, white noise included.

    Raises:
        ObservabilityError: Windows that coincide and carry no noise.
    """
    total = covariance(rows, rows, theta, prior)
    total.flat[:: len(total) + 1] += np.exp(2.0 * theta[4])
    return solve(total, values[:, None], np.zeros((len(values), 0)))


def learn_sizes(rows: WindowRows, values: Array, prior: Array, drift: float) -> Array:
    """Returns theta (6,) of largest evidence under the weak prior.

    Of many windows every second, third, ... is looked at, so that the search stays short.

    Args:
        rows: Learned from.
        values: (n,) m, their deviation less its prior mean.
        prior: (q,) variance of each factor.
        drift: N, median of the prior of the drift of a zero; 0 where it stays.

    Raises:
        ObservabilityError: Windows that coincide and carry no noise.
    """
    stride = -(-len(values) // SEARCHED)
    rows, values = rows.take(slice(None, None, stride)), values[::stride]
    fixed = (rows.basis * prior) @ rows.basis.T
    same = rows.member[:, None] == rows.member
    fixed += same * (rows.zero @ rows.zero.T)
    lever = same * (rows.lever @ rows.lever.T)
    turn, way = (
        _squared_distance(rows.joints, rows.joints),
        _squared_distance(rows.place, rows.place),
    )
    nothing = np.zeros((len(values), 0))

    centre = with_drift(CENTRE[:5], drift)

    def log_posterior(theta: Array) -> tuple[float, Array]:
        a1, l1, a2, l2, white, slope = np.exp(2.0 * theta)
        pose = a1 * np.exp(-0.5 * turn / l1)
        along = same * (a2 * np.exp(-0.5 * way / l2))
        drifted = slope * lever
        total = fixed + pose + along + drifted
        total.flat[:: len(total) + 1] += white
        found = solve(total, values[:, None], nothing)
        weight = found.sensitivity()
        gradient = np.array(
            [
                np.vdot(weight, pose),
                0.5 * np.vdot(weight, pose * turn) / l1,
                np.vdot(weight, along),
                0.5 * np.vdot(weight, along * way) / l2,
                white * np.trace(weight),
                np.vdot(weight, drifted),
            ]
        )
        off = (theta - centre) / SPREAD
        return found.log_evidence - 0.5 * float(off @ off), gradient - off / SPREAD

    held = np.full(len(CENTRE), np.nan)
    if drift <= _NO_DRIFT or not rows.lever.any():
        held[5] = centre[5]
    return search_theta(log_posterior, centre, BOUNDS, held)


def with_drift(theta: Array, drift: float) -> Array:
    """Returns theta (6,) of one (5,) without the drift (N) of the zero."""
    return np.append(theta, np.log(max(drift, _NO_DRIFT)))


def _squared_distance(one: Array, two: Array) -> Array:
    product = one @ two.T
    size = np.einsum("ij,ij->i", one, one)[:, None] + np.einsum("ij,ij->i", two, two)
    return np.asarray(np.maximum(size - 2.0 * product, 0.0))
