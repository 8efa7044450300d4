"""The learned deviation online: what it says of the same windows offline, counted once. SIMULATED.

Windows of an arm whose joints soften under load, predicted with the response of the unloaded arm
at one pose; streams of another stretch and of another pass.
"""

from functools import cache

import numpy as np
import pytest
from sensing_cases import part
from test_sensing import estimated, same

from robotrue.core.units import UM
from robotrue.dynamics.deviation import fit_deviation
from robotrue.dynamics.deviation_physics import static_compliance
from robotrue.dynamics.learned_deviation import WindowTrust
from robotrue.dynamics.oscillators import join_oscillators
from robotrue.dynamics.pose_modes import pose_modes
from robotrue.dynamics.streaming import ModalFilter
from robotrue.dynamics.windows import WindowSet, concatenate_windows, peaks_per_turn
from robotrue.online.blocks import ForceBlock, JointBlock
from robotrue.online.estimates import Doubt
from robotrue.online.sensing import Sensing
from robotrue.online.sensing_models import (
    JointCompliance,
    LearnedPart,
    MeasuredResponse,
    SensingModels,
)
from robotrue.online.sensing_records import new_record
from robotrue.online.sensing_windows import add_peak, peaks, window_dtype
from robotrue.simulation.milling_arm import FEED, RATE, TURN, milling_arm, pass_joints
from robotrue_reproductions.jin2022.jin_tables import arm_of
from robotrue_reproductions.jin2022.milling_pass import pass_force, read_force, tooling

ARM, TOOLS = milling_arm(6), tooling(6)
STATED = arm_of(ARM)
ROBOT = STATED.robot
HOME = pass_joints(np.array([0.25]))[0]
OWN = join_oscillators([pose_modes(ARM.arm, HOME).oscillators(), ARM.tool])
ROWS = 5200
"""Samples of a window, a quarter of a second: fifteen turns and six tenths of one."""
SECONDS = 7.2
"""Beyond the memory of the filters, and not a whole number of windows."""


def truth(force, joints):
    """Displacement y (n,) m of the loaded arm."""
    mean = force.mean(axis=0)
    _, jacobian = ARM.arm.mass_and_jacobian(joints)
    modes = pose_modes(ARM.soften(jacobian[:3].T @ mean), joints)
    stream = ModalFilter(join_oscillators([modes.oscillators(), ARM.tool]), RATE)
    stream.settle(mean)
    return stream.push(force)[:, 1]


def window(read, bent, joints, measured=np.nan, name="1"):
    """One window of what the sensor read and the response bent."""
    peak = peaks_per_turn(np.abs(read[:, 1]), TURN).mean()
    return WindowSet(
        passes=(name,),
        joints=joints[None],
        force=read.mean(axis=0)[None],
        force_peak=np.array([peak]),
        force_mean=-read[:, 1].mean(keepdims=True),
        predicted=np.array([peaks_per_turn(-bent, TURN).mean()]),
        measured=np.array([measured]),
    )


@cache
def learned():
    """The deviation of thirty windows along the printed pass."""
    rng = np.random.default_rng(11)
    rows = []
    for along in np.linspace(0.01, 0.48, 30):
        joints = pass_joints(np.array([along]))[0]
        force = pass_force(TOOLS, ROWS, rng) * rng.uniform(0.8, 1.2)
        read = read_force(TOOLS, force, rng)
        stream = ModalFilter(OWN, RATE)
        stream.settle(read.mean(axis=0))
        seen = -truth(force, joints) + 0.3 * UM * rng.standard_normal()
        rows.append(
            window(read, stream.push(read)[:, 1], joints, peaks_per_turn(seen, TURN).mean())
        )
    return fit_deviation(concatenate_windows(rows), STATED, row=static_compliance(-OWN.static[1]))


def models(*, with_learned=True, deviation=None):
    known = 1.0 / STATED.stiffness
    return SensingModels(
        robot=ROBOT,
        rate=RATE,
        compliance=JointCompliance(compliance=known, covariance=np.diag((0.3 * known) ** 2)),
        response=MeasuredResponse(oscillators=OWN, joints=HOME, frame="base"),
        learned=LearnedPart(model=deviation or learned(), spindle=RATE / TURN, window=ROWS / RATE)
        if with_learned
        else None,
    )


