"""From hits of a hammer to a frequency response: H1 over all good hits, with its coherence.

::

    H1 = S_xf / S_ff,    coherence = |S_xf|^2 / (S_xx S_ff)

H1 takes the noise of the response out and leaves that of the force in. Source: Bendat and Piersol
2010, Random Data, 4th ed., ch. 6; windows after Ewins 2000, Modal Testing, 2nd ed., ch. 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import scipy.fft

from robotrue.core.arrays import Array
from robotrue.core.provenance import merge
from robotrue.dynamics.frf import FORMS, ComplexArray, FrequencyResponse
from robotrue.dynamics.frf_checks import (
    BLIND_BELOW,
    AxisPairCurves,
    assemble_response,
    coherent_band,
)
from robotrue.dynamics.hits import SECOND, HammerRecord, check_sensors, find_hits
from robotrue.dynamics.modal import ModalModel
from robotrue.errors import ImplausibleDataError, ModelMismatchError, ObservabilityError, ShapeError

_CUT_SHORT: Final = 0.5
"""Part of the shortest time between hits below which the last hit is left out."""
_BEFORE: Final = 0.01
"""Part of a segment that lies before the hit."""
_PULSE: Final = 3.0
"""Lengths of the pulse after which the force window closes."""
_DECAYED: Final = 0.08
"""Part of its beginning that the motion may be at the end of a segment without a window."""
_WINDOW: Final = 0.05
"""End of the exponential window where one is needed."""
_STRONG: Final = 0.05
"""Part of the largest power of the displacement at which a line shows a mode ringing."""
_POWER: Final = 1e-2
"""Part of the hammer's largest power below which it excites nothing (20 dB)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HammerResult:
    """One axis of excitation, evaluated.

    Attributes:
        frequency: (m,) Hz from 0 on.
        response: (m, r) in ``form``.
        coherence: (m, r) or None: one hit is always coherent with itself.
        record: Its source.
        hits: Samples at which the used hits begin.
        left_out: Sample and reason of every hit that was not used.
        valid: Hz, where the hammer had power and the response followed it.
        added_damping: 1/s, what the exponential window adds to -Re of every pole.
    """

    frequency: Array
    response: ComplexArray
    coherence: Array | None
    record: HammerRecord
    hits: tuple[int, ...]
    left_out: tuple[tuple[int, str], ...]
    valid: tuple[float, float]
    added_damping: float

    @property
    def duration(self) -> float:
        """Length of a segment, s."""
        return 2.0 * (len(self.frequency) - 1) / self.record.rate


def evaluate_hits(
    record: HammerRecord, *, duration: float | None = None, window: float | None = None
) -> HammerResult:
    """Returns H1 and coherence over all good hits of a record.

    Args:
        record: As recorded; any number of hits.
        duration: s of a segment; default: up to the next hit, at most 4 s.
        window: Part of its beginning that the exponential window has fallen to at the end of a
            segment; default: none where the motion has decayed by itself, else 0.05.

    Raises:
        ImplausibleDataError: No hit, all of them double, a clipped hammer or sensor, a sensor that
            does not move.
    """
    check_sensors(record)
    hits, left_out = find_hits(record)
    count = _segment(record, [*hits, *(at for at, _ in left_out)], duration)
    whole = [at for at in hits if at - _lead(count) + count <= len(record.force)]
    left_out = left_out + tuple((at, "cut off") for at in hits if at not in whole)
    if not whole:
        raise ImplausibleDataError(
            "no whole hit: " + ", ".join(f"sample {at}: {why}" for at, why in left_out) + ".",
            source=record.source,
            hint="hit once, let it ring, hit again; record two seconds after the last.",
        )
    forces, motions = _segments(record, whole, count)
    rung = _compare_last_quarter(motions, record)
    end = window if window is not None else (1.0 if rung < _DECAYED else _WINDOW)
    if not 0.0 < end <= 1.0:
        raise ShapeError(f"window of {end:g} at its end, expected above 0 and at most 1.")
    decay = abs(np.log(end)) / (count / record.rate)
    fade = np.exp(-decay * (np.arange(count) - _lead(count)) / record.rate)
    frequency = scipy.fft.rfftfreq(count, 1.0 / record.rate)
    response, coherence, power = _average(forces * fade, motions * fade[:, None])
    return HammerResult(
        frequency=frequency,
        response=response,
        coherence=coherence,
        record=record,
        hits=tuple(whole),
        left_out=left_out,
        valid=_band(record, frequency, power, coherence),
        added_damping=float(decay),
    )


