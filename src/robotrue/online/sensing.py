"""The tool's error at every force sample: blocks of joints and forces in, estimates out.

Per sample: the joints at its time, the pose and whether the models are valid there, the force in
base without the load on the sensor, the arm's deflection under the slow force, the response in
time, the learned deviation of the window before; and a standard deviation. A row with any invalid
input is NaN and states the cause.

The same data cut differently give the same numbers, bit for bit; so does a run that was stopped and
continues from :meth:`Sensing.state`.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.dynamics.oscillators import Oscillators, join_oscillators
from robotrue.dynamics.pose_modes import PoseModes, pose_modes
from robotrue.dynamics.streaming import ModalFilter
from robotrue.errors import ModelMismatchError
from robotrue.online import sensing_kernels as kernels
from robotrue.online.blocks import ForceBlock, JointBlock
from robotrue.online.estimates import Doubt, EstimateBlock
from robotrue.online.sensing_joints import JointTrack
from robotrue.online.sensing_models import PoseResponse, SensingModels, SensingSettings
from robotrue.online.sensing_pose import BASE, SENSOR, TOOL, write_pose
from robotrue.online.sensing_records import (
    POSE_DTYPE,
    WORK_DTYPE,
    constants,
    new_record,
    noise_variance,
    numbers_of,
    parameters,
    state_dtype,
)
from robotrue.online.sensing_watch import new_watch
from robotrue.online.sensing_windows import WindowDeviation, window_dtype

ROWS: Final = 1024
"""Rows of work at a time; bounds the memory of long blocks."""
_FRAMES: Final = {"base": BASE, "tool": TOOL, "sensor": SENSOR}


class Sensing:
    """The estimator: takes what streams gave, in the order it came.

    Attributes:
        models: Its inputs.
        settings: Limits and times.
    """

    def __init__(self, models: SensingModels, settings: SensingSettings | None = None) -> None:
        """Starts with nothing known: the first estimates are marked until the filters settled.

        Raises:
            ShapeError: A mode at or above half the rate of the force.
            ReachError: A measured response of a pose outside the limits of the joints.
        """
        self.models = models
        self.settings = SensingSettings() if settings is None else settings
        dof = models.robot.dof
        self._track = JointTrack(models, self.settings)
        self._windows = WindowDeviation(models)
        self._state = new_record(state_dtype(dof))
        self._state["last_time"], self._state["anchor"], self._state["row"] = -np.inf, np.nan, -1.0
        self._state["joints_of_pose"] = self._state["joints_of_modes"] = np.nan
        self._watch = new_watch()
        self._window = new_record(window_dtype(dof))
        self._filter: ModalFilter | None = None
        self._modes: PoseModes | None = None
        own = _start(models)
        if own is not None:
            self._filter = ModalFilter(own, models.rate)
        self._parameters = parameters(models, self.settings, own)
        self._constants = constants(models, self.settings)
        self._pose, self._axes = new_record(POSE_DTYPE), -1
        self._noise = noise_variance(own, models, self.settings)
        self._force = np.empty((ROWS + self.settings.bridged + 1, 3))
        self._moved = np.zeros_like(self._force)
        self._work = np.zeros(len(self._force), WORK_DTYPE)

    @property
    def memory(self) -> float:
        """Time after a gap or restart during which estimates are marked as settling, s."""
        return float(self._parameters["memory"][0]) / self.models.rate

    def joints(self, block: JointBlock) -> None:
        """Takes joint samples: those before a force must be passed before the force.

        Raises:
            ModelMismatchError: Joints of another arm.
        """
        self._track.take(block)

    def force(self, block: ForceBlock) -> EstimateBlock:
        """Returns the estimates (n) of force samples, a row for each.

        Raises:
            ModelMismatchError: A force in axes the models do not know.
        """
        n, dof = len(block), self.models.robot.dof
        frame = self._frame(block)
        joints, wrench = np.empty((n, dof)), np.empty((n, 6))
        out = np.full((3, n, 3), np.nan)
        doubts = np.empty(n, dtype=np.int64)
        first = 0
        while first < n:
            first, count, why, stopped_at = kernels.ingest(
                first, block.host_time, block.controller_time, block.wrench, block.flags, frame,
                self._track.rows, self._parameters, self._constants, self._state, self._watch,
                self._window, self._pose, joints, wrench, doubts, self._force, self._work,
            )  # fmt: skip
            full, why = divmod(why, 4)
            if why == kernels.SETTLE:
                self._windows.forget()
            self._filter_rows(count, why, stopped_at)
            kernels.combine(
                count, self._moved, self._work, self._parameters, self._noise,
                self._windows.correction, self._windows.direction, self._windows.turn,
                self._state, self._window, doubts, *out,
            )  # fmt: skip
            if full:
                self._windows.take(self._window)
                numbers_of(self._window)[:] = 0.0
        self._track.forget(int(self._state["row"][0]))
        self._state["row"] = np.minimum(self._state["row"], 0.0)
        bad = (doubts & int(Doubt.INVALID)) != 0
        wrench[bad] = np.nan
        joints = self.models.robot.controller.to_controller(joints)
        for values in (out, wrench, joints, doubts):
            values.flags.writeable = False  # as they are: no copies
        return EstimateBlock(
            host_time=block.host_time,
            error=out[0],
            sd=out[1],
            static=out[2],
            wrench=wrench,
            joints=joints,
            sequence=block.sequence,
            doubt=doubts,
        )

    def state(self) -> dict[str, Array]:
        """Returns the state from which a run continues, as arrays by name."""
        return {
            "numbers": numbers_of(self._state).copy(),
            "watch": numbers_of(self._watch).copy(),
            "window": numbers_of(self._window).copy(),
            "correction": self._windows.correction.copy(),
            "filter": np.zeros(0) if self._filter is None else self._filter.snapshot(),
            **self._track.state(),
        }

    def restore(self, state: dict[str, Array]) -> None:
        """Continues from :meth:`state` of an estimator with the same models and settings.

        Raises:
            ModelMismatchError: A state of other models.
        """
        own = self.state()
        for name, values in own.items():
            free = name == "joint_rows"
            there = np.shape(state[name]) if name in state else ()
            if there[free:] != values.shape[free:]:
                raise ModelMismatchError(
                    f"the state's {name!r} has shape {there}, expected {values.shape}.",
                    hint="the models and settings it was saved with.",
                )
        for record, name in (
            (self._state, "numbers"), (self._watch, "watch"), (self._window, "window"),
        ):  # fmt: skip
            numbers_of(record)[:] = state[name]
        self._windows.correction[:] = state["correction"]
        self._track.restore(state)
        self._axes = -1
        if self._filter is not None:
            response = self.models.response
            if isinstance(response, PoseResponse) and self._state["started"][0]:
                self._modes = _modes(response, self._state["joints_of_modes"][0])
                self._filter.change(join_oscillators([self._modes.oscillators(), response.tool]))
            self._filter.resume(state["filter"])

    def _filter_rows(self, count: int, why: int, at: int) -> None:
        """Moves the filters over rows of work, settling or changing them before row ``at``."""
        if self._filter is None or not count:
            return
        if why == kernels.GOES_ON:
            self._filter.push(self._force[:count], self._moved[:count])
            return
        self._filter.push(self._force[:at], self._moved[:at])
        response = self.models.response
        if isinstance(response, PoseResponse):
            modes = _modes(response, self._state["joints_of_modes"][0])
            self._filter.change(
                join_oscillators([modes.oscillators(), response.tool]), self._carry(modes)
            )
            self._modes = modes
        if why == kernels.SETTLE:
            self._filter.settle(self._force[at])
        self._filter.push(self._force[at:count], self._moved[at:count])

    def _carry(self, after: PoseModes) -> Array | None:
        """Normal coordinates of arm and tool at a pose from those before; the joints stay."""
        if self._modes is None:
            return None
        n, k = len(after.frequency), len(self._filter.oscillators) if self._filter else 0
        out = np.eye(k)
        out[:n, :n] = after.carry(self._modes)
        return out

    def _frame(self, block: ForceBlock) -> int:
        if block.frame not in _FRAMES:
            raise ModelMismatchError(
                f"forces along the axes of {block.frame!r}, expected one of {', '.join(_FRAMES)}."
            )
        if self.models.held is not None and block.frame != "sensor":
            raise ModelMismatchError(
                f"forces along the axes of {block.frame!r}, and a held tool to take off: that is "
                "known in the axes of the sensor alone.",
                hint="leave --tool out where the controller takes gravity off by itself.",
            )
        frame = _FRAMES[block.frame]
        if frame != self._axes:
            self._axes = frame
            joints = np.array(self._state["joints_of_pose"][0])
            if np.isfinite(joints).all():
                write_pose(joints, frame, self._constants, self._pose)
        return frame


def _start(models: SensingModels) -> Oscillators | None:
    """Returns the initial state of the modal filter."""
    response = models.response
    if isinstance(response, PoseResponse):
        middle = models.robot.limits.mean(axis=1)
        return join_oscillators([_modes(response, middle).oscillators(), response.tool])
    return None if response is None else response.oscillators


def _modes(response: PoseResponse, joints: Array) -> PoseModes:
    """Modes at a pose; beyond a limit those at the limit, and the estimate is invalid there."""
    limits = response.arm.robot.limits
    return pose_modes(response.arm, np.clip(joints, limits[:, 0], limits[:, 1]))
