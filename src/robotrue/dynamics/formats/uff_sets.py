"""Data sets of universal files through pyuff (extra ``dynamics``): units, directions, origin.

Directions 1, 2, 3 are x, y, z, negative ones the other way. Units are those of the axes' labels,
else of dataset 164.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final, Protocol, TypeAlias

from robotrue.core.arrays import Array
from robotrue.core.files import read_bytes
from robotrue.core.provenance import Provenance, merge, provenance_of_lines, read_provenance
from robotrue.core.units import MM, UM
from robotrue.dynamics.frf import AXES, ComplexArray
from robotrue.errors import FormatError, MissingExtraError

UFF_SUFFIXES: Final = (".uff", ".unv", ".uf")
FORCE_TYPES: Final = (9, 13)
"""Specific data types of a force: excitation and reaction."""
LENGTH_UNITS: Final = {"m": 1.0, "mm": MM, "um": UM, "µm": UM, "μm": UM}
FORCE_UNITS: Final = {"n": 1.0, "kn": 1e3, "mn": 1e-3}
UffSet: TypeAlias = dict[str, str | float | Array | ComplexArray]
"""A data set by the names of pyuff, which has no types."""


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
    """Returns where a file comes from: what its fifth identification lines say of it."""
    stated = provenance_of_lines(f"# {one.get('id5', '')}" for one in sets)
    return merge([read_provenance(path), stated])
