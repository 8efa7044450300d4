"""Fanuc LS: TP programs as text (ASCII), with their positions in ``/POS``.

What is read: positions as X Y Z W P R or J1 to J6; J, L, C, A and S moves; user frames and tools
by number. Only the numbers of positions and the CONFIG they ask for are ever rewritten.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from robotrue.program.program import FrameTable, Program, Replacement

_LOOKED_AT: Final = 1 << 16
_PROG: Final = re.compile(rb"(?:\A(?:\xef\xbb\xbf)?|[\r\n])[ \t]*/PROG\b")
_SECTION: Final = re.compile(rb"[\r\n][ \t]*/(?:ATTR|MN|POS)[ \t]*[\r\n]")


class FanucLs:
    """The Fanuc LS dialect."""

    name = "fanuc_ls"
    suffixes = (".ls",)

    def detect(self, data: bytes) -> float:
        """Returns 1 for ``/PROG`` with one of its sections, less for one of the two."""
        data = data[:_LOOKED_AT]
        return 0.5 * bool(_PROG.search(data)) + 0.5 * bool(_SECTION.search(data))

    def read(self, data: bytes, *, name: str, frames: FrameTable) -> Program:
        """Returns the program of one file.

        Raises:
            FormatError: Not an LS program, cut off, or a record that cannot be read.
        """
        from robotrue.program.formats.fanuc_read import read_fanuc

        return read_fanuc(data, name, frames)

    def companions(self, name: str) -> tuple[str, ...]:
        """Returns none: a program holds its own positions."""
        return ()

    def read_job(
        self, files: Sequence[tuple[str, bytes]], *, frames: FrameTable
    ) -> tuple[Program, ...]:
        """Returns one program per file.

        Raises:
            FormatError: Not an LS program, cut off, or a record that cannot be read.
        """
        from robotrue.program.formats.fanuc_moves import quiet_programs

        quiet = (*frames.harmless_routines, *quiet_programs(files))
        frames = replace(frames, harmless_routines=quiet)
        return tuple(self.read(data, name=name, frames=frames) for name, data in files)

    def write(self, program: Program, replacement: Replacement) -> bytes:
        """Returns the file with the numbers of the changed rows replaced.

        Raises:
            ShapeError: A changed row has a value that cannot be written.
        """
        from robotrue.program.formats.fanuc_write import write_fanuc

        return write_fanuc(program, replacement)


DIALECT: Final = FanucLs()
