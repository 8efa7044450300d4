"""Calibration from paths of constant or slowly turning attitude, simulated unless ``--real``.

    python benchmarks/constant_attitude.py [--quick] [--paths N] [--first SEED] [--only KIND]
                                           [--methods NAME ...] [--rows] [--real]

Each seed is one path: a line, arc, raster or curve of 0.05 to 0.5 m on an arm of the presets with
geometric errors, 50 to 100 poses, noise of 5 to 50 um per axis, reflector known to 1 to 100 mm and
off by as much, tracker frame known or not. Four blocks of consecutive poses inside the path, a
fifth of it, are held out. `auto` calibrates from the rest. The floor of the same run is SciPy's
least squares of the whole DH table, tool and frame, from the same poses and the same stated
reflector; priors of 10 mm and 10 mrad keep it from running away where the data see nothing.

``--real`` takes planar rasters of constant attitude out of both measured series of the UR10: 50 to
110 poses of one height and one attitude each, the reflector stated to 10 mm.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from real_arms import ROOT, points
from scipy.optimize import least_squares

from robotrue.calibration.methods import METHODS
from robotrue.calibration.observations import observations_of
from robotrue.calibration.parameters import retract, start_state
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.terms.error_vector import PriorScales
from robotrue.core.arrays import Array, IntArray
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import RobotrueError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.inverse_numeric import solve
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.presets import preset
from robotrue.robot.statics import NO_LOAD
from robotrue.validation.contest import selection_from_summary
from robotrue.validation.evaluation import evaluate
from robotrue.validation.selection import fit_auto

ARMS = ("irb120", "kr160", "kr300", "tx2-90l", "ur5", "ur10", "gp225")
KINDS = ("line", "arc", "raster", "curve")
STATED = 15e-6
"""m per axis, the instrument's sigma in the cell, whatever its true noise."""
WORSE = 0.8
"""Least squares at below this share of the error of `auto` is better by 20 %."""
PATHS = 2000
QUICK = 12
SERIES = ("A", "B")
REFLECTOR = pose(np.eye(3), np.array([0.0, 0.0, 0.109]))
"""T_flange_tool of the measured UR10, stated to 10 mm."""
FEWEST = 40
"""Poses of a measured raster."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One simulated path: what the fit is given, and the poses held out."""

    seed: int
    kind: str
    robot: RobotModel
    settings: FitSettings
    train: MeasurementSet
    test: MeasurementSet


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What came of one path; mean held-out errors in m, NaN where there is no model."""

    case: Case
    auto: float
    floor: float
    winner: str
    refusal: str
    unsettled: tuple[str, ...]
    seconds: float


def simulate(seed: int, kind: str | None = None) -> Case:
    """Returns the path of a seed; of one kind if asked for."""
    rng = np.random.default_rng([seed, 7])
    drawn = KINDS[int(rng.integers(len(KINDS)))]
    kind = drawn if kind is None else kind
    noise, sigma = np.exp(rng.uniform(np.log([5e-6, 1e-3]), np.log([50e-6, 0.1])))
    size = rng.uniform(0.05, 0.5)
    known = bool(rng.random() < 0.5)
    turning = rng.choice([0.0, 0.2]) * rng.normal(size=3)
    count = int(rng.integers(50, 101))
    arm = preset(ARMS[int(rng.integers(len(ARMS)))])
    robot = arm.with_tool(pose(np.eye(3), np.array([0.0, 0.0, 0.1])))
    while True:
        joints = _joints(robot, _shape(kind, size, count, rng), turning, rng)
        if joints is not None:
            break
        size *= 0.9
    actual = robot.with_errors(_errors(robot, sigma, rng))
    points = forward(actual, joints)[:, :3, 3]
    T = np.eye(4)
    if not known:
        T = pose(matrix_from_rotation_vector(rng.normal(size=3)), rng.uniform(-3.0, 3.0, 3))
    points = points @ T[:3, :3].T + T[:3, 3] + noise * rng.normal(size=points.shape)
    rows = MeasurementSet(
        joints=joints,
        position=points,
        covariance=np.broadcast_to(STATED**2 * np.eye(3), (count, 3, 3)),
        frame="base" if known else "tracker",
    )
    held = held_blocks(count)
    return Case(
        seed=seed,
        kind=kind,
        robot=robot,
        settings=FitSettings(scales=PriorScales(tool=float(sigma))),
        train=rows.subset(np.setdiff1d(np.arange(count), held)),
        test=rows.subset(held),
    )


def measured_rasters() -> list[Case]:
    """Returns the rasters of both measured series, each pose once, in the order of the lanes."""
    robot = preset("UR10").with_tool(REFLECTOR)
    cases = []
    for name in SERIES:
        rows = points(name)
        T = forward(robot, rows.joints)
        turn = rotation_vector_from_matrix(T[:, :3, :3] @ T[0, :3, :3].T)
        place = np.round(T[:, :3, 3] / (10 * MM)).astype(np.int64)
        key = np.column_stack([np.round(turn / DEG).astype(np.int64), place[:, 2]])
        _, group = np.unique(key, axis=0, return_inverse=True)
        for k in range(int(group.max()) + 1):
            mine = np.flatnonzero(group == k)
            _, first = np.unique(place[mine], axis=0, return_index=True)  # by lane, then along it
            raster = rows.subset(mine[first])
            if len(raster) < FEWEST:
                continue
            held = held_blocks(len(raster))
            cases.append(
                Case(
                    seed=len(cases),
                    kind=f"UR10 {name}",
                    robot=robot,
                    settings=FitSettings(scales=PriorScales(tool=10 * MM)),
                    train=raster.subset(np.setdiff1d(np.arange(len(raster)), held)),
                    test=raster.subset(held),
                )
            )
    return cases


def held_blocks(count: int) -> IntArray:
    """Returns a fifth of the rows in four blocks inside the path."""
    length = count // 20
    starts = (np.arange(1, 5) * count) // 5 - length // 2
    return (starts[:, None] + np.arange(length)).ravel()


def _shape(kind: str, size: float, count: int, rng: np.random.Generator) -> Array:
    """Points (count, 2) m about the origin of the plane, within ``size``."""
    s = np.linspace(-0.5, 0.5, count)
    if kind == "line":
        plane = np.stack([s, 0.0 * s], axis=1)
    elif kind == "arc":
        angle = 2.0 * np.pi * s * rng.uniform(0.3, 1.0)
        plane = 0.5 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    elif kind == "raster":
        lanes = int(rng.integers(3, 7))
        lane = np.minimum(((s + 0.5) * lanes).astype(np.int64), lanes - 1)
        along = (s + 0.5) * lanes - lane - 0.5
        plane = np.stack([along * (-1.0) ** lane, lane / (lanes - 1) - 0.5], axis=1)
    else:
        a, b = rng.uniform(0.1, 0.4, 2)
        plane = np.stack(
            [s, a * np.sin(2.0 * np.pi * s * rng.uniform(0.5, 1.5)) + b * s**2], axis=1
        )
    return size * plane


def _joints(
    robot: RobotModel, plane: Array, turning: Array, rng: np.random.Generator
) -> Array | None:
    """Joints of the path at a random place and in a random plane; None if the arm cannot follow."""
    low, high = np.clip(robot.limits, -2.6, 2.6).T
    middle = low + (high - low) * rng.uniform(0.2, 0.8, robot.dof)
    centre = forward(robot, middle[None])[0]
    if centre[2, 3] < 0.0 or np.hypot(*centre[:2, 3]) < 0.25 * robot.reach:
        return None
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0][:, :2]
    T = np.broadcast_to(centre, (len(plane), 4, 4)).copy()
    T[:, :3, 3] += plane @ axes.T
    s = np.linspace(-0.5, 0.5, len(plane))
    T[:, :3, :3] = matrix_from_rotation_vector(s[:, None] * turning) @ centre[:3, :3]
    solved = solve(robot, T, middle)
    joints = solved.joints
    inside = (joints > robot.limits[:, 0]).all() and (joints < robot.limits[:, 1]).all()
    smooth = np.abs(np.diff(joints, axis=0)).max() < 0.3
    return joints if solved.converged.all() and inside and smooth else None


def _errors(robot: RobotModel, sigma: float, rng: np.random.Generator) -> Array:
    """True errors: 0.1 to 0.3 mm and 0.2 to 0.6 mrad of the table, the reflector's place."""
    errors = np.zeros(len(robot.errors))
    scale = rng.uniform(1.0, 3.0)
    for name, sd in (("theta", 2e-4), ("d", 1e-4), ("a", 1e-4), ("alpha", 2e-4)):
        errors[parameter_slice(robot.dof, name)] = scale * sd * rng.normal(size=robot.dof)
    errors[parameter_slice(robot.dof, "tool")][:3] = sigma * rng.normal(size=3)
    return errors


