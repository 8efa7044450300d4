"""The learned deviation online: correction by the last whole window for the samples after it.

The physics of the deviation follow the slow force of every sample. Other parts (residual process,
gain on the prediction) and the standard deviation are those of the last window, a second of
milling, a few millimetres of path.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Records
from robotrue.core.compiled import EXACT, compile_kernel
from robotrue.dynamics.learned_deviation import WindowTrust
from robotrue.dynamics.windows import WindowSet
from robotrue.online.sensing_models import SensingModels
from robotrue.online.sensing_records import record_dtype

_NAME: Final = "online"
INSIDE, EXTRAPOLATED, INVALID = 0.0, 1.0, 2.0
_WHOLE: Final = 1e-9
"""Turn; a turn is whole but for rounding."""


def window_dtype(dof: int) -> np.dtype[np.void]:
    """Returns the record of sums over a window of milling.

    Fields: ``rows``; ``force`` sum (3,) N; ``turn_peak`` m and ``turn_force`` N of the present
    turn of the spindle; ``peaks``, ``force_peaks`` their sums over whole turns; ``turns``;
    ``seen`` samples; ``joints`` sum (dof,) rad.
    """
    return record_dtype(
        ("rows", ()), ("force", (3,)), ("turn_peak", ()), ("turn_force", ()), ("peaks", ()),
        ("force_peaks", ()), ("turns", ()), ("seen", ()), ("joints", (dof,)),
    )  # fmt: skip


class WindowDeviation:
    """Deviation of the last window.

    Attributes:
        correction: (3,) m beyond the physics, m^2 its variance, standing.
        direction: (3,) base, unit; zero where nothing was learned.
        turn: Samples per turn of the spindle.
        rows: Samples of a window.
    """

    __slots__ = ("_learned", "correction", "direction", "rows", "turn")

    def __init__(self, models: SensingModels) -> None:
        """Starts without a window."""
        self._learned = models.learned
        self.correction, self.direction = np.zeros(3), np.zeros(3)
        self.turn, self.rows = 1.0, 0
        if self._learned is not None:
            self.direction = np.array(self._learned.model.arm.direction)
            self.turn = models.rate / self._learned.spindle
            self.rows = max(round(self._learned.window * models.rate), 1)
        self.forget()

    def forget(self) -> None:
        """Resets the learned deviation: only the physical model remains."""
        self.correction[:] = 0.0, 0.0, EXTRAPOLATED

    def take(self, windows: Records) -> None:
        """Takes the sums over a whole window (1,), see ``window_dtype``."""
        if self._learned is None:
            return
        model, sums = self._learned.model, windows[0]
        peak, push = peaks(sums, self.turn)
        force = sums["force"] / sums["rows"]
        window = WindowSet(
            passes=(_NAME,),
            joints=sums["joints"][None] / sums["rows"],
            force=force[None],
            force_peak=np.array([push]),
            force_mean=np.array([force @ self.direction]),
            predicted=np.array([peak]),
            measured=np.array([np.nan]),
        )
        found = model.predict(window)
        if found.standing[0] == WindowTrust.INVALID:
            self.correction[:] = 0.0, 0.0, INVALID
            return
        terms = model.by_sample
        gain = terms.gain * (window.predicted[0] - terms.gain_at)
        self.correction[0] = found.deviation[0] - found.physics[0] + gain
        self.correction[1] = found.sd[0] ** 2
        self.correction[2] = float(found.standing[0])


def peaks(sums: np.record, turn: float) -> tuple[float, float]:
    """Returns mean peak of displacement (m) and force (N) over the whole turns of a window.

    As :func:`robotrue.dynamics.windows.peaks_per_turn`: a turn started at the end does not count.
    """
    turns, bent, pushed = (float(sums[name]) for name in ("turns", "peaks", "force_peaks"))
    if turns == 0.0 or sums["seen"] / turn + _WHOLE >= turns + 1.0:
        bent, pushed = bent + float(sums["turn_peak"]), pushed + float(sums["turn_force"])
        turns += 1.0
    return bent / turns, pushed / turns


@compile_kernel(EXACT)
def clear_window(window: np.record) -> None:
    """Sets the sums over a window to zero."""
    window.rows = window.turn_peak = window.turn_force = window.peaks = 0.0
    window.force_peaks = window.turns = window.seen = 0.0
    window.force[:], window.joints[:] = 0.0, 0.0


@compile_kernel(EXACT)
def add_peak(bent: float, pushed: float, turn: float, window: np.record) -> None:
    """Adds a sample to the peaks per turn of the spindle in the window, as ``peaks_per_turn``."""
    seen, turns = window.seen, window.turns
    edge = np.rint(turns * turn)
    if seen >= np.rint((turns + 1.0) * turn):
        window.peaks += window.turn_peak
        window.force_peaks += window.turn_force
        window.turns = turns + 1.0
        edge = seen
    if seen == edge:
        window.turn_peak, window.turn_force = bent, abs(pushed)
    else:
        window.turn_peak = max(window.turn_peak, bent)
        window.turn_force = max(window.turn_force, abs(pushed))
    window.seen = seen + 1.0
