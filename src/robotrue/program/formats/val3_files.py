"""The XML files of a VAL3 application: points, frames and tools of a ``.dtx``, code of a ``.pgx``.

Parsed with the standard library's expat, which reports the first byte of an element; a document
type declaration is refused before anything is expanded.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, NamedTuple
from xml.parsers import expat

from robotrue.errors import FormatError
from robotrue.program.formats.text_lines import require_text

POINT: Final = "pointRx"
JOINTS: Final = "jointRx"
WORLD: Final = "world[0]"
"""The frame of a point that names none."""
_TARGETS: Final = (POINT, JOINTS)
_KEPT: Final = (*_TARGETS, "frame", "tool")
_COMMENT: Final = re.compile(r'"(?:[^"\\\n]|\\[^\n])*+"?+|//[^\n]*+')
"""Text and comments of the code: what names nothing."""


class FrameValue(NamedTuple):
    """One element of a variable that holds frames or tools.

    Attributes:
        kind: Type of the variable.
        name: Of the variable.
        key: Of the element: a number, or the word of a collection.
        attributes: As written.
    """

    kind: str
    name: str
    key: str
    attributes: dict[str, str]


@dataclass(slots=True)
class PointValues:
    """Elements of variables that hold points or axis values, in the order of the text.

    Attributes:
        is_axis: Axis values, not a pose.
        name: Of the variable.
        key: Of the element: a number, or the word of a collection.
        father: Its reference frame, as written; the root without one.
        start: First byte of its tag.
        line: One-based.
    """

    is_axis: list[bool] = field(default_factory=list)
    name: list[str] = field(default_factory=list)
    key: list[str] = field(default_factory=list)
    father: list[str] = field(default_factory=list)
    start: list[int] = field(default_factory=list)
    line: list[int] = field(default_factory=list)


@dataclass(slots=True)
class Val3Routine:
    """One program of a ``.pgx``.

    Attributes:
        name: Of the program.
        file: Of the job.
        own: Names of its parameters and local variables.
        parameters: Names of its parameters in their order.
        given: Those of the parameters that mean a variable of the caller.
        line: One-based line its code begins in.
        code: The code with blanks for text and comments.
        number: Of the routine in the job.
    """

    name: str
    file: int
    own: set[str] = field(default_factory=set)
    parameters: list[str] = field(default_factory=list)
    given: set[str] = field(default_factory=set)
    line: int = 0
    code: str = ""
    number: int = 0

    def spell(self, name: str) -> str:
        """Returns a name of the routine's own as no variable of the job is spelled."""
        return f"{self.number} {name}"


@dataclass(slots=True)
class Val3File:
    """What one file of an application holds.

    Attributes:
        points: Points and axis values.
        frames: Frames and tools, in the order of the text.
        routines: Programs.
    """

    points: PointValues = field(default_factory=PointValues)
    frames: list[FrameValue] = field(default_factory=list)
    routines: list[Val3Routine] = field(default_factory=list)


def read_val3_file(data: bytes, name: str, file: int) -> Val3File:
    """Returns what a file of an application holds.

    Args:
        data: Its bytes.
        name: Its name.
        file: Its number in the job.

    Raises:
        FormatError: No VAL3 file, one of before version 7, one in inches, or damaged XML.
    """
    require_text(data, name)
    reader = _Reader(name, file)
    reader.parse(data)
    if reader.root not in ("Database", "Programs", "Project"):
        old = reader.root in ("programList", "dataList", "project")
        why = "a file of VAL3 before version 7" if old else f"<{reader.root}> is no VAL3 file"
        raise FormatError(
            f"{why}; <Database>, <Programs> or <Project> is read.",
            source=name,
            line=1,
            hint="export the application for VAL3 s7 or later.",
        )
    return reader.content


