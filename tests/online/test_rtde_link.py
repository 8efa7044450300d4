"""The link to a Universal Robots controller against the simulated one."""

import asyncio
import socket
import struct

import numpy as np
import pytest
from simulated import (
    controller,
    flagged,
    rows,
    rtde_settings,
    scenario,
    timed,
    until,
    until_shown,
)

from robotrue.errors import ConfigurationError
from robotrue.online import rtde
from robotrue.online.blocks import Flag
from robotrue.online.rtde_link import RtdeForce, RtdeSettings, RtdeSource
from robotrue.robot.forward import forward


def test_joints_and_pose_that_belong_together():
    async def work():
        async with controller() as there:
            source = RtdeSource(rtde_settings(there.port))
            return await until(source, rows(100)), source.health(), there

    found, health, there = timed(work())
    joints = np.concatenate([b.joints for b in found])
    poses = np.concatenate([b.T_frame_tool for b in found])
    robot = scenario().robot
    model = robot.controller.to_model(joints)
    np.testing.assert_allclose(forward(robot, model), poses, atol=1e-6)
    time = np.concatenate([b.controller_time for b in found])
    elapsed = (np.diff(np.concatenate([b.sequence for b in found])) == 1).mean()
    assert elapsed > 0.5
    assert time[0] > 100.0  # its own clock
    assert (health.refused, health.reconnects) == (0, 0)
    assert health.received == len(joints)
    assert there.report.clients == 1


def test_force_in_base_axes():
    async def work():
        async with controller() as there:
            source = RtdeForce(rtde_settings(there.port, rate=125.0))
            return await until(source, rows(30))

    found = timed(work())
    assert found[0].frame == "base"
    assert np.concatenate([b.valid for b in found]).all()
    time = np.concatenate([b.controller_time for b in found])
    steps = np.diff(time) * 125.0
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-3)
    assert np.isfinite(np.concatenate([b.wrench for b in found])).all()


def test_two_clients_at_once():
    async def work():
        async with controller() as there:
            joints = RtdeSource(rtde_settings(there.port))
            force = RtdeForce(rtde_settings(there.port, rate=250.0))
            return await asyncio.gather(until(joints, rows(50)), until(force, rows(25)))

    joints, force = timed(work())
    assert abs(joints[-1].controller_time[-1] - force[-1].controller_time[-1]) < 5.0


@pytest.mark.parametrize(
    ("fault", "flag"),
    [
        ("gap@0.2+0.1", Flag.GAP),
        ("nan@0.2+0.1", Flag.NOT_FINITE),
        ("repeat@0.2+0.1", Flag.REPEATED),
        ("reorder@0.2+0.2", Flag.REORDERED),
        ("jump@0.3", Flag.CLOCK_JUMP),
    ],
)
@pytest.mark.parametrize("kind", [RtdeSource, RtdeForce])
def test_what_goes_wrong_is_said(fault, flag, kind):
    found, _, _ = timed(
        until_shown(
            lambda: controller(fault),
            lambda port: kind(rtde_settings(port)),
            flagged(flag, 80),
        )
    )
    valid = np.concatenate([b.valid for b in found])
    flags = np.concatenate([b.flags for b in found])
    assert valid[-50:].all()
    if flag in Flag.INVALID:
        assert not valid[(flags & int(flag)) != 0].any()


@pytest.mark.parametrize("fault", ["garble@0.2+0.05", "silence@0.2+0.2"])
def test_a_stream_out_of_step_or_cut_is_opened_again(fault):
    async def work():
        async with controller(fault) as there:
            source = RtdeSource(rtde_settings(there.port))
            stream, found = source.blocks(), []
            async for block in stream:
                found.append(block)
                if source.health().reconnects and rows(150)(found):
                    break
            await stream.aclose()
            return found, source.health(), there.report

    found, health, report = timed(work())
    assert health.refused == (1 if "garble" in fault else 0)
    assert health.last_fault
    assert health.lost > 0  # its clock went on meanwhile
    assert report.clients >= 2
    sequence = np.concatenate([b.sequence for b in found])
    assert (np.diff(sequence) > 0).all()


def test_a_controller_killed_and_started_again():
    async def work():
        async with controller() as first:
            source = RtdeSource(rtde_settings(first.port))
            stream, port = source.blocks(), first.port
            seen = 0
            while seen < 60:
                seen += len(await anext(stream))
        async with controller(port=port, started=5.0):
            found = []
            async for block in stream:
                found.append(block)
                if flagged(Flag.CLOCK_JUMP, 20)(found):
                    break
            await stream.aclose()
        return found, source.health()

    found, health = timed(work())
    flags = np.concatenate([b.flags for b in found])
    assert ((flags & int(Flag.CLOCK_JUMP)) != 0).sum() == 1
    assert health.reconnects == 1


