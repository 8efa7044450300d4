"""Universal files through pyuff (extra ``dynamics``): their data sets, and responses of dataset 58.

Function type 4 is a response, 6 a coherence. The form is the ordinate's specific data type: 8 a
displacement, 11 a velocity, 12 an acceleration, over 13 or 9, a force. Directions 1, 2, 3 are x, y,
z, negative ones the other way. Units are those of the axes' labels, else of dataset 164; a file
with neither is refused.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple, Protocol, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.files import read_bytes, write_atomic
from robotrue.core.provenance import (
    Provenance,
    mark_line,
    merge,
    provenance_of_lines,
    read_provenance,
)
from robotrue.core.units import MM, STANDARD_GRAVITY, UM
from robotrue.dynamics.frf import AXES, ComplexArray, FrequencyResponse
from robotrue.dynamics.frf_checks import AxisPairCurves, assemble_response
from robotrue.errors import FormatError, MissingExtraError

UFF_SUFFIXES: Final = (".uff", ".unv", ".uf")
FORCE_TYPES: Final = (9, 13)
"""Specific data types of a force: excitation and reaction."""
LENGTH_UNITS: Final = {"m": 1.0, "mm": MM, "um": UM, "µm": UM, "μm": UM}
FORCE_UNITS: Final = {"n": 1.0, "kn": 1e3, "mn": 1e-3}
UffSet: TypeAlias = dict[str, str | float | Array | ComplexArray]
"""A data set by the names of pyuff, which has no types."""
_FORM: Final = {8: "receptance", 11: "mobility", 12: "accelerance"}
_RESPONSE, _COHERENCE = 4, 6
_MOTION_UNITS: Final = {
    "receptance": LENGTH_UNITS,
    "mobility": {"m/s": 1.0, "mm/s": MM},
    "accelerance": {"m/s2": 1.0, "m/s^2": 1.0, "m/s²": 1.0, "mm/s2": MM, "mm/s^2": MM}
    | dict.fromkeys(("g", "gn"), STANDARD_GRAVITY),
}
_ID: Final = 80
"""Characters of an identification line."""


class _UffFile(Protocol):
    def read_sets(self) -> UffSet | list[UffSet]: ...

    def write_sets(self, one: UffSet, mode: str) -> None: ...


class Pyuff(Protocol):
    """The module, which has no types."""

    UFF: Callable[[str], _UffFile]


def import_pyuff() -> Pyuff:
    """Returns pyuff.

    Raises:
        MissingExtraError: It is not installed.
    """
    try:
        import pyuff
    except ImportError as cause:
        raise MissingExtraError(
            "universal files need pyuff.", hint="pip install 'robotrue[dynamics]'"
        ) from cause
    found: Pyuff = pyuff
    return found


def read_sets(path: str | Path) -> list[UffSet]:
    """Returns the data sets of a file in their order.

    Raises:
        FormatError: Unreadable, no universal file, or cut off.
        MissingExtraError: pyuff is not installed.
    """
    pyuff = import_pyuff()
    data = read_bytes(path)
    if b"    -1" not in data[:400]:
        raise FormatError(
            "not a universal file: no delimiter -1 at its beginning.", source=path, hint="UFF58."
        )
    if sum(line.rstrip() == b"    -1" for line in data.split(b"\n")) % 2:
        # pyuff would leave the last set out without a word.
        raise FormatError(
            "the file ends in the middle of its last set.", source=path, hint="export it again."
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = pyuff.UFF(str(path)).read_sets()
    except Exception as cause:  # pyuff raises whatever its parsing meets
        raise FormatError(
            f"cannot be read as a universal file ({type(cause).__name__}: {cause}).",
            source=path,
            hint="export it again, as ASCII.",
        ) from cause
    return [found] if isinstance(found, dict) else list(found)


def read_direction(one: UffSet, what: str, number: int, path: str | Path) -> tuple[str, float]:
    """Returns axis and sign of ``rsp_dir`` or ``ref_dir`` of a set.

    Raises:
        FormatError: A rotation, or no direction.
    """
    direction = int(one[what])
    if abs(direction) not in (1, 2, 3):
        raise FormatError(
            f"set {number}: direction {direction} of the "
            f"{'response' if what == 'rsp_dir' else 'reference'}, expected 1 to 3 or -1 to -3.",
            source=path,
            hint="give the channel its direction before exporting.",
        )
    return AXES[abs(direction) - 1], 1.0 if direction > 0 else -1.0


def unit_of(one: UffSet, key: str, known: Mapping[str, float]) -> float | None:
    """Returns the factor to SI of the label of an axis, or None where it names no known unit."""
    label = str(one.get(key) or "").strip()
    if label in known:
        return known[label]
    return known.get(label.lower().replace(" ", ""))


def units_of_file(sets: Sequence[UffSet]) -> tuple[float | None, float | None]:
    """Returns length and force of the file in m and N (dataset 164 gives SI over file), or None."""
    for one in sets:
        if int(one.get("type", 0)) == 164:
            return 1.0 / float(one["length"]), 1.0 / float(one["force"])
    return None, None


def sets_origin(path: str | Path, sets: Sequence[UffSet]) -> Provenance:
    """Returns where a file comes from: from its fifth identification lines."""
    stated = provenance_of_lines(f"# {one.get('id5', '')}" for one in sets)
    return merge([read_provenance(path), stated])


class _Curve(NamedTuple):
    """A response in the SI unit of its form, or a coherence, whose form is empty."""

    number: int
    pair: str
    form: str
    lines: Array
    values: ComplexArray


def read_uff(path: str | Path) -> FrequencyResponse:
    """Returns all responses of a file as one.

    Raises:
        FormatError: Unreadable, no response in it, no unit, directions that are rotations,
            different lines, a pair twice.
        ImplausibleDataError: Numbers that contradict their stated form.
        MissingExtraError: pyuff is not installed.
    """
    sets = read_sets(path)
    units = units_of_file(sets)
    curves = [
        _read_curve(one, number, path, units)
        for number, one in enumerate(sets, 1)
        if int(one.get("type", 0)) == 58 and int(one["func_type"]) in (_RESPONSE, _COHERENCE)
    ]
    for k, curve in enumerate(curves):
        lines = curves[0].lines
        if len(curve.lines) != len(lines) or not np.allclose(curve.lines, lines, rtol=1e-6):
            raise FormatError(
                f"set {curve.number} ({curve.pair}) has other lines than those before it.",
                source=path,
                hint="export all curves from one spectrum.",
            )
        if any(c.pair == curve.pair and bool(c.form) == bool(curve.form) for c in curves[:k]):
            raise FormatError(
                f"set {curve.number} is {curve.pair} for the second time.",
                source=path,
                hint="keep one driving point per file.",
            )
    response = {c.pair: c.values for c in curves if c.form}
    forms = sorted({curve.form for curve in curves if curve.form})
    if not forms:
        raise FormatError(
            "no frequency response in it (dataset 58, function type 4).",
            source=path,
            hint="export frequency response functions.",
        )
    if len(forms) > 1:
        raise FormatError(f"curves of {' and '.join(forms)}.", source=path)
    coherence = {c.pair: c.values.real for c in curves if not c.form and c.pair in response}
    pairs = AxisPairCurves(form=forms[0], response=response, coherence=coherence)
    origin = sets_origin(path, sets)
    return assemble_response(curves[0].lines, pairs, source=str(path), provenance=origin)


def write_uff(path: str | Path, frf: FrequencyResponse) -> None:
    """Writes the receptances (and coherences) as ASCII dataset 58, whole or not at all.

    Raises:
        FormatError: The file cannot be written.
        MissingExtraError: pyuff is not installed.
    """
    import tempfile

    pyuff = import_pyuff()
    with tempfile.TemporaryDirectory() as folder:
        # pyuff writes by path and appends; the file moves to its final path when it is complete.
        beside = Path(folder) / "response.uff"
        out = pyuff.UFF(str(beside))
        for pair in frf.pairs:
            i, j = frf.index(pair)
            out.write_sets(_set(frf, pair, frf.response[:, i, j], _RESPONSE), "add")
            if frf.coherence is not None:
                out.write_sets(_set(frf, pair, frf.coherence[:, i, j], _COHERENCE), "add")
        write_atomic(path, read_bytes(beside))


def _set(frf: FrequencyResponse, pair: str, values: ComplexArray | Array, kind: int) -> UffSet:
    """Returns the fields that pyuff does not fill in by itself."""
    step = np.diff(frf.frequency)
    is_response = kind == _RESPONSE
    return {
        "type": 58,
        "func_type": kind,
        "rsp_node": 1,
        "rsp_dir": AXES.index(pair[0]) + 1,
        "ref_node": 1,
        "ref_dir": AXES.index(pair[1]) + 1,
        "id1": f"{'FRF' if is_response else 'coherence'} {pair}",
        "id5": mark_line(frf.provenance).strip("# \n")[:_ID] or "NONE",
        "abscissa_spacing": int(np.allclose(step, step[0], rtol=1e-9)),
        "abscissa_spec_data_type": 18,
        "abscissa_axis_units_lab": "Hz",
        "ordinate_spec_data_type": 8 if is_response else 0,
        "ordinate_axis_units_lab": "m" if is_response else "NONE",
        "orddenom_spec_data_type": 13 if is_response else 0,
        "orddenom_axis_units_lab": "N" if is_response else "NONE",
        "x": frf.frequency,
        "data": values,
    }


def _read_curve(
    one: UffSet, number: int, path: str | Path, units: tuple[float | None, float | None]
) -> _Curve:
    """The curve of a set; ``units`` are length and force of the file in m and N, if stated."""
    response, one_sign = read_direction(one, "rsp_dir", number, path)
    reference, other_sign = read_direction(one, "ref_dir", number, path)
    axes, sign = response + reference, one_sign * other_sign
    lines = np.asarray(one["x"], dtype=np.float64)
    values = np.asarray(one["data"], dtype=np.complex128)
    if not np.isfinite(values).all():
        where = int(np.argmin(np.isfinite(values)))
        raise FormatError(
            f"set {number} ({axes}) holds no number at {lines[where]:g} Hz.", source=path
        )
    if int(one["func_type"]) == _COHERENCE:
        return _Curve(number, axes, "", lines, values)
    form, scale = _form_and_scale(one, number, path, *units)
    return _Curve(number, axes, form, lines, np.asarray(sign * scale * values, np.complex128))


def _form_and_scale(
    one: UffSet, number: int, path: str | Path, length: float | None, force: float | None
) -> tuple[str, float]:
    """Form of the curve and the factor to its SI unit."""
    kinds = (int(one["ordinate_spec_data_type"]), int(one["orddenom_spec_data_type"]))
    if kinds[0] not in _FORM or kinds[1] not in FORCE_TYPES:
        raise FormatError(
            f"set {number} is of data type {kinds[0]} over {kinds[1]}, expected 8, 11 or 12 over a "
            "force (13).",
            source=path,
            hint="export it with the types of its channels.",
        )
    form = _FORM[kinds[0]]
    above = unit_of(one, "ordinate_axis_units_lab", _MOTION_UNITS[form])
    below = unit_of(one, "orddenom_axis_units_lab", FORCE_UNITS)
    above = length if above is None else above
    below = force if below is None else below
    if above is None or below is None:
        raise FormatError(
            f"set {number} has no unit: labels {one.get('ordinate_axis_units_lab')!r} over "
            f"{one.get('orddenom_axis_units_lab')!r}, and no dataset 164.",
            source=path,
            hint="export with units, or as CSV with G??_re_m_per_s2_per_N.",
        )
    return form, above / below
