"""Prediction against the equation of motion, and what the printed form gets wrong."""

from dataclasses import replace

import numpy as np
import pytest
from frf_cases import measured, modal, robot_with_tool, single
from scipy.linalg import expm

from robotrue.core.units import UM
from robotrue.dynamics.cutter import CutterEngagement, CuttingCoefficients, EndMill
from robotrue.dynamics.force import ForceRecord
from robotrue.dynamics.frf import with_static
from robotrue.dynamics.interpolation import response_curve
from robotrue.dynamics.milling_force import force_over_time
from robotrue.dynamics.modal_fit import fit_modes
from robotrue.dynamics.oscillators import oscillators_of
from robotrue.dynamics.predict import out_of_band, predict_error, prediction_columns
from robotrue.dynamics.streaming import ModalFilter
from robotrue.errors import ConfigurationError, ModelMismatchError

RATE = 2000.0


def record(force, rate=RATE):
    return ForceRecord(start=0.0, rate=rate, force=force, source="record")


def known(truth, **grid):
    """A curve that knows the truth exactly between its lines."""
    return response_curve(measured(truth, static=True, **grid), truth)


def along_x(values):
    return np.column_stack([values, np.zeros_like(values), np.zeros_like(values)])


def smooth_burst(n, rate=RATE):
    """A force that begins and ends at zero, far below half the rate."""
    t = np.arange(n) / rate
    envelope = np.where(t < 1.0, np.sin(np.pi * t) ** 2, 0.0)
    return 80.0 * envelope * (1.0 + 0.5 * np.sin(2.0 * np.pi * 60.0 * t))


def late_push(n):
    """80 N for some time, gone in 5 ms, soon before the record ends."""
    edge = 0.5 - 0.5 * np.cos(np.pi * np.arange(10) / 10)
    force = np.zeros(n)
    force[n - 1000 : n - 100] = 80.0
    force[n - 1000 : n - 990], force[n - 110 : n - 100] = 80.0 * edge, 80.0 * edge[::-1]
    return force


def test_equation_of_motion_of_one_mode():
    """The matrix exponential with linear force between finer samples is the reference."""
    stiffness, hz, zeta = 2e6, 30.0, 0.03
    fine, n = 8, 6000
    t = np.arange(n * fine) / (RATE * fine)
    force = np.interp(t, np.arange(n) / RATE, smooth_burst(n))
    omega = 2.0 * np.pi * hz
    system = np.zeros((4, 4))
    system[0, 1] = system[2, 3] = 1.0
    system[1, :3] = -(omega**2), -2.0 * zeta * omega, omega**2 / stiffness
    step = expm(system / (RATE * fine))
    state, want = np.zeros(4), np.zeros(n * fine)
    slope = np.append(np.diff(force), 0.0) * RATE * fine
    for k in range(n * fine):
        want[k] = state[0]
        state[2:] = force[k], slope[k]
        state = step @ state
    found = predict_error(known(single(hz, zeta, stiffness)), record(along_x(smooth_burst(n))))
    assert np.abs(want).max() > 30 * UM
    np.testing.assert_allclose(found.error[:, 0], want[::fine], atol=0.02 * UM)
    assert np.isnan(found.error[:, 1:]).all()


def test_circular_error_is_that_of_the_record_s_end():
    """A burst at the end of a record rings on at its beginning, unless zeros follow it."""
    found = predict_error(known(single(8.7, 0.035)), record(along_x(late_push(4000))))
    before = slice(0, 2900)
    assert np.abs(found.error[before, 0]).max() < 0.03 * UM
    assert np.abs(found.circular[before, 0]).max() > 10.0 * UM
    assert found.circular_error[1] > 10.0 * UM


