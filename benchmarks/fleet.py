"""The next arm of a type with 10 poses, from a fleet of calibrated arms. Simulated.

    python benchmarks/fleet.py [--draws N] [--scenario NAME] [--record FILE]

A fleet of 12 virtual KR160 (scenario S1A: geometry, compliance, ripple and what no model has, each
arm its own), each calibrated with 60 poses. In draw k arm k is the next one: it has 10 poses, the
models of 9 others are its fleet. Checked on 50 poses of another day. Beside it: the 10 poses alone
(``elastic`` and ``ripple``, leaning on the prior), one other arm, and the 60 poses of its own.
The number to reach: 0.080 mm, mean of the draws.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.sources import TransferSource
from robotrue.calibration.transfer import fit_transfer
from robotrue.core.units import MM
from robotrue.validation.evaluation import evaluate
from robotrue.validation.metrics import coverage
from robotrue_reproductions.deng2022 import scenarios

ARMS = 12
FLEET = 9
CALIBRATED = 60
POSES = 10
REACH = 0.080
Examined = dict[str, tuple[float, float]]


def examine(model: ErrorModel, case: scenarios.Scenario) -> tuple[float, float]:
    """Returns mean error in mm and coverage on the check poses of another day."""
    seen = evaluate(model, scenarios.check(case), payload=case.settings.payload)
    error = float(np.linalg.norm(seen.after, axis=1).mean()) / MM
    return error, float(coverage(seen.after, seen.covariance).share)


def calibrate_arm(case: scenarios.Scenario) -> ErrorModel:
    """Returns the calibration of one arm of the fleet."""
    rows = scenarios.target(case, CALIBRATED)
    return fit(case.cell.known.measured_robot, rows, method="ripple", settings=case.settings)


def run(cases: list[scenarios.Scenario], models: list[ErrorModel], arm: int) -> Examined:
    """Returns what every way to use the 10 poses of an arm reaches."""
    case = cases[arm]
    robot, settings = case.cell.known.measured_robot, case.settings
    rows = scenarios.target(case, POSES)
    others = [
        TransferSource(model=model, relation="unit", name=f"arm {k}")
        for k, model in enumerate(models)
        if k != arm
    ][:FLEET]
    leaning = replace(settings, lean_on_prior=True)
    made = {
        f"{FLEET} other arms": fit_transfer(robot, rows, others, settings),
        "one other arm": fit_transfer(robot, rows, others[:1], settings),
        "elastic": fit(robot, rows, method="elastic", settings=leaning),
        "ripple": fit(robot, rows, method="ripple", settings=leaning),
        f"{CALIBRATED} own poses": models[arm],
    }
    return {name: examine(model, case) for name, model in made.items()}


def main(arguments: list[str]) -> int:
    """Prints each draw and the means."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=ARMS)
    parser.add_argument("--scenario", choices=scenarios.SCENARIOS, default="S1A")
    parser.add_argument("--record", type=Path, help="JSON lines, gone on with")
    options = parser.parse_args(arguments)
    record: Path | None = options.record
    lines = record.read_text("utf-8").splitlines() if record and record.is_file() else []
    known: dict[int, Examined] = {each["arm"]: each["found"] for each in map(json.loads, lines)}
    cases = [scenarios.scenario(options.scenario, seed) for seed in range(ARMS)]
    models = [calibrate_arm(case) for case in cases]
    for arm in range(min(options.draws, ARMS)):
        if arm not in known:
            known[arm] = run(cases, models, arm)
            if record:
                with record.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({"arm": arm, "found": known[arm]}) + "\n")
        print(f"arm {arm:2d}  " + "  ".join(f"{n} {v[0]:.4f}" for n, v in known[arm].items()))
    print(f"{options.scenario} (simulated), {POSES} poses, mean of {len(known)} arms")
    for name in next(iter(known.values())):
        mean, inside = np.mean([found[name] for found in known.values()], axis=0)
        print(f"  {name:16s} {mean:.4f} mm, {100 * inside:.1f} % in their 95 % region")
    mean, inside = np.mean([found[f"{FLEET} other arms"] for found in known.values()], axis=0)
    print(
        f"RESULT | the next arm with {POSES} poses and {FLEET} other arms, {options.scenario} "
        f"(simulated), mean of {len(known)} | - | <= {REACH:.3f} | {mean:.4f}, "
        f"{100 * inside:.1f} % | {'reached' if mean <= REACH else 'missed'}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
