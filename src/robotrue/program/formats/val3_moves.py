"""Which points the code of a VAL3 application moves to, with which tool, and what else it touches.

A point, frame or tool that any other statement names may be changed there, so it is not trusted;
``open``, ``close``, ``appro`` and what else only reads it are named in ``_READ_ONLY``.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from dataclasses import dataclass
from typing import Final, NamedTuple

from robotrue.program.formats.val3_files import Val3Routine
from robotrue.program.program import Motion

_NAME: Final = r"[A-Za-z_]\w*+(?::[A-Za-z_]\w*+)?+"
_REF: Final = rf"\s*+({_NAME})\s*+(?:\[((?:[^\[\]\n]|\[[^\[\]\n]*+\])*+)\])?+\s*+"
_MOVE: Final = re.compile(
    rf"\b(?:move([jl])\s*+\(|movec\s*+\({_REF},){_REF},{_REF},[^()\n]*+\)", re.ASCII
)
_COMPUTED: Final = re.compile(r"\bmove([jlc])\s*+\(", re.ASCII)
_CALL: Final = re.compile(
    rf"\bcall\s++({_NAME})|\btaskCreate\b[^\n(]{{0,200}}?,\s*+({_NAME})\s*+\("
)
_WORD: Final = re.compile(rf"({_NAME})|([()\[\]])|([^\w\s()\[\]]++)", re.ASCII)
_READ_ONLY: Final = frozenset({"appro", "open", "close", "here", "compose", "position"})
_MOVES: Final = frozenset({"movej", "movel", "movec"})
"""Functions that change nothing they are given, apart from the point they return."""
_MOTIONS: Final = {"j": Motion.PTP, "l": Motion.LIN, "c": Motion.ARC_END}


class Reference(NamedTuple):
    """A variable as a statement names it.

    Attributes:
        name: Of the variable.
        key: Its element; None if that is computed.
    """

    name: str
    key: str | None

    def __str__(self) -> str:
        return self.name if self.key in ("0", None) else f"{self.name}[{self.key}]"


class Val3Move(NamedTuple):
    """One motion.

    Attributes:
        motion: PTP, LIN or ARC_END.
        via: Auxiliary point of an arc.
        target: None if it is computed.
        tool: Likewise.
        file: Of the job.
        line: One-based.
    """

    motion: Motion
    via: Reference | None
    target: Reference | None
    tool: Reference | None
    file: int
    line: int


@dataclass(slots=True)
class CodeUse:
    """What the code of an application does with its data.

    Attributes:
        moves: Motions in the order of the text.
        touched: Names that other statements may change.
        computed: Names in motions to a target that is computed.
        calls: Routines that are called, and where first (file, line).
    """

    moves: list[Val3Move]
    touched: set[str]
    computed: set[str]
    calls: dict[str, tuple[int, int]]


def read_code(routines: list[Val3Routine]) -> CodeUse:
    """Returns what the routines of an application do with its data."""
    use = CodeUse([], set(), set(), {})
    for routine in routines:
        _read_routine(routine, use)
    return use


def _read_routine(routine: Val3Routine, use: CodeUse) -> None:
    code = routine.code
    ends = [match.start() for match in re.finditer("\n", code)]
    moves: list[tuple[int, Val3Move]] = []
    for match in _MOVE.finditer(code):
        how, via, via_key, target, key, tool, tool_key = match.groups()
        move = Val3Move(
            _MOTIONS[how or "c"],
            _refer(routine, via, via_key) if via else None,
            _refer(routine, target, key),
            _refer(routine, tool, tool_key),
            routine.file,
            routine.line + bisect_left(ends, match.start()),
        )
        moves.append((match.start(), move))
    rest = _MOVE.sub(_blank, code)
    for match in _COMPUTED.finditer(rest):
        line = routine.line + bisect_left(ends, match.start())
        moves.append(
            (match.start(), Val3Move(_MOTIONS[match[1]], None, None, None, routine.file, line))
        )
    use.moves += [move for _, move in sorted(moves, key=lambda item: item[0])]
    for match in _CALL.finditer(rest):
        line = routine.line + bisect_left(ends, match.start())
        use.calls.setdefault(match[1] or match[2], (routine.file, line))
    _note_touched(routine, rest, use)


def _blank(match: re.Match[str]) -> str:
    text = match[0]
    return re.sub(r"[^\n]", " ", text) if "\n" in text else " " * len(text)


def _refer(routine: Val3Routine, name: str, key: str | None) -> Reference | None:
    """The variable of the application that a name means; None for one of the routine's own."""
    if name in routine.own:
        return None
    text = "0" if key is None else key.strip()
    plain = text.isascii() and text.isdecimal()
    return Reference(name, (text.lstrip("0") or "0") if plain else None)


def _note_touched(routine: Val3Routine, code: str, use: CodeUse) -> None:
    """Notes the names outside of plain motions, but for those that a function only reads."""
    functions, before = [""], ""
    for match in _WORD.finditer(code):
        name, bracket, _ = match.groups()
        if bracket in ("(", "["):
            functions.append(before if bracket == "(" else functions[-1])
        elif bracket and len(functions) > 1:
            functions.pop()
        elif name and name not in routine.own and functions[-1] not in _READ_ONLY:
            (use.computed if functions[-1] in _MOVES else use.touched).add(name)
        before = name or ""
