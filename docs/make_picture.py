"""Draws docs/_static/ur10_before_after.png: errors of a measured UR10 on poses the fit never saw.

    ROBOTRUE_DATA=path/to/data python docs/make_picture.py

Data: Landgraf et al., CASE 2021, series A, laser tracker. 1,500 rows spread over the series, every
fifth held out. Left: base and tool corrected on the other four fifths, which needs no calibration.
Right: robotrue's ``ripple`` method on the same rows.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from robotrue.calibration.methods import fit
from robotrue.core.poses import pose
from robotrue.core.units import MM
from robotrue.measurement.formats.measured_files import read_measurements
from robotrue.robot.presets import preset
from robotrue.validation.validate import validate

HERE: Final = Path(__file__).resolve().parent
DATA: Final = Path(os.environ.get("ROBOTRUE_DATA", HERE.parents[1] / "shared" / "data"))
SERIES: Final = DATA / "ur10-landgraf" / "Series_A" / "measurements_grid.csv"
ROWS: Final = 1500
FIFTH: Final = 5
ENLARGED: Final = 100
COLOURS: Final = ("#b5452c", "#1f6f8b")
OUT: Final = HERE / "_static" / "ur10_before_after.png"


def main() -> None:
    """Fits, validates, draws, and says the numbers on stderr."""
    everything = read_measurements(SERIES)
    rows = np.unique(np.linspace(0, len(everything) - 1, ROWS).astype(int))
    held = np.arange(len(rows)) % FIFTH == FIFTH // 2
    training, unseen = everything.subset(rows[~held]), everything.subset(rows[held])
    robot = preset("UR10").with_tool(pose(np.eye(3), np.array([0.0, 0.0, 93.1]) * MM))
    panels = []
    for method, title in (("nominal", "base and tool corrected"), ("ripple", "robotrue")):
        report = validate(fit(robot, training, method=method), unseen)
        panels.append((title, report.position / MM, report.errors_after / MM))
        sys.stderr.write(
            f"{method}: {len(unseen)} held-out poses of {len(rows)}, mean "
            f"{report.after.mean / MM:.4f} mm, max {report.after.max / MM:.4f} mm, "
            f"{100 * report.coverage_95:.1f} % in their 95 % regions\n"
        )
    draw(panels)


def draw(panels: list[tuple[str, np.ndarray, np.ndarray]]) -> None:
    """Writes the picture: both panels in one scale, seen from the front (y, z)."""
    mpl.rcParams.update({"font.family": "DejaVu Sans", "font.size": 10})
    figure, axes = plt.subplots(1, 2, figsize=(9.6, 3.5), sharey=True, layout="constrained")
    for axis, colour, (title, position, error) in zip(axes, COLOURS, panels, strict=True):
        size = np.linalg.norm(error, axis=1)
        panel(axis, position[:, 1:], error[:, 1:], colour)
        axis.set_title(f"{title}: mean {size.mean():.3f} mm, max {size.max():.3f} mm", fontsize=10)
        axis.set_xlabel("y in mm")
    axes[0].set_ylabel("z in mm")
    figure.suptitle(
        f"Measured UR10: {len(panels[0][1])} poses the fit never saw, errors enlarged "
        f"{ENLARGED} times",
        fontsize=11,
    )
    OUT.parent.mkdir(exist_ok=True)
    figure.savefig(OUT, dpi=140, metadata={"Software": None})


def panel(axis: Axes, place: np.ndarray, error: np.ndarray, colour: str) -> None:
    """Draws one arrow per pose and a reference arrow of 1 mm."""
    arrows = axis.quiver(
        *place.T,
        *error.T,
        angles="xy",
        scale_units="xy",
        scale=1.0 / ENLARGED,
        width=0.0035,
        headwidth=4,
        color=colour,
    )
    axis.quiverkey(arrows, 0.86, 0.04, 1.0, "1 mm", labelpos="E", coordinates="axes")
    axis.scatter(*place.T, s=3, color="0.6", zorder=0)
    axis.set_xlim(place[:, 0].min() - 120, place[:, 0].max() + 120)
    axis.set_ylim(place[:, 1].min() - 150, place[:, 1].max() + 100)
    axis.set_aspect("equal")
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)


if __name__ == "__main__":
    main()
