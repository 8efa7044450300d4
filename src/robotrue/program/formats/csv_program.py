"""Tool paths as CSV as a program whose points are rewritten in place.

The columns are those of :mod:`.toolpath_csv`; separators, quotes and decimals stay.
"""

from __future__ import annotations

from typing import Final

from robotrue.program.formats.path_dialect import PathDialect
from robotrue.program.formats.toolpath_csv import is_toolpath_header
from robotrue.program.program import FrameTable, Program


def _score(data: bytes) -> float:
    return float(is_toolpath_header(data.decode("latin-1").removeprefix("\xef\xbb\xbf")))


def _read(data: bytes, name: str, frames: FrameTable) -> Program:
    from robotrue.program.formats.csv_program_read import read_csv_program

    return read_csv_program(data, name, frames)


DIALECT: Final = PathDialect(name="toolpath_csv", suffixes=(), score=_score, reader=_read)
