"""Transfer between regions, campaigns and a source region: prints tables, seeds and times.

    python benchmarks/transfer.py [--quick] [--rows NAME ...] [--draws N] [--pooled]

Measured UR10 (folder ROBOTRUE_DATA, positions only): every number is the distance between measured
and predicted position on target rows that no fit saw; draws of the target points are seeds 0, 1,
... Simulated rows (scenarios S1A, S2A): residual at 50 check poses measured on another day; medians
over arms, seeds 0, 1, .... Scales are learned from the target points of the draw alone.

Beside the transfer stand: ``source`` (the source as it is; for a tracker frame of its own only that
frame is fitted), ``target`` (the target points alone, leaning on the prior), ``pooled`` (one fit of
all rows; a minute a draw on the full series, so only with --pooled for the UR10).
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from real_arms import CHI2_95, ROOT, examine, nominal_y, points

from robotrue.calibration.drift_prior import NO_DRIFT
from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel, Query, require_belief
from robotrue.calibration.new_rows import new_rows
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.transfer import TransferSource, fit_transfer
from robotrue.core.units import MM
from robotrue.errors import RobotrueError
from robotrue.measurement.measurement_set import MeasurementSet, concatenate
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset
from robotrue_reproductions.deng2022 import scenarios

QUICK_ROWS = 1500
CANDIDATES = 500
TEST_ROWS = 1000
Examined = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One transfer on measured arms.

    Attributes:
        title: What goes where.
        relation: Of the source to the target.
        source: Rows of the source.
        target: Rows of the target, known and held out.
        counts: Numbers of target points; the first one is that of the reach.
        reference: What was known before.
        reach: Mean in mm to reach with ``counts[0]`` points.
    """

    title: str
    relation: str
    source: Callable[[], MeasurementSet]
    target: Callable[[], MeasurementSet]
    counts: tuple[int, ...]
    reference: str
    reach: float


def side(sign: float) -> MeasurementSet:
    """Returns the rows of A more than 200 mm to one side."""
    rows = points("A")
    return rows.subset(sign * nominal_y(preset("UR10"), rows) > 0.2)


CASES = {
    "side": Case(
        title="UR10 A y<-200 -> y>200",
        relation="region",
        source=lambda: side(-1.0),
        target=lambda: side(1.0),
        counts=(20, 0, 5, 10, 40),
        reference="0.391; prototype 0.171, cover 0.86",
        reach=0.150,
    ),
    "campaign": Case(
        title="UR10 A -> B",
        relation="campaign",
        source=lambda: points("A"),
        target=lambda: points("B"),
        counts=(30, 5, 10, 20, 40),
        reference="0.425; prototype 0.171-0.199, cover 0.52-0.61",
        reach=0.155,
    ),
}
SIMULATED = {"S1A": ("0.098 / 0.064", (0.090, 0.060)), "S2A": ("0.190 / 0.140", (None, None))}
SIMULATED_COUNTS = (0, 5, 10, 20, 40)
FEWER = 3
"""Counts without a number to reach get a third of the draws or arms."""


def contestants(
    case: Case,
    source: MeasurementSet,
    model: ErrorModel,
    known: MeasurementSet,
    pooled: bool,
    others: bool,
) -> Iterator[tuple[str, Callable[[], ErrorModel]]]:
    """Yields name and fit of every way to use the same rows."""
    robot = preset("UR10")
    given = [TransferSource(model=model, relation=case.relation, name="source")]  # type: ignore[arg-type]
    yield "transfer", lambda: fit_transfer(robot, known, given)
    if not others:
        return
    if case.relation == "region":
        yield "source", lambda: model
    else:
        yield "source", lambda: fit_transfer(robot, known, given, scales=NO_DRIFT, learn=False)
    if len(known):
        leaning = FitSettings(lean_on_prior=True)
        yield "target", lambda: alone(robot, known, leaning)
    if pooled and len(known):
        apart = known
        if case.relation != "region":
            apart = replace(known, station=known.station + 1 + int(source.station.max()))
        yield "pooled", lambda: fit(robot, concatenate([source, apart]), method="gp")


def alone(robot: RobotModel, known: MeasurementSet, leaning: FitSettings) -> ErrorModel:
    """Returns the fit of the target points alone; geometry where they are too few for more."""
    try:
        return fit(robot, known, method="gp", settings=leaning)
    except RobotrueError:
        return fit(robot, known, method="elastic", settings=leaning)


