"""Fit the residual of the predicted milling error on one pass, test on another. Simulated."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from robotrue.core.archive import read_archive, write_archive
from robotrue.core.units import UM
from robotrue.dynamics.deviation import deviation_from_archive, fit_deviation
from robotrue.dynamics.deviation_physics import CompliantArm
from robotrue.dynamics.formats.dynamics_csv import read_windows, write_windows
from robotrue.dynamics.learned_deviation import WindowTrust
from robotrue.simulation.milling_arm import milling_robot
from robotrue_reproductions.jin2022.milling_experiment import milling_experiment


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    experiment = milling_experiment(7, (0, 4))
    write_windows(out / "windows.csv", experiment.windows)
    windows = read_windows(out / "windows.csv")
    first, second = (windows.take(windows.pass_index == k) for k in (0, 1))
    arm = CompliantArm(
        robot=milling_robot(),
        stiffness=experiment.arm.stiffness_belief,
        direction=np.array([0.0, -1.0, 0.0]),
    )
    write_archive(out / "deviation.robotrue", fit_deviation(first, arm).to_archive())
    model = deviation_from_archive(read_archive(out / "deviation.robotrue"))
    for i, (factor, sd) in enumerate(zip(model.factors[:6], model.factors_sd[:6], strict=True)):
        print(f"joint {i + 1}: compliance {factor:.2f} +- {sd:.2f} of the stated value")
    found = model.predict(second)
    print(f"windows outside the training data: {int((found.standing != WindowTrust.INSIDE).sum())}")
    before, after = second.deviation / UM, (found.error - second.measured) / UM
    figure, axes = plt.subplots(figsize=(6, 3))
    place = np.arange(len(second))
    low, high = ((found.error + s * 1.96 * found.sd) / UM for s in (-1.0, 1.0))
    axes.fill_between(place, low, high, alpha=0.2, label="95 %")
    axes.plot(place, found.error / UM, label="with learned deviation")
    axes.plot(place, second.predicted / UM, label="frequency response and force")
    axes.plot(place, second.measured / UM, "k.", markersize=3, label="measured")
    axes.set(xlabel="window", ylabel="error, um (simulated)")
    axes.legend(fontsize=7)
    figure.savefig(out / "11_milling_error.png", bbox_inches="tight")
    print(f"before: {np.sqrt((before**2).mean()):.1f} um rms")
    spread = np.abs(after).std(ddof=1) / np.sqrt(len(after))
    print(f"error on the unseen pass: {np.abs(after).mean():.2f} +- {spread:.2f} um (simulated)")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "example-out"))