def run(case: Case, methods: Sequence[str]) -> Outcome:
    """Returns what `auto` and the floor make of a case."""
    begun = time.process_time()
    auto, winner, refusal, unsettled = float("nan"), "", "", ()
    try:
        table = {name: METHODS[name] for name in methods}
        model = fit_auto(case.robot, case.train, case.settings, methods=table)
        selection = selection_from_summary(model.training_summary()["selection"])
        winner = selection.winner
        unsettled = tuple(f"{s.name}: {s.failure}" for s in selection.table if s.failure)
        seen = evaluate(model, case.test)
        auto = float(np.linalg.norm(seen.after, axis=1).mean())
    except RobotrueError as fault:
        refusal = f"{type(fault).__name__}: {fault.message}"
    return Outcome(
        case=case,
        auto=auto,
        floor=least_squares_error(case),
        winner=winner,
        refusal=refusal,
        unsettled=unsettled,
        seconds=time.process_time() - begun,
    )


def least_squares_error(case: Case) -> float:
    """Mean held-out error in m of plain least squares of the DH table, tool and frame."""
    try:
        tool_sd = case.settings.scales.tool
        robot, layout, start = start_state(case.robot, case.train, tool_sd=tool_sd, line=True)
    except RobotrueError:
        return float("nan")
    sd = np.full(layout.size, 1e-2)
    for name in ("compliance", "gear"):
        sd[parameter_slice(layout.dof, name)] = 0.0
    base, tool = (parameter_slice(layout.dof, name) for name in ("base", "tool"))
    sd[base] = 0.0 if layout.stations else 0.1
    sd[tool] = np.repeat([case.settings.scales.tool, 0.0], 3)
    sd[layout.robot_size :] = 0.3
    free = np.flatnonzero(sd)

    def rows(x: Array, data: MeasurementSet, which: str) -> Array:
        step = np.zeros(layout.size)
        step[free] = x * sd[free]
        item = observations_of(robot, data, NO_LOAD, repeatability=0.0, rotation_sd=1.0)[
            0
        ].linearise(layout, retract(layout, start, step))
        if which == "residual":
            return item.residual
        return item.jacobian[:, :, free] * sd[free]

    def residual(x: Array) -> Array:
        return np.concatenate([rows(x, case.train, "residual").ravel() / STATED, x])

    def jacobian(x: Array) -> Array:
        moved = rows(x, case.train, "jacobian").reshape(-1, len(free))
        return np.concatenate([-moved / STATED, np.eye(len(free))])

    found = least_squares(residual, np.zeros(len(free)), jacobian, max_nfev=60)
    return float(np.linalg.norm(rows(found.x, case.test, "residual"), axis=1).mean())


