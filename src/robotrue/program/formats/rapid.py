"""ABB RAPID: ``.mod``, ``.modx`` and ``.prg`` modules.

What is read: robtargets and jointtargets in motions and in declarations, arrays too; MoveL, MoveJ,
MoveC, MoveAbsJ and their forms with signals and triggers; tools and work objects as the module sets
them. Nothing but the numbers of targets is ever rewritten, tooldata and wobjdata least of all. How
numbers are written is told in :mod:`robotrue.program.formats.rapid_write`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import PurePath
from typing import Final

from robotrue.program.held import as_printed
from robotrue.program.program import FrameTable, Program, Replacement

_HEAD: Final = re.compile(
    rb"^(?:\xef\xbb\xbf)?[^\S\n]*+(?:%%%|MODULE\s+[\w\x80-\xff])", re.IGNORECASE | re.MULTILINE
)
_BODY: Final = re.compile(
    rb"^[^\S\n]*+Move(?:L|J|C|AbsJ)\b[\s\\\[\w\x80-\xff]"
    rb"|\b(?:CONST|PERS|VAR)\s+(?:robtarget|jointtarget)\s"
    rb"|^[^\S\n]*+ENDMODULE\b|^[^\S\n]*+(?:LOCAL\s+)?(?:PERS|VAR|CONST)\s+[\w\x80-\xff]+\s+[\w\x80-\xff]+\s*:=",
    re.IGNORECASE | re.MULTILINE,
)
_MOVES: Final = re.compile(rb"\bMove(?:L|J|C|AbsJ)\b", re.IGNORECASE)
_LOOKED_AT: Final = 1 << 18
"""Bytes that decide on the dialect."""
_BESIDE: Final = ("CalibData.mod", "CalibData.modx")
"""Where ABB's tools keep tooldata and wobjdata."""


class Rapid:
    """The RAPID dialect."""

    name = "rapid"
    suffixes = (".mod", ".modx", ".prg")

    def detect(self, data: bytes) -> float:
        """Returns 1 for a module with a motion or data, less for one of the two."""
        data = data[:_LOOKED_AT]
        return 0.5 * bool(_HEAD.search(data)) + 0.5 * bool(_BODY.search(data))

    def read(self, data: bytes, *, name: str, frames: FrameTable) -> Program:
        """Returns the program of one module.

        Raises:
            FormatError: Not RAPID, or cut off, with the line.
        """
        return self.read_job([(name, data)], frames=frames)[0]

    def companions(self, name: str) -> tuple[str, ...]:
        """Returns the module in which ABB's tools keep the frames of the others."""
        return () if PurePath(name).stem.lower() == "calibdata" else _BESIDE

    def read_job(
        self, files: Sequence[tuple[str, bytes]], *, frames: FrameTable
    ) -> tuple[Program, ...]:
        """Returns one program per file; each with motions is read with the frames of all.

        Raises:
            FormatError: Not RAPID, or cut off, with the file and line.
        """
        from robotrue.program.formats.rapid_read import read_rapid

        first, *others = read_rapid(files, frames)
        out = [first]
        for k, program in enumerate(others, start=1):
            again = _MOVES.search(files[k][1])
            job = [files[k], *files[:k], *files[k + 1 :]]
            out.append(read_rapid(job, frames)[0] if again else program)
        return tuple(out)

    def write(self, program: Program, replacement: Replacement) -> bytes:
        """Returns the module with the numbers of the changed rows replaced.

        Raises:
            ShapeError: A changed row has a value that cannot be written.
        """
        from robotrue.program.formats.rapid_write import write_rapid

        return write_rapid(*as_printed(program, replacement))


DIALECT: Final = Rapid()
