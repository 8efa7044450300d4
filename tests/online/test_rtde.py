"""UR RTDE against packets written by hand from the guide of protocol version 2."""

import math
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robotrue.errors import ConfigurationError, FormatError, RobotrueError
from robotrue.online import rtde
from robotrue.online.blocks import Flag

NAMES = ("timestamp", "actual_q", "actual_TCP_pose", "actual_TCP_force")
RECIPE = rtde.Recipe(number=1, names=NAMES, types=("DOUBLE", "VECTOR6D", "VECTOR6D", "VECTOR6D"))
VALUES = {
    "timestamp": (12.5,),
    "actual_q": (0.1, -1.5, 1.5, 0.0, 0.5, 3.0),
    "actual_TCP_pose": (0.5, 0.1, 0.2, 0.0, 0.0, math.pi / 2),
    "actual_TCP_force": (1.0, 2.0, 3.0, 0.1, 0.2, 0.3),
}


def _frame(data):
    (frame,), rest = rtde.split_frames(data)
    assert rest == b""
    return frame


def _rows(*values):
    return rtde.read_data([_frame(rtde.write_data(RECIPE, v)) for v in values], RECIPE)


def _values(rows):
    """The first row as a controller's values."""
    return {name: tuple(np.atleast_1d(rows[name][0]).tolist()) for name in rows.dtype.names}


def test_requests_by_hand():
    assert rtde.write_protocol_request() == b"\x00\x05V\x00\x02"
    asked = rtde.write_output_request(("timestamp", "actual_q"), 500.0)
    assert asked == b"\x00\x1dO" + struct.pack(">d", 500.0) + b"timestamp,actual_q"
    assert rtde.write_frame("S") == b"\x00\x03S"
    assert rtde.read_accepted(_frame(b"\x00\x04V\x01"))
    assert not rtde.read_accepted(_frame(b"\x00\x04S\x00"))
    text = rtde.read_text(_frame(b"\x00\x0dM\x05hello\x02me\x01"))
    assert text == ("hello", "me", 1)


def test_data_by_hand():
    recipe = rtde.read_recipe(_frame(b"\x00\x13O\x01DOUBLE,VECTOR6D"), NAMES[:2])
    data = b"\x00\x3cU\x01" + struct.pack(">7d", 12.5, *VALUES["actual_q"])
    rows = rtde.read_data([_frame(data)], recipe)
    assert _values(rows) == {name: VALUES[name] for name in NAMES[:2]}
    block = rtde.rtde_joint_block(rows, 3.0, rate=500.0)
    assert block.sequence.tolist() == [6250]
    np.testing.assert_array_equal(block.joints, [VALUES["actual_q"]])
    assert np.isnan(block.T_frame_tool).all()
    assert block.valid.all()
    with pytest.raises(FormatError, match="without actual_TCP_force"):
        rtde.rtde_force_block(rows, 3.0, rate=500.0)


def test_samples():
    rows = _rows(VALUES, VALUES)
    block = rtde.rtde_joint_block(rows, 3.0, rate=500.0)
    for pose in block.T_frame_tool:
        np.testing.assert_allclose(pose[:3, 0], [0.0, 1.0, 0.0], atol=1e-15)
        np.testing.assert_allclose(pose[:3, 3], [0.5, 0.1, 0.2])
    force = rtde.rtde_force_block(rows, 3.0, rate=500.0)
    assert force.frame == "base"
    np.testing.assert_array_equal(force.wrench, [VALUES["actual_TCP_force"]] * 2)