def is_better(outcome: Outcome) -> bool:
    """Whether least squares is better than `auto` by 20 %."""
    return outcome.floor < WORSE * outcome.auto


def report(outcomes: Sequence[Outcome], word: str) -> int:
    """Prints counts and quantiles of simulated or measured paths; 1 if a bound was missed."""
    refused = [o for o in outcomes if o.refusal]
    moving = [
        o
        for o in outcomes
        if "still moving" in o.refusal or any("still moving" in f for f in o.unsettled)
    ]
    failed = [o for o in outcomes if o.unsettled]
    behind = [o for o in outcomes if is_better(o)]
    nominal = [o for o in behind if o.winner == "nominal"]
    lines = [o for o in outcomes if o.case.kind == "line"]
    fitted = [o for o in lines if not o.refusal]
    print("winner: " + ", ".join(f"{w or 'none'} {n}" for w, n in _counted(outcomes)))
    print(f"a method that failed beside one that did not: {len(failed)}")
    print(
        f"least squares better by 20 %: {len(behind)}, seeds {[o.case.seed for o in behind][:40]}"
    )
    for o in [*refused, *moving, *nominal][:20]:
        print(f"  seed {o.case.seed} {o.case.kind}: {o.winner} {o.refusal} {o.unsettled}")
    ratio = np.array([o.auto / o.floor for o in outcomes if not o.refusal])
    print(f"auto within 10 % of least squares or better: {np.sum(ratio <= 1.1)} of {len(ratio)}")
    for label, values in (
        ("auto mm", np.array([o.auto for o in outcomes if not o.refusal]) / MM),
        ("least squares mm", np.array([o.floor for o in outcomes if not o.refusal]) / MM),
        ("ratio", ratio),
    ):
        q = np.nanquantile(values, [0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1.0])
        print(f"{label:18s} 5/25/50/75/95/99/100 %: " + " ".join(f"{v:.4f}" for v in q))
    print(f"auto: {np.mean([o.seconds for o in outcomes]):.2f} CPU s a path, with the floor")
    count = len(outcomes)
    rows = (
        (f"methods still moving, of {count} {word} paths", 0, len(moving)),
        (f"{word} paths refused, of {count}", 0, len(refused)),
        ("nominal where least squares is better by 20 %", 0, len(nominal)),
        (f"{word} lines not fitted, of {len(lines)}", 0, len(lines) - len(fitted)),
    )
    for name, reach, value in rows:
        verdict = "reached" if value <= reach else "missed"
        print(f"RESULT | constant attitude, {name} | - | {reach} | {value} | {verdict}")
    return int(any(value > reach for _, reach, value in rows))


