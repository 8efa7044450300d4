"""New measurements as linear rows over the columns of a belief, and the one way to a posterior.

    z = measured - h(w0) + H w0 = H w + noise

The posture, the tracker frames and the nuisances of the new set are linearised at the belief's
mean; conditioning the prior on them and linearising again at the new mean is Gauss-Newton. Tracker
set-ups that the belief does not contain, and further reflectors, add columns.

Updates, transfers and touches differ in their rows, their robust weights and where they stop. A row
is weighed by its distance from the belief's prediction (before conditioning), or from the
prediction by all other rows (:func:`left_out_lengths`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.belief import Belief, condition, with_nuisances
from robotrue.calibration.observations import (
    LinearRows,
    Observation,
    linear_rows,
    observations_of,
    take_to_base,
)
from robotrue.calibration.parameters import ParameterLayout, State, retract, start_state
from robotrue.calibration.settings import FitSettings
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.robust import Loss, weights
from robotrue.core.units import MM
from robotrue.errors import ConvergenceError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel

NUISANCE_SD: Final = 0.1
"""m and rad, about a start in closed form: far looser than any data."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NewRows:
    """A set to be added, and the nuisances it brings.

    Attributes:
        robot: Nominal arm.
        observations: In base (known set-ups) and in new tracker frames.
        layout: Of robot errors and nuisances.
        T_tracker_base: New set-ups, their present frames.
        T_flange_target: Further reflectors, their present positions.
        count: n.
    """

    robot: RobotModel
    observations: tuple[Observation, ...]
    layout: ParameterLayout
    T_tracker_base: Mapping[int, Array]
    T_flange_target: Mapping[int, Array]
    count: int

    @property
    def nuisances(self) -> int:
        """Number of nuisance columns."""
        return self.layout.size - self.layout.robot_size

    def prior(self, belief: Belief) -> Belief:
        """Returns a belief with the nuisances of the rows at its end, of which nothing is known."""
        return with_nuisances(belief, np.full(self.nuisances, NUISANCE_SD))

    def move(self, step: Array) -> NewRows:
        """Returns the rows with their nuisances moved by ``step`` (nuisances,)."""
        whole = np.concatenate([np.zeros(self.layout.robot_size), step])
        state = retract(self.layout, self._state(self.robot), whole)
        return replace(
            self, T_tracker_base=state.T_tracker_base, T_flange_target=state.T_flange_target
        )

    def _state(self, robot: RobotModel) -> State:
        return State(
            robot=robot,
            T_tracker_base=self.T_tracker_base,
            T_flange_target=self.T_flange_target,
        )

    def pieces(self, belief: Belief, chosen: BoolArray | None = None) -> list[LinearRows]:
        """Returns the rows (of a mask, or all), linearised at the belief's mean."""
        size, whole, terms = self.layout.robot_size, self.layout.size, len(belief.values)
        order = np.r_[:size, whole : whole + terms, size:whole]
        about = np.concatenate([belief.errors, np.zeros(self.nuisances)])
        state = self._state(belief.actual)
        return [
            replace(rows, columns=np.take(rows.columns, order, axis=2))
            for rows in linear_rows(
                self.observations, self.layout, state, about, belief.terms, belief.values, chosen
            )
        ]


def new_rows(
    belief: Belief, measurements: MeasurementSet, settings: FitSettings, *, fresh: bool
) -> NewRows:
    """Returns the measurements ready to be added to a belief.

    Args:
        belief: Prior of the arm.
        measurements: In base or in tracker frames.
        settings: Payload, sd of orientations.
        fresh: True: every tracker set-up is a new one, whatever its number.

    Raises:
        ObservabilityError: A new set-up with fewer than 3 points, or all on one line.
        ImplausibleDataError: Points that are impossible for this robot.
    """
    robot = belief.actual
    measurements = _with_tool_axes(robot, measurements)
    known = np.zeros(len(measurements), dtype=bool)
    if measurements.frame == "tracker" and not fresh:
        known = np.isin(measurements.station, list(belief.T_tracker_base))
    stations: dict[int, Array] = {}
    targets: dict[int, Array] = {}
    sizes: dict[int, int] = {}
    places: set[int] = set()
    observations: list[Observation] = []
    for mine in (known, ~known):
        rows = np.flatnonzero(mine)
        if not len(rows):
            continue
        part = measurements.subset(rows)
        if mine is known:
            part = take_to_base(part, belief.T_tracker_base)
        _, layout, start = start_state(robot, part)
        stations |= dict(start.T_tracker_base)
        targets |= dict(start.T_flange_target)
        sizes |= dict(layout.targets)
        places |= set(layout.places)
        for o in observations_of(
            belief.robot,
            part,
            settings.payload,
            repeatability=belief.repeatability,
            rotation_sd=settings.rotation_sd,
        ):
            observations.append(replace(o, rows=rows[o.rows]))
    return NewRows(
        robot=belief.robot,
        observations=tuple(observations),
        layout=ParameterLayout(
            dof=robot.dof,
            stations=tuple(sorted(stations)),
            targets=tuple(sorted(sizes.items())),
            places=tuple(sorted(places)),
        ),
        T_tracker_base=stations,
        T_flange_target=targets,
        count=len(measurements),
    )


