"""The tracker's frame as a random walk estimated from monuments and removed from the rows of a run.

Between two moments the frame shifts and turns by independent Gaussian steps whose variance grows
with the distance of the moments. With c the centre of the monuments, a nest j that is fixed to the
floor at M_j is seen at moment t at

    m = M_j + d(t) + w(t) x (M_j - c) + noise,      d(0) = 0, w(0) = 0

The M_j are free; the variances of the steps are those of the largest restricted likelihood
(Patterson and Thompson 1971). A row between two shots gets the conditional mean of d and w, and
their covariance is added to its own. The instrument at the first shot is the reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.core.rotations import matrix_from_rotation_vector, skew
from robotrue.core.units import UM
from robotrue.errors import ShapeError
from robotrue.measurement.measurement_set import MeasurementSet

FEWEST_NESTS: Final = 3
"""Nests from which a turn of the frame is estimated; fewer show its shift alone."""
SWEEPS: Final = 2
"""Searches of one step with the other held."""
_SHIFTS: Final = np.concatenate([[0.0], np.geomspace(0.1, 100.0, 13)]) * UM
_TURNS: Final = np.concatenate([[0.0], np.geomspace(0.1, 100.0, 13)]) * 1e-6
"""Steps that are tried: m and rad, one sd per axis and square root of a moment."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MonumentShots(Columns):
    """n shots of nests that are fixed to the floor, within one run.

    Attributes:
        nest: Name of the nest of each shot.
        position: (n, 3) m in the frame of the rows.
        covariance: (n, 3, 3) m^2, the instrument.
        moment: (n,) when, in any unit that the rows share: the line in the file, or s.
        station: (n,) index of the instrument set-up.
    """

    nest: Annotated[tuple[str, ...], Column("n")]
    position: Annotated[Array, Column("n 3", unit="m")]
    covariance: Annotated[Array, Column("n 3 3", unit="m^2")]
    moment: Annotated[Array, Column("n")]
    station: Annotated[IntArray, Column("n", fill=0)] = EMPTY

    def __len__(self) -> int:
        return len(self.nest)


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameWalk:
    """Motion of the frame of one set-up.

    Attributes:
        shift_step: m per axis and square root of a moment.
        turn_step: rad likewise.
        moment: (k,) requested moments.
        mean: (k, 6) m, rad: shift and turn of the frame about ``centre``.
        covariance: (k, 6, 6) of them.
        centre: (3,) m.
        nests: Number of nests.
        shots: Number of shots.
    """

    shift_step: float
    turn_step: float
    moment: Array
    mean: Array
    covariance: Array
    centre: Array
    nests: int
    shots: int


