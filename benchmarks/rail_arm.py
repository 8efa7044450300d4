"""An arm on a rail, or beside a rotary table, and the same arm alone. All simulated.

    python benchmarks/rail_arm.py [--draws N] [--poses N] [--method ripple] [--table]

The arms and rails of ``robotrue.simulation.rail_practice``: a tracker in an unknown frame sees
poses along six metres. Fitted: the arm alone (all rows at one place, checked there), and the arm
along its rail. Error of 200 further poses: from where they were measured (noise of the tracker and
of the arm included), and from where the reflector truly was. Coverage: share of those poses, as
measured, in their 95 % region.

With ``--table`` the arm stands, beside the tables of ``robotrue.simulation.table_practice``: the
same tracker sees 4 points on the table at 12 angles. Checked: the tool relative to 200 other points
of the part at other angles, within 0.6 m of the axis, as predicted by the model of the arm alone
(the table turns as the cell states it) and with the errors of the table; and the tool in base at
the same poses.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel, Query
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.table_fit import calibrate_table
from robotrue.core.arrays import Array
from robotrue.core.conditions import EXTERNAL_AXES, no_conditions
from robotrue.core.poses import apply, inverse
from robotrue.core.units import MM
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.program.external_axes import move_frames
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset
from robotrue.simulation.rail_practice import T_TRACKER_BASE, RailArm, draw_rail, measure_rail
from robotrue.simulation.table_practice import AXIS, draw_table, measure_table
from robotrue.simulation.warm_shift import LOAD, REPEATABILITY, TRACKER, joints_of
from robotrue.validation.evaluation import evaluate
from robotrue.validation.metrics import coverage
from robotrue.validation.selection import fit_auto

CHECKED = 200
NEAR = 0.6
"""m from the axis of the table."""
WAYS = ("alone", "on the rail")
TABLE_WAYS = ("alone", "table as stated", "on the table")


def judge(
    nominal: RobotModel, arm: RailArm, way: str, poses: int, method: str, seed: int
) -> tuple[float, float, float]:
    """Mean error in mm, as measured and true, and coverage."""
    rng, still = np.random.default_rng([seed, 1]), way == "alone"
    rows, _ = measure_rail(nominal, arm, poses, rng, still=still)
    check, true = measure_rail(nominal, arm, CHECKED, rng, still=still)
    model = learn(nominal, rows, method)
    seen = evaluate(model, check, payload=LOAD)
    turned = model.in_base(replace(check, position=true)).position - seen.measured.position
    measured, exact = (
        float(np.linalg.norm(gap, axis=1).mean() / MM) for gap in (seen.after, seen.after + turned)
    )
    return measured, exact, coverage(seen.after, seen.covariance).share


def learn(nominal: RobotModel, rows: MeasurementSet, method: str) -> ErrorModel:
    """The model of an arm."""
    settings = FitSettings(payload=LOAD, repeatability=REPEATABILITY * 3.6158)
    if method == "auto":
        return fit_auto(nominal, rows, settings)
    return fit(nominal, rows, method=method, settings=settings)


def judge_table(
    nominal: RobotModel, arm: RailArm, poses: int, method: str, seed: int
) -> list[tuple[float, float, float]]:
    """Of each way the mean error in mm, as measured and true, and coverage."""
    rng = np.random.default_rng([seed, 2])
    rows, _ = measure_rail(nominal, arm, poses, rng, still=True)
    model, table = learn(nominal, rows, method), draw_table(rng)
    if not isinstance(model, CalibratedModel):
        raise SystemExit(f"a {type(model).__name__} has no table.")
    with_table = calibrate_table(model, measure_table(table, rng), [AXIS])
    joints = joints_of(nominal, 40 * CHECKED, rng)
    commanded = forward(nominal, joints)[:, :3, 3]
    near = np.linalg.norm(commanded - np.asarray(AXIS.point), axis=1) < NEAR
    joints, commanded = joints[near][:CHECKED], commanded[near][:CHECKED]
    angle = rng.uniform(-np.pi, np.pi, len(joints))
    T_tracker_base = model.T_tracker_base[0]
    stated = np.tile(np.eye(4), (len(joints), 1, 1))
    move_frames(stated, AXIS, angle)
    # The part is where the program's frame is in the base of the model, and the table turns it.
    placed = apply(T_tracker_base[None], apply(inverse(stated), commanded))
    turned = apply(table.motion(angle), apply(inverse(T_TRACKER_BASE[None]), placed))
    part = apply(T_TRACKER_BASE[None], turned)
    tool = apply(T_TRACKER_BASE[None], arm.points(joints, np.zeros(len(joints))))
    seen = tool + rng.normal(0.0, np.hypot(REPEATABILITY, TRACKER), tool.shape)
    external = np.full((len(joints), EXTERNAL_AXES), np.nan)
    beside = apply(T_tracker_base[None], commanded)
    judged = []
    for k in range(len(TABLE_WAYS)):
        external[:, AXIS.number - 1] = angle if k == 2 else np.nan
        conditions = replace(no_conditions(len(joints)), external=external)
        told = with_table.predict(Query(joints=joints, load=LOAD, conditions=conditions))
        to_base: Array = T_tracker_base[:3, :3]
        against = beside if k == 0 else part
        off, exact = ((x - against) @ to_base - told.error for x in (seen, tool))
        share = coverage(off, told.covariance + TRACKER**2 * np.eye(3)).share
        size, left = (float(np.linalg.norm(e, axis=1).mean() / MM) for e in (off, exact))
        judged.append((size, left, share))
    return judged


def main() -> None:
    """Prints error and coverage of the ways, and their ratio to the arm alone."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--poses", type=int, default=90)
    parser.add_argument("--method", default="ripple")
    parser.add_argument("--table", action="store_true")
    asked = parser.parse_args()
    nominal, found = preset("KR160"), []
    ways = TABLE_WAYS if asked.table else WAYS
    for draw in range(asked.draws):
        arm = draw_rail(nominal, np.random.default_rng(draw))
        if asked.table:
            found.append(judge_table(nominal, arm, asked.poses, asked.method, draw))
        else:
            found.append(
                [judge(nominal, arm, way, asked.poses, asked.method, draw) for way in ways]
            )
    table = np.array(found)
    print(f"SIMULATED: {asked.draws} arms, {asked.poses} poses, method {asked.method}")
    print("way              measured mm  worst  true mm  worst  covered  worst")
    for k, way in enumerate(ways):
        measured, exact, share = table[:, k].T
        print(
            f"{way:15s}  {measured.mean():11.4f}  {measured.max():5.3f}  {exact.mean():7.4f}  "
            f"{exact.max():5.3f}  {share.mean():7.3f}  {share.min():5.3f}"
        )
    ratio = table[:, -1].mean(axis=0) / table[:, 0].mean(axis=0)
    print(f"{ways[-1]} over alone: measured {ratio[0]:.3f}, true {ratio[1]:.3f}")


if __name__ == "__main__":
    main()
