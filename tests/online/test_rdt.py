"""ATI RDT against records written by hand, and the sensor's page of counts."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from online_cases import NETFT, RDT, flipped
from rdt_records import RdtRecord, read_records, write_record

from robotrue.errors import FormatError, ImplausibleDataError, RobotrueError
from robotrue.online import rdt
from robotrue.online.blocks import Flag
from robotrue.online.rdt import RdtCommand, RdtDevice, decode_records, rdt_block
from robotrue.online.sequence import advance

SCALE = rdt.RdtScale(newton=1e-6, newton_metre=1e-6)
NET, AXIA = RdtDevice.NET, RdtDevice.AXIA


def _sample(record, device=NET, before=None, scale=SCALE):
    """The only row of the block of one record."""
    block = rdt_block(
        decode_records(write_record(record)),
        scale,
        np.array([5.0]),
        np.zeros(1, dtype=np.int64),
        device=device,
        rate=7000.0,
        before=None if before is None else (before.rdt_sequence, before.ft_sequence),
    )
    return SimpleNamespace(
        wrench=block.wrench[0],
        valid=bool(block.valid[0]),
        flags=Flag(int(block.flags[0])),
        status=block.status[0],
        controller_time=block.controller_time[0],
        frame=block.frame,
    )


def _record(**changed):
    values = {"rdt_sequence": 7, "ft_sequence": 7000, "status": 0, "counts": (1, 2, 3, 4, 5, 6)}
    return RdtRecord(**(values | changed))


def test_a_request():
    assert rdt.write_request(RdtCommand.START, 0) == b"\x12\x34\x00\x02\x00\x00\x00\x00"
    assert rdt.read_request(b"\x12\x34\x00\x42\x00\x00\x00\x05") == (RdtCommand.BIAS, 5)
    for bad in (b"\x12\x35\x00\x02\x00\x00\x00\x00", b"\x12\x34\x00\x09\x00\x00\x00\x00", b"\x12"):
        with pytest.raises(FormatError, match="RDT request"):
            rdt.read_request(bad)


def test_a_record():
    (record,) = read_records(RDT)
    sample = _sample(record)
    np.testing.assert_allclose(sample.wrench, [1.5, -2.0, 250.0, 0.25, -0.5, 0.0], rtol=1e-15)
    assert sample.valid
    assert sample.frame == "sensor"
    assert sample.controller_time == pytest.approx(1e-3)
    assert write_record(record) == RDT
    assert len(decode_records(RDT * 40)) == 40
    for size in (35, 37):
        with pytest.raises(FormatError, match=f"of {size} bytes"):
            decode_records((RDT * 41)[:size])


@pytest.mark.parametrize(
    ("device", "status", "flags"),
    [
        (NET, 1 << 16, Flag.NONE),
        (NET, 0x80020000, Flag.SENSOR_FAULT | Flag.SATURATED),
        (NET, 1 << 31 | 1 << 28, Flag.SENSOR_FAULT),
        (AXIA, 1 << 31 | 1 << 30, Flag.SENSOR_FAULT | Flag.SATURATED),
        (AXIA, 1 << 31 | 1 << 27, Flag.SENSOR_FAULT | Flag.SATURATED),
        (AXIA, 1 << 31 | 1 << 2, Flag.SENSOR_FAULT),
        (AXIA, 1 << 3, Flag.SENSOR_FAULT),
    ],
)
def test_the_status_word(device, status, flags):
    sample = _sample(_record(status=status), device)
    assert sample.flags == flags
    assert sample.status == status
    assert sample.valid == (flags == Flag.NONE)


@pytest.mark.parametrize("extreme", [2**31 - 1, -(2**31)])
def test_counts_at_the_end_of_their_range(extreme):
    sample = _sample(_record(counts=(0, 0, extreme, 0, 0, 0)))
    assert sample.flags & Flag.SATURATED


def test_a_sensor_that_hangs():
    sample = _sample(_record(rdt_sequence=8), before=_record())
    assert sample.flags == Flag.SENSOR_FAULT
    assert _sample(_record(rdt_sequence=8, ft_sequence=7001), before=_record()).valid


def test_counts_taken_for_newtons_are_marked():
    (record,) = read_records(RDT)
    scale = rdt.RdtScale(newton=1.0, newton_metre=1.0)
    sample = _sample(record, scale=scale)
    assert sample.flags == Flag.IMPLAUSIBLE
    assert np.isnan(sample.wrench[:3]).all()


def test_the_count_turns_over():
    state = rdt.rdt_sequence(1000.0)
    told = []
    for i, number in enumerate((2**32 - 2, 2**32 - 1, 0, 0, 3, 2)):
        state, flags = advance(state, number, i * 1e-3)
        told.append(flags)
    assert told == [0, 0, 0, Flag.REPEATED, Flag.GAP, Flag.REORDERED]
    assert (state.total, state.lost, state.repeated, state.reordered) == (5, 1, 1, 1)


def test_the_page_of_counts():
    assert rdt.parse_netftapi(NETFT) == SCALE
    american = NETFT.replace(b">N<", b">lbf<").replace(b">N-m<", b">lbf-in<")
    scale = rdt.parse_netftapi(american)
    assert scale.newton == pytest.approx(4.4482216152605e-6)
    assert scale.newton_metre == pytest.approx(0.1129848290276167e-6)
    coded = NETFT.replace(b"<scfgfu>N</scfgfu>", b"<cfgfu>2</cfgfu>")
    assert rdt.parse_netftapi(coded) == SCALE
    small = NETFT.replace(b"N-m", b"N-mm").replace(b"<cfgcpt>1000000", b"<cfgcpt>1000")
    assert rdt.parse_netftapi(small).newton_metre == pytest.approx(1e-6)


@pytest.mark.parametrize(
    ("old", "new", "kind", "message"),
    [
        (b"<scfgfu>N</scfgfu>", b"", FormatError, "unit None of scfgfu"),
        (b">N<", b">V<", FormatError, "unit 'V'"),
        (b"</netft>", b"<cfgfu>1</cfgfu></netft>", ImplausibleDataError, "two units"),
        (b"<cfgcpf>1000000", b"<cfgcpf>0", ImplausibleDataError, "0 counts per unit"),
        (b"<cfgcpf>1000000", b"<cfgcpf>nan", ImplausibleDataError, "nan counts"),
        (b"<cfgcpf>1000000", b"<cfgcpf>much", FormatError, "no number cfgcpf"),
        (b"</netft>", b"<cfgcpf>7</cfgcpf></netft>", FormatError, "twice and differs"),
        (b"</netft>", b"", FormatError, "not XML"),
    ],
)
def test_a_page_that_cannot_be_used(old, new, kind, message):
    assert old in NETFT
    with pytest.raises(kind, match=message):
        rdt.parse_netftapi(NETFT.replace(old, new))


def test_one_flipped_bit_changes_one_number_or_is_marked():
    (whole,) = read_records(RDT)
    for damaged in flipped(RDT):
        (record,) = read_records(damaged)
        sample = _sample(record)
        if record.status != whole.status:
            assert not sample.valid or record.status == 1 << 16
        moved = sum(a != b for a, b in zip(record.counts, whole.counts, strict=True))
        assert moved <= 1


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=200))
def test_anything_else_raises_our_own_error(data):
    for read in (decode_records, rdt.read_request, rdt.parse_netftapi):
        try:
            read(data)
        except RobotrueError:
            continue
