"""APT and CL data: the tool path of a CAM system before any post processor.

Read: GOTO/ with three or six numbers (the tool axis is modal), GODLTA/, FROM/ (the start position
of the tool, not a move), UNITS/, MULTAX/, TLAXIS/, RAPID (the next move), FEDRAT/ per minute or per
revolution, SPINDL/, CIRCLE/ and TLON,GOFWD/ as points, INTOL/ and OUTTOL/ for their chords, LOADTL/
and TOOLNO/, names of operations. Words that move nothing are saved as remarks; unknown ones are
listed. Words that would move or bend the path in a way not read here (TRANS/, CUTCOM/, CYCLE/,
loops, motions along surfaces, ...) are refused with their line: ignored, they would make a wrong
program.

Without UNITS/ a file is in millimetres, which its notes state.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Final, NoReturn

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.errors import FormatError
from robotrue.program.formats.apt_arcs import Circle, arc_points, circle_of, directed_circle
from robotrue.program.formats.apt_modal import AptSpeeds, AxisSystems
from robotrue.program.formats.apt_statements import AptStatement, numbers, statements
from robotrue.program.toolpath import Remark, Toolpath

INCH: Final = 25.4 * MM
CHORD: Final = 0.01 * MM
"""m by which points of an arc leave it where the file prints no tolerance."""
LENGTHS: Final = {"MM": MM, "MILLIMETERS": MM, "CM": 10.0 * MM, "INCHES": INCH, "INCH": INCH}
"""m of each unit a file may state."""
UNREAD_MOTIONS: Final = {
    "TRANS": "moves the coordinates",
    "ORIGIN": "moves the coordinates",
    "TRACUT": "moves the coordinates",
    "REFSYS": "moves the coordinates",
    "COPY": "repeats points",
    "INDEX": "repeats points",
    "MIRROR": "mirrors points",
    "ROTABL": "turns the part",
    "ROTATE": "turns the part",
    "ROTHED": "turns the tool",
    "THREAD": "is not a straight move",
    "NURBS": "is not a straight move",
    "MOVARC": "is an arc whose sense differs between systems",
    "POCKET": "makes its own motions",
    "MACRO": "is part of an APT source",
    "CALL": "is part of an APT source",
    "DEFSUB": "begins a subroutine",
    "CALSUB": "repeats points",
    "LOOPST": "is part of an APT source",
    "JUMPTO": "is part of an APT source",
    "GO": "is a motion along surfaces",
    "GOLFT": "is a motion along surfaces",
    "GORGT": "is a motion along surfaces",
    "GOFWD": "is a motion along surfaces",
    "GOBACK": "is a motion along surfaces",
    "GOUP": "is a motion along surfaces",
    "GODOWN": "is a motion along surfaces",
    "GOHOME": "has no end in the file",
    "TLLFT": "is a motion along surfaces",
    "TLRGT": "is a motion along surfaces",
    "TLON": "is a motion along surfaces",
}
"""Words that move or bend the path in a way not read here, and how."""
_OFF_ONLY: Final = {"CYCLE": "makes its own motions", "CUTCOM": "moves the path sideways"}
_KNOWN: Final = frozenset(
    "PARTNO PPRINT INSERT REMARK TPRINT MACHIN FINI END REWIND STOP OPSTOP COOLNT CUTTER TLDATA "
    "CLDIST LINTOL AUTOPS DELAY DISPLY PAINT CLEARP SAFETY TOLER HEAD CLRSRF "
    "SEQNO DEBUG PBS OPNAME SET TURRET CHECK PROBE INTCOD LEADER TOOL".split()
)
"""Words that move nothing: kept for people, without a warning."""
_OPERATION: Final = re.compile(r"OPERATION NAME\s*:\s*(.+)", re.IGNORECASE)


def read_apt(data: bytes, *, source: str) -> Toolpath:
    """Returns the tool path of APT or CL data.

    Args:
        data: The bytes of the file.
        source: Its path, for messages; its stem names the path where the file names no part.

    Raises:
        FormatError: A statement that cannot be understood, with its line.
        ImplausibleDataError: No point, or a path larger than any part.
    """
    reader = _Reader(source)
    for statement in statements(data, source):
        reader.take(statement)
    return reader.finish()


def looks_like_apt(text: str) -> bool:
    """Returns whether a text has the motion statements of APT or CL data."""
    return bool(re.search(r"(?im)^[^\S\n]*+(GOTO|FROM|GODLTA)\s*/", text))


class _Reader:
    """Modal state while the file is read, and the points found so far."""

    def __init__(self, source: str) -> None:
        self.source = source
        self.unit = MM
        self.unit_line = 0
        self.here: Array | None = None
        self.axis = np.array([0.0, 0.0, 1.0])
        self.fixed_axis = False
        self.rapid = False
        self.speeds = AptSpeeds(source)
        self.circle: Circle | None = None
        self.tangent: Array | None = None
        self.inner, self.outer = np.nan, np.nan
        self.operations: list[str] = []
        self.tools: list[tuple[str, int]] = []
        self.remarks: list[Remark] = []
        self.notes: list[str] = []
        self.unknown: dict[str, int] = {}
        self.systems = AxisSystems(source)
        self.points: list[Array] = []
        self.axes: list[Array] = []
        self.columns: list[tuple[float, bool, int, int]] = []
        self._modal: dict[str, Callable[[AptStatement], None]] = {
            "UNITS": self._units,
            "MULTAX": self._multax,
            "TLAXIS": self._tlaxis,
            "INTOL": self._intol,
            "OUTTOL": self._outtol,
            "MSYS": self._msys,
            "TOOL PATH": self._tool_path,
        }

    def take(self, statement: AptStatement) -> None:
        """Takes one statement."""
        self._comment(statement)
        head = statement.head
        word = head.partition(",")[0].partition(" ")[0]
        if not head:
            return
        if self.circle is not None and word not in ("GOTO", "FEDRAT"):
            self._refuse(statement, "between a CIRCLE/ and its GOTO/")
        if head in ("GOTO", "GODLTA", "FROM"):
            self._move(statement)
        elif head == "CIRCLE":
            self.circle = circle_of(statement, self.unit, self.source)
        elif head == "TLON,GOFWD":
            self._add_directed(statement)
        elif head == "INDIRV":
            self.tangent = self._vector(statement)
        elif head in self._modal:
            self._modal[head](statement)
        elif head == "RAPID":
            self.rapid = True
        elif head in ("FEDRAT", "SPINDL"):
            self.speeds.take(statement, self.unit)
            if head == "SPINDL":
                self._keep(statement, known=True)
        elif head in ("LOADTL", "TOOLNO", "SELCTL"):
            if head != "SELCTL":
                self._tool(statement)
            self._keep(statement, known=True)
        elif word in UNREAD_MOTIONS:
            self._refuse(statement, f"{word} {UNREAD_MOTIONS[word]}")
        elif word == "MODE" and "INCR" in statement.arguments:
            self._refuse(
                statement, "MODE/INCR makes coordinates add up; only absolute ones are read"
            )
        elif word in _OFF_ONLY and statement.arguments[:1] not in (("OFF",), ("NOMORE",)):
            self._refuse(statement, f"{word}/ {_OFF_ONLY[word]}")
        else:
            self._keep(statement, known=word in _KNOWN or word in _OFF_ONLY or "END-OF" in head)

    def finish(self) -> Toolpath:
        """Returns what was read."""
        if self.circle is not None:
            raise FormatError(
                "CIRCLE/ without a GOTO/ after it.", source=self.source, line=self.circle.line
            )
        if not self.unit_line:
            self._note(1, "the file does not state UNITS/: millimetres are assumed.")
        if self.systems.own:
            self._note(
                self.systems.own,
                "the points are in a machining axis system; register that frame, and export a "
                "mesh in it.",
            )
        for word, line in self.unknown.items():
            self._note(line, f"{word} is unknown; it was saved as a comment.")
        columns = list(zip(*self.columns, strict=True)) or [(), (), (), ()]
        stem = Path(self.source).stem
        return Toolpath(
            name=stem,
            source=self.source,
            position=np.array(self.points).reshape(-1, 3),
            axis=np.array(self.axes).reshape(-1, 3),
            feed=np.array(columns[0], dtype=np.float64),
            rapid=np.array(columns[1], dtype=np.bool_),
            line=np.array(columns[2], dtype=np.int64),
            operation=np.array(columns[3], dtype=np.int64),
            operations=tuple(self.operations) or (stem,),
            tools=tuple(self.tools),
            remarks=tuple(self.remarks),
            notes=tuple(self.notes),
        )

    def _move(self, statement: AptStatement) -> None:
        values = numbers(statement, self.source)
        if self.circle is not None and statement.head == "GOTO":
            self._arc_to(self.circle, statement, values)
            return
        if len(values) not in (3, 6):
            self._refuse(
                statement, f"{statement.head}/ with {len(values)} numbers, expected 3 or 6"
            )
        if len(values) == 6:
            self._turn(statement, values[3:])
        point = np.array(values[:3]) * self.unit
        if statement.head == "GODLTA":
            if self.here is None:
                self._refuse(statement, "GODLTA/ before any point: it has no start point")
            point = point + self.here
        if statement.head == "FROM":
            self.here = point
            self._keep(statement, known=True)
            return
        self._enter(point[None], self.axis[None], statement.line)

    def _enter(self, points: Array, axes: Array, line: int) -> None:
        """Adds points; a RAPID before them ends with them."""
        feed = np.nan if self.rapid else self.speeds.feed(line)
        if not self.operations:
            self.operations.append(Path(self.source).stem)
        row = (feed, self.rapid, line, len(self.operations) - 1)
        self.points.extend(points)
        self.axes.extend(axes)
        self.columns.extend([row] * len(points))
        self.here, self.rapid, self.tangent = points[-1], False, None

    def _arc_to(self, circle: Circle, statement: AptStatement, values: list[float]) -> None:
        """Adds the arc to a GOTO: one end, or several points of the same arc."""
        before = self.axis
        with_axis = len(values) == 6 and abs(np.linalg.norm(values[3:]) - 1.0) < 0.01
        if len(values) % 3 or not values:
            self._refuse(statement, f"GOTO/ with {len(values)} numbers after CIRCLE/")
        if with_axis:
            self._turn(statement, values[3:])
            values = values[:3]
        self.circle = None
        for end in np.array(values).reshape(-1, 3) * self.unit:
            self._arc(circle, end, before, statement.line)

    def _add_directed(self, statement: AptStatement) -> None:
        if self.here is None:
            self._refuse(statement, "an arc before any point")
        circle, end = directed_circle(
            statement, self.here, self.tangent, self.axis, self.unit, self.source
        )
        self._arc(circle, end, self.axis, statement.line)

    def _arc(self, circle: Circle, end: Array, before: Array, line: int) -> None:
        if self.here is None:
            raise FormatError("an arc before any point.", source=self.source, line=line)
        points = arc_points(circle, self.here, end, self._chord(), self.source)
        share = (np.arange(1, len(points) + 1) / len(points))[:, None]
        axes = (1.0 - share) * before + share * self.axis
        length = np.linalg.norm(axes, axis=1)[:, None]
        if (length < 0.1).any():
            raise FormatError("the tool turns over along the arc.", source=self.source, line=line)
        self._enter(points, axes / length, line)

    def _chord(self) -> float:
        """The tolerance printed so far, or the default."""
        printed = [value for value in (self.inner, self.outer) if value > 0.0]
        return sum(printed) if printed else CHORD

    def _turn(self, statement: AptStatement, values: list[float]) -> None:
        length = math.hypot(*values)
        if not 0.99 <= length <= 1.01:
            self._refuse(statement, f"a tool axis of length {length:.4g}, expected 1")
        axis = np.array(values) / length
        if self.fixed_axis and float(axis @ self.axis) < 1.0 - 1e-6:
            self._refuse(statement, "another tool axis after MULTAX/OFF")
        self.axis = axis

    def _vector(self, statement: AptStatement) -> Array:
        values = numbers(statement, self.source)
        if len(values) != 3 or not np.linalg.norm(values) > 0.0:
            self._refuse(statement, f"{statement.head}/ is not a direction of three numbers")
        return np.array(values)

    def _units(self, statement: AptStatement) -> None:
        word = statement.arguments[0] if statement.arguments else ""
        if word not in LENGTHS:
            self._refuse(statement, f"UNITS/{word}, expected MM or INCHES")
        if LENGTHS[word] != self.unit and (self.points or self.here is not None):
            self._refuse(statement, "UNITS/ after the first point")
        self.unit, self.unit_line = LENGTHS[word], statement.line

    def _multax(self, statement: AptStatement) -> None:
        word = statement.arguments[0] if statement.arguments else "ON"
        if word not in ("ON", "OFF"):
            self._refuse(statement, f"MULTAX/{word}, expected ON or OFF")
        self.fixed_axis = word == "OFF"

    def _tlaxis(self, statement: AptStatement) -> None:
        axis = self._vector(statement)
        self.axis = axis / np.linalg.norm(axis)

    def _intol(self, statement: AptStatement) -> None:
        self.inner = self._tolerance(statement)

    def _outtol(self, statement: AptStatement) -> None:
        self.outer = self._tolerance(statement)

    def _tolerance(self, statement: AptStatement) -> float:
        values = numbers(statement, self.source)
        if not values or min(values) < 0.0:
            self._refuse(statement, f"{statement.head}/ without a tolerance of 0 or more")
        return values[0] * self.unit

    def _tool_path(self, statement: AptStatement) -> None:
        self._operation(statement.text.partition("/")[2].partition(",")[0].strip())
        self._keep(statement, known=True)

    def _operation(self, name: str) -> None:
        self.operations.append(name or f"operation {len(self.operations) + 1}")

    def _tool(self, statement: AptStatement) -> None:
        name = statement.arguments[0] if statement.arguments else ""
        if not self.tools or self.tools[-1][0] != name:
            self.tools.append((name, statement.line))

    def _msys(self, statement: AptStatement) -> None:
        values = tuple(numbers(statement, self.source))
        self.systems.take(values, statement.line, points=bool(self.points))
        self._keep(statement, known=True)

    def _comment(self, statement: AptStatement) -> None:
        """Reads operations and machining axis systems, which some systems write in comments."""
        found = _OPERATION.search(statement.comment)
        if found:
            self._operation(found[1].strip())
        self.systems.comment(statement.comment, statement.line, points=bool(self.points))

    def _note(self, line: int, text: str) -> None:
        self.notes.append(f"{self.source}:{line}: {text}")

    def _keep(self, statement: AptStatement, *, known: bool) -> None:
        remark = Remark(
            before=len(self.points), line=statement.line, text=statement.text, known=known
        )
        self.remarks.append(remark)
        if not known:
            self.unknown.setdefault(statement.head, statement.line)

    def _refuse(self, statement: AptStatement, why: str) -> NoReturn:
        raise FormatError(
            f"{why}: {statement.text[:60]!r}.",
            source=self.source,
            line=statement.line,
            hint="post the path as plain GOTO/ points in one frame.",
        )
