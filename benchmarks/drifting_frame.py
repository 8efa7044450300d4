"""A run during which the tracker's frame drifts, with and without monuments. All simulated.

    python benchmarks/drifting_frame.py [--draws N] [--quick]

A KR160 R1570 with geometric errors of .3 mm and .02 deg, joint springs and a joint ripple of .0025
deg that no parameter of the fit explains is measured in 80 poses, one after the other. The frame
walks, scaled so that it is 50 um away in the end, and turns by 10 urad. Three nests on the floor
are shot at every fifth pose. The model (elastic) is fitted to the first 40 poses and judged on the
last 20 (late rows) as they were measured, and on 200 poses of the true arm. Coverage: share of the
late rows in their stated 95 % region.
"""

from __future__ import annotations

import argparse

import numpy as np

from robotrue.calibration.methods import fit
from robotrue.calibration.model import Query
from robotrue.calibration.settings import FitSettings
from robotrue.core.arrays import Array
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM, UM
from robotrue.measurement.frame_walk import MonumentShots, remove_walk
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load, deflect_arm

POSES, EARLY, LATE, EVERY = 80, 40, 60, 5
DRIFT, TURN = 50.0 * UM, 10e-6
REPEATABILITY, TRACKER = 28.0 * UM, 12.0 * UM
"""m, sd per axis."""
RIPPLE, PERIODS = 0.0025 * DEG, np.array([3.0, 2.0, 4.0, 5.0, 3.0, 2.0])
NESTS = np.array([[2.2, 1.0, 0.1], [-0.4, 2.0, 0.1], [1.5, -1.8, 0.1]])
LOAD = Load(mass=np.array([80.0]), com=np.array([[0.0, 0.05, 0.12]]))
CHI2_95 = 7.814727903251179
REACH = 0.085


def true_arm(nominal: RobotModel, rng: np.random.Generator) -> RobotModel:
    """A KR160 as it was built."""
    errors = np.zeros(len(nominal.errors))
    for name, sd in (
        ("theta", 0.02 * DEG),
        ("alpha", 0.02 * DEG),
        ("d", 0.3 * MM),
        ("a", 0.3 * MM),
    ):
        place = parameter_slice(nominal.dof, name)
        errors[place] = rng.normal(0.0, sd, nominal.dof)
    springs = np.array([1.75e6, 1.72e6, 1.95e6, 3.73e5, 2.11e5, 1.74e5])
    errors[parameter_slice(nominal.dof, "compliance")] = 1.0 / springs
    return nominal.with_errors(errors)


def joints_of(robot: RobotModel, count: int, rng: np.random.Generator) -> Array:
    """Postures (n, 6) rad over half the joint ranges."""
    low, high = robot.limits.T
    middle, half = (low + high) / 2.0, (high - low) / 2.0
    return np.asarray(middle + 0.5 * half * rng.uniform(-1.0, 1.0, (count, robot.dof)))


def walk(rng: np.random.Generator, end: float) -> Array:
    """A random walk (n, 3) that ends at a distance of ``end`` from where it began."""
    path = np.cumsum(rng.normal(0.0, 1.0, (POSES, 3)), axis=0)
    path -= path[0]
    return np.asarray(path * end / np.linalg.norm(path[-1]))


def points_of(robot: RobotModel, joints: Array) -> Array:
    """Where the reflector is, (n, 3) m."""
    ripple = RIPPLE * np.sin(PERIODS * joints + np.arange(robot.dof))
    return deflect_arm(robot, joints, LOAD, ripple)[0].position


def run(nominal: RobotModel, seed: int) -> tuple[RobotModel, MeasurementSet, MonumentShots]:
    """The arm, the rows of its run, and the shots of the nests."""
    rng = np.random.default_rng(seed)
    arm = true_arm(nominal, rng)
    joints = joints_of(nominal, POSES, rng)
    shift, turn = walk(rng, DRIFT), matrix_from_rotation_vector(walk(rng, TURN))
    true = points_of(arm, joints) + rng.normal(0.0, REPEATABILITY, (POSES, 3))
    seen = (turn @ true[:, :, None])[:, :, 0] + shift
    noise = TRACKER**2 * np.eye(3)
    rows = MeasurementSet(
        joints=joints,
        position=seen + rng.normal(0.0, TRACKER, seen.shape),
        covariance=np.tile(noise, (POSES, 1, 1)),
    )
    when = np.repeat(np.arange(0, POSES, EVERY), len(NESTS))
    nest = np.tile(np.arange(len(NESTS)), len(when) // len(NESTS))
    places = (turn[when] @ NESTS[nest][:, :, None])[:, :, 0] + shift[when]
    shots = MonumentShots(
        nest=tuple(f"M{i}" for i in nest),
        position=places + rng.normal(0.0, TRACKER, places.shape),
        covariance=np.tile(noise, (len(when), 1, 1)),
        moment=when.astype(np.float64),
    )
    return arm, rows, shots


def judge(nominal: RobotModel, arm: RobotModel, rows: MeasurementSet) -> tuple[float, float, float]:
    """Mean error of the late rows and of the true arm in mm, and coverage of the late rows."""
    settings = FitSettings(payload=LOAD, repeatability=REPEATABILITY * 3.6158)
    model = fit(nominal, rows.subset(np.arange(EARLY)), settings=settings)

    def error_of(joints: Array, position: Array, noise: Array) -> tuple[Array, Array]:
        stated = model.predict(Query(joints=joints, load=LOAD))
        gap = position - forward(model.robot, joints)[:, :3, 3] - stated.error
        whitened = np.linalg.solve(stated.covariance + noise, gap[:, :, None])[:, :, 0]
        return gap, (gap * whitened).sum(axis=1) <= CHI2_95

    late = rows.subset(np.arange(LATE, POSES))
    gap, inside = error_of(late.joints, late.position, late.covariance)
    others = joints_of(nominal, 200, np.random.default_rng(1))
    true, _ = error_of(others, points_of(arm, others), np.zeros((200, 3, 3)))
    lengths = [np.linalg.norm(each, axis=1).mean() / MM for each in (gap, true)]
    return float(lengths[0]), float(lengths[1]), float(inside.mean())


def main() -> int:
    """Prints the table; 1 if the late rows with monuments miss what was to be reached."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=8)
    parser.add_argument("--quick", action="store_true", help="two draws")
    asked = parser.parse_args()
    nominal = preset("KUKA KR160 R1570")
    draws = 2 if asked.quick else asked.draws
    found = []
    print("simulated; mm: late rows, true arm, coverage of the late rows")
    print("draw  as measured              with monuments")
    for seed in range(draws):
        arm, rows, shots = run(nominal, seed)
        moved, _ = remove_walk(rows, shots, np.arange(POSES, dtype=np.float64))
        plain, corrected = judge(nominal, arm, rows), judge(nominal, arm, moved)
        found.append((*plain, *corrected))
        print(f"{seed:4d}  " + "  ".join(f"{value:7.4f}" for value in found[-1]), flush=True)
    mean = np.mean(found, axis=0)
    print("mean  " + "  ".join(f"{value:7.4f}" for value in mean))
    reached = bool(mean[3] <= REACH)
    verdict = "reached" if reached else "missed"
    case = f"late rows of a run that drifts 50 um, {draws} arms, monuments (simulated)"
    print(f"RESULT | {case} | {mean[0]:.3f} mm | {REACH} mm | {mean[3]:.3f} mm | {verdict}")
    return 0 if reached else 1


if __name__ == "__main__":
    raise SystemExit(main())
