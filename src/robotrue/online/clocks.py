"""Sample times on the host's clock: the controller's count without the delays of the network.

A packet arrives after it was sent. So the least delay of every second, host time minus controller
time, is a point on the line that joins the two clocks; the scatter of the network lies above it. A
straight line through the least delays of the last minutes gives offset and drift, and a far more
accurate time of each sample than its arrival.

One stream does not determine the least delay itself: an alignment from a jog
(:mod:`robotrue.online.clock_alignment`) determines the difference of two streams.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.errors import ShapeError

BIN: Final = 1.0
"""s of the controller's clock that give one least delay."""
WINDOW: Final = 120
"""Least delays kept: two minutes, in which a quartz keeps its rate."""
DRIFT: Final = 100e-6
"""Drift of a quartz against another, one standard deviation before any sample has come."""
JUMP: Final = 5e-3
"""s; packets that come this much too early, or all too late, are of another clock."""
LATE: Final = 0.1
"""s; a single packet that is later by this does not determine when it was sent."""
_FIRST: Final = 1e-3
"""s, standard deviation of the delays before a second has passed."""
_FINEST: Final = 1e-6
"""s, what the clocks themselves resolve."""
_LATE_RUN: Final = 25
"""Packets in a row later than JUMP before all are flagged, since a stall of the host clears
sooner."""
_LATE_BINS: Final = 3
"""Seconds in a row later than JUMP before the clock is taken to have jumped."""
_TRIMMED: Final = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockFix:
    """Offset and drift of a controller's clock against the host's.

    Attributes:
        at: s on the controller's clock.
        offset: s, host minus controller at that time, least delay included.
        offset_sd: s.
        drift: s/s, by which the host's clock runs faster.
        drift_sd: s/s.
        seconds: Least delays it rests on.
        jumps: How often the clocks have jumped since the stream was opened.
    """

    at: float
    offset: float
    offset_sd: float
    drift: float
    drift_sd: float
    seconds: int
    jumps: int


