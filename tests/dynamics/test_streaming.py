"""The filters against the exact response, and packets against one batch."""

import numpy as np
import pytest
from scipy.linalg import expm

from robotrue.dynamics.oscillators import Oscillators, join_oscillators, real_modes
from robotrue.dynamics.streaming import ModalFilter
from robotrue.errors import ModelMismatchError, ShapeError

RATE = 20e3


def some_modes(seed=1, count=13):
    rng = np.random.default_rng(seed)
    frequency = np.sort(np.exp(rng.uniform(np.log(8.0), np.log(2300.0), count)))
    shape = rng.normal(size=(count, 3)) * 0.1
    return real_modes(frequency, rng.uniform(0.02, 0.05, count), shape)


def test_response_of_one_mode_is_the_textbook_one():
    one = real_modes(np.array([30.0]), np.array([0.03]), np.array([[0.2, 0.0, 0.1]]))
    f = np.array([0.0, 10.0, 30.0, 120.0])
    omega, omega_0 = 2 * np.pi * f, 2 * np.pi * 30.0
    want = 1.0 / (omega_0**2 - omega**2 + 2j * 0.03 * omega_0 * omega)
    np.testing.assert_allclose(one.response(f)[:, 0, 2], 0.02 * want, rtol=1e-12)
    np.testing.assert_allclose(one.static, one.response(f)[0].real, rtol=1e-12)


def test_ramp_is_followed_exactly():
    """The matrix exponential of mode and ramp together is the independent reference."""
    omega, zeta, shape = 2 * np.pi * 40.0, 0.03, np.array([0.3, -0.1, 0.2])
    one = real_modes(np.array([40.0]), np.array([zeta]), shape[None])
    slope = np.array([2.0, 3.0, -1.0])  # N per sample, from zero at sample -1
    n = np.arange(200)
    x = ModalFilter(one, RATE).push((n[:, None] + 1.0) * slope)
    system = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-(omega**2), -2 * zeta * omega, shape @ slope * RATE, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, 0.0, 0.0],
        ]
    )
    want = [(expm(system * (i + 1) / RATE) @ [0.0, 0.0, 0.0, 1.0])[0] * shape for i in n]
    np.testing.assert_allclose(x, want, rtol=1e-9, atol=1e-9 * np.abs(want).max())


def test_packets_equal_one_batch():
    rng = np.random.default_rng(3)
    force = rng.normal(size=(5000, 3)) * 40.0
    modes = some_modes()
    whole = ModalFilter(modes, RATE).push(force)
    stream, parts, start = ModalFilter(modes, RATE), [], 0
    while start < len(force):
        stop = start + int(rng.integers(1, 300))
        parts.append(stream.push(force[start:stop]))
        start = stop
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    single = ModalFilter(modes, RATE)
    one = np.concatenate([single.push(force[i : i + 1]) for i in range(500)])
    np.testing.assert_array_equal(one, whole[:500])


def test_state_goes_on_where_it_was_left():
    force = np.random.default_rng(4).normal(size=(400, 3))
    modes = some_modes(2)
    whole = ModalFilter(modes, RATE).push(force)
    first, second = ModalFilter(modes, RATE), ModalFilter(modes, RATE)
    first.push(force[:150])
    second.resume(first.snapshot())
    np.testing.assert_array_equal(second.push(force[150:]), whole[150:])


def test_standing_force_stays_where_it_is():
    modes = some_modes(5)
    force = np.array([10.0, -30.0, 5.0])
    stream = ModalFilter(modes, RATE)
    stream.settle(force)
    x = stream.push(np.tile(force, (1000, 1)))
    np.testing.assert_allclose(x, np.tile(modes.static @ force, (1000, 1)), rtol=1e-7)


def test_complex_shapes_and_residual():
    rng = np.random.default_rng(6)
    residue = rng.normal(size=(2, 2, 3)) + 1j * rng.normal(size=(2, 2, 3))
    modes = Oscillators(
        poles=np.array([-5.0 + 200j, -20.0 + 900j]),
        excite=residue[0],
        respond=residue[1] * 1e-5,
        residual=rng.normal(size=(3, 3)) * 1e-8,
    )
    t = np.arange(40000) / RATE
    tone = np.cos(2 * np.pi * 80.0 * t)[:, None] * np.array([1.0, 2.0, -1.0])
    x = ModalFilter(modes, RATE).push(tone)[-2000:]
    want = modes.response(np.array([80.0]))[0] @ np.array([1.0, 2.0, -1.0])
    wave = (np.exp(2j * np.pi * 80.0 * t[-2000:])[:, None] * want).real
    # a tone seen as straight lines between samples is smaller by (sin x / x)^2, x = pi f T
    np.testing.assert_allclose(x, wave, atol=2e-4 * np.abs(want).max())


def test_modes_that_move_keep_the_tool_in_place():
    force = np.tile([[0.0, 50.0, 0.0]], (4000, 1))
    before = real_modes(np.array([12.0]), np.array([0.03]), np.array([[0.0, 0.1, 0.02]]))
    after = real_modes(np.array([12.4]), np.array([0.03]), np.array([[0.0, 0.09, 0.018]]))
    stream = ModalFilter(before, RATE)
    x = stream.push(force)
    stream.change(after)
    y = stream.push(force[:10])
    step = np.abs(np.diff(x[-10:], axis=0)).max()
    assert np.abs(y[0] - x[-1]).max() < 1.2 * step
    assert np.abs(np.diff(y, axis=0)).max() < 1.2 * step


def test_unchanged_modes_change_nothing():
    force = np.random.default_rng(7).normal(size=(300, 3))
    modes = some_modes(8)
    stream = ModalFilter(modes, RATE)
    first = stream.push(force[:100])
    stream.change(modes)
    both = np.concatenate([first, stream.push(force[100:])])
    whole = ModalFilter(modes, RATE).push(force)
    np.testing.assert_allclose(both, whole, atol=1e-10 * np.abs(whole).max())


def test_parts_in_series_add_up():
    force = np.random.default_rng(9).normal(size=(200, 3))
    a, b = some_modes(10, 6), some_modes(11, 7)
    both = ModalFilter(join_oscillators([a, b]), RATE).push(force)
    np.testing.assert_allclose(
        both,
        ModalFilter(a, RATE).push(force) + ModalFilter(b, RATE).push(force),
        rtol=1e-9,
        atol=1e-20,
    )


def test_force_that_is_not_finite_is_refused_and_the_state_kept():
    modes = some_modes()
    force = np.ones((10, 3))
    stream, clean = ModalFilter(modes, RATE), ModalFilter(modes, RATE)
    stream.push(force)
    clean.push(force)
    broken = force.copy()
    broken[4, 1] = np.nan
    with pytest.raises(ShapeError, match="force sample 4"):
        stream.push(broken)
    np.testing.assert_array_equal(stream.push(force), clean.push(force))


def test_what_cannot_be_filtered_is_refused():
    modes = some_modes()
    with pytest.raises(ShapeError, match="below 1000 Hz"):
        ModalFilter(modes, 2000.0)
    with pytest.raises(ShapeError, match="shape"):
        ModalFilter(modes, RATE).push(np.zeros((4, 2)))
    with pytest.raises(ModelMismatchError, match="6 modes after 13"):
        ModalFilter(modes, RATE).change(some_modes(1, 6))
    with pytest.raises(ShapeError, match="damping"):
        real_modes(np.array([5.0]), np.array([1.2]), np.ones((1, 3)))