def evaluate_together(
    records: Sequence[HammerRecord], *, duration: float | None = None, window: float | None = None
) -> list[HammerResult]:
    """Returns the results of records of several axes, all with segments and window of one kind.

    Args:
        records: One per axis hit.
        duration: s; default: what the record with the closest hits allows.
        window: As ``evaluate_hits``; default: none, unless one record needs it.

    Raises:
        ImplausibleDataError: As ``evaluate_hits``.
    """
    results = [evaluate_hits(r, duration=duration, window=window) for r in records]
    shortest = min(r.duration for r in results)
    if window is None:
        window = _WINDOW if any(r.added_damping > 0.0 for r in results) else 1.0
    return [
        r
        if r.duration == shortest and (r.added_damping > 0.0) == (window < 1.0)
        else evaluate_hits(r.record, duration=shortest, window=window)
        for r in results
    ]


def combine_axes(results: Sequence[HammerResult]) -> FrequencyResponse:
    """Returns one response of hits along one, two or three axes.

    Raises:
        ModelMismatchError: An axis twice, other sensors, spectra or windows.
        ImplausibleDataError: Numbers that cannot be (``frf_checks.check_response``).
        ObservabilityError: No band in common.
    """
    first = results[0]  # a hit does not determine the line at 0 Hz
    response: dict[str, ComplexArray] = {}
    coherence: dict[str, Array] = {}
    for one in results:
        _check_alike(first, one)
        for k, axis in enumerate(one.record.response_axes):
            pair = axis + one.record.excitation_axis
            if pair in response:
                raise ModelMismatchError(
                    f"{pair} is measured twice.",
                    source=one.record.source,
                    hint="one file per axis.",
                )
            response[pair] = one.response[1:, k]
            if one.coherence is not None:
                coherence[pair] = one.coherence[1:, k]
    valid = max(r.valid[0] for r in results), min(r.valid[1] for r in results)
    if not valid[0] < valid[1]:
        raise ObservabilityError(
            f"no band in common: from {valid[0]:g} to {valid[1]:g} Hz.",
            hint="hit with the same tip along all axes.",
        )
    pairs = AxisPairCurves(form=first.record.form, response=response, coherence=coherence)
    names = ", ".join(r.record.source for r in results)
    return assemble_response(
        first.frequency[1:],
        pairs,
        source=names,
        provenance=merge(r.record.provenance for r in results),
        valid=valid,
    )


def without_window(model: ModalModel, added_damping: float) -> ModalModel:
    """Returns modes without the damping of the exponential window.

    Args:
        model: Fitted to a response that was measured with the window.
        added_damping: 1/s, of the ``HammerResult``.

    Raises:
        ImplausibleDataError: A mode had no damping beyond the window's.
    """
    poles = model.poles + added_damping
    if (poles.real >= 0.0).any():
        k = int(np.argmax(poles.real))
        raise ImplausibleDataError(
            f"the mode at {model.frequency[k]:.4g} Hz decays more slowly than the window alone.",
            source=model.source,
            hint="longer segments and a weaker window.",
        )
    return replace(model, poles=poles)


def _lead(count: int) -> int:
    return max(2, round(_BEFORE * count))


def _segment(record: HammerRecord, hits: list[int], duration: float | None) -> int:
    """Samples of a segment."""
    if duration is not None:
        count = round(duration * record.rate)
    else:
        starts = sorted(hits)
        gaps = np.diff([*starts, len(record.force)])
        # A record that ends soon after its last hit loses that hit, not the length of all.
        if len(gaps) > 1 and gaps[-1] < _CUT_SHORT * gaps[:-1].min():
            gaps = gaps[:-1]
        count = int(min(gaps.min() / (1.0 + _BEFORE), 4.0 * record.rate))
    if count < 64:
        raise ImplausibleDataError(
            f"segments of {count} samples, expected 64 or more.",
            source=record.source,
            hint="leave more time between the hits.",
        )
    return int(count - count % 2)


