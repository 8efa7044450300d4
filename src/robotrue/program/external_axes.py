"""External axes in the chain: a robot on a rail, a part on a turntable or a linear table.

A program names a work frame once, and external values with every target. Where an axis carries the
robot, every frame on the floor moves in the opposite direction, seen from the robot; where it
carries a frame, that frame moves along. Each distinct pose becomes a separate work frame, so that
later code needs no external axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray, frozen
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.errors import ShapeError

COUNT = 6
"""External axes a target may have."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExternalAxis:
    """One external axis, in the robot base while all axes are ``at``.

    Attributes:
        number: 1 to 6: E1.. of KUKA, eax_a.. of ABB, the order of the values elsewhere.
        name: Its name in the controller, e.g. ABB's mechanical unit; empty if not needed.
        direction: (3,) unit vector in base: its direction of motion, or its axis of rotation by the
            right-hand rule, as its value grows.
        point: (3,) m in base, on the axis of a turn; None of a linear axis.
        at: m or rad, its value when the frames were stated.
        carries_robot: The robot is mounted on it. Linear axes only.
        frames: Work frames that it carries, by number or name; ``base`` is the default one.
        per_pulse: mm or deg per pulse, for jobs that print pulses; NaN is not known.
    """

    number: int
    name: str = ""
    direction: Array
    point: Array | None = None
    at: float = 0.0
    carries_robot: bool = False
    frames: tuple[str, ...] = ()
    per_pulse: float = np.nan

    def __post_init__(self) -> None:
        """Normalises the direction.

        Raises:
            ShapeError: An invalid number, no direction, or a robot that turns.
        """
        if not 1 <= self.number <= COUNT:
            raise ShapeError(f"external axis {self.number}, expected 1 to {COUNT}.")
        direction: Array = frozen(self.direction, (3,), "direction")
        length = float(np.linalg.norm(direction))
        if not length > 0.0:
            raise ShapeError(f"external axis {self.number} has no direction.")
        if self.carries_robot and (self.point is not None or self.frames):
            raise ShapeError(
                f"external axis {self.number} carries the robot: it must be linear, and the frames "
                "on the floor move by themselves.",
                hint="describe the rail with its direction, without what it carries.",
            )
        if abs(length - 1.0) > 1e-12:  # a unit vector keeps its bits
            object.__setattr__(self, "direction", frozen(direction / length, (3,), "direction"))
        else:
            object.__setattr__(self, "direction", direction)
        if self.point is not None:
            object.__setattr__(self, "point", frozen(self.point, (3,), "point"))

    @property
    def unit(self) -> float:
        """M or rad per printed mm or deg."""
        return MM if self.point is None else DEG


def plain_key(text: str) -> str:
    """Returns a frame's number without leading zeros, or its name in lower case."""
    text = text.strip().lower()
    return (text.lstrip("0") or "0") if text.isascii() and text.isdigit() else text


def riders_of(axes: Sequence[ExternalAxis], *keys: str) -> tuple[bool, ...]:
    """Returns which of the axes carry the work frame of these numbers and names."""
    wanted = {plain_key(key) for key in keys}
    return tuple(any(plain_key(name) in wanted for name in axis.frames) for axis in axes)


def mark_described(axes: Sequence[ExternalAxis]) -> BoolArray:
    """Returns which of the six external values (6,) belong to an axis that is described."""
    out = np.zeros(COUNT, np.bool_)
    out[[axis.number - 1 for axis in axes]] = True
    return out


@dataclass(frozen=True, slots=True, kw_only=True)
class Carried:
    """Work frames of n targets with the external axes where each target has them.

    Attributes:
        frame: (n,) index into ``T_base_frame``.
        T_base_frame: (f, 4, 4), those given first.
        unknown: (n,) the place depends on an axis whose value the target does not state.
        external: (n, 6) m or rad, where the described axes are that carry the robot or the frame of
            the target; NaN elsewhere. None: no axis is described.
    """

    frame: IntArray
    T_base_frame: Array
    unknown: BoolArray
    external: Array | None = None


def carry_frames(
    axes: Sequence[ExternalAxis],
    T_base_frame: Array,
    frame: IntArray,
    values: Array,
    riders: Array,
    on_robot: BoolArray,
    *,
    rest: bool = False,
) -> Carried:
    """Returns the work frames as the external axes move them.

    Args:
        axes: Described axes, in the order from the floor up.
        T_base_frame: (f, 4, 4) with every axis ``at``.
        frame: (n,) index of each target.
        values: (n, 6) external values as printed, mm or deg; NaN where none is.
        riders: (f, a) which frames each of the ``axes`` carries.
        on_robot: (f,) frames that move with the robot, its own root above all.
        rest: An axis without a value in any target is where the frames were stated.
    """
    if not axes:
        return Carried(frame=frame, T_base_frame=T_base_frame, unknown=np.zeros(len(frame), bool))
    rails = np.array([axis.carries_robot for axis in axes], np.bool_)
    moving = np.where(rails, ~on_robot[:, None], riders)  # (f, a)
    need = moving[frame]
    unit = np.array([axis.unit for axis in axes])
    here = values[:, [axis.number - 1 for axis in axes]] * unit
    if rest:
        silent = np.isnan(here).all(axis=0)
        here = np.where(silent, [axis.at for axis in axes], here)
    unknown: BoolArray = np.asarray((need & np.isnan(here)).any(axis=1))
    external = np.full((len(frame), COUNT), np.nan)
    external[:, [axis.number - 1 for axis in axes]] = np.where(need, here, np.nan)
    here = np.where(need, here, [axis.at for axis in axes])
    away = (here != [axis.at for axis in axes]).any(axis=1) & ~unknown
    rows = np.flatnonzero(away)
    out = np.array(frame)
    if not len(rows):
        return Carried(frame=out, T_base_frame=T_base_frame, unknown=unknown, external=external)
    begins = np.ones(len(rows), np.bool_)
    begins[1:] = np.diff(frame[rows]) != 0
    for column in here[rows].T:
        begins[1:] |= np.diff(column) != 0.0
    first = rows[begins]
    out[rows] = len(T_base_frame) + np.cumsum(begins) - 1
    T = T_base_frame[frame[first]]
    for column in reversed(range(len(axes))):  # the axis nearest to the part moves it first
        if not rails[column]:
            move_frames(T, axes[column], here[first, column])
    for column in np.flatnonzero(rails).tolist():  # seen from a robot that went the other way
        move_frames(T, axes[column], 2.0 * axes[column].at - here[first, column])
    every = np.concatenate([T_base_frame, T])
    every.flags.writeable = False
    return Carried(frame=out, T_base_frame=every, unknown=unknown, external=external)


def move_frames(T: Array, axis: ExternalAxis, values: Array) -> None:
    """Moves frames (k, 4, 4) in place as the axis moves what it carries, values (k,) m or rad."""
    step = (values - axis.at)[:, None] * axis.direction
    if axis.point is None:
        T[:, :3, 3] += step
    else:
        T[:, :3, 3] -= axis.point
        T[:, :3] = matrix_from_rotation_vector(step) @ T[:, :3]
        T[:, :3, 3] += axis.point