def test_every_type_has_its_size():
    types = tuple(rtde._FORMATS)
    recipe = rtde.Recipe(number=9, names=types, types=types)
    sizes = {"VECTOR3D": 3, "VECTOR6D": 6, "VECTOR6INT32": 6, "VECTOR6UINT32": 6}
    values = {t: (1,) * sizes.get(t, 1) for t in types}
    assert _values(rtde.read_data([_frame(rtde.write_data(recipe, values))], recipe)) == values
    assert recipe.dtype.itemsize == recipe.layout.size == 1 + 1 + 4 + 8 + 4 + 8 + 24 + 48 + 24 + 24


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e300])
def test_values_that_cannot_be_are_marked(bad):
    for name in ("actual_q", "actual_TCP_pose", "actual_TCP_force"):
        values = VALUES | {name: (*VALUES[name][:5], bad)}
        read = rtde.rtde_force_block if "force" in name else rtde.rtde_joint_block
        flags = read(_rows(VALUES, values, VALUES), 0.0, rate=500.0).flags
        assert flags[1] & (Flag.NOT_FINITE | Flag.IMPLAUSIBLE)
        assert not flags[[0, 2]].any()
    block = rtde.rtde_joint_block(_rows(VALUES | {"timestamp": (bad,)}), 0.0, rate=500.0)
    assert block.flags.tolist() == [Flag.CLOCK_JUMP]


@pytest.mark.parametrize("answer", ["NOT_FOUND", "IN_USE"])
def test_a_variable_that_is_not_there(answer):
    frame = rtde.RtdePacket(kind="O", payload=b"\x01DOUBLE," + answer.encode())
    with pytest.raises(ConfigurationError, match=f"actual_q is {answer}"):
        rtde.read_recipe(frame, NAMES[:2])


@pytest.mark.parametrize(
    ("payload", "message"),
    [
        (b"\x01timestamp,actual_q", "type 'timestamp'"),
        (b"\x01DOUBLE", "1 types for 2"),
        (b"\x00DOUBLE,VECTOR6D", "recipe 0"),
        (b"", "expected a recipe"),
        (b"\x01\xff", "not text"),
    ],
)
def test_a_recipe_that_is_none(payload, message):
    with pytest.raises(FormatError, match=message):
        rtde.read_recipe(rtde.RtdePacket(kind="O", payload=payload), NAMES[:2])


def test_data_that_do_not_fit():
    frame = _frame(rtde.write_data(RECIPE, VALUES))
    with pytest.raises(FormatError, match="expected U with"):
        rtde.read_data([rtde.RtdePacket(kind="U", payload=frame.payload[:-1])], RECIPE)
    with pytest.raises(FormatError, match="recipe 2, expected 1"):
        rtde.read_data([rtde.RtdePacket(kind="U", payload=b"\x02" + frame.payload[1:])], RECIPE)
    with pytest.raises(FormatError, match="do not fit"):
        rtde.write_data(RECIPE, {"timestamp": (1.0,)})


@given(st.lists(st.integers(1, 60), max_size=40))
def test_a_stream_in_pieces_gives_the_same_packets(cuts):
    stream = b"".join(rtde.write_data(RECIPE, VALUES) + b"\x00\x04S\x01" for _ in range(3))
    whole, _ = rtde.split_frames(stream)
    found, buffer, at = [], b"", 0
    for size in [*cuts, len(stream)]:
        frames, buffer = rtde.split_frames(buffer + stream[at : at + size])
        found += frames
        at += size
    assert tuple(found) == whole
    assert buffer == b""


def test_a_stream_out_of_step_is_refused():
    with pytest.raises(FormatError, match="packet of 2 bytes"):
        rtde.split_frames(b"\x00\x02V")
    with pytest.raises(FormatError, match="type 'x'"):
        rtde.split_frames(b"\x00\x04xx")


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=200))
def test_anything_else_raises_our_own_error(data):
    try:
        frames, rest = rtde.split_frames(data)
    except RobotrueError:
        return
    assert len(rest) <= len(data)
    for frame in frames:
        for read in (
            rtde.read_accepted,
            rtde.read_text,
            lambda f: rtde.read_recipe(f, NAMES),
            lambda f: rtde.read_data([f], RECIPE),
        ):
            try:
                read(frame)
            except RobotrueError:
                continue
