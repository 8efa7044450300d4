"""Thermal term: expansion of links and drift of joint zeros, by temperature or by time.

    state_i = T_i - 20 degC                with measured temperatures, of the arm or its joints
    state_i = 1 - exp(-(t - t_0) / lag)    with time alone: first-order warming to a steady state

    dd_i = (growth + growth_i) state_i d_i      da_i = (growth + growth_i) state_i a_i
    dq_i = zero_i state_i

``growth`` is common to all links: cast iron, steel and aluminium expand by 11e-6 to 23e-6 per
kelvin, a body that lags behind the thermometer by less. Lengths up to the tool point expand. A
posture without temperature and time takes the mean state of the calibration; ``unstated`` is its
deviation from that mean, in standard deviations of those rows, with mean zero and unit variance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Final, Literal, Self, TypeAlias

import numpy as np

from robotrue.calibration.evidence import PriorGroup
from robotrue.calibration.terms.term import ArmPostures, Effect, MeanTables, Term
from robotrue.core.arrays import Array
from robotrue.core.conditions import ArmConditions
from robotrue.core.document_decoder import decode
from robotrue.core.units import DEG, UM, ZERO_CELSIUS
from robotrue.errors import ArchiveError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import Sensitivity
from robotrue.robot.model import RobotModel, parameter_slice

Driver: TypeAlias = Literal["temperature", "time"]
REFERENCE: Final = 293.15
"""K at which the geometry of the arm is stated: 20 degC, as ISO 1 has it."""
GROWTH: Final = 17e-6
"""1/K, prior sd of the common expansion: the materials of arms, or a lagging body."""
GROWTH_APART: Final = 4e-6
"""1/K, prior sd of the difference of one link."""
ZERO: Final = 5e-6
"""rad/K, prior sd of a joint zero: a housing that warms on one side by a third of a kelvin."""
REST: Final = 1e-7
"""rad/K, sd of zeros for which the data show no drift."""
HOLD: Final = 0.5
"""Sd of the log scale of the zeros, where rows are few."""
RISE: Final = 10.0
"""K, prior temperature rise of an arm in a shift, where only the time is known."""
LAG: Final = 3600.0
"""s, prior time constant of warming."""
LAG_SD: Final = 0.7
"""Prior sd of its logarithm: a factor of two."""
LEAST_SPAN: Final[Mapping[Driver, float]] = {"temperature": 1.5, "time": 1800.0}
"""K and s, smallest span of the rows for this term."""
MARGIN: Final[Mapping[Driver, float]] = {"temperature": 1.0, "time": 3600.0}
"""K and s beyond the rows from which a stated value gets a warning."""
FEWEST_ROWS: Final = 12
BLIND: Final = 0.8
"""Share of the prior sd above which a zero counts as undetermined."""
HOUR: Final = 3600.0
MDEG: Final = 1e-3 * DEG


@dataclass(frozen=True, slots=True, kw_only=True)
class WarmState:
    """Thermal state of the arm at n postures.

    Attributes:
        state: (n, dof) K relative to 20 degC, or share of the travel.
        unsure: (n,) its sd where it is not stated.
        by_lag: (n, dof) derivative by the logarithm of the lag.
    """

    state: Array
    unsure: Array
    by_lag: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Thermal(Term):
    """Expansion of links and drift of joint zeros.

    Attributes:
        dof: Number of joints.
        driver: Quantity that determines the state.
        start: s, start of warming; 0 with temperatures.
        usual: (dof,) state of a posture without a stated one: the mean of the calibration.
        spread: sd of the state over the rows of the calibration; 0 if it is stated.
        span: (2,) lowest and highest temperature (K) or time (s) of those rows.
    """

    name: ClassVar[str] = "thermal"
    linear: ClassVar[bool] = False
    dof: int
    driver: Driver
    start: float
    usual: Array
    spread: float
    span: Array

    @property
    def parameters(self) -> tuple[str, ...]:
        """``growth, growth1 .., zero1 .., unstated``, and ``lag`` where time drives."""
        joints = range(1, self.dof + 1)
        names = ["growth", *(f"growth{i}" for i in joints), *(f"zero{i}" for i in joints)]
        return (*names, "unstated", *(["lag"] if self.driver == "time" else []))

    @property
    def unit(self) -> str:
        """Of growth and of zeros; the others have none."""
        return "1/K, rad/K" if self.driver == "temperature" else "1, rad"

    @property
    def _zeros(self) -> slice:
        return slice(self.dof + 1, 2 * self.dof + 1)

    def state_at(self, conditions: ArmConditions, values: Array) -> WarmState:
        """Returns the state of n postures, ``unstated`` included."""
        n = len(conditions)
        by_lag = np.zeros((n, self.dof))
        if self.driver == "temperature":
            state = np.broadcast_to(conditions.temperature, (n, self.dof)) - REFERENCE
        else:
            ratio = np.maximum(conditions.time - self.start, 0.0) / (LAG * np.exp(values[-1]))
            state = np.broadcast_to(-np.expm1(-ratio)[:, None], (n, self.dof))
            by_lag += np.nan_to_num(-ratio * np.exp(-ratio))[:, None]
        lacking = np.isnan(state)
        unsure = np.where(lacking.any(axis=1), self.spread, 0.0)
        usual = self.usual + self.spread * values[2 * self.dof + 1]
        return WarmState(state=np.where(lacking, usual, state), unsure=unsure, by_lag=by_lag)

    def _growth(self, values: Array) -> Array:
        """Growth (dof + 1,) per unit of state: of each link, and of the tool."""
        return np.append(values[0] + values[1 : self.dof + 1], values[0])

    def columns(self, robot: RobotModel, at: ArmPostures, by: Sensitivity, values: Array) -> Array:
        """Returns d(observed)/d(parameters), shape (n, m, k)."""
        warm = self.state_at(at.conditions, values)
        lengths = by.errors @ link_lengths(robot).T
        state = np.column_stack([warm.state, warm.state[:, -1]])[:, None, :]
        links = lengths * state
        whole = links.sum(axis=2, keepdims=True)
        zeros = by.drive * warm.state[:, None, :]
        growth = lengths * self._growth(values)
        slope = growth[:, :, :-1] + by.drive * values[self._zeros]
        slope[:, :, -1] += growth[:, :, -1]
        unstated = slope.sum(axis=2, keepdims=True) * warm.unsure[:, None, None]
        parts = [whole, links[:, :, :-1], zeros, unstated]
        if self.driver == "time":
            parts.append((slope * warm.by_lag[:, None, :]).sum(axis=2, keepdims=True))
        return np.concatenate(parts, axis=2)

    def effect(self, robot: RobotModel, at: ArmPostures, values: Array) -> Effect:
        """Returns the turn of the drives and the growth of the lengths."""
        state = self.state_at(at.conditions, values).state
        growth = np.column_stack([state, state[:, -1]]) * self._growth(values)
        return Effect(
            drive_shift=state * values[self._zeros], error_shift=growth @ link_lengths(robot)
        )

    def groups(self, *, few: bool) -> Sequence[PriorGroup]:
        """Returns growth by the physics of materials, zeros with a learned scale."""
        unit = 1.0 if self.driver == "temperature" else RISE
        zeros = np.arange(self.dof) + self.dof + 1
        rest, hold = (ZERO * unit, HOLD) if few else (REST * unit, 0.0)
        out = [
            PriorGroup(name="thermal/growth", columns=np.zeros(1, np.int64), sd=GROWTH * unit),
            PriorGroup(
                name="thermal/links", columns=np.arange(self.dof) + 1, sd=GROWTH_APART * unit
            ),
            PriorGroup(name="thermal/zeros", columns=zeros, sd=ZERO * unit, rest=rest, hold=hold),
            PriorGroup(name="thermal/unstated", columns=zeros[-1:] + 1, sd=1.0),
        ]
        if self.driver == "time":
            out.append(PriorGroup(name="thermal/lag", columns=zeros[-1:] + 2, sd=LAG_SD))
        return out

    def under(self, conditions: ArmConditions) -> Thermal:
        """Returns the term at a stated temperature or time, where a posture states none."""
        at = self.state_at(conditions.spread(1), np.zeros(self.size))
        return self if at.unsure.any() else replace(self, usual=at.state[0], spread=0.0)

    def remark(self, conditions: ArmConditions) -> str:
        """Returns what is assumed if nothing is stated, or a warning of values beyond the rows."""
        kelvin = self.driver == "temperature"
        stated = float(conditions.temperature.mean() if kelvin else conditions.time[0])
        low, high = self.span
        if np.isnan(stated):
            mean = f"{self.usual.mean() + REFERENCE - ZERO_CELSIUS:.1f} degC, " if kelvin else ""
            option = "--temperature" if kelvin else "--time"
            return f"for the mean of the calibration, {mean}uncertain; {option} states another"
        if not (stated < low - MARGIN[self.driver] or stated > high + MARGIN[self.driver]):
            return ""
        shift, scale, unit = (ZERO_CELSIUS, 1.0, "degC") if kelvin else (self.start, HOUR, "h")
        at, first, last = ((value - shift) / scale for value in (stated, low, high))
        return (
            f"{at:.1f} {unit} is beyond the {first:.1f} to {last:.1f} {unit} of the calibration: "
            "warmth is extrapolated"
        )

    def in_tables(self, tables: MeanTables, values: Array) -> MeanTables:
        """Returns the tables of the arm in its usual state."""
        robot, errors = tables.robot, np.array(tables.robot.errors)
        usual = self.usual + self.spread * values[2 * self.dof + 1]
        errors += (np.append(usual, usual[-1]) * self._growth(values)) @ link_lengths(robot)
        turn = robot.joint_map @ (usual * values[self._zeros])
        errors[parameter_slice(self.dof, "theta")] += turn
        return replace(tables, robot=robot.with_errors(errors))

    @classmethod
    def begin(cls, robot: RobotModel, measurements: MeasurementSet, few: bool) -> Self | None:
        """Returns the term where all rows state a temperature that varies, or else a time."""
        stated = measurements.conditions
        measured: dict[Driver, Array] = {
            "temperature": stated.temperature.mean(axis=1),
            "time": stated.time,
        }
        for driver, values in measured.items():
            if len(values) >= FEWEST_ROWS and np.ptp(values) >= LEAST_SPAN[driver]:
                span = np.array([values.min(), values.max()])
                term = cls(
                    dof=robot.dof,
                    driver=driver,
                    start=float(span[0]) if driver == "time" else 0.0,
                    usual=np.zeros(robot.dof),
                    spread=0.0,
                    span=span,
                )
                state = term.state_at(stated, np.zeros(term.size)).state
                spread = float(state.mean(axis=1).std())
                return replace(term, usual=state.mean(axis=0), spread=spread)
        return None

    def sentences(self, values: Array, variance: Array) -> Sequence[str]:
        """Returns what was learned, and for which temperatures or times it holds."""
        sd, kelvin = np.sqrt(variance), self.driver == "temperature"
        per = "per K" if kelvin else "when warm"
        zero, zero_sd = values[self._zeros] / MDEG, sd[self._zeros] / MDEG
        most = int(np.abs(zero).argmax())
        low, high = self.span - ZERO_CELSIUS if kelvin else (self.span - self.start) / HOUR
        sentence = (
            f"warmth: links grow by {values[0] / UM:.1f} +- {sd[0] / UM:.1f} um/m {per}, joint "
            f"zeros turn by up to {abs(zero[most]):.2f} +- {zero_sd[most]:.2f} mdeg {per} (joint "
            f"{most + 1}); estimated from {low:.1f} to {high:.1f} "
            f"{'degC' if kelvin else 'h after the start'}, elsewhere extrapolated"
        )
        if not kelvin:
            sentence += f"; two thirds of the way after {LAG * np.exp(values[-1]) / HOUR:.1f} h"
        prior = (ZERO if kelvin else ZERO * RISE) / MDEG
        blind = np.flatnonzero((zero_sd > 0.0) & (zero_sd > BLIND * prior)) + 1
        if not len(blind):
            return (sentence,)
        which = ", ".join(map(str, blind))
        return sentence, f"warmth: the rows do not determine the zero rotation of joints {which}"

    def arrays(self, values: Array) -> Mapping[str, Array]:
        """Returns parameters, usual state and span."""
        return {"coefficients": values, "usual": self.usual, "span": self.span}

    def document(self) -> Mapping[str, object]:
        """Returns what drives the state, from when, and its spread."""
        return {"driver": self.driver, "start": self.start, "spread": self.spread}

    @classmethod
    def restore(
        cls, robot: RobotModel, document: Mapping[str, object], arrays: Mapping[str, Array]
    ) -> tuple[Self, Array]:
        """Returns the term and its parameters.

        Raises:
            ArchiveError: Parts that do not belong to the robot.
        """
        term = cls(
            dof=robot.dof,
            driver="time" if document["driver"] == "time" else "temperature",
            start=decode(float, document["start"], key="thermal.start"),
            usual=arrays["usual"],
            spread=decode(float, document["spread"], key="thermal.spread"),
            span=arrays["span"],
        )
        shapes = arrays["coefficients"].shape, term.usual.shape, term.span.shape
        intact = document["driver"] == term.driver and 0.0 <= term.spread < np.inf
        if shapes != ((term.size,), (robot.dof,), (2,)) or not intact:
            raise ArchiveError(f"the thermal term is damaged: arrays of {shapes}.")
        return term, arrays["coefficients"]


def link_lengths(robot: RobotModel) -> Array:
    """Returns how the error vector answers to a strain of each link and of the tool.

    (dof + 1, 9 dof + 12) m.
    """
    dof = robot.dof
    out = np.zeros((dof + 1, len(robot.errors)))
    out[:dof, parameter_slice(dof, "d")] = np.diag(robot.d)
    out[:dof, parameter_slice(dof, "a")] = np.diag(robot.a)
    T = robot.T_flange_tool
    out[dof, parameter_slice(dof, "tool")] = np.append(T[:3, :3].T @ T[:3, 3], np.zeros(3))
    return out
