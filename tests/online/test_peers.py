"""Our packets read by other projects' codecs, and theirs by ours; skipped where not installed."""

import socket
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from online_cases import CONFIG, EGM_JOINT_TARGET, EGM_POSE_TARGET, FORCE, JOINTS, NETFT, ROB
from rdt_records import RdtRecord, force_sample, write_record

from robotrue.core.units import MM
from robotrue.errors import FormatError
from robotrue.online import egm, rdt, rsi, rsi_answer
from robotrue.online.device_defaults import RTDE_PORT
from robotrue.online.robot_correction import Correction, CorrectionMode
from robotrue.online.rsi_config import parse_rsi_config

pytestmark = pytest.mark.peer
ABSOLUTE = CorrectionMode.ABSOLUTE


@pytest.fixture
def echo_server(tmp_path, monkeypatch):
    # it makes a folder of logs where it is imported
    monkeypatch.chdir(tmp_path)
    server = pytest.importorskip("RSIPI.rsi_echo_server", reason="pip install RSIPI")
    path = tmp_path / "RSI_EthernetConfig.xml"
    path.write_bytes(CONFIG.replace(b"192.0.2.1", b"127.0.0.1").replace(b"G\xf6ppingen", b"here"))
    try:
        echo = server.EchoServer(str(path), mode="absolute")
    except OSError as cause:
        pytest.skip(f"its fixed port 50000 is taken: {cause}")
    yield echo
    echo.udp_socket.close()


def test_rsipi_takes_our_answers_and_we_its_packets(echo_server):
    config = parse_rsi_config(CONFIG)
    before = 0.0
    for cycle in range(5):
        sent = echo_server.generate_message().encode()
        packet = rsi.read_rob(sent, config)
        assert packet == rsi.read_rob(rsi_answer.write_rob(packet))
        assert rsi.read_rob_fast(sent).joints_deg == packet.joints_deg
        echo_server.last_sent_ipoc = packet.ipoc
        shift = Correction(shift=np.array([0, 0, cycle]) * MM, turn=np.zeros(3), mode=ABSOLUTE)
        answer = rsi_answer.SenWriter(config, ABSOLUTE).write(packet.ipoc, shift)
        assert echo_server.process_reply(answer.decode()) is True
        pose = rsi.read_rob(echo_server.generate_message().encode()).pose_mm_deg
        assert pose is not None
        assert cycle == 0 or pose[2] - before == pytest.approx(1.0)
        before = pose[2]
        echo_server.ipoc_value += 4
    wrong = rsi_answer.SenWriter(config, ABSOLUTE).write(packet.ipoc + 7, shift).decode()
    assert echo_server.process_reply(wrong) is False


def test_rsipi_reads_our_configuration_alike(echo_server):
    config = parse_rsi_config(CONFIG)
    assert echo_server.config.network_settings["sentype"] == config.sen_type
    holds = {e.tag: int(e.hold) for e in config.receive if e.tag.startswith(("RKorr", "DiO"))}
    assert holds.items() <= echo_server.holdon_map.items()
    assert rsi.read_rob(ROB, config).late == 0


@pytest.fixture
def egm_pb2():
    return pytest.importorskip(
        "ABBRobotEGM._egm_protobuf.egm_pb2", reason="pip install ABBRobotEGM"
    )


def _robot():
    return egm.EgmRobot(
        seqno=300,
        tm_ms=4000,
        joints_deg=JOINTS,
        pose=egm.EgmPose(xyz_mm=(1.0, 2.0, 3.0), quat_wxyz=(1.0, 0.0, 0.0, 0.0)),
        planned_deg=JOINTS,
        clock=(1_700_000_000, 999_999),
        motors=egm.MotorState.ON,
        guidance=egm.GuidanceState.RUNNING,
        converged=False,
        rapid=egm.RapidState.RUNNING,
        force_sent=True,
        force_active=True,
        force=FORCE,
    )


def test_protobuf_itself_reads_and_writes_the_same(egm_pb2):
    robot = _robot()
    message = egm_pb2.EgmRobot.FromString(egm.write_robot(robot, egm.RobotWare.SEVEN))
    assert message.header.seqno == 300
    assert tuple(message.feedBack.joints.joints) == JOINTS
    assert tuple(message.measuredForce.force) == FORCE
    assert message.feedBack.time.usec == 999_999
    assert message.IsInitialized()
    assert egm.read_robot(message.SerializeToString(), egm.RobotWare.SEVEN) == robot