class _Reader:
    """Handlers of one parse."""

    def __init__(self, name: str, file: int) -> None:
        self.name, self.file, self.content, self.root = name, file, Val3File(), ""
        self.parser = expat.ParserCreate()
        self._variable: tuple[str, str] | None = None
        self._code: list[str] | None = None
        self._fathers: dict[str, str] = {}  # a name once, however many points have it
        self._open: dict[str, Callable[[dict[str, str]], None]] = {
            "Data": self._begin_variable,
            "Program": self._begin_routine,
            "Parameter": self._add_parameter,
            "Local": self._add_own,
            "Code": self._begin_code,
            "Parameters": self._require_millimetres,
        }

    def parse(self, data: bytes) -> None:
        parser = self.parser
        parser.buffer_text = True
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._text
        parser.StartDoctypeDeclHandler = self._refuse_doctype
        try:
            parser.Parse(data, True)
        except expat.ExpatError as cause:
            raise FormatError(
                f"not well-formed XML: {expat.errors.messages[cause.code]}.",
                source=self.name,
                line=cause.lineno,
                hint="check that the file is complete.",
            ) from cause

    def _refuse_doctype(self, *_: object) -> None:
        raise self._fault("a document type declaration, which VAL3 does not have", "delete it.")

    def _fault(self, what: str, hint: str) -> FormatError:
        line = self.parser.CurrentLineNumber
        return FormatError(f"{what}.", source=self.name, line=line, hint=hint)

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        if tag == "Value":  # nearly all there are
            self._add_value(attributes)
            return
        self.root = self.root or tag
        handle = self._open.get(tag)
        if handle is not None:
            handle(attributes)

    def _end(self, tag: str) -> None:
        if tag == "Data":
            self._variable = None
        elif tag == "Code" and self._code is not None:
            text = "".join(self._code)
            self.content.routines[-1].code = _COMMENT.sub(_blank, text)
            self._code = None

    def _text(self, text: str) -> None:
        if self._code is not None:
            self._code.append(text)

    def _begin_variable(self, attributes: dict[str, str]) -> None:
        kind, name = attributes.get("type", ""), attributes.get("name", "")
        self._variable = (kind, name) if kind in _KEPT and name else None

    def _add_value(self, attributes: dict[str, str]) -> None:
        if self._variable is None:
            return
        kind, name = self._variable
        key = attributes.get("key", "0")
        if kind not in _TARGETS:
            self.content.frames.append(FrameValue(kind, name, key, attributes))
            return
        points, father = self.content.points, attributes.get("fatherId", WORLD)
        points.is_axis.append(kind == JOINTS)
        points.name.append(name)
        points.key.append(key)
        points.father.append(self._fathers.setdefault(father, father))
        points.start.append(self.parser.CurrentByteIndex)
        points.line.append(self.parser.CurrentLineNumber)

    def _begin_routine(self, attributes: dict[str, str]) -> None:
        if self.root == "Programs":
            self.content.routines.append(Val3Routine(attributes.get("name", ""), self.file))

    def _add_own(self, attributes: dict[str, str]) -> None:
        if self.content.routines:
            self.content.routines[-1].own.add(attributes.get("name", ""))

    def _add_parameter(self, attributes: dict[str, str]) -> None:
        self._add_own(attributes)
        for routine in self.content.routines[-1:]:
            routine.parameters.append(attributes.get("name", ""))
            if attributes.get("use") == "reference":
                routine.given.add(routine.parameters[-1])

    def _begin_code(self, _: dict[str, str]) -> None:
        if self.content.routines:
            self._code = []
            self.content.routines[-1].line = self.parser.CurrentLineNumber

    def _require_millimetres(self, attributes: dict[str, str]) -> None:
        if attributes.get("millimeterUnit", "true") != "true":
            raise self._fault(
                "the application counts in inches; millimetres are read",
                "set the unit of length of the application to millimetres.",
            )


def _blank(match: re.Match[str]) -> str:
    text = match[0]
    return re.sub(r"[^\n]", " ", text) if "\n" in text else " " * len(text)
