"""Wrong measurements on purpose: does the data doctor name the cause, and does its cure help?

    python benchmarks/data_doctor.py [--draws N] [--first SEED] [--kinds NAME ...] [--clean N]
                                     [--sets NAME ...] [--cure] [--json FILE]

Each draw takes 60 to 120 rows of a measured UR5 or UR10 (in the order of the file) or of a
simulated arm, corrupts them in one way, and asks the doctor; ``--clean`` draws are not corrupted.
With ``--cure`` the elastic calibration of the clean, the corrupted and the cured rows is judged on
rows that were held out and never corrupted. Rows of a joint with an offset show the file's offset
and the arm's own zero error as one angle: there the cured calibration is judged on held-out rows
with the same offset, cured by the same angle; ``at_controller`` of ``--json`` is its error at the
controller's joints. Sets named "simulated" are simulated.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from real_arms import ROOT, points

from robotrue.calibration.methods import fit
from robotrue.calibration.settings import FitSettings
from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.errors import RobotrueError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load, drive_torque
from robotrue.validation.doctor import SIX_WORDS, Diagnosis, describe_diagnosis, diagnose
from robotrue.validation.doctor_evidence import CauseName
from robotrue.validation.evaluation import evaluate
from robotrue.validation.metrics import wilson_interval

REAL = {"ur5": "UR5", "B": "UR10", "A": "UR10"}
SETS = ("ur5", "kr160", "B", "kr300", "A", "tx2-90l")
"""Those that are no files are simulated arms."""
HELD_OUT = 100
STALE = (532, 1063)
CLEAN = "clean"
Corrupt = Callable[[MeasurementSet, RobotModel, np.random.Generator], MeasurementSet]


@dataclass(frozen=True, slots=True, kw_only=True)
class Draw:
    """One set of rows and those it is judged on."""

    name: str
    robot: RobotModel
    rows: MeasurementSet
    test: MeasurementSet
    settings: FitSettings


@cache
def _series(name: str) -> MeasurementSet:
    rows = points(name)
    # Series B holds the same point twice, at other joints: the doctor names them, rightly.
    return rows.subset(np.setdiff1d(np.arange(len(rows)), STALE)) if name == "B" else rows


def draw(seed: int, names: tuple[str, ...]) -> Draw:
    """Returns the rows of a seed: measured ones, or those of a simulated arm."""
    rng = np.random.default_rng([seed, 11])
    name = names[seed % len(names)]
    count = int(rng.integers(60, 121))
    if name in REAL:
        rows = _series(name)
        picked = rng.permutation(len(rows))[: count + HELD_OUT]
        return Draw(
            name=name,
            robot=preset(REAL[name]),
            rows=rows.subset(np.sort(picked[:count])),
            test=rows.subset(np.sort(picked[count:])),
            settings=FitSettings(),
        )
    return simulate(name, count, rng)


def simulate(name: str, count: int, rng: np.random.Generator) -> Draw:
    """Returns a simulated arm: geometry, springs, ripple, noise of 10 to 30 um per axis."""
    robot = preset(name).with_tool(
        pose(np.eye(3), rng.uniform([0.03, -0.05, 0.08], [0.1, 0.05, 0.2]))
    )
    low, high = np.clip(robot.limits, -2.2, 2.2).T
    middle, half = (low + high) / 2.0, (high - low) * rng.uniform(0.2, 0.42)
    joints = middle + half * rng.uniform(-1.0, 1.0, (count + HELD_OUT, robot.dof))
    if rng.random() < 0.5:  # along a path
        joints = np.concatenate([_order_path(joints[:count]), joints[count:]])
    errors = np.zeros(len(robot.errors))
    for group, sd in (("theta", 6e-4), ("d", 3e-4), ("a", 3e-4), ("alpha", 3e-4)):
        errors[parameter_slice(robot.dof, group)] = sd * rng.normal(size=robot.dof)
    errors[parameter_slice(robot.dof, "compliance")] = rng.uniform(1e-7, 6e-7, robot.dof)
    errors[parameter_slice(robot.dof, "tool")][:3] = 1e-3 * rng.normal(size=3)
    actual = robot.with_errors(errors)
    place = pose(matrix_from_rotation_vector(rng.normal(size=3)), rng.uniform(-3.0, 3.0, 3))
    frame = "tracker" if rng.random() < 0.7 else "base"
    wave = rng.normal(size=robot.dof) * 4e-5
    phase = rng.uniform(0.0, 6.28, robot.dof)

    def see(q: Array) -> MeasurementSet:
        shift = drive_torque(robot, q) * actual.error("compliance") + wave * np.sin(2.0 * q + phase)
        seen = forward(actual, q, shift)[:, :3, 3]
        if frame == "tracker":
            seen = seen @ place[:3, :3].T + place[:3, 3]
        sd = rng.uniform(1e-5, 3e-5)
        covariance = np.broadcast_to(sd**2 * np.eye(3), (len(q), 3, 3))
        return MeasurementSet(
            joints=q, position=seen + sd * rng.normal(size=seen.shape), covariance=covariance,
            frame=frame,
        )  # fmt: skip

    return Draw(
        name=f"{name}, simulated", robot=robot, rows=see(joints[:count]), test=see(joints[count:]),
        settings=FitSettings(),
    )  # fmt: skip


def _order_path(joints: Array) -> Array:
    order, left = [0], set(range(1, len(joints)))
    while left:
        near = min(left, key=lambda k: float(np.abs(joints[k] - joints[order[-1]]).sum()))
        order.append(near)
        left.remove(near)
    return joints[order]


def _tail(rows: MeasurementSet, rng: np.random.Generator) -> Array:
    return np.arange(len(rows)) >= int(len(rows) * rng.uniform(0.35, 0.75))


def _unit(rng: np.random.Generator) -> Array:
    way = rng.normal(size=3)
    return way / np.linalg.norm(way)


def bump(rows: MeasurementSet, robot: RobotModel, rng: np.random.Generator) -> MeasurementSet:
    """The instrument moves by 0.3 to 2 mm and 0.1 to 0.5 mrad in mid-file."""
    late = _tail(rows, rng)
    centre = rows.position.mean(axis=0)
    T = pose(
        matrix_from_rotation_vector(rng.uniform(1e-4, 5e-4) * _unit(rng)),
        rng.uniform(3e-4, 2e-3) * _unit(rng),
    )
    moved = (rows.position - centre) @ T[:3, :3].T + centre + T[:3, 3]
    return replace(rows, position=np.where(late[:, None], moved, rows.position))


def drift(rows: MeasurementSet, robot: RobotModel, rng: np.random.Generator) -> MeasurementSet:
    """The instrument drifts by 0.5 to 2 mm over the file."""
    share = np.linspace(0.0, 1.0, len(rows))[:, None]
    return replace(rows, position=rows.position + share * rng.uniform(5e-4, 2e-3) * _unit(rng))


def reflector(rows: MeasurementSet, robot: RobotModel, rng: np.random.Generator) -> MeasurementSet:
    """Another place of the reflector, 1 to 30 mm off, from a row on."""
    off = np.exp(rng.uniform(np.log(1e-3), np.log(3e-2))) * _unit(rng)
    turn = forward(robot, rows.joints)[:, :3, :3]
    if rows.frame == "tracker":
        turn = _tracker_turn(rows, robot) @ turn
    late = _tail(rows, rng)
    return replace(rows, position=rows.position + late[:, None] * (turn @ off))


def _tracker_turn(rows: MeasurementSet, robot: RobotModel) -> Array:
    from robotrue.validation.doctor_case import robust_frame

    return robust_frame(forward(robot, rows.joints)[:, :3, 3], rows.position)[:3, :3]


def scale(rows: MeasurementSet, robot: RobotModel, rng: np.random.Generator) -> MeasurementSet:
    """A block in inches, or with an atmospheric correction off by 500 to 2000 um/m."""
    late = _tail(rows, rng)
    factor = 1.0 / 25.4 if rng.random() < 0.5 else 1.0 + rng.uniform(5e-4, 2e-3)
    return replace(rows, position=np.where(late[:, None], rows.position * factor, rows.position))


def one_direction(
    rows: MeasurementSet, robot: RobotModel, rng: np.random.Generator
) -> MeasurementSet:
    """20 % of the rows are off by the same vector of 1 to 5 mm."""
    wrong = rng.permutation(len(rows)) < 0.2 * len(rows)
    return replace(
        rows, position=rows.position + wrong[:, None] * rng.uniform(1e-3, 5e-3) * _unit(rng)
    )


def early(rows: MeasurementSet, robot: RobotModel, rng: np.random.Generator) -> MeasurementSet:
    """Joints are read while the arm settles: 0.03 to 0.06 deg at random."""
    sd = rng.uniform(0.03, 0.06) * DEG
    return replace(rows, joints=rows.joints + sd * rng.normal(size=rows.joints.shape))


def clock(rows: MeasurementSet, robot: RobotModel, rng: np.random.Generator) -> MeasurementSet:
    """Joints are read when 0.5 to 5 % of the way from the row before are left."""
    step = np.diff(rows.joints, axis=0, prepend=rows.joints[:1])
    return replace(rows, joints=rows.joints - rng.uniform(0.005, 0.05) * step)


def shifted(rows: MeasurementSet, robot: RobotModel, rng: np.random.Generator) -> MeasurementSet:
    """Joints of the row before or after."""
    step = 1 if rng.random() < 0.5 else -1
    joints = np.roll(rows.joints, step, axis=0)
    keep = slice(1, None) if step > 0 else slice(0, -1)
    return replace(rows, joints=joints).subset(np.arange(len(rows))[keep])


def sign(rows: MeasurementSet, robot: RobotModel, rng: np.random.Generator) -> MeasurementSet:
    """A joint with the wrong sign."""
    joints = rows.joints.copy()
    joints[:, rng.integers(1, robot.dof - 1)] *= -1.0
    return replace(rows, joints=joints)


def turn(rows: MeasurementSet, robot: RobotModel, rng: np.random.Generator) -> MeasurementSet:
    """A joint off by 360 deg in a block."""
    joints = rows.joints.copy()
    j = int(rng.integers(3, robot.dof))
    joints[_tail(rows, rng), j] += 2.0 * np.pi * rng.choice([-1.0, 1.0])
    return replace(rows, joints=joints)


def offset(rows: MeasurementSet, robot: RobotModel, rng: np.random.Generator) -> MeasurementSet:
    """A joint off by 1 to 10 deg in all rows."""
    joints = rows.joints.copy()
    joints[:, rng.integers(1, robot.dof - 1)] += rng.uniform(1.0, 10.0) * DEG * rng.choice([-1, 1])
    return replace(rows, joints=joints)


def exchanged(rows: MeasurementSet, robot: RobotModel, rng: np.random.Generator) -> MeasurementSet:
    """Two joint columns exchanged."""
    a, b = rng.permutation(robot.dof)[:2]
    joints = rows.joints.copy()
    joints[:, [a, b]] = joints[:, [b, a]]
    return replace(rows, joints=joints)


def duplicated(rows: MeasurementSet, robot: RobotModel, rng: np.random.Generator) -> MeasurementSet:
    """5 to 20 % of the rows stand twice."""
    extra = rng.permutation(len(rows))[: int(len(rows) * rng.uniform(0.05, 0.2)) + 1]
    return rows.subset(np.concatenate([np.arange(len(rows)), extra]))


def payload(rows: MeasurementSet, robot: RobotModel, rng: np.random.Generator) -> MeasurementSet:
    """A payload of 60 to 120 % of the rated one is taken up at a row nobody notes."""
    mass = rng.uniform(0.6, 1.2) * 0.08 * robot.reach**2 * 400.0 / 2.0
    spring = 2.5e-3 / (mass * 9.81 * robot.reach)  # winds up by 2.5 mrad at full reach
    torque = drive_torque(robot, rows.joints, Load(mass=np.array([mass])))
    torque = torque - drive_torque(robot, rows.joints)
    gone = forward(robot, rows.joints, spring * torque) - forward(robot, rows.joints)
    shift = gone[:, :3, 3]
    if rows.frame == "tracker":
        shift = shift @ _tracker_turn(rows, robot).T
    return replace(rows, position=rows.position + _tail(rows, rng)[:, None] * shift)


def stale(rows: MeasurementSet, robot: RobotModel, rng: np.random.Generator) -> MeasurementSet:
    """Every tenth row holds the point of the row before: the instrument was not read again."""
    origin = np.arange(len(rows)) - (np.arange(len(rows)) % 10 == 9)
    return replace(rows, position=rows.position[origin])


KINDS: dict[str, tuple[Corrupt, tuple[str, ...]]] = {
    "instrument-moved": (bump, ("instrument-moved",)),
    "drift": (drift, ("drift",)),
    "reflector": (reflector, ("reflector",)),
    "scale": (scale, ("scale",)),
    "one-direction": (one_direction, ("one-direction",)),
    "joints-early": (early, ("joints-early",)),
    "clock": (clock, ("clock",)),
    "shifted-rows": (shifted, ("shifted-rows",)),
    "joint-sign": (sign, ("joint-sign",)),
    "joint-turn": (turn, ("joint-turn",)),
    "joint-offset": (offset, ("joint-offset",)),
    "joints-exchanged": (exchanged, ("joints-exchanged",)),
    "duplicates": (duplicated, ("duplicates",)),
    "payload": (payload, ("payload",)),
}


def judge(rows: MeasurementSet, case: Draw, test: MeasurementSet | None = None) -> float:
    """Returns the mean held-out error in mm of an elastic calibration; NaN where it is refused."""
    try:
        model = fit(case.robot, rows, method="elastic", settings=case.settings)
        after = evaluate(model, case.test if test is None else test).after
        return float(np.linalg.norm(after, axis=1).mean()) / MM
    except RobotrueError:
        return float("nan")


def named(diagnosis: Diagnosis) -> list[str]:
    """Returns the causes, the likeliest first."""
    return [each.hypothesis.cause for each in diagnosis.findings]


def examine(kind: str, seed: int, options: argparse.Namespace) -> dict[str, object]:
    """Returns one draw's outcome."""
    case = draw(seed, tuple(options.sets))
    rows = case.rows
    if kind != CLEAN:
        rows = KINDS[kind][0](rows, case.robot, np.random.default_rng([seed, 5]))
    start = time.process_time()
    diagnosis = diagnose(case.robot, rows, case.settings)
    causes = named(diagnosis)
    row: dict[str, object] = {
        "kind": kind, "seed": seed, "set": case.name, "causes": causes,
        "seconds": time.process_time() - start,
        "considered": [(c, round(float(o), 1)) for c, o in diagnosis.considered[:4]],
        "text": [each.hypothesis.text for each in diagnosis.findings],
        "right": not causes if kind == CLEAN else bool(causes) and causes[0] in KINDS[kind][1],
    }  # fmt: skip
    if options.cure and kind != CLEAN and row["right"]:
        cured = diagnosis.findings[0].hypothesis.cured
        row["clean"], row["wrong"] = judge(case.rows, case), judge(rows, case)
        row["cured"] = float("nan") if cured is None else judge(cured, case)
        if kind == "joint-offset" and cured is not None:
            row["at_controller"] = row["cured"]
            left = cured.joints[0] - case.rows.joints[0]
            alike = replace(case.test, joints=case.test.joints + left)
            row["cured"] = judge(cured, case, alike)
    return row


