"""How a simulated controller moves its joints in time: a jog, a raster of lines, a recording."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Protocol

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ReachError
from robotrue.online.replay import replay_joints
from robotrue.robot.forward import forward
from robotrue.robot.inverse import inverse_path
from robotrue.robot.model import RobotModel

_KNOT = 2.0 * MM
"""m of the tool's way between two poses that are inverted; joints are linear in between."""


class Motion(Protocol):
    """Where the arm is at each moment."""

    @property
    def duration(self) -> float:
        """s; infinite for a motion that repeats."""

    def at(self, time: float) -> tuple[Array, Array]:
        """Returns joints (dof,) rad as displayed and T_base_tool (4, 4) m, at a time from zero."""

    def along(self, times: Array) -> tuple[Array, Array]:
        """Returns joints (n, dof) and poses (n, 4, 4) at many times (n,): sooner than by ``at``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Jog:
    """One joint to and fro: what clocks are aligned with.

    Attributes:
        robot: The arm.
        joints: (dof,) rad, model joints where it starts.
        axis: Which joint, from 1.
        amplitude: rad to the far end.
        period: s to the far end and back.
    """

    robot: RobotModel
    joints: Array
    axis: int = 1
    amplitude: float = math.radians(5.0)
    period: float = 4.0

    def __post_init__(self) -> None:
        """Checks."""
        object.__setattr__(self, "joints", frozen(self.joints, (self.robot.dof,), "joints"))
        if not 1 <= self.axis <= self.robot.dof or not self.period > 0.0:
            raise ConfigurationError(
                f"jog of axis {self.axis} in {self.period:g} s, expected an axis from 1 to "
                f"{self.robot.dof} and more than 0 s."
            )

    @property
    def duration(self) -> float:
        """Infinite: it repeats."""
        return math.inf

    def at(self, time: float) -> tuple[Array, Array]:
        """Returns joints as displayed and the pose; smooth, at rest at both ends."""
        return _only(self.along(np.array([time])))

    def along(self, times: Array) -> tuple[Array, Array]:
        """Returns joints and poses at many times."""
        joints = np.repeat(self.joints[None], len(times), axis=0)
        turn = 0.5 * (1.0 - np.cos(2.0 * math.pi * times / self.period))
        joints[:, self.axis - 1] += self.amplitude * turn
        return _shown(self.robot, joints)


@dataclass(frozen=True, slots=True, kw_only=True)
class Raster:
    """Lines side by side along the axes of the base, there and back again, as in milling.

    Attributes:
        robot: The arm.
        knots: (n, dof) rad, model joints along one way there and back.
        times: (n,) s of the knots.
    """

    robot: RobotModel
    knots: Array
    times: Array

    @property
    def duration(self) -> float:
        """Infinite: it repeats."""
        return math.inf

    def at(self, time: float) -> tuple[Array, Array]:
        """Returns joints as displayed and the pose of these very joints."""
        return _only(self.along(np.array([time])))

    def along(self, times: Array) -> tuple[Array, Array]:
        """Returns joints and poses at many times."""
        when = np.mod(times, float(self.times[-1]))
        columns = [np.interp(when, self.times, column) for column in self.knots.T]
        return _shown(self.robot, np.column_stack(columns))


def raster(
    robot: RobotModel,
    joints: Array,
    *,
    length: float = 100.0 * MM,
    pitch: float = 6.0 * MM,
    lines: int = 3,
    feed: float = 20.0 * MM,
) -> Raster:
    """Returns lines along base x, side by side along base y, with the tool held as it stands.

    Args:
        robot: An arm with a closed inverse.
        joints: (dof,) rad, where the first line begins.
        length: m of a line.
        pitch: m between lines.
        lines: How many.
        feed: m/s of the tool point.

    Raises:
        ConfigurationError: Nothing to go along, or an arm without a closed inverse.
        ReachError: A place that the arm cannot take.
    """
    if not (length > 0.0 and pitch > 0.0 and lines >= 1 and feed > 0.0):
        raise ConfigurationError(
            f"{lines} lines of {length / MM:g} mm at {feed / MM:g} mm/s, expected more than none."
        )
    start = forward(robot, np.asarray(joints, dtype=np.float64)[None])[0]
    corners: list[tuple[float, float]] = []
    for line in range(lines):
        ends = (0.0, length) if line % 2 == 0 else (length, 0.0)
        corners += [(x, line * pitch) for x in ends]
    corners += corners[-2::-1]
    places, times = [np.zeros(2)], [0.0]
    for a, b in pairwise(np.array(corners)):
        way = float(np.linalg.norm(b - a))
        count = max(1, math.ceil(way / _KNOT))
        places += [a + (b - a) * k / count for k in range(1, count + 1)]
        times += [times[-1] + way / feed * k / count for k in range(1, count + 1)]
    poses = np.tile(start, (len(places), 1, 1))
    poses[:, :2, 3] += np.array(places)
    knots = inverse_path(robot, poses, near=joints)
    lost = np.flatnonzero(np.isnan(knots).any(axis=1))
    if len(lost):
        raise ReachError(
            f"the raster leaves the arm's reach at x, y = {poses[lost[0], :2, 3] / MM} mm.",
            hint="begin elsewhere, or with shorter lines.",
        )
    return Raster(robot=robot, knots=knots, times=np.array(times))


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A recorded path; at each moment the row that was the latest then.

    Attributes:
        times: (n,) s from its first row.
        joints: (n, dof) rad as displayed.
        T_base_tool: (n, 4, 4) m; NaN where it was not recorded.
    """

    times: Array
    joints: Array
    T_base_tool: Array

    @property
    def duration(self) -> float:
        """Length of the recording in s."""
        return float(self.times[-1])

    def at(self, time: float) -> tuple[Array, Array]:
        """Returns joints as displayed and the pose of the latest row."""
        return _only(self.along(np.array([time])))

    def along(self, times: Array) -> tuple[Array, Array]:
        """Returns joints and poses at many times."""
        rows = np.maximum(np.searchsorted(self.times, times, side="right") - 1, 0)
        return self.joints[rows], self.T_base_tool[rows]


def recorded(path: str | Path) -> Recording:
    """Returns the motion of a CSV of joints, as the online service replays it.

    Raises:
        FormatError: As the replay.
        ConfigurationError: No row that is sound.
    """
    samples = [sample for sample in replay_joints(path) if sample.valid]
    if not samples:
        raise ConfigurationError(f"{path} has no row a robot could have been at.")
    times = np.array([sample.controller_time for sample in samples])
    return Recording(
        times=times - times[0],
        joints=np.array([sample.joints for sample in samples]),
        T_base_tool=np.array([sample.T_frame_tool for sample in samples]),
    )


def _shown(robot: RobotModel, joints: Array) -> tuple[Array, Array]:
    shown = joints if robot.controller is None else robot.controller.to_controller(joints)
    return shown, forward(robot, joints)


def _only(found: tuple[Array, Array]) -> tuple[Array, Array]:
    return found[0][0], found[1][0]
