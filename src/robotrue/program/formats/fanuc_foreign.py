"""The words behind a target of a Fanuc LS move, also on controllers that do not speak English.

A listing is written in the language of the pendant: ``KONFIG``, ``WKZ_NUM``, ``sek``. What moves a
target elsewhere (INC, Offset, RTCP, COORD) has other names there, too, which we know only in
English; so behind a target only words that are known to be harmless are let pass.
"""

from __future__ import annotations

import re
from typing import Final

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
    """Returns what stands behind a target, in capitals, without the names in brackets.

    What is called at a time before or after the end of the move stands last, and is left out.
    """
    words = tail.upper()
    closed = words.rfind(b"]") + 1  # brackets behind it are not closed
    words = _BRACKETS.sub(b"[]", words[:closed]) + words[closed:]
    timed = _TIMED.search(words)
    return words[: timed.start()] if timed else words


def cut_timed(tail: bytes) -> bytes:
    """Returns what stands behind a target up to what is called at a time."""
    words = _BRACKETS.sub(lambda match: b"[" + b" " * (len(match[0]) - 2) + b"]", tail.upper())
    timed = _TIMED.search(words)
    return tail[: timed.start()] if timed else tail


def odd_word(words: bytes) -> str:
    """Returns the first of the words behind a target that may move it, or nothing."""
    odd = [word for word in words.split() if not _HARMLESS.fullmatch(word)]
    return odd[0].decode("latin-1") if odd else ""
