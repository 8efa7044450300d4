"""Draws docs/_static/slot_sides.png: true error of each side and the step, for ways to register.

    python docs/make_slot_picture.py [CELLS]

Simulated cells of robotrue.simulation.feng2018_cell, seeds 1 to CELLS (60). Marks are medians,
bars go from 5 to 95 % of the cells.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes

from robotrue.core.units import MM
from robotrue.report.figure import AFTER, BEFORE, INK, MUTED, png
from robotrue.simulation.reproduce_feng2018_ways import WAYS, Way, WayResult, results_of

OUT: Final = Path(__file__).resolve().parent / "_static" / "slot_sides.png"
KEYS: Final = ("drawn", "paper", "per-side", "touches-30", "touches-90", "calibrated", "refitted")
LABELS: Final = {
    "drawn": "as drawn,\nspindle askew",
    "paper": "3 points,\ntip from CAD",
    "per-side": "a frame\nper side",
    "touches-30": "30 touches,\none estimate",
    "touches-90": "90 touches,\none estimate",
    "calibrated": "calibrated,\n30 points",
    "refitted": "calibrated,\nnew tool refitted",
}
COLUMNS: Final = (
    ("front", BEFORE, "o", "true error, first side (rms)"),
    ("back", AFTER, "s", "true error, second side (rms)"),
    ("mismatch", INK, "D", "step of the slots"),
)


def main(arguments: list[str]) -> None:
    """Cuts, draws, and says the medians on stderr."""
    cells = int(arguments[0]) if arguments else 60
    ways = tuple(way for key in KEYS for way in WAYS if way.key == key)
    found = [results_of(seed, ways) for seed in range(1, cells + 1)]
    for way in ways:
        medians = [np.median([getattr(c[way.name], q) for c in found]) / MM for q, *_ in COLUMNS]
        sys.stderr.write(f"{way.key:12s} {' '.join(f'{v:.3f}' for v in medians)}\n")
    with mpl.rc_context({"font.size": 10.0}):
        picture = png(
            lambda axes: draw(axes[0], ways, found),
            height=4.6,
            title=f"SIMULATED: cut from two sides, {cells} cells, median and 5 to 95 %",
        )
    OUT.write_bytes(picture)


def draw(ax: Axes, ways: tuple[Way, ...], found: list[dict[str, WayResult]]) -> None:
    """Draws one group of three marks for each way, on a logarithmic axis."""
    place = np.arange(len(ways))
    for k, (quantity, colour, mark, label) in enumerate(COLUMNS):
        values = np.array([[getattr(c[w.name], quantity) for c in found] for w in ways]) / MM
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
    ax.set_xticks(place, [LABELS[w.key] for w in ways])
    ax.set_ylabel("mm (logarithmic)")
    ax.grid(axis="x", visible=False)
    ax.legend(loc="upper right", ncols=1)


if __name__ == "__main__":
    main(sys.argv[1:])
