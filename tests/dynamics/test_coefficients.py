"""Planted coefficients come back with honest deviations; wrong axes are named."""

from dataclasses import replace

import numpy as np
import pytest

from robotrue.dynamics.coefficients import CuttingTest, check_axes_agree, identify_coefficients
from robotrue.dynamics.cutter import CutterEngagement, CuttingCoefficients, EndMill
from robotrue.dynamics.milling_force import mean_force
from robotrue.errors import ImplausibleDataError, ObservabilityError

TRUE = CuttingCoefficients(
    tangential=7.96e8, radial=1.69e8, axial=2.22e8,
    tangential_edge=2.77e4, radial_edge=3.08e4, axial_edge=1.4e3,
)  # fmt: skip
VALUES = np.array([7.96e8, 1.69e8, 2.22e8, 2.77e4, 3.08e4, 1.4e3])
FLAT = EndMill(kind="flat", diameter=0.016, teeth=2, helix=0.5)
SLOT = CutterEngagement(mode="slot", depth=1e-3, width=0.016, feed_per_tooth=5e-5, spindle=60.0)
FEEDS = (3e-5, 5e-5, 7e-5, 1e-4, 1.4e-4)


def slots(turn=lambda f: f, cutter=FLAT, cut=SLOT, noise=0.0, seed=0, feeds=FEEDS):
    rng = np.random.default_rng(seed)
    tests = []
    for feed in feeds:
        one = replace(cut, feed_per_tooth=feed)
        force = mean_force(cutter, one, TRUE) + noise * rng.normal(size=3)
        tests.append(CuttingTest(cut=one, force=turn(force)))
    return tests


def numbers(found):
    k = found.coefficients
    return np.array([k.tangential, k.radial, k.axial, k.tangential_edge, k.radial_edge,
                     k.axial_edge])  # fmt: skip


@pytest.mark.parametrize("kind", ["flat", "ball"])
def test_clean_slots(kind):
    cutter = replace(FLAT, kind=kind)
    found = identify_coefficients(cutter, slots(cutter=cutter))
    np.testing.assert_allclose(numbers(found), VALUES, rtol=1e-6)


def test_other_widths_do_as_well():
    tests = slots(cut=replace(SLOT, mode="up", width=0.006))
    tests += slots(cut=replace(SLOT, mode="down", width=0.003))
    np.testing.assert_allclose(numbers(identify_coefficients(FLAT, tests)), VALUES, rtol=1e-6)


def test_stated_deviations_cover():
    off = []
    for seed in range(80):
        found = identify_coefficients(FLAT, slots(noise=0.3, seed=seed))
        off.append((numbers(found) - VALUES) / found.deviation)
    spread = np.std(off, axis=0)
    assert (spread > 0.75).all()
    assert (spread < 1.45).all()


@pytest.mark.parametrize(
    ("turn", "said"),
    [
        (lambda f: f[[1, 0, 2]], "x and y swapped"),
        (lambda f: -f, "x and y flipped"),
        (lambda f: f * [-1, 1, 1], "with x flipped"),
        (lambda f: f * [1, -1, 1], "with y flipped"),
    ],
)
def test_axes_of_the_dynamometer(turn, said):
    with pytest.raises(ImplausibleDataError, match=said):
        identify_coefficients(FLAT, slots(turn, noise=0.1))


def test_axes_of_a_recorded_cut():
    expected = mean_force(FLAT, replace(SLOT, mode="up", width=0.006), TRUE)
    check_axes_agree(1.2 * expected, expected, "cut.csv")
    with pytest.raises(ImplausibleDataError, match="fits with x and y swapped"):
        check_axes_agree(expected[[1, 0, 2]], expected, "cut.csv")
    with pytest.raises(ImplausibleDataError, match="fits with x and y flipped"):
        check_axes_agree(expected * [-1, -1, 1], expected, "cut.csv")


def test_too_little_to_tell():
    with pytest.raises(ObservabilityError, match="2 cutting tests"):
        identify_coefficients(FLAT, slots(feeds=(3e-5, 9e-5)))
    with pytest.raises(ObservabilityError, match="too similar"):
        identify_coefficients(FLAT, slots(feeds=(5.0e-5, 5.1e-5, 5.2e-5)))
    with pytest.raises(ObservabilityError, match="does not change clearly"):
        identify_coefficients(FLAT, slots(noise=20.0, seed=3))
