"""Writes new points into the bytes of a path of words; every other byte is copied.

A number is rewritten in its own style, only when it differs by more than half of its last digit. A
word that was left out because it stayed the same is inserted where it changes: after the last word
of its block, in the style of the last one of its kind. Limits of a path of words (arcs out of their
plane, unprinted turns) are listed by :func:`path_losses`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError
from robotrue.program.formats.apt_arcs import MISS
from robotrue.program.formats.gcode_arcs import (
    ACROSS,
    Centre,
    PlaneArcs,
    in_plane,
    middles,
    moved_words,
)
from robotrue.program.formats.number_table import Numbers, put_stretches, respell_tokens
from robotrue.program.formats.number_text import Stretch, respell_word, restyle
from robotrue.program.formats.path_kernels import decimals_of, owed_words
from robotrue.program.formats.path_words import PathWords, Turn, printed_angles
from robotrue.program.formats.pose_write import (
    SAME_ROTATION,
    changed_rows,
    find_moved,
    new_words,
    require_printable,
    spans_of,
)
from robotrue.program.language import Unfollowed
from robotrue.program.program import Program, Replacement

_MILLIMETRES: Final = (3, 3)
_INCHES: Final = (4, 5)
_VECTOR: Final = (5, 7)
"""Decimals that can hold a correction, and those printed where there are fewer."""
_UNSEEN: Final = b"0.0000"
"""Style of a word that was not printed before."""
_ARC_NAMES: Final = (b"I", b"J", b"K")
_SLIGHT: Final = 0.5 * UM
_SLIGHT_TURN: Final = 1e-4 * DEG
_IN_PLANE: Final = (
    "{count} arcs stay in their plane, and keep the digits of their radius: in the middle they "
    "deviate by up to {worst:.1f} um (line {line})."
)
_LEVEL: Final = (
    "{count} arcs end at the height they begin at: there they deviate by up to {worst:.1f} um "
    "(line {line})."
)
_UNSAID: Final = (
    "{count} points print no word for all of their turn: up to {worst:.3f} deg are not written "
    "(line {line})."
)


def write_path(program: Program, replacement: Replacement) -> bytes:
    """Returns the file with the words of the changed rows replaced and nothing else touched.

    Raises:
        ShapeError: A changed row has a value that is not finite, or beyond 1e9 mm or deg.
        ConfigurationError: New ends of an arc that no circle of its plane joins as it did.
    """
    words = spans_of(program, PathWords, "path")
    changed = changed_rows(program, replacement)
    values, touched = _compute_wanted(program, replacement, words, changed)
    enough, least = _decimals(words)
    marks = _marks(program, replacement, words)
    if not (touched.any() or marks):
        return program.data
    arcs = _arcs(program, words, values, touched)
    others = [
        *marks,
        *_insertions(program.data, words, values, touched, enough, least),
        *_arc_insertions(program.data, words, arcs),
    ]
    numbers = [(words.numbers, values, touched, enough, least)]
    if len(words.arcs):
        size = arcs[0].shape
        unit = np.where(_is_inch(words)[words.arcs.end], 0, 1)[:, None]
        few = np.where(unit, _MILLIMETRES[0], _INCHES[0])
        many = np.where(unit, _MILLIMETRES[1], _INCHES[1])
        numbers.append(
            (words.arcs.numbers, *arcs, np.broadcast_to(few, size), np.broadcast_to(many, size))
        )
    return _spell_edits(program.data, numbers, others)


def _spell_edits(
    data: bytes,
    numbers: list[tuple[Numbers, Array, BoolArray, IntArray, IntArray]],
    others: list[Stretch],
) -> bytes:
    """Returns the bytes with other stretches spliced in and all touched numbers rewritten."""
    columns = [
        np.concatenate([np.asarray(each).ravel() for each in column])[:, None]
        for column in zip(
            *((n.start, n.length, n.value, v, t, e, m) for n, v, t, e, m in numbers), strict=True
        )
    ]
    start, length, value, wanted, touched, enough, least = columns
    data, start = put_stretches(data, others, start)
    tokens = Numbers(start=start, length=length, value=value)
    return respell_tokens(data, tokens, wanted, touched, enough, least)


def _compute_wanted(
    program: Program, replacement: Replacement, words: PathWords, changed: BoolArray
) -> tuple[Array, BoolArray]:
    """Returns the new value of every word (n, 6), as printed, and which of them change."""
    values = np.array(words.value)
    touched = np.zeros(values.shape, dtype=np.bool_)
    place, turn, axes = find_moved(program, replacement)
    point = changed & (words.turn != Turn.AXES)
    touched[:, :3] = place & point[:, None]
    printed = replacement.position / words.unit[:, None]
    values[:, :3] = np.where(touched[:, :3], printed, values[:, :3])
    rows = np.flatnonzero(turn & point & (words.turn == Turn.ANGLES))
    values[rows, 3:] = printed_angles(replacement.rotation[rows], values[rows, 3:], words.rule)
    touched[rows, 3:] = True
    rows = np.flatnonzero(turn & point & (words.turn == Turn.VECTOR))
    before = words.rule.axes_of(program.rotation[rows])
    after = words.rule.axes_of(np.asarray(replacement.rotation[rows]))
    with np.errstate(invalid="ignore"):
        same = (np.abs(after - before) <= SAME_ROTATION).all(axis=1)  # the spin alone is no word
    rows, after = rows[~same], after[~same]
    values[rows, 3:], touched[rows, 3:] = after, True
    rows = np.flatnonzero(changed & (words.turn == Turn.AXES))
    touched[rows] = axes[rows]
    values[rows] = np.where(axes[rows], replacement.axes[rows] / DEG, values[rows])
    require_printable(program, values, touched, "mm, inches or deg")
    return values, touched


def _is_inch(words: PathWords) -> BoolArray:
    return np.asarray(words.unit > 2.0 * MM)


def _decimals(words: PathWords) -> tuple[IntArray, IntArray]:
    """Decimals (n, 6) that can hold a correction, and those to print where there are fewer."""
    out = []
    for k in (0, 1):
        each = np.full(words.value.shape, _MILLIMETRES[k], np.int64)
        each[_is_inch(words), :3] = _INCHES[k]
        each[words.turn == Turn.VECTOR, 3:] = _VECTOR[k]
        each[words.turn == Turn.AXES] = _MILLIMETRES[k]
        out.append(each)
    return out[0], out[1]


def _arcs(
    program: Program, words: PathWords, values: Array, touched: BoolArray
) -> tuple[Array, BoolArray]:
    """Returns the new centres and radii (k, 3), and which of them change."""
    arcs = words.arcs
    if not len(arcs):
        return np.empty((0, 3)), np.empty((0, 3), np.bool_)
    rows = np.stack([arcs.start, arcs.via, arcs.end])
    stirred = np.asarray(touched[rows, :3].any(axis=(0, 2)))
    new = np.where(
        stirred[:, None], moved_words(arcs, words.value[:, :3], values[:, :3]), arcs.value
    )
    _require_circles(program, words, replace(arcs, value=new), values[:, :3], stirred)
    return new, np.broadcast_to(stirred[:, None], new.shape).copy()


def _require_circles(
    program: Program, words: PathWords, arcs: PlaneArcs, points: Array, stirred: BoolArray
) -> None:
    """Refuses an arc that the control would refuse, or run the other part of its circle."""
    middle, miss = middles(arcs, points)
    off = np.where(stirred, miss * words.unit[arcs.end], 0.0)
    start, wanted, written = (
        in_plane(arcs.plane, each) for each in (points[arcs.start], points[arcs.via], middle)
    )
    # A whole circle whose ends come apart is a short arc if its end now lies before its start.
    other = np.hypot(*(written - wanted).T) > 0.5 * np.hypot(*(wanted - start).T)
    other &= stirred
    if (off <= MISS).all() and not other.any():
        return
    worst = int(np.argmax(np.where(other, np.inf, off)))
    what = (
        "the corrected ends of the whole circle lie apart, and the arc between them is another"
        if other[worst]
        else f"the corrected ends of the arc lie {off[worst] / MM:.3f} mm off one circle, at most "
        f"{MISS / MM:g} mm is an arc to the control"
    )
    raise ConfigurationError(
        f"{what}.",
        source=program.name,
        line=int(program.line[arcs.end[worst]]),
        hint="compensate --split writes it as lines.",
    )


def _insertions(
    data: bytes,
    words: PathWords,
    values: Array,
    touched: BoolArray,
    enough: IntArray,
    least: IntArray,
) -> list[Stretch]:
    """Returns (byte, 0, words) of left-out words, those of one place together."""
    shown = decimals_of(np.frombuffer(data, np.uint8), words.numbers.start, words.numbers.length)
    shown = np.where(shown < enough, np.maximum(shown, least), shown)
    scale = 10.0**shown
    with np.errstate(invalid="ignore", over="ignore"):  # beyond 1e9 it is refused below
        near = np.abs(values - words.value) <= 0.5 / scale
        said = np.where(touched & ~near, np.round(values * scale) / scale, words.value)
    owed = np.zeros(values.shape, np.bool_)
    donor = np.full(values.shape, -1, np.int64)
    owed_words(
        words.numbers.start >= 0, said, values, words.value, shown, words.turn, words.skip,
        words.at >= 0, words.barred, owed, donor,
    )  # fmt: skip
    rows, columns = np.nonzero(owed)
    gap = b" " if words.blank else b""
    out: list[Stretch] = []
    styles = donor[rows, columns]
    starts = np.where(styles >= 0, words.numbers.start[styles, columns], -1)
    ends = starts + words.numbers.length[styles, columns]
    for column, first, end, place, turn, value, few, many in zip(
        *(
            each.tolist()
            for each in (
                columns, starts, ends, words.at[rows], words.turn[rows],
                values[rows, columns], enough[rows, columns], least[rows, columns],
            )
        ),
        strict=True,
    ):  # fmt: skip
        style = data[first:end] if first >= 0 else _UNSEEN
        fine = len(style.partition(b".")[2]) >= few
        text = gap + words.names[turn][column] + restyle(style, value, least=0 if fine else many)
        if out and out[-1][0] == place:
            text = out.pop()[2] + text
        out.append((place, 0, text))
    return out


def _style(data: bytes, numbers: Numbers, row: int, column: int) -> bytes:
    first = int(numbers.start[row, column])
    return data[first : first + int(numbers.length[row, column])]


def _arc_insertions(
    data: bytes, words: PathWords, wanted: tuple[Array, BoolArray]
) -> list[Stretch]:
    """Returns (byte, 0, word) of components of a centre that were 0."""
    arcs, (values, touched) = words.arcs, wanted
    gap = b" " if words.blank else b""
    out: list[Stretch] = []
    left_out = touched & (arcs.numbers.start < 0) & (arcs.kind == Centre.FROM_START)[:, None]
    fine = np.where(
        _is_inch(words)[arcs.end], 0.5 * 10.0 ** -_INCHES[1], 0.5 * 10.0 ** -_MILLIMETRES[1]
    )
    for row, column in np.argwhere(left_out & (np.abs(values) > fine[:, None])).tolist():
        with_it = np.flatnonzero(arcs.numbers.start[row] >= 0)
        if not len(with_it):
            continue
        style = _style(data, arcs.numbers, row, int(with_it[0]))
        least = _INCHES[1] if _is_inch(words)[arcs.end[row]] else _MILLIMETRES[1]
        number = restyle(style, float(values[row, column]), least=least)
        last = int((arcs.numbers.start[row] + arcs.numbers.length[row]).max())
        out.append((last, 0, gap + _ARC_NAMES[column] + number))
    return out


def _marks(program: Program, replacement: Replacement, words: PathWords) -> list[Stretch]:
    """Returns (first byte, bytes, text) of the configuration words that change."""
    new = np.asarray(replacement.words)
    return [
        (
            *(place := words.marks[row, column].tolist()),
            respell_word(program.data[place[0] : sum(place)], int(new[row, column])),
        )
        for row, column in np.argwhere(new_words(program, replacement)).tolist()
    ]


def path_losses(program: Program, replacement: Replacement) -> tuple[Unfollowed, ...]:
    """Returns the parts of a replacement that the words of the program cannot hold.

    Raises:
        ShapeError: The program is not a path of words.
    """
    words = spans_of(program, PathWords, "path")
    changed = changed_rows(program, replacement)
    out = []
    deviations = (
        (_IN_PLANE, *arc_deviation(program, replacement, words, changed)),
        (_LEVEL, *_rise_lost(replacement, words, changed)),
    )
    for text, rows, off in deviations:
        if off.max(initial=0.0) > _SLIGHT:
            worst = int(np.argmax(off))
            count, line = int((off > _SLIGHT).sum()), int(program.line[rows[worst]])
            out.append(Unfollowed(count=count, worst=off[worst] / UM, line=line, text=text))
    quiet = np.isin(words.turn, (Turn.FIXED, Turn.VECTOR)) | words.barred[:, 3:].any(axis=1)
    quiet &= changed & ~words.skip
    turn = np.zeros(len(program))
    turn[quiet] = _unsaid(program, replacement, words, quiet)
    if turn.max(initial=0.0) > _SLIGHT_TURN:
        worst = int(np.argmax(turn))
        count, line = int((turn > _SLIGHT_TURN).sum()), int(program.line[worst])
        out.append(Unfollowed(count=count, worst=turn[worst] / DEG, line=line, text=_UNSAID))
    return tuple(out)


def arc_deviation(
    program: Program, replacement: Replacement, words: PathWords, changed: BoolArray
) -> tuple[IntArray, Array]:
    """Returns rows (k,) of middles of corrected plane arcs, and their remaining error (k,) m.

    Args:
        program: As it was read.
        replacement: What its points shall be.
        words: Its words.
        changed: (n,) rows that move.
    """
    arcs = words.arcs
    if not len(arcs):
        return np.empty(0, np.int64), np.empty(0)
    old = words.value[:, :3]
    new = np.where(changed[:, None], replacement.position / words.unit[:, None], old)
    wanted = moved_words(arcs, old, new)
    shown = decimals_of(
        np.frombuffer(program.data, np.uint8), arcs.numbers.start, arcs.numbers.length
    )
    scale = 10.0 ** np.maximum(shown, _MILLIMETRES[1])
    radius = (arcs.kind == Centre.RADIUS)[:, None]
    written = np.where(radius, np.round(wanted * scale) / scale, wanted)
    middle, _ = middles(replace(arcs, value=written), new)
    mine = changed[arcs.via]
    off = np.linalg.norm(middle - new[arcs.via], axis=1) * words.unit[arcs.via]
    return arcs.via[mine], off[mine]


def _rise_lost(
    replacement: Replacement, words: PathWords, changed: BoolArray
) -> tuple[IntArray, Array]:
    """Returns the ends (k,) of corrected arcs without a word of height, and what each lacks, m."""
    arcs, third = words.arcs, ACROSS[words.arcs.plane, 2]
    mine = changed[arcs.end] & changed[arcs.start] & words.barred[arcs.end, third]
    start, end, third = arcs.start[mine], arcs.end[mine], third[mine]
    rise = replacement.position[end, third] - replacement.position[start, third]
    rise -= (words.value[end, third] - words.value[start, third]) * words.unit[end]
    return end, np.abs(rise)


def _unsaid(program: Program, replacement: Replacement, words: PathWords, rows: BoolArray) -> Array:
    """Returns rad (k,) that rows are turned by and do not print: all of it, or the spin."""
    before, after = program.rotation[rows], np.asarray(replacement.rotation)[rows]
    turn = rotation_vector_from_matrix(after @ np.swapaxes(before, 1, 2))
    spin = np.abs((turn * words.rule.axes_of(before)).sum(axis=1))
    fixed = (words.turn[rows] == Turn.FIXED) | words.barred[rows, 3:].any(axis=1)
    out: Array = np.where(fixed, np.linalg.norm(turn, axis=1), spin)
    return out
