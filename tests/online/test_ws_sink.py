"""Viewers that look, sleep, go away or have no business here."""

import asyncio
import gc
import json
import socket
import tracemalloc
import urllib.error
import urllib.request

import pytest
from estimate_cases import estimates

from robotrue.errors import ConfigurationError
from robotrue.online.estimates import Doubt
from robotrue.online.link import Health
from robotrue.online.live_page import page_files
from robotrue.online.sinks import SinkSettings, open_sink

websockets = pytest.importorskip("websockets.asyncio.client")
TOKEN = "correct-horse-battery"  # noqa: S105


def _run(scene, address="ws://127.0.0.1:0", **settings):
    async def run():
        sink = open_sink(address, SinkSettings(**{"environment": {}, **settings}))
        await sink.open()
        try:
            return await asyncio.wait_for(scene(sink), 60)
        finally:
            await asyncio.wait_for(sink.close(), 5)

    return asyncio.run(run())


def _connect(sink, query="", **more):
    return websockets.connect(f"ws://127.0.0.1:{sink.port}/frames{query}", **more)


async def _until(socket_, kind):
    while (frame := json.loads(await asyncio.wait_for(socket_.recv(), 5)))["type"] != kind:
        pass
    return frame


def test_a_viewer_gets_the_cell_the_estimates_and_the_counters():
    healths = (Health(name="rsi://x", connected=True, late=3, turnaround_p50=2e-5),)

    async def scene(sink):
        async with _connect(sink) as viewer:
            hello = await _until(viewer, "hello")
            await sink.write(estimates(0, 30, doubt=Doubt.EXTRAPOLATED))
            first = await _until(viewer, "estimates")
            rest = await _until(viewer, "estimates")  # the open bin, once nothing more comes
            health = await _until(viewer, "health")
            assert sink.health().connected
            return hello, first, rest, health

    hello, first, rest, health = _run(
        scene, cell="c7", note="simulated", joints=6, healths=lambda: healths
    )
    assert (hello["cell"], hello["note"], hello["per_second"]) == ("c7", "simulated", 50.0)
    assert hello["doubts"][str(int(Doubt.EXTRAPOLATED))] == "extrapolated"
    assert not hello["invalid"] & int(Doubt.EXTRAPOLATED)
    assert sum(b["rows"] for b in first["bins"] + rest["bins"]) == 30
    assert first["bins"][0]["doubt"] == int(Doubt.EXTRAPOLATED)
    assert first["bins"][0]["force_N"] == [100.0, -50.0, 20.0]
    assert health["links"][0]["late"] == 3
    assert health["links"][0]["turnaround_p50_ms"] == 0.02
    assert health["links"][0]["turnaround_p99_ms"] is None


def test_one_that_sleeps_holds_up_nobody_and_costs_bounded_memory():
    async def scene(sink):
        port = sink.port
        asleep = socket.create_connection(("127.0.0.1", port))
        asleep.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        asleep.sendall(
            f"GET /frames HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\n"
            "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
        )
        rows, grown = 0, []
        async with _connect(sink) as awake:
            await _until(awake, "hello")
            tracemalloc.start()
            try:
                for k in range(700):
                    await sink.write(estimates(20 * k, 20))
                    if k:
                        frame = await _until(awake, "estimates")
                        rows += sum(b["rows"] for b in frame["bins"])
                    if k in (500, 699):
                        gc.collect()  # or what is measured is when it last ran
                        grown.append(tracemalloc.get_traced_memory()[0])
            finally:
                tracemalloc.stop()
        dropped = sink.health().dropped
        asleep.close()
        return rows, dropped, grown

    rows, dropped, (middle, end) = _run(scene)
    assert 698 * 20 <= rows < 700 * 20  # all but the last bin, which is still open
    assert dropped > 100
    assert end - middle < 100_000


def test_one_that_goes_is_forgotten():
    async def scene(sink):
        for _ in range(3):
            async with _connect(sink) as viewer:
                await _until(viewer, "hello")
        async with asyncio.timeout(5):
            while sink.health().connected:
                await sink.write(estimates(0, 100))
                await asyncio.sleep(0.01)
        return sink.health()

    health = _run(scene)
    assert health.reconnects == 2
    assert health.last_fault == ""


