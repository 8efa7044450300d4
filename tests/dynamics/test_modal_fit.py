"""Planted modes come back, the curve is rebuilt, nothing is invented."""

from dataclasses import replace

import numpy as np
import pytest
from frf_cases import measured, modal, robot_with_tool, single

from robotrue.dynamics.frf import with_static
from robotrue.dynamics.interpolation import rebuild_error
from robotrue.dynamics.modal_fit import fit_modes
from robotrue.errors import ObservabilityError


def test_thirteen_clean_modes_come_back_exactly():
    truth = robot_with_tool()
    found = fit_modes(measured(truth))
    np.testing.assert_allclose(found.frequency, truth.frequency, rtol=1e-9)
    np.testing.assert_allclose(found.damping, truth.damping, rtol=1e-7)
    f = np.geomspace(4.0, 2900.0, 500)
    np.testing.assert_allclose(found.response(f), truth.response(f), rtol=1e-6, atol=1e-15)
    np.testing.assert_allclose(found.modal_static, truth.modal_static, rtol=1e-6)
    assert not found.lower.any()
    assert rebuild_error(measured(truth), found) < 1e-9


def arm_alone():
    """Four modes in all three axes."""
    shapes = np.random.default_rng(4).normal(size=(4, 3)) * 0.04
    return modal([9.0, 14.0, 31.0, 52.0], [0.035, 0.03, 0.03, 0.025], shapes)


def test_noise_leaves_the_curve_better_than_the_lines():
    truth = arm_alone()
    frf = measured(truth, noise=0.05, step=0.25, highest=120.0)
    model = fit_modes(frf)
    f = np.geomspace(4.0, 119.0, 1000)
    want = truth.response(f)
    off = np.linalg.norm(model.response(f) - want, axis=(1, 2)) / np.linalg.norm(want, axis=(1, 2))
    assert np.sqrt((off**2).mean()) < 0.012
    assert len(model.poles) == 4
    assert rebuild_error(frf, model) == pytest.approx(0.05, abs=0.01)


def test_what_lies_above_the_band_is_the_upper_residual():
    truth = modal([20.0, 60.0, 900.0], [0.03, 0.03, 0.02], [[0.1], [0.1], [3.0]], axes=("x",))
    model = fit_modes(measured(truth, step=0.2, highest=200.0))
    assert len(model.poles) == 2
    above = 9.0 / (2.0 * np.pi * 900.0) ** 2
    assert model.upper[0, 0] == pytest.approx(above, rel=0.05)


def test_what_lies_below_the_band_is_the_lower_residual():
    truth = modal([1.0, 60.0, 90.0], [0.03, 0.03, 0.02], [[0.1], [0.1], [0.05]], axes=("x",))
    frf = measured(truth, step=0.2, highest=200.0, lowest=20.0)
    model = fit_modes(frf, lower=True)
    assert len(model.poles) == 2
    assert model.lower[0, 0] == pytest.approx(0.01, rel=0.05)
    assert fit_modes(frf).lower.any()
    assert not fit_modes(frf, lower=False).lower.any()


def test_a_static_load_test_pulls_the_modes_to_it():
    truth = arm_alone()
    blind = measured(truth, noise=0.2, step=0.5, highest=100.0, lowest=6.0)
    static = {
        a + b: float(truth.modal_static[i, j])
        for i, a in enumerate("xyz")
        for j, b in enumerate("xyz")
    }
    without = np.abs(fit_modes(blind).modal_static - truth.modal_static).max()
    pulled = fit_modes(with_static(blind, static))
    assert np.abs(pulled.modal_static - truth.modal_static).max() < 0.2 * without
    assert not pulled.lower.any()


def test_one_pair_alone():
    truth = single(frequency=30.0, damping=0.02)
    model = fit_modes(measured(truth, step=0.25, highest=200.0))
    assert model.frequency == pytest.approx([30.0], rel=1e-9)
    assert model.damping == pytest.approx([0.02], rel=1e-7)


def test_pairs_that_were_not_measured_stay_out():
    truth = robot_with_tool()
    frf = measured(truth)
    present = np.eye(3, dtype=bool)
    model = fit_modes(replace(frf, present=present, response=np.where(present, frf.response, 0.0)))
    assert not model.residues[:, 0, 1].any()
    np.testing.assert_allclose(model.modal_static[0, 0], truth.modal_static[0, 0], rtol=5e-3)


def test_noise_alone_has_no_modes():
    frf = measured(single(), step=1.0, highest=400.0)
    rng = np.random.default_rng(0)
    noise = rng.normal(size=frf.response.shape) + 1j * rng.normal(size=frf.response.shape)
    with pytest.raises(ObservabilityError, match="no pole comes back"):
        fit_modes(replace(frf, response=1e-7 * noise))


def test_too_few_lines():
    with pytest.raises(ObservabilityError, match="sixteen"):
        fit_modes(measured(single(), step=20.0, highest=200.0))


def test_modes_just_above_the_band_do_not_drag_those_in_it():
    truth = robot_with_tool(7)
    frf = measured(truth, static=True, highest=1000.0)
    model = fit_modes(frf)
    assert rebuild_error(frf, model) < 0.01
    assert np.allclose(model.frequency[:6], truth.frequency[:6], rtol=2e-3)
    assert np.allclose(model.damping[:6], truth.damping[:6], rtol=0.05)
