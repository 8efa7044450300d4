"""Modes of the tool: poles, residues and residuals outside the band.

With poles p_k (upper half plane) and residues R_k, the receptance is::

    G(s) = sum_k [ R_k / (s - p_k) + conj(R_k) / (s - conj(p_k)) ] + upper + lower / s^2

``upper`` (m/N) is the flexibility of the modes above the band, ``lower`` (1/kg) that of the modes
below it and of the rigid body: at s = j omega it is -lower / omega^2. ``lower`` grows without limit
towards 0 Hz: a filter in time needs it zero, and the static part from a load test.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.archive import Archive, archive_reader
from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.document_decoder import decode
from robotrue.core.provenance import MEASURED, Provenance, provenance_from
from robotrue.dynamics.frf import AXES, ComplexArray
from robotrue.errors import ArchiveError, ConfigurationError, ShapeError

KIND: Final = "modal-model"
SCHEMA: Final = 1
_BLOCK: Final = 65536
"""Frequencies at a time; bounds the memory of long records."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModalModel(Columns):
    """Receptance as a sum of modes.

    Attributes:
        poles: (k,) rad/s, imaginary part above zero, real part below, by rising frequency.
        residues: (k, r, e) m/(N s).
        upper: (r, e) m/N, flexibility of the modes above the band.
        lower: (r, e) 1/kg, of what lies below the band; zero where nothing does.
        static: (r, e) m/N of a static load test, NaN for pairs it left out; or None.
        response_axes: r of x, y, z.
        excitation_axes: e of x, y, z.
        valid: Hz, band of the response it was fitted to.
        source: File or model it came from.
        provenance: Of the response.
    """

    poles: Annotated[ComplexArray, Column("k")]
    residues: Annotated[ComplexArray, Column("k r e")]
    upper: Annotated[Array, Column("r e")]
    lower: Annotated[Array, Column("r e")]
    static: Annotated[Array | None, Column("r e", nan=True)]
    response_axes: Annotated[tuple[str, ...], Column("r")]
    excitation_axes: Annotated[tuple[str, ...], Column("e")]
    valid: tuple[float, float]
    source: str
    provenance: Provenance = MEASURED

    def __post_init__(self) -> None:
        """Checks the values."""
        self._check_columns(r=len(self.response_axes), e=len(self.excitation_axes))
        if not set(self.response_axes) | set(self.excitation_axes) <= set(AXES):
            raise ConfigurationError(f"axes of a modal model are some of {AXES}.")
        if not ((self.poles.imag > 0.0) & (self.poles.real < 0.0)).all():
            raise ShapeError("poles need a real part below and an imaginary part above zero.")

    @property
    def frequency(self) -> Array:
        """(k,) Hz, undamped natural frequencies."""
        return np.asarray(np.abs(self.poles) / (2.0 * np.pi))

    @property
    def damping(self) -> Array:
        """(k,) part of critical damping."""
        return np.asarray(-self.poles.real / np.abs(self.poles))

    @property
    def decay_time(self) -> float:
        """Time constant of the slowest mode, s; its response falls to 1/e in it."""
        return float(np.max(-1.0 / self.poles.real))

    def response(self, frequency: Array) -> ComplexArray:
        """Returns the receptance (m, r, e) m/N at frequencies (m,) Hz.

        Raises:
            ConfigurationError: 0 Hz was requested of a model with a lower residual.
        """
        s = 2j * np.pi * np.asarray(frequency, dtype=float)
        if self.lower.any() and (s == 0.0).any():
            raise ConfigurationError(
                "a modal model with a lower residual has no value at 0 Hz.",
                hint="fit it with the static deflection of a load test.",
            )
        r, e = self.upper.shape
        poles = np.concatenate([self.poles, self.poles.conj()])
        residues = np.concatenate([self.residues, self.residues.conj()]).reshape(-1, r * e)
        out = np.empty((len(s), r * e), dtype=np.complex128)
        for start in range(0, len(s), _BLOCK):
            part = s[start : start + _BLOCK, None]
            out[start : start + _BLOCK] = (1.0 / (part - poles)) @ residues
            out[start : start + _BLOCK] += self.upper.ravel()
            if self.lower.any():
                out[start : start + _BLOCK] += self.lower.ravel() / part**2
        return out.reshape(-1, r, e)

    @property
    def modal_static(self) -> Array:
        """(r, e) m/N, what the modes and the upper residual alone deflect at 0 Hz."""
        pole = self.poles[:, None, None]
        return np.asarray(-2.0 * (self.residues / pole).real.sum(axis=0) + self.upper)

    @property
    def at_rest(self) -> Array:
        """(r, e) m/N at 0 Hz: of the static load test, of the modes for pairs it left out."""
        if self.static is None:
            return self.modal_static
        return np.asarray(np.where(np.isnan(self.static), self.modal_static, self.static))

    def to_archive(self) -> Archive:
        """Returns the model as document and arrays (SI)."""
        arrays = {
            "poles_re": self.poles.real,
            "poles_im": self.poles.imag,
            "residues_re": self.residues.real,
            "residues_im": self.residues.imag,
            "upper": self.upper,
            "lower": self.lower,
        }
        if self.static is not None:
            arrays["static"] = self.static
        document = {
            "response_axes": list(self.response_axes),
            "excitation_axes": list(self.excitation_axes),
            "valid_hz": list(self.valid),
            "source": self.source,
            "provenance": self.provenance.to_document(),
        }
        return Archive(kind=KIND, schema=SCHEMA, document=document, arrays=arrays)


@dataclass(frozen=True, slots=True, kw_only=True)
class _ModalDocument:
    """Fields of a :class:`ModalModel` that are not arrays."""

    response_axes: tuple[str, ...]
    excitation_axes: tuple[str, ...]
    valid_hz: tuple[float, float]
    source: str
    provenance: object = None


@archive_reader
def modal_model_from_archive(archive: Archive) -> ModalModel:
    """Returns the model of an archive.

    Raises:
        ArchiveError: Another kind, damaged, or written by a newer robotrue.
    """
    archive.expect(KIND, SCHEMA)
    stated = decode(_ModalDocument, dict(archive.document))
    low, high = stated.valid_hz
    if not 0.0 <= low < high:
        raise ArchiveError(f"a modal model that is valid from {low:g} to {high:g} Hz.")
    return ModalModel(
        poles=archive.array("poles_re") + 1j * archive.array("poles_im"),
        residues=archive.array("residues_re") + 1j * archive.array("residues_im"),
        upper=archive.array("upper"),
        lower=archive.array("lower"),
        static=archive.array("static", finite=False) if "static" in archive.arrays else None,
        response_axes=stated.response_axes,
        excitation_axes=stated.excitation_axes,
        valid=(low, high),
        source=stated.source,
        provenance=provenance_from(stated.provenance, before=[stated.source]),
    )
