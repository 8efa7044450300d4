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
_AXIS_NAMES: Final = ("j1", "j2", "j3", "j4", "j5", "j6")
_TAG: Final = len(b"<Value")


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
        word = (_AXIS_NAMES if is_axis[row] else POSE_NAMES)[column]
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
