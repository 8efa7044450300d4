"""What the dialects of paths of words share: all but how they are told apart and read."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from robotrue.program.program import FrameTable, Program, Replacement

LOOKED_AT: Final = 1 << 16
_OTHERS: Final = re.compile(
    rb"(?im)^[^\S\n]*+(?:/JOB|/PROG|&ACCESS|DEF(?:DAT)?\s+\w+ *\(|(?:SYS)?MODULE\b|def |///"
    rb"|GOTO\s*/)|x_mm"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PathDialect:
    """A dialect.

    Attributes:
        name: Registered name.
        suffixes: Of its files.
        score: Returns 0..1: how surely bytes are in it.
        reader: Returns the program of bytes of a file name.
    """

    name: str
    suffixes: tuple[str, ...]
    score: Callable[[bytes], float]
    reader: Callable[[bytes, str, FrameTable], Program]

    def detect(self, data: bytes) -> float:
        """Returns 0..1: how surely these bytes are in this dialect."""
        return self.score(data[:LOOKED_AT])

    def read(self, data: bytes, *, name: str, frames: FrameTable) -> Program:
        """Returns the program of one file.

        Raises:
            FormatError: The bytes are not in this dialect, with the line.
        """
        return self.reader(data, name, frames)

    def companions(self, name: str) -> tuple[str, ...]:
        """Returns none: a program holds its own points."""
        return ()

    def read_job(
        self, files: Sequence[tuple[str, bytes]], *, frames: FrameTable
    ) -> tuple[Program, ...]:
        """Returns one program per file.

        Raises:
            FormatError: The bytes are not in this dialect, with the line.
        """
        return tuple(self.read(data, name=name, frames=frames) for name, data in files)

    def write(self, program: Program, replacement: Replacement) -> bytes:
        """Returns the file with the words of the changed rows replaced.

        Raises:
            ShapeError: A changed row has a value that cannot be written.
        """
        from robotrue.program.formats.path_write import write_path

        return write_path(program, replacement)

    def list_unfollowed(self, program: Program, replacement: Replacement) -> tuple[str, ...]:
        """Returns what the written file cannot say of the new points, one sentence each."""
        from robotrue.program.formats.path_losses import path_losses

        return path_losses(program, replacement)


def is_other_language(data: bytes) -> bool:
    """Returns whether bytes have what no G-code has: heads of robot programs, APT, tables."""
    return bool(_OTHERS.search(data))
