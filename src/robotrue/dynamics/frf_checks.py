"""From measured curves to one frequency response that can be what it claims.

Form, band and static line of the response, its checks, and what to know before using it.

The laws are those of :mod:`robotrue.dynamics.response_physics`, and Maxwell's: G_ij = G_ji.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.dynamics.frf import AXES, COHERENT, ComplexArray, FrequencyResponse, in_form
from robotrue.dynamics.response_physics import (
    check_cross,
    check_direct,
    check_size,
    check_static,
    check_swapped,
)
from robotrue.errors import FormatError, ImplausibleDataError

BLIND_BELOW: Final = 4.0
"""Hz below which accelerometers of hammer tests see noise and not motion (3 to 5 by sensor)."""
RECIPROCAL: Final = 0.1
"""Part of the larger by which two reciprocal receptances may differ without a remark."""
_ROUNDING: Final = 1e-3
"""Beyond 0 and 1, of a printed coherence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisPairCurves:
    """Curves by pair of axes, response first.

    Attributes:
        form: Receptance, mobility or accelerance, of all.
        response: "xx" and so on to (m,), in the SI unit of the form.
        coherence: The same pairs to (m,) 0..1; may be empty.
    """

    form: str
    response: Mapping[str, ComplexArray]
    coherence: Mapping[str, Array] = field(default_factory=dict)


def assemble_response(
    frequency: Array,
    pairs: AxisPairCurves,
    *,
    source: str,
    provenance: Provenance = MEASURED,
    valid: tuple[float, float] | None = None,
) -> FrequencyResponse:
    """Returns one response of all curves, as receptance, checked.

    A line at 0 Hz of a receptance is its static deflection; of the other forms it is dropped. Data
    of an accelerometer are valid from 4 Hz on, and so is a receptance that grows towards 0 Hz like
    integrated noise; anything else from its first line.

    Args:
        frequency: (m,) Hz.
        pairs: The curves.
        source: Of messages.
        provenance: Simulated or measured, and the files.
        valid: Hz, valid band, where it is known.

    Raises:
        FormatError: Fewer than eight lines.
        ImplausibleDataError: Numbers that contradict their stated form (:func:`check_response`).
    """
    moving = int((frequency > 0.0).sum())
    if moving < 8:
        raise FormatError(f"{moving} lines above 0 Hz, expected eight or more.", source=source)
    out, into = (tuple(a for a in AXES if a in {p[k] for p in pairs.response}) for k in (0, 1))
    shape = (len(frequency), len(out), len(into))
    raw = np.zeros(shape, dtype=np.complex128)
    coherence = np.ones(shape) if pairs.coherence else None
    present = np.zeros(shape[1:], dtype=np.bool_)
    for pair, values in pairs.response.items():
        i, j = out.index(pair[0]), into.index(pair[1])
        raw[:, i, j], present[i, j] = values, True
        if coherence is not None and pair in pairs.coherence:
            coherence[:, i, j] = _coherence(pair, pairs.coherence[pair], source)
    static = None
    if frequency[0] == 0.0:
        if pairs.form == "receptance":
            static = raw[0].real.copy()
        else:
            frequency, raw = frequency[1:], raw[1:]
            coherence = None if coherence is None else coherence[1:]
    response = in_form(raw, frequency, pairs.form, "receptance")
    low = 0.0 if static is not None else float(frequency[0])
    direct = (response[:, out.index(a), into.index(a)] for a in out if a + a in pairs.response)
    blind = static is None and any(diverges_below(frequency, curve) for curve in direct)
    if pairs.form != "receptance" or blind:
        low = max(low, BLIND_BELOW)
    found = FrequencyResponse(
        frequency=frequency,
        response=response,
        response_axes=out,
        excitation_axes=into,
        present=present,
        coherence=coherence,
        valid=valid or (low, float(frequency[-1])),
        measured_as=pairs.form,
        static=static,
        source=source,
        provenance=provenance,
    )
    check_response(found)
    return found


def _coherence(pair: str, values: Array, source: str) -> Array:
    if values.min() < -_ROUNDING or values.max() > 1.0 + _ROUNDING:
        raise ImplausibleDataError(
            f"coherence C{pair} goes from {values.min():.3g} to {values.max():.3g}, expected 0 to "
            "1.",
            source=source,
            hint="export the coherence, not a spectrum or per cent.",
        )
    return np.asarray(np.clip(values, 0.0, 1.0))


def check_response(frf: FrequencyResponse) -> None:
    """Returns nothing; raises where the numbers cannot be receptances of these axes.

    Raises:
        ImplausibleDataError: An accelerance or mobility taken for a receptance, a flipped or
            swapped axis, a wrong sign of time, another unit, a static value that does not fit.

    Fails when: only cross pairs were measured, or the damping is lost in noise or between the
    lines: a flipped axis then looks like a sound one. Accelerances and mobilities are found.
    """
    for pair in frf.pairs:
        check_static(frf, pair)
    check_swapped(frf)
    for axis in frf.response_axes:
        if axis + axis in frf.pairs:
            check_direct(frf, axis)
    band = frf.in_band
    for pair in frf.pairs:
        if pair[0] != pair[1]:
            check_cross(frf, pair)
        check_size(pair, frf.frequency[band], frf.pair(pair[0], pair[1])[band], frf.source)
    _check_cross_signs(frf)


