"""What comes in broken is marked at once, gives no number, and the filters' memory of it is out."""

from dataclasses import replace

import numpy as np
import pytest
from sensing_cases import (
    ARM,
    HOME,
    RATE,
    ROBOT,
    cutting,
    forces,
    joints_at,
    models,
    part,
    response,
    still,
)

from robotrue.core.units import DEG
from robotrue.dynamics.flange_sensor import HeldTool
from robotrue.errors import ConfigurationError, ModelMismatchError, ReachError
from robotrue.online.blocks import Flag
from robotrue.online.estimates import Doubt
from robotrue.online.sensing import Sensing
from robotrue.online.sensing_models import SensingModels, SensingSettings

AT = 22_000
"""Sample that is spoilt, long after the start has settled."""
FORCE = cutting(8.0)


def run(block, joints=None, given=None, settings=None):
    sensing = Sensing(models() if given is None else given, settings)
    sensing.joints(still() if joints is None else joints)
    found = sensing.force(block)
    assert found.valid[20_000:AT].all(), "the case has to be sound before it is spoilt"
    return sensing, found


def spoilt(which=AT, **columns):
    """The sound block with values set in some rows."""
    block = forces(FORCE)
    changed = {}
    for name, value in columns.items():
        array = np.array(getattr(block, name))
        array[which] = value
        changed[name] = array
    return replace(block, **changed)


def marked(found, doubt, which=AT):
    rows = found.doubt[which]
    assert (rows & int(doubt)).all()
    assert np.isnan(found.error[which]).all()
    assert np.isnan(found.sd[which]).all()
    assert np.isnan(found.static[which]).all()


@pytest.mark.parametrize(
    "flag",
    [Flag.NOT_FINITE, Flag.IMPLAUSIBLE, Flag.SENSOR_FAULT, Flag.SATURATED, Flag.REPEATED,
     Flag.REORDERED],
)  # fmt: skip
def test_flagged_force(flag):
    _, found = run(spoilt(flags=int(flag)))
    marked(found, Doubt.BAD_FORCE)


def test_nan_packet():
    _, found = run(spoilt(wrench=np.nan))
    marked(found, Doubt.BAD_FORCE)
    assert found.valid[AT + 1]  # one sample is bridged


def test_repeated_packet_leaves_the_next_as_it_was():
    sound = run(forces(FORCE))[1]
    block = forces(FORCE)
    twice = np.insert(np.arange(len(block)), AT, AT - 1)
    double = part(block, twice)
    flags = np.array(double.flags)
    flags[AT] = int(Flag.REPEATED)
    found = run(replace(double, flags=flags))[1]
    marked(found, Doubt.BAD_FORCE)
    np.testing.assert_array_equal(found.error[AT + 1 :], sound.error[AT:])


def test_longer_gap_settles_as_long_as_the_filters_remember():
    lost = slice(AT, AT + 10)
    sensing, found = run(spoilt(lost, wrench=np.nan))
    marked(found, Doubt.BAD_FORCE, lost)
    rows = round(sensing.memory * RATE)
    marked(found, Doubt.SETTLING, slice(AT + 10, AT + 10 + rows))
    assert found.valid[AT + 10 + rows :].all()


def test_lost_packets_are_seen_by_the_senders_clock():
    block = forces(FORCE)
    _, found = run(part(block, np.r_[0:AT, AT + 10 : len(block)]))
    marked(found, Doubt.SETTLING)
    _, few = run(part(block, np.r_[0:AT, AT + 2 : len(block)]))
    assert few.valid[AT:].all()


def test_lost_packets_without_a_senders_clock_are_seen_by_their_flag():
    block = spoilt(flags=int(Flag.GAP))
    block = replace(block, controller_time=np.full(len(block), np.nan))
    _, found = run(block)
    marked(found, Doubt.SETTLING)


def test_bridged_gap_costs_little():
    sound = run(forces(FORCE))[1]
    found = run(spoilt([AT, AT + 1], wrench=np.nan))[1]
    rows = slice(AT + 2, AT + 2000)
    assert found.valid[rows].all()
    assert np.abs(found.error[rows] - sound.error[rows]).max() < 0.4 * sound.sd[rows].min()


@pytest.mark.parametrize("name", ["controller_time", "host_time"])
def test_clock_that_goes_back(name):
    times = forces(FORCE).host_time
    _, found = run(spoilt(**{name: times[AT] - 2.0}))
    marked(found, Doubt.CLOCK)


def test_flagged_clock_jump():
    _, found = run(spoilt(flags=int(Flag.CLOCK_JUMP)))
    marked(found, Doubt.CLOCK)
    joints = still()
    flags = np.array(joints.flags)
    flags[1200] = int(Flag.CLOCK_JUMP)
    _, found = run(forces(FORCE), replace(joints, flags=flags))
    row = int(np.searchsorted(forces(FORCE).host_time, joints.host_time[1200]))
    marked(found, Doubt.CLOCK | Doubt.BAD_JOINTS, row)