def test_the_trap_is_real(egm_pb2):
    """The generated code reads RobotWare 6 as an empty list without a word; we refuse it."""
    six = egm.write_robot(_robot(), egm.RobotWare.SIX)
    assert list(egm_pb2.EgmRobot.FromString(six).measuredForce.force) == []
    with pytest.raises(FormatError, match="RobotWare 6"):
        egm.read_robot(six, egm.RobotWare.SEVEN)


def test_protobuf_reads_what_we_send_to_the_robot(egm_pb2):
    for target in (EGM_JOINT_TARGET, EGM_POSE_TARGET):
        sensor = egm_pb2.EgmSensor.FromString(target)
        assert sensor.header.mtype == 3
        assert egm.read_target(sensor.SerializeToString()) == egm.read_target(target)
    shift = Correction(shift=np.array([0.0, 0.5 * MM, 0.0]), turn=np.zeros(3), mode=ABSOLUTE)
    path = egm_pb2.EgmSensorPathCorr.FromString(egm.write_path_correction(6, 24, shift, 0.004))
    assert (path.pathCorr.pos.y, path.pathCorr.age, path.header.mtype) == (0.5, 4, 4)


def test_pynetft_reads_our_records():
    pynetft = pytest.importorskip("pynetft", reason="pip install pynetft")
    scale = rdt.parse_netftapi(NETFT)
    counts = (1_500_000, -2_000_000, 250_000_000, 250_000, -500_000, 3)
    stop = threading.Event()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as server:
        server.bind(("127.0.0.1", 0))
        server.settimeout(0.002)
        commands = []

        def serve():
            client, number = None, 0
            while not stop.is_set():
                try:
                    data, address = server.recvfrom(64)
                    command, _ = rdt.read_request(data)
                    commands.append(command)
                    client = address if command is rdt.RdtCommand.START else client
                except TimeoutError:
                    pass
                if client is not None:
                    number += 1
                    record = RdtRecord(
                        rdt_sequence=number, ft_sequence=number, status=0, counts=counts
                    )
                    server.sendto(write_record(record), client)

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            sample = _first_sample(pynetft, server.getsockname()[1])
        finally:
            stop.set()
            thread.join()
    ours = force_sample(
        RdtRecord(rdt_sequence=1, ft_sequence=1, status=0, counts=counts),
        scale,
        0.0,
        device=rdt.RdtDevice.NET,
        rate=1000.0,
    )
    np.testing.assert_allclose([*sample.force, *sample.torque], ours.wrench, rtol=1e-12)
    assert rdt.RdtCommand.START in commands


def _first_sample(pynetft, port):
    calibration = pynetft.Calibration(
        counts_per_force_unit=1e6,
        counts_per_torque_unit=1e6,
        force_unit=pynetft.ForceUnit.NEWTON,
        torque_unit=pynetft.TorqueUnit.NEWTON_METER,
    )
    config = pynetft.Config(
        sensor_host="127.0.0.1", rdt_port=port, calibration_override=calibration
    )
    with pynetft.Client(config) as client:
        client.start()
        assert client.wait_for_first_sample(5.0)
        return client.latest_sample()


RTDE_NAMES = ("timestamp", "actual_q", "actual_TCP_pose")
RTDE_HOST = "127.0.0.77"
"""The peer knows one port only; another loopback address keeps it to ourselves."""


def test_ur_rtde_reads_our_packets():
    peer = pytest.importorskip("rtde_receive", reason="pip install ur-rtde")
    # the peer's constructor waits without letting Python run: the robot is another process
    command = [sys.executable, str(Path(__file__).with_name("rtde_robot.py")), RTDE_HOST]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as robot:  # noqa: S603
        try:
            assert robot.stdout is not None
            if robot.stdout.readline().strip() != "ready":
                pytest.skip(f"{RTDE_HOST}:{RTDE_PORT} cannot be opened")
            client = peer.RTDEReceiveInterface(RTDE_HOST, 500.0, list(RTDE_NAMES))
            joints, pose = client.getActualQ(), client.getActualTCPPose()
            client.disconnect()
        finally:
            robot.kill()
    assert joints == [0.1, -1.5, 1.5, 0.0, 0.5, 3.0]
    assert pose == [0.5, 0.1, 0.2, 0.0, 0.0, 1.0]
