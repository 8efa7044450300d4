"""Transfer a calibration to another region with up to 40 poses of that region. Simulated."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.sources import TransferSource
from robotrue.calibration.transfer import fit_transfer
from robotrue.core.units import MM
from robotrue.validation.evaluation import evaluate
from robotrue.validation.metrics import coverage
from robotrue_reproductions.deng2022.scenarios import check, scenario, transfer


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    case = scenario("S1A", seed=1)
    robot, held_out = case.cell.known.measured_robot, check(case)
    rows = transfer(case, 40)  # 126 poses of the source region, then 40 of the target
    region = np.arange(126)
    source = fit(robot, rows.subset(region), method="gp", settings=case.settings)

    def held_out_error(model: ErrorModel) -> tuple[float, float, float]:
        seen = evaluate(model, held_out, payload=case.cell.known.payload)
        size = np.linalg.norm(seen.after, axis=1) / MM
        inside = coverage(seen.after, seen.covariance).share
        return size.mean(), size.std(ddof=1) / np.sqrt(len(size)), inside

    counts = (0, 5, 10, 20, 40)
    found = []
    for n in counts:
        few = rows.subset(126 + np.arange(n)) if n else None
        carried = [TransferSource(model=source, relation="region", name="measured region")]
        found.append(held_out_error(fit_transfer(robot, few, carried, case.settings)))
    error, sd, inside = np.array(found).T

    figure, axes = plt.subplots(figsize=(6, 3))
    axes.errorbar(counts, error, 2.0 * sd, fmt="o-")
    axes.set(xlabel="poses of the new region", ylabel="mean error, mm (simulated)", ylim=(0, None))
    figure.savefig(out / "07_transfer.png", bbox_inches="tight")
    print(
        f"held-out poses: source alone {error[0]:.3f} mm, {100 * inside[0]:.0f} % in their region"
    )
    print(f"with 5 poses of the new region {error[1]:.3f} +- {sd[1]:.3f} mm,", end=" ")
    print(f"{100 * inside[1]:.0f} % (simulated)")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "example-out"))
