"""What no structure can do is refused, and by its name."""

from dataclasses import replace

import numpy as np
import pytest
from frf_cases import measured, robot_with_tool, single

from robotrue.dynamics.frf import in_form
from robotrue.dynamics.frf_checks import (
    check_response,
    coherent_band,
    diverges_below,
    reciprocity,
    response_remarks,
)
from robotrue.errors import ImplausibleDataError


def spoiled(change, **grid):
    frf = measured(robot_with_tool(), noise=0.02, **grid)
    return replace(frf, response=change(np.array(frf.response), frf.frequency))


def flipped(response, _f):
    response[:, 1, :] *= -1.0
    return response


def swapped(response, _f):
    return response[:, [1, 0, 2], :]


def one_cross_flipped(response, _f):
    response[:, 0, 1] *= -1.0
    return response


@pytest.mark.parametrize("seed", range(5))
def test_sound_responses_pass(seed):
    check_response(measured(robot_with_tool(seed), noise=0.05, seed=seed))
    check_response(measured(single(damping=0.01), noise=0.05, seed=seed))
    check_response(measured(single(frequency=700.0), noise=0.05, seed=seed))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda g, f: in_form(g, f, "receptance", "accelerance"), "an accelerance"),
        (lambda g, f: in_form(g, f, "receptance", "mobility"), "a mobility"),
        (lambda g, f: g.conj(), "the conjugate"),
        (flipped, "The y axis of sensor or hammer is flipped"),
        (swapped, "energy would come out between x and y"),
        (lambda g, f: 1e6 * g, r"expected at most 0.0005 m/N"),
        (one_cross_flipped, "Gxy is the negative of Gyx"),
        (lambda g, f: 0.0 * g, "zero throughout"),
    ],
)
def test_what_cannot_be_is_named(change, said):
    with pytest.raises(ImplausibleDataError, match=said) as caught:
        check_response(spoiled(change))
    assert caught.value.hint


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("truth", [robot_with_tool, lambda seed: single(120.0 + 50 * seed, 0.02)])
def test_an_accelerance_is_never_taken_for_a_receptance(truth, seed):
    frf = measured(truth(seed), noise=0.05, seed=seed)
    spoilt = in_form(frf.response, frf.frequency, "receptance", "accelerance")
    with pytest.raises(ImplausibleDataError, match="accelerance"):
        check_response(replace(frf, response=spoilt))


@pytest.mark.parametrize("noise", [0.02, 0.3])
@pytest.mark.parametrize("damping", [0.002, 0.05])
@pytest.mark.parametrize("hertz", [8.0, 30.0, 400.0, 1500.0])
@pytest.mark.parametrize("grid", [(4.0, 3000.0, 0.5), (4.0, 200.0, 0.25), (20.0, 1000.0, 2.0)])
def test_noise_and_little_damping_are_no_reason_to_refuse(noise, damping, hertz, grid):
    """Where the sign of Im is lost in noise nothing is concluded from it."""
    low, high, step = grid
    frf = measured(single(hertz, damping), noise=noise, lowest=low, highest=high, step=step)
    check_response(frf)
    if low < hertz < high and noise < 0.1:
        for form in ("mobility", "accelerance"):
            spoilt = in_form(frf.response, frf.frequency, "receptance", form)
            with pytest.raises(ImplausibleDataError):
                check_response(replace(frf, response=spoilt))


def test_a_static_line_that_does_not_continue():
    frf = measured(single(), static=True)
    with pytest.raises(ImplausibleDataError, match="no static deflection"):
        check_response(replace(frf, static=np.zeros((1, 1))))


def test_reciprocity_is_measured():
    frf = measured(robot_with_tool())
    assert max(reciprocity(frf).values()) < 1e-12
    response = np.array(frf.response)
    response[:, 0, 1] *= 1.3
    assert reciprocity(replace(frf, response=response))["xy"] == pytest.approx(0.26, abs=0.01)
    said = " ".join(response_remarks(replace(frf, response=response)))
    assert "Gxy and Gyx differ by 26 %" in said
    assert "no data below 4 Hz" in said


def test_pairs_nobody_measured_are_named():
    frf = measured(robot_with_tool())
    present = np.eye(3, dtype=bool)
    response = np.where(present, frf.response, 0.0)
    said = " ".join(response_remarks(replace(frf, present=present, response=response)))
    assert "xy, xz, yx, yz, zx, zy" in said


def test_band_of_coherence_ignores_antiresonances():
    f = np.arange(0.0, 200.0, 0.5)
    coherence = np.where((f > 5.0) & (f < 150.0), 0.97, 0.3)
    coherence[(f > 60.0) & (f < 61.0)] = 0.1
    low, high = coherent_band(f, coherence)
    assert low == pytest.approx(5.0, abs=1.0)
    assert high == pytest.approx(150.0, abs=1.0)
    with pytest.raises(ImplausibleDataError, match=r"no band with a coherence of 0\.8"):
        coherent_band(f, np.full_like(f, 0.5))


def test_integrated_noise_of_an_accelerometer_diverges():
    f = np.arange(0.5, 50.0, 0.5)
    assert diverges_below(f, (5e-7 + 1e-5 / f**2).astype(complex))
    assert not diverges_below(f, np.full(len(f), 5e-7 + 0j))
    assert not diverges_below(f, single(2.0, 0.05).response(f)[:, 0, 0])


@pytest.mark.parametrize("step", [0.1, 0.5, 2.0])
def test_modes_of_the_arm_above_a_static_line_are_no_reason_to_refuse(step):
    """Two per cent of the lines may reach above all modes of the arm; those say nothing of rest."""
    for seed in range(5):
        check_response(measured(robot_with_tool(seed), static=True, step=step, highest=4000.0))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda g, f: in_form(g, f, "receptance", "accelerance"), "an accelerance"),
        (lambda g, f: in_form(g, f, "receptance", "mobility"), "a mobility"),
        (lambda g, f: 1e6 * g, r"expected at most 0\.0005 m/N"),
    ],
)
def test_cross_pairs_alone_are_told_by_size_and_phase(change, said):
    frf = measured(robot_with_tool(), noise=0.02)
    present = np.zeros((3, 3), dtype=bool)
    present[1, 0] = present[2, 0] = True
    check_response(replace(frf, present=present))
    spoilt = replace(frf, present=present, response=change(frf.response, frf.frequency))
    with pytest.raises(ImplausibleDataError, match=said):
        check_response(spoilt)
