"""Measure the position error of a virtual KR160 with a spindle. All data are simulated."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from robotrue.core.units import MM
from robotrue.measurement.formats.canonical import write_canonical
from robotrue.robot.forward import forward
from robotrue.simulation.plans import random_joints
from robotrue.simulation.presets import deng2022
from robotrue.simulation.virtual_tracker import measure


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    cell = deng2022(seed=1)
    robot = cell.known.measured_robot  # nominal robot of the controller, with the reflector as tool
    joints = random_joints(robot, 60, seed=1)
    taken = measure(
        cell.robot, cell.tracker, joints, seed=1, T_flange_tool=cell.known.T_flange_target
    )
    write_canonical(out / "measurements.csv", taken)
    size = np.linalg.norm(taken.position - forward(robot, joints)[:, :3, 3], axis=1) / MM

    figure, axes = plt.subplots(figsize=(6, 3))
    axes.hist(size, bins=15)
    axes.set(xlabel="position error, mm (simulated)", ylabel="poses")
    figure.savefig(out / "01_virtual_cell.png", bbox_inches="tight")
    error = size.std(ddof=1) / np.sqrt(len(size))
    print(f"mean error before calibration {size.mean():.3f} +- {error:.3f} mm (simulated)")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "example-out"))
