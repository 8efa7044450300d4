"""Physical limits of every structure: phase, energy and size of a receptance.

A structure without motors takes energy in and gives none back. At the point that is pushed, the
displacement never leads the force: Im G_ii <= 0 (e^{+j omega t}). An accelerance has Im >= 0, a
mobility has Re >= 0 instead, and a pair of two different axes has no such law. Below its modes a
tool deflects like a spring, above them it moves like a mass. A curve of implausible stiffness or
mass is in another unit, or is an acceleration.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.dynamics.frf import ComplexArray, FrequencyResponse
from robotrue.errors import ImplausibleDataError

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
_SOFTEST: Final = 5e-4
"""m/N at the low end of the band; more than that, 2 N/mm, is no robot."""
_LIGHTEST: Final = 1e-3
"""kg; 1/(w^2 G) of a tool is its moving mass, at resonance some hundredths of that."""
_MASS_FROM: Final = 20.0
"""Hz; below it a soft arm may look as light as that."""
_NEAR_REST: Final = 6.0
"""Hz below which an arm deflects nearly statically, as its lowest mode is above 7 Hz."""
_LIKE_REST: Final = 10.0


def check_direct(frf: FrequencyResponse, axis: str) -> None:
    """Passes if the displacement along an axis does not lead the force along it.

    Raises:
        ImplausibleDataError: Another form, another sign of time, a flipped or swapped axis.
    """
    band = frf.in_band
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


def check_cross(frf: FrequencyResponse, pair: str) -> None:
    """Passes if a pair of two axes, which has no sign, is turned by 90 deg at resonances only.

    Raises:
        ImplausibleDataError: A mobility.
    """
    band = frf.in_band
    frequency, values = frf.frequency[band], frf.pair(pair[0], pair[1])[band]
    if values.any() and _phase(frequency, values).is_mobility:
        raise ImplausibleDataError(
            f"G{pair}: the phase is near 90 deg at nearly all frequencies: a mobility (m/s/N), not "
            "a receptance.",
            source=frf.source,
            hint="name the form in the column's unit.",
        )


def check_swapped(frf: FrequencyResponse) -> None:
    """Passes if no energy comes out between two axes: det(-Im G) is not below zero.

    Whatever two forces push, a passive structure takes their energy in: -Im G is positive
    (semi-)definite. Swapped sensors change the sign of its determinant; so does one flipped axis,
    but then a direct pair has the wrong sign by itself.

    Raises:
        ImplausibleDataError: Two axes are swapped.
    """
    band = frf.in_band
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


def check_size(pair: str, frequency: Array, values: ComplexArray, source: str) -> None:
    """Returns nothing; raises where a curve of the band is too large for a receptance.

    Args:
        pair: Response and excitation axis.
        frequency: (m,) Hz.
        values: (m,) m/N.
        source: Of messages.

    Raises:
        ImplausibleDataError: Softer than 2 N/mm, or lighter than a gram.

    Fails when: a mobility or another unit leaves the curve within that.
    """
    size = np.abs(values)
    softest = float(np.median(size[: max(3, len(size) // 50)]))
    if softest > _SOFTEST:
        raise ImplausibleDataError(
            f"G{pair} is {softest:.3g} m/N at {frequency[0]:g} Hz, {softest * 1e3:.3g} mm "
            f"for every newton; expected at most {_SOFTEST:g} m/N.",
            source=source,
            hint="another unit: um_per_N or mm_per_N, or an accelerance, m_per_s2_per_N.",
        )
    upper = (frequency >= max(_MASS_FROM, np.sqrt(frequency[0] * frequency[-1]))) & (size > 0.0)
    if not upper.any():
        return
    mass = float(np.median(1.0 / ((2.0 * np.pi * frequency[upper]) ** 2 * size[upper])))
    if mass < _LIGHTEST:
        raise ImplausibleDataError(
            f"G{pair} from {frequency[upper][0]:.4g} Hz on is that of a mass of {mass * 1e3:.2g} "
            f"g, expected {_LIGHTEST * 1e3:g} g or more: an accelerance (m/s2/N), or another unit.",
            source=source,
            hint="name the form in the column's unit: m_per_s2_per_N, um_per_N.",
        )


def check_static(frf: FrequencyResponse, pair: str) -> None:
    """Returns nothing; raises where the line at 0 Hz of a direct pair is no static deflection.

    Compared are the lines below 6 Hz, where an arm is hardly turned by its modes yet.

    Raises:
        ImplausibleDataError: Ten times more or less than those lines.
    """
    static = frf.static
    near = (frf.frequency > 0.0) & (frf.frequency <= _NEAR_REST)
    if static is None or pair[0] != pair[1] or not near.any():
        return
    lines = np.abs(frf.pair(pair[0], pair[1])[near])
    low = float(np.median(lines))
    at_rest = float(static[frf.index(pair)])
    if np.isfinite(at_rest) and not low / _LIKE_REST < at_rest < low * _LIKE_REST:
        raise ImplausibleDataError(
            f"G{pair} is {at_rest:.3g} m/N at 0 Hz and {low:.3g} m/N at the lines up to "
            f"{_NEAR_REST:g} Hz: the line at 0 Hz is no static deflection.",
            source=frf.source,
            hint="leave the line at 0 Hz out, or put the result of a static load test there.",
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Phase:
    """Diagnosis from the phase of a curve.

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
