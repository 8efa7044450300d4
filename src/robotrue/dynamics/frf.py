"""The frequency response of the tool: the noun, its three forms, its value at any frequency.

Inside it is always a **receptance**, displacement over force in m/N, with e^{+j omega t}. Hammer
tests with an accelerometer measure the accelerance; the forms differ by j omega::

    mobility = j omega G,    accelerance = -omega^2 G
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.columns import Column, Columns
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.errors import ConfigurationError, ImplausibleDataError, ShapeError

ComplexArray: TypeAlias = npt.NDArray[np.complex128]
"""complex128 array; shape and unit are in the docstring of each use."""
AXES: Final = ("x", "y", "z")
COHERENT: Final = 0.8
"""Least coherence of a line to be trusted."""
FORMS: Final = {"receptance": 0, "mobility": 1, "accelerance": 2}
"""Form to the power of j omega in it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FrequencyResponse(Columns):
    """Displacement of the tool over the force on it, axis by axis.

    Attributes:
        frequency: (n,) Hz, rising, from 0 on.
        response: (n, r, e) m/N; zero where ``present`` is false.
        response_axes: r of x, y, z: where the displacement goes.
        excitation_axes: e of x, y, z: where the force acts.
        present: (r, e), false for a pair that was not measured.
        coherence: (n, r, e) 0..1, or None.
        valid: Hz, lowest and highest reliable frequency.
        measured_as: Form it was measured in: receptance, mobility or accelerance. The latter two do
            not contain the static deflection.
        static: (r, e) m/N of a static load test, NaN for pairs it left out; or None.
        source: File or test it came from.
        provenance: Simulated or measured, and the files.
    """

    frequency: Annotated[Array, Column("n", unit="Hz")]
    response: Annotated[ComplexArray, Column("n r e")]
    response_axes: Annotated[tuple[str, ...], Column("r")]
    excitation_axes: Annotated[tuple[str, ...], Column("e")]
    present: Annotated[BoolArray, Column("r e")]
    coherence: Annotated[Array | None, Column("n r e")]
    valid: tuple[float, float]
    measured_as: str
    static: Annotated[Array | None, Column("r e", nan=True)]
    source: str
    provenance: Provenance = MEASURED

    def __post_init__(self) -> None:
        """Checks axes, order and band."""
        self._check_columns(r=len(self.response_axes), e=len(self.excitation_axes))
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

    def index(self, pair: str) -> tuple[int, int]:
        """Returns row and column of a measured pair of axes, response first."""
        return self.response_axes.index(pair[0]), self.excitation_axes.index(pair[1])

    def pair(self, response: str, excitation: str) -> ComplexArray:
        """Returns (n,) m/N of one pair of axes, response first.

        Raises:
            ConfigurationError: The pair was not measured.
        """
        pair = response + excitation
        if pair in self.pairs:
            return self.response[:, *self.index(pair)]
        raise ConfigurationError(
            f"the frequency response holds no pair {pair}; it holds {', '.join(self.pairs)}.",
            source=self.source,
        )

    @property
    def pairs(self) -> tuple[str, ...]:
        """Measured pairs, response axis first: xx, yx, ..."""
        all_pairs = (a + b for a in self.response_axes for b in self.excitation_axes)
        return tuple(pair for pair in all_pairs if self.present[self.index(pair)])

    @property
    def in_band(self) -> BoolArray:
        """(n,) true where the response is to be trusted."""
        low, high = self.valid
        inside = (self.frequency >= low) & (self.frequency <= high)
        return np.asarray(inside & (self.frequency > 0.0))

    def is_coherent(self, pair: str) -> BoolArray:
        """Returns the lines (n,) of good coherence; all where it was not measured."""
        if self.coherence is None:
            return np.ones(len(self.frequency), dtype=np.bool_)
        return np.asarray(self.coherence[:, *self.index(pair)] >= COHERENT)


def in_form(response: ComplexArray, frequency: Array, have: str, want: str) -> ComplexArray:
    """Returns a response (m, ...) converted between receptance, mobility and accelerance.

    Multiplied or divided by powers of j omega; a line at 0 Hz becomes zero on the way up.

    Args:
        response: (m, ...) in the form ``have``.
        frequency: (m,) Hz.
        have: Form it is in.
        want: Form wanted.

    Raises:
        ConfigurationError: Not a form, or a line at 0 Hz on the way down: a velocity or an
            acceleration does not contain the static deflection.
    """
    for form in (have, want):
        if form not in FORMS:
            raise ConfigurationError(f"form {form!r}, expected one of {sorted(FORMS)}.")
    power = FORMS[want] - FORMS[have]
    if power < 0 and (frequency <= 0.0).any():
        raise ConfigurationError(
            f"a line at 0 Hz of {have} does not cover {want}.",
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
        known[frf.index(pair)] = value
    return replace(frf, static=known)


def trusted_lines(frf: FrequencyResponse) -> FrequencyResponse:
    """Returns the response without the lines outside its band of validity."""
    low, high = frf.valid
    return frf.take((frf.frequency >= low) & (frf.frequency <= high))


def _check_axes(axes: tuple[str, ...], name: str) -> None:
    if not axes or len(set(axes)) != len(axes) or not set(axes) <= set(AXES):
        raise ConfigurationError(f"{name} {axes}, expected some of {AXES}, each once.")
