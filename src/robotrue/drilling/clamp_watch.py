"""Detects clamps in a stream of machine values: the foot is on the skin and at rest.

Named values of a foot: ``d1_mm, d2_mm, ...`` (less their zero), or ``raw1_mm, ...`` or
``raw1_counts, ...`` with the foot's zero; ``force_N``, ``z_mm``, and ``A_deg, B_deg`` as the
machine counts its axes; optionally ``X_mm, Y_mm``. Of a reference: ``left_a_deg, left_b_deg``.

A clamp begins when the force rises above ``force_on``. It is recorded once, as the mean over the
first ``quiet`` seconds in which no reading and no force moves by more than stated, and ends when
the force falls below ``force_off``. A clamp that does not come to rest in time is reported as such,
not averaged.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.campaign import Clamps
from robotrue.drilling.campaign_csv import (
    FORMS,
    FORMS_HINT,
    LEFT,
    PLACE,
    STEEPEST,
    readings_less_zero,
)
from robotrue.drilling.drill_defaults import (
    CLAMP_FORCE_N,
    PATIENCE_S,
    QUIET_MS,
    RELEASED,
    STEADY_N,
    STEADY_UM,
)
from robotrue.drilling.foot_file import FootSetup
from robotrue.errors import ConfigurationError, FormatError, ImplausibleDataError, ShapeError

LEAST: Final = 5
"""Fewest samples of a mean."""
SIMULATED: Final = "simulated"
"""Name of the value that marks a simulated machine; not 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampSettings:
    """When a foot counts as clamped and at rest.

    Attributes:
        force_on: N, above which a clamp begins.
        force_off: N, below which it has ended.
        quiet: s in which nothing may move.
        reading_moves: m, peak to peak of each reading in that time.
        force_moves: N, likewise of the force.
        axes_move: rad, likewise of A and B.
        patience: s from the start of a clamp until it is abandoned.
        gap: s without a sample after which the quiet time restarts.
    """

    force_on: float = CLAMP_FORCE_N
    force_off: float = RELEASED * CLAMP_FORCE_N
    quiet: float = QUIET_MS * 1e-3
    reading_moves: float = STEADY_UM * UM
    force_moves: float = STEADY_N
    axes_move: float = 2e-3 * DEG
    patience: float = PATIENCE_S
    gap: float = 0.1

    def __post_init__(self) -> None:
        """Checks signs and order."""
        numbers = (
            self.quiet, self.reading_moves, self.force_moves, self.axes_move, self.gap,
            self.force_off,
        )  # fmt: skip
        if not (all(v > 0.0 for v in numbers) and self.force_on > self.force_off):
            raise ConfigurationError(
                f"clamp from {self.force_on:g} N to {self.force_off:g} N, quiet for "
                f"{self.quiet:g} s; expected all above 0 and the force that begins a clamp above "
                "the one that ends it."
            )
        if not self.patience > self.quiet:
            raise ConfigurationError(
                f"patience of {self.patience:g} s, expected more than the {self.quiet:g} s of rest."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class FootSample(Columns):
    """Readings and axes of the foot at one time.

    Attributes:
        time: s, of a clock that does not go back.
        readings: (k,) m, less their zero.
        force: N.
        height: m, of the Z axis.
        axes: (2,) rad, A and B as the machine counts them; 0 where a robot carries the foot.
        place: (2,) m, X and Y of the machine; NaN where it does not send them.
    """

    time: float
    readings: Annotated[Array, Column("k", unit="m")]
    force: float
    height: float
    axes: Annotated[Array, Column("2", unit="rad")]
    place: Annotated[Array, Column("2", unit="m", nan=True, fill=np.nan)] = EMPTY

    def _check_rules(self) -> None:
        """A sample that is not finite is for the caller to leave out."""
        if not np.isfinite([self.time, self.force, self.height]).all():
            raise ShapeError(
                f"time {self.time:g} s, force {self.force:g} N, height {self.height:g} m; expected "
                "finite numbers."
            )


class Seen(Enum):
    """Effects of a sample."""

    NOTHING = "nothing"
    BEGUN = "begun"
    TAKEN = "taken"
    RESTLESS = "restless"
    """It did not come to rest in time."""
    ENDED = "ended"


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampEvent:
    """Detected event and its clamps.

    Attributes:
        seen: It.
        clamps: One clamp, means over the rest, where ``seen`` is ``TAKEN``.
        axes: (2,) rad, A and B in that time.
        said: The value that moved and its change, where ``seen`` is ``RESTLESS``.
    """

    seen: Seen
    clamps: Clamps | None = None
    axes: Array = field(default_factory=lambda: np.zeros(2))
    said: str = ""


_NOTHING: Final = ClampEvent(seen=Seen.NOTHING)


class ClampWatch:
    """The state from sample to sample.

    Args:
        settings: When a foot counts as clamped and at rest.
        approach: How this cell brings its foot down, as the campaign names it.
    """

    def __init__(self, settings: ClampSettings, *, approach: str = "") -> None:
        self._settings, self._approach = settings, approach
        self._rest: deque[FootSample] = deque()
        self._latest = -np.inf
        self._begun: float | None = None
        self._told = False

    def push(self, sample: FootSample) -> ClampEvent:
        """Returns what a sample brought about.

        A sample that is not newer than the one before is left out.

        Raises:
            ShapeError: Another number of sensors within one clamp.
        """
        if not sample.time > self._latest:
            return _NOTHING
        if sample.time - self._latest > self._settings.gap:
            self._rest.clear()
        self._latest = sample.time
        if self._begun is None:
            if sample.force < self._settings.force_on:
                return _NOTHING
            self._begun, self._told = sample.time, False
            self._rest.clear()
            self._rest.append(sample)
            return ClampEvent(seen=Seen.BEGUN)
        if sample.force < self._settings.force_off:
            self._begun = None
            return ClampEvent(seen=Seen.ENDED)
        return _NOTHING if self._told else self._resting(sample, self._begun)

    def broken(self) -> None:
        """Discards the samples at rest so far: a sample was bad or is missing."""
        self._rest.clear()

    def _resting(self, sample: FootSample, begun: float) -> ClampEvent:
        rest, settings = self._rest, self._settings
        rest.append(sample)
        # the oldest is dropped when the others still fill the time
        while len(rest) > 1 and sample.time - rest[1].time >= settings.quiet:
            rest.popleft()
        full = sample.time - rest[0].time >= settings.quiet and len(rest) >= LEAST
        moving = self._moving() if full else ""
        if full and not moving:
            self._told = True
            return ClampEvent(seen=Seen.TAKEN, clamps=self._mean(), axes=_mean_axes(rest))
        if sample.time - begun > settings.patience:
            self._told = True
            said = moving or f"only {len(rest)} good samples in {settings.quiet:g} s"
            return ClampEvent(seen=Seen.RESTLESS, said=said)
        return _NOTHING

    def _moving(self) -> str:
        """Returns the value that moves most while the foot should rest; empty if none does."""
        force = np.array([s.force for s in self._rest])
        if np.ptp(force) > self._settings.force_moves:
            return f"the clamp force moves by {np.ptp(force):.1f} N"
        span = np.ptp(np.array([s.readings for s in self._rest]), axis=0)
        worst = int(np.argmax(span))
        if span[worst] > self._settings.reading_moves:
            return f"sensor {worst + 1} moves by {span[worst] / MM:.4f} mm"
        turned = float(np.ptp(np.array([s.axes for s in self._rest]), axis=0).max())
        if turned > self._settings.axes_move:
            return f"the axes A and B turn by {turned / DEG:.4f} deg"
        return ""

    def _mean(self) -> Clamps:
        return Clamps(
            readings=np.mean([s.readings for s in self._rest], axis=0)[None],
            force=np.array([np.mean([s.force for s in self._rest])]),
            height=np.array([np.mean([s.height for s in self._rest])]),
            approach=(self._approach,),
            place=np.mean([s.place for s in self._rest], axis=0)[None],
            axes=_mean_axes(self._rest)[None],
        )


def _mean_axes(rest: deque[FootSample]) -> Array:
    return np.asarray(np.mean([s.axes for s in rest], axis=0))


def is_reference(values: Mapping[str, float]) -> bool:
    """Returns whether values are what a reference found, not what a foot reads."""
    return any(name in values for name in LEFT)


def foot_sample(
    values: Mapping[str, float], setup: FootSetup, time: float, *, head: bool = True
) -> FootSample:
    """Returns the sample of a foot.

    Args:
        values: By name, in the units of their names.
        setup: Number of sensors, and their zero where readings are raw.
        time: s, of a clock that does not go back.
        head: Whether a head's axes turn the foot; not where a robot carries it.

    Raises:
        FormatError: A value is missing, or readings come in two forms.
        ConfigurationError: Raw readings without the foot's zero.
    """
    sensors = range(1, len(setup.foot.radius) + 1)
    forms = [form for form in FORMS if form.format(1) in values]
    if len(forms) != 1:
        raise FormatError(
            f"{'several forms of' if forms else 'no'} readings among {', '.join(values)}.",
            hint=FORMS_HINT,
        )
    raw = _select_values(values, tuple(forms[0].format(k) for k in sensors))
    if (beyond := forms[0].format(len(sensors) + 1)) in values:
        raise FormatError(
            f"{beyond} of a machine with more sensors than the {len(sensors)} of the foot.",
            hint="the foot file, and the model, of this machine.",
        )
    force, height = _select_values(values, ("force_N", "z_mm"))
    return FootSample(
        time=time,
        readings=readings_less_zero(raw[None], forms[0], setup)[0],
        force=float(force),
        height=float(height * MM),
        axes=_select_values(values, ("A_deg", "B_deg")) * DEG if head else np.zeros(2),
        place=np.array([values.get(name, np.nan) for name in PLACE]) * MM,
    )


def read_reference_tilt(values: Mapping[str, float]) -> Array:
    """Returns the tilt (2,) rad that a reference found after a move.

    Raises:
        FormatError: One of the two is missing.
        ImplausibleDataError: Tilts that are not left by any move.
    """
    left = _select_values(values, LEFT)
    if np.abs(left).max() > STEEPEST:
        raise ImplausibleDataError(
            f"a reference of {left[0]:g}, {left[1]:g} deg, up to {STEEPEST:g} deg is possible."
        )
    return left * DEG


def _select_values(values: Mapping[str, float], names: tuple[str, ...]) -> Array:
    missing = [name for name in names if name not in values]
    if missing:
        raise FormatError(
            f"{', '.join(missing)} is missing; there are {', '.join(values) or 'no values'}."
        )
    return np.array([values[name] for name in names])
