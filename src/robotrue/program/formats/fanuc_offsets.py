"""Targets of Fanuc LS moves that differ from their position record.

``Offset,PR[1]`` moves a target in its user frame, ``Tool_Offset,PR[1]`` in its tool. How the
controller joins a turned offset is not documented where we could read it, so only offsets without a
turn are followed. A register as a target is in the frames in force.

A listing is written in the language of the pendant: ``KONFIG``, ``WKZ_NUM``, ``sek``. Words that
move a target (INC, Offset, RTCP, COORD) have other names there, too, which we know only in English;
so after a target only words that are known to be harmless are accepted.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

from robotrue.program.formats.fanuc_values import (
    OffsetCondition,
    RegisterPose,
    State,
    Value,
)
from robotrue.program.program import Reason

_OFFSET: Final = re.compile(
    rb"\b(TOOL_)?OFFSET\b(?:[ \t]*,[ \t]*PR\[[ \t]*(\d{1,6})[ \t]*(?::[^\]]*)?\])?", re.IGNORECASE
)
_ZERO: Final = (0.0, 0.0, 0.0)
_ENGLISH: Final = re.compile(
    rb"^[ \t]*(?:OWNER|COMMENT|PROG_SIZE|CREATE|MODIFIED|LINE_COUNT|MEMORY_SIZE|PROTECT|"
    rb"DEFAULT_GROUP|CONTROL_CODE)[ \t]*=",
    re.MULTILINE,
)
_ATTRIBUTE: Final = re.compile(rb"^[ \t]*[^\s=;:]+[ \t]*=[^;\n]*[;,]", re.MULTILINE)
_CONFIG: Final = re.compile(rb"\b(\w++)\s*+:\s*+'")
_TIMED: Final = re.compile(rb"\b(?:ZEIT|TB|TA|DB)\b")
_HARMLESS: Final = re.compile(
    rb"(?:R\s*\[[^\]]*\]|[\d.]+)?(?:%|(?:MM|CM|INCH|DEG|GRAD)/(?:SEC|SEK|MIN)|M?SE[CK])"
    rb"|FINE|FEIN|CNT\d*|ACC\d*|R\s*\[[^\]]*\]|\d+"
)
_BRACKETS: Final = re.compile(rb"\[[^\]]*\]")
_OPTIONS: Final = (
    (
        re.compile(rb"\bINC\b"),
        Reason.RELATIVE,
        "INC moves by a step from the target before it, and with its correction",
    ),
    (
        re.compile(rb"\b(?:TOOL_OFFSET|OFFSET|VOFFSET)\b"),
        Reason.EXPRESSION,
        "an offset from a register moves the target",
    ),
    (
        re.compile(rb"\b(?:PR|VR)\s*+\[\](?!\s*=)"),
        Reason.EXPRESSION,
        "an offset from a register moves the target",
    ),
    (re.compile(rb"\bRTCP\b"), Reason.TOOL_ON_FLOOR, "RTCP uses a tool fixed outside the robot"),
    (re.compile(rb"\bCOORD\b"), Reason.EXTERNAL_AXIS, "COORD moves with another group"),
)


class TargetOffset(NamedTuple):
    """Offset of a move's target.

    Attributes:
        in_frame: (x, y, z) mm in the user frame.
        in_tool: (x, y, z) mm in the tool.
    """

    in_frame: tuple[float, ...] = _ZERO
    in_tool: tuple[float, ...] = _ZERO


NO_OFFSET: Final = TargetOffset()


class MoveTarget(NamedTuple):
    """The target of one or several moves.

    Attributes:
        row: Of the position record, -1 for a register.
        line: One-based, of the first move.
        spans: First byte and end of its name in each move.
        offset: What the moves shift it by.
        pose: Of a register.
        in_force: Numbers of the user frame and the tool in force, of a register.
        known: All of this is known.
    """

    row: int
    line: int
    spans: tuple[tuple[int, int], ...]
    offset: TargetOffset = NO_OFFSET
    pose: RegisterPose | None = None
    in_force: tuple[int, int] = (-1, -1)
    known: bool = True

    @property
    def alike(self) -> tuple[object, ...]:
        """Key that moves to the same target share."""
        return self.row, self.offset, self.pose, self.in_force


def read_offset(tail: bytes, state: State, frame: int) -> tuple[TargetOffset | None, bytes, str]:
    """Returns the offset of a move, the other words after its target, and why it is unknown.

    Args:
        tail: Text after the target.
        state: Known registers there.
        frame: Number of the user frame of the target.
    """
    found = list(_OFFSET.finditer(tail))
    rest = _OFFSET.sub(b"", tail)
    shifts = {"OFFSET": _ZERO, "TOOL_OFFSET": _ZERO}
    for match in found:
        name = "TOOL_OFFSET" if match[1] else "OFFSET"
        shift, why = _shift_of(name, match[2], state, frame)
        if shift is None:
            return None, rest, why
        shifts[name] = shift
    if len(found) > len({bool(match[1]) for match in found}):
        return None, rest, "an offset is stated twice"
    return TargetOffset(shifts["OFFSET"], shifts["TOOL_OFFSET"]), rest, ""


def _shift_of(
    name: str, number: bytes | None, state: State, frame: int
) -> tuple[tuple[float, float, float] | None, str]:
    """Returns (x, y, z) mm, or why they are not known."""
    if number is not None:
        told: Value | None = state.get(f"PR{int(number)}")
        what = f"PR[{int(number)}]"
    else:
        condition = state.get(name)
        if not isinstance(condition, OffsetCondition):
            return None, "the register of its condition is unknown there"
        what = f"PR[{condition.register}]"
        told = state.get(f"PR{condition.register}")
        if told != condition.pose:
            return None, f"{what} differs between its condition and the move"
        if condition.frame >= 0 and condition.frame != frame:
            return None, f"its condition names frame {condition.frame}, the target has another"
    if not isinstance(told, RegisterPose):
        return None, (
            f"the value of {what} there is unknown: give POSREG.VA beside the program, or set it "
            "by constants on every path to the move"
        )
    if any(told.values[3:]):
        return None, f"{what} rotates the target in an undocumented way"
    x, y, z = told.values[:3]
    return (x, y, z), ""


def target_of(
    number: int, state: Mapping[str, Value], line: int, span: tuple[int, int]
) -> tuple[MoveTarget | None, str]:
    """Returns the target ``PR[number]`` of a move, or why it is not known."""
    pose, base, tool = (state.get(name) for name in (f"PR{number}", "UF", "UT"))
    if not isinstance(pose, RegisterPose):
        return None, (
            f"the value of PR[{number}] there is unknown: give POSREG.VA beside the program, or "
            "set it from a position on every path to the move"
        )
    if not pose.config.strip():
        return None, f"the CONFIG of PR[{number}] is unknown: set it from a position"
    if not isinstance(base, float) or not isinstance(tool, float):
        return None, (
            f"PR[{number}] is in the frames in force, which are unknown there: set "
            "UFRAME_NUM and UTOOL_NUM by numbers before the move"
        )
    if base != int(base) or tool != int(tool) or min(base, tool) < 0:
        return None, "UFRAME_NUM or UTOOL_NUM is no number of a frame"
    target = MoveTarget(-1, line, (span,), pose=pose)
    return target._replace(in_force=(int(base), int(tool))), ""


def join_targets(targets: Iterable[MoveTarget]) -> list[MoveTarget]:
    """Returns targets that are one and the same as one each, with the names of all their moves."""
    joined: dict[tuple[object, ...], MoveTarget] = {}
    for target in targets:
        before = joined.get(target.alike)
        spans = (*(before.spans if before else ()), *target.spans)
        joined[target.alike] = (before or target)._replace(spans=spans)
    return list(joined.values())


def in_another_language(data: bytes, statements: tuple[int, int]) -> bool:
    """Returns whether the listing is written in another language than English.

    Args:
        data: The bytes.
        statements: Where the statements begin and end.
    """
    first, last = statements
    config = _CONFIG.search(data, last)
    if config and config[1].upper() != b"CONFIG":
        return True
    return bool(_ATTRIBUTE.search(data, 0, first)) and not _ENGLISH.search(data, 0, first)


def words_behind(tail: bytes) -> bytes:
    """Returns the words after a target, in capitals, without the names in brackets.

    Calls at a time before or after the end of the move come last, and are left out.
    """
    words = cut_timed(tail).upper()
    closed = words.rfind(b"]") + 1
    return _BRACKETS.sub(b"[]", words[:closed]) + words[closed:]


def cut_timed(tail: bytes) -> bytes:
    """Returns the words after a target, up to a timed call."""
    closed = tail.rfind(b"]") + 1  # brackets after it are not closed
    words = _BRACKETS.sub(lambda match: b"[%b]" % (b" " * (len(match[0]) - 2)), tail[:closed])
    timed = _TIMED.search((words + tail[closed:]).upper())
    return tail[: timed.start()] if timed else tail


def doubtful_words(tail: bytes) -> tuple[tuple[Reason, str], ...]:
    """Returns why words after a target make it another one, and a sentence on each."""
    words = words_behind(tail)
    return tuple((why, what) for sign, why, what in _OPTIONS if sign.search(words))


def odd_word(words: bytes) -> str:
    """Returns the first of the words after a target that may move it, or nothing."""
    odd = [word for word in words.split() if not _HARMLESS.fullmatch(word)]
    return odd[0].decode("latin-1") if odd else ""
