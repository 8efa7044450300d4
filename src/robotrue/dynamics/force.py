"""A record of cutting force at one clock, its checks against broken sensors, its spindle lines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.columns import Column, Columns
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.dynamics.frf import AXES, ComplexArray
from robotrue.errors import ConfigurationError, ImplausibleDataError, ShapeError

MOST: Final = 50e3
"""N; no robot mills with more. A record beyond it is in another unit."""
_COUNTS: Final = 1000.0
"""Whole numbers only, and some beyond this: counts of a converter."""
_FLAT_RUN: Final = 4
"""Samples in a row at the same extreme; twice that a sensor clipped."""
_DISTINCT: Final = 20
_STILL: Final = 200
"""Samples without any change after which a sensor that moved before has stopped."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceRecord(Columns):
    """Force on the tool, sampled evenly.

    Attributes:
        start: s, time of the first sample on the recorder's clock.
        rate: Samples per second.
        force: (n, 3) N along x, y, z, what acts **on the tool**, in the axes of the frequency
            response it is to meet.
        source: File or model it came from.
        provenance: Simulated or measured, and the file.
    """

    start: float
    rate: float
    force: Annotated[Array, Column("n 3", unit="N")]
    source: str
    provenance: Provenance = MEASURED

    def _check_rules(self) -> None:
        """Checks the values."""
        if not self.rate > 0.0:
            raise ShapeError(f"rate {self.rate:g} 1/s, expected more than zero.")

    def __len__(self) -> int:
        return len(self.force)

    @property
    def time(self) -> Array:
        """(n,) s on the recorder's clock."""
        return np.asarray(self.start + np.arange(len(self.force)) / self.rate)


def check_force(
    record: ForceRecord, line_of: Callable[[int], int] | None = None
) -> tuple[str, ...]:
    """Returns what is odd but harmless, one sentence each; an implausible sensor raises.

    Args:
        record: As read.
        line_of: Row to line of the file, for the message.

    Raises:
        ImplausibleDataError: Counts instead of newtons, clipped tops, a dead channel.

    Fails when: a channel is dead but noisy, or clips outside the record's largest values.
    """
    force = record.force
    remarks = []
    if not force.any():
        raise _build_refusal(
            record, 0, line_of, "all forces are zero: was the sensor connected?", "the cable"
        )
    for axis, values in zip(AXES, force.T, strict=True):
        if not values.any():
            remarks.append(f"f{axis} is zero throughout: assumed to be no force")
            continue
        row = int(np.argmax(np.abs(values)))
        top = float(values[row])
        if abs(top) > MOST:
            what = f"f{axis} reaches {top:.4g} N, expected at most {MOST:g}."
            raise _build_refusal(record, row, line_of, what, "the unit: counts, mN or mV are not N")
        if abs(top) > _COUNTS and (values == np.rint(values)).all():
            what = f"f{axis} holds whole numbers up to {top:g}: counts of a converter, not newtons."
            raise _build_refusal(record, row, line_of, what, "the sensor's counts per newton")
        if len(values) > _DISTINCT and np.ptp(values) == 0.0:
            what = f"f{axis} is {top:g} N on every sample: a sensor that is not connected."
            raise _build_refusal(record, 0, line_of, what, "cable and charge amplifier")
        clipped = _find_clipping(values)
        if clipped is not None:
            what = f"f{axis} stays at exactly {values[clipped]:g} N, its extreme, again and again: "
            raise _build_refusal(
                record, clipped, line_of, what + "the sensor is saturated.", "a larger range"
            )
    whole = force[:, force.any(axis=0)]
    if (whole == np.rint(whole)).all() and len(np.unique(whole)) >= _DISTINCT:
        remarks.append("all forces are whole numbers: counts of a converter, not newtons?")
    return tuple(remarks)


