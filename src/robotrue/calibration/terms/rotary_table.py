"""Table term: axis, reading and run-out of the rotary axes that carry a part.

The part is given where every axis is ``at``. With phi = e - at, an axis moves what it carries by
its stated rotation and, in axes across and along it, about the stated point on it, by

    turn  = (1 - R(phi)) tilt + scale phi along + sum_k (A_k c_k + B_k s_k)
    shift = (1 - R(phi)) offset + sum_k (C_k c_k + D_k s_k)
    c_k = cos k e - cos k at     s_k = sin k e - sin k at     k = 1, 2

``tilt`` and ``offset`` are those of the axis across its stated place, the sums are run-out, wobble
and the error of the reading over a turn. All is zero at ``at``: the zero of the reading, a place
along the axis and a turn about it belong to the frame of the part. An axis on another one is moved
with it.

The part moves, the arm does not: a tool on the part is off by the motion of its base the other way.
Postures that state no angle have nothing to do with the table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
from robotrue.core.arrays import Array, BoolArray
from robotrue.core.conditions import ArmConditions
from robotrue.core.document_decoder import decode
from robotrue.core.rotations import skew
from robotrue.core.units import DEG, UM
from robotrue.errors import ArchiveError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.program.external_axes import ExternalAxis, move_frames, plain_key
from robotrue.robot.forward import Sensitivity
from robotrue.robot.model import RobotModel, parameter_slice

HARMONICS: Final = 2
TILT: Final = 2e-3
"""rad, prior sd of the axis across its stated direction."""
OFFSET: Final = 2e-3
"""m, prior sd of the axis across its stated place."""
SCALE: Final = 1e-4
"""Prior sd of the scale of the reading."""
RUN_OUT: Final = 3e-5
WOBBLE: Final = 3e-5
"""m and rad, prior sd of the first harmonics; the k-th has that over k^2."""
AXIS: Final = ("tilt1", "tilt2", "offset1", "offset2", "scale")
MOTIONS: Final = ("across1", "across2", "along", "turn1", "turn2", "turn")
SIZE: Final = len(AXIS) + 2 * HARMONICS * len(MOTIONS)
"""Parameters of an axis: the first five, then the motions, each as cosines and sines."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RotaryTable(Term):
    """Errors of the rotary axes of a positioner; parameters axis by axis, from the floor up.

    Attributes:
        axes: As the cell states them.
        low: (a,) rad, angles that the rows cover.
        high: (a,) rad.
        scatter: m, sd per axis of a point on the table beyond the instrument.
    """

    name: ClassVar[str] = "table"
    axes: tuple[ExternalAxis, ...]
    low: Array
    high: Array
    scatter: float = 0.0

    @property
    def parameters(self) -> tuple[str, ...]:
        """``table2_tilt1 ..``."""
        waves = [f"{m}_{f}{k + 1}" for m in MOTIONS for k in range(HARMONICS) for f in ("c", "s")]
        return tuple(f"table{axis.number}_{p}" for axis in self.axes for p in (*AXIS, *waves))

    @property
    def unit(self) -> str:
        """Of shifts and of turns."""
        return "m, rad"

    def twists(self, external: Array) -> Array:
        """Returns the motion (n, 6, k) of the part beyond the stated one, by the parameters.

        Shift, then turn, about the origin of the base and in its axes.

        Args:
            external: (n, 6) rad, where the axes are; NaN of one that does not carry the part.
        """
        out = []
        T = np.tile(np.eye(4), (len(external), 1, 1))
        for axis in self.axes:
            angle = external[:, axis.number - 1]
            angle = np.where(np.isnan(angle), axis.at, angle)
            local = _across(axis) @ _functions(angle, axis.at).reshape(-1, 2, 3, SIZE)
            turn = local[:, 1]
            shift = local[:, 0] + skew(_point(axis)[None])[0] @ turn
            R = T[:, :3, :3]
            turn = R @ turn
            out.append(np.concatenate([R @ shift + skew(T[:, :3, 3]) @ turn, turn], axis=1))
            step = np.tile(np.eye(4), (len(external), 1, 1))
            move_frames(step, axis, angle)
            T = T @ step
        return np.concatenate(out, axis=2)

    def columns(self, robot: RobotModel, at: ArmPostures, by: Sensitivity, values: Array) -> Array:
        """Returns d(observed)/d(parameters), shape (n, m, k)."""
        base = by.errors[:, :, parameter_slice(robot.dof, "base")]
        return np.asarray(-base @ self.twists(at.conditions.external))

    def effect(self, robot: RobotModel, at: ArmPostures, values: Array) -> Effect:
        """Returns the motion of the base relative to the part."""
        errors = np.zeros((len(at), len(robot.errors)))
        external = at.conditions.external
        errors[:, parameter_slice(robot.dof, "base")] = -self.twists(external) @ values
        carried = self._is_carried(external)
        return Effect(error_shift=errors, uncarried=np.where(carried, self.scatter**2, 0.0))

    def _is_carried(self, external: Array) -> BoolArray:
        """Returns which postures (n,) are on the table."""
        numbers = [axis.number - 1 for axis in self.axes]
        return np.asarray(np.isfinite(external[:, numbers]).any(axis=1))

    def groups(self, *, few: bool) -> Sequence[PriorGroup]:
        """Returns the place of the axes by what a cell states, harmonics with learned scales."""
        waves = np.arange(SIZE - len(AXIS)).reshape(2, -1) + len(AXIS)
        falling = np.tile(np.repeat(1.0 / np.arange(1, HARMONICS + 1) ** 2, 2), 3)
        out = []
        for k, axis in enumerate(self.axes):
            first, name = k * SIZE, f"table{axis.number}"
            shape = np.array([TILT, TILT, OFFSET, OFFSET, SCALE])
            place = first + np.arange(len(AXIS))
            out.append(PriorGroup(name=f"{name}/axis", columns=place, sd=1.0, shape=shape))
            for what, columns, sd, rest in (
                ("run-out", waves[0], RUN_OUT, REST_SHIFT),
                ("wobble", waves[1], WOBBLE, REST_TURN),
            ):
                out.append(
                    PriorGroup(
                        name=f"{name}/{what}",
                        columns=first + columns,
                        sd=sd,
                        rest=sd if few else rest,
                        shape=falling,
                    )
                )
        return out

    def in_tables(self, tables: MeanTables, values: Array) -> MeanTables | None:
        """Returns the tables as they are: those of the arm, for targets off the table."""
        return tables

    def beyond_tables(self, conditions: ArmConditions) -> bool:
        """Returns whether a posture is on the table."""
        return bool(self._is_carried(conditions.external).any())

    def contradicts(self, axes: Sequence[ExternalAxis]) -> str:
        """Returns which axis a cell states elsewhere, or without one that carries its frames."""
        numbers = {axis.number for axis in self.axes}
        stated = [axis for axis in axes if axis.number in numbers]
        same = all(any(same_axis(axis, known) for known in self.axes) for axis in stated)
        if not stated or (same and not find_axes_beside(axes, stated)):
            return ""
        return (
            f"the model has a rotary table E{stated[0].number}, and the cell states its axes "
            "otherwise"
        )

    @classmethod
    def begin(cls, robot: RobotModel, measurements: MeasurementSet, few: bool) -> Self | None:
        """Returns None: rows of the arm do not show the table."""
        return None

    def actual_axis(self, number: int, values: Array) -> tuple[Array, Array]:
        """Returns direction and point (3,) m of an axis in base, by its index, as identified."""
        axis, part = self.axes[number], values[number * SIZE :]
        across = _across(axis)[:, :2]
        direction = axis.direction + np.cross(across @ part[:2], axis.direction)
        return direction / np.linalg.norm(direction), _point(axis) + across @ part[2:4]

    def sentences(self, values: Array, variance: Array) -> Sequence[str]:
        """Returns place, scale and run-out of each axis, and what is not observable."""
        out = []
        for k, axis in enumerate(self.axes):
            mine = slice(k * SIZE, k * SIZE + len(AXIS))
            place, sd = values[mine], np.sqrt(variance[mine])
            grid = np.linspace(self.low[k], self.high[k], 181)
            waves = _functions(grid, axis.at)[:, :, len(AXIS) :]
            motion = waves @ values[mine.stop : (k + 1) * SIZE]
            motion = (motion - motion.mean(axis=0)).reshape(-1, 2, 3)
            size = np.linalg.norm(motion, axis=2).max(axis=0) / UM
            out.append(
                f"table E{axis.number}: axis off by {np.linalg.norm(place[2:4]) / UM:.0f} +- "
                f"{np.linalg.norm(sd[2:4]) / UM:.0f} um and tilted by "
                f"{np.linalg.norm(place[:2]) / UM:.0f} +- {np.linalg.norm(sd[:2]) / UM:.0f} urad, "
                f"scale {place[4] / UM:+.0f} +- {sd[4] / UM:.0f} urad/rad, run-out {size[0]:.0f} "
                f"um, wobble {size[1]:.0f} urad; learned from {self.low[k] / DEG:.0f} to "
                f"{self.high[k] / DEG:.0f} deg. Not observable: the zero of its reading; frames "
                f"are those at {axis.at / DEG:g} deg",
            )
        return tuple(out)

    def arrays(self, values: Array) -> Mapping[str, Array]:
        """Returns parameters, places of the axes and angles."""
        return {
            "coefficients": values,
            "direction": np.array([axis.direction for axis in self.axes]),
            "point": np.array([_point(axis) for axis in self.axes]),
            "at": np.array([axis.at for axis in self.axes]),
            "low": self.low,
            "high": self.high,
        }

    def document(self) -> Mapping[str, object]:
        """Returns which axes they are, and the scatter of a point."""
        return {"numbers": [axis.number for axis in self.axes], "scatter": self.scatter}

    @classmethod
    def restore(
        cls, robot: RobotModel, document: Mapping[str, object], arrays: Mapping[str, Array]
    ) -> tuple[Self, Array]:
        """Returns the term and its parameters.

        Raises:
            ArchiveError: Invalid parts.
        """
        numbers = decode(tuple[int, ...], document["numbers"], key="table.numbers")
        scatter = decode(float, document["scatter"], key="table.scatter")
        values, a = arrays["coefficients"], len(numbers)
        names = ("direction", "point", "at", "low", "high")
        shapes = [arrays[name].shape for name in names]
        sound = shapes == [(a, 3), (a, 3), (a,), (a,), (a,)] and values.shape == (a * SIZE,)
        if not (a and sound and scatter >= 0.0 and all(1 <= n <= 6 for n in numbers)):
            raise ArchiveError(f"the table of the model is damaged: arrays of {shapes}.")
        axes = tuple(
            ExternalAxis(number=number, direction=direction, point=point, at=float(at))
            for number, direction, point, at in zip(
                numbers, arrays["direction"], arrays["point"], arrays["at"], strict=True
            )
        )
        return cls(axes=axes, low=arrays["low"], high=arrays["high"], scatter=scatter), values


