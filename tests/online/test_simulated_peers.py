"""``robotrue simulate`` as other projects' clients see it; skipped where they are not installed."""

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager

import numpy as np
import pytest

from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.robot.forward import forward
from robotrue.simulation.online_scenario import online_scenario

HOST = "127.0.0.78"
"""ur-rtde knows one port only; another loopback address keeps it to ourselves."""
LIMIT = 20.0


@contextmanager
def simulated(*arguments):
    """What a simulator in a process of its own says; Ctrl-C at the end, and then its table."""
    command = [sys.executable, "-c", "from robotrue.cli.main import run; run()", "simulate"]
    with subprocess.Popen(  # noqa: S603 (our own command line)
        [*command, *arguments, "--seconds", f"{LIMIT:g}"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "COLUMNS": "200"},
    ) as process:
        said = []
        try:
            for line in process.stderr:
                said.append(line)
                if "Ctrl-C ends it" in line or line.startswith("robotrue:"):
                    break
            yield said
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
            out, _ = process.communicate(timeout=LIMIT)
            said.append(out)
            assert process.returncode == 0 or "robotrue:" in said[-2]


@pytest.mark.parametrize(("kind", "head"), [("egm", b"\x0a"), ("rsi", b"<Rob")])
def test_port_zero_is_a_free_port_that_packets_go_to(kind, head):
    with simulated(kind, "--port", "0") as said:
        told = "".join(said)
        port = int(told.split("sends to udp 127.0.0.1:")[1].split(" ")[0])
        assert port > 0
        assert f"{kind}://127.0.0.1:{port}?" in told
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
            listener.settimeout(LIMIT)
            listener.bind(("127.0.0.1", port))
            assert listener.recv(65535).startswith(head)


@pytest.mark.peer
def test_ur_rtde_reads_the_simulated_controller():
    peer = pytest.importorskip("rtde_receive", reason="pip install ur-rtde")
    with simulated("rtde", "--host", HOST) as said:
        if "cannot be opened" in said[-1]:
            pytest.skip(said[-1])
        client = peer.RTDEReceiveInterface(
            HOST, 500.0, ["timestamp", "actual_q", "actual_TCP_pose"]
        )
        found = []
        until = time.monotonic() + 10.0
        while len(found) < 20 and time.monotonic() < until:
            one = client.getTimestamp(), client.getActualQ(), client.getActualTCPPose()
            if one[0] == client.getTimestamp() and (not found or one[0] > found[-1][0]):
                found.append(one)
            time.sleep(1e-3)
        client.disconnect()
    assert len(found) == 20
    robot = online_scenario(0, "UR10").robot
    joints, poses = np.array([f[1] for f in found]), np.array([f[2] for f in found])
    ours = forward(robot, robot.controller.to_model(joints))
    # it may take two values from packets on either side of one: 2 ms of the fastest knock
    np.testing.assert_allclose(ours[:, :3, 3], poses[:, :3], atol=5e-4)
    turn = matrix_from_rotation_vector(poses[:, 3:])
    np.testing.assert_allclose(ours[:, :3, :3], turn, atol=5e-3)


@pytest.mark.peer
def test_pynetft_reads_the_simulated_sensor():
    pynetft = pytest.importorskip("pynetft", reason="pip install pynetft")
    with simulated("rdt", "--port", "0", "--page-port", "0") as said:
        told = "".join(said)
        port = int(told.split("udp 127.0.0.1:")[1].split(",")[0])
        page = int(told.split("http://127.0.0.1:")[1].split("/")[0])
        config = pynetft.Config(sensor_host="127.0.0.1", rdt_port=port, http_port=page)
        with pynetft.Client(config) as client:
            client.start()
            assert client.wait_for_first_sample(10.0)
            sample = client.latest_sample()
            health = client.health()
    scenario = online_scenario(0)
    whole = scenario.sensor_wrench(np.arange(0.0, 32.0, 1e-3))
    wrench = np.array([*sample.force, *sample.torque])
    assert (wrench > whole.min(axis=0) - 1.0).all()
    assert (wrench < whole.max(axis=0) + 1.0).all()
    assert np.linalg.norm(wrench[:3]) > 1.0  # the weight, if nothing else
    assert (health.state, health.fault_code) == (
        pynetft.ClientState.STREAMING,
        pynetft.FaultCode.NONE,
    )
    assert health.duplicate_count == health.out_of_order_count == health.malformed_count == 0
    assert said[0].startswith("SIMULATED ATI force sensor")
    assert "SIMULATED ATI force sensor" in said[-1]  # the table after Ctrl-C
    assert "withheld by a fault" in said[-1]
