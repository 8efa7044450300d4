"""Reads programs of blocks: G-code of Sinumerik and Fanuc, and Heidenhain conversational."""

from __future__ import annotations

from robotrue.errors import FormatError
from robotrue.program.formats.gcode_blocks import Findings, Take, scan_blocks
from robotrue.program.formats.gcode_build import build
from robotrue.program.formats.gcode_odd import OddReader
from robotrue.program.formats.gcode_vocabulary import HEIDENHAIN, Vocabulary
from robotrue.program.formats.heidenhain_odd import ConversationalReader
from robotrue.program.formats.text_lines import line_at
from robotrue.program.program import FrameTable, Program


def read_gcode(data: bytes, name: str, vocabulary: Vocabulary, frames: FrameTable) -> Program:
    """Returns the program of a file of G-code.

    Raises:
        FormatError: Not text, or without a single block that moves.
    """
    blocks = scan_blocks(data, name, vocabulary, _reader)
    if not (blocks.column < 24).any() and not blocks.findings.silent:
        raise FormatError(
            "no block has a coordinate: not a program of machining.",
            source=name,
            line=1,
            hint="give the program with the moves, not the one that calls it.",
        )
    return build(blocks, name, vocabulary, frames)


def _reader(vocabulary: Vocabulary, found: Findings) -> Take:
    return OddReader(vocabulary, found).take


def read_heidenhain(data: bytes, name: str, frames: FrameTable) -> Program:
    """Returns the program of a conversational file.

    Raises:
        FormatError: Not text, no ``BEGIN PGM``, or no ``END PGM`` (cut off).
    """
    made: list[ConversationalReader] = []

    def reader(vocabulary: Vocabulary, found: Findings) -> Take:
        made.append(ConversationalReader(vocabulary, found))
        return made[0].take

    blocks = scan_blocks(data, name, HEIDENHAIN, reader)
    if not made[0].begun:
        raise FormatError(
            "no BEGIN PGM: not a conversational program.",
            source=name,
            line=1,
            hint="output the program as conversational text (.H).",
        )
    if not made[0].ended:
        raise FormatError(
            "no END PGM: the file is cut off.",
            source=name,
            line=line_at(data.rstrip(), len(data.rstrip())),
            hint="export the program again.",
        )
    return build(blocks, name, HEIDENHAIN, frames)
