"""What the languages of words share (G-code, Heidenhain, APT, CSV): their writer and its losses."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.errors import RobotrueError
from robotrue.program.formats.stated_feeds import FLAGS, RAPID, last_stated
from robotrue.program.insertion import Inserter
from robotrue.program.language import Unfollowed
from robotrue.program.program import Program, Replacement

if TYPE_CHECKING:
    from robotrue.program.toolpath import Toolpath

_OTHERS: Final = re.compile(
    rb"(?im)^[^\S\n]*+(?:/JOB|/PROG|&ACCESS|DEF(?:DAT)?\s+\w+ *\(|(?:SYS)?MODULE\b|def |///"
    rb"|GOTO\s*/)|x_mm"
)
_FEED_WORDS: Final = (
    rb"(?P<note>;[^\r\n]*|(?<![A-Z_])G0*+4\b[^\r\n;(]*)"
    rb"|(?<![A-Z_])G0*(?P<mode>[0-3])(?![\d.])|(?P<cip>\bCIP\b)"
    rb"|(?<![A-Z_#])F[ \t]*+(?:=[ \t]*+)?(?P<feed>\d++\.?+\d*+|\.\d++)"
    rb"|(?<![A-Z_#])F[ \t]*+(?P<lost>[=#\[])|(?<![A-Z_])(?P<odd>G(?:93|95|20|70|700)\b)"
)
_FEEDS: Final = re.compile(rb"\((?P<inside>[^)\r\n]*+)(?P<closed>\))?|" + _FEED_WORDS, FLAGS)
_FEEDS_OPEN: Final = re.compile(_FEED_WORDS, FLAGS)
"""Words after a bracket that its line does not close, which is no comment."""


LONG_PATH: Final = 8 << 20
"""Bytes from which a file is cut: some 180,000 points."""
G_CODE: Final = "ISO G-code"
"""Family of the languages that go by each other's suffixes."""


def is_other_language(data: bytes) -> bool:
    """Returns whether bytes have what no G-code has: heads of robot programs, APT, tables."""
    return bool(_OTHERS.search(data))


def path_inserter() -> Inserter:
    """Returns the inserter of targets into programs of words."""
    from robotrue.program.formats.path_insert import INSERTER

    return INSERTER


def write_words(program: Program, replacement: Replacement) -> bytes:
    """Returns the file with the words of the changed rows replaced.

    Raises:
        ShapeError: A changed row has a value that cannot be written.
    """
    from robotrue.program.formats.path_write import write_path

    return write_path(program, replacement)


def list_losses(program: Program, replacement: Replacement) -> tuple[Unfollowed, ...]:
    """Returns what the written file cannot hold of the new points."""
    from robotrue.program.formats.path_write import path_losses

    return path_losses(program, replacement)


def g_code_feeds(program: Program) -> Array:
    """Returns the feed (n,) m/s of F and G0; NaN where it is per revolution or in inches."""
    place, value, feed, rapid, known = [], [], np.nan, False, True
    for match in _find_feed_words(program.data):
        if match["note"]:
            continue
        if match["odd"]:
            known = False
        elif match["mode"]:
            rapid = match["mode"] == b"0"
        elif match["cip"]:
            rapid = False
        else:
            feed = float(match["feed"]) * MM / 60.0 if match["feed"] else np.nan
        place.append(match.start())
        value.append(RAPID if rapid else feed if known else np.nan)
    return last_stated(program, place, value)


def _find_feed_words(data: bytes) -> Iterator[re.Match[bytes]]:
    for match in _FEEDS.finditer(data):
        if match["inside"] is None:
            yield match
        elif not match["closed"]:
            yield from _FEEDS_OPEN.finditer(data, *match.span("inside"))


def toolpath_feeds(program: Program, reader: Callable[..., Toolpath]) -> Array:
    """Returns the feed (n,) m/s of the lines of a tool path; NaN where it cannot be read as one."""
    try:
        path = reader(program.data, source=program.name)
    except RobotrueError:  # a program may state less than a tool path must
        return np.full(len(program), np.nan)
    feed = dict(zip(path.line.tolist(), np.where(path.rapid, RAPID, path.feed), strict=True))
    return np.array([feed.get(line, np.nan) for line in program.line.tolist()])
