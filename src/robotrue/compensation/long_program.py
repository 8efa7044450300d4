"""The route a program takes through compensation: held whole, or in blocks."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Final

from robotrue.errors import ConfigurationError
from robotrue.program.program import FrameTable
from robotrue.program.stream import Outline, longest, outline

LONG: Final = 32 << 20
"""Bytes from which a program goes in blocks."""
WHOLE: Final = 10
"""Bytes of memory for each byte of a program that is held whole."""
BESIDE: Final = 250 << 20
"""Bytes of memory besides."""


def outline_long(
    path: Path,
    frames: FrameTable,
    *,
    several: bool,
    why_whole: str,
    note: Callable[[str], None],
) -> Outline | None:
    """Returns the outline of a program that is to go in blocks, None if it is to be held whole.

    Args:
        path: The program.
        frames: What it names but does not hold.
        several: Workers are asked for, so that even a short program goes in blocks.
        why_whole: What else asks for the whole program; empty if nothing does.
        note: Told why a long program is held whole.

    Raises:
        ConfigurationError: It must be held whole, and this machine has not the memory.
        FormatError: The file cannot be read, or is not in its dialect.
    """
    size = longest(path)[0].stat().st_size
    if size < LONG and not several:
        return None
    if not why_whole:
        found = outline(path, frames)
        if isinstance(found, Outline):
            return found
        why_whole = str(found)
    need = WHOLE * size + BESIDE
    said = f"the program is held whole ({why_whole}); this takes about {_mib(need)}"
    if need > _memory():
        raise ConfigurationError(
            f"{said}, this machine has {_mib(_memory())}.",
            source=path,
            hint="split the program into files, or take away what asks for the whole.",
        )
    note(f"{said}.")
    return None


def _memory() -> int:
    """Returns the memory of this machine in bytes; without bound where it does not say."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 1 << 60


def _mib(count: int) -> str:
    return f"{count / 2**20:.0f} MiB of memory"
