"""Reads the bytes of a RAPID module as statements, arguments and literals.

A statement ends with ``;`` and may span lines; control words (``IF .. THEN``, ``PROC name()``) end
with themselves. Comments (``!``), strings and brackets are respected everywhere.
"""

from __future__ import annotations

import re
from typing import Final, NamedTuple

from robotrue.errors import FormatError
from robotrue.program.formats.number_text import WHOLE_NUMBER
from robotrue.program.formats.text_lines import line_at

GAP: Final = rb"(?:\s++|![^\r\n]*+)*+"
"""Blanks, line ends and comments."""


def _row(count: int) -> bytes:
    return rb"\[" + GAP + (GAP + b"," + GAP).join([WHOLE_NUMBER] * count) + GAP + rb"\]"


def _rows(*counts: int) -> re.Pattern[bytes]:
    inside = (GAP + b"," + GAP).join(_row(count) for count in counts)
    return re.compile(rb"\[" + GAP + inside + GAP + rb"\]")


ROBTARGET: Final = _rows(3, 4, 4, 6)
"""Position in mm, quaternion, confdata, external axes."""
JOINTTARGET: Final = _rows(6, 6)
"""Axes in deg, external axes."""
POSE: Final = _rows(3, 4)
INLINE: Final = re.compile(
    GAP + rb"(Move[LJ])\b\s*+(" + ROBTARGET.pattern + rb")([^;\"![\](){}]*+);", re.IGNORECASE
)
"""A whole motion to a literal, as a post writes it: word, literal, remainder."""
UNCOMMENTED: Final = re.compile(INLINE.pattern.replace(GAP, rb"\s*+"), re.IGNORECASE)
"""The same without comments inside, which is matched in two thirds of the time."""
WORD: Final = rb"[\w\x80-\xff]++"
"""Of a name, with the letters of whatever encoding the module is in."""
NAME: Final = re.compile(rb"[A-Za-z\x80-\xff][\w\x80-\xff]*+")
SKIP: Final = re.compile(GAP)

_STRING: Final = rb'"(?:[^"\r\n]|"")*+"'
_BODY: Final = re.compile(rb'(?:[^;"!]++|' + _STRING + rb"|![^\r\n]*+)*+;")
_PIECE: Final = re.compile(rb"[\[({]|[\])}]|[,\\]|" + _STRING + rb"|![^\r\n]*+")
_COMMENT: Final = re.compile(_STRING + rb"|(![^\r\n]*+)")
_HEADER: Final = re.compile(rb"(?:\xef\xbb\xbf)?\s*+(?:%%%.*?%%%)?", re.DOTALL)
_LABEL: Final = re.compile(GAP + rb":(?!=)")
_NAMED: Final = re.compile(GAP + WORD + GAP + rb"(?:\([^()]*+\))?+")
_FUNCTION: Final = re.compile(GAP + WORD + GAP + WORD + GAP + rb"(?:\([^()]*+\))?+")
_BRACKETED: Final = re.compile(GAP + rb"\([^()]*+\)")
_PLACEHOLDER: Final = re.compile(rb"<[^\r\n]*+")


def _until(words: bytes) -> re.Pattern[bytes]:
    plain = (
        rb'(?:[^;"!\w\x80-\xff]++|'
        + _STRING
        + rb"|![^\r\n]*+|(?!(?:"
        + words
        + rb")\b)[\w\x80-\xff]++)*+"
    )
    return re.compile(plain + rb"(;|[\w\x80-\xff]++)", re.IGNORECASE)


_HEADS: Final = {
    "if": _until(rb"THEN"),
    "elseif": _until(rb"THEN"),
    "while": _until(rb"DO"),
    "for": _until(rb"DO"),
}
_TEST: Final = _until(rb"CASE|DEFAULT|ENDTEST")
_CASE: Final = re.compile(rb'(?:[^;"!:]++|' + _STRING + rb"|![^\r\n]*+)*+:(?!=)")
_ALONE: Final = frozenset(
    """else endif endwhile endfor endtest endproc endfunc endtrap endrecord endmodule undo
    backward""".split()
)
COMPACT: Final = re.compile(
    rb'(?:"(?:[^"\r\n]|"")*+"|![^\r\n]*+|[^"!\w\x80-\xff]|'
    + WORD
    + rb"(?:\s*+\.\s*+"
    + WORD
    + rb")*+)*?(?<![\w\x80-\xff])"
    rb"((?:Move|Trigg|Search|Arc)" + WORD + rb"|" + WORD + rb"(?=\s*+(?:\{[^{}]*+\}"
    rb"\s*+)?+(?:\.\s*+" + WORD + rb"\s*+)*+:=)|GOTO|RETURN|EXIT)(?![\w\x80-\xff])",
    re.IGNORECASE | re.DOTALL,
)
"""``IF condition instruction;`` up to the end of the instruction's first word."""
_NAME_OF_FUNCTION: Final = re.compile(
    rb"\bFUNC\s++" + WORD + rb"\s++(" + WORD + rb")", re.IGNORECASE
)
_USED: Final = re.compile(rb"(" + WORD + rb")\s*+\(")


class RapidStatement(NamedTuple):
    """One statement or control word.

    Attributes:
        word: Its first word in lower case; ``label``, ``prefix`` (LOCAL before a routine),
            ``late`` (a call by name) and ``if then`` are words of our own.
        start: First byte of that word.
        body: Byte after it.
        end: End of the statement, without the ``;``.
    """

    word: str
    start: int
    body: int
    end: int


def beginning(data: bytes) -> int:
    """Returns where the first statement may begin, after the header."""
    header = _HEADER.match(data)
    return header.end() if header else 0


