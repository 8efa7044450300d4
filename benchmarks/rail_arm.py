"""An arm on a rail beside the same arm that stands still. All simulated.

    python benchmarks/rail_arm.py [--draws N] [--poses N] [--method ripple]

The arms and rails of ``robotrue.simulation.rail_practice``: a tracker in an unknown frame sees
poses along six metres. Fitted: the arm alone (all rows at one place, checked there), and the arm
along its rail. Error of 200 further poses: from where they were measured (noise of the tracker and
of the arm included), and from where the reflector truly was. Coverage: share of those poses, as
measured, in their 95 % region.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from robotrue.calibration.methods import fit
from robotrue.calibration.settings import FitSettings
from robotrue.core.units import MM
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset
from robotrue.simulation.rail_practice import RailArm, draw_rail, measure_rail
from robotrue.simulation.warm_shift import LOAD, REPEATABILITY
from robotrue.validation.evaluation import evaluate
from robotrue.validation.metrics import coverage
from robotrue.validation.selection import fit_auto

CHECKED = 200
WAYS = ("alone", "on the rail")


def judge(
    nominal: RobotModel, arm: RailArm, way: str, poses: int, method: str, seed: int
) -> tuple[float, float, float]:
    """Mean error in mm, as measured and true, and coverage."""
    rng, still = np.random.default_rng([seed, 1]), way == "alone"
    rows, _ = measure_rail(nominal, arm, poses, rng, still=still)
    check, true = measure_rail(nominal, arm, CHECKED, rng, still=still)
    settings = FitSettings(payload=LOAD, repeatability=REPEATABILITY * 3.6158)
    if method == "auto":
        model = fit_auto(nominal, rows, settings)
    else:
        model = fit(nominal, rows, method=method, settings=settings)
    seen = evaluate(model, check, payload=LOAD)
    turned = model.in_base(replace(check, position=true)).position - seen.measured.position
    measured, exact = (
        float(np.linalg.norm(gap, axis=1).mean() / MM) for gap in (seen.after, seen.after + turned)
    )
    return measured, exact, coverage(seen.after, seen.covariance).share


def main() -> None:
    """Prints error and coverage of the ways, and their ratio to the arm alone."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--poses", type=int, default=90)
    parser.add_argument("--method", default="ripple")
    asked = parser.parse_args()
    nominal = preset("KR160")
    table = np.array(
        [
            [
                judge(
                    nominal,
                    draw_rail(nominal, np.random.default_rng(draw)),
                    way,
                    asked.poses,
                    asked.method,
                    draw,
                )
                for way in WAYS
            ]
            for draw in range(asked.draws)
        ]
    )
    print(f"SIMULATED: {asked.draws} arms, {asked.poses} poses, method {asked.method}")
    print("way           measured mm  worst  true mm  worst  covered  worst")
    for k, way in enumerate(WAYS):
        measured, exact, share = table[:, k].T
        print(
            f"{way:12s}  {measured.mean():11.4f}  {measured.max():5.3f}  {exact.mean():7.4f}  "
            f"{exact.max():5.3f}  {share.mean():7.3f}  {share.min():5.3f}"
        )
    ratio = table[:, 1].mean(axis=0) / table[:, 0].mean(axis=0)
    print(f"on the rail over alone: measured {ratio[0]:.3f}, true {ratio[1]:.3f}")


if __name__ == "__main__":
    main()
