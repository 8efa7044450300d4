"""How often the drift check calls an unchanged robot changed, and what it sees. All SIMULATED.

    python benchmarks/drift_check.py [--arms 20] [--sets 20] [--poses 7]

Part 1: arms drawn from a model's own posterior; the check's formulas alone are on trial.
Part 2: arms of the benchmark's scenarios, each calibrated from 60 poses (method elastic and gp) and
checked with poses of the same campaign and of other days. S0 is what the model describes; S1 has
ripple, backlash, tilt, thermal drift and more that it does not.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.tracker import point_covariance
from robotrue.robot.model import parameter_slice
from robotrue.robot.statics import deflect_arm
from robotrue.validation.drift_check import DriftCheck, drift_check
from robotrue_reproductions.deng2022.scenarios import (
    Scenario,
    measure_joints,
    scenario,
    sobol_joints,
    whole,
)

CALIBRATION_POSES = 60
LEVELS = (0.05, 0.01)
TOOL = 1e-4
JOINT = 1e-4


def postures(case: Scenario, n: int, rng: np.random.Generator) -> np.ndarray:
    pool = sobol_joints(case, 512)
    return pool[rng.choice(len(pool), n, replace=False)]


def from_posterior(
    case: Scenario, model: CalibratedModel, n: int, rng: np.random.Generator, shift: np.ndarray
) -> MeasurementSet:
    """One check of an arm the model believes possible, changed by a shift of its parameters."""
    values, vectors = np.linalg.eigh(model.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    arm = model.robot.with_errors(model.errors + root @ rng.standard_normal(len(values)) + shift)
    joints = postures(case, n, rng)
    true = deflect_arm(arm, joints, case.cell.known.payload)[0].position
    tracker = case.cell.tracker
    covariance = point_covariance(tracker.specification, true, tracker.position)
    scatter = np.hypot(model.repeatability, model.white) * rng.standard_normal(true.shape)
    noise = np.einsum("nij,nj->ni", np.linalg.cholesky(covariance), rng.standard_normal(true.shape))
    return MeasurementSet(joints=joints, position=true + scatter + noise, covariance=covariance)


def changed(found: DriftCheck, level: float) -> bool:
    """Whether the same check at another level would have called the robot changed."""
    return found.p < level / 2.0 or any(c.p < level / 2.0 for c in found.causes)


def part_one(sets: int, poses: int) -> None:
    case = scenario("S0A", 1)
    model = fit(
        case.cell.known.measured_robot, whole(case, CALIBRATION_POSES), settings=case.settings
    )
    if not isinstance(model, CalibratedModel):
        raise SystemExit("the elastic method gives a rigid-flexible model")
    changes = {"nothing": ("", 0, 0.0), "tool 0.1 mm": ("tool", 0, TOOL)}
    changes |= {f"joint {j + 1}, 1e-4 rad": ("theta", j, JOINT) for j in range(6)}
    print(f"1. SIMULATED, arms from the posterior of one model, {sets} sets of {poses} poses each")
    print("   change                 called changed at 5 %   at 1 %   named rightly (of 1 %)")
    for name, (group, index, by) in changes.items():
        shift = np.zeros(len(model.errors))
        if group:
            shift[parameter_slice(6, group).start + index] = by
        rng = np.random.default_rng(17)
        found = [
            drift_check(
                model,
                from_posterior(case, model, poses, rng, shift),
                payload=case.cell.known.payload,
                level=0.01,
            )
            for _ in range(sets)
        ]
        shares = [100.0 * float(np.mean([changed(f, level) for f in found])) for level in LEVELS]
        named = Counter(f.best.name for f in found if f.best is not None)
        right = named[name.split(",")[0].replace(" 0.1 mm", "")]
        print(
            f"   {name:22s} {shares[0]:18.1f} % {shares[1]:8.1f} % {100.0 * right / sets:14.1f} %"
        )


def checks(
    case: Scenario, model: ErrorModel, sets: int, poses: int, *, other_days: bool
) -> Iterator[DriftCheck]:
    rng = np.random.default_rng([case.seed, 23])
    for k in range(sets):
        campaign = 100 + k if other_days else 0
        joints = postures(case, poses, rng)
        # Another seed gives other noise on the same arm; the campaign decides the day.
        rows = measure_joints(replace(case, seed=1000 * case.seed + k), joints, campaign=campaign)
        yield drift_check(model, rows, payload=case.cell.known.payload, level=0.05)


def part_two(arms: int, sets: int, poses: int) -> None:
    print(f"\n2. SIMULATED, {arms} calibrated arms x {sets} checks of {poses} poses, level 5 %")
    print("   arm   method    same campaign   other days   verdicts on other days")
    for name in ("S0A", "S1A"):
        for method in ("elastic", "gp"):
            share: dict[bool, list[bool]] = {False: [], True: []}
            verdicts: Counter[str] = Counter()
            for seed in range(1, arms + 1):
                case = scenario(name, seed)
                model = fit(
                    case.cell.known.measured_robot,
                    whole(case, CALIBRATION_POSES),
                    method=method,
                    settings=case.settings,
                )
                for days in (False, True):
                    for found in checks(case, model, sets, poses, other_days=days):
                        share[days].append(found.changed)
                        verdicts.update([found.verdict] if days else [])
            rates = [100.0 * float(np.mean(share[days])) for days in (False, True)]
            said = ", ".join(f"{v} {n}" for v, n in verdicts.most_common())
            print(
                f"   {name}   {method:8s} {rates[0]:12.1f} % {rates[1]:10.1f} %   {said}",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", type=int, default=20)
    parser.add_argument("--sets", type=int, default=20)
    parser.add_argument("--poses", type=int, default=7)
    asked = parser.parse_args()
    part_one(400, asked.poses)
    part_two(asked.arms, asked.sets, asked.poses)


if __name__ == "__main__":
    main()
