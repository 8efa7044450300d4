"""Moves of KRL and RAPID to targets that the program computes, as calls of a correcting function.

Only the text of the target is wrapped in a call, and only where that is certain to be right; the
text around it, and every other byte, stays.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from robotrue.program.correction_krl import TYPES
from robotrue.program.formats.text_lines import split_outside
from robotrue.program.program import Motion, Program, Reason

COMPUTED: Final = (Reason.EXPRESSION, Reason.RELATIVE)
"""Why a target is not compensated although its work frame and its tool are known."""
_KRL_MOVE: Final = re.compile(
    r"^[ \t]*(?P<motion>S?LIN|S?PTP)[ \t]+(?P<target>[^\s;{][^;\r\n{]*?)[ \t]*"
    r"(?=(?:[ \t]C_\w+[^\r\n]*|[ \t]WITH\b[^\r\n]*|;[^\r\n]*)?\r?$)",
    re.IGNORECASE | re.MULTILINE,
)
_KRL_DECLARED: Final = re.compile(
    r"^[ \t]*(?:DECL[ \t]+)?(?:GLOBAL[ \t]+)?(?P<type>E6POS|FRAME|POS)[ \t]+"
    r"(?P<names>[^;={}\r\n]+)",
    re.IGNORECASE | re.MULTILINE,
)
_RAPID_MOVE: Final = re.compile(
    r"^[ \t]*(?P<motion>Move[LJ])(?:[ \t]*\\Conc[ \t]*,|[ \t]+)[ \t]*(?P<arguments>[^;!\"]*);",
    re.IGNORECASE | re.MULTILINE,
)
_NAME: Final = re.compile(r"[A-Za-z_$]\w*")
_PLACE: Final = re.compile(r"[A-Za-z_]\w*(?:\[[^\[\]]*\])?")
"""A variable, or an element of an array."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ComputedCall:
    """A move to a computed target.

    Attributes:
        file: Name of the file.
        line: One-based.
        before: The statement as written.
        after: The statement with the call; empty where no call is known.
        why: Why the call is not inserted without a check by the user; empty where it may be.
        place: Where the target begins and ends in the bytes of the file.
        call: The text of the call.
    """

    file: str
    line: int
    before: str
    after: str
    why: str
    place: tuple[int, int]
    call: str


class _Move(NamedTuple):
    """A move as it is written: the span of the statement and of the target, and the call."""

    statement: tuple[int, int]
    target: tuple[int, int]
    call: str
    why: str


def list_calls(programs: Sequence[Program], name: str) -> tuple[ComputedCall, ...]:
    """Returns the moves of a job to computed targets, in the order of its files.

    Args:
        programs: Files of the job, in KRL or RAPID.
        name: Of the module and its function.
    """
    texts = [program.data.decode("latin-1") for program in programs]
    types = _read_types(texts)
    known = _names_of_rows(programs, texts)
    calls = []
    for program, text in zip(programs, texts, strict=True):
        moves = _krl_moves(text, name, types) if program.dialect == "krl" else ()
        if program.dialect == "rapid":
            moves = _rapid_moves(text, name)
        for move in moves:
            line = text.count("\n", 0, move.statement[0]) + 1
            start, end = move.target
            if not _is_computed(program, line, text[start:end], known):
                continue
            first, last = move.statement
            before = text[first:last]
            after = f"{text[first:start]}{move.call}{text[end:last]}" if move.call else ""
            calls.append(
                ComputedCall(
                    file=program.name,
                    line=line,
                    before=_one_line(before),
                    after=_one_line(after),
                    why=move.why,
                    place=move.target,
                    call=move.call,
                )
            )
    return tuple(calls)


def put_calls(program: Program, calls: Sequence[ComputedCall]) -> bytes:
    """Returns the bytes of a file with the calls that need not be looked at; all else stays."""
    parts, at = [], 0
    for call in calls:
        if call.file == program.name and not call.why:
            start, end = call.place
            parts += [program.data[at:start], call.call.encode("latin-1")]
            at = end
    return b"".join([*parts, program.data[at:]])


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _read_types(texts: Sequence[str]) -> dict[str, str]:
    """Returns the types of KRL variables by name in lower case; empty where files disagree."""
    types: dict[str, str] = {}
    for text in texts:
        for match in _KRL_DECLARED.finditer(text):
            for part in re.sub(r"\[[^\]]*\]", "", match["names"]).split(","):
                name, kind = part.strip().lower(), match["type"].upper()
                types[name] = kind if types.get(name, kind) == kind else ""
    return types


