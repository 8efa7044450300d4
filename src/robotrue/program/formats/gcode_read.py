"""Reads programs of blocks: G-code of Sinumerik and Fanuc, and Heidenhain conversational."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from robotrue.errors import FormatError
from robotrue.program.formats.gcode_blocks import CALLED, Blocks, Findings, Take, scan_blocks
from robotrue.program.formats.gcode_build import build
from robotrue.program.formats.gcode_jobs import (
    carry_states,
    list_calls,
    list_changed_offsets,
    list_shifted_calls,
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
    found = [_scan(data, name, vocabulary, "") for name, data in files]
    if len(files) > 1:
        calls = list_calls(files, found)
        for k, why in list_shifted_calls(files, found, calls).items():
            found[k] = _scan(files[k][1], files[k][0], vocabulary, why)
        carry_states(files, found, calls)
    tables = [replace(frames, changed_frames=each) for each in list_changed_offsets(files)]
    return tuple(
        build(blocks, name, vocabulary, table)
        for (name, _), blocks, table in zip(files, found, tables, strict=True)
    )


def _scan(data: bytes, name: str, vocabulary: Vocabulary, shifted: str) -> Blocks:
    """Returns the blocks of a file; ``shifted``: why its coordinates are, from its first on."""
    made: list[ConversationalReader] = []

    def reader(vocabulary: Vocabulary, found: Findings) -> Take:
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
