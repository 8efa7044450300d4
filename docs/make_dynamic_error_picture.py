"""Draws docs/_static/dynamic_error.png: error along two passes, measured and predicted.

    python docs/make_dynamic_error_picture.py

Virtual milling, seed 6. Left: the printed pass, each sixth of it predicted from the other five.
Right: a pass 250 mm aside, predicted from the printed one alone.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.axes import Axes

from robotrue.core.arrays import Array
from robotrue.core.units import MM, UM
from robotrue.dynamics.deviation import fit_deviation
from robotrue.dynamics.paper_regression import fit_paper
from robotrue.dynamics.window_folds import folds
from robotrue.dynamics.windows import WindowSet
from robotrue.report.figure import AFTER, BAND, BEFORE, CAUTION, INK, Drawing, png
from robotrue_reproductions.jin2022.jin_tables import arm_of, row_of_hammer
from robotrue_reproductions.jin2022.milling_experiment import MillingExperiment, milling_experiment

OUT: Final = Path(__file__).resolve().parent / "_static" / "dynamic_error.png"
SEED: Final = 6
PASSES: Final = (0, 2)


def main() -> None:
    """Mills, learns, draws, and says the errors on stderr."""
    experiment = milling_experiment(SEED, PASSES)
    windows = experiment.windows
    one = windows.take(windows.pass_index == 0)
    sides = [
        (one, folds(one, "blocks"), "one pass, sixths of it held out"),
        (windows, folds(windows, "unseen"), "a pass 250 mm aside, never seen"),
    ]

    def draw(axes: list[Axes]) -> None:
        for ax, (data, parts, title) in zip(axes, sides, strict=True):
            panel(ax, experiment, data, parts, title)
        axes[0].set_ylabel("error across the feed, um")
        axes[1].legend(loc="upper left", fontsize=9)

    title = "SIMULATED: milling with an IRB 6660, windows of about a second"
    OUT.write_bytes(png(Drawing(draw=draw, panels=2, width=11.0, height=3.8), title=title))


def panel(
    ax: Axes,
    experiment: MillingExperiment,
    data: WindowSet,
    parts: list[tuple[Array, Array]],
    title: str,
) -> None:
    """Draws measured, paper's and our error of the windows held out, along the pass."""
    arm, row = arm_of(experiment.arm), row_of_hammer(experiment)
    held = np.concatenate([test for _, test in parts])
    ours, sd, paper = (np.full(len(data), np.nan) for _ in range(3))
    for train, test in parts:
        known, asked = data.take(train), data.take(test)
        found = fit_deviation(known, arm, row=row).predict(asked)
        ours[test], sd[test] = found.error, found.sd
        paper[test] = fit_paper(known, arm).predict(asked).error
    along = experiment.along[: len(data)][held] / MM
    shown = {"measured": data.measured, "predicted": data.predicted, "paper": paper, "ours": ours}
    values = {name: value[held] / UM for name, value in shown.items()}
    low, high = (values["ours"] + s * 1.96 * sd[held] / UM for s in (-1.0, 1.0))
    ax.fill_between(along, low, high, color=BAND, label="ours, 95 %", linewidth=0)
    ax.plot(along, values["predicted"], color=BEFORE, label="frequency response and force")
    ax.plot(along, values["paper"], color=CAUTION, linestyle="--", label="paper: PCA and SVR")
    ax.plot(along, values["ours"], color=AFTER, label="ours")
    ax.plot(along, values["measured"], ".", color=INK, markersize=4, label="measured")
    ax.set_title(title, loc="left")
    ax.set_xlabel("along the pass, mm")
    for name in ("predicted", "paper", "ours"):
        miss = values[name] - values["measured"]
        sys.stderr.write(f"{title}: {name} {np.sqrt((miss**2).mean()):.2f} um rms\n")


if __name__ == "__main__":
    main()
