"""Speed of the tool to each target, as far as the text of a program states it directly.

Modal feeds (``$VEL.CP``, F, FEDRAT/) apply in the order of the text: changes by a jump or a call
are not followed. A feed at another place than the target (a variable, a point of another file) is
not known, nor is one that is computed or per revolution.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.lang import languages
from robotrue.program.program import Motion, Program

RAPID: Final = np.inf
"""The feed of a move that cuts nothing."""
FLAGS: Final = re.IGNORECASE | re.MULTILINE
PLAIN: Final = rb"(\d++\.?+\d*+|\.\d++)"
"""A number without sign or exponent, as a group."""


def stated_feeds(program: Program) -> Array:
    """Returns the feed (n,) m/s of the move to each target; infinite for rapids, NaN if not known.

    Args:
        program: As read.
    """
    language = languages().get(program.dialect)
    feed = np.full(len(program), np.nan) if language is None else language.feeds(program)
    feed[program.motion == Motion.PTP] = RAPID
    via = np.flatnonzero((program.motion[:-1] == Motion.ARC_VIA) & np.isnan(feed[:-1]))
    feed[via] = feed[via + 1]
    return feed


def last_stated(program: Program, places: Sequence[int], values: Sequence[float]) -> Array:
    """Returns the value (n,) last stated up to the end of the line of each target, NaN before.

    Args:
        program: As read.
        places: First bytes of the statements, rising.
        values: Of each.
    """
    starts = line_starts(program.data)
    end = np.append(starts[1:], len(program.data))[program.line - 1]
    last = np.searchsorted(np.array(places, dtype=np.int64), end, side="left") - 1
    return np.where(last < 0, np.nan, np.array([*values, np.nan])[last])


def target_lines(program: Program) -> list[bytes]:
    """Returns the text of the line of every target, without its end."""
    starts = [*line_starts(program.data).tolist(), len(program.data)]
    return [program.data[starts[k - 1] : starts[k]] for k in program.line.tolist()]


def feeds_of_points(
    program: Program, stated: Iterable[tuple[bytes, float]], point: re.Pattern[bytes]
) -> Array:
    """Returns the feed (n,) m/s of points that moves name; NaN where two moves state two feeds.

    Args:
        program: As read.
        stated: Name of a point and mm/s, of every move that states a feed.
        point: Matches the line of a point; its first group is the name.
    """
    feeds: dict[bytes, float] = {}
    for name, speed in stated:
        feeds[name] = speed * MM if feeds.get(name, speed * MM) == speed * MM else np.nan
    names = [point.match(text) for text in target_lines(program)]
    return np.array([feeds.get(name[1], np.nan) if name else np.nan for name in names])
