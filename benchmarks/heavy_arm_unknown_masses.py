"""Arms of which nobody states a link mass: what is learned of their weight. Simulated.

    python benchmarks/heavy_arm_unknown_masses.py [--draws N] [--method NAME] [--cell-arms N]

Heavy arm: the kinematics of the peer comparison, computed by its own code. Every draw is another
arm: geometry 0.3 mm and 0.02 deg, springs +-30 %, link masses at a factor of 0.5 to 2, centres of
mass off by 50 mm, and 60 poses with tracker noise and repeatability. Judged on 200 other poses
without force, and under 300 N sideways and 150 N down; coverage of the stated 95 % regions counts
one visit more. KR160 size: the arms of ``few_poses.py`` with all effects, 30 poses, judged on the
50 check poses of another day, also with the stiffness of the cell left out.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace

import few_poses
import heavy_arm as bench
import heavy_arm_case as case
import numpy as np

from robotrue.calibration.methods import METHODS, FitSettings, fit
from robotrue.calibration.model import ErrorModel, Query
from robotrue.core.units import DEG, MM
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel
from robotrue.validation.selection import fit_auto
from robotrue_reproductions.deng2022.scenarios import scenario, whole

POSES, TEST, PULLED = 60, 200, 20
PULL = np.array([0.0, 800.0, 0.0])
REACH = {0: 0.024, PULLED: 0.032}
"""mm: unloaded; 20 poses under a side load, judged under force."""
CELL_REACH = 0.058


def true_arm(seed: int) -> tuple[case.Arm, case.Array]:
    """An arm and its compliances (6,) rad/(N m)."""
    rng, known = np.random.default_rng([seed, 1]), case.nominal_arm()
    compliance = 1.0 / (case.STIFFNESS * rng.uniform(0.7, 1.3, 6))
    arm = replace(
        case.true_arm(),
        a=known.a + rng.normal(0.0, 0.3 * MM, 6),
        d=known.d + rng.normal(0.0, 0.3 * MM, 6),
        alpha=known.alpha + rng.normal(0.0, 0.02 * DEG, 6),
        theta=known.theta + rng.normal(0.0, 0.02 * DEG, 6),
        mass=case.MASS * 2.0 ** rng.uniform(-1.0, 1.0, 6),
        com=case.COM + rng.normal(0.0, 0.05, (6, 3)),
    )
    return arm, compliance


def measured(
    arm: case.Arm, compliance: case.Array, joints: case.Array, pulled: int, seed: int
) -> MeasurementSet:
    """The calibration poses, the first ones under the side load."""
    position = case.points(arm, joints, compliance)
    position[:pulled] = case.points(arm, joints[:pulled], compliance, PULL)
    wrench = np.zeros((len(joints), 6))
    wrench[:pulled, :3] = PULL
    return MeasurementSet(
        joints=joints,
        position=case.measured(position, np.random.default_rng([seed, 2])),
        covariance=case.tracker_sd(position)[:, None, None] ** 2 * np.eye(3),
        wrench=wrench,
    )


def bare(robot: RobotModel) -> RobotModel:
    """The arm as its maker describes it: no masses."""
    return replace(robot, link_mass=np.empty(0), link_com=np.empty(0))


def fit_by(
    method: str, robot: RobotModel, rows: MeasurementSet, settings: FitSettings
) -> ErrorModel:
    """A fit by a method, or by the contest of all."""
    if method == "auto":
        return fit_auto(robot, rows, settings)
    return fit(robot, rows, method=method, settings=settings)


def judge_heavy(seed: int, method: str, pulled: int) -> list[float]:
    """Mean error in mm and coverage without and with force."""
    joints = case.poses(POSES + TEST, seed=100 + seed)
    train, test = joints[:POSES], joints[POSES:]
    arm, compliance = true_arm(seed)
    rows = measured(arm, compliance, train, pulled, seed)
    model = fit_by(method, bare(bench.robot()), rows, bench.SETTINGS)
    believed, rng = case.points(case.nominal_arm(), test), np.random.default_rng([seed, 3])
    out: list[float] = []
    for force in (None, case.FORCE):
        told = model.predict(Query(joints=test, load=bench.load(force)))
        off = case.points(arm, test, compliance, force) - believed - told.error
        seen = off + case.REPEATABILITY_SD * rng.standard_normal(off.shape)
        solved = np.linalg.solve(told.covariance, seen[:, :, None])[:, :, 0]
        inside = (seen * solved).sum(axis=1) <= few_poses.CHI2_95
        out += [float(np.linalg.norm(off, axis=1).mean()) / MM, float(inside.mean())]
    return out


def judge_cell(seed: int, method: str) -> list[float]:
    """Mean residual in mm and coverage on the check poses: masses and stiffness known, neither."""
    arm, out = scenario("S1A", seed), []
    robot, rows = arm.cell.known.measured_robot, whole(arm, 30)
    for known in (True, False):
        settings = arm.settings if known else replace(arm.settings, stiffness=None)
        model = fit_by(method, robot if known else bare(robot), rows, settings)
        out += few_poses.examine(model, arm)
    return out


def main(arguments: list[str]) -> int:
    """Prints a row for each draw as it comes, then the rows of the table of all benchmarks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=20, help="heavy arms")
    parser.add_argument("--cell-arms", type=int, default=24, help="arms of KR160 size")
    parser.add_argument("--method", choices=[*METHODS, "auto"], default="elastic")
    chosen = parser.parse_args(arguments)
    print("simulated; mean mm and share inside the 95 % region")
    for pulled, reach in REACH.items() if chosen.draws else ():
        found = []
        for seed in range(chosen.draws):
            found.append(judge_heavy(seed, chosen.method, pulled))
            print(f"  heavy {seed:2d}, {pulled} pulled: ", *np.round(found[-1], 4), flush=True)
        force = 2 if pulled else 0
        mean, inside = np.mean([each[force : force + 2] for each in found], axis=0)
        largest = max(each[force] for each in found)
        words = "20 of 60 pulled, under force" if pulled else "unloaded"
        verdict = "reached" if mean <= reach and 0.93 <= inside <= 0.98 else "missed"
        print(
            f"RESULT | no masses (simulated, {len(found)} heavy arms, {chosen.method}), {words}"
            f" | - | <= {reach} mm, 0.93 to 0.98 | {mean:.4f} mm (largest {largest:.4f}), "
            f"{inside:.3f} | {verdict}"
        )
    if chosen.cell_arms:
        rows = []
        for seed in range(chosen.cell_arms):
            rows.append(judge_cell(seed, chosen.method))
            print(f"  KR160 size {seed:2d}: ", *np.round(rows[-1], 4), flush=True)
        known, known_in, none, none_in = np.mean(rows, axis=0)
        print(
            f"RESULT | KR160 size, 30 poses, all effects, no masses (simulated, {len(rows)} arms, "
            f"{chosen.method}) | masses and stiffness known: {known:.4f}, {known_in:.3f} "
            f"| <= {CELL_REACH} | {none:.4f} mm, {none_in:.3f} "
            f"| {'reached' if none <= CELL_REACH else 'missed'}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
