"""Modal state of APT and CL data: machining axis systems, feed and spindle.

Three systems state the frame of the points in three ways: ``$$*CATIA0`` with a name and three rows
in comments, ``MSYS/``, and ``$$-> CSYS /`` with twelve numbers. The points are left in that frame;
what matters is that it is one for the whole file, and that the user learns of it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.units import MM
from robotrue.errors import FormatError
from robotrue.program.formats.apt_statements import AptStatement, is_number, to_number
from robotrue.program.toolpath import FASTEST

_ROWS: Final = "*CATIA0"
_TWELVE: Final = "-> CSYS"
_PLAIN: Final = ((1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0), (0, 0, 0, 1, 0, 0, 0, 1, 0))
_PER_MINUTE: Final = {"MMPM": MM, "IPM": 25.4 * MM, "MPM": 1.0, "FPM": 304.8 * MM}
_PER_SECOND: Final = {"MMPS": MM, "IPS": 25.4 * MM}
_PER_TURN: Final = {"MMPR": MM, "IPR": 25.4 * MM}


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
        """Reads one of three rows of four numbers; the name of the system precedes the first."""
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
                "a second machining axis system: the points before and after it are in different "
                "frames.",
                source=self.source,
                line=line,
                hint="post one file per axis system, or all operations in one.",
            )
        self._known = values
        if not plain and not self.own:
            self.own = line


class AptSpeeds:
    """Feed and spindle in force.

    Attributes:
        turns: Spindle turns per second; NaN where not known.
    """

    def __init__(self, source: str) -> None:
        self.source = source
        self.turns = np.nan
        self._feed, self._per_turn = np.nan, False

    def feed(self, line: int) -> float:
        """Returns the feed in force in m/s; NaN if none was stated.

        Raises:
            FormatError: It is per revolution and the spindle's speed is not known, or too fast.
        """
        value = self._feed * self.turns if self._per_turn else self._feed
        if self._per_turn and not np.isfinite(value):
            raise FormatError(
                "the feed is per revolution and no SPINDL/ gives the revolutions.",
                source=self.source,
                line=line,
                hint="state the feed per minute (FEDRAT/ v,MMPM).",
            )
        if value > FASTEST:
            raise FormatError(
                f"the feed is {value / MM:g} mm/s, at most {FASTEST / MM:g} mm/s is allowed.",
                source=self.source,
                line=line,
                hint="check the unit of FEDRAT/.",
            )
        return float(value)

    def take(self, statement: AptStatement, unit: float) -> None:
        """Takes a FEDRAT/ or SPINDL/ statement; ``unit`` is m per unit of the file.

        Raises:
            FormatError: A feed without a number above 0, or in a unit that is not known.
        """
        values = [to_number(word) for word in statement.arguments if is_number(word)]
        words = [word for word in statement.arguments if not is_number(word)]
        if statement.head == "SPINDL":
            self._spindle(values, words)
            return
        if len(values) != 1 or not values[0] > 0.0:
            raise self._fault(statement, "expected one number above 0")
        scale = [
            table[word] / time
            for word in words
            for table, time in ((_PER_MINUTE, 60.0), (_PER_SECOND, 1.0), (_PER_TURN, 1.0))
            if word in table
        ]
        self._per_turn = any(word in _PER_TURN or word == "PERREV" for word in words)
        if "PERREV" in words:
            scale.append(unit)
        elif "PERMIN" in words or not words:
            scale.append(unit / 60.0)
        if len(scale) != 1:
            raise self._fault(statement, "expected MMPM, IPM, MMPR, IPR, PERMIN or PERREV")
        self._feed = values[0] * scale[0]

    def _spindle(self, values: list[float], words: list[str]) -> None:
        """A surface speed (SFM, SMM) or a bare ON does not state revolutions; OFF stops them."""
        if "OFF" in words:
            self.turns = np.nan
        elif values and not {"SFM", "SMM", "MAXRPM", "RANGE"} & set(words):
            self.turns = values[0] / 60.0

    def _fault(self, statement: AptStatement, wanted: str) -> FormatError:
        return FormatError(
            f"{statement.text[:60]!r}: {wanted}.",
            source=self.source,
            line=statement.line,
            hint="FEDRAT/ 300.0,MMPM",
        )
