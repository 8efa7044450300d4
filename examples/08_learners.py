"""Use the learners directly: 126 poses of a source region, 16 of the target. Simulated."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from robotrue.calibration.learners import GaussianProcess, TrAdaBoostR2, TransferGaussianProcess
from robotrue.robot.forward import forward
from robotrue.simulation.plans import random_joints
from robotrue.simulation.presets import deng2022
from robotrue.simulation.virtual_tracker import measure

MM = 1e3


def errors(seed: int, n: int, sector: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Returns joints (n, 6) rad with joint 1 in a sector, and measured errors (n, 3) mm."""
    cell = deng2022(seed=1)
    robot, reflector = cell.known.measured_robot, cell.known.T_flange_target
    joints = random_joints(robot, n, seed=seed).copy()
    joints[:, 0] = np.random.default_rng(seed).uniform(*np.deg2rad(sector), n)
    taken = measure(cell.robot, cell.tracker, joints, seed=seed, T_flange_tool=reflector)
    return joints, MM * (taken.position - forward(robot, joints)[:, :3, 3])


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    source, source_errors = errors(1, 126, (-40.0, -20.0))
    joints, measured = errors(2, 16, (10.0, 30.0))
    there, truth = errors(3, 100, (10.0, 30.0))
    given = {"X_source": source, "y_source": source_errors}
    learners = {
        "mean of 16": None,
        "GP, 16 poses": GaussianProcess().fit(joints, measured),
        "TrAdaBoost.R2": TrAdaBoostR2().fit(joints, measured, **given),
        "transfer GP": TransferGaussianProcess().fit(joints, measured, **given),
    }
    missed = {}
    for name, learner in learners.items():
        mean = measured.mean(axis=0) if learner is None else learner.predict(there)
        missed[name] = np.linalg.norm(truth - mean, axis=1)
        print(f"{name:14s} mean {missed[name].mean():.3f} mm on 100 held-out poses (simulated)")

    figure, axes = plt.subplots(figsize=(6, 3.5))
    axes.boxplot(list(missed.values()), tick_labels=list(missed))
    axes.set(ylabel="residual error, mm (simulated)", yscale="log")
    figure.savefig(out / "08_learners.png", bbox_inches="tight")
    best = learners["transfer GP"]
    mean, deviation = best.predict(there, return_std=True)
    inside = np.mean(np.abs(truth - mean) < 1.96 * deviation)
    print(f"rho {best.rho_:.2f}, {100 * inside:.0f} % of components inside their 95 % intervals")
    print(f"first held-out pose, x: {mean[0, 0]:.3f} +- {1.96 * deviation[0, 0]:.3f} mm, ", end="")
    print(f"measured {truth[0, 0]:.3f}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "example-out"))
