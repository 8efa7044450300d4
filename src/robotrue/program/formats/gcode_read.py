"""Reads programs of blocks: G-code of Sinumerik and Fanuc, and Heidenhain conversational."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from robotrue.errors import FormatError
from robotrue.program.formats.gcode_blocks import CALLED, Blocks, Findings, Take, scan_blocks
from robotrue.program.formats.gcode_build import ProgramBuilder
from robotrue.program.formats.gcode_jobs import (
    Call,
    carry_states,
    list_calls,
    list_changed_offsets,
    list_groups,
    list_shifted_calls,
    settle_states,
)
from robotrue.program.formats.gcode_odd import OddReader
from robotrue.program.formats.gcode_vocabulary import HEIDENHAIN, Vocabulary
from robotrue.program.formats.heidenhain_odd import ConversationalReader
from robotrue.program.formats.text_lines import line_at
from robotrue.program.program import FrameTable, Program


def read_gcode(
    files: Sequence[tuple[str, bytes]], vocabulary: Vocabulary, frames: FrameTable
) -> tuple[Program, ...]:
    """Returns the programs of a job of G-code or conversational files.

    Raises:
        FormatError: Not text, without a single block that moves, or a conversational file without
            ``BEGIN PGM``, or ``END PGM`` (cut off).
    """
    found = [_scan(each, vocabulary, "") for each in files]
    begun = frozenset[str]().union(*(each.findings.begun for each in found))
    for k, each in enumerate(files):
        if begun and found[k].findings.breaks:
            found[k] = _scan(each, vocabulary, "", begun, found[k].findings.entries)
    calls = list_calls(files, found)
    for k, why in list_shifted_calls(files, found, calls).items():
        found[k] = _scan(files[k], vocabulary, why, begun, found[k].findings.entries)
    settle_states(found, calls, every=vocabulary is HEIDENHAIN)
    carry_states(files, found, calls)
    tables = [replace(frames, changed_frames=each) for each in list_changed_offsets(files)]
    builders = [
        ProgramBuilder(blocks, name, vocabulary, table)
        for blocks, (name, _), table in zip(found, files, tables, strict=True)
    ]
    return _build_all(builders, calls)


def _build_all(builders: Sequence[ProgramBuilder], calls: Sequence[Call]) -> tuple[Program, ...]:
    """Returns the programs; a point of one may take over words from another that it calls."""
    groups = list_groups(len(builders), calls)
    handing = {
        group
        for k, (builder, group) in enumerate(zip(builders, groups, strict=True))
        if builder.continues_others({call.block for call in calls if call.caller == k})
    }
    called = {call.called for call in calls}
    return tuple(
        builder.program(ends=group in handing, last=k in called)
        for k, (builder, group) in enumerate(zip(builders, groups, strict=True))
    )


def _scan(
    file: tuple[str, bytes],
    vocabulary: Vocabulary,
    shifted: str,
    elsewhere: frozenset[str] = frozenset(),
    entries: Sequence[int] = (),
) -> Blocks:
    """Returns the blocks of a file.

    Args:
        file: Its name and bytes.
        vocabulary: The control.
        shifted: Why its coordinates are, from its first on; empty: they are not.
        elsewhere: Shifts that may be in force behind its calls and jumps.
        entries: Blocks that jumps lead to.
    """
    name, data = file
    made: list[ConversationalReader] = []

    def reader(vocabulary: Vocabulary, found: Findings) -> Take:
        found.elsewhere, found.reached = elsewhere, min(entries, default=found.reached)
        if shifted:
            found.shift(0, CALLED, True)
            found.told.append((0, shifted))
        if vocabulary is not HEIDENHAIN:
            return OddReader(vocabulary, found).take
        made.append(ConversationalReader(vocabulary, found))
        return made[0].take

    blocks = scan_blocks(data, name, vocabulary, reader)
    if made:
        _require_whole(data, name, made[0])
    elif not (blocks.column < 24).any() and not blocks.findings.silent:
        raise FormatError(
            "no block has a coordinate: not a program of machining.",
            source=name,
            line=1,
            hint="give the program with the moves, not the one that calls it.",
        )
    return blocks


def _require_whole(data: bytes, name: str, made: ConversationalReader) -> None:
    if not made.begun:
        raise FormatError(
            "no BEGIN PGM: not a conversational program.",
            source=name,
            line=1,
            hint="output the program as conversational text (.H).",
        )
    if not made.ended:
        raise FormatError(
            "no END PGM: the file is cut off.",
            source=name,
            line=line_at(data.rstrip(), len(data.rstrip())),
            hint="export the program again.",
        )