def next_statement(data: bytes, at: int, name: str) -> tuple[RapidStatement | None, int]:
    """Returns the first statement from a byte on, None at the end of the file, and its end.

    Raises:
        FormatError: Something that is no statement, or one that does not end, with its line.
    """
    while True:
        gap = SKIP.match(data, at)
        at = gap.end() if gap else at
        if at >= len(data):
            return None, at
        match = NAME.match(data, at)
        if match is not None:
            break
        end = _nameless(data, at, name)
        if data[at : at + 1] == b"%":
            return RapidStatement("late", at, at, end - 1), end
        at = end
    word, body = match[0].decode("latin-1").lower(), match.end()
    if word in _ALONE:
        return RapidStatement(word, at, body, body), body
    statement = _control(data, word, at, body)
    if statement is not None:
        return statement, statement.end
    ended = _BODY.match(data, body)
    if ended is None:
        raise _endless(data, at, name)
    return RapidStatement(word, at, body, ended.end() - 1), ended.end()


def _nameless(data: bytes, at: int, name: str) -> int:
    """Returns the end of what starts with no word: a stray ``;``, ``%"x"%;``, ``<SMT>``."""
    if data[at : at + 1] == b";":
        return at + 1
    placeholder = _PLACEHOLDER.match(data, at)
    if placeholder:
        return placeholder.end()
    end = _BODY.match(data, at) if data[at : at + 1] == b"%" else None
    if end is None:
        raise FormatError(
            f"{_show(data, at)!r} cannot begin a statement.",
            source=name,
            line=line_at(data, at),
            hint="export the module again; a bracket or ';' may be missing before it.",
        )
    return end.end()


def _control(data: bytes, word: str, at: int, body: int) -> RapidStatement | None:
    """Returns a statement that does not end with ``;``, or None if this one does."""
    if word in _HEADS:
        head = _HEADS[word].match(data, body)
        if head is None or head[1] == b";":
            return None
        return RapidStatement(word + " then" if word == "if" else word, at, body, head.end())
    if word in ("case", "default"):
        end = _CASE.match(data, body)
        return RapidStatement(word, at, body, end.end()) if end else None
    if word == "test":
        end = _TEST.match(data, body)
        return RapidStatement(word, at, body, end.start(1)) if end and end[1] != b";" else None
    if word in ("proc", "func", "trap", "module", "record"):
        end = (_FUNCTION if word == "func" else _NAMED).match(data, body)
        return RapidStatement(word, at, body, end.end()) if end else None
    if word == "error":
        end = _BRACKETED.match(data, body)
        return RapidStatement(word, at, body, end.end() if end else body)
    if word in ("local", "task"):
        gap = SKIP.match(data, body)
        after = NAME.match(data, gap.end() if gap else body)
        if after and after[0].lower() in (b"proc", b"func", b"trap", b"record"):
            return RapidStatement("prefix", at, body, after.start())
    end = _LABEL.match(data, body)
    return RapidStatement("label", at, at, end.end()) if end else None


def _endless(data: bytes, at: int, name: str) -> FormatError:
    return FormatError(
        f"the statement {_show(data, at)!r} has no ';', or a string in it is not closed.",
        source=name,
        line=line_at(data, at),
        hint="the file may be cut off; export it again.",
    )


def _show(data: bytes, at: int) -> str:
    return data[at : at + 40].split(b"\n")[0].decode("latin-1").strip()


class Arguments(NamedTuple):
    """Arguments of an instruction: byte stretches, and the optional ones by lower-case name."""

    places: list[tuple[int, int]]
    options: dict[str, str]


def arguments(data: bytes, start: int, end: int) -> Arguments | None:
    """Returns the arguments of an instruction, None if its brackets do not match."""
    pieces: list[tuple[int, int, bool]] = []
    depth, begun, optional = 0, start, False
    for match in _PIECE.finditer(data, start, end):
        sign = match[0]
        if sign in (b",", b"\\"):
            if depth == 0:
                pieces.append((begun, match.start(), optional))
                begun, optional = match.end(), sign == b"\\"
        elif sign in (b"[", b"(", b"{"):
            depth += 1
        elif sign in (b"]", b")", b"}"):
            depth -= 1
            if depth < 0:
                return None
    if depth:
        return None
    pieces.append((begun, end, optional))
    found = Arguments([], {})
    for first, last, is_option in pieces:
        if is_option:
            name, _, value = clean(data[first:last]).partition(":=")
            found.options[name.strip().lower()] = value.strip()
            continue
        gap = SKIP.match(data, first, last)
        first = gap.end() if gap else first
        if first < last:
            found.places.append((first, last))
    return found


def clean(text: bytes) -> str:
    """Returns code as text without comments and the blanks around it."""
    return _COMMENT.sub(lambda m: b"" if m[1] else m[0], text).decode("latin-1").strip()


def fills(pattern: re.Pattern[bytes], data: bytes, start: int, end: int) -> re.Match[bytes] | None:
    """Returns the match of a literal that is all there is between two bytes."""
    match = pattern.match(data, start, end)
    gap = SKIP.match(data, match.end(), end) if match else None
    return match if gap and gap.end() == end else None


def numbers_of(literal: bytes) -> list[bytes]:
    """Returns the numbers of a literal as printed."""
    return re.findall(WHOLE_NUMBER, re.sub(rb"![^\r\n]*", b"", literal))


def list_functions(data: bytes) -> frozenset[bytes]:
    """Returns the names of the functions of a module, in lower case."""
    return frozenset(name.lower() for name in _NAME_OF_FUNCTION.findall(data))


def find_calls(data: bytes, start: int, end: int, functions: frozenset[bytes]) -> list[str]:
    """Returns which of some functions the code between two bytes calls, in its order."""
    names = [name.lower() for name in _USED.findall(data, start, end)] if functions else []
    return [name.decode("latin-1") for name in names if name in functions]