def _names_of_rows(programs: Sequence[Program], texts: Sequence[str]) -> dict[str, set[Reason]]:
    """Returns the reasons of stored points by their names in lower case."""
    names: dict[str, set[Reason]] = {}
    for program, text in zip(programs, texts, strict=True):
        lines = text.split("\n")
        for line, reason in zip(program.line.tolist(), program.reason.tolist(), strict=True):
            head = re.split(r":?=", lines[line - 1], maxsplit=1)[0]
            found = _NAME.findall(re.sub(r"[\[{].*", "", head))
            if found and "=" in lines[line - 1]:
                names.setdefault(found[-1].lower(), set()).add(Reason(reason))
    return names


def _is_computed(program: Program, line: int, target: str, known: dict[str, set[Reason]]) -> bool:
    """Whether a move goes to a target that the program computes.

    A target written out for this line, or a stored one by its name, has a row; else the path of the
    program names the line.
    """
    rows = program.reason[(program.line == line) & (program.motion != Motion.UNUSED)]
    if len(rows):
        return bool(np.isin(rows, COMPUTED).all())
    if len(program.path) and (program.path[:, 1] == -line).any():
        return True
    name = _NAME.match(target)
    reasons = known.get(name[0].lower(), set()) if name else set()
    return bool(_PLACE.fullmatch(target)) and bool(reasons) and reasons <= {*COMPUTED}


def _krl_moves(text: str, name: str, types: dict[str, str]) -> Iterator[_Move]:
    for match in _KRL_MOVE.finditer(text):
        target = match["target"]
        if target.lower().startswith(tuple(f"{name}{end}(".lower() for end in TYPES.values())):
            continue
        kind = _type_of(target, types)
        call = f"{name.upper()}{TYPES[kind]}({target})" if kind else ""
        why = ""
        if not kind:
            why = (
                f"the type of {target} is not declared in the files given; "
                f"{name.upper()} takes E6POS, {name.upper()}_F FRAME, {name.upper()}_P POS."
            )
        elif kind != "FRAME" and match["motion"].upper().endswith("PTP"):
            why = "S and T of the target are kept, and an axis near 0 may need another T."
        yield _Move((match.start("motion"), match.end()), match.span("target"), call, why)


def _type_of(target: str, types: dict[str, str]) -> str:
    """Returns the type of ``A`` or ``A:B:..`` of declared variables; empty where not known.

    The geometric operator gives the type of its last operand.
    """
    parts = [part.strip() for part in target.split(":")]
    if not all(_PLACE.fullmatch(part) for part in parts):
        return ""
    kinds = [types.get(re.sub(r"\[.*", "", part).lower(), "") for part in parts]
    return kinds[-1] if all(kinds) else ""


def _rapid_moves(text: str, name: str) -> Iterator[_Move]:
    for match in _RAPID_MOVE.finditer(text):
        arguments = split_outside(match["arguments"], ",")
        target = arguments[0].strip()
        if target.startswith("[") or target.lower().startswith(f"{name}(".lower()):
            continue
        optional = [part.split(":=", 1) for each in arguments for part in each.split("\\")[1:]]
        stated = {part[0].strip().lower(): part[1].strip() for part in optional if len(part) == 2}
        tool = arguments[-1].split("\\")[0].strip()
        start = match.start("arguments") + match["arguments"].index(target)
        target = target.split("\\")[0].rstrip() if len(split_outside(target, "\\")) > 1 else target
        frame = f"\\WObj:={stated['wobj']}" if "wobj" in stated else "\\WObj:=wobj0"
        named = len(arguments) >= 4 and _NAME.fullmatch(tool)
        call = f"{name}({target}{frame}\\Tool:={tool})" if named else ""
        why = "" if named else "its tool is no name."
        if named and match["motion"].lower() == "movej":
            why = (
                "confdata of the target is kept, and an axis near a quarter turn may need another."
            )
        span = (start, start + len(target))
        yield _Move((match.start("motion"), match.end()), span, call, why)
