r"""Draws docs/_static/few_poses.png: error against the number of measured poses, simulated arms.

    cd docs && python ../benchmarks/few_poses.py --methods least-squares elastic gp \
        --json _static/few_poses.json
    python docs/make_few_poses_picture.py

Left: scenario S1A, right: S2A, whose noise is near the paper's; medians and quartiles over the
arms. Least squares of rigid Denavit-Hartenberg parameters is what pybotics, robotkinecal and
figaroh's documented default fit (benchmarks/heavy_arm.py runs those packages themselves). The
crosses are one real arm, printed in Table 8 of Deng et al. 2022.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

HERE: Final = Path(__file__).resolve().parent
DATA: Final = HERE / "_static" / "few_poses.json"
OUT: Final = HERE / "_static" / "few_poses.png"
LINES: Final = (
    ("least-squares", "DH least squares, as other packages fit", "#8a8f98"),
    ("elastic", "geometry and compliance", "#1f6f8b"),
    ("gp", "robotrue, method gp", "#b5452c"),
)
PAPER: Final = (
    (50, 0.658, "GPR, 50 poses"),
    (206, 0.182, "Tr-GPR, 206"),
    (378, 0.151, "GPR, 378"),
)
"""Poses, mean mm and name, Table 8 of the paper: measured on one arm."""
PAPER_SIMULATED: Final = {"S2A": (206, 0.138)}
"""Poses and median mm of Tr-GPR, `robotrue reproduce deng2022`, 20 arms."""


def main() -> None:
    """Reads the medians and draws both panels."""
    record = json.loads(DATA.read_text(encoding="utf-8"))
    mpl.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.8), sharey=True, layout="constrained")
    for axis, name in zip(axes, ("S1A", "S2A"), strict=True):
        draw(axis, name, record[name])
    axes[0].set_ylabel("mean error of 50 check poses, mm")
    axes[0].legend(*axes[1].get_legend_handles_labels(), frameon=False, loc="upper right")
    figure.savefig(OUT, dpi=160)


def draw(axis: Axes, name: str, found: dict[str, Any]) -> None:
    """Draws one scenario."""
    for method, label, colour in LINES:
        poses = [int(n) for n in found[method]]
        low, middle, high = np.array(list(found[method].values())).T
        axis.plot(poses, middle, "o-", color=colour, label=label, ms=4, lw=1.5)
        axis.fill_between(poses, low, high, color=colour, alpha=0.15, lw=0)
    axis.axhline(found["floor_mm"], color="black", lw=0.8, ls=":")
    axis.annotate(
        "floor: repeatability and tracker",
        (10, found["floor_mm"]),
        xytext=(0, -10),
        textcoords="offset points",
        fontsize=8,
    )
    if name in PAPER_SIMULATED:
        poses, error = PAPER_SIMULATED[name]
        axis.plot(poses, error, "D", color="#5b4a8a", ms=6, label="the paper's Tr-GPR, simulated")
        axis.plot([], [], "x", color="black", label="the paper, one real arm, measured")
        for poses, error, label in PAPER:
            axis.plot(poses, error, "x", color="black", ms=6)
            axis.annotate(
                label,
                (poses, error),
                xytext=(0, 6),
                textcoords="offset points",
                ha="center",
                fontsize=7.5,
            )
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_xticks([10, 20, 30, 50, 100, 206, 378], ["10", "20", "30", "50", "100", "206", "378"])
    axis.set_xticks([], minor=True)
    axis.set_yticks([0.03, 0.05, 0.1, 0.2, 0.5], ["0.03", "0.05", "0.1", "0.2", "0.5"])
    axis.set_yticks([], minor=True)
    axis.set_ylim(0.028, 0.9)
    axis.set_xlabel("measured poses")
    axis.set_title(f"{name}: {found['arms']} simulated arms", fontsize=9, loc="left")


if __name__ == "__main__":
    main()