def test_nobody_there():
    async def work():
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))
            port = taken.getsockname()[1]
        source = RtdeSource(rtde_settings(port))
        reading = asyncio.ensure_future(until(source, rows(1)))
        while "lost" not in source.health().last_fault:
            await asyncio.sleep(0.01)
        await source.close()
        return await reading

    assert timed(work()) == []


async def _odd(answers):
    """A server that answers each request by its letter; the port it has."""

    async def serve(reader, writer):
        rest = b""
        while data := await reader.read(4096):
            frames, rest = rtde.split_frames(rest + data)
            for frame in frames:
                writer.write(answers.get(frame.kind, b""))
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    return server, server.sockets[0].getsockname()[1]


YES = {kind: rtde.write_frame(kind, b"\x01") for kind in "VSP"}


@pytest.mark.parametrize(
    ("answers", "message"),
    [
        ({"V": rtde.write_frame("V", b"\x00")}, "does not speak RTDE protocol 2"),
        (
            {**YES, "O": rtde.write_frame("O", b"\x00DOUBLE,NOT_FOUND,VECTOR6D")},
            "actual_q is NOT_FOUND",
        ),
        (
            {
                **YES,
                "O": rtde.write_frame("O", b"\x01DOUBLE,VECTOR6D,VECTOR6D"),
                "S": rtde.write_frame("S", b"\x00"),
            },
            "does not start the stream",
        ),
    ],
)
def test_a_controller_that_cannot_serve_is_named(answers, message):
    async def work():
        server, port = await _odd(answers)
        async with server:
            await until(RtdeSource(rtde_settings(port)), rows(1))

    with pytest.raises(ConfigurationError, match=message):
        timed(work())


def test_words_of_the_controller_are_kept_and_halves_are_joined():
    """The start and the data come in one piece, with a message between them, cut anywhere."""
    recipe = rtde.Recipe(number=1, names=rtde.JOINT_NAMES, types=("DOUBLE", "VECTOR6D", "VECTOR6D"))

    def data(tick):
        values = {
            "timestamp": (tick / 500.0,),
            "actual_q": (0.1,) * 6,
            "actual_TCP_pose": (0.2,) * 6,
        }
        return rtde.write_data(recipe, values)

    said = b"\x04stop\x06safety\x00"
    text = rtde.write_frame("M", said)
    start = YES["S"] + data(100) + text + b"".join(data(t) for t in range(101, 140))
    answers = {**YES, "O": rtde.write_recipe("O", recipe), "S": start + data(140)[:20]}

    async def work():
        server, port = await _odd(answers)
        async with server:
            source = RtdeSource(rtde_settings(port))
            return await until(source, rows(40)), source.health()

    found, health = timed(work())
    np.testing.assert_array_equal(np.concatenate([b.sequence for b in found]), np.arange(100, 140))
    assert health.last_fault == "safety: stop"


def test_a_simulated_controller_answers_like_one():
    async def work():
        async with controller() as there:
            reader, writer = await asyncio.open_connection("127.0.0.1", there.port)

            async def ask(request):
                writer.write(request)
                head = await reader.readexactly(3)
                size, kind = struct.unpack(">HB", head)
                return chr(kind), await reader.readexactly(size - 3)

            found = [
                await ask(rtde.write_protocol_request()),
                await ask(rtde.write_frame("V", struct.pack(">H", 1))),
                await ask(rtde.write_frame("v")),
                await ask(rtde.write_frame("S")),  # nothing was asked for
                await ask(rtde.write_output_request(("timestamp", "actual_speed"), 125.0)),
                await ask(rtde.write_frame("I", b"speed_slider_mask")),
            ]
            writer.write(b"\x00\x01?")
            assert await reader.read() == b""  # what is no RTDE is hung up on
            writer.close()
            return found, there.report

    found, report = timed(work())
    assert [body for _, body in found[:2]] == [b"\x01", b"\x00"]
    assert found[3] == ("S", b"\x00")
    assert found[4] == ("O", b"\x00DOUBLE,NOT_FOUND")
    assert found[5][1].endswith(b"NOT_FOUND")
    assert report.refused == 1


def test_settings_that_would_not_do():
    with pytest.raises(ConfigurationError, match="rate 600 Hz"):
        RtdeSettings(name="rtde://x", host="x", rate=600.0)
    with pytest.raises(ConfigurationError, match="silence longer than two"):
        RtdeSettings(name="rtde://x", host="x", rate=2.0, silence=1.0)
