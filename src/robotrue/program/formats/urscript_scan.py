"""Reads the bytes of a UR script as routines of statements.

A statement is a line, longer where a bracket is open. Routines may be nested; each is a separate
list of statements. Comments and strings are blanked out first, byte for byte, so that every offset
stays true.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Final

from robotrue.errors import FormatError
from robotrue.program.formats.number_text import WHOLE_NUMBER
from robotrue.program.formats.text_lines import line_at

_QUIET: Final = re.compile(rb'"(?:[^"\\\r\n]|\\.)*+"|#[^\r\n]*+')
_LINE: Final = re.compile(rb"[^\r\n]++")
_OPENING: Final = re.compile(rb"\s*(def|thread|sec|if|while)\b(?:\s+(\w+)\s*\(([^)]*)\))?")
_END: Final = re.compile(rb"\s*end\s*$")
_BLOCK: Final = re.compile(rb"\s*(?:def|thread|sec|if|while|end)\b")
_SIGNS: Final = re.compile(rb"[\[(]|[\])]|,")
_ROUTINES: Final = (b"def", b"thread", b"sec")
_FLAT: Final = rb"[^\r\n()\[\]]++|\[[^\r\n()\[\]]*+\]"
_CALL_LINE: Final = re.compile(
    rb"[\r\n]*+((?![^\S\r\n]*+(?:def|thread|sec|if|while|end)\b)[^\r\n()\[\]]++"
    rb"\((?:" + _FLAT + rb"|\((?:" + _FLAT + rb")*+\))*+\)[^\r\n()\[\]]*+)(?![^\r\n])"
)
"""A statement in one line that is a call, with one call inside at most."""


def _six(before: bytes) -> re.Pattern[bytes]:
    number = rb"\s*+" + WHOLE_NUMBER + rb"\s*+"
    return re.compile(before + rb"\[" + b",".join([number] * 6) + rb"\]")


POSE: Final = _six(b"p")
"""Position in m, rotation vector in rad."""
AXES: Final = _six(b"")
"""Six axes in rad."""


@dataclass(slots=True)
class Routine:
    """One routine; the first is the code outside of all.

    Attributes:
        name: As written.
        parameters: Names.
        parallel: A thread.
        around: Routines are defined inside of it, which see its variables.
        statements: (first byte, end) of each, routines inside left out.
    """

    name: str
    parameters: tuple[str, ...] = ()
    parallel: bool = False
    around: bool = False
    statements: list[tuple[int, int]] = field(default_factory=list)


def blank_comments(data: bytes) -> bytes:
    """Returns the bytes with comments blank and strings empty, of the same length."""

    def blank(match: re.Match[bytes]) -> bytes:
        size = len(match[0])
        return b" " * size if match[0][:1] == b"#" else b'"' + b"_" * (size - 2) + b'"'

    return _QUIET.sub(blank, data)


def routines(code: bytes, name: str) -> list[Routine]:
    """Returns the routines of quieted bytes.

    Raises:
        FormatError: A bracket or block that is not closed, or closed twice, with its line.
    """
    found = [Routine("")]
    open_routines, blocks = [found[0]], [(b"", 0)]
    at = 3 if code.startswith(b"\xef\xbb\xbf") else 0
    while True:
        while call := _CALL_LINE.match(code, at):
            open_routines[-1].statements.append(call.span(1))
            at = call.end()
        line = _LINE.search(code, at)
        if line is None:
            break
        start, at = line.start(), _statement_end(code, line.start(), line.end(), name)
        if not _BLOCK.match(code, start, at):  # nearly all there are
            open_routines[-1].statements.append((start, at))
            continue
        opening = _OPENING.match(code, start, at)
        if opening and opening[1] in _ROUTINES:
            open_routines[-1].around = True
            found.append(_routine(opening))
            open_routines.append(found[-1])
        if opening:
            blocks.append((opening[1], start))
        if opening and opening[1] in _ROUTINES:
            continue
        if _END.match(code, start, at):
            if len(blocks) == 1:
                raise _refusal("'end' without a block before it.", code, start, name)
            if blocks.pop()[0] in _ROUTINES:
                open_routines.pop()
                continue
        open_routines[-1].statements.append((start, at))
    if len(blocks) > 1:
        kind, start = blocks[-1]
        what = f"the '{kind.decode()}' has no 'end': the file is cut off."
        raise _refusal(what, code, start, name)
    return found


def _routine(opening: re.Match[bytes]) -> Routine:
    return Routine(
        (opening[2] or b"").decode("latin-1"),
        tuple(re.findall(r"\b\w++(?=\s*+(?:,|=|$))", (opening[3] or b"").decode("latin-1"))),
        opening[1] != b"def",
    )


def _statement_end(code: bytes, start: int, end: int, name: str) -> int:
    """Returns where the line ends that begins here, with the lines its brackets go on in."""
    depth = 0
    at = start
    while True:
        depth += code.count(b"(", at, end) + code.count(b"[", at, end)
        depth -= code.count(b")", at, end) + code.count(b"]", at, end)
        if depth < 0:
            raise _refusal("a bracket is closed that was not opened.", code, start, name)
        if depth == 0:
            return end
        line = _LINE.search(code, end)
        if line is None:
            raise _refusal("a bracket is not closed: the file is cut off.", code, start, name)
        at, end = line.span()


def _refusal(what: str, code: bytes, place: int, name: str) -> FormatError:
    return FormatError(
        what, source=name, line=line_at(code, place), hint="export the script again."
    )


def arguments(code: bytes, start: int, end: int, most: int = 99) -> list[tuple[int, int]]:
    """Returns the stretches between the commas of an argument list, blanks left out.

    Args:
        code: Quieted bytes.
        start: First byte inside the brackets.
        end: The closing bracket.
        most: Largest number returned.
    """
    out, depth, begun = [], 0, start
    for match in _SIGNS.finditer(code, start, end):
        if match[0] == b",":
            if depth == 0:
                out.append(_trim(code, begun, match.start()))
                begun = match.end()
                if len(out) == most:
                    return out
        else:
            depth += 1 if match[0] in b"[(" else -1
    out.append(_trim(code, begun, end))
    return out


def _trim(code: bytes, start: int, end: int) -> tuple[int, int]:
    text = code[start:end]
    return start + len(text) - len(text.lstrip()), start + len(text.rstrip())
