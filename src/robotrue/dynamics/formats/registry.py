"""Which reader a file of the room of dynamics goes to, by its suffix."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from robotrue.dynamics.force import ForceRecord
from robotrue.dynamics.formats.force_csv import read_force_csv
from robotrue.dynamics.formats.frf_csv import read_frf_csv
from robotrue.dynamics.frf import FrequencyResponse
from robotrue.errors import FormatError

FRF_SUFFIXES: Final = (".csv", ".txt", ".uff", ".unv", ".uf", ".mat")
FORCE_SUFFIXES: Final = (".csv", ".txt", ".tdms", ".mat")


def read_frf(path: str | Path) -> FrequencyResponse:
    """Returns the frequency response of a CSV, UFF58 or MAT file.

    Raises:
        FormatError: Unreadable, without units, or of an unknown suffix.
        ImplausibleDataError: Numbers that cannot be what they claim.
        MissingExtraError: UFF58 without pyuff.
    """
    suffix = Path(path).suffix.lower()
    if suffix in (".uff", ".unv", ".uf"):
        from robotrue.dynamics.formats.uff import read_uff

        return read_uff(path)
    if suffix == ".mat":
        from robotrue.dynamics.formats.mat import read_frf_mat

        return read_frf_mat(path)
    if suffix in FRF_SUFFIXES:
        return read_frf_csv(path)
    raise _unknown(path, FRF_SUFFIXES)


def read_force(path: str | Path) -> tuple[ForceRecord, tuple[str, ...]]:
    """Returns the force record of a CSV, TDMS or MAT file, and what is odd but harmless.

    Raises:
        FormatError: Unreadable, without units, or of an unknown suffix.
        ImplausibleDataError: An uneven clock or a sensor that cannot be right.
        MissingExtraError: TDMS without npTDMS.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".tdms":
        from robotrue.dynamics.formats.force_tdms import read_force_tdms

        return read_force_tdms(path)
    if suffix == ".mat":
        from robotrue.dynamics.formats.mat import read_force_mat

        return read_force_mat(path)
    if suffix in FORCE_SUFFIXES:
        return read_force_csv(path)
    raise _unknown(path, FORCE_SUFFIXES)


def _unknown(path: str | Path, known: tuple[str, ...]) -> FormatError:
    return FormatError(
        f"suffix {Path(path).suffix!r} is not known.",
        source=path,
        hint=f"one of {', '.join(known)}.",
    )
