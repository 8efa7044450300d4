"""Clocks found again on simulated truths: delays, drift, jumps, restarts, however they are cut."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.errors import ShapeError
from robotrue.online.clocks import StreamClock

LEAST = 2e-4


def stream(
    seed: int, *, rate: float = 1000.0, seconds: float = 60.0, drift: float = 40e-6
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Controller times, true host times of the samples, and when their packets came."""
    rng = np.random.default_rng(seed)
    controller = 5000.0 + np.arange(int(rate * seconds)) / rate
    true = -4000.0 + controller * (1.0 + drift)
    delay = LEAST + rng.exponential(2e-4, len(true))
    delay += (rng.random(len(true)) < 0.01) * rng.exponential(5e-3, len(true))
    return controller, true, np.maximum.accumulate(true + delay)


def test_times_are_better_than_arrivals_by_two_orders() -> None:
    errors, drifts, ratios = [], [], []
    for seed in range(8):
        drift = (seed - 4) * 20e-6
        controller, true, host = stream(seed, drift=drift)
        clock = StreamClock()
        time, doubt = clock.align(controller, host)
        assert doubt.mean() < 1e-3
        errors.append((time - true - LEAST)[10_000:])
        fix = clock.fix()
        drifts.append(fix.drift - drift)
        ratios.append(errors[-1][-1] / fix.offset_sd)
        arrival = np.sqrt(np.mean((host - true - LEAST) ** 2))
        assert arrival > 5e-4
    assert np.sqrt(np.mean(np.square(errors))) < 4e-6
    assert np.abs(errors).max() < 15e-6
    assert np.sqrt(np.mean(np.square(drifts))) < 0.1e-6
    assert np.sqrt(np.mean(np.square(ratios))) < 2.0


def test_cuts_change_nothing_and_a_state_goes_on() -> None:
    controller, _, host = stream(1, seconds=20.0)
    whole = StreamClock()
    wanted, doubted = whole.align(controller, host)
    rng = np.random.default_rng(2)
    cuts = np.sort(rng.integers(0, len(host), 300))
    clock, parts, doubts = StreamClock(), [], []
    for k, (c, h) in enumerate(zip(np.split(controller, cuts), np.split(host, cuts), strict=True)):
        if k % 7 == 0:
            state, clock = clock.state(), StreamClock()
            clock.restore(state)
        time, doubt = clock.align(c, h)
        parts.append(time)
        doubts.append(doubt)
    np.testing.assert_array_equal(np.concatenate(parts), wanted)
    np.testing.assert_array_equal(np.concatenate(doubts), doubted)
    assert clock.fix() == whole.fix()


def test_a_record_without_host_times_stays_as_it_is() -> None:
    time = np.arange(5000) * 1e-3
    found, doubt = StreamClock().align(time, time)
    np.testing.assert_array_equal(found, time)
    assert not doubt.any()


@pytest.mark.parametrize("step", [0.02, 0.5, 3.0, 4000.0])
def test_a_clock_that_is_put_forward_is_seen_at_once(step: float) -> None:
    controller, true, host = stream(3, seconds=30.0)
    controller[15_000:] += step
    clock = StreamClock()
    time, doubt = clock.align(controller, host)
    assert doubt[15_000]
    assert clock.fix().jumps == 1
    late = slice(27_000, None)
    assert np.abs(time[late] - true[late] - LEAST).max() < 2e-5
    assert not doubt[27_000:].any()


@pytest.mark.parametrize("step", [0.02, 0.5, 3.0, 4990.0])
def test_a_clock_that_is_put_back_is_doubted_within_some_packets(step: float) -> None:
    controller, true, host = stream(4, seconds=30.0)
    controller[15_000:] -= step
    clock = StreamClock()
    time, doubt = clock.align(controller, host)
    wrong = np.abs(time - true) > 6e-3
    wrong[:15_000] = False
    assert doubt[15_000:15_030].any()
    # beside the few packets in which it could have been a stall, no wrong time goes undoubted
    assert (wrong & ~doubt).sum() <= 25
    assert clock.fix().jumps == 1
    assert np.abs(time[27_000:] - true[27_000:] - LEAST).max() < 3e-5
    assert not doubt[27_000:].any()


def test_a_stall_of_the_host_is_no_jump() -> None:
    controller, true, host = stream(5, seconds=20.0)
    stalled = slice(10_000, 10_020)
    host[stalled] = host[10_020]
    clock = StreamClock()
    time, _ = clock.align(controller, host)
    assert clock.fix().jumps == 0
    assert np.abs(time - true - LEAST)[10_000:].max() < 2e-5


def test_times_never_fall_and_what_has_none_keeps_its_arrival() -> None:
    controller, _, host = stream(6, seconds=5.0)
    controller[100:200] = np.nan
    host[150] = np.nan
    time, doubt = StreamClock().align(controller, host)
    assert (np.diff(time) >= 0.0).all()
    np.testing.assert_array_equal(time[100:150], np.maximum.accumulate(host[100:150]))
    assert doubt[150]
    with pytest.raises(ShapeError, match="controller times for"):
        StreamClock().align(controller[:3], host[:2])
    state = StreamClock().state()
    with pytest.raises(ShapeError, match="clock state bins"):
        StreamClock().restore({**state, "bins": np.zeros(3)})


@pytest.mark.parametrize("first", [0.001, 0.004, 0.1, 3.3, 4_208_163.634])
def test_a_second_that_ends_on_a_sample_ends(first: float) -> None:
    """0.001 + 1 is 1.001, but 1.001 - 0.001 is less than 1."""
    controller = first + np.arange(5000) / 1e3
    controller[1000::1000] = first + np.arange(1.0, 5.0)
    clock = StreamClock()
    clock.align(controller, controller + 7.0)
    assert clock.fix().seconds == 4


def test_seconds_that_end_on_a_sample_end_whatever_the_rounding() -> None:
    """Counts of milliseconds from an odd start: differences that are a rounding off whole."""
    for start in (4208163634, 1, 77_777_777, 123_456_789_012):
        controller = (start + 4 * np.arange(3000)) * 1e-3
        time, doubt = StreamClock().align(controller, controller + 0.1)
        np.testing.assert_allclose(time, controller + 0.1, rtol=0.0, atol=1e-6)
        assert not doubt.any()