def _counted(outcomes: Sequence[Outcome]) -> list[tuple[str, int]]:
    names = [o.winner for o in outcomes]
    return [(name, names.count(name)) for name in dict.fromkeys(sorted(names))]


def main() -> int:
    """Runs the paths."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} paths")
    parser.add_argument("--paths", type=int, default=PATHS)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--only", choices=KINDS, help="one kind of path")
    parser.add_argument("--methods", nargs="+", choices=list(METHODS), default=list(METHODS))
    parser.add_argument("--rows", action="store_true", help="print every path")
    parser.add_argument("--real", action="store_true", help="rasters of the measured UR10 instead")
    args = parser.parse_args()
    if args.real and not ROOT.is_dir():
        parser.error(f"no measured data at {ROOT}")
    outcomes: list[Outcome] = []
    seeds = range(args.first, args.first + (QUICK if args.quick else args.paths))
    word = "measured" if args.real else "simulated"
    cases = measured_rasters() if args.real else (simulate(seed, args.only) for seed in seeds)
    for case in cases:
        o = run(case, args.methods)
        outcomes.append(o)
        if args.rows:
            print(
                f"{case.seed:5d} {o.case.kind:6s} {o.case.robot.name:20s} {o.case.train.frame:7s} "
                f"{len(o.case.train):3d} tool {o.case.settings.scales.tool / MM:5.1f} mm "
                f"auto {o.auto / MM:.4f} floor {o.floor / MM:.4f} {o.winner} {o.seconds:.2f} s "
                f"{o.refusal} {o.unsettled or ''}",
                flush=True,
            )
    print(f"{len(outcomes)} {word} paths" + f", seeds from {args.first}" * (not args.real))
    return report(outcomes, word)


if __name__ == "__main__":
    sys.exit(main())