def whiten(pieces: Sequence[LinearRows], noise: Array, weights: Array) -> tuple[Array, Array]:
    """Returns whitened columns (m, p) and values (m,) of the rows with weight.

    Args:
        pieces: From :meth:`NewRows.pieces`.
        noise: (2,) white variance of lengths (m^2) and angles (rad^2).
        weights: (n,) robust weight of every row of the set.
    """
    columns, values = [], []
    for piece in pieces:
        u = weights[piece.rows]
        kept = u > 0.0
        inverse_lower = (
            np.linalg.inv(np.linalg.cholesky(piece.total(noise)[kept]))
            * np.sqrt(u[kept])[:, None, None]
        )
        columns.append((inverse_lower @ piece.columns[kept]).reshape(-1, piece.columns.shape[2]))
        values.append((inverse_lower @ piece.values[kept][:, :, None]).reshape(-1))
    return np.concatenate(columns), np.concatenate(values)


def _with_tool_axes(robot: RobotModel, measurements: MeasurementSet) -> MeasurementSet:
    """Returns the set with orientations of the robot's tool, for any mounting of its target.

    A 6-D target that was mounted again may be turned by any angle; the constant part of the turn
    contains no information about the arm.
    """
    posed = measurements.has_rotation & (measurements.target == 0)
    if not posed.any():
        return measurements
    turned, _, _ = start_state(robot, measurements)
    turn = robot.T_flange_tool[:3, :3].T @ turned.T_flange_tool[:3, :3]
    rotation = measurements.rotation.copy()
    rotation[posed] = rotation[posed] @ turn.T
    return replace(measurements, rotation=rotation)


LINEARISATIONS: Final = 3
"""Steps that take a posterior near its prior to rest."""
TO_AND_FRO: Final = -0.5
"""Ratio of a step to the one before below which steps jump over their goal, and are shortened."""


def condition_on_rows(
    prior: Belief,
    rows: NewRows,
    noise: Array,
    row_weights: Array,
    *,
    start: Belief | None = None,
    steps: int = LINEARISATIONS,
    still: float = 0.0,
) -> tuple[Belief, NewRows]:
    """Returns the posterior of the rows, linearised at its own mean, and the rows moved there.

    Args:
        prior: With the nuisances of the rows at its end.
        rows: The rows.
        noise: (2,) white variance of lengths and angles.
        row_weights: (n,) robust weights.
        start: Where the mean already is; one linearisation is then enough.
        steps: Most linearisations.
        still: m and rad; nuisances that move by less are at rest. Zero: all steps are taken.

    Raises:
        ConvergenceError: Nuisances that still move by more than ``still`` after all steps.
    """
    at, size = (prior if start is None else start), 0.0
    share, before = 1.0, np.zeros(0)
    for _ in range(steps if start is None else 1):
        columns, values = whiten(rows.pieces(at), noise, row_weights)
        found = condition(prior, columns, values)
        step = found.mean[found.end :]
        size = float(np.abs(step).max(initial=0.0))
        if size < still:
            return found, rows.move(step)
        back = float(step @ before / (before @ before)) if before.any() else 0.0
        if share < 1.0 or back < TO_AND_FRO:  # Aitken's rule
            share = min(share / (1.0 - min(back, 0.5)), 1.0)
        before = step
        at = replace(found, mean=(1.0 - share) * at.mean + share * found.mean)
        rows = rows.move(share * step)
    if still > 0.0:
        raise ConvergenceError(
            f"the frames still move by {size / MM:.3g} mm (or mrad) after {steps} linearisations.",
            hint="give start frames nearer to the parts, or touch more points.",
        )
    return at, rows


def weigh_innovations(
    belief: Belief,
    pieces: Sequence[LinearRows],
    noise: Array,
    count: int,
    loss: Loss,
    inflation: float,
) -> Array:
    """Returns the robust weight (n,) of rows by their distance from the belief's prediction."""
    out = np.ones(count)
    for piece in pieces:
        n, m, p = piece.columns.shape
        half = (piece.columns.reshape(n * m, p) @ belief.root.T).reshape(n, m, -1)
        spread = half @ np.swapaxes(half, 1, 2)
        total = inflation * (spread + piece.total(noise))
        off = piece.values - piece.columns @ belief.mean
        solved = np.linalg.solve(total, off[:, :, None])[:, :, 0]
        length = np.sqrt(np.maximum((off * solved).sum(axis=1), 0.0))
        out[piece.rows] = weights(length, m, loss)
    return out


def left_out_lengths(
    total: Array, offset: Array, blocks: Sequence[IntArray], plain: Array
) -> Array:
    """Returns the whitened length (b,) of each block of numbers, predicted from all others.

    With P the inverse of the covariance of all numbers, ``e = P_bb^-1 (P y)_b`` has the covariance
    ``P_bb^-1`` (Rasmussen and Williams 2006, eq. 5.10-5.12, in blocks).

    Args:
        total: (m, m) covariance of all numbers, noise over weight included.
        offset: (m,) y, measured minus expected.
        blocks: Numbers of each block.
        plain: (m, m) what full weight would take from the noise in ``total``: a block without
            weight is compared as one that had full weight.
    """
    precision = np.linalg.inv(total)
    force = precision @ offset
    out = np.empty(len(blocks))
    for i, mine in enumerate(blocks):
        own = np.linalg.inv(precision[np.ix_(mine, mine)])
        off = own @ force[mine]
        own = own + plain[np.ix_(mine, mine)]
        out[i] = np.sqrt(max(float(off @ np.linalg.solve(own, off)), 0.0))
    return out
