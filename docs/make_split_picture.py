"""Draws docs/_static/split_moves.png: lines and arcs kept whole and split, simulated arms.

    OMP_NUM_THREADS=1 python docs/make_split_picture.py

Left: how far lines and arcs between compensated targets are off, median of 20 arms of
benchmarks/split_moves.py. Right: along one arc of 25 mm under a force that turns with it (arm of
seed 0), kept whole and in the parts that 2 um ask for. Everything here is simulated.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))
from split_moves import FORCE, TOLERANCE, Move, arm, fewest, job_of, targets

from robotrue.compensation.arcs import circles, from_circles
from robotrue.compensation.split_deviation import job_deviation, sample_moves
from robotrue.core.units import UM

OUT: Final = Path(__file__).resolve().parent / "_static" / "split_moves.png"
ARMS: Final = 20
LINES: Final = np.array([10, 20, 50, 100, 200, 400, 600])
RADII: Final = np.array([5, 10, 25, 50, 100, 200])
FINE: Final = 56
"""Steps of a part in the profile."""


def medians(moves: list[Move]) -> list[float]:
    """Returns the median deviation of every move in um."""
    models = [arm(seed) for seed in range(ARMS)]
    out = []
    for move in moves:
        jobs = [job_of(model, *targets(move), arc=bool(move.angle)) for model in models]
        out.append(float(np.median([job_deviation(job).size[0] for job in jobs]) / UM))
    return out


def sizes(axis: Axes) -> None:
    """Draws deviations over length and radius."""
    line = medians([Move(float(size), 0, "") for size in LINES])
    free = medians([Move(float(size), np.pi, "") for size in RADII])
    pushed = medians([Move(float(size), np.pi, "", FORCE) for size in RADII])
    axis.loglog(LINES, line, "o-", color="#1f6f8b", ms=4, label="line, by its length")
    axis.loglog(RADII, free, "s-", color="#5b4a8a", ms=4, label="half circle, by its radius")
    label = f"half circle, {FORCE:g} N along the feed"
    axis.loglog(RADII, pushed, "^-", color="#b5452c", ms=4, label=label)
    axis.axhline(TOLERANCE / UM, color="black", lw=0.8, ls=":")
    axis.annotate("2 um", (700, TOLERANCE / UM), xytext=(0, 3), textcoords="offset points",
                  ha="right", fontsize=8)  # fmt: skip
    axis.set_xlabel("length or radius, mm")
    axis.set_ylabel("off the compensated path, um")
    axis.legend(frameon=False, fontsize=8, loc="lower right")
    axis.set_title("kept whole: median of 20 arms", fontsize=9)


def profile(axis: Axes) -> None:
    """Draws the distance along one arc, whole and in parts."""
    job = job_of(arm(0), *targets(Move(25, np.pi, "", FORCE)), arc=True)
    needed, _ = fewest([job])
    for parts, colour in ((1, "#b5452c"), (2, "#c98a2b"), (needed, "#1f6f8b")):
        (points,) = sample_moves(job, np.zeros(1, int), np.full(1, parts), FINE)
        told = points.solved.replacement.position
        distance = []
        for part in range(parts):
            row = int(points.base[0]) + part * FINE
            ends = (told[[each]] for each in (row, row + FINE // 2, row + FINE))
            run = told[row : row + FINE + (part == parts - 1)]
            distance.append(from_circles(run, circles(*ends), np.zeros(len(run), int)))
        off = np.concatenate(distance) / UM
        angle = np.linspace(0.0, 180.0, len(off))
        label = "one arc" if parts == 1 else f"{parts} arcs"
        axis.plot(angle, off, color=colour, lw=1.5, label=f"{label}: {off.max():.1f} um")
    axis.axhline(TOLERANCE / UM, color="black", lw=0.8, ls=":")
    axis.set_xlabel("along the arc, deg")
    axis.set_yscale("symlog", linthresh=1.0)
    axis.set_yticks([0, 1, 10, 100], ["0", "1", "10", "100"])
    axis.legend(frameon=False, fontsize=8, loc="upper left", ncols=3, columnspacing=1.0)
    axis.set_ylim(0.0, 1200.0)
    axis.set_title(f"half circle of 25 mm, {FORCE:g} N along the feed, one arm", fontsize=9)


def main() -> None:
    """Draws both panels."""
    mpl.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.8), layout="constrained")
    sizes(axes[0])
    profile(axes[1])
    figure.suptitle("SIMULATED: KR160, 0.3 mm and 0.02 deg per parameter", fontsize=9)
    figure.savefig(OUT, dpi=160)


if __name__ == "__main__":
    main()
