"""Frequency responses and force records in MAT files (to version 7.2), through SciPy.

The variables carry the names of the CSV columns. Responses: ``f_Hz`` and complex ``Gxx_m_per_N``
(or ``_m_per_s2_per_N`` and so on), ``Cxx``; or all pairs at once as ``G_m_per_N`` (m, 3, 3),
response axis first. Forces: ``fx_N, fy_N, fz_N`` with ``t_s`` or ``rate_Hz``.
"""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.files import read_bytes
from robotrue.core.provenance import read_provenance
from robotrue.dynamics.clock import even_rate
from robotrue.dynamics.force import ForceRecord, check_force
from robotrue.dynamics.formats.frf_csv import UNITS
from robotrue.dynamics.frf import AXES, ComplexArray, FrequencyResponse
from robotrue.dynamics.frf_build import AxisPairCurves, assemble_response
from robotrue.errors import FormatError

_CURVE: Final = re.compile(r"G(?:([xyz])([xyz]))?_(\w+)")
_COHERENCE: Final = re.compile(r"C([xyz])([xyz])")


def read_frf_mat(path: str | Path) -> FrequencyResponse:
    """Returns the response of a MAT file.

    Raises:
        FormatError: Unreadable, a variable missing, without unit or of another length.
        ImplausibleDataError: Numbers that cannot be what their names say.
    """
    found = _variables(path)
    frequency = _vector(found, "f_Hz", path, None)
    response: dict[str, ComplexArray] = {}
    coherence: dict[str, Array] = {}
    units: set[str] = set()
    for name, values in found.items():
        curve, plain = _CURVE.fullmatch(name), _COHERENCE.fullmatch(name)
        if plain is not None:
            coherence[plain[1] + plain[2]] = _vector(found, name, path, len(frequency))
        elif curve is not None and curve[3] in UNITS:
            units.add(curve[3])
            scale = UNITS[curve[3]][1]
            if curve[1] is not None:
                column = _finite(np.ravel(np.asarray(values)), name, path, len(frequency))
                response[curve[1] + curve[2]] = np.asarray(scale * column, dtype=np.complex128)
                continue
            cube = np.asarray(values)
            if cube.shape != (len(frequency), 3, 3):
                raise FormatError(
                    f"{name} has shape {cube.shape}, expected ({len(frequency)}, 3, 3).",
                    source=path,
                )
            for i, j in np.ndindex(3, 3):
                if cube[:, i, j].any():
                    column = _finite(cube[:, i, j], name, path, len(frequency))
                    response[AXES[i] + AXES[j]] = np.asarray(scale * column, dtype=np.complex128)
        elif name.startswith("G"):
            raise FormatError(
                f"{name} has no unit that is known.",
                source=path,
                hint=f"end its name in one of {', '.join(UNITS)}.",
            )
    if len(units) != 1:
        raise FormatError(
            f"{len(units)} units of responses, expected one: variables {', '.join(found)}.",
            source=path,
            hint="save f_Hz and Gxx_m_per_N.",
        )
    pairs = AxisPairCurves(form=UNITS[units.pop()][0], response=response, coherence=coherence)
    return assemble_response(frequency, pairs, source=str(path), provenance=read_provenance(path))


def read_force_mat(path: str | Path) -> tuple[ForceRecord, tuple[str, ...]]:
    """Returns the force record of a MAT file, checked, and what is odd about it but harmless.

    Raises:
        FormatError: Unreadable, a variable missing, without unit, of another length, not finite.
        ImplausibleDataError: An uneven clock or a sensor that cannot be right.
    """
    found = _variables(path)
    force = _vector(found, "fx_N", path, None)
    columns = [force] + [_vector(found, f"f{axis}_N", path, len(force)) for axis in "yz"]
    if "rate_Hz" in found:
        start, rate = 0.0, float(_vector(found, "rate_Hz", path, 1)[0])
    else:
        start, rate = even_rate(_vector(found, "t_s", path, len(force)), path)
    record = ForceRecord(
        start=start,
        rate=rate,
        force=np.column_stack(columns),
        source=str(path),
        provenance=read_provenance(path),
    )
    return record, check_force(record)


def _variables(path: str | Path) -> dict[str, object]:
    from scipy.io import loadmat  # here, so that text files do not pay for it

    data = read_bytes(path)
    if data[:8] == b"\x89HDF\r\n\x1a\n" or data.startswith(b"MATLAB 7.3"):
        raise FormatError(
            "a MAT file of version 7.3 (HDF5).", source=path, hint="save it with -v7."
        )
    try:
        found = loadmat(io.BytesIO(data))  # type: ignore[arg-type]  # files work, too
    except Exception as cause:  # SciPy raises whatever its parsing meets
        raise FormatError(
            f"cannot be read as a MAT file ({cause}).", source=path, hint="save it with -v7."
        ) from cause
    return {name: value for name, value in found.items() if not name.startswith("__")}


def _vector(found: dict[str, object], name: str, path: str | Path, length: int | None) -> Array:
    if name not in found:
        raise FormatError(
            f"no variable {name}; the file has {', '.join(found) or 'none'}.",
            source=path,
            hint="names carry their units, as in the CSV.",
        )
    column = np.ravel(np.asarray(found[name]))
    return np.asarray(_finite(column, name, path, length).real, dtype=np.float64)


def _finite(column: object, name: str, path: str | Path, length: int | None) -> ComplexArray:
    values = np.asarray(column)
    if length is not None and len(values) != length:
        raise FormatError(f"{name} has {len(values)} values, expected {length}.", source=path)
    if values.dtype.kind not in "fiuc" or not np.isfinite(values).all():
        bad = int(np.argmin(np.isfinite(values))) if values.dtype.kind in "fc" else 0
        raise FormatError(
            f"sample {bad} of {name} is {values[bad]}, expected a finite number.", source=path
        )
    return np.asarray(values, dtype=np.complex128)
