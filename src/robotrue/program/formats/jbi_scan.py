"""One pass over a Yaskawa JBI job: its points, the modal headers over them, its moves.

In ``//POS`` the lines ``///USER``, ``///TOOL``, ``///POSTYPE``, ``///PULSE``, ``///RECTAN``,
``///ANGLE`` and ``///RCONF`` apply to the points that follow, until they are repeated. Robot points
are C and P; BC and BP are those of a base axis, EC and EX of a station.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final, NamedTuple, NoReturn

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.errors import FormatError
from robotrue.program.formats.alike import Alike
from robotrue.program.formats.number_table import Numbers, NumberTable
from robotrue.program.formats.number_text import NUMBER
from robotrue.program.formats.text_lines import require_text

_END: Final = rb"(?:\r\n|\n|\r|\Z)"
_LINE: Final = re.compile(rb"([^\r\n]*)" + _END)
_FINITE: Final = rb"[+-]?(?:\d{1,200}+(?:\.\d*+)?|\.\d++)(?:[eE][+-]?0?\d{1,2}(?!\d))?+"
_CONFIGURATION: Final = rb"[ \t]*+///RCONF[ \t]++((?:[0-9]{1,9},){5,}+[0-9]{1,9})[ \t]*+" + _END
PLAIN_POINT: Final = re.compile(
    rb"(?:" + _CONFIGURATION + rb")?+[ \t]*+([CP])(\d{1,6}+)[ \t]*+=("
    + rb",".join([rb"[ \t]*+" + _FINITE + rb"[ \t]*+"] * 6) + rb")" + _END
)  # fmt: skip
"""A robot point of six numbers, and the configuration in the line before it."""
PLAIN_MOVE: Final = re.compile(rb"[ \t]*+MOV([JLC])[ \t]+C(\d{1,6})(?![^ \t\r\n])([^\r\n]*)" + _END)
_OTHER_POINT: Final = re.compile(rb"(C|P|BC|BP|EC|EX)(\d{1,6})[ \t]*=(.*)")
_HEADER: Final = re.compile(rb"///(\w+)[ \t]*(.*)")
_NUMBER: Final = re.compile(NUMBER)
_WHOLE: Final = r"[ \t]*+[+-]?[0-9]{1,9}[ \t]*+"
_INTEGERS: Final = re.compile(rf"{_WHOLE}(?:,{_WHOLE})*+")
UNITS: Final = {"RECTAN": 0, "ANGLE": 1, "PULSE": 2}
"""How numbers are meant: a pose in mm and deg, axes in deg, axes in pulses."""
_ARGUMENTS: Final = b"//ARGINFO"
_BOM: Final = b"\xef\xbb\xbf"


class Header(NamedTuple):
    """Header state for the points that follow.

    Attributes:
        user: Number of the user frame, empty if none was stated.
        tool: Number of the tool, likewise.
        postype: ``BASE``, ``ROBOT``, ``USER``, ``TOOL``, ``MTOOL``, ``PULSE``, ``ANGLE`` or empty.
        unit: One of ``UNITS``; points without a type are pulses.
    """

    user: str = ""
    tool: str = ""
    postype: str = ""
    unit: int = UNITS["PULSE"]


@dataclass(frozen=True, slots=True, kw_only=True)
class JbiScan:
    """Places of the contents; rows are the robot points in file order.

    Attributes:
        data: The bytes.
        names: (n,) number of each point, P points counted from ``P_POINTS``.
        line: (n,) one-based line.
        header: (n,) index into ``headers``.
        configuration: (n,) index into ``rconf``, -1 before the first.
        count: (n,) number of its values.
        numbers: (n, 6) none for a point of another count.
        headers: Distinct states of the modal headers.
        rconf: The fields of every ``///RCONF`` line.
        counts: Values of ``///NPOS``, empty without it.
        found: Numbers of C, BC, EC, P, BP, EX.
        external: Values of BC, BP, EC and EX points by name.
        pulses: Those of them that are printed in pulses: under ``///PULSE``, or as whole numbers.
        body: Instruction lines (one-based line, text), headers and comments left out, and moves
            that are alike but for their point: of those only the first.
        alike: First byte, end and point of each of the others (k, 3), by the line of the first.
        attributes: Header lines of ``//INST`` (line, name, value).
    """

    data: bytes
    names: IntArray
    line: IntArray
    header: IntArray
    configuration: IntArray
    count: IntArray
    numbers: Numbers
    headers: list[Header]
    rconf: list[tuple[int, ...]]
    counts: tuple[int, ...]
    found: dict[str, int]
    external: dict[tuple[str, int], tuple[float, ...]]
    pulses: set[tuple[str, int]]
    body: list[tuple[int, bytes]]
    alike: dict[int, IntArray]
    attributes: list[tuple[int, str, str]]

    def list_alike(self, line: int) -> Iterator[tuple[int, bytes]]:
        """Yields line and text of the moves after one that are alike."""
        for begin, end, _ in self.alike[line].tolist() if line in self.alike else ():
            line += 1
            yield line, self.data[begin:end].strip(b" \t\r\n")


P_POINTS: Final = 10**6
"""Added to the number of a P point, so that C00001 and P00001 have different names."""


def scan(data: bytes, *, name: str) -> JbiScan:
    """Returns the columns of a job.

    Raises:
        FormatError: Not a job, cut off, or a line that cannot be read.
    """
    require_text(data, name)
    reader = _Reader(data, name)
    reader.read()
    return reader.result()


@dataclass(slots=True)
class _Reader:
    data: bytes
    name: str
    at: int = 0
    line: int = 0
    state: Header = field(default_factory=Header)
    counts: tuple[int, ...] = ()
    index: dict[Header, int] = field(default_factory=dict)
    rconf: list[tuple[int, ...]] = field(default_factory=list)
    external: dict[tuple[str, int], tuple[float, ...]] = field(default_factory=dict)
    pulses: set[tuple[str, int]] = field(default_factory=set)
    found: dict[str, int] = field(default_factory=dict)
    body: list[tuple[int, bytes]] = field(default_factory=list)
    alike: dict[int, IntArray] = field(default_factory=dict)
    attributes: list[tuple[int, str, str]] = field(default_factory=list)
    rows: array[int] = field(default_factory=lambda: array("q"))
    fields: dict[bytes, tuple[int, ...]] = field(default_factory=dict)
    table: NumberTable = field(init=False)

    def __post_init__(self) -> None:
        """Makes the table of the numbers."""
        self.table = NumberTable(self.data, [range(6)], b"'")

    def read(self) -> None:
        """Reads the whole file."""
        self.at = len(_BOM) if self.data.startswith(_BOM) else 0
        self._section(b"/JOB")
        if self._section(b"//POS", b"//INST") == b"//POS":
            self._points()
        self._instructions()

    def result(self) -> JbiScan:
        """Returns the columns."""
        table = np.frombuffer(self.rows, np.int64).reshape(-1, 5)
        names = table[:, 0]
        order = np.argsort(names, kind="stable")
        twice = np.flatnonzero(np.diff(names[order]) == 0)
        if len(twice):
            first, second = table[order[twice[0]], 1], table[order[twice[0] + 1], 1]
            self.line = int(second)
            self._refuse(f"this point is in line {first}, too", "remove one of the two")
        return JbiScan(
            data=self.data,
            names=names,
            line=table[:, 1],
            header=table[:, 2],
            configuration=table[:, 3],
            count=table[:, 4],
            numbers=self.table.numbers(),
            headers=list(self.index),
            rconf=self.rconf,
            counts=self.counts,
            found=self.found,
            external=self.external,
            pulses=self.pulses,
            body=self.body,
            alike=self.alike,
            attributes=self.attributes,
        )

    def _next(self) -> bytes | None:
        """Returns the next line without blanks around it, ``None`` after the last."""
        match = _LINE.match(self.data, self.at)
        if match is None or self.at >= len(self.data):
            return None
        self.at = match.end()
        self.line += 1
        return _strip(match[1])

    def _section(self, *wanted: bytes) -> bytes:
        """Skips headers and comments to one of some section lines and returns it."""
        names = " or ".join(each.decode() for each in wanted)
        while (text := self._next()) is not None:
            if text.upper() in wanted:
                return text.upper()
            if text.upper() == _ARGUMENTS:
                self._pass_arguments()
            if text and not text.startswith((b"/", b"'")):
                self._refuse(f"{_show(text)} is in place of {names}", "export the job again")
        self._refuse(f"the file ends before {names}", "give a whole Yaskawa job")

    def _points(self) -> None:
        """Reads ``//POS`` up to ``//INST``."""
        self.found |= {"C": 0, "P": 0}
        more, alike = True, Alike(self.data, wholes=(3,), zones=(4,))
        while more:
            header = self._header()
            while match := PLAIN_POINT.match(self.data, self.at):
                rconf, kind, number, _ = match.groups()
                if rconf:
                    self.line += 1
                    self._configure(rconf)
                self.line += 1
                self.at = match.end()
                name = self._name(kind.decode(), int(number))
                self.rows.extend((name, self.line, header, len(self.rconf) - 1, 6))
                self.table.add(*match.span(4), 0)
                for found in alike.after(match, len(self.data)):
                    self._points_alike(kind.decode(), bool(rconf), found)
            more = self._other()

    def _points_alike(self, kind: str, configured: bool, found: IntArray) -> None:
        """Notes points like the last one."""
        count = len(found)
        step = np.arange(1, count + 1)[:, None]
        table = np.array(self.rows[-5:]) + step * [0, 1 + configured, 0, configured, 0]
        table[:, 0] = found[:, 2] + (P_POINTS if kind == "P" else 0)
        self.rows.frombytes(table.tobytes())
        self.table.extend(array("q", found[:, 4:6].tobytes()), 0)
        self.rconf += self.rconf[-1:] * (count * configured)
        self.found[kind] += count
        self.line += count * (1 + configured)
        self.at = int(found[-1, 1])

    def _configure(self, text: bytes) -> None:
        """Notes the fields of a plain ``///RCONF``; their texts repeat themselves."""
        fields = self.fields.get(text)
        if fields is None:
            fields = self.fields[text] = tuple(map(int, text.split(b",")))
        self.rconf.append(fields)

    def _pass_arguments(self) -> None:
        """Skips the content of ``//ARGINFO``: kinds of arguments and text for people."""
        at, line = self.at, self.line
        while (text := self._next()) is not None:
            if text.startswith(b"//") and not text.startswith(b"///"):
                self.at, self.line = at, line
                return
            at, line = self.at, self.line

    def _name(self, kind: str, number: int) -> int:
        self.found[kind] += 1
        return number + (P_POINTS if kind == "P" else 0)

    def _header(self) -> int:
        return self.index.setdefault(self.state, len(self.index))

    def _other(self) -> bool:
        """Reads a line of ``//POS`` that is no point of six numbers; False for ``//INST``."""
        text = self._next()
        if text is None:
            self._refuse("the file ends before //INST", "it is cut off: export the job again")
        point, header = _OTHER_POINT.fullmatch(text), _HEADER.fullmatch(text)
        if text.upper() == _ARGUMENTS:
            self._pass_arguments()
            return True
        if text.upper() == b"//INST":
            return False
        if point:
            self._odd_point(point[1].decode(), int(point[2]), point[3])
        elif header:
            self._header_line(header[1].decode("latin-1").upper(), header[2].decode("latin-1"))
        elif text and not text.startswith((b"//", b"'")):
            self._refuse(f"{_show(text)} is no point and no header", "correct or remove it")
        return True

    def _odd_point(self, kind: str, number: int, text: bytes) -> None:
        parts = [part.strip(b" \t") for part in text.split(b",")]
        if not all(_NUMBER.fullmatch(part) for part in parts):
            self._refuse(f"{_show(text)} is no list of numbers", "correct it")
        numbers = tuple(float(part) for part in parts)
        if kind in ("C", "P") and (len(parts) == 6 or not np.isfinite(numbers).all()):
            self._refuse(f"{_show(text)} has a number that cannot be read", "correct it")
        if kind in ("C", "P"):
            row = self._name(kind, number), self.line, self._header(), len(self.rconf) - 1
            self.rows.extend((*row, len(parts)))
            self.table.add(0, 0, 0)
        else:
            self.found[kind] = self.found.get(kind, 0) + 1
            self.external[kind, number] = numbers
            if self.state.unit == UNITS["PULSE"] or b"." not in text:
                self.pulses.add((kind, number))

    def _header_line(self, name: str, value: str) -> None:
        value = value.strip()
        if name == "NPOS":
            self.counts = self._integers(name, value)
        elif name == "USER":
            self.state = self.state._replace(user=str(self._integers(name, value)[0]))
        elif name == "TOOL":
            self.state = self.state._replace(tool=str(self._integers(name, value)[0]))
        elif name == "POSTYPE":
            kind = value.upper()
            self.state = self.state._replace(postype=kind, unit=UNITS.get(kind, 0))
        elif name in UNITS:
            self.state = self.state._replace(unit=UNITS[name])
        elif name == "RCONF":
            fields = self._integers(name, value)
            if len(fields) < 6:
                self._refuse(f"///RCONF has {len(fields)} fields, at least 6 are", "complete it")
            self.rconf.append(fields)

    def _integers(self, name: str, value: str) -> tuple[int, ...]:
        if not _INTEGERS.fullmatch(value):
            self._refuse(f"///{name} {value[:60]!r} is no list of whole numbers", "correct it")
        return tuple(map(int, value.split(",")))

    def _instructions(self) -> None:
        """Reads ``//INST`` to its ``END``."""
        ended, begin, alike = False, self.at, Alike(self.data, wholes=(2,), zones=())
        while (text := self._next()) is not None:
            if text.startswith(b"/"):
                header = _HEADER.fullmatch(text.replace(b"////", b"///", 1))
                if header and not self.body:
                    name, value = header[1].decode("latin-1"), header[2].decode("latin-1")
                    self.attributes.append((self.line, name.upper(), value.strip()))
            elif text and not text.startswith(b"'"):
                ended = text == b"END"
                self.body.append((self.line, text))
                move = PLAIN_MOVE.match(self.data, begin)
                found = list(alike.after(move, len(self.data))) if move else []
                if found:
                    self.alike[self.line] = np.concatenate(found)[:, :3]
                    self.at = int(found[-1][-1, 1])
                    self.line += len(self.alike[self.line])
            begin = self.at
        if not ended:
            self._refuse("the job has no END", "it is cut off: export it again")

    def _refuse(self, what: str, cure: str) -> NoReturn:
        raise FormatError(f"{what}.", source=self.name, line=max(self.line, 1), hint=f"{cure}.")


def _strip(text: bytes) -> bytes:
    return text.strip(b" \t")


def _show(text: bytes) -> str:
    return repr(text[:60].decode("latin-1"))
