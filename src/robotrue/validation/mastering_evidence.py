"""Touches of one fixed point under a hypothesis: these zeros are unknown, the others known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from robotrue.calibration.belief import Belief, with_nuisances
from robotrue.calibration.drift_scales import Stack, stack_rows
from robotrue.calibration.new_rows import NewRows
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.robot.model import RobotModel, parameter_slice

STEPS: Final = 5
STILL: Final = 1e-7
"""m and rad by which a solution at rest moves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OffsetEvidence:
    """Offsets of a hypothesis, and its fit to the touches.

    Attributes:
        log: Log marginal likelihood, up to a constant of the touches.
        surprise: Touches over their expectation.
        offset: (k,) rad, shift of the zeros of the hypothesis.
        covariance: (k, k) rad^2 of it, with the arm stretched.
    """

    log: float
    surprise: float
    offset: Array
    covariance: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class SolvedTouches:
    """The mean after the touches, and the m believed numbers linearised there.

    Attributes:
        at: The prior at the mean of the posterior.
        rows: Where they stand then.
        residuals: (n, 3) m, of the believed touches.
        off: (m,) m, distance of the touches from what was expected before them.
        half: (m, r) root of their covariance: the arm, the point, then a column per zero of the
            hypothesis, m/rad.
        noise: (m, m) m^2, the remainder.
        row: (m,) touch of each number.
        zeros: Number of unknown zeros.
    """

    at: Belief
    rows: NewRows
    residuals: Array
    off: Array
    half: Array
    noise: Array
    row: IntArray
    zeros: int


def offset_columns(robot: RobotModel) -> Array:
    """Returns d(error vector)/d(joint offset) (e, n): a joint's zero moves every axis it drives."""
    out = np.zeros((len(robot.errors), robot.dof))
    out[parameter_slice(robot.dof, "theta")] = robot.joint_map
    return out


def solve_touches(
    belief: Belief,
    joints: tuple[int, ...],
    size: float,
    rows: NewRows,
    keep: BoolArray,
    loose: float,
) -> SolvedTouches:
    """Returns the touches under a hypothesis, linearised where its posterior is.

    Args:
        belief: Of the arm before any zero was lost.
        joints: Whose zeros are unknown.
        size: rad, prior deviation of the zeros.
        rows: The touches.
        keep: (n,) which are used.
        loose: m per axis, prior deviation of the point.
    """
    prior = loosen_zeros(belief, joints, size, rows.nuisances, loose)
    at, moved = prior, np.zeros(rows.nuisances)
    stack = stack_rows(rows.pieces(at, keep))
    for _ in range(STEPS):
        last, at = at.mean, _estimate(prior, stack, moved)[0]
        step = at.mean[at.end :]
        rows, moved = rows.move(step), moved + step
        at = replace(at, mean=np.concatenate([at.mean[: at.end], np.zeros(rows.nuisances)]))
        stack = stack_rows(rows.pieces(at, keep))
        if max(np.abs(at.mean - last).max(), np.abs(step).max()) < STILL:
            break
    at, off, half, noise = _estimate(prior, stack, moved)
    half[:, half.shape[1] - len(joints) :] /= size
    return SolvedTouches(
        at=at,
        rows=rows,
        residuals=(stack.values - stack.columns @ at.mean).reshape(-1, 3),
        off=off,
        half=half,
        noise=noise,
        row=stack.row,
        zeros=len(joints),
    )


def _estimate(prior: Belief, stack: Stack, moved: Array) -> tuple[Belief, Array, Array, Array]:
    """The prior at the mean after the touches; their distance from it, root and noise.

    Of the point, which was moved, its old place is no longer known.
    """
    mean = np.concatenate([prior.mean[: prior.end], -moved])
    off = stack.values - stack.columns @ mean
    half = stack.columns @ prior.root.T
    noise = stack.known + np.diag(prior.noise[0] * stack.white)
    pull = cho_solve(cho_factor(half @ half.T + noise, lower=True), off)
    return replace(prior, mean=mean + prior.root.T @ (half.T @ pull)), off, half, noise


def weigh_offsets(solved: SolvedTouches, size: float, stretch: Array) -> OffsetEvidence:
    """Returns offsets and evidence of a hypothesis, for zeros lost by about ``size`` rad.

    The offsets weigh the touches by what the arm states of itself; only their covariance contains
    what it does not know.

    Args:
        solved: The touches with the zeros of the hypothesis unknown.
        size: rad, standard deviation of a lost zero.
        stretch: (n,) factor on the standard deviation of the arm at each touch.
    """
    arm = solved.half.shape[1] - solved.zeros - solved.rows.nuisances
    half = solved.half.copy()
    lost = half[:, half.shape[1] - solved.zeros :]
    lost *= size
    factor = cho_factor(half @ half.T + solved.noise, lower=True)
    square = float(solved.off @ cho_solve(factor, solved.off))
    # The loss of a zero is not its present value: the arm's own zero was never known exactly.
    gain = size * cho_solve(factor, lost)
    half[:, :arm] *= stretch[solved.row, None]
    apart = half.T @ gain
    shared = size * gain.T @ lost
    return OffsetEvidence(
        log=-0.5 * square - float(np.log(np.diagonal(factor[0])).sum()),
        surprise=float(np.sqrt(square / max(len(solved.off) - solved.rows.nuisances, 1))),
        offset=gain.T @ solved.off,
        covariance=size**2 * np.eye(solved.zeros)
        - (shared + shared.T)
        + apart.T @ apart
        + gain.T @ solved.noise @ gain,
    )


def loosen_zeros(
    belief: Belief, joints: tuple[int, ...], size: float, nuisances: int, loose: float
) -> Belief:
    """The belief with nuisances of the rows, and zeros unknown: those are the root's last rows."""
    prior = with_nuisances(belief, np.full(nuisances, loose))
    extra = np.zeros((len(joints), len(prior.mean)))
    extra[:, : len(belief.errors)] = size * offset_columns(belief.robot)[:, list(joints)].T
    return replace(prior, root=np.vstack([prior.root, extra]))
