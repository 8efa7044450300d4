"""Numbers in the tags of VAL3 points: their places and values."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import BoolArray, Bytes, IntArray
from robotrue.core.compiled import PLAIN, compile_kernel
from robotrue.core.units import DEG
from robotrue.errors import FormatError
from robotrue.program.formats.number_table import read_tokens
from robotrue.program.formats.target_tokens import TargetTokens
from robotrue.program.formats.val3_files import PointValues

POSE_NAMES: Final = ("x", "y", "z", "rx", "ry", "rz")
AXIS_NAMES: Final = ("j1", "j2", "j3", "j4", "j5", "j6")
_TAG: Final = len(b"<Value")
_TAG_BYTES: Final = np.frombuffer(b"<Value", np.uint8)
_ATTRIBUTES: Final = np.array(
    [[*name.encode().ljust(3, b"\0")] for name in ("key", *POSE_NAMES, *AXIS_NAMES)], np.uint8
)
_DIGITS: Final = 9, 20
"""Most of the number of an element, and most bytes of a number of a plain point."""


def find_point_numbers(data: bytes, points: PointValues, name: str) -> TargetTokens:
    """Returns the places of the six numbers of every point; NaN where one is left out.

    Args:
        data: A file that was parsed as XML without an error.
        points: Its points.
        name: Of the file.

    Raises:
        FormatError: A number that cannot be read.
    """
    shape = (len(points.start), 6)
    start, length = np.full(shape, -1), np.zeros(shape, np.int64)
    plain = np.ones(shape, np.bool_)
    first = np.array([*points.start, len(data)], np.int64)
    is_axis = np.array(points.is_axis, np.bool_)
    _find_attributes(np.frombuffer(data, np.uint8), first, is_axis, start, length, plain)
    value = read_tokens(data, np.where(plain, start, -1), length)
    odd = np.argwhere(~plain | np.isinf(value))
    if len(odd):
        row, column = odd[0].tolist()
        place = int(start[row, column])
        written = data[place : place + int(length[row, column])].decode("utf-8", "replace")
        text = " ".join(written.split())[:60]
        word = (AXIS_NAMES if is_axis[row] else POSE_NAMES)[column]
        raise FormatError(
            f"{word} of {points.name[row]}[{points.key[row]}] is {text!r}, expected a number.",
            source=name,
            line=points.line[row],
            hint="write the value as a decimal number.",
        )
    return TargetTokens(
        start=start,
        length=length,
        value=value,
        kind=is_axis.astype(np.int64),
        unit=np.full((2, 6), DEG),
        whole=np.zeros(2, np.bool_),
        x_first=True,
    )


@compile_kernel(PLAIN)
def _find_attributes(
    buf: Bytes,
    first: IntArray,
    is_axis: BoolArray,
    start: IntArray,
    length: IntArray,
    plain: BoolArray,
) -> None:
    """Writes the places of the values of coordinates or axes in tags (n,), without blanks around.

    ``first`` (n + 1,) are the first bytes of the tags, and the end of the file; ``plain`` becomes
    false where a value is no number.
    """
    for row in range(is_axis.size):
        i, end = first[row] + _TAG, first[row + 1]
        while i < end and buf[i] != 62:
            name = _pass_blanks(buf, i, end)
            i = name
            while i < end and buf[i] != 61 and buf[i] != 62 and not _is_blank(buf[i]):
                i += 1
            column = _column_of(buf, name, i, is_axis[row])
            while i < end and buf[i] != 34 and buf[i] != 39 and buf[i] != 62:
                i += 1
            if i >= end or buf[i] == 62:
                break
            quote, value = buf[i], _pass_blanks(buf, i + 1, end)
            i = value
            while i < end and buf[i] != quote:
                i += 1
            last = i
            while last > value and _is_blank(buf[last - 1]):
                last -= 1
            i += 1
            if column >= 0:
                start[row, column], length[row, column] = value, last - value
                plain[row, column] = _is_number(buf, value, last)


def find_plain_points(data: bytes, edges: IntArray) -> IntArray:
    """Returns the lines that are one point or axis target with all of its numbers, in order.

    Args:
        data: Text.
        edges: (l + 1,) first byte of each of its lines, and the size.

    Returns:
        (n, 7) line, first byte of the tag, number of the element, whether it is one of axes, first
        byte and end of the attributes after the numbers, whether those of the point before are the
        same.
    """
    found = np.empty((len(edges) - 1, 7), np.int64)
    buf = np.frombuffer(data, np.uint8)
    return found[: _find_plain_points(buf, edges, _TAG_BYTES, _ATTRIBUTES, found)]


@compile_kernel(PLAIN)
def _find_plain_points(
    buf: Bytes, edges: IntArray, tag: Bytes, names: Bytes, found: IntArray
) -> int:
    """Writes the plain points into ``found`` and returns their number."""
    count = 0
    for line in range(edges.size - 1):
        first, end = edges[line], edges[line + 1]
        while end > first and _is_blank(buf[end - 1]):
            end -= 1
        first = _pass_blanks(buf, first, end)
        plain = end - first > tag.size + 2 and buf[end - 2] == 47 and buf[end - 1] == 62
        for k in range(tag.size if plain else 0):
            plain &= buf[first + k] == tag[k]
        for k in range(edges[line], end if plain else 0):
            plain &= 32 <= buf[k] <= 126 or buf[k] == 9
        if not plain:
            continue
        i, end, of_axes, key = first + tag.size, end - 2, 0, 0
        for column in range(7):
            value = _pass_name(buf, i, end, names[column + 6 * of_axes])
            if value < 0 and column == 1:
                of_axes = 1
                value = _pass_name(buf, i, end, names[7])
            i = value
            while 0 <= i < end and buf[i] != buf[value - 1]:
                i += 1
            if i < 0 or i >= end or not _is_plain(buf, value, i, column == 0):
                i = -1
                break
            for k in range(value, i if column == 0 else value):
                key = 10 * key + buf[k] - 48
            i += 1
        if i >= 0:
            same = count > 0 and end - i == found[count - 1, 5] - found[count - 1, 4]
            for k in range(end - i if same else 0):
                same &= buf[i + k] == buf[found[count - 1, 4] + k]
            found[count] = line, first, key, of_axes, i, end, int(same)
            count += 1
    return count


@compile_kernel(PLAIN)
def _pass_name(buf: Bytes, i: int, end: int, name: Bytes) -> int:
    """Returns the first byte of the value of an attribute after blanks, -1 if it is another."""
    j = _pass_blanks(buf, i, end)
    if j == i:
        return -1
    for k in range(name.size):
        if name[k]:
            if j >= end or buf[j] != name[k]:
                return -1
            j += 1
    if j + 1 >= end or buf[j] != 61 or (buf[j + 1] != 34 and buf[j + 1] != 39):
        return -1
    return j + 2


@compile_kernel(PLAIN)
def _is_plain(buf: Bytes, i: int, end: int, whole: bool) -> bool:
    """Returns whether bytes are a number that is finite, or the plain number of an element."""
    if whole:
        plain = 0 < end - i <= _DIGITS[0] and (buf[i] != 48 or end - i == 1)
        for k in range(i, end):
            plain &= 48 <= buf[k] <= 57
        return plain
    plain = end - i <= _DIGITS[1] and _is_number(buf, i, end)
    for k in range(i, end):
        plain &= (buf[k] | 32) != 101 or end - k <= 3 + (buf[k + 1] < 48)
    return plain


@compile_kernel(PLAIN, inline=True)
def _is_blank(byte: int) -> bool:
    return byte == 32 or 9 <= byte <= 13


@compile_kernel(PLAIN)
def _pass_blanks(buf: Bytes, i: int, end: int) -> int:
    while i < end and _is_blank(buf[i]):
        i += 1
    return i


@compile_kernel(PLAIN)
def _column_of(buf: Bytes, first: int, last: int, is_axis: bool) -> int:
    """Returns the column of an attribute, -1 if its value is none of the six numbers."""
    if is_axis:
        if last - first != 2 or buf[first] != 106 or not 49 <= buf[first + 1] <= 54:
            return -1
        axis: int = buf[first + 1] - 49
        return axis
    turn = last - first == 2 and buf[first] == 114
    if not (turn or last - first == 1) or not 120 <= buf[last - 1] <= 122:
        return -1
    column: int = buf[last - 1] - 120
    return column + 3 if turn else column


@compile_kernel(PLAIN)
def _is_number(buf: Bytes, i: int, end: int) -> bool:
    """Returns whether bytes are a decimal number, with an exponent or without."""
    if i < end and (buf[i] == 43 or buf[i] == 45):
        i += 1
    digits, point = 0, False
    while i < end and (48 <= buf[i] <= 57 or (buf[i] == 46 and not point)):
        point |= buf[i] == 46
        digits += buf[i] != 46
        i += 1
    if digits and i < end and (buf[i] | 32) == 101:
        i += 1
        if i < end and (buf[i] == 43 or buf[i] == 45):
            i += 1
        digits = 0
        while i < end and 48 <= buf[i] <= 57:
            digits += 1
            i += 1
    return digits > 0 and i == end
