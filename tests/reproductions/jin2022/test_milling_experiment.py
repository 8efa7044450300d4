"""The virtual milling experiment: its size beside the printed one, and the same for a seed."""

import numpy as np
import pytest

from robotrue.core.units import UM
from robotrue.simulation.milling_arm import RATE, SPINDLE, milling_arm, pass_joints
from robotrue_reproductions.jin2022.milling_experiment import milling_experiment, with_noise
from robotrue_reproductions.jin2022.milling_pass import tooling


@pytest.fixture(scope="module")
def printed():
    return milling_experiment(2, [0])


def test_forces_and_errors_are_of_the_printed_size(printed):
    """Printed: peak 75 to 83 N, mean -4.8 to -5.6 N, error 28 to 35 um, deviation 4 (11) um."""
    windows = printed.windows
    assert len(windows) == 93
    assert 60.0 < windows.force_peak.min() < windows.force_peak.max() < 95.0
    assert -6.0 < windows.force_mean.mean() < -2.0
    assert 25 * UM < windows.measured.mean() < 40 * UM
    size = np.abs(windows.deviation)
    assert 2.0 * UM < size.mean() < 8.0 * UM
    assert 5.0 * UM < size.max() < 15.0 * UM


def test_most_of_the_deviation_is_static(printed):
    """What varies along the pass is the bending under the mean force, not the ringing."""
    windows = printed.windows
    rest = windows.deviation - printed.static
    static = printed.static - printed.static.mean()
    assert np.std(rest + static.mean()) < 3.0 * UM
    assert np.corrcoef(static, windows.deviation)[0, 1] > 0.8


def test_a_seed_gives_the_same_windows_in_any_company(printed):
    again = milling_experiment(2, [0]).windows
    np.testing.assert_array_equal(again.measured, printed.windows.measured)
    np.testing.assert_array_equal(again.joints, printed.windows.joints)


def test_noise_is_added_to_the_measured_error_alone(printed):
    noisy = with_noise(printed.windows, 2.5 * UM, 7)
    difference = noisy.measured - printed.windows.measured
    assert 2.0 * UM < difference.std() < 3.0 * UM
    np.testing.assert_array_equal(noisy.predicted, printed.windows.predicted)


def test_belief_is_within_thirty_percent_and_load_softens():
    arm = milling_arm(5)
    ratio = arm.stiffness_belief / arm.arm.stiffness
    assert ((ratio > 0.7) & (ratio < 1.3)).all()
    soft, stiff = arm.soften(np.full(6, 120.0)), arm.soften(np.zeros(6))
    assert (soft.stiffness < arm.arm.stiffness).all()
    assert (stiff.stiffness > arm.arm.stiffness).all()


def test_up_milling_pushes_back_along_the_feed():
    force = tooling(1).table
    assert len(force) == round(3 * RATE / SPINDLE)
    assert force[:, 0].max() <= 1e-9
    assert -33.0 < force[:, 0].mean() < -25.0


def test_pass_keeps_its_attitude():
    joints = pass_joints(np.array([0.0, 0.2, 0.49]), (0.4, -0.15))
    assert np.isfinite(joints).all()
    assert np.abs(np.diff(joints, axis=0)).max() < 0.6
