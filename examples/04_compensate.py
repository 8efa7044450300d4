"""Compensate a KRL program and re-measure it on the virtual cell. All data are simulated."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from robotrue.calibration.methods import fit
from robotrue.calibration.settings import FitSettings
from robotrue.compensation.compensate import compensate
from robotrue.compensation.settings import CompensationSettings
from robotrue.core.files import write_atomic
from robotrue.core.units import MM
from robotrue.program.formats import read_program, write_program
from robotrue.simulation.flange_hole import FlangeHole, check_rows, hole_program
from robotrue.simulation.milling import dry_run
from robotrue.simulation.plans import random_joints
from robotrue.simulation.presets import deng2022
from robotrue.simulation.virtual_tracker import measure


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    cell, hole = deng2022(seed=1), FlangeHole(depth=3 * MM)
    known, robot = cell.known, cell.known.measured_robot
    joints = random_joints(robot, 80, seed=1)
    taken = measure(cell.robot, cell.tracker, joints, seed=1, T_flange_tool=known.T_flange_target)
    model = fit(robot, taken, method="elastic", settings=FitSettings(payload=known.payload))

    source, target = out / "hole.src", out / "hole_compensated.src"
    write_atomic(source, hole_program(hole, known.robot))
    program = read_program(source)
    result = compensate(model, program, settings=CompensationSettings(load=known.payload))
    write_atomic(target, write_program(program, result.replacement))
    driven = read_program(target)

    rows = check_rows(program, hole, 2)
    before = dry_run(cell, program, program, rows, campaign=1)
    after = dry_run(cell, program, driven, rows, campaign=2)
    sizes = [np.linalg.norm(e, axis=1) / MM for e in (before, after)]
    figure, axes = plt.subplots(figsize=(6, 3))
    for size, label in zip(sizes, ("before", "after"), strict=True):
        axes.plot(size, "o-", label=label)
    axes.set(xlabel="check target", ylabel="error, mm (simulated)")
    axes.legend()
    figure.savefig(out / "04_compensate.png", bbox_inches="tight")
    error = sizes[1].std(ddof=1) / np.sqrt(len(rows))
    print(f"re-measured mean error {sizes[1].mean():.3f} +- {error:.3f} mm (simulated)")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "example-out"))
