"""How fast the tool moves to each target, as far as the text of a program says it plainly.

Modal feeds (``$VEL.CP``, F, FEDRAT/) hold in the order of the text: what a jump or a call changes
is not followed. A feed that stands with a move in another place than the target (a variable, a
point of another file) is not known, nor is one that is computed or per revolution.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.errors import RobotrueError
from robotrue.program.formats.apt import read_apt
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.formats.toolpath_csv import read_toolpath_csv
from robotrue.program.program import Motion, Program
from robotrue.program.toolpath import Toolpath

RAPID: Final = np.inf
"""The feed of a move that cuts nothing."""
_FLAGS: Final = re.IGNORECASE | re.MULTILINE
_NUMBER: Final = rb"(\d++\.?+\d*+|\.\d++)"
_G_WORDS: Final = (
    rb"(?P<note>;[^\r\n]*|(?<![A-Z_])G0*+4\b[^\r\n;(]*)"
    rb"|(?<![A-Z_])G0*(?P<mode>[0-3])(?![\d.])|(?P<cip>\bCIP\b)"
    rb"|(?<![A-Z_#])F[ \t]*+(?:=[ \t]*+)?(?P<feed>\d++\.?+\d*+|\.\d++)"
    rb"|(?<![A-Z_#])F[ \t]*+(?P<lost>[=#\[])|(?<![A-Z_])(?P<odd>G(?:93|95|20|70|700)\b)"
)
_G: Final = re.compile(rb"\((?P<inside>[^)\r\n]*+)(?P<closed>\))?|" + _G_WORDS, _FLAGS)
_G_OPEN: Final = re.compile(_G_WORDS, _FLAGS)
"""Words behind a bracket that its line does not close, which is no comment."""
_HEIDENHAIN: Final = re.compile(
    rb";[^\r\n]*|\bF(?:" + _NUMBER + rb"|(?P<max>MAX)|(?P<odd>AUTO|[UZQ]))", _FLAGS
)
_KRL_SPEED: Final = re.compile(
    rb"^([^;\r\n]*?)(?:\$VEL\.CP[ \t]*=|\$VEL[ \t]*=|BAS[ \t]*\([ \t]*#(?:CP_PARAMS|VEL_CP)[ \t]*,)"
    rb"[ \t]*(?:" + _NUMBER + rb"[ \t]*(?=[\r\n;,)]|C_|$))?",
    _FLAGS,
)
_KRL_MOVE: Final = re.compile(rb"[ \t]*S?(?:LIN|CIRC|PL)\b", re.IGNORECASE)
_RAPID_MOVE: Final = re.compile(rb"\b(?:Move|Trigg)[LJC]", re.IGNORECASE)
_RAPID_TIMED: Final = re.compile(
    rb"\\(?:T|V[ \t]*:=[ \t]*" + _NUMBER + rb")(?=[ \t]*[:,\\])", re.IGNORECASE
)
"""A time or a speed that stands beside the speed data and goes before it."""
_RAPID_SPEED: Final = re.compile(rb",\s*v(\d+)\b", re.IGNORECASE)
_UR_SPEED: Final = re.compile(
    rb"\bv[ \t]*=[ \t]*" + _NUMBER
    + rb"|\][ \t]*,[ \t]*(?:a[ \t]*=[ \t]*)?[\d.]+[ \t]*,[ \t]*" + _NUMBER
)  # fmt: skip
_FANUC_MOVE: Final = re.compile(
    rb"P\[(\d++)(?:(?!P\[)[^\]\r\n])*+\][ \t]++" + _NUMBER + rb"[ \t]*(mm/sec|cm/min)",
    re.IGNORECASE,
)
_FANUC_POINT: Final = re.compile(rb"[ \t]*P\[(\d+)")
_JBI_MOVE: Final = re.compile(rb"^MOV[LCS][ \t]+([CP]\d++)[^\r\n]*?\bV=" + _NUMBER, re.MULTILINE)
_JBI_POINT: Final = re.compile(rb"[ \t]*([CP]\d+)")


def stated_feeds(program: Program) -> Array:
    """Returns the feed (n,) m/s of the move to each target; infinite for rapids, NaN if not known.

    Args:
        program: As read.
    """
    read = _READERS.get(program.dialect)
    feed = np.full(len(program), np.nan) if read is None else read(program)
    feed[program.motion == Motion.PTP] = RAPID
    via = np.flatnonzero((program.motion[:-1] == Motion.ARC_VIA) & np.isnan(feed[:-1]))
    feed[via] = feed[via + 1]
    return feed


def _at(program: Program, place: list[int], value: list[float]) -> Array:
    """The value last said at or before the end of the line of each target; NaN before the first."""
    starts = line_starts(program.data)
    end = np.append(starts[1:], len(program.data))[program.line - 1]
    found = np.searchsorted(np.array(place, dtype=np.int64), end, side="left") - 1
    return np.where(found < 0, np.nan, np.array([*value, np.nan])[found])


def _g_words(data: bytes) -> Iterator[re.Match[bytes]]:
    for match in _G.finditer(data):
        if match["inside"] is None:
            yield match
        elif not match["closed"]:
            yield from _G_OPEN.finditer(data, *match.span("inside"))


def _g_code(program: Program) -> Array:
    place, value, feed, rapid, known = [], [], np.nan, False, True
    for match in _g_words(program.data):
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
    return _at(program, place, value)


def _heidenhain(program: Program) -> Array:
    place, value, once = [], [], []
    known = b"INCH" not in program.data[:4096].upper()
    for match in _HEIDENHAIN.finditer(program.data):
        if match["max"]:
            once.append(match.start())
        elif match[1] or match["odd"]:
            place.append(match.start())
            value.append(float(match[1]) * MM / 60.0 if match[1] and known else np.nan)
    out = _at(program, place, value)
    fast = np.searchsorted(line_starts(program.data), np.array(once, dtype=np.int64), side="right")
    out[np.isin(program.line, fast)] = RAPID
    return out


def _toolpath(reader: Callable[..., Toolpath]) -> Callable[[Program], Array]:
    def read(program: Program) -> Array:
        try:
            path = reader(program.data, source=program.name)
        except RobotrueError:  # a program may say less than a tool path has to
            return np.full(len(program), np.nan)
        feed = dict(zip(path.line.tolist(), np.where(path.rapid, RAPID, path.feed), strict=True))
        return np.array([feed.get(line, np.nan) for line in program.line.tolist()])

    return read


def _rows(program: Program) -> list[bytes]:
    """The text of the line of every target, without its end."""
    starts = [*line_starts(program.data).tolist(), len(program.data)]
    return [program.data[starts[k - 1] : starts[k]] for k in program.line.tolist()]


def _krl(program: Program) -> Array:
    place, value, own = [], [], {}
    starts = line_starts(program.data)
    for match in _KRL_SPEED.finditer(program.data):
        said = float(match[2]) if match[2] else np.nan
        if _KRL_MOVE.match(match[1]):
            own[int(np.searchsorted(starts, match.start(), side="right"))] = said
        else:
            place.append(match.start())
            value.append(said)
    out = _at(program, place, value)
    for k, (line, text) in enumerate(zip(program.line.tolist(), _rows(program), strict=True)):
        out[k] = own.get(line, out[k]) if _KRL_MOVE.match(text) else np.nan
    return out


def _rapid(program: Program) -> Array:
    starts = line_starts(program.data)
    out = np.full(len(program), np.nan)
    for k, line in enumerate(program.line.tolist()):
        begin = int(starts[line - 1])
        text = program.data[begin : program.data.find(b";", begin)]
        if _RAPID_MOVE.search(text):
            match = _RAPID_TIMED.search(text) or _RAPID_SPEED.search(text)
            out[k] = float(match[1]) * MM if match and match[1] else np.nan
    return out


def _urscript(program: Program) -> Array:
    out = np.full(len(program), np.nan)
    for k, text in enumerate(_rows(program)):
        match = _UR_SPEED.search(text) if b"move" in text else None
        if match:
            out[k] = float(match[1] or match[2])
    return out


def _by_point(move: re.Pattern[bytes], point: re.Pattern[bytes]) -> Callable[[Program], Array]:
    def read(program: Program) -> Array:
        feed: dict[bytes, float] = {}
        for match in move.finditer(program.data):
            unit = 10.0 * MM / 60.0 if match.re is _FANUC_MOVE and match[3] == b"cm/min" else MM
            value = float(match[2]) * unit
            feed[match[1]] = value if feed.get(match[1], value) == value else np.nan
        out = np.full(len(program), np.nan)
        for k, text in enumerate(_rows(program)):
            named = point.match(text)
            out[k] = feed.get(named[1], np.nan) if named else np.nan
        return out

    return read


_READERS: Final[Mapping[str, Callable[[Program], Array]]] = {
    "apt": _toolpath(read_apt),
    "fanuc_gcode": _g_code,
    "fanuc_ls": _by_point(_FANUC_MOVE, _FANUC_POINT),
    "heidenhain": _heidenhain,
    "jbi": _by_point(_JBI_MOVE, _JBI_POINT),
    "krl": _krl,
    "rapid": _rapid,
    "sinumerik": _g_code,
    "toolpath_csv": _toolpath(read_toolpath_csv),
    "urscript": _urscript,
}
