"""Validate on held-out poses of a real UR5, or of the virtual cell without these data."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from robotrue.calibration.methods import fit
from robotrue.calibration.settings import FitSettings
from robotrue.core.poses import pose
from robotrue.core.units import MM
from robotrue.measurement.formats.measured_files import read_measurements
from robotrue.robot.presets import preset
from robotrue.simulation.plans import VALIDATION, random_joints
from robotrue.simulation.presets import deng2022
from robotrue.simulation.virtual_tracker import measure
from robotrue.validation.validate import validate

DATA = Path(os.environ.get("ROBOTRUE_DATA", "../shared/data")) / "ur5-jacobi"


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    if DATA.is_dir():
        what = "real UR5"
        robot = preset("UR5").with_tool(pose(np.eye(3), np.array([0.0, 0.0, 31 * MM])))
        train = read_measurements(DATA / "3D_UR5_uncalibrated_grid_cleaned.csv")
        test = read_measurements(DATA / "3D_UR5_uncalibrated_random_cleaned.csv")
        settings = FitSettings()
    else:
        what = "simulated KR160"
        cell = deng2022(seed=1)
        robot, target = cell.known.measured_robot, cell.known.T_flange_target
        train, test = (
            measure(cell.robot, cell.tracker, q, seed=1, campaign=k, T_flange_tool=target)
            for k, q in enumerate(
                (
                    random_joints(robot, 80, seed=1),
                    random_joints(robot, 50, seed=2, region=VALIDATION),
                )
            )
        )
        settings = FitSettings(payload=cell.known.payload)
    report = validate(
        fit(robot, train, method="elastic", settings=settings), test, payload=settings.payload
    )
    sizes = [np.linalg.norm(e, axis=1) / MM for e in (report.errors_before, report.errors_after)]

    figure, axes = plt.subplots(figsize=(6, 3))
    for size, label in zip(sizes, ("before", "after"), strict=True):
        axes.plot(np.sort(size), np.linspace(0, 1, len(size)), label=label)
    axes.set(xlabel=f"held-out error, mm ({what})", ylabel="share of poses")
    axes.legend()
    figure.savefig(out / "03_validate.png", bbox_inches="tight")
    error = report.after.std / np.sqrt(report.after.n) / MM
    print(f"held-out mean error {report.after.mean / MM:.3f} +- {error:.3f} mm ({what})")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "example-out"))