def find_stuck_channels(record: ForceRecord) -> tuple[str, ...]:
    """Returns the spans where a varying channel stays at one force, one sentence each.

    A channel at zero is not a fault: the tool is in the air. One that only rises to a value, like a
    step or a ramp, is no stopped sensor, and one that only leaps between values is a synthetic
    force.
    """
    said = []
    for axis, values in zip(AXES, record.force.T, strict=True):
        change = np.diff(values)
        moved = change[change != 0.0]
        if np.count_nonzero(np.diff(np.sign(moved))) < _DISTINCT:
            continue
        edge = np.flatnonzero(np.diff(np.concatenate([[True], change != 0.0, [True]])))
        begins, ends = edge[::2], edge[1::2]
        still = ends - begins >= _STILL
        long = still & (values[begins] != 0.0)
        if long.any() and len(change) - (ends - begins)[still].sum() >= _STILL:
            k = int(np.argmax(long))
            said.append(
                f"f{axis} is exactly {values[begins[k]]:.6g} N for "
                f"{(ends[k] - begins[k]) / record.rate:.3g} s from "
                f"{record.start + begins[k] / record.rate:.6g} s on: a sensor that has stopped"
            )
    return tuple(said)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpindleLines:
    """Force at the multiples of the spindle's frequency.

    Attributes:
        frequency: (k,) Hz, the spindle's and its multiples.
        amplitude: (k, 3) N, complex; its angle counts from the first sample as a cosine.
        is_tooth: (k,) true at multiples of the tooth-passing frequency; the others are runout.
        mean: (3,) N.
        tooth_share: Part, 0..1, of the mean square about the mean that lies on tooth lines.
        runout_share: The same of the other spindle lines.
    """

    frequency: Array
    amplitude: ComplexArray
    is_tooth: BoolArray
    mean: Array
    tooth_share: float
    runout_share: float


def spindle_lines(record: ForceRecord, *, spindle: float, teeth: int) -> SpindleLines:
    """Returns the force at all multiples of the spindle's frequency.

    Over a whole number of turns, where the lines do not leak into each other.

    Args:
        record: The force, steady.
        spindle: rev/s.
        teeth: Number of teeth.

    Raises:
        ConfigurationError: Less than two turns, or a spindle faster than half the rate.
    """
    turns = int(len(record) * spindle / record.rate)
    if turns < 2 or not spindle < record.rate / 2.0:
        raise ConfigurationError(
            f"{turns} turns of {spindle:g} rev/s in {len(record) / record.rate:g} s, expected two "
            "or more at less than half the sampling rate."
        )
    count = round(turns * record.rate / spindle)
    force = record.force[:count]
    mean = force.mean(axis=0)
    order = np.arange(1, int(np.floor(record.rate / 2.0 / spindle)) + 1)
    order = order[order * spindle < record.rate / 2.0 * (1.0 - 1e-9)]
    import scipy.fft  # here alone: the process that answers a robot reads this file, too

    lines = scipy.fft.rfft(force - mean, axis=0)[order * turns]
    amplitude = np.asarray(2.0 / count * lines, dtype=np.complex128)
    is_tooth = order % teeth == 0
    power = (np.abs(amplitude) ** 2).sum(axis=1) / 2.0
    whole = float(((force - mean) ** 2).sum(axis=1).mean())
    share = [float(power[which].sum() / max(whole, 1e-300)) for which in (is_tooth, ~is_tooth)]
    return SpindleLines(
        frequency=np.asarray(order * spindle, dtype=np.float64),
        amplitude=amplitude,
        is_tooth=is_tooth,
        mean=mean,
        tooth_share=share[0],
        runout_share=share[1],
    )


def _find_clipping(values: Array) -> int | None:
    """First sample of two or more flat tops, or None.

    Zero is no top: between the teeth there is no force. Neither is the plateau of a signal of a
    few values, like a step.
    """
    for extreme in (values.max(), values.min()):
        if extreme == 0.0:
            continue
        at = np.concatenate([[False], values == extreme, [False]])
        edge = np.flatnonzero(np.diff(at.astype(np.int8)))
        long = (edge[1::2] - edge[::2]) >= _FLAT_RUN
        if long.sum() >= 2 and len(np.unique(values[: 200 * _DISTINCT])) >= _DISTINCT:
            return int(edge[::2][long][0])
    return None


def _build_refusal(
    record: ForceRecord, row: int, line_of: Callable[[int], int] | None, what: str, check: str
) -> ImplausibleDataError:
    return ImplausibleDataError(
        what if line_of is not None else f"sample {row}: {what}",
        source=record.source,
        line=None if line_of is None else line_of(row),
        hint=f"check {check}.",
    )
