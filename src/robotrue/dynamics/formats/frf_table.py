"""Frequency responses as CSV or MAT, and which reader a file goes to.

CSV: ``f_Hz`` and ``Gxx_re_m_per_N, Gxx_im_m_per_N, ...``. The first letter of a pair is the
response, the second the excitation. ``m_per_s_per_N`` is a mobility, ``m_per_s2_per_N`` an
accelerance, ``um_per_N`` and ``mm_per_N`` receptances; one unit per file. ``Cxx`` is the coherence
of a pair. A line at 0 Hz of a receptance is its static deflection.

MAT (to version 7.2): the same names, complex ``Gxx_m_per_N`` in place of two columns; or all pairs
at once as ``G_m_per_N`` (m, 3, 3), response axis first.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance, mark_line, read_provenance
from robotrue.core.units import MM, UM
from robotrue.dynamics.formats.column_table import (
    ColumnTable,
    check_suffix,
    finite_samples,
    mat_column,
    read_column_table,
    read_mat,
    table_bytes,
)
from robotrue.dynamics.formats.uff import UFF_SUFFIXES
from robotrue.dynamics.frf import AXES, ComplexArray, FrequencyResponse
from robotrue.dynamics.frf_checks import AxisPairCurves, assemble_response
from robotrue.errors import FormatError

FRF_SUFFIXES: Final = (".csv", ".txt", *UFF_SUFFIXES, ".mat")
UNITS: Final = {
    "m_per_N": ("receptance", 1.0),
    "mm_per_N": ("receptance", MM),
    "um_per_N": ("receptance", UM),
    "m_per_s_per_N": ("mobility", 1.0),
    "m_per_s2_per_N": ("accelerance", 1.0),
}
"""Unit in a column's name to form and scale."""
_PART: Final = re.compile(r"G([xyz])([xyz])_(re|im)(?:_(\w+))?")
_CURVE: Final = re.compile(r"G([xyz]{2})?_(\w+)")
_COHERENCE: Final = re.compile(r"C([xyz]{2})")


def read_frf(path: str | Path) -> FrequencyResponse:
    """Returns the frequency response of a CSV, UFF58 or MAT file.

    Raises:
        FormatError: Unreadable, of an unknown suffix, a column or variable that is not known or
            without its unit, half of a complex pair, a cell that is no finite number, lines out of
            order; with its line where there are lines.
        ImplausibleDataError: Numbers that contradict the form in their name (see
            ``frf_checks.check_response``).
        MissingExtraError: UFF58 without pyuff.
    """
    suffix = check_suffix(path, FRF_SUFFIXES)
    if suffix == ".mat":
        return _read_mat(path)
    if suffix in (".csv", ".txt"):
        return _read_csv(path)
    from robotrue.dynamics.formats.uff import read_uff  # here, so that tables do not need pyuff

    return read_uff(path)


def write_frf_csv(path: str | Path, frf: FrequencyResponse) -> None:
    """Writes a response as receptance, whole or not at all; its static deflection at 0 Hz.

    The static deflection is left out where it is not known for every pair.

    Raises:
        FormatError: The file cannot be written.
    """
    names, columns = ["f_Hz"], [frf.frequency]
    at_rest: list[float] = [0.0]
    for pair in frf.pairs:
        i, j = frf.index(pair)
        values = frf.response[:, i, j]
        names += [f"G{pair}_re_m_per_N", f"G{pair}_im_m_per_N"]
        columns += [values.real, values.imag]
        at_rest += [np.nan if frf.static is None else float(frf.static[i, j]), 0.0]
        if frf.coherence is not None:
            names.append(f"C{pair}")
            columns.append(frf.coherence[:, i, j])
            at_rest.append(1.0)
    table = np.column_stack(columns)
    if frf.frequency[0] > 0.0 and np.isfinite(at_rest).all():
        table = np.vstack([at_rest, table])
    write_atomic(path, mark_line(frf.provenance).encode() + table_bytes(names, table))


def _build_response(
    path: str | Path,
    frequency: Array,
    curves: dict[str, ComplexArray],
    coherence: dict[str, Array],
    unit: str,
    provenance: Provenance,
) -> FrequencyResponse:
    """The response of curves by pair, in one of the units."""
    form, scale = UNITS[unit]
    response = {
        pair: np.asarray(scale * values, dtype=np.complex128) for pair, values in curves.items()
    }
    pairs = AxisPairCurves(form=form, response=response, coherence=coherence)
    return assemble_response(frequency, pairs, source=str(path), provenance=provenance)


