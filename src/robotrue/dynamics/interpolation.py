"""The receptance at any frequency: between the lines, below the band, above it.

Between the lines a complex cubic, or the modes where they fit better. Below the band nothing was
measured: there the value runs from the static deflection (of a load test, else of the modes or the
lowest lines) to the first line of the band, Re with f^2 and Im with f, as that of a grounded
structure does. Above the band it is that of the modes, or zero without modes: a curve that ends
abruptly rings before its cause, and modes end gently.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline

from robotrue.core.arrays import Array
from robotrue.dynamics.frf import ComplexArray, FrequencyResponse
from robotrue.dynamics.modal import ModalModel
from robotrue.dynamics.modal_fit import fit_modes
from robotrue.errors import ObservabilityError, RobotrueError

COARSE: Final = 0.05
"""Rms error of lines left out, over the rms of all, beyond which the grid counts as coarse."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ResponseCurve:
    """A receptance at any frequency.

    Attributes:
        frf: Measured response.
        modes: Its interpolation between the lines, or None: a cubic.
        left_out: Rms error at every other line when the cubic uses only the others, over the rms of
            all lines: the interpolation error at twice the spacing.
        rebuilt: The same measure of the modes on all lines, or None.
    """

    frf: FrequencyResponse
    modes: ModalModel | None
    left_out: float
    rebuilt: float | None

    def at(self, frequency: Array) -> ComplexArray:
        """Returns the receptance (n, r, e) m/N at frequencies (n,) Hz from 0 on, rising."""
        low, high = self.frf.valid
        _, r, e = self.frf.response.shape
        out = np.zeros((len(frequency), r, e), dtype=np.complex128)
        above_rest = max(low, np.nextafter(0.0, 1.0))
        first, last = (int(i) for i in np.searchsorted(frequency, [above_rest, high]))
        last += last < len(frequency) and frequency[last] == high
        inside = slice(first, len(frequency) if self.modes is not None else last)
        out[inside] = self._between(frequency[inside])
        out[:first] = self._below(frequency[:first])
        out[:, ~self.frf.present] = 0.0
        return out

    @property
    def at_rest(self) -> Array:
        """(r, e) m/N at 0 Hz: of the static load test, else of the modes or the lowest lines."""
        static = self.frf.static
        if static is not None and np.isfinite(static).all():
            return static
        if self._has_rest and self.modes is not None:
            guess = self.modes.modal_static
        else:
            lowest = float(self.frf.frequency[self.frf.frequency > 0.0][0])
            guess = self._between(np.array([max(self.frf.valid[0], lowest)]))[0].real
        return np.asarray(guess if static is None else np.where(np.isnan(static), guess, static))

    @property
    def _has_rest(self) -> bool:
        """True if the modes have a value at 0 Hz."""
        return self.modes is not None and not self.modes.lower.any()

    def _below(self, frequency: Array) -> ComplexArray:
        """Value (n, r, e) m/N below the band, at 0 Hz the static one."""
        low, rest = self.frf.valid[0], self.at_rest
        if not low > 0.0:
            return np.tile(rest + 0j, (len(frequency), 1, 1))
        part = (frequency / low)[:, None, None]
        if self._has_rest and self.modes is not None:
            gap = rest - self.modes.modal_static
            return np.asarray(self.modes.response(frequency) + gap * (1.0 - part**2))
        edge = self._between(np.array([low]))[0]
        return np.asarray(rest + (edge.real - rest) * part**2 + 1j * edge.imag * part)

    def _between(self, frequency: Array) -> ComplexArray:
        if self.modes is not None:
            return self.modes.response(frequency)
        lines, values = _select_band(self.frf)
        return np.asarray(CubicSpline(lines, values, axis=0)(frequency), dtype=np.complex128)


def response_curve(frf: FrequencyResponse, modes: ModalModel | None = None) -> ResponseCurve:
    """Returns the receptance as a function of frequency.

    Args:
        frf: Measured response.
        modes: Modes fitted to it; used where they rebuild the lines better than the lines
            rebuild each other.

    Raises:
        ObservabilityError: Fewer than eight lines in the band.
    """
    left_out = held_out_error(frf)
    rebuilt = None
    if modes is not None:
        rebuilt = rebuild_error(frf, modes)
        if rebuilt > left_out:
            modes = None
    return ResponseCurve(frf=frf, modes=modes, left_out=left_out, rebuilt=rebuilt)


def fit_curve(frf: FrequencyResponse, between: str) -> ResponseCurve:
    """Returns the response at any frequency.

    Args:
        frf: Measured response.
        between: Interpolation between its lines: ``lines``, ``modes``, or ``auto`` for the one that
            rebuilds them best.

    Raises:
        RobotrueError: Modes were requested and cannot be fitted.
    """
    if between == "lines":
        return response_curve(frf)
    try:
        modes = fit_modes(frf)
    except RobotrueError:
        if between == "modes":
            raise
        return response_curve(frf)
    curve = response_curve(frf, modes)
    if between == "modes" and curve.modes is None:
        return replace(curve, modes=modes)
    return curve


def held_out_error(frf: FrequencyResponse) -> float:
    """Returns the rms error of a cubic at every other line, over the rms of all lines.

    Raises:
        ObservabilityError: Fewer than eight lines in the band.
    """
    lines, values = _select_band(frf)
    if len(lines) < 8:
        raise ObservabilityError(
            f"{len(lines)} lines between {frf.valid[0]:g} and {frf.valid[1]:g} Hz, eight are the "
            "least.",
            source=frf.source,
            hint="a wider band, or a finer spectrum.",
        )
    kept = np.arange(0, len(lines), 2)
    out = np.arange(1, kept[-1], 2)
    guess = CubicSpline(lines[kept], values[kept], axis=0)(lines[out])
    return _relative(guess - values[out], values)


def rebuild_error(frf: FrequencyResponse, modes: ModalModel) -> float:
    """Returns the rms difference of the modes from the lines of the band, over the lines' rms."""
    band = frf.in_band
    values = frf.response[band]
    return _relative(
        (modes.response(frf.frequency[band]) - values)[:, frf.present], values[:, frf.present]
    )


def describe_rebuild_error(error: float) -> str:
    """Returns the error of modes at the lines, in per cent; rounding of exact modes as such."""
    percent = 100.0 * error
    return f"{percent:.2g} % off the lines" if percent >= 0.001 else "< 0.001 % off the lines"


def _relative(difference: ComplexArray, of: ComplexArray) -> float:
    return float(np.sqrt((np.abs(difference) ** 2).mean() / max((np.abs(of) ** 2).mean(), 1e-300)))


def _select_band(frf: FrequencyResponse) -> tuple[Array, ComplexArray]:
    """Lines of the band, with that at 0 Hz where it is a static deflection."""
    band = np.array(frf.in_band)
    if frf.static is not None and frf.frequency[0] == 0.0 and frf.valid[0] == 0.0:
        band[0] = True
    return frf.frequency[band], frf.response[band]
