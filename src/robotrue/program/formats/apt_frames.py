"""Machining axis systems of APT and CL data: in which frame the points of a file stand.

Three systems say it in three ways: ``$$*CATIA0`` with a name and three rows in comments, ``MSYS/``,
and ``$$-> CSYS /`` with twelve numbers. The points are left in that frame; what matters is that it
is one for the whole file, and that the user learns of it.
"""

from __future__ import annotations

from typing import Final

from robotrue.errors import FormatError
from robotrue.program.formats.apt_statements import is_number, to_number

_ROWS: Final = "*CATIA0"
_TWELVE: Final = "-> CSYS"
_PLAIN: Final = ((1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0), (0, 0, 0, 1, 0, 0, 0, 1, 0))


class AxisSystems:
    """The axis system in force.

    Attributes:
        own: Line of the first system that is not the part's own axes; 0 without one.
    """

    def __init__(self, source: str) -> None:
        self.source = source
        self.own = 0
        self._known: tuple[float, ...] | None = None
        self._rows: list[float] | None = None
        self._named = False

    def comment(self, text: str, line: int, *, points: bool) -> None:
        """Takes a comment.

        Args:
            text: Without its dollar signs.
            line: Of it.
            points: The file had points before it.

        Raises:
            FormatError: A row that cannot be read, or a second axis system.
        """
        head = text.upper()
        if head.startswith(_ROWS):
            self._rows, self._named = [], False
        elif head.startswith(_TWELVE):
            words = text.partition("/")[2].split(",")
            if len(words) == 12 and all(map(is_number, words)):
                self.take(tuple(to_number(word) for word in words), line, points=points)
        elif self._rows is not None and text:
            self._row(self._rows, text, line, points=points)

    def _row(self, rows: list[float], text: str, line: int, *, points: bool) -> None:
        """One of three rows of four numbers; the name of the system stands before the first."""
        words = text.split()
        if len(words) == 4 and all(map(is_number, words)):
            rows.extend(to_number(word) for word in words)
        elif rows or self._named:
            raise FormatError(
                f"{text[:60]!r} is no row of the machining axis system before it.",
                source=self.source,
                line=line,
                hint="post the file again, or take the comment *CATIA0 out.",
            )
        else:
            self._named = True
        if len(rows) == 12:
            self._rows = None
            self.take(tuple(rows), line, points=points)

    def take(self, values: tuple[float, ...], line: int, *, points: bool) -> None:
        """Takes an axis system as its system prints it.

        Raises:
            FormatError: Another one was in force, or none while there were points.
        """
        plain = values in _PLAIN
        if values != self._known and (self._known is not None or (points and not plain)):
            raise FormatError(
                "a second machining axis system: the points before and after it stand in "
                "different frames.",
                source=self.source,
                line=line,
                hint="post one file per axis system, or all operations in one.",
            )
        self._known = values
        if not plain and not self.own:
            self.own = line