def _read_csv(path: str | Path) -> FrequencyResponse:
    table = read_column_table(path)
    parts, coherence, unit = _sort_columns(table)
    if "f_Hz" not in table.names:
        raise table.fault(
            f"no column f_Hz; the file has {', '.join(table.names[:6])}.",
            "a frequency in rad/s has to be divided by 2 pi.",
        )
    frequency = table.column("f_Hz")
    falls = np.flatnonzero(np.diff(frequency) <= 0.0)
    if falls.size or frequency[0] < 0.0:
        row = int(falls[0]) + 1 if falls.size else 0
        raise FormatError(
            f"f_Hz is {frequency[row]:g} after {frequency[max(row - 1, 0)]:g}; it has to rise "
            "from 0 or above.",
            source=path,
            line=table.line(row),
            hint="sort the lines; leave negative frequencies out.",
        )
    curves: dict[str, ComplexArray] = {
        pair: np.asarray(table.column(re_) + 1j * table.column(im))
        for pair, (re_, im) in parts.items()
    }
    return _build_response(path, frequency, curves, coherence, unit, table.provenance)


def _read_mat(path: str | Path) -> FrequencyResponse:
    variables = read_mat(path)
    frequency = mat_column(variables, "f_Hz", path)
    n = len(frequency)
    curves: dict[str, ComplexArray] = {}
    coherence: dict[str, Array] = {}
    units: set[str] = set()
    for name, values in variables.items():
        curve, plain = _CURVE.fullmatch(name), _COHERENCE.fullmatch(name)
        if plain is not None:
            coherence[plain[1]] = mat_column(variables, name, path, n)
        elif curve is not None and curve[2] in UNITS:
            units.add(curve[2])
            if curve[1] is not None:
                curves[curve[1]] = finite_samples(np.ravel(values), name, path, n)
                continue
            if values.shape != (n, 3, 3):
                raise FormatError(
                    f"{name} has shape {values.shape}, expected ({n}, 3, 3).", source=path
                )
            for i, j in np.argwhere(values.any(axis=0)):
                curves[AXES[i] + AXES[j]] = finite_samples(values[:, i, j], name, path, n)
        elif name.startswith("G"):
            raise FormatError(
                f"{name} has no unit that is known.",
                source=path,
                hint=f"end its name in one of {', '.join(UNITS)}.",
            )
    if len(units) != 1:
        raise FormatError(
            f"{len(units)} units of responses, expected one: variables {', '.join(variables)}.",
            source=path,
            hint="save f_Hz and Gxx_m_per_N.",
        )
    return _build_response(path, frequency, curves, coherence, units.pop(), read_provenance(path))


def _sort_columns(
    table: ColumnTable,
) -> tuple[dict[str, tuple[str, str]], dict[str, Array], str]:
    """Names of real and imaginary columns by pair, coherence by pair, the unit of all."""
    halves: dict[str, dict[str, str]] = {}
    coherence: dict[str, Array] = {}
    units: dict[str, str] = {}

    for name in table.names:
        part, plain = _PART.fullmatch(name), _COHERENCE.fullmatch(name)
        if part is not None and part[4] is None:
            raise table.fault(
                f"column {name!r} has no unit.",
                f"call it {name}_m_per_N, or {name}_m_per_s2_per_N if it is an accelerance.",
            )
        if part is not None and part[4] in UNITS:
            halves.setdefault(part[1] + part[2], {})[part[3]] = name
            units.setdefault(part[4], name)
        elif plain is not None:
            coherence[plain[1]] = table.column(name)
        elif name != "f_Hz":
            raise table.fault(
                f"column {name!r} is not known; expected f_Hz, G??_re_UNIT, G??_im_UNIT and C?? "
                f"with UNIT one of {', '.join(UNITS)}, ?? of {', '.join(AXES)}.",
                "rename or remove the column.",
            )
    if not halves:
        raise table.fault("no column G??_re_m_per_N.", "export real and imaginary parts.")
    if len(units) > 1:
        raise table.fault(f"two units: {', '.join(units.values())}.", "one unit per file.")
    for pair, found in halves.items():
        if set(found) != {"re", "im"}:
            raise table.fault(
                f"G{pair} has only its {next(iter(found))} part.", "export both parts of it."
            )
    return {p: (h["re"], h["im"]) for p, h in halves.items()}, coherence, next(iter(units))
