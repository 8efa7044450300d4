"""Tool paths as CSV as a program whose points are rewritten in place.

The columns are those of :mod:`.toolpath_csv`; separators, quotes and decimals stay.
"""

from __future__ import annotations

from typing import Final

from robotrue.core.arrays import Array
from robotrue.program.formats.toolpath_csv import is_toolpath_header, read_toolpath_csv
from robotrue.program.lang.word_languages import (
    LONG_PATH,
    list_losses,
    path_inserter,
    toolpath_feeds,
    write_words,
)
from robotrue.program.language import Cutter, Language, read_each
from robotrue.program.program import FrameTable, Program


def _score(data: bytes) -> float:
    return float(is_toolpath_header(data.decode("latin-1").removeprefix("\xef\xbb\xbf")))


def _read(data: bytes, name: str, frames: FrameTable) -> Program:
    from robotrue.program.formats.csv_program_read import read_csv_program

    return read_csv_program(data, name, frames)


def _feeds(program: Program) -> Array:
    return toolpath_feeds(program, read_toolpath_csv)


def _cutter() -> Cutter:
    from robotrue.program.formats.path_chunks import CSV

    return CSV


LANGUAGE: Final = Language(
    name="toolpath_csv",
    suffixes=(),
    score=_score,
    reader=read_each(_read),
    writer=write_words,
    inserter=path_inserter,
    cutter=_cutter,
    long=LONG_PATH,
    feeds=_feeds,
    losses=list_losses,
    table_suffixes=(".csv",),
)