class StreamClock:
    """Controller times of one stream to host times, sample by sample; how it is cut is the same."""

    __slots__ = ("_bins", "_fit", "_number")

    def __init__(self) -> None:
        """Starts without a sample."""
        # fit: start, offset there, drift, offset's reference, sd of both, noise
        self._fit = np.zeros(7)
        # number: bin, least delay in it, where, latest controller time, latest result, run of late
        # packets, late bins in a row, bins stored, jumps, started
        self._number = np.array([0.0, np.inf, 0.0, -np.inf, -np.inf, 0.0, 0.0, 0.0, 0.0, 0.0])
        self._bins = np.zeros((WINDOW, 2))

    def align(self, controller: Array, host: Array) -> tuple[Array, BoolArray]:
        """Returns sample times (n,) s on the host's clock, and which are uncertain (n,).

        The times never fall. A sample without a controller time keeps the moment it came.

        Args:
            controller: (n,) s; NaN where none was sent.
            host: (n,) s, when they came.

        Raises:
            ShapeError: Different lengths.
        """
        if controller.shape != host.shape or host.ndim != 1:
            raise ShapeError(f"{controller.shape} controller times for {host.shape} host times.")
        known = np.isfinite(controller) & np.isfinite(host)
        if known.all():
            time, doubt = self._align_known(controller, host)
        else:
            time, doubt = host.copy(), ~np.isfinite(host)
            if known.any():
                time[known], doubt[known] = self._align_known(controller[known], host[known])
        return self._rising(time), doubt

    def fix(self) -> ClockFix:
        """Returns the state of the clocks."""
        start, offset, drift, at, offset_sd, drift_sd, _ = self._fit.tolist()
        kept = int(self._number[7])
        if not kept:
            least = float(self._number[1])
            offset = least if np.isfinite(least) else 0.0
            offset_sd, drift_sd, at, start = _FIRST, DRIFT, start, start
        return ClockFix(
            at=at,
            offset=offset + drift * (at - start),
            offset_sd=offset_sd,
            drift=drift,
            drift_sd=drift_sd,
            seconds=kept,
            jumps=int(self._number[8]),
        )

    def state(self) -> dict[str, Array]:
        """Returns the state from which :meth:`restore` continues, bit for bit."""
        return {"fit": self._fit.copy(), "number": self._number.copy(), "bins": self._bins.copy()}

    def restore(self, state: dict[str, Array]) -> None:
        """Continues from :meth:`state`.

        Raises:
            ShapeError: Not such a state.
        """
        for name in ("fit", "number", "bins"):
            own = getattr(self, f"_{name}")
            if state[name].shape != own.shape:
                raise ShapeError(f"clock state {name} has shape {state[name].shape}.")
            own[:] = state[name]

    def _align_known(self, controller: Array, host: Array) -> tuple[Array, BoolArray]:
        time, doubt = np.empty_like(host), np.zeros(len(host), dtype=np.bool_)
        delay, done = host - controller, 0
        while done < len(host):
            if not self._number[9]:
                self._begin(float(controller[done]))
            done += self._piece(controller[done:], delay[done:], time[done:], doubt[done:])
        return time, doubt

    def _piece(self, controller: Array, delay: Array, time: Array, doubt: BoolArray) -> int:
        """Aligns up to the end of the second, or to a jump; returns the number aligned."""
        number = self._number
        # the very difference that _close divides: else rounding could leave a second open for ever
        over = controller - self._fit[0] >= (number[0] + 1.0) * BIN
        n = int(np.argmax(over)) if over.any() else len(controller)
        if not n:
            self._close(float(controller[0]))
            return 0
        controller, delay = controller[:n], delay[:n]
        latest = np.maximum.accumulate(np.maximum(controller, number[3]))
        wrong = controller < latest - BIN
        expected = self._expect_host_times(controller, delay)
        if number[7]:
            wrong |= delay < expected - JUMP
        if wrong.any():
            n = int(np.argmax(wrong))
            if not n:
                self._jump()
                self._begin(float(controller[0]))
                time[0], doubt[0] = controller[0] + delay[0], True
                self._least(controller[:1], delay[:1])
                return 1
            controller, delay, expected = controller[:n], delay[:n], expected[:n]
        number[3] = latest[n - 1]
        time[:n] = controller + expected
        doubt[:n] = self._too_late(delay - expected)
        self._least(controller, delay)
        return n

    def _expect_host_times(self, controller: Array, delay: Array) -> Array:
        start, offset, drift = self._fit[:3]
        if self._number[7]:
            return np.asarray(offset + drift * (controller - start))
        return np.asarray(np.minimum.accumulate(np.minimum(delay, self._number[1])))

    def _too_late(self, excess: Array) -> BoolArray:
        """Returns a mask of late packets, which carry no clock information; counts runs of them."""
        late = excess > JUMP
        if not late.any():
            self._number[5] = 0.0
            return late
        place = np.arange(1, len(late) + 1)
        sound = np.maximum.accumulate(np.where(late, -self._number[5], place))
        run = place - sound
        self._number[5] = run[-1]
        return np.asarray((run >= _LATE_RUN) | (excess > LATE))

    def _least(self, controller: Array, delay: Array) -> None:
        where = int(np.argmin(delay))
        if delay[where] < self._number[1]:
            self._number[1], self._number[2] = delay[where], controller[where]

    def _begin(self, controller: float) -> None:
        self._fit[:] = (controller, 0.0, 0.0, controller, _FIRST, DRIFT, _FIRST)
        number = self._number
        number[:4] = 0.0, np.inf, 0.0, controller
        number[5:8] = 0.0
        number[9] = 1.0

    def _jump(self) -> None:
        self._number[8] += 1.0

    def _close(self, controller: float) -> None:
        """Ends a second: its least delay joins the line, unless the clock has jumped."""
        number, fit = self._number, self._fit
        least, where = number[1], number[2]
        # rounding may move a time at the end into the second that ends
        number[0] = max(number[0] + 1.0, np.floor((controller - fit[0]) / BIN))
        number[1] = np.inf
        if not np.isfinite(least):
            return
        kept = int(number[7])
        if kept and least - (fit[1] + fit[2] * (where - fit[0])) > JUMP:
            number[6] += 1.0
            if number[6] >= _LATE_BINS:
                self._jump()
                self._begin(controller)
            return
        number[6] = 0.0
        if kept == WINDOW:
            self._bins[:-1] = self._bins[1:]
            kept -= 1
        self._bins[kept] = where - fit[0], least
        number[7] = kept + 1
        self._refit(kept + 1)

    def _refit(self, kept: int) -> None:
        """Fits a line through the smallest delays; seconds with a busy host are excluded."""
        x, y = self._bins[:kept, 0], self._bins[:kept, 1]
        low = y.min()
        y = y - low
        use = np.ones(kept)
        centre = offset = drift = spread = 0.0
        noise, weight = _FIRST, 1.0
        for _ in range(4):
            weight = float(use.sum())
            centre = float(use @ x) / weight
            u = x - centre
            # the prior of the drift counts as one more observation of it
            spread = float(use @ (u * u)) + (noise / DRIFT) ** 2
            offset = float(use @ y) / weight
            drift = float(use @ (u * y)) / spread
            excess = y - offset - drift * u
            noise = max(_FINEST, 1.4826 * float(np.median(np.abs(excess))))
            use = (excess < _TRIMMED * noise).astype(np.float64)
        now = float(x[-1])
        # least delays lie above the true line by as much as they scatter: that much is not known
        sd = noise * np.sqrt(1.0 + 1.0 / weight + (now - centre) ** 2 / spread)
        self._fit[1:] = (
            low + offset - drift * centre, drift, self._fit[0] + now,
            sd, noise / np.sqrt(spread), noise,
        )  # fmt: skip

    def _rising(self, time: Array) -> Array:
        """Times that never fall: a better fit must not move a sample before the previous one."""
        rising = np.maximum.accumulate(
            np.maximum(np.where(np.isfinite(time), time, -np.inf), self._number[4])
        )
        self._number[4] = rising[-1] if len(rising) else self._number[4]
        return np.where(np.isfinite(rising), rising, np.nan)
