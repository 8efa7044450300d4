"""Cutting force: closed forms, symmetries, limits."""

from dataclasses import replace

import numpy as np
import pytest

from robotrue.dynamics.cutter import CutterEngagement, CuttingCoefficients, EndMill, engagement
from robotrue.dynamics.milling_force import force_over_time, mean_force, milling_force
from robotrue.errors import ConfigurationError

TURN = 2.0 * np.pi * (np.arange(7200) + 0.5) / 7200
STEEL = CuttingCoefficients(
    tangential=8e8, radial=1.7e8, axial=2.2e8,
    tangential_edge=2.8e4, radial_edge=3.1e4, axial_edge=1.4e3,
)  # fmt: skip
FLAT = EndMill(kind="flat", diameter=0.016, teeth=2, helix=np.deg2rad(30.0))
BALL = EndMill(kind="ball", diameter=0.016, teeth=2, helix=np.deg2rad(30.0))
CUT = CutterEngagement(mode="up", depth=1e-3, width=6e-3, feed_per_tooth=5e-5, spindle=60.0)


@pytest.mark.parametrize(
    ("mode", "width"), [("up", 0.006), ("up", 0.012), ("down", 0.006), ("slot", 0.016)]
)
@pytest.mark.parametrize("teeth", [1, 2, 5])
@pytest.mark.parametrize("helix", [0.0, 45.0])
def test_mean_of_a_turn_is_the_closed_form(mode, width, teeth, helix):
    cutter = replace(FLAT, teeth=teeth, helix=np.deg2rad(helix))
    cut = replace(CUT, mode=mode, width=width)
    mean = milling_force(cutter, cut, STEEL, TURN).mean(axis=0)
    np.testing.assert_allclose(mean, mean_force(cutter, cut, STEEL), atol=0.05)


def test_slot_written_out():
    """Altintas 2012, eq. 2.22: slopes of a slot."""
    cut = replace(CUT, mode="slot", width=0.016)
    n, a, c = FLAT.teeth, cut.depth, cut.feed_per_tooth
    want = [
        -n * a / 4 * STEEL.radial * c - n * a / np.pi * STEEL.radial_edge,
        n * a / 4 * STEEL.tangential * c + n * a / np.pi * STEEL.tangential_edge,
        n * a / np.pi * STEEL.axial * c + n * a / 2 * STEEL.axial_edge,
    ]
    np.testing.assert_allclose(mean_force(FLAT, cut, STEEL), want, rtol=1e-12)


def test_one_straight_tooth_at_the_thickest_chip():
    """At 90 deg the cutting speed is to the right: the tool is pushed left and back."""
    cutter = replace(FLAT, teeth=1, helix=0.0)
    cut = replace(CUT, mode="slot", width=0.016)
    force = milling_force(cutter, cut, STEEL, np.array([np.pi / 2]))[0]
    chip = cut.feed_per_tooth
    np.testing.assert_allclose(
        force,
        cut.depth * np.array([
            -(STEEL.radial * chip + STEEL.radial_edge),
            STEEL.tangential * chip + STEEL.tangential_edge,
            STEEL.axial * chip + STEEL.axial_edge,
        ]),
        rtol=1e-12,
    )  # fmt: skip


def test_up_and_down_milling_are_mirror_images():
    """Turning the tool backwards in a mirror: x of the shear terms flips, y stays."""
    shear = CuttingCoefficients(tangential=8e8, radial=1e-6, axial=0.0)
    up = mean_force(FLAT, CUT, shear)
    down = mean_force(FLAT, replace(CUT, mode="down"), shear)
    np.testing.assert_allclose(up, down * [-1, 1, 1], atol=1e-9)


def test_out_of_the_cut_there_is_nothing():
    cutter = replace(FLAT, helix=0.0)
    force = milling_force(cutter, CUT, STEEL, TURN)
    swept = np.arccos(1.0 - 2.0 * CUT.width / cutter.diameter)
    assert (force == 0.0).all(axis=1).mean() == pytest.approx(1.0 - swept / np.pi, abs=2e-3)