def test_entry_costs_tens_of_micrometres_in_a_whole_record():
    """The order of note and paper: some 3 um rms and 20 um at most, in the first part of 5 s."""
    truth = robot_with_tool()
    cutter = EndMill(kind="flat", diameter=0.016, teeth=2, helix=np.deg2rad(30.0), runout=8e-6)
    material = CuttingCoefficients(
        tangential=1.07e9, radial=2.3e8, axial=3.0e8,
        tangential_edge=3.7e4, radial_edge=4.2e4, axial_edge=1.9e3,
    )  # fmt: skip
    cut = CutterEngagement(mode="up", depth=1e-3, width=6e-3, feed_per_tooth=4.17e-5, spindle=60.0)
    force = force_over_time(cutter, cut, material, rate=20e3, duration=5.0)
    found = predict_error(known(truth), force)
    difference = np.linalg.norm(found.circular - found.error, axis=1)
    head = difference[: round(0.2 * 20e3)]
    assert 1.0 * UM < np.sqrt((head**2).mean()) < 20.0 * UM
    assert 5.0 * UM < head.max() < 60.0 * UM
    assert difference[round(3.5 * 20e3) :].max() < 0.05 * UM
    assert any("begins in the cut" in remark for remark in found.remarks)


def test_padding_cures_it():
    """With zeros for longer than the tool rings, more zeros change nothing."""
    curve = known(single(8.7, 0.035))
    late = record(along_x(late_push(4000)))
    whole = predict_error(curve, late, padding=20.0).error[:, 0]
    usual = predict_error(curve, late).error[:, 0]
    none = predict_error(curve, late, padding=0.0).error[:, 0]
    assert np.abs(usual - whole).max() < 1e-4 * UM
    assert np.abs(none - whole).max() > 10.0 * UM


