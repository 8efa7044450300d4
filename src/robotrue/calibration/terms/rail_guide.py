"""Rail term: scale, direction and straightness of a rail, and rotations of its carriage.

With x = (e - low) / (high - low) along the travel of the rows, the base of the arm moves by

    shift_c = sum_k  A_ck b_k(x)     turn_c = sum_k  B_ck b_k(x)     c: along, two across
    b_0 = x - 1/2     b_k = cos((k + 1) pi x), k = 1..5

relative to the rail of the cell, in axes along and across the rail. ``A_c0`` is the scale of the
rail (along) and its direction (across); the cosines are straightness and pitch of the rack. The
turns are roll, pitch and yaw of the carriage, about the origin of the base. The shortest cosine has
half waves of a sixth of the travel. Beyond the travel the cosines are constant, and their variation
along the travel becomes uncertainty. A posture without a stated position on the rail takes the mean
over the travel, with its spread as uncertainty.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Final, Self

import numpy as np

from robotrue.calibration.evidence import PriorGroup
from robotrue.calibration.terms.term import (
    REST_SHIFT,
    REST_TURN,
    ArmPostures,
    Effect,
    MeanTables,
    Term,
)
from robotrue.core.arrays import Array
from robotrue.core.conditions import ArmConditions
from robotrue.core.document_decoder import decode
from robotrue.core.units import MM, UM
from robotrue.errors import ArchiveError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import Sensitivity
from robotrue.robot.model import RobotModel, parameter_slice

WAVES: Final = 6
"""Functions of the travel for each of six motions: a slope and five cosines."""
SCALE: Final = 3e-4
"""Prior sd of the scale of rack and gear."""
DIRECTION: Final = 2e-3
"""rad, prior sd of the stated direction, across the rail."""
STRAIGHT: Final = 2e-4
"""m, prior sd of the longest cosine; the k-th has that over k^2."""
TURN: Final = 1e-4
"""rad, the same of the turns of the carriage, its slope too."""
HOLD: Final = 0.5
"""Sd of the log scales, where rows are few."""
LEAST_TRAVEL: Final = 0.2
"""m, smallest span of the rows for this term."""
FEWEST_ROWS: Final = 20
MOTIONS: Final = ("along", "across", "up", "roll", "pitch", "yaw")
"""The second axis across is up for a level rail."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RailGuide(Term):
    """Errors of a rail; parameters motion by motion, function by function.

    Attributes:
        number: Of the external axis, 1 to 6.
        direction: (3,) unit vector in base.
        low: m, travel that the rows cover.
        high: m.
        stated: m, position of postures that state none; NaN: unknown.
    """

    name: ClassVar[str] = "rail"
    number: int
    direction: Array
    low: float
    high: float
    stated: float = np.nan

    @property
    def parameters(self) -> tuple[str, ...]:
        """``rail_along0 ..``."""
        return tuple(f"rail_{motion}{k}" for motion in MOTIONS for k in range(WAVES))

    @property
    def unit(self) -> str:
        """Of shifts and of turns."""
        return "m, rad"

    @property
    def _axes(self) -> Array:
        """Columns (6, 6): shifts and turns along, across and up, in the base group."""
        helper = np.eye(3)[2] if abs(self.direction[2]) < 0.9 else np.eye(3)[0]
        across = np.cross(helper, self.direction)
        across /= np.linalg.norm(across)
        frame = np.column_stack([self.direction, across, np.cross(self.direction, across)])
        return np.kron(np.eye(2), frame)

    def waves(self, conditions: ArmConditions) -> Array:
        """Returns b (n, WAVES) at the places of n postures; means where none is stated."""
        place = conditions.external[:, self.number - 1]
        out = _functions((np.where(np.isnan(place), self.stated, place) - self.low) / self.travel)
        out[np.isnan(out[:, 0])] = _functions(_GRID).mean(axis=0)
        return out

    @property
    def travel(self) -> float:
        """Travel of the rows in m, from the lowest to the highest position."""
        return self.high - self.low

    def columns(self, robot: RobotModel, at: ArmPostures, by: Sensitivity, values: Array) -> Array:
        """Returns d(observed)/d(parameters), shape (n, m, k)."""
        moved = by.errors[:, :, parameter_slice(robot.dof, "base")] @ self._axes
        waves = self.waves(at.conditions)
        return (moved[:, :, :, None] * waves[:, None, None, :]).reshape(*moved.shape[:2], -1)

    def effect(self, robot: RobotModel, at: ArmPostures, values: Array) -> Effect:
        """Returns the motion of the base, and its variance where the rail position is not known."""
        shape = values.reshape(6, WAVES)
        errors = np.zeros((len(at), len(robot.errors)))
        base = parameter_slice(robot.dof, "base")
        errors[:, base] = self.waves(at.conditions) @ shape.T @ self._axes.T
        place = at.conditions.external[:, self.number - 1]
        x = (np.where(np.isnan(place), self.stated, place) - self.low) / self.travel
        beyond = WAVES * np.nan_to_num(np.maximum(np.maximum(-x, x - 1.0), 0.0))
        uncarried = -np.expm1(-(beyond**2)) * _spread(robot, shape[:, 1:], _functions(_GRID)[:, 1:])
        uncarried[np.isnan(x)] = _spread(robot, shape, _functions(_GRID))
        return Effect(error_shift=errors, uncarried=uncarried)

    def groups(self, *, few: bool) -> Sequence[PriorGroup]:
        """Returns the slopes by what a cell states, cosines and turns with learned scales."""
        slopes = WAVES * np.arange(3)
        falling = 1.0 / np.arange(1, WAVES) ** 2
        cosines = (slopes[:, None] + np.arange(1, WAVES)).ravel()
        turns = 3 * WAVES + np.arange(3 * WAVES)
        turning = np.tile(np.concatenate([[1.0], falling]), 3)
        hold = HOLD if few else 0.0
        return [
            PriorGroup(
                name="rail/slope",
                columns=slopes,
                sd=self.travel,
                shape=np.array([SCALE, DIRECTION, DIRECTION]),
            ),
            PriorGroup(
                name="rail/straight",
                columns=cosines,
                sd=STRAIGHT,
                rest=STRAIGHT if few else REST_SHIFT,
                shape=np.tile(falling, 3),
                hold=hold,
            ),
            PriorGroup(
                name="rail/turn",
                columns=turns,
                sd=TURN,
                rest=TURN if few else REST_TURN,
                shape=turning,
                hold=hold,
            ),
        ]

    def under(self, conditions: ArmConditions) -> RailGuide:
        """Returns the term with the arm at a stated place of its rail."""
        place = float(conditions.external[0, self.number - 1])
        return self if np.isnan(place) else replace(self, stated=place)

    def lacking(self, conditions: ArmConditions) -> str:
        """Returns what a program must state: where the arm is on its rail."""
        places = conditions.external[:, self.number - 1]
        count = 0 if np.isfinite(self.stated) else int(np.isnan(places).sum())
        if not count:
            return ""
        return (
            f"the model has a rail E{self.number}, and {count} of {len(places)} targets do not "
            "state where the arm is on it"
        )

    def in_tables(self, tables: MeanTables, values: Array) -> MeanTables | None:
        """Returns the tables of the arm at a stated place; elsewhere no tables hold."""
        if np.isnan(self.stated):
            return None
        robot, errors = tables.robot, np.array(tables.robot.errors)
        waves = _functions((np.array([self.stated]) - self.low) / self.travel)
        moved = (waves @ values.reshape(6, WAVES).T @ self._axes.T)[0]
        errors[parameter_slice(robot.dof, "base")] += moved
        return replace(tables, robot=robot.with_errors(errors))

    @classmethod
    def begin(cls, robot: RobotModel, measurements: MeasurementSet, few: bool) -> Self | None:
        """Returns the term where the rows know their rail and were taken along it."""
        rail = measurements.rail
        if rail is None or len(measurements) < FEWEST_ROWS:
            return None
        places = measurements.external[:, rail.number - 1]
        if not np.ptp(places) >= LEAST_TRAVEL:
            return None
        return cls(
            number=rail.number,
            direction=rail.direction,
            low=float(places.min()),
            high=float(places.max()),
        )

    def sentences(self, values: Array, variance: Array) -> Sequence[str]:
        """Returns scale, direction and straightness, and the travel they hold for."""
        shape, sd = values.reshape(6, WAVES), np.sqrt(variance).reshape(6, WAVES)
        slope, slope_sd = shape[:3, 0] / self.travel, sd[:3, 0] / self.travel
        bow = _functions(_GRID)[:, 1:] @ shape[1:3, 1:].T
        turn = _functions(_GRID) @ shape[3:].T
        return (
            f"rail E{self.number}: scale {slope[0] / UM:+.0f} +- {slope_sd[0] / UM:.0f} um/m, "
            f"direction {slope[1] / MM:+.2f} +- {slope_sd[1] / MM:.2f} and {slope[2] / MM:+.2f} +- "
            f"{slope_sd[2] / MM:.2f} mm/m across, straight within "
            f"{np.ptp(bow, axis=0).max() / MM:.2f} mm, carriage turns within "
            f"{np.ptp(turn, axis=0).max() / MM:.2f} mrad; learned from {self.low / MM:.0f} to "
            f"{self.high / MM:.0f} mm",
        )

    def arrays(self, values: Array) -> Mapping[str, Array]:
        """Returns parameters and direction."""
        return {"coefficients": values, "direction": self.direction}

    def document(self) -> Mapping[str, object]:
        """Returns which axis it is, its travel, and the place that is stated, if any."""
        known = {"number": self.number, "low": self.low, "high": self.high}
        return known if np.isnan(self.stated) else {**known, "stated": self.stated}

    @classmethod
    def restore(
        cls, robot: RobotModel, document: Mapping[str, object], arrays: Mapping[str, Array]
    ) -> tuple[Self, Array]:
        """Returns the term and its parameters.

        Raises:
            ArchiveError: Invalid parts.
        """
        term = cls(
            number=decode(int, document["number"], key="rail.number"),
            direction=arrays["direction"],
            low=decode(float, document["low"], key="rail.low"),
            high=decode(float, document["high"], key="rail.high"),
            stated=decode(float, document.get("stated", np.nan), key="rail.stated"),
        )
        shapes = arrays["coefficients"].shape, term.direction.shape
        if shapes != ((6 * WAVES,), (3,)) or not (1 <= term.number <= 6 and term.travel > 0.0):
            raise ArchiveError(f"the rail of the model is damaged: arrays of {shapes}.")
        return term, arrays["coefficients"]


def _spread(robot: RobotModel, shape: Array, waves: Array) -> float:
    """Returns the variance per axis, m^2, of the tool point over places along the travel.

    Args:
        robot: For its reach, the lever of the turns.
        shape: (6, k) shifts and turns.
        waves: (p, k) functions at the places.
    """
    variance = (waves @ shape.T).var(axis=0)
    return float(variance[:3].sum() + robot.reach**2 * variance[3:].sum()) / 3.0


def _functions(x: Array) -> Array:
    """Returns b (n, WAVES) at x (n,) along the travel; the slope continues beyond its ends."""
    inside = np.clip(x, 0.0, 1.0)[:, None]
    cosines = np.cos(np.pi * np.arange(2, WAVES + 1) * inside)
    return np.column_stack([x - 0.5, cosines])


_GRID: Final = np.linspace(0.0, 1.0, 101)
"""Places along the travel."""
