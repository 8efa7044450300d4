"""Calibrate geometry and joint compliance from 80 poses of the virtual cell."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from robotrue.calibration.methods import fit
from robotrue.calibration.settings import FitSettings
from robotrue.core.units import MM
from robotrue.robot.forward import forward
from robotrue.simulation.plans import random_joints
from robotrue.simulation.presets import deng2022
from robotrue.simulation.virtual_tracker import measure
from robotrue.store.model_file import write_model
from robotrue.validation.evaluation import evaluate


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    cell = deng2022(seed=1)
    known, robot = cell.known, cell.known.measured_robot
    joints = random_joints(robot, 80, seed=1)
    taken = measure(cell.robot, cell.tracker, joints, seed=1, T_flange_tool=known.T_flange_target)
    model = fit(robot, taken, method="elastic", settings=FitSettings(payload=known.payload))
    write_model(out / "model.robotrue", model, known)
    before = np.linalg.norm(taken.position - forward(robot, joints)[:, :3, 3], axis=1) / MM
    residual = evaluate(model, taken, payload=known.payload).after
    after = np.linalg.norm(residual, axis=1) / MM

    figure, axes = plt.subplots(figsize=(6, 3))
    axes.semilogy(before, "o", label="before")
    axes.semilogy(after, "o", label="after, on the training poses")
    axes.set(xlabel="pose", ylabel="error, mm (simulated)")
    axes.legend()
    figure.savefig(out / "02_calibrate.png", bbox_inches="tight")
    error = after.std(ddof=1) / np.sqrt(len(after))
    print(f"residual on the training poses {after.mean():.3f} +- {error:.3f} mm (simulated)")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "example-out"))
