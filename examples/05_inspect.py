"""Show each parameter of a calibration from 80 poses with its uncertainty. Simulated."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from robotrue.calibration.methods import fit
from robotrue.calibration.settings import FitSettings
from robotrue.simulation.plans import random_joints
from robotrue.simulation.presets import deng2022
from robotrue.simulation.virtual_tracker import measure


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    cell = deng2022(seed=1)
    known, robot = cell.known, cell.known.measured_robot
    joints = random_joints(robot, 80, seed=1)
    taken = measure(cell.robot, cell.tracker, joints, seed=1, T_flange_tool=known.T_flange_target)
    model = fit(robot, taken, method="elastic", settings=FitSettings(payload=known.payload))
    summary = model.training_summary()
    for direction in summary["unseen"]:
        print(f"not seen: {direction['name']}. {direction['cure']}")

    known_parameters = {k: v for k, v in summary["parameters"].items() if v["sd"] > 0.0}
    names = list(known_parameters)
    ratio = [abs(v["value"]) / v["sd"] for v in known_parameters.values()]
    figure, axes = plt.subplots(figsize=(9, 3))
    axes.bar(names, ratio)
    axes.axhline(2.0, color="black", linewidth=0.8)
    axes.tick_params(axis="x", labelrotation=90, labelsize=6)
    axes.set(ylabel="value over its sd")
    figure.savefig(out / "05_inspect.png", bbox_inches="tight")
    soft = summary["parameters"]["compliance2"]
    stiffness = 1.0 / soft["value"]
    spread = soft["sd"] * stiffness**2
    true = 1.0 / cell.robot.actual.error("compliance")[1]
    print(f"stiffness of joint 2: {stiffness / 1e6:.2f} +- {spread / 1e6:.2f} MN m/rad", end=" ")
    print(f"(simulated; true {true / 1e6:.2f}, {np.abs(stiffness - true) / spread:.1f} sd away)")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "example-out"))
