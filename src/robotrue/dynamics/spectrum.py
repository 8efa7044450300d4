"""What a force record holds by frequency: its density, and the lines of spindle and teeth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
import scipy.signal

from robotrue.core.arrays import Array, BoolArray
from robotrue.dynamics.force import ForceRecord
from robotrue.dynamics.frf import ComplexArray
from robotrue.errors import ConfigurationError


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


def force_density(record: ForceRecord, *, segment: float = 1.0) -> tuple[Array, Array]:
    """Returns frequencies (m,) Hz and one-sided density (m, 3) N^2/Hz, Welch's mean of segments.

    Its integral over frequency is the mean square of the force about its mean.

    Args:
        record: The force.
        segment: s; lines are one over it apart.

    Raises:
        ConfigurationError: A segment longer than the record or shorter than 16 samples.
    """
    samples = round(segment * record.rate)
    if not 16 <= samples <= len(record):
        raise ConfigurationError(
            f"segments of {segment:g} s ({samples} samples) of a record of {len(record)} samples.",
            hint="a segment between 16 samples and the whole record.",
        )
    frequency, density = scipy.signal.welch(
        record.force, fs=record.rate, nperseg=samples, axis=0, detrend="constant"
    )
    return np.asarray(frequency), np.asarray(density)


def spindle_lines(
    record: ForceRecord, *, spindle: float, teeth: int, highest: float | None = None
) -> SpindleLines:
    """Returns the force at all multiples of the spindle's frequency.

    Over a whole number of turns, where the lines do not leak into each other.

    Args:
        record: The force, steady.
        spindle: rev/s.
        teeth: Number of teeth.
        highest: Hz; default: half the sampling rate.

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
    top = min(highest or np.inf, record.rate / 2.0)
    order = np.arange(1, int(np.floor(top / spindle)) + 1)
    order = order[order * spindle < record.rate / 2.0 * (1.0 - 1e-9)]
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