@cache
def stream(shift=(0.0, 0.0), times=1.0, at=0.2):
    """Joints, forces and the true displacement y of seconds of a pass."""
    rng = np.random.default_rng(12)
    n = round(SECONDS * RATE)
    force = times * pass_force(TOOLS, n, rng)
    read, time = read_force(TOOLS, force, rng), np.arange(n) / RATE
    wrench = np.full((n, 6), np.nan)
    wrench[:, :3] = read
    zeros = np.zeros(n, dtype=np.int64)
    block = ForceBlock(
        controller_time=time, host_time=time, wrench=wrench, frame="base",
        sequence=np.arange(n), status=zeros, flags=zeros,
    )  # fmt: skip
    clock = np.arange(-0.1, SECONDS + 0.1, 1.0 / 250.0)
    joints = pass_joints(at + FEED * clock, shift)
    m = len(clock)
    arm = JointBlock(
        controller_time=clock, host_time=clock, joints=ROBOT.controller.to_controller(joints),
        T_frame_tool=np.full((m, 4, 4), np.nan), sequence=np.arange(m),
        flags=np.zeros(m, dtype=np.int64),
    )  # fmt: skip
    return arm, block, truth(force, joints[m // 2])


def run(arm, block, cuts=(), **given):
    sensing = Sensing(models(**given))
    sensing.joints(arm)
    return sensing, estimated(sensing, block, cuts)


def offline(block, found, k):
    """Window ``k`` of a stream cut by hand, and what the model says of it."""
    rows = slice(k * ROWS, (k + 1) * ROWS)
    own = ModalFilter(OWN, RATE)
    own.settle(np.array(block.wrench[0, :3]))
    bent = own.push(np.array(block.wrench[:, :3]))[rows, 1]
    joints = ROBOT.controller.to_model(found["joints"][rows]).mean(axis=0)
    asked = window(np.array(block.wrench[rows, :3]), bent, joints, name="online")
    return asked, learned().predict(asked)


def beyond_physics(asked, said):
    model = learned()
    gain = model.factors[-1] * (asked.predicted[0] - model.windows.predicted.mean())
    return said.deviation[0] - said.physics[0] + gain


def test_windows_say_what_the_model_says_of_them_offline():
    arm, block, _ = stream()
    sensing, found = run(arm, block)
    last = len(block) // ROWS - 1
    asked, said = offline(block, found, last)
    assert said.standing[0] == WindowTrust.INSIDE
    correction = sensing.state()["correction"]
    np.testing.assert_allclose(correction[0], beyond_physics(asked, said), atol=1e-6 * UM)
    np.testing.assert_allclose(np.sqrt(correction[1]), said.sd[0], rtol=1e-6)
    assert correction[2] == said.standing[0]
    # the deviation of the samples behind it, against that of their own window
    own = ModalFilter(OWN, RATE)
    own.settle(np.array(block.wrench[0, :3]))
    bent = own.push(np.array(block.wrench[:, :3]))[:, 1]
    rows = slice(last * ROWS, (last + 1) * ROWS)
    assert (found["doubt"][rows] == 0).all()
    deviation = -(found["error"][rows, 1] - bent[rows])
    np.testing.assert_allclose(deviation.mean(), said.deviation[0], atol=0.3 * UM)
    assert (found["sd"][rows, 1] > 0.95 * said.sd[0]).all()


def test_any_cut_gives_the_same_bits():
    arm, block, _ = stream()
    whole, one = run(arm, block)
    edges = np.cumsum(np.random.default_rng(3).integers(1, 4000, 200))
    pieces, two = run(arm, block, [*edges[edges < len(block)].tolist()])
    same(one, two)
    for name, values in whole.state().items():
        np.testing.assert_array_equal(values, pieces.state()[name], err_msg=name)


def test_restored_goes_on_with_a_window_half_full():
    arm, block, _ = stream()
    at = 24 * ROWS + ROWS // 2 + 77
    _, whole = run(arm, block)
    one = Sensing(models())
    one.joints(arm)
    one.force(part(block, slice(0, at)))
    two = Sensing(models())
    two.restore(one.state())
    rest = estimated(two, part(block, slice(at, None)))
    assert (rest["doubt"] == 0).all()
    same({name: values[at:] for name, values in whole.items()}, rest)


@pytest.mark.parametrize("strange", [{"shift": (0.4, -0.15)}, {"times": 4.0}])
def test_outside_what_was_learned_the_physics_stand_alone_with_their_band(strange):
    arm, block, _ = stream(**strange)
    sensing, found = run(arm, block)
    asked, said = offline(block, found, len(block) // ROWS - 1)
    assert said.standing[0] == WindowTrust.EXTRAPOLATED
    np.testing.assert_allclose(said.deviation, said.physics, atol=1e-3 * UM)
    correction = sensing.state()["correction"]
    np.testing.assert_allclose(correction[0], beyond_physics(asked, said), atol=1e-6 * UM)
    np.testing.assert_allclose(np.sqrt(correction[1]), said.sd[0], rtol=1e-6)
    settled = slice(round(sensing.memory * RATE), None)
    assert (found["doubt"][settled] == int(Doubt.EXTRAPOLATED)).all()
    assert np.isfinite(found["error"][settled]).all()
    inside = run(*stream()[:2])[1]
    assert found["sd"][settled, 1].min() > inside["sd"][settled, 1].max()


def test_static_part_is_counted_once():
    """On a pass nobody learned from, the error is nearer to the truth than without."""
    arm, block, moved = stream(shift=(-0.12, 0.0))
    missed = {}
    for with_learned in (False, True):
        sensing, found = run(arm, block, with_learned=with_learned)
        settled = slice(round(sensing.memory * RATE), None)
        rest = found["error"][settled, 1] - moved[settled]
        missed[with_learned] = float(np.sqrt((rest**2).mean()))
        if with_learned:
            band = 1.96 * found["sd"][settled, 1]
            assert (np.abs(rest) < band).mean() > 0.9
    assert missed[True] < 0.7 * missed[False], missed


@pytest.mark.parametrize("turn", [62.5, 62.4, 62.6, 80.0, 333.0 + 1.0 / 3.0])
@pytest.mark.parametrize("n", [334, 562, 563, 1000, 1250, 1251])
def test_turns_are_cut_as_offline(turn, n):
    bent, push = np.random.default_rng(5).normal(size=(2, n))
    sums = new_record(window_dtype(6))[0]
    for one, two in zip(bent, push, strict=True):
        add_peak(one, two, turn, sums)
    found = peaks(sums, turn)
    np.testing.assert_allclose(found[0], peaks_per_turn(bent, turn).mean(), rtol=1e-12)
    np.testing.assert_allclose(found[1], peaks_per_turn(np.abs(push), turn).mean(), rtol=1e-12)
