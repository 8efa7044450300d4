"""Draws docs/_static/slot_sides.png: true error of each side and the step, for ways to register.

    python docs/make_slot_picture.py [CELLS]

With CELLS the simulated cells of robotrue_reproductions.feng2018.machining_cell with seeds 1 to
CELLS are cut and kept in slot_sides.json; without, the picture is drawn from that file. Marks are
medians, bars go from 5 to 95 % of the cells.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes

from robotrue.core.units import MM
from robotrue.report.figure import AFTER, BEFORE, INK, MUTED, Drawing, png
from robotrue_reproductions.feng2018.way_results import WAYS, results_of

OUT: Final = Path(__file__).resolve().parent / "_static" / "slot_sides.png"
KEPT: Final = OUT.with_suffix(".json")
KEYS: Final = (
    "drawn",
    "paper",
    "per-side",
    "planned-30",
    "planned-90",
    "calibrated",
    "refitted-planned",
)
LABELS: Final = {
    "drawn": "as drawn,\nspindle askew",
    "paper": "3 points,\ntip from CAD",
    "per-side": "a frame\nper side",
    "planned-30": "30 touches,\nplanned",
    "planned-90": "90 touches,\nplanned",
    "calibrated": "calibrated,\n30 points",
    "refitted-planned": "calibrated,\nnew tool refitted",
}
COLUMNS: Final = (
    ("front", BEFORE, "o", "true error, first side (rms)"),
    ("back", AFTER, "s", "true error, second side (rms)"),
    ("mismatch", INK, "D", "step of the slots"),
)


def main(arguments: list[str]) -> None:
    """Cuts if asked to, draws, and says the medians on stderr."""
    if arguments:
        KEPT.write_text(json.dumps(cut(int(arguments[0])), indent=1) + "\n")
    found = json.loads(KEPT.read_text())
    for key, values in found["ways"].items():
        medians = (f"{np.median(values[quantity]):.3f}" for quantity, *_ in COLUMNS)
        sys.stderr.write(f"{key:16s} {' '.join(medians)}\n")
    with mpl.rc_context({"font.size": 10.0}):
        picture = png(
            Drawing(draw=lambda axes: draw(axes[0], found["ways"]), height=4.2),
            title=f"SIMULATED: cut from two sides, {found['cells']} cells, median and 5 to 95 %",
        )
    OUT.write_bytes(picture)


def cut(cells: int) -> dict[str, Any]:
    """Returns step and true errors in mm of every way in every cell."""
    ways = tuple(way for key in KEYS for way in WAYS if way.key == key)
    found = [results_of(seed, ways) for seed in range(1, cells + 1)]
    values = {
        way.key: {
            quantity: [round(getattr(cell[way.name], quantity) / MM, 4) for cell in found]
            for quantity, *_ in COLUMNS
        }
        for way in ways
    }
    return {"simulated": True, "unit": "mm", "cells": cells, "ways": values}


def draw(ax: Axes, ways: dict[str, dict[str, list[float]]]) -> None:
    """Draws one group of three marks for each way, on a logarithmic axis."""
    place = np.arange(len(ways))
    for k, (quantity, colour, mark, label) in enumerate(COLUMNS):
        values = np.array([way[quantity] for way in ways.values()])
        low, middle, high = np.percentile(values, [5, 50, 95], axis=1)
        ax.errorbar(
            place + 0.2 * (k - 1),
            middle,
            yerr=[middle - low, high - middle],
            fmt=mark,
            color=colour,
            markersize=6.0,
            elinewidth=1.6,
            label=label,
        )
    ax.axhline(0.7, color=MUTED, linewidth=1.0, linestyle="--")
    ax.annotate("step the paper measured, 0.7 mm", (6.45, 0.78), ha="right", color=MUTED)
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    ax.set_xticks(place, [LABELS[key] for key in ways])
    ax.set_ylabel("mm (logarithmic)")
    ax.grid(axis="x", visible=False)
    ax.legend(loc="upper right", ncols=1)


if __name__ == "__main__":
    main(sys.argv[1:])
