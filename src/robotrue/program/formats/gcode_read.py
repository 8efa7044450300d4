"""Reads Sinumerik and Fanuc programs: blocks of addresses and keywords."""

from __future__ import annotations

from robotrue.errors import FormatError
from robotrue.program.formats.gcode_blocks import Findings
from robotrue.program.formats.gcode_build import build
from robotrue.program.formats.gcode_odd import OddReader
from robotrue.program.formats.gcode_scan import Take, scan_blocks
from robotrue.program.formats.gcode_vocabulary import Vocabulary
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
