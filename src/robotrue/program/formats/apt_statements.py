"""APT and CL data as statements: joins lines, strips comments, separates words and numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final, NamedTuple

from robotrue.errors import FormatError

LARGEST: Final = 1e7
"""Of any number in a statement; 10 km."""
_NUMBER: Final = re.compile(r"[+-]?(?:\d++\.?+\d*+|\.\d++)(?:[EeDd][+-]?\d+)?")
_NUMBERS: Final = re.compile(r"[\d\s.,+\-Ee]+\$?\s*")
_LINE_END: Final = re.compile(r"\r\n|\n|\r")
_HEAD: Final = re.compile(r"[A-Za-z][\w ,.\-]*")
_FREE_TEXT: Final = ("PARTNO", "PPRINT", "INSERT", "REMARK", "TPRINT", "LETTER", "MCHFIN")
"""Words whose text is for people; nothing in it is looked at."""


class AptStatement(NamedTuple):
    """One statement.

    Attributes:
        line: One-based line it begins on.
        head: Text before the slash, in capitals: ``GOTO``, ``TLON,GOFWD``.
        arguments: Text after it, split at commas, in capitals.
        text: The statement as written, blanks collapsed.
        comment: Text after ``$$``; a line may be nothing else.
    """

    line: int
    head: str
    arguments: tuple[str, ...]
    text: str
    comment: str


def statements(data: bytes, source: str) -> Iterator[AptStatement]:
    """Yields the statements of a file in order; comment lines have an empty head.

    A dollar sign at the end of a line continues it. So it does in comments that begin with ``$$->``
    (data some systems hide from others), as long as numbers follow.

    Raises:
        FormatError: Not text, a line that is no statement, a continuation without an end.
    """
    pending, start, hidden = "", 0, ""
    lines = _LINE_END.split(_decode(data, source))
    if not lines[-1]:
        lines.pop()  # after the last line end
    for number, raw in enumerate(lines, start=1):
        if not (hidden or pending) and not raw.strip():
            continue
        if hidden and _NUMBERS.fullmatch(raw):
            code, comment = "", f"{hidden} {raw.strip()}"
        else:
            code, _, comment = raw.partition("$$")
        code, comment = code.strip(), comment.strip()
        hidden = comment[:-1] if comment.startswith("->") and comment.endswith("$") else ""
        if code.endswith("$"):
            start = start or number
            pending += code[:-1] + " "
            continue
        if pending:
            code, line = pending + code, start
            pending, start = "", 0
        else:
            line = number
        if code.strip() or (comment and not hidden):
            yield _statement(code, comment, line, source)
    if pending:
        raise FormatError(
            "the file ends in a continued statement ($ at the end of the line).",
            source=source,
            line=start,
            hint="copy or post the file again.",
        )


def _decode(data: bytes, source: str) -> str:
    zero = data.find(b"\0")
    if zero >= 0:
        raise FormatError(
            "NUL byte: a binary CL file, UTF-16 text, or a damaged copy.",
            source=source,
            line=data.count(b"\n", 0, zero) + 1,
            hint="output the CL data as text (APT source).",
        )
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")  # an umlaut in a comment; every statement is ASCII


def _statement(code: str, comment: str, line: int, source: str) -> AptStatement:
    text = " ".join(code.split())
    if not text:
        return AptStatement(line, "", (), "", comment)
    first = text.partition(" ")[0].partition("/")[0].upper()
    if first in _FREE_TEXT:
        return AptStatement(line, first, (text[len(first) :].strip(" /"),), text, comment)
    head, _, rest = text.partition("/")
    if not _HEAD.fullmatch(head.strip()):
        raise FormatError(
            f"{text[:60]!r} is no statement of APT or CL data.",
            source=source,
            line=line,
            hint="a statement begins with a word: GOTO/, FEDRAT/, ...; $ continues a line.",
        )
    arguments = tuple(part.strip().upper() for part in rest.split(",")) if rest.strip() else ()
    return AptStatement(line, " ".join(head.upper().split()), arguments, text, comment)


def is_number(word: str) -> bool:
    """Returns whether a word is a number as APT writes them."""
    return bool(_NUMBER.fullmatch(word.replace(" ", "")))


def to_number(word: str) -> float:
    """Returns the value of a word :func:`is_number` accepts; 1.5D+02 is Fortran's 1.5E+02."""
    return float(word.replace(" ", "").replace("D", "E").replace("d", "E"))


def numbers(statement: AptStatement, source: str) -> list[float]:
    """Returns all arguments as numbers.

    Raises:
        FormatError: One of them is not a number, or one no part can have.
    """
    for word in statement.arguments:
        if not is_number(word):
            raise FormatError(
                f"{statement.head}/ holds {word!r}, expected a number.",
                source=source,
                line=statement.line,
                hint="post the path as plain coordinates, without names of points.",
            )
    values = [to_number(word) for word in statement.arguments]
    if any(abs(value) > LARGEST for value in values):
        raise FormatError(
            f"{statement.head}/ holds a number beyond {LARGEST:g}.",
            source=source,
            line=statement.line,
        )
    return values