def least_sure(model: ErrorModel, rows: MeasurementSet, n: int) -> np.ndarray:
    """Returns n rows that, measured, would most lower the variance over a part of all rows.

    Greedy I-optimal choice by the carried-over model's own covariance; no measured target value is
    looked at, only joints.
    """
    candidates = np.arange(0, len(rows), max(1, len(rows) // CANDIDATES))
    belief = require_belief(model)
    found = new_rows(belief, rows.subset(candidates), FitSettings(), fresh=False)
    half = np.zeros((len(candidates), 3, len(belief.root)))
    for piece in found.pieces(belief):
        half[piece.rows] = piece.columns @ belief.root.T
    covariance = half.reshape(-1, half.shape[2]) @ half.reshape(-1, half.shape[2]).T
    noise = (belief.white**2 + belief.repeatability**2) * np.eye(3)
    chosen: list[int] = []
    for _ in range(n):
        blocks = covariance.reshape(len(candidates) * 3, len(candidates), 3).swapaxes(0, 1)
        own = np.stack([blocks[i][3 * i : 3 * i + 3] for i in range(len(candidates))]) + noise
        reduced = np.einsum("nka,nab,nkb->n", blocks, np.linalg.inv(own), blocks, optimize=True)
        reduced[chosen] = -1.0
        best = int(np.argmax(reduced))
        chosen.append(best)
        gain = blocks[best]
        covariance = covariance - gain @ np.linalg.solve(own[best], gain.T)
    return candidates[np.sort(chosen)]


def thinned(rows: MeasurementSet) -> MeasurementSet:
    """Returns every k-th row, at least :data:`TEST_ROWS` where there are so many."""
    return rows.subset(np.arange(0, len(rows), max(1, len(rows) // TEST_ROWS)))


def placed(model: ErrorModel, rows: MeasurementSet) -> MeasurementSet:
    """Returns the rows with the number of a station the model knows."""
    known = sorted(getattr(model, "physics", model).T_tracker_base)
    return (
        rows if set(rows.station) <= set(known) else replace(rows, station=rows.station + known[-1])
    )


def measured_case(case: Case, draws: int, quick: bool, pooled: bool) -> Iterator[str]:
    """Yields the table of one transfer on measured arms, and its result lines."""
    source, target = case.source(), case.target()
    if quick:
        source = source.subset(np.arange(0, len(source), max(1, len(source) // QUICK_ROWS)))
    start = time.perf_counter()
    model = fit(preset("UR10"), source, method="gp")
    yield f"{case.title}: source {len(source)} rows fitted in {time.perf_counter() - start:.0f} s"
    for n in case.counts[: 2 if quick else None]:
        found: dict[str, list[Examined]] = {}
        seconds: dict[str, float] = {}
        repeats = draws if n == case.counts[0] else -(-draws // FEWER)
        for seed in range(repeats if n else 1):
            order = np.random.default_rng(seed).permutation(len(target))
            known, test = target.subset(np.sort(order[:n])), target.subset(np.sort(order[n:]))
            for name, make in contestants(
                case, source, model, known, pooled and seed == 0, seed < FEWER
            ):
                begin = time.perf_counter()
                try:
                    made = make()
                except RobotrueError as refusal:
                    yield f"  {n:3d} points  {name:9s} {refusal}"
                    continue
                seconds[name] = time.perf_counter() - begin
                errors, inside = examine(made, placed(made, thinned(test)))
                found.setdefault(name, []).append((float(errors.mean()) / MM, inside.mean()))
        for name, values in found.items():
            yield f"  {n:3d} points  {name:9s} {spread(values)}  {seconds[name]:6.1f} s"
        if n == case.counts[0] and case.relation == "region":
            picked = least_sure(model, target, n)
            rest = target.subset(np.setdiff1d(np.arange(len(target)), picked))
            made = fit_transfer(
                preset("UR10"),
                target.subset(picked),
                [TransferSource(model=model, relation="region", name="source")],
            )
            errors, inside = examine(made, thinned(rest))
            values = [(float(errors.mean()) / MM, float(inside.mean()))]
            yield f"  {n:3d} planned points, transfer  {spread(values)}"
            yield result(f"{case.title}, {n} planned points", "-", case.reach, values)
        if n == case.counts[0]:
            yield result(f"{case.title}, {n} points", case.reference, case.reach, found["transfer"])


def spread(values: list[Examined]) -> str:
    """Returns median and range of the means, and coverage, over draws or arms."""
    mean, cover = np.array(values).T
    low, middle, high = np.quantile(mean, [0.25, 0.5, 0.75])
    return (
        f"median {middle:.4f} mm  IQR {low:.4f}-{high:.4f}  range {mean.min():.4f}-{mean.max():.4f}"
        f"  cover {100 * cover.mean():5.1f} % ({100 * cover.min():.0f}-{100 * cover.max():.0f})"
        f"  of {len(mean)}"
    )


def result(
    case: str,
    reference: str,
    reach: float | None,
    values: list[Examined],
    *,
    covering: bool = True,
) -> str:
    """Returns the line that the table of all benchmarks takes up."""
    mean, cover = np.array(values).T
    middle, share = float(np.median(mean)), float(cover.mean())
    inside = 0.93 <= share <= 0.97
    good = (inside or not covering) and (reach is None or middle <= reach)
    wanted = "-" if reach is None else f"<= {reach:.3f}"
    wanted += ", cover 93-97 %" if covering else ""
    return (
        f"RESULT | {case}, median of means mm over {len(mean)} | {reference} | {wanted} | "
        f"{middle:.4f}, {100 * share:.1f} % | {'reached' if good else 'missed'}"
    )


def check(model: ErrorModel, case: scenarios.Scenario) -> Examined:
    """Returns mean error in mm and coverage on the check poses of another day."""
    rows = scenarios.check(case)
    stated = model.predict(
        Query(joints=rows.joints, approach=rows.approach, load=case.settings.payload)
    )
    error = rows.position - forward(model.robot, rows.joints)[:, :3, 3] - stated.error
    solved = np.linalg.solve(stated.covariance + rows.covariance, error[:, :, None])[:, :, 0]
    inside = (error * solved).sum(axis=1) <= CHI2_95
    return float(np.linalg.norm(error, axis=1).mean()) / MM, float(inside.mean())


def simulated_case(name: str, arms: int, pooled: bool) -> Iterator[str]:
    """Yields the table of one scenario: 126 source poses and a few of the target domain."""
    found: dict[tuple[int, str], list[Examined]] = {}
    for seed in range(arms):
        case = scenarios.scenario(name, seed)
        robot, settings = case.cell.known.measured_robot, case.settings
        leaning = replace(settings, lean_on_prior=True)
        for n in SIMULATED_COUNTS[: None if seed * FEWER < arms else 2]:
            rows = scenarios.transfer(case, n)
            source, known = rows.subset(rows.group == 0), rows.subset(rows.group == 1)
            model = fit(robot, source, method="gp", settings=settings)
            given = [TransferSource(model=model, relation="region", name="source")]
            made = {"transfer": fit_transfer(robot, known, given, settings), "source": model}
            if n:
                made["target"] = alone(robot, known, leaning)
            if n and pooled:
                made["pooled"] = fit(robot, rows, method="gp", settings=settings)
            for key, value in made.items():
                found.setdefault((n, key), []).append(check(value, case))
    yield f"{name} (simulated), {arms} arms, 126 source poses"
    for (n, key), values in found.items():
        yield f"  {n:3d} points  {key:9s} {spread(values)}"
    reference, reaches = SIMULATED[name]
    for n, reach in zip((0, 5), reaches, strict=True):
        title = f"{name} (simulated) 126 source + {n} target poses"
        yield result(title, reference, reach, found[n, "transfer"], covering=False)


def main(arguments: list[str]) -> int:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    names = [*CASES, *SIMULATED]
    parser.add_argument("--quick", action="store_true", help="thinned source, few draws and arms")
    parser.add_argument("--rows", nargs="+", choices=names, default=names)
    parser.add_argument("--draws", type=int, default=10, help="draws of the target points")
    parser.add_argument("--arms", type=int, default=20, help="simulated arms")
    parser.add_argument("--pooled", action="store_true", help="also one fit of all rows (slow)")
    options = parser.parse_args(arguments)
    for name in options.rows:
        if name in SIMULATED:
            lines = simulated_case(name, 2 if options.quick else options.arms, options.pooled)
        elif ROOT.is_dir():
            draws = 2 if options.quick else options.draws
            lines = measured_case(CASES[name], draws, options.quick, options.pooled)
        else:
            sys.stderr.write(f"no measured data at {ROOT}; set ROBOTRUE_DATA.\n")
            continue
        for line in lines:
            print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