def estimate_walk(shots: MonumentShots, moment: Array) -> FrameWalk:
    """Returns the walk of one set-up's frame at the moments of its rows.

    Args:
        shots: Of one set-up.
        moment: (k,) of the rows, in the unit of the shots.

    Raises:
        ShapeError: No nest that was shot twice: nothing shows a motion.
    """
    names, nest, counts = np.unique(np.array(shots.nest), return_inverse=True, return_counts=True)
    if not len(shots) or counts.max() < 2:
        raise ShapeError(f"{len(shots)} shots of {len(names)} nests, none of them shot twice.")
    centre = shots.position.mean(axis=0)
    turns = len(names) >= FEWEST_NESTS
    begun = float(shots.moment.min())
    problem = _Problem(
        lever=_levers(shots.position - centre, turns),
        nests=np.asarray(np.kron(np.eye(len(names))[nest], np.eye(3)), dtype=np.float64),
        noise=shots.covariance,
        values=(shots.position - centre).ravel(),
        shared=_shared_time(shots.moment - begun, shots.moment - begun),
    )
    shift, turn = problem.find_steps(turns)
    solution = problem.solve(shift, turn)
    mean, covariance = _at_moments(problem, solution, shots.moment - begun, moment - begun)
    return FrameWalk(
        shift_step=float(shift),
        turn_step=float(turn),
        moment=moment,
        mean=mean,
        covariance=covariance,
        centre=centre,
        nests=len(names),
        shots=len(shots),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Solution:
    """The walk at given steps.

    Attributes:
        steps: (6,) m, rad.
        inverse: (3n, 3n) its inverse with the nests projected out.
        weights: (3n,) that times the values.
        likelihood: Restricted log likelihood, up to a constant.
    """

    steps: Array
    inverse: Array
    weights: Array
    likelihood: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Problem:
    """n shots: lever (n, 3, 6), nests (3n, 3m), noise (n, 3, 3), values (3n,), shared (n, n)."""

    lever: Array
    nests: Array
    noise: Array
    values: Array
    shared: Array

    def find_steps(self, turns: bool) -> tuple[float, float]:
        """Returns the steps of shift and turn of the largest likelihood, one after the other."""
        shift = turn = 0.0
        for _ in range(SWEEPS if turns else 1):
            shift = max(_SHIFTS, key=lambda step: self.solve(step, turn).likelihood)
            if turns:
                turn = max(_TURNS, key=lambda step: self.solve(shift, step).likelihood)
        return float(shift), float(turn)

    def solve(self, shift: float, turn: float) -> _Solution:
        """Returns the solution at given steps per axis."""
        n = len(self.lever)
        steps = np.repeat([shift, turn], 3)
        lever = self.lever * steps
        covariance = np.einsum("iak,jbk,ij->iajb", lever, lever, self.shared)
        covariance[np.arange(n), :, np.arange(n), :] += self.noise
        factor = cho_factor(covariance.reshape(3 * n, 3 * n), lower=True)
        precision = cho_solve(factor, np.eye(3 * n))
        seen = precision @ self.nests
        core = cho_factor(self.nests.T @ seen, lower=True)
        inverse = precision - seen @ cho_solve(core, seen.T)
        weights = inverse @ self.values
        log_det = np.log(np.diagonal(factor[0])).sum() + np.log(np.diagonal(core[0])).sum()
        likelihood = -float(log_det) - 0.5 * float(self.values @ weights)
        return _Solution(steps=steps, inverse=inverse, weights=weights, likelihood=likelihood)


def _at_moments(
    problem: _Problem, solution: _Solution, shots: Array, moment: Array
) -> tuple[Array, Array]:
    """Mean (k, 6) and covariance (k, 6, 6) of the walk at moments (k,), given shots (n,)."""
    shared = _shared_time(moment, shots)
    lever = problem.lever * solution.steps  # (n, 3, 6)
    # Cross covariance of component c at a moment with number a of shot i.
    cross = np.einsum("ki,iac,c->kcia", shared, lever, solution.steps)
    cross = cross.reshape(len(moment), 6, -1)
    own = np.abs(moment)[:, None, None] * np.diag(solution.steps**2)
    covariance = own - cross @ solution.inverse @ np.swapaxes(cross, 1, 2)
    return cross @ solution.weights, covariance


def _shared_time(first: Array, second: Array) -> Array:
    """Time (n, m) that two walks from moment 0 have in common; before 0 they run backwards."""
    smaller = np.minimum(np.abs(first)[:, None], np.abs(second)[None, :])
    same_side = np.sign(first)[:, None] * np.sign(second)[None, :] > 0.0
    shared: Array = np.where(same_side, smaller, 0.0)
    return shared


def _levers(arm: Array, turns: bool) -> Array:
    """Returns the effect of shift and turn about the centre on ``arm`` (n, 3): (n, 3, 6)."""
    lever = np.zeros((len(arm), 3, 6))
    lever[:, :, :3] = np.eye(3)
    if turns:
        lever[:, :, 3:] = -skew(arm)
    return lever


def remove_walk(
    measurements: MeasurementSet, shots: MonumentShots, moment: Array
) -> tuple[MeasurementSet, tuple[FrameWalk, ...]]:
    """Returns the rows in the frame of the first shot, and how the frame of each set-up moved.

    The remaining uncertainty of the walk is added to the covariance of each row; that it is common
    to neighbouring rows is not kept.

    Args:
        measurements: Rows of one run, in the frame of the shots.
        shots: Of monuments.
        moment: (n,) of the rows, in the unit of the shots.

    Raises:
        ShapeError: A set-up with shots of which no nest was shot twice.
    """
    position, covariance = measurements.position.copy(), measurements.covariance.copy()
    rotation = measurements.rotation.copy()
    angular = measurements.rotation_covariance.copy()
    walks = []
    for station in np.unique(shots.station).tolist():
        rows = np.flatnonzero(measurements.station == station)
        if not len(rows):
            continue
        walk = estimate_walk(shots.take(shots.station == station), moment[rows])
        lever = _levers(position[rows] - walk.centre, True)
        position[rows] -= (lever @ walk.mean[:, :, None])[:, :, 0]
        covariance[rows] += lever @ walk.covariance @ np.swapaxes(lever, 1, 2)
        rotation[rows] = matrix_from_rotation_vector(-walk.mean[:, 3:]) @ rotation[rows]
        angular[rows] += walk.covariance[:, 3:, 3:]
        walks.append(walk)
    moved = replace(
        measurements,
        position=position,
        covariance=covariance,
        rotation=rotation,
        rotation_covariance=angular,
    )
    return moved, tuple(walks)


def describe_walks(walks: Sequence[FrameWalk]) -> tuple[str, ...]:
    """Returns one sentence per set-up: the motion of its frame, and its covariance."""
    return tuple(map(_describe_walk, (walk for walk in walks if len(walk.mean))))


def _describe_walk(walk: FrameWalk) -> str:
    shift = float(np.linalg.norm(walk.mean[:, :3], axis=1).max())
    turn = float(np.linalg.norm(walk.mean[:, 3:], axis=1).max())
    known = float(np.sqrt(walk.covariance[:, :3, :3].trace(axis1=1, axis2=2).mean() / 3.0))
    few = "" if walk.nests >= FEWEST_NESTS else "; a turn needs 3 nests"
    return (
        f"monuments: {walk.shots} shots of {walk.nests} nests; the frame moved up to "
        f"{shift / UM:.1f} um and {turn * 1e6:.1f} urad, which was subtracted with an uncertainty "
        f"of {known / UM:.1f} um per axis{few}"
    )
