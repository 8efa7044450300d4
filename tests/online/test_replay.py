"""Recorded streams: the samples they were, and lines that are none."""

from types import SimpleNamespace

import numpy as np
import pytest

from robotrue.core.units import DEG
from robotrue.errors import FormatError, ImplausibleDataError
from robotrue.online.blocks import Flag
from robotrue.online.replay_blocks import force_blocks, joint_blocks

JOINTS = "t_s,host_s,sequence,a1_deg,a2_deg,a3_deg,a4_deg,a5_deg,a6_deg"
POSE = ",x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg"


def _file(tmp_path, *lines, end="\n"):
    path = tmp_path / "record.csv"
    path.write_text("\n".join(lines) + end, encoding="utf-8")
    return path


def _samples(blocks):
    """The rows of blocks, one by one."""
    for block in blocks:
        names = [name for name in block.__dataclass_fields__ if name != "frame"]
        for row in range(len(block)):
            values = {name: getattr(block, name)[row] for name in names}
            yield SimpleNamespace(
                **values, valid=block.valid[row], frame=getattr(block, "frame", None)
            )


def test_joints(tmp_path):
    path = _file(
        tmp_path,
        "# robot 7",
        JOINTS + POSE,
        "1.0,5.0,100,10,-90,90,0,45,180,1000,0,500,0,0,90",
        "1.004,5.004,101,10,-90,90,0,45,180,1000,0,,0,0,90",
    )
    first, second = _samples(joint_blocks(path))
    assert (first.controller_time, first.host_time, first.sequence) == (1.0, 5.0, 100)
    np.testing.assert_allclose(first.joints, np.array([10, -90, 90, 0, 45, 180]) * DEG)
    np.testing.assert_allclose(first.T_frame_tool[:3, 3], [1.0, 0.0, 0.5])
    np.testing.assert_allclose(first.T_frame_tool[:3, 0], [0.0, 1.0, 0.0], atol=1e-15)
    assert first.valid
    assert second.flags == Flag.NOT_FINITE


def test_force_with_all_that_goes_wrong(tmp_path):
    path = _file(
        tmp_path,
        "t_s,sequence,fx_N,fy_N,fz_N,tx_Nm,ty_Nm,tz_Nm,status",
        "0.000,1,1,2,3,.1,.2,.3,0",
        "0.001,2,nan,2,3,.1,.2,.3,0",
        "0.001,2,1,2,3,.1,.2,.3,0",
        "0.004,5,1,2,3,.1,.2,.3,0",
        "0.005,6,1,2,3,.1,,.3,0",
        "0.006,7,1,2,3,.1,.2,.3,131072",
        "0.0065,8,1,2,3,.1,.2,.3,65536",
        "0.007,900000,1,2,3,.1,.2,.3,0",
        "0.008,900001,1e9,2,3,.1,.2,.3,0",
    )
    samples = list(_samples(force_blocks(path)))
    assert [s.flags for s in samples] == [
        Flag.NONE,
        Flag.NOT_FINITE,
        Flag.REPEATED,
        Flag.GAP,
        Flag.NOT_FINITE,
        Flag.SENSOR_FAULT,
        Flag.NONE,  # a limit latched: the data are sound, as they are live
        Flag.CLOCK_JUMP,
        Flag.IMPLAUSIBLE,
    ]
    np.testing.assert_array_equal(samples[0].wrench, [1, 2, 3, 0.1, 0.2, 0.3])


def test_the_clock_alone_is_watched(tmp_path):
    path = _file(tmp_path, "t_s,fx_N,fy_N,fz_N", *(f"{t},1,2,3" for t in (0, 5, 5, 4.5, 1, 1.1)))
    samples = list(_samples(force_blocks(path, frame="tool")))
    expected = [0, 0, Flag.REPEATED, Flag.REORDERED, Flag.CLOCK_JUMP, 0]
    assert [s.flags for s in samples] == expected
    assert samples[0].valid  # no torques measured is no fault
    assert np.isnan(samples[0].wrench[3:]).all()
    assert samples[0].frame == "tool"


def test_a_last_line_cut_short_is_left_out(tmp_path):
    path = _file(tmp_path, "t_s,fx_N,fy_N,fz_N", "0,1,2,3", "1,1,2,30", end="")
    assert len(list(_samples(force_blocks(path)))) == 1


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["t_s,fx,fy_N,fz_N", "0,1,2,3"], r"missing fx_N\.not known fx"),
        (["t_s,fx_N,fy_N,fz_N,tx_Nm", "0,1,2,3,4"], "missing ty_Nm, tz_Nm"),
        (["t_s,t_s,fx_N,fy_N,fz_N", "0,0,1,2,3"], "one occurs twice"),
        (["t_s,fx_N,fy_N,fz_N", "0,1,2"], r"csv:2: 3 cells, expected 4"),
        (["t_s,fx_N,fy_N,fz_N", "0,1,2,three"], r"csv:2: no number"),
        (["t_s,fx_N,fy_N,fz_N"], "no rows"),
    ],
)
def test_a_file_that_cannot_be_replayed(tmp_path, lines, message):
    with pytest.raises(FormatError, match=message):
        list(_samples(force_blocks(_file(tmp_path, *lines))))


def test_a_sequence_that_is_none(tmp_path):
    path = _file(tmp_path, "t_s,sequence,fx_N,fy_N,fz_N", "0,1.5,1,2,3")
    with pytest.raises(ImplausibleDataError, match=r"sequence 1\.5"):
        list(_samples(force_blocks(path)))


def test_no_file(tmp_path):
    with pytest.raises(FormatError, match="cannot read"):
        next(joint_blocks(tmp_path / "none.csv"))


def test_tdms_is_the_same_record(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    force = np.random.default_rng(1).normal(size=(50, 3)) * 100.0
    channels = [
        nptdms.ChannelObject(
            "force", f"f{axis}", values, {"unit_string": "N", "wf_increment": 1e-3}
        )
        for axis, values in zip("xyz", force.T, strict=True)
    ]
    with nptdms.TdmsWriter(tmp_path / "f.tdms") as writer:
        writer.write_segment(channels)
    samples = list(_samples(force_blocks(tmp_path / "f.tdms")))
    np.testing.assert_array_equal([s.wrench[:3] for s in samples], force)
    np.testing.assert_allclose([s.controller_time for s in samples], np.arange(50) * 1e-3)
    assert all(s.valid for s in samples)
