"""Against a real OPC UA client that reads, subscribes, writes where it must not, and logs in."""

import asyncio
import contextlib
import datetime
import os
import socket
import time
from pathlib import Path

import numpy as np
import pytest
from estimate_cases import estimates

from robotrue.errors import ConfigurationError
from robotrue.online.estimates import Doubt, Envelopes
from robotrue.online.link import Health
from robotrue.online.opcua_nodes import nodeset_files, readings, status_name
from robotrue.online.sinks import SinkSettings, open_sink

asyncua = pytest.importorskip("asyncua")
ua = asyncua.ua
SECRET = "not-for-logs-7"  # noqa: S105


def _free_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


def _run(scene, address="opcua://127.0.0.1:{port}", **settings):
    port = _free_port()

    async def run():
        given = SinkSettings(**{"environment": {}, "cell": "c7", **settings})
        sink = open_sink(address.format(port=port), given)
        await sink.open()
        try:
            return await asyncio.wait_for(scene(sink, f"opc.tcp://127.0.0.1:{port}/"), 90)
        finally:
            await asyncio.wait_for(sink.close(), 10)

    return asyncio.run(run())


@contextlib.asynccontextmanager
async def _client(url, user="", password=""):
    client = asyncua.Client(url, timeout=5)
    if user:
        client.set_user(user)
        client.set_password(password)
    async with client:
        yield client


async def _node(client, *path):
    index = await client.get_namespace_index("urn:robotrue:online")
    names = [f"{index}:{p}" for p in ("c7", *path)]
    return await client.nodes.objects.get_child(names)


class _Heard:
    def __init__(self):
        self.values = []

    def datachange_notification(self, node, value, data):
        self.values.append(data.monitored_item.Value)


async def _until(condition):
    async with asyncio.timeout(15):
        while not condition():
            await asyncio.sleep(0.01)


@pytest.fixture(scope="module")
def seen():
    """What a client saw of one server: starting one takes seconds."""
    counted = [Health(name="rsi://x", connected=True, late=3, turnaround_p50=2e-5)]

    async def scene(sink, url):
        async with _client(url) as client:
            found = await _numbers(sink, client)
            found["stopped"] = await _stopped(client)
            late = await _node(client, "Health", "rsi://x", "Late")
            first = await late.read_value()
            fifty = await (await _node(client, "Health", "rsi://x", "TurnaroundP50")).read_value()
            worst = await _node(client, "Health", "rsi://x", "TurnaroundP99")
            unknown = await worst.read_data_value(raise_on_bad_status=False)
            counted[0] = Health(name="rsi://x", connected=False, late=5)
            async with asyncio.timeout(10):
                while await late.read_value() != 5:
                    await asyncio.sleep(0.02)
            found["health"] = (first, fifty, unknown.StatusCode.name)
            return found

    return _run(scene, note="simulated", healths=lambda: tuple(counted))


DOUBTS = np.repeat([0, 0, int(Doubt.BAD_FORCE), int(Doubt.EXTRAPOLATED), 0, 0], 100)


async def _numbers(sink, client):
    heard = _Heard()
    subscription = await client.create_subscription(20, heard)
    ex = await _node(client, "Error", "Ex")
    await subscription.subscribe_data_change(ex)
    await _until(lambda: heard.values)
    # on the grid of tenths, so that bins and hundreds are the same
    start = np.ceil((time.monotonic() - 1.0) * 10.0) / 10.0 + 1e-4
    for k in range(0, 600, 100):
        await sink.write(estimates(k, 100, doubt=DOUBTS[k : k + 100], at=start))
        await _until(lambda n=k // 100: len(heard.values) > n)
    found = {
        "unit": await (await ex.get_child(["0:EngineeringUnits"])).read_value(),
        "kind": await ex.read_type_definition(),
    }
    for name, *path in (("joint", "Joints", "A6"), ("force", "Wrench", "Fx"), ("note", "Note")):
        found[name] = await (await _node(client, *path)).read_value()
    found["sequence"] = await (await _node(client, "Sequence")).read_value()
    with pytest.raises(ua.UaStatusCodeError):
        await ex.write_value(1.0)
    await subscription.delete()
    return {**found, "values": heard.values, "start": start}


async def _stopped(client):
    """Returns the status of a number, and of what is valid, once nothing comes any more."""
    ex, valid = await _node(client, "Error", "Ex"), await _node(client, "Valid")
    async with asyncio.timeout(10):
        while await valid.read_value():
            await asyncio.sleep(0.02)
    return (await ex.read_data_value(raise_on_bad_status=False)).StatusCode.name


def test_a_subscriber_hears_values_times_and_doubts(seen):
    values, start = seen["values"], seen["start"]
    names = [v.StatusCode.name for v in values]
    assert names[0] == "BadWaitingForInitialData"
    assert names[1:6] == ["Good", "Good", "BadSensorFailure", "UncertainSubNormal", "Good"]
    truth = estimates(0, 600, at=start).error[:, 0] * 1e6
    assert values[1].Value.Value == pytest.approx(truth[99], abs=1e-6)
    assert values[4].Value.Value == pytest.approx(truth[399], abs=1e-6)
    bad = values[3].Value  # a client gets no value at all, or none that is a number
    assert bad is None or bad.Value is None or np.isnan(bad.Value)
    apart = values[2].SourceTimestamp - values[1].SourceTimestamp
    assert apart.total_seconds() == pytest.approx(0.1, abs=2e-3)
    now = datetime.datetime.now(datetime.UTC).replace(tzinfo=None)
    stamp = values[1].SourceTimestamp.replace(tzinfo=None)
    assert abs((now - stamp).total_seconds()) < 60


def test_numbers_have_units_and_nobody_may_write_them(seen):
    assert seen["unit"].DisplayName.Text == "um"
    assert seen["unit"].UnitId == 13384  # "4H"
    assert seen["kind"].Identifier == 17497  # AnalogUnitType
    assert seen["joint"] == pytest.approx(np.degrees(0.6))
    assert seen["force"] == 100.0
    assert seen["sequence"] >= 399
    assert seen["note"] == "simulated"


def test_a_stream_that_stops_is_said_to_have_stopped(seen):
    assert seen["stopped"] == "BadNoCommunication"


def test_counters_of_the_links(seen):
    assert seen["health"] == (3, 0.02, "BadNoData")


def test_a_password_lets_in_and_nothing_else_does():
    async def scene(sink, url):
        found = []
        for user, password in (("cell", SECRET), ("cell", "wrong"), ("", "")):
            try:
                async with _client(url, user, password) as client:
                    found.append(await (await _node(client, "Doubt")).read_value())
            except (ua.UaError, ConnectionError, TimeoutError) as cause:
                found.append(type(cause).__name__)
        return found, repr(sink.health())

    found, shown = _run(scene, f"opcua://cell:{SECRET}@127.0.0.1:{{port}}")
    assert found[0] == 0
    assert all(isinstance(f, str) for f in found[1:]), found
    assert SECRET not in shown


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("opcua://0.0.0.0:4840", "no user and no password, expected both: other computers"),
        ("opcua://cell@127.0.0.1:4840", "a user and no password"),
        ("opcua://127.0.0.1?rate=500", "second, 1 to 50"),
        ("opcua://127.0.0.1?security=none", "option security is unknown, expected rate="),
    ],
)
def test_addresses_that_are_refused(address, words):
    with pytest.raises(ConfigurationError, match=words):
        open_sink(address, SinkSettings(environment={}))


