"""Interpolates the arm's pose at force times; joint samples wait for the forces that need them.

A force uses the joints of samples at or before its time, extrapolated at their last speed for 1.5
sample intervals, then held. So an estimate depends on the times of the samples alone, not on the
cutting of the streams or the lead of one over the other.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray, Records
from robotrue.core.compiled import EXACT, compile_kernel
from robotrue.errors import ModelMismatchError
from robotrue.online.blocks import Flag, JointBlock
from robotrue.online.estimates import Doubt
from robotrue.online.sensing_models import SensingModels, SensingSettings
from robotrue.online.sensing_pose import walk_drives
from robotrue.online.sensing_records import HEAD
from robotrue.robot.chain import ORIGIN, chain_dtype, links_of

MOST_ROWS: Final = 1 << 18
"""Rows kept while no force comes: a quarter of an hour at 250 samples per second."""
_BAD: Final = int(Doubt.BAD_JOINTS)
_CLOCK: Final = int(Doubt.CLOCK)
_INVALID: Final = int(Flag.INVALID)
_JUMP: Final = int(Flag.CLOCK_JUMP)
_ON: Final = 1.5
"""Intervals that joints are carried on at their speed."""
_LEAP: Final = 0.05
_FASTEST: Final = 12.0
"""rad and rad/s: no joint goes farther than both together from one sample to the next."""
_BURST: Final = 1e-6
"""s; samples closer than this came in one burst and define no speed."""


class JointTrack:
    """Joint samples as rows that a force finds its place in.

    Attributes:
        rows: (k, HEAD + 2 dof), by rising time: time it came, warning, time of the joints, reach of
            their speed in s, acceleration of the held mass x y z; then joints (rad), then speeds
            (rad/s).
    """

    __slots__ = ("_age", "_arm", "_last", "_path", "_robot", "_weighs", "rows")

    def __init__(self, models: SensingModels, settings: SensingSettings) -> None:
        """Starts without joints."""
        robot = models.robot
        self._robot, self._age = robot, settings.joints_age
        self._weighs = models.held is not None and settings.acceleration_samples > 0
        centre = np.eye(4)
        if models.held is not None:
            centre[:3, 3] = models.held.centre
        self._arm = (
            links_of(robot.nominal(), models.T_flange_sensor @ centre),
            np.zeros(1, chain_dtype(robot.dof)),
            np.array(robot.theta),
            np.array(robot.joint_map),
        )
        self._last = np.full(2 + 2 * robot.dof, np.nan)
        self._path = np.full((max(1, settings.acceleration_samples), 4), np.nan)
        self.rows = np.empty((0, HEAD + 2 * robot.dof))

    def take(self, block: JointBlock) -> None:
        """Adds a block.

        Raises:
            ModelMismatchError: Joints of another arm.
        """
        dof = self._robot.dof
        if block.joints.shape[1] != dof:
            raise ModelMismatchError(
                f"{block.joints.shape[1]} joints in the stream, {self._robot.name} has {dof}.",
                hint="the robot of cell.toml is another than the one that sends.",
            )
        joints = self._robot.controller.to_model(block.joints)
        new = np.empty((len(block), HEAD + 2 * dof))
        _write_rows(
            block.host_time, np.ascontiguousarray(joints), block.flags, self._age, self._weighs,
            *self._arm, self._last, self._path, new,
        )  # fmt: skip
        self.rows = np.concatenate([self.rows, new])[-MOST_ROWS:]

    def forget(self, before: int) -> None:
        """Drops the rows before one that a force has passed."""
        if before > 0:
            self.rows = self.rows[before:]

    def state(self) -> dict[str, Array]:
        """Returns the state from which a later track of the same models continues."""
        return {
            "joint_rows": self.rows.copy(),
            "joint_last": self._last.copy(),
            "joint_path": self._path.copy(),
        }

    def restore(self, state: dict[str, Array]) -> None:
        """Continues from :meth:`state`; shapes were checked."""
        self.rows = np.array(state["joint_rows"])
        self._last[:] = state["joint_last"]
        self._path[:] = state["joint_path"]


@compile_kernel(EXACT)
def _write_rows(
    host_time: Array,
    joints: Array,
    flags: IntArray,
    age: float,
    weighs: bool,
    links: Records,
    chain: Records,
    zero_angle: Array,
    joint_map: Array,
    last: Array,
    path: Array,
    rows: Array,
) -> None:
    """Writes a row per sample. ``last``: time it came, time of joints, joints, speeds."""
    n = joints.shape[1]
    for i in range(len(host_time)):
        time, doubt = host_time[i], 0
        if flags[i] & _INVALID:
            doubt |= _BAD
        if flags[i] & _JUMP:
            doubt |= _CLOCK
        for j in range(n):
            if not np.isfinite(joints[i, j]):
                doubt |= _BAD
        if not np.isfinite(time) or time < last[0]:
            doubt |= _BAD | _CLOCK
            time = last[0]
        else:
            last[0] = time
        reach = 0.0
        if doubt == 0:
            passed = time - last[1]
            if passed > _BURST:  # not for the first: NaN
                for j in range(n):
                    gone = joints[i, j] - last[2 + j]
                    last[2 + n + j] = gone / passed if passed <= age else 0.0
                    if abs(gone) > _LEAP + _FASTEST * passed:
                        doubt |= _BAD
                if doubt != 0:  # where it leapt to counts from the next sample on
                    for j in range(n):
                        last[2 + n + j] = 0.0
                reach = _ON * min(passed, age)
            elif not np.isfinite(passed):
                for j in range(n):
                    last[2 + n + j] = 0.0
            last[1] = time
            for j in range(n):
                last[2 + j] = joints[i, j]
            if weighs:
                if not passed <= age:
                    for k in range(len(path)):
                        path[k, 0] = np.nan
                if not passed <= _BURST:
                    walk_drives(joints[i], zero_angle, joint_map, links[0], chain[0])
                    for k in range(len(path) - 1):
                        for c in range(4):
                            path[k, c] = path[k + 1, c]
                    path[-1, 0] = time
                    for r in range(3):
                        path[-1, 1 + r] = chain[0].frame[n, r, ORIGIN]
        rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3] = time, doubt, last[1], reach
        _write_acceleration(path, rows[i, 4:7])
        for j in range(2 * n):
            rows[i, 7 + j] = last[2 + j]


@compile_kernel(EXACT)
def _write_acceleration(path: Array, acceleration: Array) -> None:
    """Writes the second derivative of the parabola through (k, 4) time and place; else zero."""
    k = len(path)
    for c in range(3):
        acceleration[c] = 0.0
    span = path[-1, 0] - path[0, 0]
    if k < 5 or not span > 0.0:
        return
    middle = 0.0
    for i in range(k):
        middle += (path[i, 0] - path[0, 0]) / k
    s2, s3, s4 = 0.0, 0.0, 0.0
    for i in range(k):
        t = (path[i, 0] - path[0, 0] - middle) / span
        s2 += t * t
        s3 += t * t * t
        s4 += t * t * t * t
    lean = s3 / s2
    size = s4 - s2 * s2 / k - lean * s3  # of t^2 with its mean and slope removed
    if not size > 1e-9:
        return
    for c in range(3):
        total = 0.0
        for i in range(k):
            t = (path[i, 0] - path[0, 0] - middle) / span
            total += (t * t - s2 / k - lean * t) * (path[i, 1 + c] - path[0, 1 + c])
        acceleration[c] = 2.0 * total / (size * span * span)