def _segments(record: HammerRecord, hits: list[int], count: int) -> tuple[Array, Array]:
    """Force (h, count) N and motion (h, count, r) of each hit; at rest before it, zero after it."""
    lead = _lead(count)
    forces, motions = np.zeros((len(hits), count)), []
    for row, at in enumerate(hits):
        before = slice(max(0, at - lead), max(1, at - 1))
        force = record.force[max(0, at - lead) : at - lead + count]
        force = force - np.median(record.force[before])
        over = force > SECOND * force.max()
        pulse = int(np.flatnonzero(over)[-1]) - lead
        open_ = min(count, lead + round(_PULSE * max(4, pulse)))
        forces[row, lead - min(lead, at) :][:open_] = force[:open_]
        motion = np.zeros((count, record.motion.shape[1]))
        part = record.motion[max(0, at - lead) : at - lead + count]
        motion[lead - min(lead, at) :][: len(part)] = part - record.motion[before].mean(axis=0)
        motions.append(motion)
    return forces, np.array(motions)


def _average(forces: Array, motions: Array) -> tuple[ComplexArray, Array | None, Array]:
    """H1 (m, r), coherence (m, r) or None and mean power of the force (m,) over all hits."""
    force, motion = scipy.fft.rfft(forces, axis=1), scipy.fft.rfft(motions, axis=1)
    power = (np.abs(force) ** 2).mean(axis=0)
    cross = (motion * force.conj()[:, :, None]).mean(axis=0)
    coherence = None
    if len(forces) > 1:
        moved = (np.abs(motion) ** 2).mean(axis=0)
        coherence = np.abs(cross) ** 2 / np.maximum(moved * power[:, None], 1e-300)
    response = cross / np.maximum(power, 1e-300)[:, None]
    return np.asarray(response, dtype=np.complex128), coherence, power


def _compare_last_quarter(motions: Array, record: HammerRecord) -> float:
    """Rms displacement of the last quarter of the segments over that of the first.

    Of the displacement: in an acceleration the slow modes, which ring longest, are hardly seen.
    """
    quarter = motions.shape[1] // 4
    frequency = scipy.fft.rfftfreq(quarter, 1.0 / record.rate)
    seen = frequency >= BLIND_BELOW
    factor = (2.0 * np.pi * frequency[seen]) ** -FORMS[record.form]
    taper = np.hanning(quarter)[:, None]
    power = [
        ((np.abs(scipy.fft.rfft(part * taper, axis=1)[:, seen]) * factor[:, None]) ** 2).sum(
            axis=(0, 2)
        )
        for part in (motions[:, :quarter], motions[:, -quarter:])
    ]
    strong = power[0] >= _STRONG * power[0].max()  # elsewhere noise would pass for ringing
    return float(np.sqrt(power[1][strong].sum() / max(power[0][strong].sum(), 1e-300)))


def _band(
    record: HammerRecord, frequency: Array, power: Array, coherence: Array | None
) -> tuple[float, float]:
    low = 2.0 * frequency[1]
    if record.form != "receptance":
        low = max(low, BLIND_BELOW)
    strong = power >= _POWER * power[1:].max()
    weak = np.flatnonzero(~strong & (frequency > low))
    high = float(frequency[weak[0] - 1]) if weak.size else float(frequency[-1])
    if coherence is not None:
        # The axis that was hit decides: cross pairs are small and their coherence with them.
        axes = record.response_axes
        direct = [k for k, axis in enumerate(axes) if axis == record.excitation_axis]
        ends = [coherent_band(frequency, coherence[:, k]) for k in direct or range(len(axes))]
        low = max(low, min(e[0] for e in ends))
        high = min(high, max(e[1] for e in ends))
    if not low < high:
        raise ObservabilityError(
            f"no excitation between {low:g} and {high:g} Hz.",
            source=record.source,
            hint="a heavier hammer with a softer tip for a robot, a lighter one for the tool.",
        )
    return float(low), float(high)


def _check_alike(first: HammerResult, one: HammerResult) -> None:
    same = (
        one.record.form == first.record.form
        and np.array_equal(one.frequency, first.frequency)
        and abs(one.added_damping - first.added_damping) < 1e-9 * (1.0 + first.added_damping)
    )
    if not same:
        raise ModelMismatchError(
            f"another sensor, spectrum or window than in {first.record.source}: "
            f"{one.record.form}, {len(one.frequency)} lines, {one.added_damping:.3g} 1/s.",
            source=one.record.source,
            hint="one rate, one kind of sensor, one duration and window for all records.",
        )
