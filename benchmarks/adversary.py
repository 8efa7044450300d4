"""Robots that hold corrections, a network that harms, and who chooses the harm. All SIMULATED.

Without sockets and without a clock of its own: time is a number. The robots are written from what
controllers do, not from what the guard assumes: Delay counts in total or in a row, from the first
answer or from RSI_ON; a late answer is dropped or taken one cycle later; a second one is ignored or
counted as faulty. Lengths are whole nanometres, as on the wire.
"""

from __future__ import annotations

import heapq
import math
import random
from collections import deque
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from robotrue.online.guard import CorrectionGuard, CorrectionLimits, GuardState
from robotrue.online.robot_correction import Correction, CorrectionMode
from robotrue.online.rsi_answer import SILENCE, RsiBooking
from robotrue.online.sequence import SequenceState

NM = 1e-9
Vector = tuple[int, int, int]
ZERO: Vector = (0, 0, 0)
ABSOLUTE, RELATIVE = CorrectionMode.ABSOLUTE, CorrectionMode.RELATIVE


class RsiRobot:
    """A controller after RSI_ON, and the true shift that it holds."""

    def __init__(self, mode: CorrectionMode, cycle_ms: int, rng: random.Random) -> None:
        self.mode, self.cycle_ms = mode, cycle_ms
        self.ipoc = rng.randrange(10**6, 10**9)
        self.total = rng.random() < 0.6
        self.patient = rng.random() < 0.5  # counts from the first answer on
        self.tolerant = rng.random() < 0.4  # takes an answer one cycle late
        self.strict = self.total and rng.random() < 0.3  # a second answer is a fault
        self.delay = 0
        self.held: Vector = ZERO
        self.off = 0
        self._begin()

    def _begin(self) -> None:
        self._attached = False
        self._before: tuple[int, bool] = (-1, True)
        self._taken = self._faulty = False
        self._values: list[Vector] = []

    def restart(self, cycles: int) -> None:
        """RSI_OFF, a pause, RSI_ON."""
        self.held, self.delay, self.off = ZERO, 0, cycles
        self._begin()

    def emit(self) -> tuple[int, int] | None:
        """IPOC and Delay of the cycle that begins."""
        self._taken = self._faulty = False
        self._values = []
        return None if self.off else (self.ipoc, self.delay)

    def take(self, ipoc: int, value: Vector) -> None:
        """An answer comes."""
        if self.off:
            return
        if ipoc == self.ipoc and not self._taken:
            self._taken = self._attached = True
            self._values.append(value)
        elif ipoc == self.ipoc:
            self._faulty = True
        elif self.tolerant and self._before == (ipoc, False):
            self._before = (ipoc, True)
            self._values.append(value)

    def close(self) -> float:
        """Ends the cycle; returns nm by which the robot was moved."""
        before = self.held
        for value in self._values:
            if self.mode is ABSOLUTE:
                self.held = value
            elif value != ZERO:
                (x, y, z), (a, b, c) = value, self.held
                self.held = (a + x, b + y, c + z)
        if self.off:
            self.off -= 1
        elif not self._taken:
            self.delay += self._attached or not self.patient
        elif self.strict and self._faulty:
            self.delay += 1
        elif not self.total:
            self.delay = 0
        self._before = (self.ipoc, self._taken)
        self.ipoc += self.cycle_ms
        return 0.0 if self.held == before else math.dist(self.held, before)


class Tool(Protocol):
    """What answers a robot."""

    @property
    def watch(self) -> SequenceState:
        """What it knows of the controller's packets."""

    def receive(self, ipoc: int, late: int, now: float) -> Vector | None:
        """The answer to a packet, if there is one."""


