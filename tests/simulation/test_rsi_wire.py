"""The short ways of the simulated KUKA controller lead where the long ones do."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robotrue.core.rotations import abc_from_matrix, quat_wxyz_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.online.rsi import RobPacket, read_sen, write_rob, write_sen
from robotrue.online.rsi_config import usual_rsi_config
from robotrue.online.samples import Correction, CorrectionMode
from robotrue.robot.presets import preset
from robotrue.simulation.joint_motion import Jog
from robotrue.simulation.motion_grid import MotionGrid
from robotrue.simulation.rsi_wire import RobWriter, SenReader

CONFIG = usual_rsi_config("127.0.0.1", 49152)
_number = st.floats(-3000.0, 3000.0) | st.just(math.nan)
_six = st.tuples(*[_number] * 6)


@given(
    ipoc=st.integers(0, 2**40),
    late=st.integers(0, 10**6),
    joints=_six,
    pose=st.none() | _six,
    further=st.sampled_from([{}, {"DiL": 0.0}, {"Tech.C11": 0.0, "DiL": 0.0}]),
)
@settings(max_examples=100, deadline=None)
def test_a_packet_is_printed_as_by_the_long_way(ipoc, late, joints, pose, further):
    packet = RobPacket(ipoc=ipoc, late=late, joints_deg=joints, pose_mm_deg=pose, signals=further)
    assert RobWriter(further).write(ipoc, late, joints, pose) == write_rob(packet)


@given(shift=st.tuples(*[st.floats(-5e-3, 5e-3)] * 3), ipoc=st.integers(1, 2**40))
@settings(max_examples=50, deadline=None)
def test_an_answer_is_read_as_by_the_long_way(shift, ipoc):
    mode = CorrectionMode.ABSOLUTE
    correction = Correction(shift=np.array(shift), turn=np.zeros(3), mode=mode)
    data = write_sen(CONFIG, ipoc, correction, mode)
    assert SenReader(CONFIG).read(data, ipoc) == dict(read_sen(data, CONFIG, ipoc).signals)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"<IPOC>7<", b"<IPOC>8<"),
        (b'Type="ImFree"', b'Type="Other"'),
        (b"<RKorr", b"<!-- --><RKorr"),
        (b' X="', b' X="nan" Y="'),
        (b' X="0.0', b' X="zero'),
        (b"</Sen>", b""),
        (b"<Sen ", b"<Rob "),
        (b"<RKorr ", b"<RKorr  "),
    ],
)
def test_an_odd_answer_is_taken_or_refused_as_by_the_long_way(old, new):
    mode = CorrectionMode.ABSOLUTE
    still = Correction(shift=np.zeros(3), turn=np.zeros(3), mode=mode)
    data = write_sen(CONFIG, 7, still, mode).replace(old, new, 1)

    def outcome(read):
        try:
            return dict(read())
        except FormatError as refused:
            return refused.message

    assert outcome(lambda: SenReader(CONFIG).read(data, 7)) == outcome(
        lambda: read_sen(data, CONFIG, 7).signals
    )


def test_a_motion_worked_out_ahead_is_the_motion():
    jog = Jog(robot=preset("kr160"), joints=np.radians([0.0, 30.0, -30.0, 0.0, 60.0, 0.0]))
    ahead = MotionGrid(jog, 4e-3)
    for number in (0, 1, 63, 64, 200, 90):  # on, past the end, over a gap, back
        place = ahead.at(number)
        (joints,), (pose,) = jog.along(np.array([number * 4e-3]))
        np.testing.assert_allclose(np.array(place.joints_deg) * DEG, joints, atol=1e-14)
        np.testing.assert_allclose(np.array(place.pose_mm_deg[:3]) * MM, pose[:3, 3], atol=1e-14)
        quat = quat_wxyz_from_matrix(pose[:3, :3])
        np.testing.assert_allclose(place.quat_wxyz, quat, atol=1e-14)
        abc = abc_from_matrix(pose[:3, :3])
        np.testing.assert_allclose(np.array(place.pose_mm_deg[3:]) * DEG, abc, atol=1e-12)
