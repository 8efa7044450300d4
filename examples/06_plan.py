"""Plan 30 poses, predict the accuracy, and compare it with simulated measurements."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from robotrue.calibration.methods import fit
from robotrue.core.units import MM
from robotrue.planning.information import Postures
from robotrue.planning.pose_plan import PlanSettings, plan_poses
from robotrue.simulation.plans import VALIDATION, random_joints
from robotrue.validation.evaluation import evaluate
from robotrue_reproductions.deng2022.scenarios import check, measure_joints, scenario


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    case = scenario("S1A", seed=1)
    known = case.cell.known
    robot = known.measured_robot
    candidates = random_joints(robot, 500, seed=2)  # poses that the tracker can measure
    work = random_joints(robot, 100, seed=3, region=VALIDATION)  # poses of the work
    plan = plan_poses(
        known,
        30,
        settings=PlanSettings(approach="as it comes", fit=case.settings),
        candidates=candidates,
        work=Postures(joints=work, load=known.payload),
    )
    ranked = measure_joints(case, plan.joints).subset(np.argsort(plan.rank))
    held_out = check(case)

    sizes, means = (15, 20, 30), []
    for n in sizes:
        rows = ranked.subset(np.arange(n))
        model = fit(robot, rows, method="gp", settings=case.settings)
        residual = evaluate(model, held_out, payload=known.payload).after
        size = np.linalg.norm(residual, axis=1) / MM
        means.append(size.mean())

    number = np.arange(10, 31)
    figure, axes = plt.subplots(figsize=(6, 3))
    axes.plot(number, plan.expected.mean[10:] / MM, label="expected, planned")
    axes.plot(number, plan.expected.random_mean[10:] / MM, "--", label="expected, random")
    axes.plot(sizes, means, "o", label="then measured (simulated)")
    axes.set(xlabel="poses", ylabel="mean error, mm", ylim=(0, None))
    axes.legend()
    figure.savefig(out / "06_plan.png", bbox_inches="tight")
    expected = plan.expected.mean[30] / MM
    error = size.std(ddof=1) / np.sqrt(len(size))
    print(f"30 poses: {expected:.3f} mm expected, {means[-1]:.3f} +- {error:.3f} mm", end=" ")
    print("then measured (simulated)")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "example-out"))
