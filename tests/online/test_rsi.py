"""KUKA RSI against packets as controllers print them."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from online_cases import CONFIG, ROB, flipped

from robotrue.core.units import DEG, MM
from robotrue.errors import (
    ConfigurationError,
    FormatError,
    ModelMismatchError,
    RobotrueError,
    ShapeError,
)
from robotrue.online import rsi, rsi_answer
from robotrue.online.blocks import Flag
from robotrue.online.robot_correction import Correction, CorrectionMode
from robotrue.online.rsi import rob_block
from robotrue.online.rsi_config import parse_rsi_config
from robotrue.online.sequence import advance

ABSOLUTE = CorrectionMode.ABSOLUTE


def _correction(x=0.0, turn=(0.0, 0.0, 0.0), mode=ABSOLUTE):
    return Correction(shift=np.array([x, 0.0, 0.0]), turn=np.array(turn), mode=mode)


def test_configuration():
    config = parse_rsi_config(CONFIG)
    assert (config.host, config.port, config.sen_type) == ("192.0.2.1", 49152, "ImFree")
    assert not config.only_send
    assert [e.tag for e in config.send] == ["RIst", "AIPos", "Delay", "DiL"]
    assert config.send[0].index is None
    x = config.receives("RKorr.X")
    assert x is not None
    assert (x.index, x.hold, x.kind) == (1, True, "DOUBLE")
    assert config.receives("Tech.T21") is not None
    assert config.receives("Tech.T31") is None
    assert config.receives("RKorr.A") is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"ImFree", b"", "SENTYPE"),
        (b"49152", b"0", "PORT '0', expected 1 to 65535"),
        (b"FALSE", b"PERHAPS", "ONLYSEND 'PERHAPS'"),
        (b'"RKorr.Y"', b'"RKorr.X"', r"RECEIVE: tag RKorr\.X occurs twice"),
        (b'INDX="2"', b'INDX="1"', "INDX 1 occurs twice"),
        (b'INDX="2"', b'INDX="65"', "'65' of RKorr.Y"),
        (b'HOLDON="0"', b'HOLDON="2"', "HOLDON '2'"),
        (b'TYPE="LONG" INDX="1"', b'TYPE="FLOAT" INDX="1"', "FLOAT"),
        (b"<ROOT>", b'<!DOCTYPE x [<!ENTITY a "b">]><ROOT>', "document type"),
        (b"</ROOT>", b"", "is not XML"),
    ],
)
def test_a_configuration_that_cannot_be_used(old, new, message):
    assert old in CONFIG
    with pytest.raises(FormatError, match=message):
        parse_rsi_config(CONFIG.replace(old, new))


def _sample(packet, host_time):
    """The only row of the block of one packet."""
    block = rob_block([(packet, host_time, Flag.NONE)])
    return SimpleNamespace(
        valid=bool(block.valid[0]),
        flags=Flag(int(block.flags[0])),
        controller_time=block.controller_time[0],
        joints=block.joints[0],
        T_frame_tool=block.T_frame_tool[0],
    )


def test_a_packet_as_printed():
    packet = rsi.read_rob(ROB, parse_rsi_config(CONFIG))
    assert packet.ipoc == 4208163634
    assert packet.late == 0
    assert packet.joints_deg == (10.0, -90.0, 90.0, 0.0, 45.0, -180.0)
    assert packet.signals == {"DiL": 5.0}
    sample = _sample(packet, 2.0)
    assert sample.valid
    assert sample.controller_time == pytest.approx(4208163.634)
    np.testing.assert_allclose(sample.joints, np.array(packet.joints_deg) * DEG)
    np.testing.assert_allclose(sample.T_frame_tool[:3, 3], [1.0005, -0.02025, 1.5])
    np.testing.assert_allclose(sample.T_frame_tool[:3, 0], [0.0, 1.0, 0.0], atol=1e-15)
    assert rsi.read_ipoc(ROB) == packet.ipoc


def test_the_fast_route_reads_the_same():
    slow, fast = rsi.read_rob(ROB), rsi.read_rob_fast(ROB)
    assert (fast.ipoc, fast.late) == (slow.ipoc, slow.late)
    assert (fast.joints_deg, fast.pose_mm_deg) == (slow.joints_deg, slow.pose_mm_deg)
    spaced = ROB.replace(b'" Y=', b'"  Y=').replace(b'"10.0000"', b"'1e1'")
    assert rsi.read_rob_fast(spaced) == fast


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"<IPOC>4208163634</IPOC>", b"", "without IPOC"),
        (b"</Rob>", b"<IPOC>4</IPOC></Rob>", "IPOC '4', expected one"),
        (b"4208163634", b"-4", "IPOC '-4'"),
        (b"4208163634", b"4.5", "IPOC '4.5'"),
        (b'A3="90.0000" ', b"", "AIPos with 5 of"),
        (b'A3="90.0000"', b'A3="9o.0000"', "AIPos.A3='9o.0000', expected a number"),
        (b'D="0"', b'D="-1"', "D=-1, expected a count"),
        (b"</Rob>", b"", "not XML"),
        (b"Rob", b"Sen", "<Sen>, expected <Rob>"),
    ],
)
def test_a_damaged_packet_is_refused_by_every_route(old, new, message):
    data = ROB.replace(old, new)
    assert data != ROB
    for read in (rsi.read_rob, rsi.read_rob_fast):
        with pytest.raises(FormatError, match=message):
            read(data)


def test_a_signal_that_stands_twice():
    with pytest.raises(FormatError, match="DiL twice"):
        rsi.read_rob(ROB.replace(b"<DiL>5</DiL>", b"<DiL>5</DiL><DiL>6</DiL>"))


def test_a_packet_without_what_the_configuration_promises():
    with pytest.raises(FormatError, match="without DiL"):
        rsi.read_rob(ROB.replace(b"<DiL>5</DiL>", b""), parse_rsi_config(CONFIG))


@pytest.mark.parametrize("printed", [b"nan", b"-1.#IND", b"inf"])
def test_nan_is_marked(printed):
    data = ROB.replace(b"-90.0000", printed).replace(b"1500.0000", printed)
    for read in (rsi.read_rob, rsi.read_rob_fast):
        sample = _sample(read(data), 0.0)
        assert sample.flags == Flag.NOT_FINITE
        assert not sample.valid
        assert np.isnan(sample.joints[1])
        assert np.isnan(sample.T_frame_tool).all()


def test_what_no_robot_does_is_marked():
    data = ROB.replace(b"45.0000", b"45000000").replace(b"1500.0000", b"1500000000")
    sample = _sample(rsi.read_rob_fast(data), 0.0)
    assert sample.flags == Flag.IMPLAUSIBLE
    assert np.isnan(sample.joints[4])


def test_an_answer():
    config = parse_rsi_config(CONFIG)
    sent = rsi_answer.SenWriter(config, ABSOLUTE).write(42, _correction(0.5 * MM))
    assert sent == (
        b'<Sen Type="ImFree"><RKorr X="0.500000" Y="0.000000" Z="0.000000" /><IPOC>42</IPOC></Sen>'
    )
    assert rsi_answer.read_sen(sent, config, 42)["RKorr.X"] == 0.5
    with pytest.raises(FormatError, match="IPOC 42, expected 46"):
        rsi_answer.read_sen(sent, config, 46)
    with pytest.raises(FormatError, match="expected <Sen Type='ImFree'>"):
        rsi_answer.read_sen(sent.replace(b"ImFree", b"Free"), config, 42)


def test_an_answer_that_turns():
    config = parse_rsi_config(CONFIG.replace(b'"DiO" TYPE="LONG"', b'"RKorr.A" TYPE="DOUBLE"'))
    sent = rsi_answer.SenWriter(config, ABSOLUTE).write(1, _correction(turn=(0.0, 0.0, 0.25 * DEG)))
    assert b'A="0.250000"' in sent


def test_answers_that_must_not_be_sent():
    config = parse_rsi_config(CONFIG)
    with pytest.raises(ModelMismatchError, match="RELATIVE"):
        rsi_answer.SenWriter(config, CorrectionMode.RELATIVE).write(1, _correction())
    with pytest.raises(ConfigurationError, match=r"takes no RKorr\.A"):
        rsi_answer.SenWriter(config, ABSOLUTE).write(1, _correction(turn=(0.0, 0.0, 1e-3)))
    only = parse_rsi_config(CONFIG.replace(b"FALSE", b"TRUE"))
    with pytest.raises(ConfigurationError, match="ONLYSEND"):
        rsi_answer.SenWriter(only, ABSOLUTE).write(1, _correction())
    with pytest.raises(ShapeError, match="finite"):
        _correction(math.nan)


def test_the_ipoc_is_watched():
    state = rsi.rsi_sequence(4)
    told = []
    # sound, repeated, two lost, one of them after all, off the grid, sound again
    for ipoc in (100, 104, 104, 116, 112, 121, 125):
        state, flags = advance(state, ipoc, host_time=ipoc * 1e-3)
        told.append(flags)
    assert told[:4] == [Flag.NONE, Flag.NONE, Flag.REPEATED, Flag.GAP | Flag.LATE]
    assert told[4] & Flag.CLOCK_JUMP  # the host's clock went back with it
    assert told[5] == Flag.CLOCK_JUMP | Flag.LATE
    assert told[6] == Flag.NONE
    with pytest.raises(ConfigurationError, match="cycle of 5 ms"):
        rsi.rsi_sequence(5)


def test_one_flipped_bit_never_moves_the_ipoc_unseen():
    """A packet holds its IPOC once: either it is refused, or it is the packet it says it is."""
    first, _ = advance(rsi.rsi_sequence(4), 4208163630, 0.0)
    for damaged in flipped(ROB):
        try:
            packet = rsi.read_rob_fast(damaged)
        except RobotrueError:
            continue
        if packet.ipoc == 4208163634:
            continue
        _, flags = advance(first, packet.ipoc, 4e-3)
        assert flags & (Flag.CLOCK_JUMP | Flag.GAP | Flag.REORDERED | Flag.REPEATED)


def test_both_routes_agree_on_every_flipped_bit():
    for damaged in flipped(ROB):
        try:
            slow = rsi.read_rob(damaged)
        except RobotrueError:
            continue
        fast = rsi.read_rob_fast(damaged)
        assert (fast.ipoc, fast.late, fast.joints_deg, fast.pose_mm_deg) == (
            slow.ipoc,
            slow.late,
            slow.joints_deg,
            slow.pose_mm_deg,
        )


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=200) | st.integers(0, len(ROB)).map(lambda n: ROB[:n]))
def test_anything_else_raises_our_own_error(data):
    if data == ROB:
        return
    for read in (rsi.read_rob, rsi.read_rob_fast, rsi.read_ipoc, parse_rsi_config):
        with pytest.raises(RobotrueError):
            read(data)


@settings(max_examples=100, deadline=None)
@given(
    st.integers(0, 10**15),
    st.tuples(*[st.integers(-(10**8), 10**8).map(lambda i: i / 1e4)] * 6),
    st.none() | st.integers(0, 1000),
)
def test_round_trip(ipoc, six, late):
    packet = rsi.RobPacket(ipoc=ipoc, late=late, joints_deg=six, pose_mm_deg=six)
    data = rsi_answer.write_rob(packet)
    assert rsi.read_rob(data) == packet
    assert rsi.read_rob_fast(data) == packet
    assert rsi.read_ipoc(data) == ipoc
