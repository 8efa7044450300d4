"""A robot that carries the foot: its joints from the controller, or no move."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator

import numpy as np
import pytest
from known_arms import HOME, TURNED, known_arm

from robotrue.app.drilling_robot import DrillingRobot, follow_joints, with_robot
from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM
from robotrue.drilling.adjust import HoleAdjustment
from robotrue.drilling.head import HeadMove, normal_from_tilt
from robotrue.drilling.robot_adjust import squaring_joints
from robotrue.errors import ImplausibleDataError, ModelMismatchError
from robotrue.online.addresses import SourceSettings, open_stream
from robotrue.online.blocks import Flag, JointBlock
from robotrue.online.link import Health
from robotrue.online.robot_correction import CorrectionMode
from robotrue.online.rsi_config import usual_rsi_config
from robotrue.robot.statics import NO_LOAD
from robotrue.simulation.cyclic_controller import Jog
from robotrue.simulation.rsi_controller import RsiController, RsiControllerSettings

TILT = np.array([1.5, -0.8]) * DEG
FOUND = HoleAdjustment(
    tilt=TILT, covariance=np.eye(2) * 1e-10,
    move=HeadMove(axes=TILT, turn=TILT, shift=np.full(3, np.nan)),
    theoretical=TILT, notes=(),
)  # fmt: skip


class Silent:
    """A source that gives nothing."""

    async def blocks(self) -> AsyncIterator[JointBlock]:
        for block in ():
            yield block

    async def close(self) -> None:
        pass

    def health(self) -> Health:
        return Health(name="silent", connected=False)


def block(at: Array, joints: Array, flags: Flag = Flag.NONE) -> JointBlock:
    return JointBlock(
        controller_time=at, host_time=at, joints=joints, sequence=np.arange(len(at)),
        T_frame_tool=np.full((len(at), 4, 4), np.nan), flags=np.full(len(at), int(flags)),
    )  # fmt: skip


def robot(source: object = None) -> DrillingRobot:
    return DrillingRobot(
        known_arm(), NO_LOAD, "AB", TURNED, source or Silent(), still=0.2  # type: ignore[arg-type]
    )  # fmt: skip


def displayed() -> Array:
    return known_arm().robot.controller.to_controller(HOME)  # type: ignore[union-attr]


def test_the_move_is_that_of_the_calibrated_robot_in_the_axes_of_its_controller() -> None:
    arm = robot()
    at = np.arange(0.0, 0.5, 4e-3)
    arm.take(block(at, np.tile(displayed(), (len(at), 1))))
    out = arm.move(FOUND, now=0.5)
    wanted = squaring_joints(known_arm(), HOME, normal_from_tilt("AB", TILT), R_tool_foot=TURNED)
    shown = known_arm().robot.controller.to_controller(wanted.joints)  # type: ignore[union-attr]
    np.testing.assert_allclose([out[f"a{k}_deg"] for k in range(1, 7)], shown / DEG, atol=1e-9)
    np.testing.assert_allclose(
        [out["x_mm"], out["y_mm"], out["z_mm"]], wanted.T_base_tool[:3, 3] / MM, atol=1e-9
    )
    assert out["turn_deg"] == pytest.approx(1.7, abs=0.01)
    assert out["rotation_error"] == "known"


@pytest.mark.parametrize(
    ("spoil", "now", "said"),
    [
        (lambda q, t: q, 2.0, r"1\.50 s old, up to 0\.5 s"),
        (lambda q, t: q + t[:, None] * 0.1 * DEG * np.eye(6)[2], 0.5, r"joint 3 moves by 0\.0"),
    ],
)
def test_joints_that_are_old_or_still_move_are_no_place_to_move_from(spoil, now, said) -> None:
    arm, at = robot(), np.arange(0.0, 0.5, 4e-3)
    arm.take(block(at, spoil(np.tile(displayed(), (len(at), 1)), at)))
    with pytest.raises(ImplausibleDataError, match=said):
        arm.move(FOUND, now=now)


def test_nothing_a_flagged_sample_and_another_arm() -> None:
    arm, at = robot(), np.arange(0.0, 0.5, 4e-3)
    with pytest.raises(ImplausibleDataError, match="inf s old"):
        arm.move(FOUND, now=0.0)
    arm.take(block(at, np.tile(displayed(), (len(at), 1))))
    arm.take(block(np.array([0.5]), displayed()[None], Flag.CLOCK_JUMP))
    arm.take(block(at[:10] + 0.504, np.tile(displayed(), (10, 1))))
    with pytest.raises(ImplausibleDataError, match=r"last 0\.036 s are sound, 0\.2 s are needed"):
        arm.move(FOUND, now=0.56)
    with pytest.raises(ModelMismatchError, match="7 joints of the controller"):
        arm.take(block(at[:1], np.zeros((1, 7))))


def test_joints_of_a_simulated_controller_over_its_own_protocol() -> None:
    async def story() -> dict[str, object]:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        source = open_stream(f"rsi://127.0.0.1:{port}?cycle=4ms", "robot", SourceSettings())
        arm = robot(source)
        standing = RsiControllerSettings(
            config=usual_rsi_config("127.0.0.1", port, hold=True),
            mode=CorrectionMode.ABSOLUTE,
            motion=Jog(robot=known_arm().robot, joints=HOME, amplitude=0.0),
            cycles=100_000,
        )
        stop = asyncio.Event()
        controller = asyncio.create_task(RsiController(standing).run(stop=stop))
        head = {"hole": "1", "status": "move", "A_deg": 1.0, "dB_deg": 2.0, "dX_mm": 0.0}
        try:
            async with follow_joints(arm), asyncio.timeout(20.0):
                while True:
                    await asyncio.sleep(0.05)
                    try:
                        return with_robot(head, FOUND, arm)
                    except ImplausibleDataError:
                        continue
        finally:
            stop.set()
            await controller

    out = asyncio.run(story())
    assert {"A_deg", "dB_deg", "dX_mm"}.isdisjoint(out)
    wanted = squaring_joints(known_arm(), HOME, normal_from_tilt("AB", TILT), R_tool_foot=TURNED)
    shown = known_arm().robot.controller.to_controller(wanted.joints)  # type: ignore[union-attr]
    # the protocol prints joints to 1e-6 deg
    np.testing.assert_allclose([out[f"a{k}_deg"] for k in range(1, 7)], shown / DEG, atol=1e-5)