def write_report(kind: CauseName) -> str:
    """Returns what the doctor says of one simulated set that is wrong in this way."""
    rng = np.random.default_rng(1)
    wrong_cell = kind == "preset"
    case = simulate("kr300" if wrong_cell else "kr160", 60, rng)
    robot, rows = case.robot, case.rows
    if wrong_cell:
        robot = preset("gp225").with_tool(robot.T_flange_tool)
    else:
        rows = (stale if kind == "stale-points" else KINDS[kind][0])(rows, robot, rng)
    (line,) = describe_diagnosis(diagnose(robot, rows, case.settings), rows)
    return line


def write_section(kind: CauseName) -> str:
    """Returns the heading of a cause, with its six words, and its report, for the page."""
    return f"### `{kind}`: {SIX_WORDS[kind]}\n\n```text\n{write_report(kind)}\n```\n"


def main(arguments: list[str]) -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=28, help="corrupted sets, over all kinds")
    parser.add_argument("--clean", type=int, default=10, help="sets that are not corrupted")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--sets", nargs="+", default=list(SETS))
    parser.add_argument("--cure", action="store_true", help="also calibrate from the cured rows")
    parser.add_argument(
        "--reports",
        action="store_true",
        help="one report a cause, simulated, as sections of a page",
    )
    parser.add_argument(
        "--json", type=Path, help="results, one line a draw; resumed if it is there"
    )
    options = parser.parse_args(arguments)
    if options.reports:
        print("\n".join(write_section(kind) for kind in SIX_WORDS))
        return 0
    if not ROOT.is_dir():
        options.sets = [name for name in options.sets if name not in REAL]
        sys.stderr.write(f"no measured data at {ROOT}: simulated arms alone.\n")
    done = []
    if options.json is not None and options.json.exists():
        done = [json.loads(line) for line in options.json.read_text().splitlines()]
    plan = [
        (options.kinds[k % len(options.kinds)], options.first + k) for k in range(options.draws)
    ]
    plan += [(CLEAN, options.first + 5000 + k) for k in range(options.clean)]
    known = {(row["kind"], row["seed"]) for row in done}
    for kind, seed in plan:
        if (kind, seed) in known:
            continue
        row = examine(kind, seed, options)
        done.append(row)
        if not row["right"]:
            print(
                f"  {kind} seed {seed} {row['set']}: {row['causes']} {row['considered']}",
                flush=True,
            )
        if options.json is not None:
            with options.json.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
    wanted = set(plan)
    report([row for row in done if (row["kind"], row["seed"]) in wanted])
    return 0


