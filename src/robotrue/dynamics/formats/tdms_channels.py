"""Channels of TDMS files, through npTDMS (extra ``dynamics``)."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from robotrue.core.arrays import Array
from robotrue.core.files import read_bytes
from robotrue.errors import FormatError, MissingExtraError


class TdmsChannel(Protocol):
    """A channel of npTDMS, which has no types."""

    name: str
    path: str
    properties: Mapping[str, float | str]

    def __getitem__(self, rows: slice) -> Array: ...


def read_tdms_groups(path: str | Path) -> list[Sequence[TdmsChannel]]:
    """Returns the channels of a file, group by group.

    Raises:
        FormatError: It cannot be read.
        MissingExtraError: Without npTDMS.
    """
    try:
        import nptdms
    except ImportError as cause:
        raise MissingExtraError(
            "TDMS needs npTDMS.", hint="pip install 'robotrue[dynamics]'"
        ) from cause
    try:
        file = nptdms.TdmsFile.read(io.BytesIO(read_bytes(path)))
    except FormatError:
        raise
    except Exception as cause:  # npTDMS raises whatever its parsing meets
        raise FormatError(
            f"cannot be read as TDMS ({type(cause).__name__}: {cause}).", source=path
        ) from cause
    return [group.channels() for group in file.groups()]
