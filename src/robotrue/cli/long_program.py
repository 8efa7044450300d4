"""The route a program takes through `robotrue compensate`: held whole, or in blocks."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from robotrue.calibration.model import ErrorModel
from robotrue.cli.console import remark, say
from robotrue.cli.steps import StepRule
from robotrue.compensation.result import Tally
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.steps import Steps
from robotrue.core.progress import Progress, unheard
from robotrue.errors import ConfigurationError, StepError
from robotrue.program.program import FrameTable
from robotrue.program.stream import Outline, longest, outline

LONG: Final = 32 << 20
"""Bytes from which a program goes in blocks."""
WHOLE: Final = 10
"""Bytes of memory for each byte of a program that is held whole."""
BESIDE: Final = 250 << 20
"""Bytes of memory besides."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Staff:
    """Who is to do the blocks.

    Attributes:
        workers: Processes; None: as many as help.
        dask: Address of a scheduler; None: no scheduler.
    """

    workers: int | None = None
    dask: str | None = None

    @property
    def named(self) -> bool:
        """Returns whether several are asked for, so that even short programs go in blocks."""
        return self.dask is not None or (self.workers is not None and self.workers != 1)


ALONE = Staff()
"""Nobody was asked for: as many as help."""


def outlined(path: Path, frames: FrameTable, staff: Staff, *, why_whole: str) -> Outline | None:
    """Returns the outline of a program that is to go in blocks, None if it is to be held whole.

    Args:
        path: The program.
        frames: What it names but does not hold.
        staff: Who is asked for.
        why_whole: What else asks for the whole program; empty if nothing does.

    Raises:
        ConfigurationError: It must be held whole, and this machine has not the memory.
        FormatError: The file cannot be read, or is not in its dialect.
    """
    size = longest(path)[0].stat().st_size
    if size < LONG and not staff.named:
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
    remark(path.name, f"{said}.")
    return None


def compensated_in_blocks(
    model: ErrorModel,
    found: Outline,
    source: Path,
    target: Path,
    settings: CompensationSettings,
    staff: Staff,
    steps: StepRule,
    told: Progress = unheard,
) -> tuple[str, Mapping[str, Any], Steps]:
    """Writes the compensated program; returns its SHA-256, the counts as JSON values, its steps.

    Raises:
        StepError: Steps are too large and not allowed; nothing is written.
    """
    from robotrue.compensation.stream import compensate_stream

    def accept(total: Tally) -> None:
        try:
            steps.require(total.steps, source.name)
        except StepError:
            for note in [*found.notes, *map(str, total.notes)]:
                remark(found.name, note)
            raise

    result = compensate_stream(
        model, found, source, target, settings=settings, workers=staff.workers, dask=staff.dask,
        progress=told, accept=accept,
    )  # fmt: skip
    for note in [*found.notes, *result.notes]:
        remark(found.name, note)
    say(f"{found.name}: {result.blocks} blocks by {result.workers} at a time")
    return result.sha256, result.summary(), result.tally.steps


def _memory() -> int:
    """Returns the memory of this machine in bytes; without bound where it does not say."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 1 << 60


def _mib(count: int) -> str:
    return f"{count / 2**20:.0f} MiB of memory"
