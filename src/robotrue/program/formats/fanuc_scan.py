"""One pass over a Fanuc LS program: the records of ``/POS`` and the places of their numbers.

A record is ``P[n:"name"]{ GP1: UF : 1, UT : 1, CONFIG : '..', X = .. mm, .. R = .. deg };``, or
with ``J1= .. deg`` to ``J6``. What follows the sixth number in group 1, and everything in the
other groups, are external axes. ``********`` is a number that was never taught.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final, NoReturn

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.errors import FormatError
from robotrue.program.formats.alike import Alike
from robotrue.program.formats.move_trail import line_start
from robotrue.program.formats.number_table import Numbers, NumberTable
from robotrue.program.formats.number_text import NUMBER
from robotrue.program.formats.text_lines import line_at, require_text

CURRENT: Final = -1
"""UF or UT that is written ``F``: the number in force."""
_COLUMNS: Final = 7
"""Number, first byte, kind, first byte and length of CONFIG (-1, 0 without), UF, UT."""
_SECTION: Final = re.compile(rb"/(PROG|MN|POS|END)\b")
_BEFORE_SECTION: Final = re.compile(rb"[ \t]*+(?:\xef\xbb\xbf)?[ \t]*+")
RECORD_HEAD: Final = re.compile(
    rb"\s*P\s*\[\s*(\d{1,6})\s*(?::[^\]\r\n]*)?\]\s*\{\s*", re.IGNORECASE
)
_GROUP: Final = re.compile(
    rb"GP(\d{1,2})\s*:\s*UF\s*:\s*(\d{1,9}|F)\s*,\s*UT\s*:\s*(\d{1,9}|F)\s*,\s*"
    rb"(?:\w+\s*:\s*'([^'\r\n]*)'\s*,\s*)?",
    re.IGNORECASE,
)
_FIELD: Final = rb"(\w{1,4})\s*=\s*(\*+|" + NUMBER + rb")\s*(mm|deg)\s*"
_ONE: Final = re.compile(_FIELD, re.IGNORECASE)
_SIX: Final = re.compile(rb",\s*".join([_FIELD] * 6), re.IGNORECASE)
PLAIN_RECORD: Final = re.compile(
    rb"\s*+(P)\s*+\[\s*+(\d{1,6}+)\s*+(?::[^\]\r\n]*+)?\]\s*+\{\s*+GP1\s*+:"
    rb"\s*+UF\s*+:\s*+(\d{1,9}+|F)\s*+,\s*+UT\s*+:\s*+(\d{1,9}+|F)\s*+,"
    rb"(?:\s*+CONFIG\s*+:\s*+'([^'\r\n]*+)'\s*+,)?"
    + rb"("
    + rb",".join(
        rb"\s*+%c\s*+=\s*+[+-]?(?:\d{1,15}+(?:\.\d{0,15}+)?|\.\d{1,15}+)\s*+%s\s*+" % pair
        for pair in zip(b"XYZWPR", (b"mm", b"mm", b"mm", b"deg", b"deg", b"deg"), strict=True)
    )
    + rb")\}\s*+;"
)
"""A pose of group 1 alone, as controllers write them by the thousand."""
RECORD_END: Final = re.compile(rb"\}\s*;")
_POINT: Final = re.compile(rb"\bP[ \t]*\[[ \t]*(\d{1,6})(?!\d)")
_BLANK: Final = re.compile(rb"\s*")
_COMMA: Final = re.compile(rb"\s*,\s*")
_NAMES: Final[dict[tuple[bytes, ...], int]] = {
    (b"X", b"Y", b"Z", b"W", b"P", b"R"): 0,
    (b"J1", b"J2", b"J3", b"J4", b"J5", b"J6"): 1,
}
_PROG: Final = re.compile(rb"^/PROG[ \t]+(\w+)", re.MULTILINE)
_POSITIONS: Final = re.compile(rb"^[ \t]*/POS\b", re.MULTILINE)
STATEMENT: Final = re.compile(rb"\s*+(?:(\d{0,6}+)\s*+:)?+([^;]*+);[ \t]*+(?:\r\n|\n|\r)?")
_UNITS: Final = ((b"mm", b"mm", b"mm", b"deg", b"deg", b"deg"), (b"deg",) * 6)


@dataclass(frozen=True, slots=True, kw_only=True)
class FanucScan:
    """Places of the contents; rows are the records with a group 1, in file order.

    Attributes:
        data: The bytes.
        number: (n,) of each record.
        place: (n,) a byte of its first line.
        frame: (n,) its UF, ``CURRENT`` for F.
        tool: (n,) its UT, likewise.
        is_axis: (n,) it holds J1 to J6.
        numbers: (n, 6) NaN where never taught.
        config: (n, 2) first byte and length of the text in the quotes of CONFIG, -1 without.
        external: Values of external axes (group, axis, value) by row.
        others: First byte of the records without a group 1, by number.
        statements: First byte and end of the part between ``/MN`` and ``/POS``.
    """

    data: bytes
    number: IntArray
    place: IntArray
    frame: IntArray
    tool: IntArray
    is_axis: IntArray
    numbers: Numbers
    config: IntArray
    external: dict[int, list[tuple[int, str, float]]]
    others: dict[int, int]
    statements: tuple[int, int]

    @property
    def highest(self) -> int:
        """Highest number of a position, or of one that a statement names; 0 without any."""
        named = map(int, _POINT.findall(self.data, *self.statements))
        return max(int(self.number.max(initial=0)), *self.others, *named, 0)

    @property
    def last_record(self) -> int:
        """A byte of the last record."""
        return max([int(self.numbers.start[:, 5].max(initial=0)), *self.others.values()])


def find_program(data: bytes) -> tuple[str, int, int] | None:
    """Returns the name in ``/PROG``, in lower case, the place after it, and that of ``/POS``."""
    head = _PROG.search(data)
    if head is None:
        return None
    positions = _POSITIONS.search(data, head.end())
    name = head[1].decode("latin-1").lower()
    return name, head.end(), positions.start() if positions else len(data)


def list_statements(data: bytes, first: int, last: int) -> Iterator[re.Match[bytes]]:
    """Yields the statements between two places: line number and text are groups 1 and 2."""
    match = STATEMENT.match(data, first, last)
    while match is not None:
        yield match
        match = STATEMENT.match(data, match.end(), last)


def scan(data: bytes, *, name: str) -> FanucScan:
    """Returns the columns of a program.

    Raises:
        FormatError: Not an LS program, cut off, or a record that cannot be read.
    """
    require_text(data, name)
    reader = _Reader(data, name)
    statements, (first, last) = reader.sections()
    reader.records(first, last)
    return reader.result(statements)


@dataclass(slots=True)
class _Reader:
    data: bytes
    name: str
    rows: array[int] = field(default_factory=lambda: array("q"))
    odd: dict[int, tuple[list[tuple[int, int]], list[float]]] = field(default_factory=dict)
    frames: dict[bytes, int] = field(default_factory=dict)
    table: NumberTable = field(init=False)
    external: dict[int, list[tuple[int, str, float]]] = field(default_factory=dict)
    others: dict[int, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Makes the table of the numbers."""
        self.table = NumberTable(self.data, [range(6)], b";")

    def sections(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Returns the places of the statements and of the records."""
        found: dict[str, re.Match[bytes]] = {}
        for match in _SECTION.finditer(self.data):
            key = match[1].decode()
            if not self._begins_line(match.start()):
                continue
            if key in found:
                place = match.start(1) - 1
                self._refuse(f"a second /{key}", "give one program per file", place)
            found[key] = match
        for key, cure in (
            ("PROG", "give a Fanuc LS program (ASCII), not the binary TP"),
            ("MN", "the file is cut off: export the program again"),
            ("POS", "the file is cut off: export the program again"),
            ("END", "the file is cut off: export the program again"),
        ):
            if key not in found:
                self._refuse(f"there is no /{key}", cure, 0 if key == "PROG" else len(self.data))
        ends = [found[key].start(1) - 1 for key in ("PROG", "MN", "POS", "END")]
        if ends != sorted(ends):
            self._refuse("sections in another order than /PROG, /MN, /POS, /END", "export again", 0)
        return (found["MN"].end(), ends[2]), (found["POS"].end(), ends[3])

    def _begins_line(self, place: int) -> bool:
        begin = line_start(self.data, place)
        blank = _BEFORE_SECTION.match(self.data, begin, place)
        return blank is not None and blank.end() == place

    def records(self, at: int, end: int) -> None:
        """Reads the records between two places."""
        data = self.data
        while True:
            at = self._plain_records(at, end)
            match = RECORD_HEAD.match(data, at, end)
            if match is None:
                break
            at = self._record(int(match[1]), match.start(1), match.end(), end)
        rest = _BLANK.match(data, at, end)
        at = rest.end() if rest else at
        if at < end:
            self._refuse(f"{_show(data, at)} is no position record", "correct it", at)

    def _plain_records(self, at: int, end: int) -> int:
        """Reads the poses of group 1 alone from a byte on; returns the byte after them."""
        edges, alike = array("q"), Alike(self.data, wholes=(2,), zones=(6,), places=(1, 5))
        while match := PLAIN_RECORD.match(self.data, at, end):
            frames = self._frame(match[3]), self._frame(match[4])
            first, last = match.span(5)
            self.rows.extend((int(match[2]), match.start(1), 0, first, last - first, *frames))
            edges.extend(match.span(6))
            at = match.end()
            for found in alike.after(match, end):
                table = np.empty((len(found), _COLUMNS), np.int64)
                table[:, :4] = found[:, [2, 6, 0, 8]]
                table[:, 2], table[:, 4], table[:, 5:] = 0, found[:, 9] - found[:, 8], frames
                self.rows.frombytes(table.tobytes())
                edges.frombytes(found[:, 4:6].tobytes())
                at = int(found[-1, 1])
        self.table.extend(edges, 0)
        return at

    def _frame(self, text: bytes) -> int:
        number = self.frames.get(text)
        if number is None:
            number = self.frames[text] = int(text) if text.isdigit() else CURRENT
        return number

    def _record(self, number: int, place: int, at: int, end: int) -> int:
        """Reads the groups of one record up to its ``};`` and returns the place after it."""
        data, has_one, groups = self.data, False, 0
        while True:
            group = _GROUP.match(data, at, end)
            if group is None:
                break
            groups += 1
            row = len(self.rows) // _COLUMNS
            if group[1].lstrip(b"0") == b"1" and not has_one:
                has_one = True
                at = self._robot(number, place, group, end)
                at = self._axes(row, 1, at, end)
            else:
                row = row - 1 if has_one else row
                at = self._axes(row, int(group[1]), group.end(), end)
        close = RECORD_END.match(data, at, end)
        if close is None or not groups:
            what = f"{_show(data, at)} in P[{number}] cannot be read"
            self._refuse(what, "a record holds groups GPn with UF, UT and numbers in mm or deg", at)
        if not has_one:
            if self.others.setdefault(number, place) != place:
                self._twice(number, self.others[number], place)
            self.external.pop(len(self.rows) // _COLUMNS, None)
        return close.end()

    def _robot(self, number: int, place: int, group: re.Match[bytes], end: int) -> int:
        """Reads the six numbers of group 1 and returns the place after them."""
        data = self.data
        six = _SIX.match(data, group.end(), end)
        if six is None:
            what = f"{_show(data, group.end())} in P[{number}] are not six numbers in mm or deg"
            self._refuse(what, "six-axis robots are supported", group.end())
        groups = six.groups()
        kind = _kind(groups[0::3], groups[2::3])
        if kind < 0:
            what = f"{_show(data, group.end())} in P[{number}] is neither X Y Z W P R nor J1 to J6"
            self._refuse(what, "positions are in mm and deg", group.end())
        quoted = group.start(4)
        config = (quoted, group.end(4) - quoted) if quoted >= 0 else (-1, 0)
        frames = self._frame(group[2]), self._frame(group[3])
        self.rows.extend((number, place, kind, *config, *frames))
        numbers = [np.nan if text[:1] == b"*" else float(text) for text in groups[1::3]]
        if np.inf in numbers or -np.inf in numbers:
            self._refuse(f"a number in P[{number}] is too large", "correct it", six.start(2))
        self.odd[self.table.add(0, 0, 0)] = list(six.regs[2::3]), numbers
        return six.end()

    def _axes(self, row: int, group: int, at: int, end: int) -> int:
        """Reads further numbers of a group as external axes of a row."""
        while self.data[at : at + 1] != b"}":
            comma = _COMMA.match(self.data, at, end)
            one = _ONE.match(self.data, comma.end() if comma else at, end)
            if one is None:
                return at
            value = np.nan if one[2].startswith(b"*") else float(one[2])
            self.external.setdefault(row, []).append((group, one[1].decode("latin-1"), value))
            at = one.end()
        return at

    def result(self, statements: tuple[int, int]) -> FanucScan:
        """Returns the columns."""
        table = np.frombuffer(self.rows, np.int64).reshape(-1, _COLUMNS)
        self._require_once(table)
        numbers = self.table.numbers()
        if self.odd:
            rows = list(self.odd)
            spans = np.array([spans for spans, _ in self.odd.values()], np.int64)
            numbers.start[rows] = spans[:, :, 0]
            numbers.length[rows] = spans[:, :, 1] - spans[:, :, 0]
            numbers.value[rows] = [values for _, values in self.odd.values()]
        return FanucScan(
            data=self.data,
            number=table[:, 0],
            place=table[:, 1],
            frame=table[:, 5],
            tool=table[:, 6],
            is_axis=table[:, 2],
            numbers=numbers,
            config=table[:, 3:5],
            external=self.external,
            others=self.others,
            statements=statements,
        )

    def _require_once(self, table: IntArray) -> None:
        number = np.concatenate([table[:, 0], np.array(list(self.others), np.int64)])
        place = np.concatenate([table[:, 1], np.array(list(self.others.values()), np.int64)])
        order = np.lexsort((place, number))
        twice = np.flatnonzero(np.diff(number[order]) == 0)
        if len(twice):
            first, second = order[twice[0]], order[twice[0] + 1]
            self._twice(int(number[first]), int(place[first]), int(place[second]))

    def _twice(self, number: int, first: int, second: int) -> NoReturn:
        what = f"P[{number}] is in line {line_at(self.data, first)}, too"
        self._refuse(what, "remove one of the two", second)

    def _refuse(self, what: str, cure: str, place: int) -> NoReturn:
        line = line_at(self.data.rstrip(), place)
        raise FormatError(f"{what}.", source=self.name, line=line, hint=f"{cure}.")


def _kind(names: tuple[bytes, ...], units: tuple[bytes, ...]) -> int:
    """Returns 0 for a pose, 1 for axis values, -1 for neither."""
    kind = _NAMES.get(names, -1)
    return kind if kind >= 0 and units == _UNITS[kind] else -1


def _show(data: bytes, place: int) -> str:
    text = data[place : place + 60].replace(b"\r", b"\n")
    return repr(text.partition(b"\n")[0].decode("latin-1").strip())
