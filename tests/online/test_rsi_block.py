"""Packets of a KUKA controller made into a block at once: as packet by packet, bit for bit."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rsi_samples import joint_sample
from single_samples import joint_block

from robotrue.errors import FormatError
from robotrue.online.blocks import Flag, JointBlock
from robotrue.online.rsi import RobPacket, packet_flags, rob_block

_usual = st.floats(-360.0, 360.0)
_odd = st.sampled_from([math.nan, math.inf, -3.6e4, 3.61e4, 1e5, 1.1e5, 1e300, -0.0])
_numbers = st.one_of(_usual, _usual, _usual, _odd)
_sixes = st.tuples(*[_numbers] * 6)
_packets = st.builds(
    RobPacket,
    ipoc=st.integers(0, 2**40),
    late=st.just(0),
    joints_deg=_sixes,
    pose_mm_deg=st.none() | _sixes,
)
_seen = st.tuples(
    _packets, st.floats(0.0, 1e6), st.sampled_from([Flag.NONE, Flag.GAP, Flag.REPEATED])
)


@given(seen=st.lists(_seen, min_size=1, max_size=9), cut=st.integers(0, 9))
@settings(max_examples=200, deadline=None)
def test_a_block_is_its_packets_however_it_is_cut(seen, cut):
    wanted = joint_block([joint_sample(packet, time, flags) for packet, time, flags in seen])
    parts = [rob_block(part) for part in (seen[:cut], seen[cut:]) if part]
    for field in dataclasses.fields(JointBlock):
        found = np.concatenate([getattr(part, field.name) for part in parts])
        np.testing.assert_array_equal(found, getattr(wanted, field.name), strict=True)
    for packet, _, flags in seen:
        assert packet_flags(packet) | flags == joint_sample(packet, 0.0, flags).flags


def test_a_packet_without_joints_is_refused():
    packet = RobPacket(ipoc=4, late=0, joints_deg=None, pose_mm_deg=(0.0,) * 6)
    with pytest.raises(FormatError, match="without AIPos"):
        packet_flags(packet)
