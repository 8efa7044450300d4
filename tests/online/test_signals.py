"""Named values in datagrams of JSON: what is read, what is marked, what is refused."""

from __future__ import annotations

import asyncio
import json
import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotrue.errors import FormatError
from robotrue.online.blocks import Flag
from robotrue.online.signals import SignalSample, UdpSignals, read_signals, write_signals


def test_numbers_texts_and_clocks() -> None:
    sample = read_signals(b'{"seq": 7, "t_s": 1.5, "d1_mm": -0.25, "hole": "H3"}', 9.0)
    assert (sample.sequence, sample.controller_time, sample.host_time) == (7, 1.5, 9.0)
    assert sample.values == {"d1_mm": -0.25}
    assert sample.texts == {"hole": "H3"}
    assert sample.valid


@pytest.mark.parametrize("printed", ["null", "NaN", "Infinity", "1e999", "9" * 500])
def test_a_value_that_is_none_marks_the_sample(printed: str) -> None:
    sample = read_signals(b'{"d1_mm": %s, "force_N": 5}' % printed.encode(), 0.0)
    assert sample.flags is Flag.NOT_FINITE
    assert sample.missing == ("d1_mm",)
    assert not sample.valid


@pytest.mark.parametrize("data", [
    b"", b"{", b"[]", b"{}", b"3", b'{"a": 1, "a": 2}', b'{"a": [1]}', b'{"a": true}',
    b'{"seq": 1.5}', b'{"seq": -4}', b"\xff\xfe", b"[" * 9000, b"[" * 8000,
    json.dumps({f"v{k}": 1 for k in range(65)}).encode(), b'{"a": "%s"}' % (b"x" * 201),
])  # fmt: skip
def test_what_is_no_datagram_of_values_is_refused(data: bytes) -> None:
    with pytest.raises(FormatError):
        read_signals(data, 0.0)


@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(data: bytes) -> None:
    try:
        assert isinstance(read_signals(data, 0.0), SignalSample)
    except FormatError:
        pass


@given(st.dictionaries(st.text(min_size=1, max_size=9), st.floats(-1e9, 1e9), min_size=1))
def test_what_is_written_is_read(values: dict[str, float]) -> None:
    values = {f"v_{name}": value for name, value in values.items()}
    assert read_signals(write_signals(values), 0.0).values == values


def test_the_link_marks_what_comes_twice_and_answers_whoever_sent() -> None:
    async def story() -> None:
        source = UdpSignals("127.0.0.1", 0)
        stream = source.samples()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as machine:
            machine.bind(("127.0.0.1", 0))
            machine.settimeout(5.0)
            for data in (b'{"seq":1,"x":1}', b'{"seq":1,"x":1}', b"no", b'{"seq":4,"x":2}'):
                machine.sendto(data, source.address)
            async with asyncio.timeout(5.0):
                flags = [(await anext(stream)).flags for _ in range(3)]
            assert flags == [Flag.NONE, Flag.REPEATED, Flag.GAP]
            assert source.answer(b"{}")
            assert machine.recv(100) == b"{}"
        health = source.health(float("inf"))
        assert (health.received, health.refused, health.lost) == (3, 1, 2)
        assert "no JSON object" in health.last_fault
        await source.close()
        assert [sample async for sample in stream] == []

    asyncio.run(story())


def test_only_the_machine_named_is_listened_to() -> None:
    async def story() -> None:
        source = UdpSignals("127.0.0.1", 0, only="192.0.2.1")
        stream = source.samples()
        waiting = asyncio.ensure_future(anext(stream, None))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as machine:
            machine.sendto(b'{"x":1}', source.address)
            async with asyncio.timeout(5.0):
                while not source.health(0.0).refused:
                    await asyncio.sleep(0.01)
        await source.close()
        assert await waiting is None
        assert not source.answer(b"{}")

    asyncio.run(story())
