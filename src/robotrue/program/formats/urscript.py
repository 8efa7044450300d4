"""UR script: ``.script`` files of Universal Robots.

What is read: movel, movej, movep and movec to literal poses ``p[...]``, to literal axes ``[...]``,
and to variables that hold one; ``pose_trans`` with a literal frame, ``get_inverse_kin`` of a pose;
the tool of ``set_tcp``. Nothing but the numbers of targets is ever rewritten, tools and frames
least of all. How numbers are written is told in :mod:`robotrue.program.formats.urscript_write`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

from robotrue.errors import FormatError
from robotrue.program.program import FrameTable, Program, Replacement

_MOTION: Final = re.compile(
    rb"(?<![\w.])(?:move[lpjc]|set_tcp)\s*\(\s*(?:p?\[|[A-Za-z_]\w*\s*[,)(=])", re.IGNORECASE
)
_HEAD: Final = re.compile(
    rb"^(?:\xef\xbb\xbf)?[^\S\n]*+def\s+\w++\s*+\((?:(?!^[^\S\n]*+def\s)[^)])*+\)\s*+:",
    re.MULTILINE,
)
"""A head that is not closed before the next one: what closes that one would close it, too."""
_FOREIGN: Final = re.compile(rb"^[^\S\n]*+(?:import|from)\s+\w|^[^\S\n]*+&ACCESS", re.MULTILINE)
_LOOKED_AT: Final = 1 << 18
"""Bytes that decide on the dialect."""


class UrScript:
    """The UR script dialect."""

    name = "urscript"
    suffixes = (".script", ".urscript")

    def detect(self, data: bytes) -> float:
        """Returns 1 for routines with motions, less for motions alone, 0 for Python."""
        data = data[:_LOOKED_AT]
        if _FOREIGN.search(data):
            return 0.0
        return 0.8 * bool(_MOTION.search(data)) + 0.2 * bool(_HEAD.search(data))

    def read(self, data: bytes, *, name: str, frames: FrameTable) -> Program:
        """Returns the program of one script.

        Raises:
            FormatError: Not a UR script, or cut off, with the line.
        """
        from robotrue.program.formats.text_lines import require_text
        from robotrue.program.formats.urscript_build import build
        from robotrue.program.formats.urscript_scan import blank_comments, routines
        from robotrue.program.formats.urscript_walk import ScriptWalk

        require_text(data, name)
        code = blank_comments(data)
        found = routines(code, name)
        walk = ScriptWalk(code, found, frames.harmless_routines)
        walk.all()
        if len(found) == 1 and not walk.moves:
            raise FormatError(
                "not a UR script: no 'def' and no motion was found.",
                source=name,
                line=1,
                hint="give the .script that the controller runs.",
            )
        return build(walk, data, name, frames)

    def companions(self, name: str) -> tuple[str, ...]:
        """Returns nothing: a script holds its own points."""
        return ()

    def read_job(
        self, files: Sequence[tuple[str, bytes]], *, frames: FrameTable
    ) -> tuple[Program, ...]:
        """Returns one program per script.

        Raises:
            FormatError: Not a UR script, or cut off, with the file and line.
        """
        return tuple(self.read(data, name=name, frames=frames) for name, data in files)

    def write(self, program: Program, replacement: Replacement) -> bytes:
        """Returns the script with the numbers of the changed rows replaced.

        Raises:
            ShapeError: A changed row has a value that cannot be written.
        """
        from robotrue.program.formats.urscript_write import write_urscript

        return write_urscript(program, replacement)


DIALECT: Final = UrScript()
