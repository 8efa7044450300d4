"""The noun, its forms, its value between and beyond the lines."""

import numpy as np
import pytest
from frf_cases import measured, robot_with_tool, single

from robotrue.dynamics.frf import FrequencyResponse, in_form, trusted_lines, with_static
from robotrue.dynamics.interpolation import held_out_error, response_curve
from robotrue.dynamics.modal import modal_model_from_archive
from robotrue.errors import ConfigurationError, ImplausibleDataError, ShapeError


def test_one_mode_is_the_textbook_one():
    """Receptance 1 / (k - m w^2 + j c w), written out."""
    f = np.array([0.0, 10.0, 29.0, 30.0, 300.0])
    omega, k, zeta = 2.0 * np.pi * f, 2e6, 0.03
    omega_0 = 2.0 * np.pi * 30.0
    want = 1.0 / (k * (1.0 - (omega / omega_0) ** 2 + 2j * zeta * omega / omega_0))
    np.testing.assert_allclose(single().response(f)[:, 0, 0], want, rtol=1e-12)
    assert single().modal_static[0, 0] == pytest.approx(1.0 / k, rel=1e-12)
    assert single().frequency[0] == pytest.approx(30.0)
    assert single().damping[0] == pytest.approx(zeta)


def test_forms_differ_by_j_omega_and_come_back():
    f = np.array([1.0, 50.0])
    values = np.array([[2e-6 - 1e-7j], [3e-7j]])
    mobility = in_form(values, f, "receptance", "mobility")
    np.testing.assert_allclose(mobility, values * (2j * np.pi * f)[:, None])
    accelerance = in_form(mobility, f, "mobility", "accelerance")
    np.testing.assert_allclose(accelerance, -values * ((2 * np.pi * f) ** 2)[:, None])
    np.testing.assert_allclose(in_form(accelerance, f, "accelerance", "receptance"), values)


def test_a_line_at_rest_of_an_accelerance_is_refused():
    with pytest.raises(ConfigurationError, match="0 Hz of accelerance does not cover receptance"):
        in_form(np.ones(2, dtype=complex), np.array([0.0, 1.0]), "accelerance", "receptance")
    with pytest.raises(ConfigurationError, match="form 'dynamic stiffness'"):
        in_form(np.ones(1, dtype=complex), np.array([1.0]), "dynamic stiffness", "receptance")


def test_pairs_are_named_response_first():
    frf = measured(robot_with_tool())
    assert frf.pairs[:4] == ("xx", "xy", "xz", "yx")
    np.testing.assert_array_equal(frf.pair("y", "x"), frf.response[:, 1, 0])
    with pytest.raises(ConfigurationError, match="no pair xw"):
        frf.pair("x", "w")


@pytest.mark.parametrize(
    ("change", "error", "said"),
    [
        ({"frequency": np.array([1.0, 1.0, 2.0])}, ShapeError, "has to rise"),
        ({"response": np.full((3, 1, 1), np.nan + 0j)}, ShapeError, "expected a finite number"),
        ({"response_axes": ("a",)}, ConfigurationError, "expected some of"),
        ({"measured_as": "inertance"}, ConfigurationError, "form 'inertance'"),
        ({"valid": (5.0, 5.0)}, ShapeError, "low < high"),
    ],
)
def test_what_is_no_response(change, error, said):
    parts = {
        "frequency": np.array([1.0, 2.0, 3.0]),
        "response": np.ones((3, 1, 1), dtype=complex),
        "response_axes": ("x",),
        "excitation_axes": ("x",),
        "present": np.ones((1, 1), dtype=bool),
        "coherence": None,
        "valid": (1.0, 3.0),
        "measured_as": "receptance",
        "static": None,
        "source": "here",
    }
    with pytest.raises(error, match=said):
        FrequencyResponse(**(parts | change))


def test_between_lines_a_cubic_and_beyond_them_what_is_stated():
    truth = single(damping=0.05)
    frf = with_static(measured(truth, step=0.25, highest=200.0), {"xx": 1.0 / 2e6})
    curve = response_curve(frf)
    between = np.arange(4.1, 199.0, 0.37)
    np.testing.assert_allclose(
        curve.at(between)[:, 0, 0], truth.response(between)[:, 0, 0], rtol=2e-3
    )
    low = np.array([0.0, 1.0, 2.0, 3.9])
    found = curve.at(low)[:, 0, 0]
    np.testing.assert_allclose(found, truth.response(low)[:, 0, 0], rtol=2e-3)
    assert found[0] == pytest.approx(5e-7, rel=1e-12)
    assert not curve.at(np.array([200.5, 400.0])).any()


def test_lines_left_out_tell_a_coarse_grid_from_a_fine_one():
    truth = single(frequency=8.7, damping=0.035)
    fine = held_out_error(measured(truth, step=0.05, highest=100.0))
    coarse = held_out_error(measured(truth, step=0.5, highest=100.0))
    assert fine < 1e-3 < 0.05 < coarse


def test_modes_take_over_where_they_know_better():
    truth = robot_with_tool()
    frf = measured(truth)
    assert response_curve(frf, truth).modes is truth
    other = single(frequency=500.0)
    assert response_curve(measured(single()), other).modes is None


def test_static_load_test_fills_only_its_pairs():
    frf = with_static(measured(robot_with_tool()), {"xx": 8e-7, "yx": -1e-7})
    assert frf.static[0, 0] == 8e-7
    assert frf.static[1, 0] == -1e-7
    assert np.isnan(frf.static[2, 2])
    assert np.isfinite(response_curve(frf).at_rest).all()
    with pytest.raises(ImplausibleDataError, match="yields the way it is pushed"):
        with_static(measured(robot_with_tool()), {"xx": -8e-7})


def test_trusted_lines_are_those_of_the_band():
    frf = trusted_lines(measured(single(), lowest=4.0))
    assert frf.frequency[0] == 4.0


def test_modes_rebuild_from_their_archive():
    truth = robot_with_tool()
    again = modal_model_from_archive(truth.to_archive())
    f = np.array([0.0, 7.0, 333.0])
    np.testing.assert_array_equal(again.response(f), truth.response(f))
    assert again.source == truth.source