def report(rows: list[dict]) -> None:
    """Prints kind by kind what was named, the confusion, and what the cure is worth."""
    kinds = defaultdict(list)
    for row in rows:
        kinds[row["kind"]].append(row)
    print(f"{'kind':18s} draws right  named instead; held-out mm clean, wrong, cured; within 15 %")
    for kind, part in kinds.items():
        right = sum(bool(row["right"]) for row in part)
        other = Counter((row["causes"] or ["nothing"])[0] for row in part if not row["right"])
        told = ", ".join(f"{name} {count}" for name, count in other.items())
        print(f"{kind:18s} {len(part):5d} {right:5d}  {told}{_tell_cure(part)}")
    wrong = [row for row in rows if row["kind"] != CLEAN]
    clean = [row for row in rows if row["kind"] == CLEAN]
    if wrong:
        right = sum(bool(row["right"]) for row in wrong)
        print(f"RESULT | right cause, corruptions | >= 90 % | {_share(right, len(wrong))}")
    if clean:
        false = sum(not row["right"] for row in clean)
        print(f"RESULT | false alarm, clean sets | <= 2 % | {_share(false, len(clean))}")
    cured = [row for row in wrong if np.isfinite(row.get("cured", np.nan))]
    if cured:
        near = sum(row["cured"] <= 1.15 * row["clean"] for row in cured)
        ratio = np.median([row["cured"] / row["clean"] for row in cured])
        print(
            f"RESULT | cured error within 15 % of clean | all | {_share(near, len(cured))}; "
            f"median ratio {ratio:.3f}"
        )
    seconds = [row["seconds"] for row in rows]
    print(f"{np.mean(seconds):.2f} CPU s a diagnosis, at most {np.max(seconds):.2f}")


def _share(count: int, n: int) -> str:
    low, high = wilson_interval(count, n)
    return (
        f"{count} of {n}, {100.0 * count / n:.1f} %, 95 % interval {100.0 * low:.1f} to "
        f"{100.0 * high:.1f} %"
    )


def _tell_cure(rows: list[dict]) -> str:
    cured = [row for row in rows if np.isfinite(row.get("cured", np.nan))]
    if not cured:
        return ""
    mean = [np.nanmean([row[name] for row in cured]) for name in ("clean", "wrong", "cured")]
    near = sum(row["cured"] <= 1.15 * row["clean"] for row in cured)
    own = [row["at_controller"] for row in cured if "at_controller" in row]
    more = f"; {np.nanmean(own):.3f} at the controller's joints" if own else ""
    refused = sum(np.isnan(row["wrong"]) for row in cured)
    more += f"; wrong rows refused {refused}" if refused else ""
    return "; " + " ".join(f"{size:.3f}" for size in mean) + f"; {near} of {len(cured)}{more}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
