"""Held-out accuracy on the measured UR5 and UR10: prints a table, seeds, splits and times.

    python benchmarks/real_arms.py [--quick] [--rows NAME ...] [--methods NAME ...]

Every number is the distance between measured and predicted position on rows the fit never saw; no
robot moved again. Only positions are used, also where orientations were measured, so that every
method sees the same numbers. Scales, harmonics, centres and the covariance factor are chosen inside
the training rows alone. Data: the folder ROBOTRUE_DATA (default ../shared/data).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel, Query
from robotrue.core.units import MM
from robotrue.measurement.formats.measured_files import read_measurements
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset

ROOT = Path(os.environ.get("ROBOTRUE_DATA", Path(__file__).parents[2] / "shared" / "data"))
FILES = {
    "ur5": "ur5-jacobi/3D_UR5_uncalibrated_grid_cleaned.csv",
    "ur5-random": "ur5-jacobi/3D_UR5_uncalibrated_random_cleaned.csv",
    "A": "ur10-landgraf/Series_A/measurements_grid.csv",
    "B": "ur10-landgraf/Series_B/measurements_joint_configurations.csv",
}
CHI2_95 = 7.814727903251179
QUICK_ROWS = 2500
FOLDS = 5
METHODS = ("nominal", "elastic", "ripple", "gp")
Split = tuple[MeasurementSet, MeasurementSet]


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One row of the table.

    Attributes:
        title: What is trained and tested.
        robot: Preset.
        splits: Yields training and test sets.
        reference: What was known before.
        reach: The number to reach.
    """

    title: str
    robot: str
    splits: Callable[[bool], Iterator[Split]]
    reference: str
    reach: str


def points(name: str) -> MeasurementSet:
    """Returns a series, its orientations left out."""
    rows = read_measurements(ROOT / FILES[name])
    return replace(rows, rotation=np.full((len(rows), 3, 3), np.nan))


def nominal_y(robot: RobotModel, rows: MeasurementSet) -> np.ndarray:
    """Returns y (n,) m of the goal; the UR controller's base is the DH base turned by 180 deg."""
    tool = np.eye(4)
    tool[2, 3] = 0.109
    return -forward(robot.with_tool(tool), rows.joints)[:, 1, 3]


def grid_to_random(quick: bool) -> Iterator[Split]:
    """Yields the UR5 grid and its 20 random poses."""
    yield points("ur5"), points("ur5-random")


