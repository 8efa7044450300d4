"""The dynamic error of a recorded force: e = F^-1[G F], the whole record at once.

Source: Jin, Sun, Tang, Li 2022, eq. 1. As printed, the product is circular: the end of the record
deflects its beginning, and a static deflection is present from the first sample. Here the record is
followed by zeros for longer than the tool rings, which cures the first; the error without them is
computed as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy.fft

from robotrue.core.arrays import Array
from robotrue.core.units import UM
from robotrue.dynamics.force import ForceRecord, find_stuck_channels
from robotrue.dynamics.frf import AXES, ComplexArray, FrequencyResponse
from robotrue.dynamics.frf_checks import response_remarks
from robotrue.dynamics.interpolation import COARSE, ResponseCurve
from robotrue.errors import ConfigurationError, ModelMismatchError

RINGS: Final = 7.0
"""Time constants after which nothing is left of a decay (one part in 1,000)."""
_PADS: Final = 2.0
"""Times the ringing of modes in zeros; what is left then, one part in a million, comes back."""
_FARTHEST: Final = 10e-3
"""m a cut pushes a tool at most; more is a force or a response in another unit."""
_BEGINS: Final = 0.05
"""Part of the largest force from which a record starts in the cut."""
_ABOVE: Final = 0.02
_MOST_ABOVE: Final = 0.5
"""Part of the force's mean square above the band beyond which a prediction is not valid."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DeflectionPrediction:
    """Deflection of the tool along a force record.

    Attributes:
        record: The force.
        error: (n, 3) m along x, y, z; NaN along an axis without response.
        circular: (n, 3) m, the same without zeros after the record, as printed.
        static: (3,) m, mean force times receptance at 0 Hz; NaN as ``error``.
        padding: s of zeros.
        rings: s, how long after a change of force the tool still moves by it.
        remarks: Remarks before use, one sentence each.
        invalid: Why it is not to be used at all; empty for most records.
    """

    record: ForceRecord
    error: Array
    circular: Array
    static: Array
    padding: float
    rings: float
    remarks: tuple[str, ...]
    invalid: tuple[str, ...]

    @property
    def circular_error(self) -> tuple[float, float]:
        """Rms and largest difference, m, of the circular from the padded prediction."""
        size = np.linalg.norm(np.nan_to_num(self.circular - self.error), axis=1)
        return float(np.sqrt((size**2).mean())), float(size.max())


def predict_error(
    curve: ResponseCurve, record: ForceRecord, *, padding: float | None = None
) -> DeflectionPrediction:
    """Returns the deflection of the tool under a recorded force.

    Args:
        curve: Receptance at any frequency.
        record: Force on the tool, in the axes of the receptance.
        padding: s of zeros after the record; default: twice as long as the modes ring; without
            modes the time the spacing of the lines can hold.

    Raises:
        ConfigurationError: Negative padding.
        ModelMismatchError: No axis of the force is one of excitation, or the record is slower
            than the first line of the response.

    Fails when: the record begins in the middle of a cut: the force then seems to begin there, and
    the first ``rings`` seconds hold a spurious transient. A remark reports this.
    """
    frf = curve.frf
    rings = ring_time(curve)
    if padding is None:
        padding = rings if curve.modes is None else _PADS * rings
    if not padding >= 0.0:
        raise ConfigurationError(f"padding of {padding:g} s, expected zero or more.")
    force = record.force[:, [AXES.index(axis) for axis in frf.excitation_axes]]
    if not force.any():
        raise ModelMismatchError(
            f"no force along {', '.join(frf.excitation_axes)}, where the response was excited.",
            source=record.source,
            hint="check the axes of the dynamometer against those of the hammer test.",
        )
    _check_rate(curve, record)
    n = len(record)
    error = _in_all_axes(
        _apply_response(curve, force, record.rate, n + round(padding * record.rate)), frf
    )
    circular = _in_all_axes(_apply_response(curve, force, record.rate, n, exact=True), frf)
    static = _in_all_axes((curve.at_rest @ force.mean(axis=0))[None], frf)[0]
    return DeflectionPrediction(
        record=record,
        error=error[:n],
        circular=circular[:n],
        static=static,
        padding=padding,
        rings=rings,
        remarks=_remarks(curve, record, force, rings),
        invalid=_invalid(curve, record, error[:n]),
    )


def _check_rate(curve: ResponseCurve, record: ForceRecord) -> None:
    """Refuses a record too slow for what the tool does most."""
    frf, reach = curve.frf, record.rate / 2.0
    if reach < frf.valid[0] or reach < frf.frequency[1]:
        raise ModelMismatchError(
            f"{record.rate:g} samples/s reach to {reach:g} Hz, the response begins at "
            f"{frf.frequency[0]:g} Hz.",
            source=record.source,
        )
    size = np.linalg.norm(frf.response, axis=(1, 2)) * frf.in_band
    peak = float(frf.frequency[int(np.argmax(size))])
    if reach < peak:
        raise ModelMismatchError(
            f"{record.rate:.4g} samples/s reach to {reach:.4g} Hz, the tool moves most at "
            f"{peak:.4g} Hz.",
            source=record.source,
            hint="record faster; or check the unit of the time: ms are not s.",
        )


