"""Scenario of simulated robots and sensors: knocks, a milling pass, the way back.

A cycle that repeats for ever, as a function of the host's monotonic clock: simulators in separate
processes on one computer are at the same place at the same time without communication. Each cycle
begins with a jog of short knocks, which joints and force sensor both see, so that the clocks of two
streams can be aligned, and cuts a straight pass along base x with the force of the milling model.

Everything here is SIMULATED. **Assumed**: the load on the sensor, the knocks, the cut of
:mod:`robotrue.simulation.milling_arm`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, Final

import numpy as np
from scipy.interpolate import CubicSpline

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM, STANDARD_GRAVITY
from robotrue.errors import ConfigurationError, ReachError
from robotrue.robot.configuration import controller_axes
from robotrue.robot.forward import forward
from robotrue.robot.inverse_numeric import solve
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset
from robotrue.simulation.milling_arm import (
    FEED,
    RATE,
    TOOL_POINT,
    milling_robot,
    milling_table,
    pass_joints,
)

CYCLE: Final = 32.0
"""s."""
KNOCKS: Final = (1.0, 1.43, 2.11, 2.52, 3.37)
"""s, when each begins; uneven, so that no other shift of the clocks fits as well."""
KNOCK: Final = 8 * MM
KNOCK_WAY: Final = np.array([0.3, 0.5, 0.8]) / np.sqrt(0.98)
KNOCK_TIME: Final = 0.12
"""s there, and as much back."""
PASS: Final = (5.0, 25.0)
"""s, begin and end of the feed."""
RAMP: Final = 0.2
"""s in which the feed and the cut set in."""
LIFT: Final = 20 * MM
MASS: Final = 8.0
"""kg of the load on the sensor."""
CENTRE: Final = np.array([0.12, 0.0, 0.06])
"""m in the sensor's axes, which are those of the flange."""
WRIST_ATTITUDES: Final = matrix_from_abc(
    np.array([[0, 0, 0], [0, 0, 180], [0, 0, 90], [0, 0, -90], [0, 90, 0], [0, -90, 0]]) * DEG
)
"""The flange up, down and to four sides: attitudes in which the load on it is weighed."""
_MOVES: Final = (
    *((begin, KNOCK_TIME, KNOCK * KNOCK_WAY) for begin in KNOCKS),
    *((begin + KNOCK_TIME, KNOCK_TIME, -KNOCK * KNOCK_WAY) for begin in KNOCKS),
    (25.5, 0.8, np.array([0.0, 0.0, LIFT])),
    (26.5, 2.5, np.array([-FEED * (PASS[1] - PASS[0]), 0.0, 0.0])),
    (29.2, 0.8, np.array([0.0, 0.0, -LIFT])),
)
"""s, begin and length; m. The pass itself is fed and not one of them."""
_BEGIN, _LENGTH, _WAY = (np.array(column) for column in zip(*_MOVES, strict=True))
_ON_OFF: Final = np.array([1.0, -1.0])
_STEP: Final = 4e-3
_SCATTER: Final = np.array([0.02] * 3 + [0.002] * 3)
"""N and N m, of a reading at rest."""
_STARTS: Final = {
    "KUKA KR160 R1570": np.array([-20.0, -20.0, 10.0, 5.0, -60.0, 10.0]) * DEG,
    "UR10": np.array([0.3, -1.2, 1.6, -1.9, -1.57, 0.2]),
}
"""Where other arms than the milling arm begin, joints of the model."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OnlineScenario(Columns):
    """One cycle of an arm; all times are s on the host's monotonic clock, of any cycle.

    Attributes:
        seed: Of the cutter.
        robot: The arm with its tool.
        T_base_start: (4, 4), the tool where the cycle begins.
        table: (n, 3) N, force of the cut over three turns of the spindle, base axes.
        curve: Joints (6,) rad of the model over the cycle.
    """

    seed: int
    robot: RobotModel
    T_base_start: Annotated[Array, Column("4 4")]
    table: Annotated[Array, Column("_ 3")]
    curve: CubicSpline

    def poses(self, time: Array) -> Array:
        """Returns ``T_base_tool`` (n, 4, 4) m at times (n,)."""
        out = np.repeat(self.T_base_start[None], len(time), axis=0)
        out[:, :3, 3] += _motion(time)[0]
        return out

    def joints(self, time: Array) -> Array:
        """Returns joints (n, 6) rad of the model."""
        return np.asarray(self.curve(np.mod(time, CYCLE)))

    def displayed_joints(self, time: Array) -> Array:
        """Returns joints (n, 6) rad as the controller displays them."""
        return controller_axes(self.robot, self.joints(time))

    def cut(self, time: Array) -> Array:
        """Returns the force (n, 3) N of the cut on the tool in base axes."""
        since = np.mod(time, CYCLE)
        share = _smooth((since - PASS[0]) / RAMP) - _smooth((since - PASS[1]) / RAMP)
        place = np.mod(since * RATE, len(self.table))
        below = np.floor(place).astype(np.int64)
        rest = (place - below)[:, None]
        above = self.table[(below + 1) % len(self.table)]
        return np.asarray(share[:, None] * (self.table[below] * (1.0 - rest) + above * rest))

    def process(self, time: Array) -> Array:
        """Returns what acts on the tool point (n, 6) N, N m in base axes: cut and knocks."""
        force = self.cut(time) - MASS * _motion(time)[1]
        return np.concatenate([force, np.zeros_like(force)], axis=1)

    def at_rest(self, R_base_sensor: Array, seed: int = 0) -> Array:
        """Returns readings (n, 6) N, N m at rest with the sensor turned so (n, 3, 3) (simulated).

        Means over a second: with a scatter of 0.02 N and 0.002 N m.
        """
        weight = np.array([0.0, 0.0, -MASS * STANDARD_GRAVITY])
        held = np.einsum("nba,b->na", R_base_sensor, weight)
        scatter = np.random.default_rng([seed, 7]).normal(size=(len(held), 6)) * _SCATTER
        return np.asarray(np.concatenate([held, np.cross(CENTRE, held)], axis=1) + scatter)

    def sensor_wrench(self, time: Array) -> Array:
        """Returns what a sensor at the flange feels (n, 6) N, N m in its axes: weight, too."""
        R_base_sensor = self.T_base_start[:3, :3] @ self.robot.T_flange_tool[:3, :3].T
        weight = np.array([0.0, 0.0, -MASS * STANDARD_GRAVITY])
        cut = self.cut(time) @ R_base_sensor
        held = (weight - MASS * _motion(time)[1]) @ R_base_sensor
        arm = self.robot.T_flange_tool[:3, 3]
        return np.concatenate([cut + held, np.cross(arm, cut) + np.cross(CENTRE, held)], axis=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioMotion:
    """The scenario as the motion of a simulated controller, whose time begins at zero.

    Attributes:
        scenario: Where the arm goes.
        begun: s on the host's monotonic clock, when the controller's time was zero.
    """

    scenario: OnlineScenario
    begun: float

    @property
    def duration(self) -> float:
        """Infinite: it repeats."""
        return math.inf

    def along(self, times: Array) -> tuple[Array, Array]:
        """Returns joints (n, dof) rad as displayed and T_base_tool (n, 4, 4) m, from time zero."""
        now = self.begun + times
        return self.scenario.displayed_joints(now), self.scenario.poses(now)


def online_scenario(seed: int = 0, robot: str | None = None) -> OnlineScenario:
    """Returns the scenario of an arm, the same for a seed on every machine (simulated).

    Args:
        seed: Of the cutter, as :func:`~robotrue.simulation.milling_arm.milling_table` draws it.
        robot: Preset; the arm of the virtual milling experiment if not given.

    Raises:
        ConfigurationError: An arm that no scenario is made for.
        ReachError: The arm cannot take the path.
    """
    arm, start = _arm(robot)
    T_base_start = forward(arm, start[None])[0]
    times = np.linspace(0.0, CYCLE, round(CYCLE / _STEP) + 1)
    poses = np.repeat(T_base_start[None], len(times), axis=0)
    poses[:, :3, 3] += _motion(times)[0]
    found = solve(arm, poses, start)
    if not found.converged.all():
        raise ReachError(f"{arm.name} cannot take the path of the scenario.")
    joints = np.array(found.joints)
    joints[-1] = joints[0]
    return OnlineScenario(
        seed=seed,
        robot=arm,
        T_base_start=T_base_start,
        table=milling_table(seed, 1),
        curve=CubicSpline(times, joints, bc_type="periodic"),
    )


def _arm(name: str | None) -> tuple[RobotModel, Array]:
    if name is None:
        arm = milling_robot()
        return arm, pass_joints(np.zeros(1))[0]
    arm = preset(name)
    if arm.name not in _STARTS:
        raise ConfigurationError(
            f"no scenario for {arm.name}; there are {', '.join(_STARTS)} and the milling arm.",
            hint="leave the robot out: the arm of the virtual milling experiment.",
        )
    tool = np.eye(4)
    tool[:3, 3] = TOOL_POINT
    return replace(arm, T_flange_tool=tool), _STARTS[arm.name]


def _motion(time: Array) -> tuple[Array, Array]:
    """Place of the tool from its start (n, 3) m, and its acceleration (n, 3) m/s^2, base axes."""
    since = np.mod(np.asarray(time, dtype=np.float64), CYCLE)
    u = (since[:, None] - _BEGIN) / _LENGTH
    place = _smooth(u) @ _WAY
    acceleration = (_bend(u) / _LENGTH**2) @ _WAY
    u = (since[:, None] - np.array(PASS)) / RAMP
    place[:, 0] += FEED * RAMP * (_area(u) @ _ON_OFF)
    acceleration[:, 0] += FEED / RAMP * (_slope(u) @ _ON_OFF)
    return place, acceleration


def _smooth(u: Array) -> Array:
    """From 0 to 1 without a jump in speed or acceleration."""
    u = np.clip(u, 0.0, 1.0)
    return np.asarray(u**3 * (10.0 - 15.0 * u + 6.0 * u**2))


def _slope(u: Array) -> Array:
    u = np.clip(u, 0.0, 1.0)
    return np.asarray(30.0 * u**2 * (1.0 - u) ** 2)


def _bend(u: Array) -> Array:
    u = np.clip(u, 0.0, 1.0)
    return np.asarray(60.0 * u * (1.0 - u) * (1.0 - 2.0 * u))


def _area(u: Array) -> Array:
    """Integral of ``_smooth``."""
    inside = np.clip(u, 0.0, 1.0)
    return np.asarray(inside**4 * (2.5 - 3.0 * inside + inside**2) + np.maximum(u - 1.0, 0.0))