def test_runout_loads_one_tooth_more_and_leaves_the_sum():
    """What one tooth takes more the other takes less, while both cut."""
    slot = replace(CUT, mode="slot", width=0.016)
    force = milling_force(replace(FLAT, helix=0.0, runout=3e-6), slot, STEEL, TURN)
    halves = force[:3600], force[3600:]
    assert np.abs(halves[0] - halves[1]).max() > 1.0
    shear = CuttingCoefficients(tangential=8e8, radial=1.7e8, axial=2.2e8)
    cut = replace(slot, width=0.016)
    free = milling_force(replace(FLAT, helix=0.0), cut, shear, TURN)
    eccentric = milling_force(replace(FLAT, helix=0.0, runout=1e-6), cut, shear, TURN)
    inner = (TURN % np.pi > 0.2) & (TURN % np.pi < np.pi - 0.2)
    both = [f[inner].reshape(2, -1, 3).sum(axis=0) for f in (free, eccentric)]
    np.testing.assert_allclose(both[0], both[1], atol=0.05)


def test_a_tooth_that_runs_out_far_enough_cuts_alone():
    """Half a turn apart, more than half a feed in: the other tooth meets nothing."""
    cutter = replace(FLAT, helix=0.0, runout=100e-6)
    slot = replace(CUT, mode="slot", width=0.016)
    shear = CuttingCoefficients(tangential=8e8, radial=1.7e8, axial=2.2e8)
    alone = milling_force(
        replace(FLAT, helix=0.0, teeth=1), replace(slot, feed_per_tooth=1e-4), shear, TURN
    )
    np.testing.assert_allclose(milling_force(cutter, slot, shear, TURN), alone, atol=1e-9)


def test_a_deep_ball_is_half_a_sphere_and_a_shaft():
    """Above the ball the shaft adds what a flat mill of that depth takes."""
    deep = replace(CUT, mode="slot", width=0.016, depth=0.012)
    ball = mean_force(BALL, replace(deep, depth=0.008), STEEL)
    shaft = mean_force(FLAT, replace(deep, depth=0.004), STEEL)
    np.testing.assert_allclose(mean_force(BALL, deep, STEEL), ball + shaft, rtol=2e-3)


def test_ball_against_its_integral():
    """Straight teeth in a full slot, shear only: integrals over angle and tilt by quadrature."""
    cutter = replace(BALL, helix=0.0)
    cut = replace(CUT, mode="slot", width=0.016, depth=0.003)
    shear = CuttingCoefficients(tangential=8e8, radial=3e8, axial=2e8)
    radius, c, n = cutter.radius, cut.feed_per_tooth, cutter.teeth
    steepest = np.arccos(1.0 - cut.depth / radius)
    tilt = (np.arange(20000) + 0.5) * steepest / 20000
    length = radius * steepest / 20000
    sin, cos = np.sin(tilt), np.cos(tilt)
    per_turn = n * c * length / (2.0 * np.pi)
    want = [
        -per_turn * (sin * (3e8 * sin - 2e8 * cos)).sum() * np.pi / 2,
        per_turn * (sin * 8e8).sum() * np.pi / 2,
        per_turn * (sin * (2e8 * sin + 3e8 * cos)).sum() * 2.0,
    ]
    np.testing.assert_allclose(mean_force(cutter, cut, shear), want, atol=0.02)


def test_engagement_of_a_ball_narrows_towards_the_tip():
    entry, leave = engagement(BALL, CUT, np.array([1e-5, 1e-4, 1e-3, 8e-3]))
    swept = leave - entry
    assert swept[0] == 0.0
    assert (np.diff(swept) >= 0.0).all()
    assert swept[-1] == pytest.approx(np.arccos(1.0 - 2.0 * CUT.width / BALL.diameter))


def test_force_is_periodic_in_the_teeth_and_labelled():
    record = force_over_time(FLAT, CUT, STEEL, rate=24e3, duration=1.0)
    np.testing.assert_allclose(record.force[:200], record.force[200:400], atol=1e-9)
    assert "simulated" in record.source


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (lambda: replace(FLAT, kind="bull"), "cutter of kind 'bull'"),
        (lambda: replace(FLAT, teeth=0), "0 teeth"),
        (lambda: replace(FLAT, helix=1.5), "helix of 85.9437 deg"),
        (lambda: replace(CUT, mode="climb"), "milling mode 'climb'"),
        (lambda: replace(CUT, depth=0.0), "depth of the cut is 0"),
        (lambda: mean_force(FLAT, replace(CUT, width=0.02), STEEL), "width of cut 20 mm"),
        (lambda: replace(STEEL, tangential=-1.0), "expected above zero"),
        (lambda: force_over_time(FLAT, CUT, STEEL, rate=500.0, duration=1.0), "500 samples/s"),
        (lambda: milling_force(FLAT, CUT, STEEL, TURN, slices=0), "0 axial slices"),
    ],
)
def test_refused(build, said):
    with pytest.raises(ConfigurationError, match=said):
        build()