@pytest.mark.parametrize(
    ("headers", "let_in"),
    [
        ({}, True),
        ({"origin": "http://127.0.0.1:{port}"}, True),
        ({"origin": "https://cells.example"}, True),
        ({"origin": "http://evil.example"}, False),
        ({"origin": "http://127.0.0.1:1"}, False),
        ({"origin": "null"}, False),
        ({"origin": "http://evil.example:{port}", "host": "evil.example:{port}"}, False),
    ],
)
def test_pages_of_other_sites_do_not_look(headers, let_in):
    async def scene(sink):
        given = {k: v.format(port=sink.port) for k, v in headers.items()}
        host = given.pop("host", None)
        try:
            if host:
                return await _asked(sink.port, host, given["origin"]), sink.health()
            async with _connect(sink, **given) as viewer:
                await _until(viewer, "hello")
                return 101, sink.health()
        except websockets.InvalidStatus as refused:
            return refused.response.status_code, sink.health()

    status, health = _run(scene, "ws://127.0.0.1:0?origin=https://cells.example")
    assert status == (101 if let_in else 403)
    assert health.refused == (0 if let_in else 1)


async def _asked(port, host, origin):
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(
        f"GET /frames HTTP/1.1\r\nHost: {host}\r\nOrigin: {origin}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
    )
    line = await asyncio.wait_for(reader.readline(), 5)
    writer.close()
    return int(line.split()[1])


@pytest.mark.parametrize(
    ("query", "more", "let_in"),
    [
        ("", {}, False),
        ("?token=wrong", {}, False),
        (f"?token={TOKEN}", {}, True),
        ("", {"additional_headers": {"Authorization": f"Bearer {TOKEN}"}}, True),
    ],
)
def test_other_computers_need_the_token(query, more, let_in):
    async def scene(sink):
        try:
            async with _connect(sink, query, **more) as viewer:
                await _until(viewer, "hello")
                return 101, sink
        except websockets.InvalidStatus as refused:
            return refused.response.status_code, sink

    status, sink = _run(scene, "ws://0.0.0.0:0", environment={"ROBOTRUE_WS_TOKEN": TOKEN})
    assert status == (101 if let_in else 403)
    assert TOKEN not in repr(sink.health())


@pytest.mark.parametrize(
    ("address", "environment", "words"),
    [
        ("ws://0.0.0.0:0", {}, "expected a token of 16 characters"),
        ("ws://cell.example:8765", {}, "set ROBOTRUE_WS_TOKEN"),
        ("ws://127.0.0.1:0", {"ROBOTRUE_WS_TOKEN": "short"}, "a token of 5 characters"),
        ("ws://127.0.0.1:0?rate=fast", {}, "rate=fast"),
        ("ws://127.0.0.1:0?rate=1000", {}, "second, 1 to 100"),
        ("ws://127.0.0.1:0?color=red", {}, "option color is unknown, expected rate="),
        ("ws://127.0.0.1:0?origin=evil.example", {}, "expected one like https://"),
        ("ws://127.0.0.1:99999", {}, "cannot be read"),
        ("ws:127.0.0.1", {}, "without a host"),
    ],
)
def test_addresses_that_are_refused(address, environment, words):
    with pytest.raises(ConfigurationError, match=words) as refused:
        open_sink(address, SinkSettings(environment=environment))
    assert "short" not in str(refused.value)


def test_a_port_that_is_taken():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ConfigurationError, match="cannot listen"):
            _run(lambda sink: None, f"ws://127.0.0.1:{port}")


def test_the_page_comes_from_the_same_port_and_names_no_other_host():
    async def scene(sink):
        def get(path):
            with urllib.request.urlopen(f"http://127.0.0.1:{sink.port}{path}", timeout=5) as page:
                return page.status, dict(page.headers), page.read()

        found = {path: await asyncio.to_thread(get, path) for path in page_files()}
        with pytest.raises(urllib.error.HTTPError, match="404"):
            await asyncio.to_thread(get, "/../ws_sink.py")
        return found

    found = _run(scene)
    assert {"/", "/live.html", "/live.js", "/plot.js"} <= set(found)
    for path, (status, headers, body) in found.items():
        assert status == 200
        assert body == page_files()[path].body
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert b"http://" not in body
        assert b"https://" not in body
    assert found["/"][1]["Content-Type"] == "text/html; charset=utf-8"


def test_estimates_of_another_arm_are_counted():
    async def scene(sink):
        await sink.write(estimates(0, 5, dof=7))
        return sink.health()

    health = _run(scene)
    assert (health.received, health.refused) == (0, 1)
