"""CAMRob: the ``n;X;Y;Z;C;B;A;..`` file that a KRL program hands to ``CR_PROCESS_FILE``.

The seventh number is A: the rotations are printed about X, Y and Z in that order. After them are
the line of the tool path, feed, spindle, coolant and tool, and from the fifteenth column on the
external axes. Only X to A are ever rewritten. Base and tool are those in force where the program
calls.
"""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from robotrue.core.arm_words import NO_WORD, WORDS
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.units import DEG
from robotrue.errors import FormatError
from robotrue.program.formats.number_table import NumberTable
from robotrue.program.formats.number_text import NUMBER
from robotrue.program.formats.pose_write import spans_of
from robotrue.program.formats.target_tokens import POSE, TargetTokens, rewritten, values_of
from robotrue.program.formats.text_lines import line_at, line_starts, require_text
from robotrue.program.program import Motion, Program, Reason, Replacement

CALL: Final = re.compile(
    r'CR_PROCESS_FILE\s*\(\s*"([^"]+)"\s*(?:,\s*(-?\d+)\s*,\s*(-?\d+)\s*)?', re.IGNORECASE
)
"""Name of the file, first and last line of it; -1 is the end."""
_FIELD: Final = rb"[ \t]*" + NUMBER + rb"[ \t]*"
_LINE: Final = re.compile(
    rb"[ \t]*\d+[ \t]*;(" + rb";".join([_FIELD] * 6) + rb")(?:;([^\r\n]*))?(?:\r\n|\n|\r|\Z)"
)
_BLANK: Final = re.compile(rb"(?:[ \t]*(?:\r\n|\n|\r))+")
_EXTERNAL: Final = 7
"""Columns between A and the first external axis."""
_COUNT: Final = 6
_BOM: Final = b"\xef\xbb\xbf"


def scan_targets(data: bytes, name: str) -> tuple[TargetTokens, Array, IntArray]:
    """Returns places of the numbers, external values (n, 6) as printed, and lines (n,) from one.

    Raises:
        FormatError: A line that is not of this form.
    """
    require_text(data, name)
    table = NumberTable(data, [tuple(range(6))], b"#")
    external: list[list[float]] = []
    places: list[int] = []
    at = len(_BOM) if data.startswith(_BOM) else 0
    while at < len(data):
        match = _LINE.match(data, at)
        if match is None:
            blank = _BLANK.match(data, at) or re.compile(rb"[ \t]+\Z").match(data, at)
            if blank is None:
                raise _odd(data, at, name)
            at = blank.end()
            continue
        table.add(*match.span(1), 0)
        places.append(at)
        external.append(_behind(match[2], data, at, name))
        at = match.end()
    numbers = table.numbers()
    tokens = TargetTokens(
        start=numbers.start,
        length=numbers.length,
        value=numbers.value,
        kind=np.full(len(places), POSE, np.int64),
        unit=np.full((1, 6), DEG),
        whole=np.zeros(1, np.bool_),
    )
    line = np.searchsorted(line_starts(data), np.array(places, np.int64), side="right")
    return tokens, np.array(external, np.float64).reshape(-1, _COUNT), line.astype(np.int64)


def _behind(rest: bytes | None, data: bytes, at: int, name: str) -> list[float]:
    """Returns the external values of a line, NaN where absent."""
    fields = rest.split(b";")[_EXTERNAL : _EXTERNAL + _COUNT] if rest else []
    try:
        values = [float(field) for field in fields if field.strip()]
    except ValueError:
        raise _odd(data, at, name) from None
    return values + [np.nan] * (_COUNT - len(values))


def _odd(data: bytes, at: int, name: str) -> FormatError:
    shown = data[at : at + 60].splitlines()[0].decode("latin-1")
    return FormatError(
        f"{shown!r} is no line of a CAMRob file.",
        source=name,
        line=line_at(data, at),
        hint="lines are n;X;Y;Z;C;B;A;.. with numbers in mm and deg.",
    )


def camrob_program(
    name: str,
    data: bytes,
    tokens: TargetTokens,
    line: IntArray,
    *,
    reason: IntArray,
    frame: IntArray,
    tool: IntArray,
    T_base_frame: Array,
    T_flange_tool: Array,
    start: Array,
    notes: list[str],
) -> Program:
    """Returns the program of a file whose frames and reasons are known."""
    position, rotation, axes = values_of(tokens)
    n = len(line)
    bad: BoolArray = np.asarray(~np.isfinite(tokens.value).all(axis=1))
    reason[bad] = Reason.INCOMPLETE
    used = reason != Reason.UNUSED
    return Program(
        name=name,
        dialect="krl",
        data=data,
        position=position,
        rotation=rotation,
        axes=axes,
        motion=np.where(used, int(Motion.LIN), int(Motion.UNUSED)),
        reason=reason,
        words=np.full((n, WORDS["kuka"]), NO_WORD),
        words_of="kuka",
        line=line,
        frame=frame,
        tool=tool,
        T_base_frame=T_base_frame,
        T_flange_tool=T_flange_tool,
        start=start,
        notes=tuple(notes),
        spans=tokens,
    )


def write_camrob(program: Program, replacement: Replacement) -> bytes:
    """Returns the file with the numbers of the changed rows replaced and nothing else touched.

    Raises:
        ShapeError: A changed row has a value that is not finite, or beyond 1e9 mm or deg.
    """
    tokens = spans_of(program, TargetTokens, "CAMRob")
    return rewritten(program, replacement, tokens, [], aligned=False)
