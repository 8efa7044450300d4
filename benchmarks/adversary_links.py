"""The links themselves, bytes in and bytes out, for the robots of ``adversary.py``. All SIMULATED.

Their sockets are replaced by a list, their clock by a number; everything else is what runs.
"""

from __future__ import annotations

import contextlib
import math
import random
import re
from collections.abc import Iterator
from types import SimpleNamespace
from unittest import mock

from adversary import ABSOLUTE, NM, Outcome, Targets, Vector, limits

from robotrue.online import egm, egm_link, robot_link, rsi_link
from robotrue.online.egm import GuidanceState, RobotWare
from robotrue.online.egm_link import EgmSettings, EgmSource
from robotrue.online.guard import CorrectionGuard
from robotrue.online.robot_correction import CorrectionMode
from robotrue.online.rsi import RobPacket
from robotrue.online.rsi_answer import write_rob
from robotrue.online.rsi_config import usual_rsi_config
from robotrue.online.rsi_link import RsiSettings, RsiSource
from robotrue.online.sequence import SequenceState

ROBOT = ("192.0.2.10", 30000)
STRAY = ("192.0.2.66", 30000)
JOINTS = (0.0, -90.0, 90.0, 0.0, 45.0, 0.0)
POSE = (1000.0, 0.0, 1500.0, 90.0, 0.0, 0.0)
_SEN = re.compile(rb'<RKorr X="([-.\d]+)" Y="([-.\d]+)" Z="([-.\d]+)".*<IPOC>(\d+)</IPOC>')


class Clock:
    """Where the links' modules look for the time."""

    now = 0.0

    def monotonic(self) -> float:
        """The time that is set."""
        return self.now


CLOCK = Clock()


class Sent:
    """An endpoint whose datagrams are looked at."""

    def __init__(self, *_: object, **__: object) -> None:
        self.address, self.preferred = ("0.0.0.0", 0), False  # noqa: S104
        self.last: bytes | None = None

    def start(self) -> None:
        """Nothing runs."""

    def send(self, data: bytes, to: tuple[str, int]) -> bool:
        """Keeps what would be sent."""
        if to != ROBOT:
            raise RuntimeError(f"an answer to {to}")
        self.last = data
        return True


@contextlib.contextmanager
def replaced() -> Iterator[None]:
    """Has the links take their time and their endpoint from here."""
    clock = SimpleNamespace(monotonic=CLOCK.monotonic)
    with contextlib.ExitStack() as stack:
        for module in (robot_link, rsi_link, egm_link):
            stack.enter_context(mock.patch.object(module, "time", clock))
        stack.enter_context(mock.patch.object(robot_link, "UdpEndpoint", Sent))
        yield


class LinkedRsi:
    """An RSI link with its packets and answers as bytes."""

    def __init__(
        self,
        guard: CorrectionGuard,
        mode: CorrectionMode,
        cycle_ms: int,
        rng: random.Random | None = None,
        before: SequenceState | None = None,
        *,
        trust: bool = False,
        stated: bool = True,
    ) -> None:
        config = usual_rsi_config("0.0.0.0", 49152, hold=mode is ABSOLUTE)  # noqa: S104
        settings = RsiSettings(
            name="rsi://",
            config=config,
            cycle_ms=cycle_ms,
            mode=mode,
            peer=(ROBOT[0], 0) if stated else None,
            trust_restart=trust,
        )
        state = None
        if before is not None:
            state = robot_link.LinkState(watch=before, peer=ROBOT)
        self.link, self._rng = RsiSource(settings, guard, before=state), rng
        self._strays = rng is not None and rng.random() < 0.5

    @property
    def watch(self) -> SequenceState:
        """What it knows of the controller's packets."""
        return self.link.seen[0]

    def receive(
        self, ipoc: int, late: int, now: float, sender: tuple[str, int] = ROBOT
    ) -> Vector | None:
        """The answer to a packet, if there is one; strange senders get none."""
        CLOCK.now = now
        rob = write_rob(RobPacket(ipoc=ipoc, late=late, joints_deg=JOINTS, pose_mm_deg=POSE))
        sent: Sent = self.link._endpoint  # type: ignore[assignment]
        if self._strays and self._rng is not None and self._rng.random() < 0.01:
            self.link._take(rob, STRAY, now)
        sent.last = None
        self.link._take(rob, sender, now)
        self.link._inbox._items.clear()
        if sent.last is None:
            return None
        *xyz, answered = _SEN.search(sent.last).groups()  # type: ignore[union-attr]
        if int(answered) != ipoc:
            raise RuntimeError(f"answered {answered!r} for {ipoc}")
        x, y, z = (round(float(v) * 1e6) for v in xyz)
        return x, y, z


