"""Whether a frequency response can be what it claims: physics that no structure gets round.

A structure without motors takes energy in and gives none back. At the point that is pushed, the
displacement never leads the force: Im G_ii <= 0 (e^{+j omega t}). An accelerance has it the other
way, a mobility has Re >= 0 instead, and a pair of two different axes has no such law. Maxwell:
G_ij = G_ji.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.dynamics.frf import ComplexArray, FrequencyResponse
from robotrue.dynamics.response_size import check_size, check_static
from robotrue.errors import ImplausibleDataError

BLIND_BELOW: Final = 4.0
"""Hz below which accelerometers of hammer tests see noise and not motion (3 to 5 by sensor)."""
COHERENT: Final = 0.8
"""Least coherence of a line to be trusted."""
RECIPROCAL: Final = 0.1
"""Part of the larger by which two reciprocal receptances may differ before it is said."""
_CLEAR: Final = 0.3
_PURE: Final = 0.9
"""Part of a curve, weighed by phase, that has one sign where it has that sign by law."""
_TURNED: Final = 0.7
_SECOND_DIFFERENCE: Final = 0.6745 * 6.0**0.5
"""Median size of second differences of noise with a standard deviation of one."""
_ABOVE_NOISE: Final = 5.0
_FEWEST: Final = 3
_OUTGOING: Final = 0.05
"""Two axes of sound structures have 0.01 to 0.7, even with 10 % noise; swapped ones minus that."""
_LEAST_LOSS: Final = 1e-3
"""|sin phase| below which a line has no damping that a sign could be read from."""
_GRID_LINES: Final = 400


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
    _check_swapped(frf)
    for axis in frf.response_axes:
        if axis + axis in frf.pairs:
            _check_direct(frf, axis)
    band = in_band(frf)
    for pair in frf.pairs:
        if pair[0] != pair[1]:
            _check_cross(frf, pair)
        check_size(pair, frf.frequency[band], frf.pair(pair[0], pair[1])[band], frf.source)
    _check_cross_signs(frf)


def response_remarks(frf: FrequencyResponse) -> tuple[str, ...]:
    """Returns what whoever uses the response should know, one sentence each."""
    said = []
    low, high = frf.valid
    if frf.static is None or np.isnan(frf.static[frf.present]).any():
        guessed = "static deflection" if frf.static is None else "static deflection of some pairs"
        said.append(
            f"nothing is known below {low:g} Hz: the {guessed} is a guess from the lowest lines "
            "until a static load test gives it"
        )
    out, into = frf.response_axes, frf.excitation_axes
    absent = [a + b for a in out for b in into if a + b not in frf.pairs]
    absent += [a + a for a in ("x", "y", "z") if a not in out and a in into]
    if absent:
        said.append(f"pairs that nobody measured count as zero: {', '.join(absent)}")
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
    found = {}
    for pair in frf.pairs:
        if pair[0] < pair[1] and pair[::-1] in frf.pairs:
            band = in_band(frf) & _select_coherent(frf, pair) & _select_coherent(frf, pair[::-1])
            if not band.any():
                continue
            one, two = (frf.pair(p[0], p[1])[band] for p in (pair, pair[::-1]))
            size = np.sqrt((np.abs(one) ** 2 + np.abs(two) ** 2).mean() / 2.0)
            if size > 0.0:
                found[pair] = float(np.sqrt((np.abs(one - two) ** 2).mean()) / size)
    return found


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


def in_band(frf: FrequencyResponse) -> BoolArray:
    """Returns (m,) true where the response is to be trusted."""
    low, high = frf.valid
    return np.asarray((frf.frequency >= low) & (frf.frequency <= high) & (frf.frequency > 0.0))


def incoherent_share(frf: FrequencyResponse) -> float:
    """Returns the part of the lines in the band, 0..1, whose coherence is poor in a direct pair."""
    direct = [pair for pair in frf.pairs if pair[0] == pair[1]]
    if frf.coherence is None or not direct:
        return 0.0
    good = np.all([_select_coherent(frf, pair) for pair in direct], axis=0)
    return float(1.0 - good[in_band(frf)].mean())


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


def _select_coherent(frf: FrequencyResponse, pair: str) -> BoolArray:
    """Lines (m,) of good coherence; all where it was not measured."""
    if frf.coherence is None:
        return np.ones(len(frf.frequency), dtype=np.bool_)
    i, j = frf.response_axes.index(pair[0]), frf.excitation_axes.index(pair[1])
    return np.asarray(frf.coherence[:, i, j] >= COHERENT)


def _check_direct(frf: FrequencyResponse, axis: str) -> None:
    band = in_band(frf)
    frequency, values = frf.frequency[band], frf.pair(axis, axis)[band]
    if not values.any():
        raise ImplausibleDataError(
            f"G{axis}{axis} is zero throughout.", source=frf.source, hint="export the curve again."
        )
    phase = _phase(frequency, values)
    if phase.is_mobility or (phase.loss is not None and phase.loss < _CLEAR):
        raise ImplausibleDataError(
            f"G{axis}{axis}: {_diagnosis(axis, frequency, values, phase)}",
            source=frf.source,
            hint="name the form in the column's unit, or correct the sign of the channel.",
        )


def _check_cross(frf: FrequencyResponse, pair: str) -> None:
    """A pair of two axes has no sign, but it is turned by 90 deg at resonances only."""
    band = in_band(frf)
    frequency, values = frf.frequency[band], frf.pair(pair[0], pair[1])[band]
    if values.any() and _phase(frequency, values).is_mobility:
        raise ImplausibleDataError(
            f"G{pair}: the phase is near 90 deg at nearly all frequencies: a mobility (m/s/N), not "
            "a receptance.",
            source=frf.source,
            hint="name the form in the column's unit.",
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Phase:
    """What the phase of a curve says.

    Attributes:
        loss: Part of -sin that is above zero less that below, -1..1, of the lines at which it is
            more than noise; None: too few of them.
        turned: Mean |sin| on a logarithmic grid. A structure is turned by 90 deg at its
            resonances only; its velocity is everywhere else.
    """

    loss: float | None
    turned: float

    @property
    def is_mobility(self) -> bool:
        """Phase near +-90 deg nearly everywhere."""
        return self.turned > _TURNED


def _phase(frequency: Array, values: ComplexArray) -> _Phase:
    sine = _sine(values)
    clear = np.flatnonzero(np.abs(sine) > max(_ABOVE_NOISE * _noise(sine), _LEAST_LOSS))
    turned = float(np.abs(sine[_grid(frequency)]).mean())
    if len(clear) < _FEWEST:
        return _Phase(loss=None, turned=turned)
    loss = float(-sine[clear].sum() / np.abs(sine[clear]).sum())
    return _Phase(loss=loss, turned=turned)


def _diagnosis(axis: str, frequency: Array, values: ComplexArray, phase: _Phase) -> str:
    trend = float(np.polyfit(np.log(frequency), np.log(np.abs(values) + 1e-300), 1)[0])
    at_low = float(np.median(values[: max(3, len(values) // 50)].real))
    if phase.is_mobility:
        return "Re is positive at all frequencies: a mobility (m/s/N), not a receptance."
    if (phase.loss or 0.0) > -_CLEAR:
        return (
            "the imaginary part has no sign: response and excitation are of different axes, "
            "or the axes are swapped."
        )
    if trend > 0.0:
        return (
            "Im is positive and the curve rises with frequency: an accelerance (m/s2/N), not a "
            "receptance."
        )
    if at_low > 0.0:
        return "Im is positive where Re is: the conjugate, written with e^(-j omega t)."
    return (
        "Im is positive: the tool would move against the force. "
        f"The {axis} axis of sensor or hammer is flipped, or this is an accelerance (m/s2/N)."
    )


def _check_swapped(frf: FrequencyResponse) -> None:
    """Two axes between which energy would come out: det(-Im G) below zero.

    Whatever two forces push, a passive structure takes their energy in: -Im G is positive
    (semi-)definite. Swapped sensors change the sign of its determinant; so does one flipped axis,
    but then a direct pair has the wrong sign by itself.
    """
    band = in_band(frf)
    for k, a in enumerate(frf.response_axes):
        for b in frf.response_axes[k + 1 :]:
            if not {a + a, b + b, a + b, b + a} <= set(frf.pairs):
                continue
            curves = [frf.pair(p, q)[band] for p, q in ((a, a), (b, b), (a, b), (b, a))]
            one, two = (_phase(frf.frequency[band], curve).loss or 0.0 for curve in curves[:2])
            if one * two < 0.0 and min(abs(one), abs(two)) > _PURE:
                continue
            if _determinant(curves) < -_OUTGOING:
                raise ImplausibleDataError(
                    f"energy would come out between {a} and {b}: the axes {a} and {b} of sensor or "
                    "hammer are swapped.",
                    source=frf.source,
                    hint=f"exchange {a} and {b} of one of the two channels.",
                )


def _determinant(curves: list[ComplexArray]) -> float:
    """Mean of det(-Im G) over the size of its two terms, -1..1, of the lines above the noise.

    Where one mode rules, the determinant is nothing but noise; such lines do not count.
    """
    loss = [-curve.imag for curve in curves]
    noise = [_noise(_sine(curve)) * np.abs(curve) for curve in curves]
    direct, cross = loss[0] * loss[1], loss[2] * loss[3]
    spread = np.sqrt(sum((noise[k] * loss[j]) ** 2 for k, j in ((0, 1), (1, 0), (2, 3), (3, 2))))
    size = np.abs(direct) + np.abs(cross)
    clear = np.abs(direct - cross) > _ABOVE_NOISE * spread + _LEAST_LOSS * size
    if clear.sum() < _FEWEST:
        return 0.0
    return float(((direct - cross)[clear] / size[clear]).mean())


def _sine(values: ComplexArray) -> Array:
    """Sine of the phase (m,); zero where the curve is."""
    size = np.abs(values)
    return np.divide(values.imag, size, out=np.zeros_like(size), where=size > 0.0)


def _noise(sine: Array) -> float:
    """Standard deviation of what changes from line to line: a curve does so slowly."""
    if len(sine) < 5:
        return 0.0
    return float(np.median(np.abs(np.diff(sine, 2)))) / _SECOND_DIFFERENCE


def _grid(frequency: Array) -> IntArray:
    """Rows of an even grid of the logarithm of frequency."""
    some = np.geomspace(frequency[0], frequency[-1], _GRID_LINES)
    rows = np.searchsorted(frequency, some).clip(max=len(frequency) - 1)
    return np.asarray(np.unique(rows), dtype=np.int64)


def _check_cross_signs(frf: FrequencyResponse) -> None:
    for pair, difference in reciprocity(frf).items():
        band = in_band(frf) & _select_coherent(frf, pair) & _select_coherent(frf, pair[::-1])
        one, two = (frf.pair(p[0], p[1])[band] for p in (pair, pair[::-1]))
        size = np.sqrt((np.abs(one) ** 2 + np.abs(two) ** 2).mean() / 2.0)
        flipped = float(np.sqrt((np.abs(one + two) ** 2).mean()) / size)
        if flipped < RECIPROCAL < difference:
            raise ImplausibleDataError(
                f"G{pair} is the negative of G{pair[::-1]}: one of the axes is flipped in one of "
                "the two tests.",
                source=frf.source,
                hint="check the direction of hammer and sensor.",
            )