class BookedTool:
    """The tool from the booking on: what an RSI link does with IPOC and Delay, without XML."""

    def __init__(
        self,
        guard: CorrectionGuard,
        cycle_ms: int,
        before: SequenceState | None = None,
        *,
        trust: bool = False,
    ) -> None:
        self.guard = guard
        self._booking = RsiBooking(guard, cycle_ms, before, trust_restart=trust)
        self._silence, self._seen = SILENCE * cycle_ms * 1e-3, -math.inf
        self._answered: dict[int, None] = {}

    @property
    def watch(self) -> SequenceState:
        """What it knows of the controller's packets."""
        booking = self._booking
        return SequenceState(last=booking._ipoc, late_count=booking._late, host_time=booking._time)

    def receive(self, ipoc: int, late: int, now: float) -> Vector | None:
        """The answer to a packet, if there is one."""
        silent = now - self._seen > self._silence
        if silent:
            self._answered.clear()
        self._seen = now
        moves = self._booking.packet(ipoc, late, now, silent=silent)
        if ipoc in self._answered:
            return None
        self._answered[ipoc] = None
        if len(self._answered) > 128:
            del self._answered[next(iter(self._answered))]
        return vector(self.guard.next(now) if moves else self.guard.hold())


def vector(correction: Correction | None) -> Vector | None:
    """A correction in nm."""
    if correction is None:
        return None
    if not correction.shift.any():
        return ZERO
    x, y, z = (round(v / NM) for v in correction.shift.tolist())
    return x, y, z


@dataclass(slots=True)
class Harm:
    """How often what happens; shares of packets, or of cycles for events."""

    loss: float = 0.0
    late: float = 0.0
    twice: float = 0.0
    aimed: str = ""
    spacing: int = 100
    events: dict[str, float] = field(default_factory=dict)

    @classmethod
    def drawn(cls, rng: random.Random) -> Harm:
        """One of many kinds of network, from harmless to hopeless."""
        level = rng.choice([0.0, 1e-4, 1e-3, 1e-2])
        return cls(
            loss=level * rng.random(),
            late=level * rng.random(),
            twice=level * rng.random(),
            aimed=rng.choice(["", "packet out", "packet out", "answer out", "answer in", "any"]),
            spacing=rng.choice([3, 20, 97, 97, 300]),
            events={
                name: rng.choice([0.0, 0.0, 1e-3, 3e-4])
                for name in ("restart", "pause", "ipoc", "delay", "host", "death")
            },
        )


@dataclass(slots=True)
class Outcome:
    """What came of a run."""

    farthest_nm: float = 0.0
    fastest_nm: float = 0.0
    believed_nm: float = 0.0
    trips: int = 0
    refusals: int = 0
    left_nm: float = 0.0
    outside: int = 0
    trace: list[tuple[float, float, float, float]] = field(default_factory=list)


def limits(rate_mm_s: float, cycle_ms: int, ramp: float) -> CorrectionLimits:
    """0.2 mm; after a fault it begins again."""
    return CorrectionLimits(
        shift=0.2e-3,
        shift_rate=rate_mm_s * 1e-3,
        cycle=cycle_ms * 1e-3,
        ramp=ramp,
        latch=False,
    )


class Targets:
    """What the estimator wants: in and out along a way that turns, often beyond the limit."""

    def __init__(self, rng: random.Random) -> None:
        self._period = rng.uniform(1.0, 8.0)
        directions = np.random.default_rng(rng.randrange(2**32)).standard_normal((16, 3))
        size = rng.choice([0.1e-3, 0.2e-3, 1e-3])
        directions *= size / np.linalg.norm(directions, axis=1, keepdims=True)
        if rng.random() < 0.5:
            directions[:] = directions[0]
        rest = np.zeros(3)
        self._wanted = [
            Correction(shift=v, turn=rest, mode=ABSOLUTE)
            for pair in zip(directions, rng.choice([0.0, -1.0]) * directions, strict=True)
            for v in pair
        ]

    def at(self, time: float) -> Correction:
        """The one of a time."""
        return self._wanted[int(time / self._period) % len(self._wanted)]