def test_stated_rate_that_is_not_the_senders():
    block = forces(FORCE)
    slow = replace(block, controller_time=2.0 * np.asarray(block.controller_time))
    sensing = Sensing(models())
    sensing.joints(still())
    assert not sensing.force(slow).valid.any()


def test_force_in_counts():
    counts = np.rint(1000.0 * FORCE)
    block = forces(np.where(np.abs(counts) < 40_000, counts, 39_999))
    sensing = Sensing(models())
    sensing.joints(still())
    found = sensing.force(block)
    assert not found.valid.any()
    marked(found, Doubt.BAD_FORCE, slice(20, None))


def test_force_beyond_the_sensors_range():
    _, found = run(spoilt(wrench=np.r_[600.0, 0, 0, np.full(3, np.nan)]),
                   settings=SensingSettings(force_most=500.0))  # fmt: skip
    marked(found, Doubt.BAD_FORCE)


def test_clipped_force():
    clipped = np.array(FORCE)
    clipped[AT:] = np.clip(3.0 * clipped[AT:], -110.0, 110.0)
    _, found = run(forces(clipped))
    flat = np.flatnonzero((found.doubt & int(Doubt.BAD_FORCE)) != 0)
    assert flat[0] - AT < 0.03 * RATE
    assert not found.valid[flat[0] :].any()


def test_disconnected_sensor():
    dead = np.array(FORCE)
    dead[AT:] = 0.0
    _, found = run(forces(dead))
    marked(found, Doubt.BAD_FORCE, slice(AT + 250, None))


def test_joints_missing_old_or_flagged():
    late = part(still(), slice(0, 1101))  # to 4.3 s
    _, found = run(forces(FORCE), late)
    marked(found, Doubt.NO_JOINTS, slice(AT + 100, None))
    joints = still()
    flags = np.array(joints.flags)
    flags[1200] = int(Flag.NOT_FINITE)
    values = np.array(joints.joints)
    values[1200] = np.nan
    _, found = run(forces(FORCE), replace(joints, flags=flags, joints=values))
    at = round((joints.host_time[1200]) * RATE)
    marked(found, Doubt.BAD_JOINTS, slice(at + 1, at + 19))
    assert found.valid[at + 21]


def test_joints_that_leap_are_doubted_and_fast_ones_are_not():
    """20 deg in 4 ms is a packet of something else; 500 deg/s is a robot on its way."""
    block = still()
    moved = np.array(block.joints)
    leap = int(np.searchsorted(block.host_time, AT / RATE))
    moved[leap:, 0] += 20.0 * DEG
    _, found = run(forces(FORCE), joints=replace(block, joints=moved))
    after = int(np.ceil(block.host_time[leap] * RATE))
    marked(found, Doubt.BAD_JOINTS, slice(after + 1, after + 19))
    assert found.valid[after + 25 :].any()
    moved = np.array(block.joints)
    moved[:, 5] += np.interp(np.arange(len(moved)), [leap, leap + 15], [0.0, 30.0 * DEG])
    _, found = run(forces(FORCE), joints=replace(block, joints=moved))
    assert not (found.doubt[20_000:] & int(Doubt.BAD_JOINTS)).any()


def test_filters_settle_when_joints_come_back():
    joints = still()
    gone = (joints.host_time > 4.5) & (joints.host_time < 5.0)
    _, found = run(forces(FORCE), part(joints, ~gone))
    back = round(5.0 * RATE) + 20
    marked(found, Doubt.SETTLING, slice(back, back + 2000))


@pytest.mark.parametrize("turn", [60.0 * DEG, 200.0 * DEG])
def test_pose_outside_the_models(turn):
    joints = still()
    values = np.array(joints.joints)
    values[joints.host_time >= 4.5, 0] += turn * float(ROBOT.controller.sign[0])
    _, found = run(forces(FORCE), replace(joints, joints=values))
    marked(found, Doubt.OUTSIDE, slice(round(4.51 * RATE), None))


def held_tool():
    return HeldTool(
        mass=18.5, centre=np.array([0.012, -0.006, 0.145]),
        weight_in_base=np.array([0.0, 0.0, -181.0]), force_offset=np.array([3.0, -2.0, 5.0]),
        moment_offset=np.array([0.1, 0.2, -0.1]), mass_sd=0.02, centre_sd=np.full(3, 1e-4),
        force_offset_sd=np.full(3, 0.2), condition=2.2, force_noise=0.4, moment_noise=0.03,
    )  # fmt: skip


