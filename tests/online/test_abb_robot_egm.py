"""ABBRobotEGM, another project's end of EGM: it drives our simulated robot, and feeds our link."""

import asyncio
import socket
import time
from dataclasses import replace

import numpy as np
import pytest
from robots import WAIT, Robot, milling_force, until

from robotrue.core.units import DEG, MM
from robotrue.online import egm
from robotrue.online.egm import RobotWare
from robotrue.online.egm_link import EgmSettings, EgmSource
from robotrue.online.guard import CorrectionGuard, CorrectionLimits
from robotrue.online.robot_correction import Correction, CorrectionMode
from robotrue.robot.presets import preset
from robotrue.simulation.cyclic_controller import Jog
from robotrue.simulation.egm_controller import EgmController, EgmControllerSettings

pytestmark = pytest.mark.peer
peer = pytest.importorskip("ABBRobotEGM", reason="pip install ABBRobotEGM")


def _jog():
    return Jog(robot=preset("irb6660"), joints=np.array([0.0, 0.0, 0.0, 0.0, 45.0, 0.0]) * DEG)


class Client(peer.EGM):
    """Its class, on this computer alone and on a free port; it has no option for the address."""

    def __init__(self):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.send_sequence_number, self.egm_addr, self.count = 0, None, 0


def test_it_reads_our_simulated_robot_and_corrects_its_path():
    async def session(client):
        settings = EgmControllerSettings(
            target=client.socket.getsockname(),
            generation=RobotWare.SEVEN,
            motion=_jog(),
            force=milling_force,
        )
        stop = asyncio.Event()
        robot = asyncio.create_task(EgmController(settings).run(stop=stop))

        def answer():
            states = []
            for _ in range(60):
                good, state = client.receive_from_robot(WAIT)
                assert good
                assert client.send_to_robot_path_corr(np.array([0.0, 0.3, 0.0]), age=4)
                states.append(state)
            return states

        states = await asyncio.wait_for(asyncio.to_thread(answer), 60.0)
        stop.set()
        return states, await asyncio.wait_for(robot, 10.0)

    with Client() as client:
        states, report = asyncio.run(session(client))
    assert [s.header.seqno for s in states] == list(range(states[0].header.seqno, 60))
    assert all(s.motors_on and s.rapid_running for s in states)
    first = states[0]
    (shown,), (T_base_tool,) = _jog().along(np.array([first.header.tm * 1e-3]))
    np.testing.assert_allclose(first.joint_angles, shown / DEG, atol=1e-9)
    np.testing.assert_allclose(first.measured_force, milling_force(first.header.tm * 1e-3))
    np.testing.assert_allclose(first.cartesian.pos, T_base_tool[:3, 3] / MM, atol=1e-6)
    assert report.corrections >= 59
    assert report.faulty == 0
    # one lag of 20 ms is five cycles
    assert report.offset[1] == pytest.approx(0.3 * MM, rel=0.01)


def test_its_joint_targets_are_read_without_a_time_in_the_header():
    """It sends none, and the proto does not ask for one."""
    with Client() as client, Robot(client.socket.getsockname()) as robot:
        robot.send(egm.write_robot(_message(0), RobotWare.SEVEN))
        assert client.receive_from_robot(WAIT)[0]
        client.send_to_robot(joint_angles=np.arange(6.0))
        seqno, joints, pose = egm.read_target(robot.socket.recv(65535))
    assert (seqno, joints, pose) == (0, (0.0, 1.0, 2.0, 3.0, 4.0, 5.0), None)


def _message(seqno):
    return egm.EgmRobot(
        seqno=seqno,
        tm_ms=4 * seqno,
        joints_deg=(0.0, 1.0, 2.0, 3.0, 4.0, 5.0),
        guidance=egm.GuidanceState.RUNNING,
    )


@pytest.fixture
def egm_pb2():
    return pytest.importorskip("ABBRobotEGM._egm_protobuf.egm_pb2")


def test_messages_of_its_generated_code_are_answered_in_its_terms(egm_pb2):
    limits = CorrectionLimits(shift=1 * MM, shift_rate=1.0, cycle=4e-3, timeout=5.0, ramp=0.0)
    guard = CorrectionGuard(replace(limits, late_answers=1000), CorrectionMode.ABSOLUTE)
    wanted = Correction(
        shift=np.array([0.0, 0.1, -0.2]) * MM, turn=np.zeros(3), mode=CorrectionMode.ABSOLUTE
    )

    def play(robot, source):
        for n in range(20):
            message = egm_pb2.EgmRobot()
            message.header.seqno, message.header.tm = n, 4 * n
            message.header.mtype = egm_pb2.EgmHeader.MSGTYPE_DATA
            message.feedBack.joints.joints.extend(range(6))
            message.mciState.state = egm_pb2.EgmMCIState.MCI_RUNNING
            message.measuredForce.fcActive = True
            message.measuredForce.force.extend([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
            guard.want(wanted, time.monotonic())
            answer = egm_pb2.EgmSensorPathCorr.FromString(robot.ask(message.SerializeToString()))
            assert answer.header.mtype == egm_pb2.EgmHeader.MSGTYPE_PATH_CORRECTION
        until(lambda: source.force().health().received == 20)
        return answer.pathCorr

    async def session():
        settings = EgmSettings(
            name="egm://peer",
            generation=RobotWare.SEVEN,
            mode=CorrectionMode.ABSOLUTE,
            host="127.0.0.1",
            port=0,
        )
        source = EgmSource(settings, guard)
        force = source.force()
        with Robot(source.address) as robot:
            last = await asyncio.wait_for(asyncio.to_thread(play, robot, source), 30.0)
            await source.close()
        return last, [block async for block in force.blocks()]

    last, forces = asyncio.run(session())
    np.testing.assert_allclose([last.pos.x, last.pos.y, last.pos.z], [0.0, 0.1, -0.2], atol=1e-5)
    np.testing.assert_allclose(forces[0].wrench[0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