def at_random(name: str, seeds: int) -> Callable[[bool], Iterator[Split]]:
    """Returns random 80/20 splits, seeds 0, 1, ..."""

    def splits(quick: bool) -> Iterator[Split]:
        rows = points(name)
        for seed in range(1 if quick else seeds):
            order = np.random.default_rng(seed).permutation(len(rows))
            test, train = np.split(order, [len(rows) // 5])
            yield rows.subset(np.sort(thin(train, quick))), rows.subset(np.sort(test))

    return splits


def one_side(quick: bool) -> Iterator[Split]:
    """Yields y < -200 mm plus 20 points of the other side (seed 0), and the rest of that side."""
    rows = points("A")
    y = nominal_y(preset("UR10"), rows)
    far = np.flatnonzero(y > 0.2)
    known = np.random.default_rng(0).choice(far, 20, replace=False)
    near = thin(np.flatnonzero(y < -0.2), quick)
    yield (
        rows.subset(np.sort(np.concatenate([near, known]))),
        rows.subset(np.setdiff1d(far, known)),
    )


def blocks(name: str, folds: int) -> Callable[[bool], Iterator[Split]]:
    """Returns the first ``folds`` of five folds; a fold is one contiguous fifth of the rows."""

    def splits(quick: bool) -> Iterator[Split]:
        rows = points(name)
        fold = np.arange(len(rows)) * FOLDS // len(rows)
        for k in range(1 if quick else folds):
            yield rows.subset(thin(np.flatnonzero(fold != k), quick)), rows.subset(fold == k)

    return splits


def thin(rows: np.ndarray, quick: bool) -> np.ndarray:
    """Returns the rows, every k-th of them when in a hurry."""
    return rows[:: max(1, len(rows) // QUICK_ROWS)] if quick else rows


CASES = {
    "ur5": Case(
        title="UR5 grid -> 20 random poses",
        robot="UR5",
        splits=grid_to_random,
        reference="published 0.1549, DH+GP 0.064, prototype 0.053",
        reach="<= 0.053",
    ),
    "a-random": Case(
        title="UR10 A random 80/20",
        robot="UR10",
        splits=at_random("A", 1),
        reference="DH 0.394, DH+GP 0.154, prototype 0.077",
        reach="<= 0.070",
    ),
    "b-random": Case(
        title="UR10 B random 80/20",
        robot="UR10",
        splits=at_random("B", 5),
        reference="DH 0.379, DH+GP 0.217, prototype 0.092-0.108",
        reach="<= 0.098",
    ),
    "a-side": Case(
        title="UR10 A y<-200 + 20 -> y>200",
        robot="UR10",
        splits=one_side,
        reference="DH+GP 0.391, prototype 0.171",
        reach="<= 0.17",
    ),
    "a-blocks": Case(
        title="UR10 A contiguous fifths",
        robot="UR10",
        splits=blocks("A", 2),
        reference="-",
        reach="cover 93-97 %",
    ),
    "b-blocks": Case(
        title="UR10 B contiguous fifths",
        robot="UR10",
        splits=blocks("B", 5),
        reference="-",
        reach="cover 93-97 %",
    ),
}


def examine(model: ErrorModel, test: MeasurementSet) -> tuple[np.ndarray, np.ndarray]:
    """Returns 3-D errors (n,) m and whether each row lies in its stated 95 % region."""
    rows = model.in_base(test)
    stated = model.predict(Query(joints=rows.joints, approach=rows.approach))
    error = rows.position - forward(model.robot, rows.joints)[:, :3, 3] - stated.error
    solved = np.linalg.solve(stated.covariance + rows.covariance, error[:, :, None])[:, :, 0]
    return np.linalg.norm(error, axis=1), (error * solved).sum(axis=1) <= CHI2_95


def run(case: Case, method: str, quick: bool) -> str:
    """Returns the figures of one method on one case; means are over all splits."""
    means, inside, worst, start = [], [], 0.0, time.perf_counter()
    for train, test in case.splits(quick):
        errors, within = examine(fit(preset(case.robot), train, method=method), test)
        means.append(float(errors.mean()) / MM)
        inside.append(within)
        sys.stderr.write(
            f"    split {len(means)}: {means[-1]:.4f} mm, cover {100 * within.mean():.1f} %, "
            f"{time.perf_counter() - start:.0f} s\n"
        )
        worst = max(worst, float(errors.max()) / MM)
    seconds = (time.perf_counter() - start) / len(means)
    each = " ".join(f"{m:.4f}" for m in means) if len(means) > 1 else ""
    return (
        f"  {method:8s} mean {np.mean(means):.4f} mm  max {worst:.3f} mm  "
        f"cover {100 * np.concatenate(inside).mean():5.1f} %  {seconds:6.1f} s a fit  {each}"
    )


def main(arguments: list[str]) -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one split, thinned training rows")
    parser.add_argument("--rows", nargs="+", choices=list(CASES), default=list(CASES))
    parser.add_argument("--methods", nargs="+", default=list(METHODS))
    options = parser.parse_args(arguments)
    if not ROOT.is_dir():
        sys.stderr.write(f"no measured data at {ROOT}; set ROBOTRUE_DATA.\n")
        return 1
    for name in options.rows:
        case = CASES[name]
        print(f"{case.title}   reach {case.reach}   reference {case.reference}")
        for method in options.methods:
            print(run(case, method, options.quick), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