def sensed(force, joints=HOME):
    """What a sensor at the flange reads of a force on the tool point, base axes, and of weight."""
    from robotrue.robot.forward import walk

    state, tool = walk(ROBOT, joints[None]), held_tool()
    R = state.flange_rotation[0]
    arm = R.T @ (state.position[0] - state.flange_position[0])
    local, pull = force @ R, R.T @ tool.weight_in_base
    return np.column_stack(
        [
            local + tool.force_offset + pull,
            np.cross(arm, local) + tool.moment_offset + np.cross(tool.centre, pull),
        ]
    )


def test_weight_and_offset_are_taken_off():
    given = models(held=held_tool())
    _, found = run(forces(sensed(FORCE), "sensor"), given=given)
    np.testing.assert_allclose(found.wrench[20_000:, :3], FORCE[20_000:], atol=1e-9)
    np.testing.assert_allclose(found.wrench[20_000:, 3:], 0.0, atol=1e-9)
    plain = run(forces(FORCE))[1]
    np.testing.assert_allclose(found.error[20_000:], plain.error[20_000:], atol=1e-12)


@pytest.mark.parametrize("order", [[1, 0, 2, 4, 3, 5], [1, 0, 2, 3, 4, 5], [0, 2, 1, 3, 5, 4]])
def test_swapped_axes_are_seen_by_their_moments(order):
    swapped = sensed(FORCE)
    swapped[AT:] = swapped[AT:, order]
    _, found = run(forces(swapped, "sensor"), given=models(held=held_tool()))
    marked(found, Doubt.BAD_FORCE, slice(AT + 2500, None))


def test_inertia_of_the_held_tool():
    """The arm swings about joint 1: m a of the held mass comes off, within the joints' noise."""
    time = np.arange(-0.1, 8.0, 1.0 / 250.0)
    joints = np.tile(HOME, (len(time), 1))
    joints[:, 0] += 0.02 * np.sin(2.0 * np.pi * 0.5 * time)
    given = models(held=held_tool(), response=None)
    from robotrue.robot.forward import walk

    fine = np.arange(round(8.0 * RATE)) / RATE
    q = np.tile(HOME, (len(fine), 1))
    q[:, 0] += 0.02 * np.sin(2.0 * np.pi * 0.5 * fine)
    state, tool = walk(ROBOT, q), held_tool()
    centre = state.flange_position + state.flange_rotation @ tool.centre
    acceleration = np.gradient(np.gradient(centre, fine, axis=0), fine, axis=0)
    rng = np.random.default_rng(2)
    turned = state.flange_rotation.transpose(0, 2, 1)
    pull = np.einsum("nij,nj->ni", turned, tool.weight_in_base - tool.mass * acceleration)
    read = np.column_stack([pull + tool.force_offset, np.full((len(fine), 3), np.nan)])
    read[:, :3] += 0.01 * rng.normal(size=(len(fine), 3))
    left = {}
    for samples in (0, 25):
        sensing = Sensing(given, SensingSettings(acceleration_samples=samples))
        sensing.joints(joints_at(joints, time))
        left[samples] = np.nanmax(
            np.abs(sensing.force(forces(read, "sensor")).wrench[10_000:35_000, :3])
        )
    assert left[0] > 5.0
    assert left[25] < 0.25 * left[0]


def test_wrong_frame_and_wrong_arm_are_refused():
    sensing = Sensing(models(held=held_tool()))
    with pytest.raises(ModelMismatchError, match="a held tool to take off"):
        sensing.force(forces(FORCE[:5], "base"))
    with pytest.raises(ModelMismatchError, match="axes of 'world'"):
        Sensing(models()).force(forces(FORCE[:5], "world"))
    joints = still(0.1)
    with pytest.raises(ModelMismatchError, match="7 joints in the stream"):
        sensing.joints(replace(joints, joints=np.zeros((len(joints), 7))))


def test_response_that_is_no_receptance_is_refused():
    own = response().oscillators
    wrong = replace(own, respond=own.respond * 1e4, residual=own.residual * 1e4)
    with pytest.raises(ModelMismatchError, match="a receptance in m/N, not an accelerance"):
        models(response=replace(response(), oscillators=wrong))
    with pytest.raises(ReachError, match="of joint 2 at 300"):
        Sensing(models(response=replace(response(), joints=np.r_[0.0, 300.0 * DEG, 0, 0, 0, 0])))


def test_models_that_say_nothing_are_refused():
    with pytest.raises(ConfigurationError, match="neither stiffness nor frequency response"):
        SensingModels(robot=ROBOT, rate=RATE)
    other = replace(ARM.arm.robot, d=ARM.arm.robot.d + 0.1)
    from robotrue.online.sensing_models import PoseResponse

    arm = replace(ARM.arm, robot=other)
    with pytest.raises(ModelMismatchError, match="another geometry"):
        models(response=PoseResponse(arm=arm, tool=ARM.tool))