class World:
    """A robot, the network, the tool and the adversary that sees both ends."""

    def __init__(
        self, seed: int, mode: CorrectionMode, cycle_ms: int, *, link: bool = False
    ) -> None:
        rng = self.rng = random.Random(seed)  # noqa: S311
        self.cycle, self.mode = cycle_ms * 1e-3, mode
        self.limits = limits(rng.choice([1.0, 1.0, 10.0]), cycle_ms, rng.choice([0.0, 0.2]))
        self.guard = CorrectionGuard(self.limits, mode)
        self.robot = RsiRobot(mode, cycle_ms, rng)
        self.harm, self.targets = Harm.drawn(rng), Targets(rng)
        self._link = link
        self.tool = self.made(None)
        self.outcome = Outcome()
        self.step_nm = self.limits.shift_rate * self.cycle / NM
        self.count = 0
        self._line: list[tuple[float, int, str, tuple]] = []
        self._number = self._aimed_at = 0
        self._host = 0.0
        self._cut = 0
        self._frozen = 0
        self._dead = 0
        self._due: list[tuple[int, str]] = []
        for name in self.harm.events:
            self.plan(name)
        self._told: deque[tuple[GuardState, SequenceState]] = deque(maxlen=3)

    def cycles(self, count: int, *, trace: int = 0) -> Outcome:
        """Runs so many cycles; with ``trace`` every so many leave a point of the plot."""
        for _ in range(count):
            self.one_cycle()
            if trace and self.count % trace == 0:
                self.record()
        outcome, guard = self.outcome, self.guard
        outcome.trips, outcome.left_nm = guard.trips, guard.state().farthest / NM
        return outcome

    def record(self) -> None:
        """Leaves a point of the plot."""
        held, state = math.hypot(*self.robot.held), self.guard.state()
        believed = math.hypot(*state.shift)
        self.outcome.trace.append((self.count * self.cycle, held, believed, state.farthest / NM))

    def one_cycle(self) -> None:
        """A packet, its answer, what else arrives, and the robot's move."""
        now = self.count * self.cycle
        if self.count % 4 == 0:
            self.guard.want(self.targets.at(now), now + self._host)
        self.events()
        packet = self.robot.emit()
        if packet is not None:
            self.send("rob", packet, now, self.harmed("packet"))
        self.deliver(now + 0.9 * self.cycle)
        self.judged(self.robot.close())
        self.count += 1

    def events(self) -> None:
        """What happens by itself, and what the operator does about a refusal."""
        while self._due and self._due[0][0] <= self.count:
            name = heapq.heappop(self._due)[1]
            self.plan(name)
            self.happen(name)
        self._cut -= self._cut > 0
        if self._dead:
            self._dead -= 1
            if not self._dead:
                self.revive()
        self._frozen = self._frozen + 1 if self.guard._refused else 0
        if self._frozen == 1:
            self.outcome.refusals += 1
        if self._frozen * self.cycle > 1.0 and not self._dead:
            self.confirm()

    def confirm(self) -> None:
        """The operator starts the controller anew, then the service, and confirms zero."""
        self.robot.restart(self.rng.randrange(30, 80))
        trips = self.guard.trips
        self.guard = CorrectionGuard(self.limits, self.mode)
        self.guard.trips = trips
        self.tool = self.made(None)
        self._line.clear()
        self._told.clear()

    def plan(self, name: str) -> None:
        """Draws when an event comes next."""
        if share := self.harm.events[name]:
            wait = int(math.log(1.0 - self.rng.random()) / math.log1p(-share))
            heapq.heappush(self._due, (self.count + 1 + wait, name))

    def happen(self, name: str) -> None:
        """One event."""
        rng, robot = self.rng, self.robot
        if name == "restart":
            robot.restart(rng.randrange(30, 200))
        elif name == "pause":
            self._cut = max(self._cut, rng.randrange(2, 150))
        elif name == "ipoc":
            robot.ipoc += rng.choice([-1, 1]) * int(10.0 ** rng.uniform(0.6, 6.0))
            robot.ipoc = max(robot.ipoc, 1)
            if rng.random() < 0.7:
                robot.ipoc -= robot.ipoc % robot.cycle_ms
        elif name == "delay":
            robot.delay = rng.choice([0, robot.delay + 50, rng.randrange(10**4)])
        elif name == "host":
            self._host += rng.choice([-0.01, 0.05, 0.5, 20.0])
        elif name == "death" and self._told and not self._dead:
            self._dead = rng.randrange(5, 150)

    def revive(self) -> None:
        """Another process goes on, from what the one before has told: not its last answers."""
        told = self.rng.randrange(len(self._told)) if self.mode is RELATIVE else -1
        state, watch = self._told[told]
        trips = self.guard.trips
        self.guard = CorrectionGuard(self.limits, self.mode)
        self.guard.resume(state, "the process that answers has ended")
        self.guard.trips = trips + 1
        self.tool = self.made(watch)
        self._told.clear()

    def made(self, before: SequenceState | None) -> Tool:
        """The tool, new or for one that has ended."""
        cycle_ms = round(1e3 * self.cycle)
        # who states that a Delay near zero is a new session has to have such a controller
        trust = not self.harm.events["delay"]
        if not self._link:
            return BookedTool(self.guard, cycle_ms, before, trust=trust)
        from adversary_links import LinkedRsi

        return LinkedRsi(self.guard, self.mode, cycle_ms, self.rng, before, trust=trust)

    def harmed(self, what: str) -> str:
        """What becomes of a datagram: lost, late, twice, or nothing."""
        harm, rng = self.harm, self.rng
        if self._cut:
            return "lost"
        if harm.aimed and self.count - self._aimed_at >= harm.spacing and self.worth(what):
            self._aimed_at = self.count
            return "lost"
        if not harm.loss:
            return ""
        share = rng.random()
        if share >= harm.loss + harm.late + harm.twice:
            return ""
        return "lost" if share < harm.loss else "late" if share < harm.loss + harm.late else "twice"

    def worth(self, what: str) -> bool:
        """Whether losing this one may part belief and robot; seen in the guard itself."""
        kind, _, way = self.harm.aimed.partition(" ")
        if kind == "any":
            return True
        moved, held = self.guard._pending[0], self.guard._shift
        if kind != what or moved == ZERO:
            return False
        out = sum(a * b for a, b in zip(moved, held, strict=True)) > 0
        return out is (way == "out")

    def send(self, kind: str, content: tuple, now: float, harm: str) -> None:
        """Puts a datagram on its way."""
        if not harm and not self._line:
            self.arrive(kind, content, now + 0.01 * self.cycle)
            return
        if harm == "lost":
            return
        delay = self.cycle * self.rng.uniform(0.3, 4.0) if harm == "late" else 0.01 * self.cycle
        self.push(now + delay, kind, content)
        if harm == "twice":
            self.push(now + self.cycle * self.rng.uniform(0.01, 2.0), kind, content)

    def push(self, when: float, kind: str, content: tuple) -> None:
        """A datagram that arrives then."""
        self._number += 1
        heapq.heappush(self._line, (when, self._number, kind, content))

    def deliver(self, until: float) -> None:
        """Everything that arrives by then."""
        line = self._line
        while line and line[0][0] <= until:
            when, _, kind, content = heapq.heappop(line)
            self.arrive(kind, content, when)

    def arrive(self, kind: str, content: tuple, when: float) -> None:
        """A datagram is there."""
        if kind == "sen":
            self.robot.take(*content)
        elif not self._dead:
            answer = self.tool.receive(*content, when + self._host)
            if self.harm.events["death"]:
                self.tell()
            if answer is not None:
                self.send("sen", (content[0], answer), when, self.harmed("answer"))

    def tell(self) -> None:
        """What the service hears after an answer, for the process that may have to go on."""
        self._told.append((self.guard.state(), self.tool.watch))

    def judged(self, moved_nm: float) -> None:
        """Compares with the limits."""
        if not moved_nm:
            return
        outcome = self.outcome
        held = math.hypot(*self.robot.held)
        outcome.farthest_nm = max(outcome.farthest_nm, held)
        outcome.fastest_nm = max(outcome.fastest_nm, moved_nm / self.step_nm)
        limit = self.limits.shift / NM
        outcome.outside += held > limit + 0.5 or moved_nm > self.step_nm + 0.5