def test_constant_force_bends_by_the_static_deflection():
    n = 20000
    force = along_x(np.where(np.arange(n) < 200, 0.0, 100.0))
    found = predict_error(known(single(30.0, 0.1, 2e6)), record(force))
    assert found.error[n // 2, 0] == pytest.approx(100.0 / 2e6, rel=2e-3)
    assert found.static[0] == pytest.approx(99.0 / 2e6, rel=1e-9)


def test_parseval():
    """Mean square of the error is that of its spectrum."""
    rng = np.random.default_rng(0)
    force = rng.normal(size=(5001, 3)) * 20.0
    curve = known(robot_with_tool(), highest=1500.0)
    found = predict_error(curve, record(force), padding=0.0)
    spectrum = np.fft.rfft(force, axis=0)
    response = curve.at(np.fft.rfftfreq(5001, 1.0 / RATE))
    power = np.abs(np.einsum("fre,fe->fr", response, spectrum)) ** 2
    power[1:] *= 2.0
    np.testing.assert_allclose((found.circular**2).mean(axis=0), power.sum(axis=0) / 5001**2)


def test_measured_lines_predict_like_the_truth():
    """One hertz is too coarse for 8.7 Hz and 3.5 %; modes fitted to the lines say it all."""
    truth = single(8.7, 0.035)
    n = 8000
    force = record(along_x(np.roll(late_push(n), 2000)))
    want = predict_error(known(truth), force).error[:, 0]
    frf = with_static(measured(truth, step=1.0, highest=1000.0, lowest=2.0), {"xx": 5e-7})
    lines = predict_error(response_curve(frf), force)
    modes = predict_error(response_curve(frf, fit_modes(frf)), force)
    assert np.abs(modes.error[:, 0] - want).max() < 0.05 * UM
    assert np.abs(lines.error[:, 0] - want).max() > 0.5 * UM
    assert any("lines are coarse" in remark for remark in lines.remarks)
    assert not any("lines are coarse" in remark for remark in modes.remarks)


def test_whole_record_and_stream_agree():
    """Fitted modes, once by the whole spectrum and once by ramps from sample to sample."""
    rng = np.random.default_rng(4)
    shapes = rng.normal(size=(4, 3)) * np.array([[0.04], [0.04], [1.0], [2.0]])
    truth = modal([9.0, 31.0, 520.0, 900.0], [0.035, 0.03, 0.05, 0.04], shapes)
    frf = with_static(
        measured(truth, step=1.0, highest=1500.0), {"xx": float(truth.modal_static[0, 0])}
    )
    modes = fit_modes(frf)
    t = np.arange(40000) / 20e3
    waves = np.sin(2 * np.pi * np.outer(t, [60.0, 120.0, 480.0]) + rng.uniform(0, 6, 3))
    force = ForceRecord(
        start=0.0, rate=20e3, force=np.sin(np.pi * t / 2.0)[:, None] ** 2 * waves * 60.0, source=""
    )
    whole = predict_error(response_curve(frf, modes), force).error
    stream = ModalFilter(oscillators_of(modes), 20e3).push(force.force)
    assert np.abs(whole).max() > 5.0 * UM
    # Ramps between samples flatten 480 Hz by (omega T)^2 / 12 = 0.2 %.
    np.testing.assert_allclose(stream, whole, atol=2.5e-3 * np.abs(whole).max())


def test_what_is_not_known_is_said():
    truth = robot_with_tool()
    frf = measured(truth, highest=400.0)
    only_x = replace(
        frf, response=frf.response[:, :, :1], excitation_axes=("x",), present=frf.present[:, :1]
    )
    rng = np.random.default_rng(1)
    force = record(rng.normal(size=(4000, 3)))
    said = " ".join(predict_error(response_curve(only_x), force).remarks)
    assert "fy of up to" in said
    assert "never excited along y" in said
    assert "above 400 Hz" in said
    assert "static deflection is a guess" in said
    assert out_of_band(response_curve(only_x), force) == pytest.approx(0.6, abs=0.03)


def test_table_has_blank_where_nothing_is_known():
    found = predict_error(known(single()), record(along_x(smooth_burst(100))))
    names, values = prediction_columns(found)
    assert names == ["t_s", "ex_um", "ey_um", "ez_um"]
    assert np.isnan(values[:, 2:]).all()
    np.testing.assert_allclose(values[:, 1], found.error[:, 0] / UM)


def test_refused():
    curve = known(single())
    force = along_x(smooth_burst(100))
    with pytest.raises(ModelMismatchError, match="no force along x"):
        predict_error(curve, record(force[:, ::-1]))
    with pytest.raises(ConfigurationError, match="padding of -1 s"):
        predict_error(curve, record(force), padding=-1.0)
    with pytest.raises(ModelMismatchError, match="reach to 4 Hz"):
        predict_error(response_curve(measured(single(), lowest=5.0)), record(force, rate=8.0))


def test_a_push_of_centimetres_is_not_valid():
    """Force or response in another unit, that no other check has seen."""
    curve = known(single())
    force = along_x(smooth_burst(1000))
    assert not predict_error(curve, record(force)).invalid
    far = predict_error(curve, record(400.0 * force)).invalid
    assert len(far) == 1
    assert "N would push the tool by" in far[0]
    assert "mm, expected at most 10 mm" in far[0]


def test_modes_that_miss_the_lines_are_said_to():
    truth = robot_with_tool()
    poor = replace(truth, residues=1.1 * truth.residues)
    curve = response_curve(measured(truth, step=4.0), poor)
    found = predict_error(curve, record(along_x(smooth_burst(1000))))
    assert any("the modes miss the lines by 10 %" in remark for remark in found.remarks)


def test_a_sensor_that_stops_is_not_valid_and_a_step_is_no_sensor_that_stops():
    curve, force = known(single()), along_x(smooth_burst(2000))
    noisy = force + np.random.default_rng(0).normal(size=force.shape) * 0.4
    assert not predict_error(curve, record(noisy)).invalid
    noisy[1200:, 0] = noisy[1199, 0]
    (said,) = predict_error(curve, record(noisy)).invalid
    assert "for 0.4 s from 0.5995 s on: a sensor that has stopped" in said
    ramp = along_x(np.minimum(np.arange(2000) * 0.05, 40.0))
    assert not predict_error(curve, record(ramp)).invalid


def test_a_record_too_slow_for_the_tool_is_refused():
    """Milliseconds taken for seconds, among others."""
    with pytest.raises(ModelMismatchError, match="the tool moves most at 30 Hz") as caught:
        predict_error(known(single(30.0)), record(along_x(smooth_burst(2000)), rate=20.0))
    assert "ms are not s" in str(caught.value.hint)
