"""Every way of registration cut in one virtual cell, and a datum touched again. Simulated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.errors import ConfigurationError
from robotrue.validation.slot_test import DatumCheck
from robotrue_reproductions.feng2018.blind_spots import knock_block, register_block, touch_datums
from robotrue_reproductions.feng2018.way_results import (
    WAYS,
    WayResult,
    cut_way,
    require_calibrated,
    sessions_of,
)
from robotrue_reproductions.reproduction import Progress

PAPER_KEY: Final = "paper"
LONG: Final = "planned-90"
"""Planning its touches takes longer than everything else; cut only on request."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SlotTrial:
    """What became of the slots of one cell.

    Attributes:
        seed: Of the cell.
        results: All ways.
        paper: The way of the paper.
        chosen: The way to compare with.
        rest: Datum check with the block where it was.
        knocked: Datum check after the block was pushed.
    """

    seed: int
    results: tuple[WayResult, ...]
    paper: WayResult
    chosen: WayResult
    rest: DatumCheck
    knocked: DatumCheck


def run_slot_trial(seed: int, way: str, progress: Progress) -> SlotTrial:
    """Returns the slots cut every way in the cell of a seed.

    Args:
        seed: Of cell, touches, tracker and cutting.
        way: Key of :data:`WAYS` to compare with the paper's.
        progress: Called before each way.

    Raises:
        ConfigurationError: No such way, or a negative seed.
    """
    check_trial(seed, way)
    ways = [w for w in WAYS if w.key == way or w.key != LONG]
    sessions = sessions_of(seed)
    results = []
    for k, one in enumerate(ways):
        progress(one.name, k, len(ways))
        results.append(cut_way(one, sessions[one.cell], seed))
    found = {result.way.key: result for result in results}
    plain = sessions["plain"]
    model = require_calibrated(plain)
    frame = register_block(model, plain)
    rng = np.random.default_rng([seed, 59])
    pushed = knock_block(plain.cell, rng)
    return SlotTrial(
        seed=seed,
        results=tuple(results),
        paper=found[PAPER_KEY],
        chosen=found[way],
        rest=touch_datums(plain.cell, model, frame, rng),
        knocked=touch_datums(pushed, model, frame, rng),
    )


def check_trial(seed: int, way: str) -> None:
    """Passes if there is a cell of the seed and a way of the key.

    Raises:
        ConfigurationError: There is not.
    """
    if way not in [w.key for w in WAYS]:
        raise ConfigurationError(f"no way {way!r}; ways are {', '.join(w.key for w in WAYS)}.")
    if seed < 0:
        raise ConfigurationError(f"seed {seed}, expected 0 or more.")
