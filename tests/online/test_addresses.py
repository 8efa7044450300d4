"""Addresses of sources: what they make, and what they refuse with which words."""

import asyncio

import pytest
from online_cases import CONFIG, NETFT

from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.online.addresses import PROTOCOLS, SourceSettings, open_stream, protocol_of
from robotrue.online.answering_link import AVAILABLE, AnsweringLink
from robotrue.online.rdt import RdtDevice
from robotrue.online.rdt_link import RdtSource
from robotrue.online.replay_link import ReplayForce, ReplayJoints
from robotrue.online.robot_correction import CorrectionMode
from robotrue.online.rsi_link import RsiSource
from robotrue.online.rtde_link import RtdeForce, RtdeSource

PROCESS = pytest.mark.skipif(not AVAILABLE, reason="answering processes: Linux")


def _closed(source):
    asyncio.run(source.close())
    return source


@PROCESS
def test_rsi(tmp_path):
    config = tmp_path / "EthernetConfig.xml"
    config.write_bytes(CONFIG)
    found = _closed(open_stream(f"rsi://127.0.0.1:0?config={config}&cycle=12ms&mode=relative"))
    assert isinstance(found, AnsweringLink)
    assert (found.settings.cycle_ms, found.settings.mode) == (12, CorrectionMode.RELATIVE)
    assert found.settings.config.sen_type == "ImFree"
    with pytest.raises(ConfigurationError, match="port 5000, but the controller sends to 49152"):
        open_stream(f"rsi://127.0.0.1:5000?config={config}")


def test_rsi_without_a_configuration_takes_the_usual_one():
    here = SourceSettings(own_process=False)
    found = _closed(open_stream("rsi://127.0.0.1:0?mode=relative", "robot", here))
    assert isinstance(found, RsiSource)
    assert found.settings.config.receives("RKorr.X").hold is False
    assert found.settings.cycle_ms == 4


@PROCESS
def test_egm_and_its_force():
    robot = open_stream("egm://127.0.0.1:0?robotware=7&frame=tool", "robot")
    assert isinstance(robot, AnsweringLink)
    force = open_stream("egm://127.0.0.1:0", "force", SourceSettings(robot=robot))
    assert force is robot.force()
    with pytest.raises(ConfigurationError, match="the robot is egm://127"):
        open_stream("egm://127.0.0.1:9", "force", SourceSettings(robot=robot))
    _closed(robot)
    with pytest.raises(ConfigurationError, match="the robot's source is another"):
        open_stream("egm://127.0.0.1:0", "force")


def test_rtde():
    joints = open_stream("rtde://192.0.2.7?rate=125Hz")
    assert isinstance(joints, RtdeSource)
    assert isinstance(open_stream("RTDE://192.0.2.7?rate=125", "force"), RtdeForce)
    assert joints.health().name == "rtde://192.0.2.7:30004"
    assert not joints.health().connected


def test_rdt(tmp_path):
    page = tmp_path / "netftapi2.xml"
    page.write_bytes(NETFT.replace(b"</netft>", b"<comrdtrate>7000</comrdtrate></netft>"))
    found = open_stream(f"rdt://192.0.2.1?scale={page}&device=axia&frame=tool", "force")
    assert isinstance(found, RdtSource)
    made = found._settings
    assert (made.rate, made.device, made.frame) == (7000.0, RdtDevice.AXIA, "tool")
    assert made.scale.newton == pytest.approx(1e-6)
    made = open_stream(f"rdt://192.0.2.1?scale={page}&rate=1000 Hz", "force")._settings
    assert made.rate == 1000.0
    made = open_stream("rdt://192.0.2.1?scale=http", "force")._settings
    assert (made.page, made.scale) == ("http://192.0.2.1/netftapi2.xml", None)


def test_replay(tmp_path):
    path = tmp_path / "two words.csv"
    path.write_text("t_s,fx_N,fy_N,fz_N\n0,1,2,3\n")
    settings = SourceSettings(start_row=5)
    found = open_stream(
        f"replay://{path}?speed=1&from=3&repeat=forever&period=60s", "force", settings
    )
    assert isinstance(found, ReplayForce)
    made = found._settings
    assert (made.speed, made.start, made.repeats.times, made.repeats.period) == (1, 8, None, 60)
    assert isinstance(open_stream(f"replay://{path}"), ReplayJoints)


@pytest.mark.parametrize(
    ("address", "role", "message"),
    [
        ("kuka://1", "robot", "source 'kuka://', expected one of rsi://, egm://, rtde://, rdt"),
        ("record.csv", "force", "source 'record.csv', expected one of"),
        ("rdt://h?scale=http", "robot", "a force sensor knows no joints"),
        ("rsi://:0", "force", "sends no force by RSI"),
        ("rsi://127.0.0.1:0?cycle=4s", "robot", "cycle=4s, expected 4ms or 12ms"),
        ("rsi://127.0.0.1:0?cycle=8", "robot", "RSI cycle of 8 ms"),
        ("rsi://127.0.0.1:0?mode=sum", "robot", "mode=sum, expected relative or absolute"),
        ("egm://127.0.0.1:0", "robot", "RobotWare 6 or 7 is not stated"),
        ("egm://127.0.0.1:0?robotware=5", "robot", "robotware=5, expected 6 or 7"),
        ("rtde://h?rate=1kHz", "robot", "rate=1kHz, expected packets per second in Hz"),
        ("rtde://h?rate=1000", "robot", "rate 1000 Hz"),
        ("rtde://h?hz=1", "robot", r"option hz is unknown, expected rate= \(packets"),
        ("rtde://u:secret@h", "robot", "a user in the address"),
        ("rsi://u:secret@h", "force", "a user in the address"),
        ("rdt://h/x?scale=http", "force", "a path in the address of a rdt source"),
        ("rtde://", "robot", "without a host"),
        ("rdt://h", "force", "counts are never used as newtons"),
        ("rdt://h?scale=none.xml", "force", "none.xml"),
        ("rdt://h?scale=http&rate=0", "force", "0 records per second"),
        ("rdt://h?scale=http&silence=nan", "force", "silence=nan, expected s"),
        ("rdt://h?scale=http&rate=1&rate=2", "force", "an option twice"),
        ("replay://", "robot", "no path"),
        ("replay://none.csv", "robot", "there is no file 'none.csv'"),
        ("replay://none.csv?from=1.5", "robot", "there is no file"),
        ("replay://none.csv?from", "robot", "options that cannot be read"),
    ],
)
def test_refused(address, role, message):
    with pytest.raises(RobotrueError, match=message) as raised:
        open_stream(address, role)
    assert "secret" not in str(raised.value)


@pytest.mark.parametrize("address", ["rtde://h", "rdt://h?scale=http"])
def test_only_robots_with_a_way_to_take_them_are_sent_corrections(address):
    class Never:
        def next(self, host_time):
            raise AssertionError

    with pytest.raises(ConfigurationError, match="only rsi:// and egm:// robots take them"):
        open_stream(address, "robot", SourceSettings(corrector=Never()))


def test_every_scheme_has_an_example_with_options_it_takes():
    for scheme in PROTOCOLS:
        protocol = protocol_of(f"{scheme}://")
        stated, _, rest = protocol.example.partition("://")
        assert stated == scheme
        for pair in filter(None, rest.partition("?")[2].split("&")):
            assert pair.partition("=")[0] in protocol.options
