"""Touches of one fixed point under a hypothesis: these zeros are unknown, the others known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from robotrue.calibration.belief import Belief, condition, with_nuisances
from robotrue.calibration.drift_scales import stack_rows
from robotrue.calibration.new_rows import NewRows, whiten
from robotrue.calibration.observations import LinearRows
from robotrue.core.arrays import Array, BoolArray
from robotrue.robot.model import RobotModel, parameter_slice

STEPS: Final = 5
STILL: Final = 1e-7
"""m and rad by which a solution at rest moves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SolvedTouches:
    """A belief after the touches.

    Attributes:
        after: The posterior.
        rows: Linearised at the posterior.
        pieces: The rows in use, linearised there.
        moved: (3,) m, shift of the point from its prior.
        evidence: Log marginal likelihood, up to a constant of the touches.
        surprise: Touches over their expectation.
        residuals: (n, 3) m.
        offset: (k,) rad, shift of the zeros of the hypothesis.
        covariance: (k, k) rad^2 of it.
    """

    after: Belief
    rows: NewRows
    pieces: list[LinearRows]
    moved: Array
    evidence: float
    surprise: float
    residuals: Array
    offset: Array
    covariance: Array


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
    pieces = rows.pieces(at, keep)
    for _ in range(STEPS):
        last, at = at.mean, _condition(prior, pieces, moved)
        step = at.mean[at.end :]
        rows, moved = rows.move(step), moved + step
        at = replace(at, mean=np.concatenate([at.mean[: at.end], np.zeros(rows.nuisances)]))
        pieces = rows.pieces(at, keep)
        if max(np.abs(at.mean - last).max(), np.abs(step).max()) < STILL:
            break
    return _judge(prior, (joints, size), rows, pieces, moved)


def solve_beside(
    belief: Belief, joints: tuple[int, ...], size: float, solved: SolvedTouches, loose: float
) -> SolvedTouches:
    """Returns the same touches under another hypothesis, linearised where they are already."""
    prior = loosen_zeros(belief, joints, size, solved.rows.nuisances, loose)
    return _judge(prior, (joints, size), solved.rows, solved.pieces, solved.moved)


def loosen_zeros(
    belief: Belief, joints: tuple[int, ...], size: float, nuisances: int, loose: float
) -> Belief:
    """The belief with nuisances of the rows, and zeros unknown: those are the root's last rows."""
    prior = with_nuisances(belief, np.full(nuisances, loose))
    extra = np.zeros((len(joints), len(prior.mean)))
    extra[:, : len(belief.errors)] = size * offset_columns(belief.robot)[:, list(joints)].T
    return replace(prior, root=np.vstack([prior.root, extra]))


def _shift(prior: Belief, moved: Array) -> Belief:
    """Returns the prior about a point that was moved: knowledge of its old place is dropped."""
    return replace(prior, mean=np.concatenate([prior.mean[: prior.end], -moved]))


def _condition(prior: Belief, pieces: list[LinearRows], moved: Array) -> Belief:
    count = 1 + max(int(piece.rows.max()) for piece in pieces)
    return condition(_shift(prior, moved), *whiten(pieces, prior.noise, np.ones(count)))


def _judge(
    prior: Belief,
    hypothesis: tuple[tuple[int, ...], float],
    rows: NewRows,
    pieces: list[LinearRows],
    moved: Array,
) -> SolvedTouches:
    """Posterior and marginal likelihood of rows that are linearised where they end."""
    at, stack = _condition(prior, pieces, moved), stack_rows(pieces)
    off = stack.values - stack.columns @ _shift(prior, moved).mean
    half = stack.columns @ prior.root.T
    total = half @ half.T + stack.known + np.diag(prior.noise[0] * stack.white)
    factor = cho_factor(total, lower=True)
    square = float(off @ cho_solve(factor, off))
    freedom = max(len(off) - rows.nuisances, 1)
    joints, size = hypothesis
    # What a zero lost is not where it stands now: the arm's own zero was never known exactly.
    lost = size * half[:, half.shape[1] - len(joints) :]
    return SolvedTouches(
        after=at,
        rows=rows,
        pieces=pieces,
        moved=moved,
        evidence=-0.5 * square - float(np.log(np.diagonal(factor[0])).sum()),
        surprise=float(np.sqrt(square / freedom)),
        residuals=(stack.values - stack.columns @ at.mean).reshape(-1, 3),
        offset=lost.T @ cho_solve(factor, off),
        covariance=size**2 * np.eye(len(joints)) - lost.T @ cho_solve(factor, lost),
    )
