"""From single measured curves to one frequency response: form, band, static line, checks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.dynamics.checks import BLIND_BELOW, check_response, diverges_below
from robotrue.dynamics.frf import AXES, ComplexArray, FrequencyResponse, in_form
from robotrue.errors import FormatError, ImplausibleDataError

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

    A line at 0 Hz of a receptance is its static deflection; of the other forms it is dropped. What
    an accelerometer measured is trusted from 4 Hz on, and so is a receptance that grows towards
    0 Hz like the integrated noise of one; anything else from its first line.

    Args:
        frequency: (m,) Hz.
        pairs: The curves.
        source: Of messages.
        provenance: Simulated or measured, and the files.
        valid: Hz, band to trust, where somebody knows it.

    Raises:
        FormatError: Fewer than eight lines.
        ImplausibleDataError: Numbers that cannot be the form they claim (``checks``).
    """
    moving = frequency > 0.0
    lowest = float(frequency[moving][0]) if moving.any() else 0.0
    if moving.sum() < 8:
        raise FormatError(
            f"{int(moving.sum())} lines above 0 Hz, expected eight or more.", source=source
        )
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
    low = 0.0 if static is not None else lowest
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
