"""Model-based: robots, a network, an adversary that sees the guard; limit and rate always hold."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from robotrue.errors import ConfigurationError
from robotrue.online.addresses import SourceSettings, open_stream
from robotrue.online.egm import GuidanceState
from robotrue.online.guard import CorrectionGuard
from robotrue.online.robot_correction import Correction

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import adversary
import adversary_links
from adversary import ABSOLUTE, NM, RELATIVE, Harm, World

LIMIT = 200_000
NEVER = dict.fromkeys(("restart", "pause", "ipoc", "delay", "host", "death"), 0.0)


class Chosen(World):
    """A world in which nothing goes wrong by itself."""

    def __init__(self, seed, mode, *, link=False):
        super().__init__(seed, mode, 12, link=link)
        self.harm = Harm(events=dict(NEVER))
        self._due.clear()
        self.next = {"packet": "", "answer": ""}

    def harmed(self, what):
        if self._cut:
            return "lost"
        harm, self.next[what] = self.next[what], ""
        return harm


class Corrected(RuleBasedStateMachine):
    """Every rule harms once; the robot goes on between."""

    @initialize(seed=st.integers(0, 10_000), mode=st.sampled_from([RELATIVE, ABSOLUTE]))
    def begin(self, seed, mode):
        self.world = Chosen(seed, mode)
        # who states that a small Delay after a pause is a new session has no other leaps of it
        self.leaps = seed % 2 == 0
        self.world.harm.events["delay"] = float(self.leaps)
        self.world.tool = self.world.made(None)
        self.world.cycles(60)

    @rule(count=st.sampled_from([1, 2, 3, 10, 40, 120]))
    def go_on(self, count):
        self.world.cycles(count)

    @rule(
        what=st.sampled_from(["packet", "answer"]), harm=st.sampled_from(["lost", "late", "twice"])
    )
    def harm(self, what, harm):
        self.world.next[what] = harm
        self.world.cycles(1)

    @rule(name=st.sampled_from(["restart", "pause", "ipoc", "host"]))
    def event(self, name):
        self.world.happen(name)

    @precondition(lambda self: self.leaps)
    @rule()
    def delay(self):
        self.world.happen("delay")

    @rule(told=st.booleans())
    def death(self, told):
        if told:
            self.world.tell()
            self.world.happen("death")

    @invariant()
    def within(self):
        if hasattr(self, "world"):
            assert self.world.outcome.outside == 0
            assert math.hypot(*self.world.robot.held) <= LIMIT


Corrected.TestCase.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)
TestCorrected = Corrected.TestCase


@pytest.mark.parametrize("mode", [RELATIVE, ABSOLUTE])
def test_drawn_runs_stay_within_limit_and_rate(mode):
    farthest = trips = 0
    for seed in range(12):
        outcome = World(seed, mode, 12).cycles(1500)
        assert outcome.outside == 0, seed
        farthest, trips = max(farthest, outcome.farthest_nm), trips + outcome.trips
    assert 0.9 * LIMIT < farthest <= LIMIT
    assert trips > 0


def test_the_links_themselves_stay_within_limit_and_rate():
    with adversary_links.replaced():
        for seed in range(3):
            for mode in (RELATIVE, ABSOLUTE):
                assert World(seed, mode, 12, link=True).cycles(500).outside == 0, seed
        outcomes = [adversary_links.EgmWorld(seed).cycles(1000) for seed in range(3)]
    assert all(outcome.outside == 0 for outcome in outcomes)
    assert 0.5 * LIMIT < max(outcome.farthest_nm for outcome in outcomes) <= LIMIT


def test_packets_lost_while_the_robot_moves_outwards():
    """Thirty, rarely enough for no trip: each answer is booked as what became of it."""
    world = Chosen(1, RELATIVE)
    world.guard = CorrectionGuard(adversary.limits(10.0, 12, 0.0), RELATIVE)
    world.limits = world.guard.limits
    world.step_nm = 10e-3 * world.cycle / NM
    world.tool = world.made(None)
    world.harm.aimed, world.harm.spacing = "packet out", 97
    world.harmed = lambda what: World.harmed(world, what)
    lost = 0
    for _ in range(3400):
        before = world._aimed_at
        world.one_cycle()
        lost += world._aimed_at != before
        assert world.robot.held == world.guard._shift or not world.robot._taken
    assert lost >= 20
    assert world.guard.trips == 0
    assert world.outcome.outside == 0
    assert world.guard.state().spread == (0, 0)


def _led(link, guard, cycles, now=0.0, late=0):
    """Leads a link by 0.15 mm; returns the time after it, and nm that it moved the robot by."""
    moved = 0
    wanted = Correction(shift=np.array([1.5e-4, 0.0, 0.0]), turn=np.zeros(3), mode=ABSOLUTE)
    for _ in range(cycles):
        guard.want(wanted, now)
        moved += link.receive(1000 + round(1e3 * now), late, now)[0]
        now += 12e-3
    return now, moved


@pytest.mark.parametrize("stated", [True, False])
def test_a_strange_sender_never_takes_the_seat(stated):
    """In each pause it sends one packet: the robot holds what it held, and nothing twice."""
    guard = CorrectionGuard(adversary.limits(1.0, 12, 0.0), RELATIVE)
    with adversary_links.replaced():
        link = adversary_links.LinkedRsi(guard, RELATIVE, 12, stated=stated)
        now, held = _led(link, guard, 60)
        for pause in range(1, 6):
            assert held == guard._shift[0] == pytest.approx(150_000, abs=2)
            assert link.receive(77, 0, now + 0.4, adversary_links.STRAY) is None
            now, moved = _led(link, guard, 80, now + 0.48, 40 * pause)
            held += moved
        health = link.link.health()
    assert (health.reconnects, health.refused, guard.trips) == (5, 5, 5)
    assert guard.state().farthest == pytest.approx(1.5e-4, abs=2e-9)


@pytest.mark.parametrize(
    "state", [GuidanceState.STOPPED, GuidanceState.UNDEFINED, GuidanceState.ERROR]
)
def test_a_guidance_that_stopped_begins_from_zero(state):
    """At 1 mm/s the first answer of 4 ms is 0.004 mm at most."""
    with adversary_links.replaced():
        world = adversary_links.EgmWorld(0)
        world._loss = world._late = world._event = 0.0
        world._aimed = False
        world.guard.want = lambda *_: None
        wanted = Correction(shift=np.array([2e-4, 0.0, 0.0]), turn=np.zeros(3), mode=ABSOLUTE)
        for k in range(1000):
            CorrectionGuard.want(world.guard, wanted, k * 4e-3)
            if k == 300:
                assert world.held[0] > 0.19e6
                world.restart(400)
                world._shown = state
            world.one_cycle()
    assert world.first_nm <= 4000.0
    assert world.held[0] > 0.19e6, "and goes on from there"
    assert world.outcome.outside == 0


def test_rtde_takes_no_corrections():
    guard = CorrectionGuard(adversary.limits(1.0, 12, 0.0), ABSOLUTE)
    with pytest.raises(ConfigurationError, match="only rsi:// and egm:// robots take them"):
        open_stream("rtde://127.0.0.1", "robot", SourceSettings(corrector=guard))


def test_a_process_that_goes_on_counts_on_answers_that_nobody_told():
    """Killed with answers unreported, and Delay set anew meanwhile: the robot is not at rest."""
    outcome = World(3462, RELATIVE, 12).cycles(2200)
    assert outcome.farthest_nm <= LIMIT
    assert outcome.outside == 0
    assert outcome.refusals > 0
