"""Yaskawa JBI: jobs of the DX, FS and YRC controllers as text files.

What is read: C and P points in mm and deg, in degrees of the axes, or in pulses when the pulses
per degree are given; MOVJ, MOVL, MOVC and MOVS; user frames and tools by number. Only the numbers
of robot points are ever rewritten; ``///NPOS`` stays true, because no point is added.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from robotrue.program.program import FrameTable, Program, Replacement

_LOOKED_AT: Final = 1 << 16
_JOB: Final = re.compile(rb"(?:\A(?:\xef\xbb\xbf)?|[\r\n])[ \t]*/JOB[ \t]*[\r\n]", re.IGNORECASE)
_SECTION: Final = re.compile(rb"[\r\n][ \t]*//(?:POS|INST|NAME)\b", re.IGNORECASE)


class Jbi:
    """The JBI dialect."""

    name = "jbi"
    suffixes = (".jbi",)

    def detect(self, data: bytes) -> float:
        """Returns 1 for ``/JOB`` with one of its sections, less for one of the two."""
        data = data[:_LOOKED_AT]
        return 0.5 * bool(_JOB.search(data)) + 0.5 * bool(_SECTION.search(data))

    def read(self, data: bytes, *, name: str, frames: FrameTable) -> Program:
        """Returns the program of one job.

        Raises:
            FormatError: Not a job, cut off, or a line that cannot be read.
        """
        from robotrue.program.formats.jbi_read import read_jbi

        return read_jbi(data, name, frames)

    def companions(self, name: str) -> tuple[str, ...]:
        """Returns none: a job holds its own points."""
        return ()

    def read_job(
        self, files: Sequence[tuple[str, bytes]], *, frames: FrameTable
    ) -> tuple[Program, ...]:
        """Returns one program per file.

        Raises:
            FormatError: Not a job, cut off, or a line that cannot be read.
        """
        from robotrue.program.formats.jbi_moves import quiet_jobs

        quiet = (*frames.harmless_routines, *quiet_jobs(files))
        frames = replace(frames, harmless_routines=quiet)
        return tuple(self.read(data, name=name, frames=frames) for name, data in files)

    def write(self, program: Program, replacement: Replacement) -> bytes:
        """Returns the job with the numbers of the changed rows replaced.

        Raises:
            ShapeError: A changed row has a value that cannot be written.
        """
        from robotrue.program.formats.jbi_write import write_jbi

        return write_jbi(program, replacement)


DIALECT: Final = Jbi()
