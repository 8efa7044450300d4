"""KUKA KRL: ``.src`` programs and the ``.dat`` files beside them.

What is read: inline, stored, array and structure points; PTP, LIN, CIRC and their S and SPL forms;
base and tool as the program sets them. Nothing but the numbers of targets is ever rewritten,
``$BASE``, ``$TOOL``, ``BASE_DATA``, ``TOOL_DATA`` and ``LOAD_DATA`` least of all. How numbers are
written is told in :mod:`robotrue.program.formats.krl_write`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import PurePath
from typing import Final

from robotrue.program.held import as_printed
from robotrue.program.program import FrameTable, Program, Replacement

_HEAD: Final = re.compile(
    rb"^(?:\xef\xbb\xbf)?[^\S\n]*+&ACCESS|^[^\S\n]*+(?:GLOBAL\s+)?DEF(?:DAT|FCT)?\s+\w",
    re.IGNORECASE | re.MULTILINE,
)
_MOTION: Final = re.compile(
    rb"^[^\S\n]*+S?(?:PTP|LIN|CIRC|SPL)(?:_REL)?\s*\{|=\s*\{\s*(?:E6POS|E6AXIS|POS|FRAME|AXIS)\s*:",
    re.IGNORECASE | re.MULTILINE,
)


_QUOTED: Final = re.compile(rb'"(?=([^"\r\n]+)")')
_CAMROB: Final = re.compile(rb"CR_PROCESS_FILE\s*\(\s*\Z", re.IGNORECASE)
_BEFORE: Final = 128
"""Bytes in which a call and the blanks behind it stand before the name it hands over."""
_LOOKED_AT: Final = 1 << 18
"""Bytes that decide on the dialect."""


class Krl:
    """The KRL dialect."""

    name = "krl"
    suffixes = (".src", ".dat", ".sub")

    def detect(self, data: bytes) -> float:
        """Returns 1 for a KRL header with a motion or point, less for one of the two."""
        data = data[:_LOOKED_AT]
        python_like = re.search(rb"^[^\S\n]*+def\s+\w+\(.*\):", data, re.MULTILINE)
        head = bool(_HEAD.search(data)) and not python_like
        motion = bool(_MOTION.search(data))
        return 0.5 * motion + 0.5 * head

    def read(self, data: bytes, *, name: str, frames: FrameTable) -> Program:
        """Returns the program of one file.

        Raises:
            FormatError: Not KRL, cut off, or a number that cannot be read.
        """
        return self.read_job([(name, data)], frames=frames)[0]

    def companions(self, name: str) -> tuple[str, ...]:
        """Returns the ``.dat`` of a ``.src`` and the other way round, in either case."""
        path = PurePath(name)
        other = "src" if path.suffix.lower() == ".dat" else "dat"
        return tuple(f"{path.stem}.{form}" for form in (other, other.upper(), other.capitalize()))

    def named_files(self, data: bytes) -> tuple[str, ...]:
        """Returns the CAMRob files that a program hands to ``CR_PROCESS_FILE``."""
        if b'"' not in data:
            return ()
        names = [  # few quotes and many letters: the quotes are looked for
            quoted[1].decode("latin-1")
            for quoted in _QUOTED.finditer(data)
            if _CAMROB.search(data, max(0, quoted.start() - _BEFORE), quoted.start())
        ]
        return tuple(dict.fromkeys(name for name in names if not re.search(r"[/\\:]", name)))

    def read_job(
        self, files: Sequence[tuple[str, bytes]], *, frames: FrameTable
    ) -> tuple[Program, ...]:
        """Returns one program per file, read together.

        Raises:
            FormatError: Not KRL, cut off, or a number that cannot be read.
        """
        from robotrue.program.formats.krl_read import read_krl

        return read_krl(files, frames)

    def write(self, program: Program, replacement: Replacement) -> bytes:
        """Returns the file with the numbers of the changed rows replaced.

        Raises:
            ShapeError: A changed row has a value that cannot be written.
        """
        from robotrue.program.formats.camrob import write_camrob
        from robotrue.program.formats.krl_write import KrlSpans, write_krl

        if not isinstance(program.spans, KrlSpans):
            return write_camrob(program, replacement)
        return write_krl(*as_printed(program, replacement))


DIALECT: Final = Krl()
