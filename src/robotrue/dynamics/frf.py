"""The frequency response of the tool: the noun, its three forms, its value at any frequency.

Inside it is always a **receptance**, displacement over force in m/N, with e^{+j omega t}. Hammer
tests with an accelerometer measure the accelerance; the forms differ by j omega::

    mobility = j omega G,    accelerance = -omega^2 G
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.columns import Column, Columns
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.errors import ConfigurationError, ImplausibleDataError, ShapeError

ComplexArray: TypeAlias = npt.NDArray[np.complex128]
"""complex128 array; shape and unit are in the docstring of whoever names it."""
AXES: Final = ("x", "y", "z")
FORMS: Final = {"receptance": 0, "mobility": 1, "accelerance": 2}
"""Form to the power of j omega in it."""
FORM_UNITS: Final = {"receptance": "m/N", "mobility": "m/s/N", "accelerance": "m/s^2/N"}


@dataclass(frozen=True, slots=True, kw_only=True)
class FrequencyResponse(Columns):
    """Displacement of the tool over the force on it, axis by axis.

    Attributes:
        frequency: (m,) Hz, rising, from 0 on.
        response: (m, r, e) m/N; zero where ``present`` is false.
        response_axes: r of x, y, z: where the displacement goes.
        excitation_axes: e of x, y, z: where the force acts.
        present: (r, e), false for a pair that nobody measured.
        coherence: (m, r, e) 0..1, or None.
        valid: Hz, lowest and highest frequency the numbers are to be trusted at.
        measured_as: Form it was measured in: receptance, mobility or accelerance. The latter two
            know nothing of the static deflection.
        static: (r, e) m/N of a static load test, NaN for pairs it left out; or None.
        source: File or test it came from.
        provenance: Simulated or measured, and the files.
    """

    frequency: Annotated[Array, Column("m", unit="Hz")]
    response: Annotated[ComplexArray, Column("m r e")]
    response_axes: Annotated[tuple[str, ...], Column("r")]
    excitation_axes: Annotated[tuple[str, ...], Column("e")]
    present: Annotated[BoolArray, Column("r e")]
    coherence: Annotated[Array | None, Column("m r e")]
    valid: tuple[float, float]
    measured_as: str
    static: Annotated[Array | None, Column("r e", nan=True)]
    source: str
    provenance: Provenance = MEASURED

    def _known_sizes(self) -> dict[Any, int]:
        return {"r": len(self.response_axes), "e": len(self.excitation_axes)}

    def _check_rules(self) -> None:
        """Checks axes, order and band."""
        for name in ("response_axes", "excitation_axes"):
            _check_axes(getattr(self, name), name)
        rising = (np.diff(self.frequency) > 0.0).all()
        if len(self.frequency) < 2 or self.frequency[0] < 0.0 or not rising:
            raise ShapeError("frequency has to rise from 0 Hz or above and hold two lines or more.")
        if self.measured_as not in FORMS:
            raise ConfigurationError(
                f"form {self.measured_as!r} of a frequency response, expected {sorted(FORMS)}."
            )
        low, high = self.valid
        if not 0.0 <= low < high:
            raise ShapeError(f"band of validity {low:g} to {high:g} Hz, expected low < high.")

    def pair(self, response: str, excitation: str) -> ComplexArray:
        """Returns (m,) m/N of one pair of axes, response first.

        Raises:
            ConfigurationError: The pair was not measured.
        """
        if response in self.response_axes and excitation in self.excitation_axes:
            i, j = self.response_axes.index(response), self.excitation_axes.index(excitation)
            if self.present[i, j]:
                return self.response[:, i, j]
        raise ConfigurationError(
            f"the frequency response holds no pair {response}{excitation}; "
            f"it holds {', '.join(self.pairs)}.",
            source=self.source,
        )

    @property
    def pairs(self) -> tuple[str, ...]:
        """Measured pairs, response axis first: xx, yx, ..."""
        return tuple(
            a + b
            for i, a in enumerate(self.response_axes)
            for j, b in enumerate(self.excitation_axes)
            if self.present[i, j]
        )


def in_form(response: ComplexArray, frequency: Array, have: str, want: str) -> ComplexArray:
    """Returns a response (m, ...) converted between receptance, mobility and accelerance.

    Multiplied or divided by powers of j omega; a line at 0 Hz becomes zero on the way up.

    Args:
        response: (m, ...) in the form ``have``.
        frequency: (m,) Hz.
        have: Form it is in.
        want: Form wanted.

    Raises:
        ConfigurationError: Not a form, or a line at 0 Hz on the way down: the static deflection
            cannot be had from a velocity or an acceleration.
    """
    for form in (have, want):
        if form not in FORMS:
            raise ConfigurationError(f"form {form!r}, expected one of {sorted(FORMS)}.")
    power = FORMS[want] - FORMS[have]
    if power < 0 and (frequency <= 0.0).any():
        raise ConfigurationError(
            f"a line at 0 Hz of {have} says nothing about {want}.",
            hint="leave the line at 0 Hz out and give the static deflection of a load test.",
        )
    factor = (2j * np.pi * frequency) ** power
    return np.asarray(response * factor.reshape(-1, *[1] * (response.ndim - 1)))


def with_static(frf: FrequencyResponse, static: Mapping[str, float]) -> FrequencyResponse:
    """Returns the response with the deflections of a static load test.

    Args:
        frf: As measured.
        static: Pair of axes, response first, to m/N; others keep what is known of them.

    Raises:
        ConfigurationError: A pair that was not measured dynamically.
        ImplausibleDataError: A direct pair that yields against the force.
    """
    if not static:
        return frf
    known = np.full(frf.present.shape, np.nan) if frf.static is None else np.array(frf.static)
    for pair, value in static.items():
        frf.pair(pair[0], pair[1])
        if pair[0] == pair[1] and not value > 0.0:
            raise ImplausibleDataError(
                f"static deflection {pair} of {value:.3g} m/N, expected above zero: the tool "
                "yields the way it is pushed.",
                source=frf.source,
            )
        known[frf.response_axes.index(pair[0]), frf.excitation_axes.index(pair[1])] = value
    return replace(frf, static=known)


def trusted_lines(frf: FrequencyResponse) -> FrequencyResponse:
    """Returns the response without the lines outside its band of validity."""
    low, high = frf.valid
    keep = (frf.frequency >= low) & (frf.frequency <= high)
    return replace(
        frf,
        frequency=frf.frequency[keep],
        response=frf.response[keep],
        coherence=None if frf.coherence is None else frf.coherence[keep],
    )


def _check_axes(axes: tuple[str, ...], name: str) -> None:
    if not axes or len(set(axes)) != len(axes) or not set(axes) <= set(AXES):
        raise ConfigurationError(f"{name} {axes}, expected some of {AXES}, each once.")
