"""The guard of corrections, against a controller that adds up or does not."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ModelMismatchError, ShapeError
from robotrue.online.guard import CorrectionGuard, CorrectionLimits
from robotrue.online.robot_correction import Correction, CorrectionMode

ABSOLUTE, RELATIVE = CorrectionMode.ABSOLUTE, CorrectionMode.RELATIVE
CYCLE = 4e-3
LIMITS = CorrectionLimits(
    shift=0.5 * MM,
    shift_rate=5.0 * MM,
    cycle=CYCLE,
    turn=0.2 * DEG,
    turn_rate=1.0 * DEG,
    timeout=0.05,
    ramp=0.1,
    latch=False,
)
STEP = LIMITS.shift_rate * CYCLE
TURN_STEP = LIMITS.turn_rate * CYCLE
SLACK = 1e-15


def _wanted(shift, turn=(0.0, 0.0, 0.0)):
    return Correction(shift=np.array(shift), turn=np.array(turn), mode=ABSOLUTE)


class Controller:
    """What the robot holds after each answer it takes."""

    def __init__(self, mode):
        self.mode = mode
        self.shift = np.zeros(3)
        self.turn = np.zeros(3)

    def take(self, correction):
        assert correction.mode is self.mode
        before = self.shift, self.turn
        keep = 1.0 if self.mode is RELATIVE else 0.0
        self.shift = keep * self.shift + correction.shift
        self.turn = keep * self.turn + correction.turn
        return np.linalg.norm(self.shift - before[0]), np.linalg.norm(self.turn - before[1])


def _run(guard, controller, start, cycles, wanted=None):
    """So many cycles with a fresh estimate in each; returns the time after them."""
    for k in range(cycles):
        now = start + k * CYCLE
        if wanted is not None:
            guard.want(wanted, now)
        controller.take(guard.next(now))
    return start + cycles * CYCLE


numbers = st.floats(allow_nan=False, allow_infinity=False) | st.floats(-2e-3, 2e-3)
vectors = st.tuples(numbers, numbers, numbers)
events = st.one_of(
    st.tuples(st.just("want"), vectors, vectors, st.floats(-0.01, 0.2)),
    st.tuples(st.just("cycle"), st.floats(0.0, 0.2) | st.just(CYCLE)),
    st.tuples(st.just("lost"), st.just(CYCLE)),
    st.tuples(st.just("doubt")),
    st.tuples(st.just("fault")),
    st.tuples(st.just("rearm")),
    st.tuples(st.just("back"), st.floats(0.0, 1.0)),
)


@pytest.mark.parametrize("mode", [ABSOLUTE, RELATIVE])
@given(script=st.lists(events, max_size=60))
@settings(max_examples=80, deadline=None)
def test_whatever_comes_the_robot_stays_within_limit_and_rate(mode, script):
    guard, controller, now, told = CorrectionGuard(LIMITS, mode), Controller(mode), 10.0, True

    def cycle(lost=False):
        nonlocal told
        guard.book(taken=told)
        if not told:
            guard.count_late(1, now)
        answer = guard.next(now)
        moved = turned = 0.0
        if answer is not None and not lost:
            moved, turned = controller.take(answer)
        told = not lost
        assert moved <= STEP + SLACK
        assert turned <= TURN_STEP + SLACK
        assert np.linalg.norm(controller.shift) <= LIMITS.shift + SLACK
        assert np.linalg.norm(controller.turn) <= LIMITS.turn + SLACK

    latest = now
    for name, *values in script:
        latest = max(latest, now)
        if name == "want":
            guard.want(_wanted(values[0], values[1]), now - values[2])
        elif name in ("cycle", "lost"):
            now += values[0]
            cycle(lost=name == "lost")
        elif name == "doubt":
            guard.fault("invalid")
        elif name == "fault":
            guard.fault("NaN")
        elif name == "rearm":
            guard.rearm()
        else:
            now -= values[0]
    # silence: no estimate comes, nor is there one that was ahead of a clock that went back
    now = max(now, latest) + 1.0
    most = math.ceil((LIMITS.shift + STEP) / STEP + LIMITS.turn / TURN_STEP) + 2
    for _ in range(most + math.ceil(LIMITS.timeout / CYCLE)):
        now += CYCLE
        cycle()
    assert guard.at_rest
    np.testing.assert_allclose(controller.shift, 0.0, atol=1e-14)
    np.testing.assert_allclose(controller.turn, 0.0, atol=1e-14)


@pytest.mark.parametrize("mode", [ABSOLUTE, RELATIVE])
@given(script=st.lists(st.tuples(vectors, st.floats(0.0, 0.03)), min_size=1, max_size=60))
@settings(max_examples=60, deadline=None)
def test_without_losses_limit_and_rate_hold_exactly(mode, script):
    guard, controller, now = CorrectionGuard(LIMITS, mode), Controller(mode), 0.0
    for shift, later in script:
        guard.want(_wanted(shift), now)
        now += later
        moved, _ = controller.take(guard.next(now))
        assert moved <= LIMITS.shift_rate * min(later, CYCLE) + SLACK or now == later
        assert moved <= STEP + SLACK
        assert np.linalg.norm(controller.shift) <= LIMITS.shift + SLACK
        np.testing.assert_allclose(controller.shift, guard.state().held.shift, atol=1e-15)


@pytest.mark.parametrize("mode", [ABSOLUTE, RELATIVE])
def test_it_reaches_what_is_wanted_by_a_ramp(mode):
    guard, controller = CorrectionGuard(LIMITS, mode), Controller(mode)
    wanted = _wanted((0.1 * MM, -0.2 * MM, 0.0), (0.0, 0.0, 0.1 * DEG))
    now = _run(guard, controller, 0.0, 13, wanted)
    half = np.linalg.norm(controller.shift)
    assert 0.0 < half < 0.55 * np.linalg.norm(wanted.shift)
    _run(guard, controller, now, 60, wanted)
    np.testing.assert_allclose(controller.shift, wanted.shift, atol=2e-9)
    np.testing.assert_allclose(controller.turn, wanted.turn, atol=2e-6 * DEG)
    assert guard.active
    assert guard.age(now) == 0.0


def test_too_much_is_cut_along_itself():
    guard, controller = CorrectionGuard(LIMITS, RELATIVE), Controller(RELATIVE)
    _run(guard, controller, 0.0, 200, _wanted((3.0, 4.0, 0.0)))
    np.testing.assert_allclose(controller.shift, [0.3 * MM, 0.4 * MM, 0.0], atol=2e-8)
    assert np.linalg.norm(controller.shift) <= LIMITS.shift


@pytest.mark.parametrize("mode", [ABSOLUTE, RELATIVE])
@pytest.mark.parametrize(
    ("harm", "why"),
    [
        (lambda guard, now: None, "behind the answer"),
        (lambda guard, now: guard.fault("outside the model"), "outside the model"),
        (lambda guard, now: guard.fault("NaN"), "NaN"),
        (lambda guard, now: guard.count_late(2, now), "2 late answers within 1 s"),
        (lambda guard, now: guard.want(_wanted((0.0, 0.0, 0.0)), now + 1.0), "ahead of the answer"),
        (lambda guard, now: guard.want(_wanted((0.0, 0.0, 0.0)), math.nan), "without a time"),
        (lambda guard, now: guard.next(now - 1.0), "clock went back"),
    ],
)
def test_the_watchdog_bites_and_goes_to_zero_without_a_jump(mode, harm, why):
    guard, controller = CorrectionGuard(LIMITS, mode), Controller(mode)
    now = _run(guard, controller, 100.0, 100, _wanted((0.4 * MM, 0.0, 0.0)))
    answer = harm(guard, now)
    if isinstance(answer, Correction):
        controller.take(answer)
    biggest = 0.0
    for k in range(13 + math.ceil(0.4 / 0.02) + 2):
        moved, _ = controller.take(guard.next(now + k * CYCLE))
        biggest = max(biggest, moved)
    assert why in guard.why
    assert guard.trips == 1
    assert biggest <= STEP + SLACK
    assert guard.at_rest
    assert np.linalg.norm(controller.shift) <= 1e-15


def test_one_late_answer_is_forgiven():
    guard, controller = CorrectionGuard(LIMITS, ABSOLUTE), Controller(ABSOLUTE)
    now = _run(guard, controller, 0.0, 100, _wanted((0.4 * MM, 0.0, 0.0)))
    guard.count_late(1, now)
    assert guard.active
    guard.count_late(1, now + 2.0)
    assert guard.active
    guard.count_late(1, now + 2.5)
    assert not guard.active


def test_with_a_latch_it_stays_at_zero_until_it_is_armed_again():
    limits = CorrectionLimits(shift=1e-3, shift_rate=1e-2, cycle=CYCLE, ramp=0.0)
    guard, controller = CorrectionGuard(limits, ABSOLUTE), Controller(ABSOLUTE)
    wanted = _wanted((1e-4, 0.0, 0.0))
    now = _run(guard, controller, 0.0, 20, wanted)
    assert controller.shift[0] == pytest.approx(1e-4)
    guard.fault("a clock that jumped")
    now = _run(guard, controller, now, 300, wanted)
    assert (controller.shift == 0.0).all()
    assert guard.why == "a clock that jumped"
    guard.rearm()
    _run(guard, controller, now, 20, wanted)
    assert controller.shift[0] == pytest.approx(1e-4)
    assert guard.why == ""


def test_without_a_latch_it_comes_back_by_the_ramp_on_fresh_estimates():
    guard, controller = CorrectionGuard(LIMITS, ABSOLUTE), Controller(ABSOLUTE)
    wanted = _wanted((0.2 * MM, 0.0, 0.0))
    now = _run(guard, controller, 0.0, 60, wanted)
    guard.fault("settling")
    now = _run(guard, controller, now, 12, wanted)
    assert guard.at_rest or controller.shift[0] < 0.2 * MM
    _run(guard, controller, now, 60, wanted)
    assert controller.shift[0] == pytest.approx(0.2 * MM, abs=2e-9)


def test_nothing_bites_before_something_is_wanted():
    guard = CorrectionGuard(LIMITS, ABSOLUTE)
    guard.next(0.0)
    guard.fault("settling")
    guard.fault("the first packet")
    guard.count_late(5, 0.0)
    assert guard.active
    assert guard.trips == 0


def test_a_controller_that_begins_anew_holds_nothing():
    guard, controller = CorrectionGuard(LIMITS, ABSOLUTE), Controller(ABSOLUTE)
    now = _run(guard, controller, 0.0, 100, _wanted((0.4 * MM, 0.0, 0.0)))
    guard.note_restart()
    assert guard.at_rest
    assert (guard.next(now).shift == 0.0).all()


@pytest.mark.parametrize("mode", [ABSOLUTE, RELATIVE])
def test_a_controller_that_may_have_begun_anew_is_not_moved(mode):
    guard, controller = CorrectionGuard(LIMITS, mode), Controller(mode)
    now = _run(guard, controller, 0.0, 100, _wanted((0.4 * MM, 0.0, 0.0)))
    guard.note_restart(certain=False)
    assert "still apply 0.400 mm; no more corrections" in guard.why
    for k in range(200):
        guard.want(_wanted((0.1 * MM, 0.0, 0.0)), now + k * CYCLE)
        answer = guard.next(now + k * CYCLE)
        assert answer is None if mode is ABSOLUTE else not answer.shift.any()
    guard.rearm()
    assert not guard.active
    assert not guard.at_rest
    assert guard.state().farthest == pytest.approx(0.4 * MM, abs=1e-8)
    again = CorrectionGuard(LIMITS, mode)
    again.resume(guard.state(), "killed")
    assert again.frozen
    guard.note_restart()
    assert guard.at_rest
    assert guard.state().farthest == 0.0


def test_an_open_answer_counts_against_the_limit_both_ways():
    """In relative mode it may have moved the robot: the way to the limit is shorter by it."""
    guard, wanted = CorrectionGuard(LIMITS, RELATIVE), _wanted((0.5 * MM, 0.0, 0.0))
    least = most = 0.0
    for k in range(400):
        guard.want(wanted, k * CYCLE)
        lost = 20 <= k < 24
        guard.book(taken=not 20 < k <= 24)
        moved = guard.next(k * CYCLE).shift[0]
        assert moved == 0.0 or not 20 < k <= 24, "a late one may come in the same cycle"
        least, most = least + moved * (not lost), most + moved
    spread = guard.state().spread[0] * 1e-9
    assert most - least == pytest.approx(spread, abs=2e-9)
    assert spread > 0.0
    assert LIMITS.shift - 3e-8 <= most <= LIMITS.shift
    guard.release()
    _run(guard, Controller(RELATIVE), 2.0, 100)
    assert guard.at_rest
    assert guard.state().farthest == pytest.approx(spread)


def test_open_answers_beyond_half_of_the_limit_end_corrections_for_good():
    guard, wanted = CorrectionGuard(LIMITS, RELATIVE), _wanted((0.5 * MM, 0.0, 0.0))
    for k in range(400):
        guard.want(wanted, k * CYCLE)
        guard.book(taken=k % 2 == 0)
        guard.next(k * CYCLE)
    assert "add up to 0.2" in guard.why
    assert "no more corrections until the controller is restarted" in guard.why
    guard.rearm()
    assert not guard.active
    assert guard.state().refused


def test_released_it_goes_to_zero_for_good():
    guard, controller = CorrectionGuard(LIMITS, RELATIVE), Controller(RELATIVE)
    wanted = _wanted((0.4 * MM, 0.0, 0.0))
    now = _run(guard, controller, 0.0, 100, wanted)
    guard.release()
    _run(guard, controller, now, 22, wanted)
    assert guard.at_rest
    np.testing.assert_allclose(controller.shift, 0.0, atol=1e-15)


def test_small_increments_add_up_over_a_shift():
    """Each is below the last digit that is sent; their sum is what is wanted all the same."""
    limits = CorrectionLimits(shift=1e-3, shift_rate=1e-6, cycle=CYCLE, timeout=10.0, ramp=0.0)
    guard, controller = CorrectionGuard(limits, RELATIVE), Controller(RELATIVE)
    for k in range(2500):
        guard.want(_wanted((7e-6, 0.0, 0.0)), k * CYCLE)
        answer = guard.next(k * CYCLE)
        printed = np.array([float(f"{v / MM:.6f}") for v in answer.shift]) * MM
        controller.take(Correction(shift=printed, turn=np.zeros(3), mode=RELATIVE))
    assert controller.shift[0] == pytest.approx(7e-6, abs=1e-9)


def test_an_increment_as_what_is_wanted_is_refused():
    guard = CorrectionGuard(LIMITS, RELATIVE)
    with pytest.raises(ModelMismatchError, match="expected the whole of it"):
        guard.want(Correction(shift=np.zeros(3), turn=np.zeros(3), mode=RELATIVE), 0.0)
    with pytest.raises(ShapeError):
        _wanted((math.nan, 0.0, 0.0))


@pytest.mark.parametrize(
    "wrong",
    [
        {"shift": 0.0},
        {"shift": math.nan},
        {"shift_rate": math.inf},
        {"cycle": 0.0},
        {"timeout": 0.0},
        {"turn": 10.0 * DEG},
        {"late_answers": 0},
    ],
)
def test_limits_that_limit_nothing_are_refused(wrong):
    with pytest.raises(ConfigurationError):
        CorrectionLimits(**({"shift": 1e-3, "shift_rate": 1e-3, "cycle": CYCLE} | wrong))
