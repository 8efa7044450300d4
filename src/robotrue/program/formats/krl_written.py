"""KRL targets that are written out: aggregates inserted where a motion names a computed target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.program.formats.krl_expression import KrlRecord
from robotrue.program.formats.krl_scan import COMPONENTS, Scan
from robotrue.program.formats.krl_walk import KrlWalk

_CODE: Final = {name.lower(): code for code, name in enumerate(COMPONENTS)}


class Written(NamedTuple):
    """A target that is written out.

    Attributes:
        file: That contains it.
        line: Zero-based.
        start: First byte of the text it replaces.
        end: Byte after it.
        value: Its components as printed.
        agg: Its placeholder number until it has one.
        names: Variables it is computed from.
    """

    file: int
    line: int
    start: int
    end: int
    value: KrlRecord
    agg: int
    names: frozenset[str]


def put_written(walk: KrlWalk, written: Sequence[Written]) -> None:
    """Inserts targets into the scans of their files as aggregates, and renumbers them."""
    for file in {each.file for each in written}:
        mine = sorted((each for each in written if each.file == file), key=lambda each: each.start)
        walk.scans[file], place, new = _with_aggregates(walk.scans[file], mine)
        number = {each.agg: int(at) for each, at in zip(mine, new, strict=True)}
        _renumber(walk, file, place, number)
        walk.story.written |= {
            (file, number[each.agg]): (each.start, each.end, each.names) for each in mine
        }


def _with_aggregates(scan: Scan, written: Sequence[Written]) -> tuple[Scan, IntArray, IntArray]:
    """Returns the scan with more aggregates, and the new numbers of the old and of the others."""
    counts = np.concatenate([np.diff(scan.agg_token), [len(each.value) for each in written]])
    old = len(scan.agg_open)
    opened = np.concatenate([scan.agg_open, [each.start for each in written]])
    # A text inside an expression opens later, or at the same byte: it comes after.
    rank = np.concatenate([np.ones(old, np.int64), np.zeros(len(written), np.int64)])
    order = np.lexsort((rank, opened))
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    tokens = [pair for each in written for pair in each.value.items()]
    ends = [each.end for each in written for _ in each.value]
    first = np.concatenate([[0], np.cumsum(counts)])[:-1]
    index = np.concatenate([np.arange(first[a], first[a] + counts[a]) for a in order.tolist()])
    index = index.astype(np.int64)

    def column(old_one: np.ndarray, new: list[float] | list[int]) -> np.ndarray:
        return np.concatenate([old_one, np.array(new, old_one.dtype)])

    put = replace(
        scan,
        agg_line=column(scan.agg_line, [each.line for each in written])[order],
        agg_open=column(scan.agg_open, [each.start for each in written])[order],
        agg_close=column(scan.agg_close, [each.end - 1 for each in written])[order],
        agg_flag=column(scan.agg_flag, [0] * len(written))[order],
        agg_token=np.concatenate([[0], np.cumsum(counts[order])]).astype(np.int32),
        tok_component=column(scan.tok_component, [_CODE[name] for name, _ in tokens])[index],
        tok_start=column(scan.tok_start, ends)[index],
        tok_length=column(scan.tok_length, [0] * len(tokens))[index],
        tok_value=column(scan.tok_value, [value for _, value in tokens])[index],
    )
    return put, place[:old], place[old:]


def _renumber(walk: KrlWalk, file: int, place: IntArray, number: dict[int, int]) -> None:
    """Gives aggregates of a file their new numbers in everything that is collected."""
    story = walk.story

    def new(key: tuple[int, int]) -> tuple[int, int]:
        if key[0] != file:
            return key
        return file, number[key[1]] if key[1] < -1 else int(place[key[1]])

    story.definitions[:] = [
        d._replace(agg=int(place[d.agg])) if d.file == file else d for d in story.definitions
    ]
    for table in (story.uses, story.flags):
        items = [(new(key), value) for key, value in table.items()]
        table.clear()
        table.update(items)  # type: ignore[arg-type]
    story.arcs[:] = [(new(via), new(end)) for via, end in story.arcs]
    main = walk.main == file
    if main:
        story.sequence[:] = [
            (line, agg if agg == -1 else new((file, agg))[1], via)
            for line, agg, via in story.sequence
        ]