def response_remarks(frf: FrequencyResponse) -> tuple[str, ...]:
    """Returns remarks for users of the response, one sentence each."""
    said = []
    low, high = frf.valid
    if frf.static is None or np.isnan(frf.static[frf.present]).any():
        guessed = "static deflection" if frf.static is None else "static deflection of some pairs"
        said.append(
            f"no data below {low:g} Hz: the {guessed} is a guess from the lowest lines "
            "until a static load test gives it"
        )
    out, into = frf.response_axes, frf.excitation_axes
    absent = [a + b for a in out for b in into if a + b not in frf.pairs]
    absent += [a + a for a in ("x", "y", "z") if a not in out and a in into]
    if absent:
        said.append(f"unmeasured pairs are set to zero: {', '.join(absent)}")
    for pair, difference in reciprocity(frf).items():
        if difference > RECIPROCAL:
            said.append(
                f"G{pair} and G{pair[::-1]} differ by {100.0 * difference:.0f} % (reciprocity): "
                "sensor and hammer were not on the same point, or one axis is off"
            )
    poor = incoherent_share(frf)
    if poor > 0.05:
        said.append(
            f"{100.0 * poor:.0f} % of the lines between {low:g} and {high:g} Hz have a coherence "
            f"below {COHERENT} where the tool was hit"
        )
    return tuple(said)


def reciprocity(frf: FrequencyResponse) -> dict[str, float]:
    """Returns, per pair of axes measured both ways, the rms difference over the rms of both.

    Over the lines that are coherent both ways.
    """
    return {pair: _rms(one - two) / size for pair, one, two, size in _mutual_pairs(frf)}


def _mutual_pairs(
    frf: FrequencyResponse,
) -> Iterator[tuple[str, ComplexArray, ComplexArray, float]]:
    """Pairs of axes measured both ways, the lines coherent both ways of each, and their rms."""
    for pair in frf.pairs:
        back = pair[::-1]
        if pair[0] < pair[1] and back in frf.pairs:
            band = frf.in_band & frf.is_coherent(pair) & frf.is_coherent(back)
            one, two = frf.pair(*pair)[band], frf.pair(*back)[band]
            size = _rms(np.concatenate([one, two])) if band.any() else 0.0
            if size > 0.0:
                yield pair, one, two, size


def _rms(values: ComplexArray) -> float:
    return float(np.sqrt((np.abs(values) ** 2).mean()))


def coherent_band(frequency: Array, coherence: Array) -> tuple[float, float]:
    """Returns the lowest and highest Hz between which coherence is mostly good.

    Antiresonances have no coherence and do not end the band: the ends are where, seen from the
    outside, the first run of lines with a median of at least ``COHERENT`` begins.

    Args:
        frequency: (m,) Hz.
        coherence: (m,) 0..1.

    Raises:
        ImplausibleDataError: No such run.
    """
    width = 3
    median = np.array(
        [np.median(coherence[max(0, i - width) : i + width + 1]) for i in range(len(frequency))]
    )
    good = np.flatnonzero((median >= COHERENT) & (frequency > 0.0))
    if not good.size:
        raise ImplausibleDataError(
            f"no band with a coherence of {COHERENT} or more; the best is {median.max():.2f}.",
            hint="hit harder, with a softer tip, and average five hits.",
        )
    return float(frequency[good[0]]), float(frequency[good[-1]])


def incoherent_share(frf: FrequencyResponse) -> float:
    """Returns the part of the lines in the band, 0..1, whose coherence is poor in a direct pair."""
    direct = [pair for pair in frf.pairs if pair[0] == pair[1]]
    if frf.coherence is None or not direct:
        return 0.0
    good = np.all([frf.is_coherent(pair) for pair in direct], axis=0)
    return float(1.0 - good[frf.in_band].mean())


def diverges_below(frequency: Array, direct: ComplexArray) -> bool:
    """Returns whether a curve (m,) grows towards 0 Hz like integrated noise of an accelerometer."""
    # Over the whole blind range and over its lower half: a mode in it would fall on one side only.
    for top in (1.25 * BLIND_BELOW, 0.6 * BLIND_BELOW):
        low = (frequency > 0.0) & (frequency <= top)
        if low.sum() < 4 or not np.abs(direct[low]).all():
            return False
        if np.polyfit(np.log(frequency[low]), np.log(np.abs(direct[low])), 1)[0] >= -1.0:
            return False
    return True


def _check_cross_signs(frf: FrequencyResponse) -> None:
    for pair, one, two, size in _mutual_pairs(frf):
        if _rms(one + two) / size < RECIPROCAL < _rms(one - two) / size:
            raise ImplausibleDataError(
                f"G{pair} is the negative of G{pair[::-1]}: one of the axes is flipped in one of "
                "the two tests.",
                source=frf.source,
                hint="check the direction of hammer and sensor.",
            )