def ring_time(curve: ResponseCurve) -> float:
    """Returns how long the tool moves by a change of force, s.

    Seven time constants of the slowest mode; without modes the longest time the spacing of the
    lines can hold, one over the finest of it.
    """
    if curve.modes is not None:
        return RINGS * curve.modes.decay_time
    return float(1.0 / np.diff(curve.frf.frequency).min())


def out_of_band(curve: ResponseCurve, record: ForceRecord) -> float:
    """Returns the part, 0..1, of the force's mean square that lies above the band."""
    spectrum = np.abs(scipy.fft.rfft(record.force, axis=0)) ** 2
    spectrum[1:] *= 2.0
    above = scipy.fft.rfftfreq(len(record), 1.0 / record.rate) > curve.frf.valid[1]
    return float(spectrum[above].sum() / max(spectrum.sum(), 1e-300))


def _apply_response(
    curve: ResponseCurve, force: Array, rate: float, length: int, *, exact: bool = False
) -> Array:
    """F^-1[G F] (length, r) m of a force (n, e) N followed by zeros up to ``length`` or more."""
    if not exact:
        length = scipy.fft.next_fast_len(length, real=True)
    spectrum: ComplexArray = scipy.fft.rfft(force, n=length, axis=0)
    response = curve.at(scipy.fft.rfftfreq(length, 1.0 / rate))
    product = np.einsum("fre,fe->fr", response, spectrum)
    return np.asarray(scipy.fft.irfft(product, n=length, axis=0))


def _in_all_axes(values: Array, frf: FrequencyResponse) -> Array:
    out = np.full((len(values), 3), np.nan)
    out[:, [AXES.index(axis) for axis in frf.response_axes]] = values
    return out


def _invalid(curve: ResponseCurve, record: ForceRecord, error: Array) -> tuple[str, ...]:
    said = [
        f"f{axis} is exactly zero on every sample, and the tool yields along {axis}: a sensor that "
        "is not connected?"
        for axis in curve.frf.excitation_axes
        if not record.force[:, AXES.index(axis)].any()
    ]
    said += find_stuck_channels(record)
    above = out_of_band(curve, record)
    if above > _MOST_ABOVE:
        said.append(
            f"{100.0 * above:.0f} % of the force's mean square lies above {curve.frf.valid[1]:g} "
            "Hz, where there is no measurement"
        )
    farthest = float(np.abs(np.nan_to_num(error)).max())
    if farthest > _FARTHEST:
        peak = float(np.abs(record.force).max())
        said.append(
            f"{peak:.3g} N would push the tool by {farthest * 1e3:.3g} mm, expected at most "
            f"{_FARTHEST * 1e3:g} mm: a force or a response in another unit"
        )
    return tuple(said)


def _remarks(
    curve: ResponseCurve, record: ForceRecord, force: Array, rings: float
) -> tuple[str, ...]:
    said = list(response_remarks(curve.frf))
    for axis, values in zip(AXES, record.force.T, strict=True):
        if axis not in curve.frf.excitation_axes and values.any():
            said.append(
                f"f{axis} of up to {np.abs(values).max():.0f} N has no effect here: the response "
                f"was never excited along {axis}"
            )
    size = np.linalg.norm(force, axis=1)
    head = max(1, round(0.002 * record.rate))
    if np.abs(force[:head].mean(axis=0)).max() > _BEGINS * size.max():
        said.append(
            f"the record begins in the cut: the first {rings:.2g} s hold a transient of a force "
            "that seems to start there"
        )
    if curve.modes is None and curve.left_out > COARSE:
        said.append(
            f"the lines are coarse: a line left out is missed by {100.0 * curve.left_out:.0f} %; "
            "a finer spectrum or fitted modes are more accurate"
        )
    if curve.modes is not None and (curve.rebuilt or 0.0) > COARSE:
        said.append(
            f"the modes miss the lines by {100.0 * (curve.rebuilt or 0.0):.0f} %, a cubic those "
            f"left out by {100.0 * curve.left_out:.0f} %: a finer spectrum is more accurate"
        )
    above = out_of_band(curve, record)
    if above > _ABOVE:
        said.append(
            f"{100.0 * above:.0f} % of the force's mean square lies above "
            f"{curve.frf.valid[1]:g} Hz, where the response is "
            + ("zero" if curve.modes is None else "that of the modes below")
        )
    return tuple(said)


def prediction_columns(prediction: DeflectionPrediction) -> tuple[list[str], Array]:
    """Returns names and values (n, 4) of the written table: s and um, NaN where invalid."""
    names = ["t_s", "ex_um", "ey_um", "ez_um"]
    return names, np.column_stack([prediction.record.time, prediction.error / UM])