def same_axis(one: ExternalAxis, other: ExternalAxis) -> bool:
    """Returns whether two descriptions mean the same rotation of what the axis carries."""
    if one.number != other.number or one.point is None or other.point is None:
        return False
    off = np.cross(one.direction, other.point - one.point)
    return (
        bool(np.allclose(one.direction, other.direction, rtol=0.0, atol=1e-9))
        and float(np.linalg.norm(off)) < 1e-8
        and abs(one.at - other.at) < 1e-9
    )


def find_axes_beside(axes: Sequence[ExternalAxis], used: Sequence[ExternalAxis]) -> tuple[int, ...]:
    """Returns the numbers of further rotary or linear axes that carry a frame of the used ones."""
    frames = {plain_key(name) for axis in used for name in axis.frames}
    numbers = {axis.number for axis in used}
    return tuple(
        axis.number
        for axis in axes
        if axis.number not in numbers and frames & {plain_key(name) for name in axis.frames}
    )


def _point(axis: ExternalAxis) -> Array:
    return np.zeros(3) if axis.point is None else axis.point


def _across(axis: ExternalAxis) -> Array:
    """Columns (3, 3): two directions across the axis and its own."""
    helper = np.eye(3)[2] if abs(axis.direction[2]) < 0.9 else np.eye(3)[0]
    first = np.cross(helper, axis.direction)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis.direction, first), axis.direction])


def _functions(angle: Array, at: float) -> Array:
    """Returns the motion (n, 6, SIZE) by the parameters at angles (n,), in the axes of the axis."""
    out = np.zeros((len(angle), 6, SIZE))
    phi = angle - at
    moved = np.array([[1.0 - np.cos(phi), np.sin(phi)], [-np.sin(phi), 1.0 - np.cos(phi)]])
    out[:, 3:5, 0:2] = out[:, 0:2, 2:4] = moved.transpose(2, 0, 1)
    out[:, 5, 4] = phi
    order = np.arange(1, HARMONICS + 1)
    cosine = np.cos(order * angle[:, None]) - np.cos(order * at)
    sine = np.sin(order * angle[:, None]) - np.sin(order * at)
    waves = np.stack([cosine, sine], axis=2).reshape(len(angle), -1)
    for motion in range(len(MOTIONS)):
        start = len(AXIS) + motion * waves.shape[1]
        out[:, motion, start : start + waves.shape[1]] = waves
    return out