class EgmWorld:
    """An ABB controller that holds an offset, the network, and the link; 4 ms.

    EGM confirms no answer. The rate is therefore judged between answers the robot took: by the
    time between their sending.
    """

    def __init__(self, seed: int, *, rate_mm_s: float = 1.0) -> None:
        rng = self.rng = random.Random(seed)  # noqa: S311
        self.limits = limits(rate_mm_s, 4, rng.choice([0.0, 0.2]))
        self.guard = CorrectionGuard(self.limits, ABSOLUTE)
        self.link = EgmSource(
            EgmSettings(
                name="egm://", generation=RobotWare.SEVEN, mode=ABSOLUTE, peer=(ROBOT[0], 0)
            ),
            self.guard,
        )
        self.targets, self.outcome = Targets(rng), Outcome()
        level = rng.choice([0.0, 1e-3, 1e-2])
        self._loss, self._late = level * rng.random(), level * rng.random()
        self._event = rng.choice([0.0, 1e-3, 3e-4])
        self._aimed = rng.random() < 0.5
        self.held: Vector = (0, 0, 0)
        self.first_nm = 0.0
        self._fresh = True
        self._held_at = 0.0
        self._seqno, self._stopped, self._cut = rng.randrange(10**6), 0, 0
        self._shown = GuidanceState.STOPPED
        self.count = 0
        self._line: list[tuple[float, str, tuple]] = []

    def cycles(self, count: int) -> Outcome:
        """Runs so many cycles."""
        for _ in range(count):
            self.one_cycle()
        self.outcome.trips = self.guard.trips
        return self.outcome

    def restart(self, cycles: int) -> None:
        """The guidance ends and begins anew on the programmed path."""
        self._stopped, self.held, self._fresh = cycles, (0, 0, 0), True
        self._shown = self.rng.choice(
            [GuidanceState.STOPPED, GuidanceState.UNDEFINED, GuidanceState.ERROR]
        )
        if self.rng.random() < 0.3:
            self._seqno = 0

    def one_cycle(self) -> None:
        """A message, its answer, and what else arrives."""
        now, rng = self.count * 4e-3, self.rng
        if self.count % 4 == 0:
            self.guard.want(self.targets.at(now), now)
        if rng.random() < self._event:
            kind = rng.choice(["restart", "cut", "jump"])
            if kind == "restart":
                self.restart(rng.randrange(30, 500))
            elif kind == "cut":
                self._cut = rng.randrange(2, 300)
            else:
                self._seqno += rng.randrange(1, 10**6)
        if self._stopped:
            self._stopped -= 1
            if not self._stopped:
                self._held_at = now
        elif self.guard.frozen and not self._cut and rng.random() < 0.004:
            self.restart(rng.randrange(30, 100))  # its own timeout, and the operator
        state = self._shown if self._stopped else GuidanceState.RUNNING
        message = egm.EgmRobot(
            seqno=self._seqno,
            tm_ms=round(1e3 * now),
            joints_deg=JOINTS,
            guidance=state,
            motors=egm.MotorState.ON,
        )
        self.send("robot", (egm.write_robot(message, RobotWare.SEVEN),), now)
        self._seqno += 1
        self._cut -= self._cut > 0
        self.deliver(now + 3.6e-3)
        self.count += 1

    def send(self, kind: str, content: tuple, now: float) -> None:
        """Puts a datagram on its way, or loses it."""
        rng = self.rng
        aimed = self._aimed and self.guard._pending[0] != (0, 0, 0) and rng.random() < 0.01
        if self._cut or aimed or rng.random() < self._loss:
            return
        delay = rng.uniform(1e-3, 16e-3) if rng.random() < self._late else 4e-5
        self._line.append((now + delay, kind, content))

    def deliver(self, until: float) -> None:
        """Everything that arrives by then."""
        sent: Sent = self.link._endpoint  # type: ignore[assignment]
        while due := sorted((d for d in self._line if d[0] <= until), key=lambda d: d[0]):
            self._line.remove(due[0])
            when, kind, content = due[0]
            if kind == "sensor":
                self.take(*content)
                continue
            CLOCK.now, sent.last = when, None
            self.link._take(content[0], ROBOT, when)
            self.link._inbox._items.clear()
            if sent.last is not None:
                _, xyz, _ = egm.read_path_correction(sent.last)
                x, y, z = (round(v * 1e6) for v in xyz)
                if self._fresh:
                    self.first_nm, self._fresh = max(self.first_nm, math.hypot(x, y, z)), False
                self.send("sensor", ((x, y, z), when), when)

    def take(self, value: Vector, sent_at: float) -> None:
        """An answer comes to the robot, which knows none older than the one it holds."""
        if self._stopped or sent_at < self._held_at:
            return
        outcome, moved = self.outcome, math.dist(value, self.held)
        rate = self.limits.shift_rate / NM
        allowed = rate * (sent_at - self._held_at + 4e-3)
        outcome.farthest_nm = max(outcome.farthest_nm, math.hypot(*value))
        outcome.fastest_nm = max(outcome.fastest_nm, moved / allowed)
        outcome.outside += math.hypot(*value) > 0.2e6 + 0.5 or moved > allowed + 1.0
        self.held, self._held_at = value, sent_at