def test_a_port_that_is_taken_and_a_certificate_that_is_none(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ConfigurationError, match="cannot listen"):
            _run(None, f"opcua://127.0.0.1:{port}")
    (tmp_path / "cert.pem").write_text("none")
    names = {"ROBOTRUE_OPCUA_CERTIFICATE": str(tmp_path / "cert.pem")}
    with pytest.raises(ConfigurationError, match="certificate or key"):
        _run(None, environment=names)


def test_status_of_every_doubt():
    for doubt in Doubt:
        if doubt & Doubt.INVALID:
            assert status_name(int(doubt), known=False, whole=False).startswith("Bad")
    assert status_name(0, known=True, whole=True) == "Good"
    assert status_name(int(Doubt.EXTRAPOLATED), known=True, whole=True).startswith("Uncertain")
    assert status_name(int(Doubt.CLOCK), known=True, whole=False).startswith("Uncertain")


def test_every_number_has_a_place():
    assert sorted({r.column for r in readings(7)}) == list(range(22))
    thin = Envelopes(per_second=10, joints=7)
    thin.add(estimates(0, 5, dof=7))
    assert len(thin.flush()[0].last) == 22


def test_nodesets_that_are_not_there(tmp_path):
    with pytest.raises(ConfigurationError, match=r"UA/Machinery/, .*UA/Robotics/") as refused:
        nodeset_files(tmp_path)
    assert "NodeSet2.xml" in str(refused.value)
    for name in ("a.xml", "b.xml"):
        models = "".join(
            f'<Model ModelUri="http://opcfoundation.org/UA/{n}/" Version="1"/>'
            for n in ("DI", "IA", "Machinery", "Robotics")
        )
        (tmp_path / name).write_text(f"<UANodeSet><Models>{models}</Models></UANodeSet>")
    with pytest.raises(ConfigurationError, match=r"a\.xml, b\.xml"):
        nodeset_files(tmp_path)


def test_the_robot_of_the_companion_model():
    folder = os.environ.get("ROBOTRUE_NODESETS")
    if not folder:
        pytest.skip("set ROBOTRUE_NODESETS to a folder of the OPC Foundation's NodeSet2.xml files")

    async def scene(sink, url):
        async with _client(url) as client:
            await sink.write(estimates(0, 500))
            spaces = [
                await client.get_namespace_index(uri)
                for uri in (
                    "urn:robotrue:online",
                    "http://opcfoundation.org/UA/Robotics/",
                    "http://opcfoundation.org/UA/DI/",
                )
            ]
            own, robotics, di = spaces
            axes = await client.nodes.objects.get_child(
                [f"{own}:c7 robot", f"{robotics}:MotionDevices", f"{own}:Robot", f"{robotics}:Axes"]
            )
            names = [(await a.read_browse_name()).Name for a in await axes.get_children()]
            position = await axes.get_child(
                [f"{own}:Axis_6", f"{di}:ParameterSet", f"{robotics}:ActualPosition"]
            )
            async with asyncio.timeout(10):
                while True:
                    read = await position.read_data_value(raise_on_bad_status=False)
                    if read.StatusCode.is_good():
                        break
                    await asyncio.sleep(0.02)
            units = [
                await c.read_value()
                for c in await position.get_children()
                if (await c.read_browse_name()).Name == "EngineeringUnits"
            ]
            return names, read.Value.Value, [u.DisplayName.Text for u in units]

    names, value, units = _run(scene, nodesets=Path(folder))
    assert names == [f"Axis_{k}" for k in range(1, 7)]
    assert value == pytest.approx(np.degrees(0.6))
    assert units == ["deg"]
