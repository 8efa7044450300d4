"""A robot that carries the foot: its model, and joints from its controller."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.app.number_options import parse_numbers
from robotrue.app.registered import open_model
from robotrue.calibration.model import ErrorModel
from robotrue.core.arrays import Array
from robotrue.core.rotations import abc_from_matrix, matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.drilling.adjust import HoleAdjustment
from robotrue.drilling.head import AxisOrder, normal_from_tilt
from robotrue.drilling.robot_adjust import squaring_joints
from robotrue.errors import ConfigurationError, ImplausibleDataError, ModelMismatchError
from robotrue.online.addresses import SourceSettings, open_stream
from robotrue.online.blocks import JointBlock
from robotrue.online.link import StreamSource
from robotrue.robot.statics import Load

OLDEST: Final = 0.5
"""s; older joints do not determine the robot's pose."""
STILL: Final = 5e-3 * DEG
"""rad, largest motion of a joint while the robot is at rest."""


class DrillingRobot:
    """A calibrated robot and the latest joints of its controller.

    Args:
        model: The calibrated robot, its tool at the drill's tip.
        load: Its payload.
        order: Axis order of the tilts.
        R_tool_foot: (3, 3) foot in tool.
        source: Of joints.
        still: s in which no joint may have moved.
    """

    def __init__(
        self,
        model: ErrorModel,
        load: Load,
        order: AxisOrder,
        R_tool_foot: Array,
        source: StreamSource[JointBlock],
        *,
        still: float,
    ) -> None:
        self._model, self._load, self._order = model, load, order
        self._seat, self._still = R_tool_foot, still
        self._recent: deque[tuple[float, Array]] = deque()
        self.source = source

    async def follow(self) -> None:
        """Receives the joints of the controller, until the source ends."""
        async for block in self.source.blocks():
            self.take(block)

    def take(self, block: JointBlock) -> None:
        """Takes joints as the controller displays them; a flagged sample forgets those before.

        Raises:
            ModelMismatchError: Joints of another arm.
        """
        if block.joints.shape[1] != self._model.robot.dof:
            raise ModelMismatchError(
                f"{block.joints.shape[1]} joints of the controller, {self._model.robot.name} has "
                f"{self._model.robot.dof}."
            )
        for at, joints, valid in zip(
            block.host_time.tolist(), block.joints, block.valid.tolist(), strict=True
        ):
            if not valid or np.isnan(joints).any():
                self._recent.clear()
                continue
            self._recent.append((at, joints))
            # one sample before the time of rest stays: it proves the time is filled
            while len(self._recent) > 1 and at - self._recent[1][0] >= self._still:
                self._recent.popleft()

    def move(self, found: HoleAdjustment, now: float) -> dict[str, object]:
        """Returns the robot's target as the machine receives it: deg and mm.

        Args:
            found: Tilt of the surface.
            now: s on the monotonic clock.

        Raises:
            ImplausibleDataError: The joints are not known, or still move.
            ReachError: The robot cannot.
            ConvergenceError: The joints were not found.
        """
        robot = self._model.robot
        joints = self._standing(now)
        model_joints = robot.controller.to_model(joints)
        normal = normal_from_tilt(self._order, found.tilt)
        move = squaring_joints(
            self._model, model_joints, normal, R_tool_foot=self._seat, load=self._load
        )
        shown = robot.controller.to_controller(move.joints)
        a, b, c = (abc_from_matrix(move.T_base_tool[:3, :3]) / DEG).tolist()
        return {
            **{f"a{k + 1}_deg": v / DEG for k, v in enumerate(shown.tolist())},
            **{
                f"{n}_mm": v / MM
                for n, v in zip("xyz", move.T_base_tool[:3, 3].tolist(), strict=True)
            },
            "rx_deg": c,
            "ry_deg": b,
            "rz_deg": a,
            "turn_deg": move.turn / DEG,
            "rotation_error": "known" if move.rotation_known else "not known: nominal axis",
        }

    def _standing(self, now: float) -> Array:
        """Returns (n,) rad as displayed, of a robot at rest."""
        if not self._recent or now - self._recent[-1][0] > OLDEST:
            age = now - self._recent[-1][0] if self._recent else np.inf
            raise ImplausibleDataError(
                f"the joints of the robot are {age:.2f} s old, up to {OLDEST:g} s are used.",
                hint="is the controller sending, and is this its address?",
            )
        span = self._recent[-1][0] - self._recent[0][0]
        if span < self._still:
            raise ImplausibleDataError(
                f"joints of the last {span:.3f} s are sound, {self._still:g} s are needed.",
                hint="clamp again.",
            )
        moved = np.ptp([joints for _, joints in self._recent], axis=0)
        if moved.max() > STILL:
            raise ImplausibleDataError(
                f"joint {int(np.argmax(moved)) + 1} moves by {moved.max() / DEG:.4f} deg, up to "
                f"{STILL / DEG:g} deg count as a robot at rest.",
                hint="clamp when the robot has come to rest.",
            )
        return np.asarray(np.mean([joints for _, joints in self._recent], axis=0))


def carrying_robot(path: Path, foot_abc_deg: str) -> tuple[ErrorModel, Load, Array]:
    """Returns the calibrated robot that carries a foot, its load, and the foot in tool (3, 3).

    Raises:
        ConfigurationError: A cell instead of a calibrated model, or no three angles.
    """
    cell, robot = open_model(path)
    if robot is None:
        raise ConfigurationError(
            "a cell, not a calibrated model.", source=path, hint="pass a model of `calibrate`."
        )
    angles = parse_numbers("--foot-abc-deg", foot_abc_deg, 3, form="A,B,C") * DEG
    return robot, cell.payload, matrix_from_abc(angles)


def drilling_robot(
    path: Path, address: str | None, order: AxisOrder, foot_abc_deg: str, *, still: float
) -> DrillingRobot:
    """Returns the robot of a model file, its link open.

    Raises:
        ConfigurationError: No address of its joints, or a cell instead of a calibrated model.
    """
    if address is None:
        raise ConfigurationError(
            "--robot without --joints: state the joints of the robot.",
            hint="--joints rsi://0.0.0.0:49152?cycle=4ms, or rtde://HOST.",
        )
    model, load, seat = carrying_robot(path, foot_abc_deg)
    source = open_stream(address, "robot", SourceSettings())
    return DrillingRobot(model, load, order, seat, source, still=still)


@contextlib.asynccontextmanager
async def follow_joints(robot: DrillingRobot | None) -> AsyncIterator[asyncio.Task[None] | None]:
    """Follows a robot's joints while the context lasts; gives the task, or None without a robot."""
    if robot is None:
        yield None
        return
    task = asyncio.create_task(robot.follow())
    try:
        yield task
    finally:
        await robot.source.close()
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


def with_robot(
    document: Mapping[str, object], found: HoleAdjustment, robot: DrillingRobot
) -> dict[str, object]:
    """Returns an answer with where the robot has to go instead of a head's axes."""
    head = {f"{d}{axis}_{unit}" for d in ("", "d") for axis in "ABXYZ" for unit in ("deg", "mm")}
    kept = {name: value for name, value in document.items() if name not in head}
    return {**kept, **robot.move(found, time.monotonic())}
