"""A shift in which the arm warms, with and without its temperature. All simulated.

    python benchmarks/warm_shift.py [--draws N] [--method auto] [--drift UM]

The arms of ``robotrue.simulation.warm_shift``, whose tool point is off by 0.1 mm after eight hours.
Fitted to the 60 rows of the first four hours and judged on the 60 of the last four: without
temperature or time, with the temperature, with the time alone. Error: of the prediction from where
the tool point truly was. Coverage: share of the late rows, as measured, in their 95 % region.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from robotrue.calibration.methods import fit
from robotrue.calibration.settings import FitSettings
from robotrue.core.arrays import Array
from robotrue.core.units import MM, UM
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset
from robotrue.simulation.warm_shift import (
    EARLY,
    LATE,
    LOAD,
    REPEATABILITY,
    measure_shift,
    true_arm,
)
from robotrue.validation.evaluation import evaluate
from robotrue.validation.metrics import coverage
from robotrue.validation.selection import fit_auto


def judge(
    nominal: RobotModel, rows: MeasurementSet, true: Array, method: str
) -> dict[str, tuple[float, float]]:
    """Mean true error at the late rows in mm, and coverage as measured, by what is stated."""
    unknown = np.full(len(rows), np.nan)
    told = {
        "neither": replace(rows, temperature=unknown, time=unknown),
        "temperature": replace(rows, time=unknown),
        "time": replace(rows, temperature=unknown),
    }
    settings = FitSettings(payload=LOAD, repeatability=REPEATABILITY * 3.6158)
    out = {}
    for name, stated in told.items():
        early = stated.subset(np.arange(EARLY))
        if method == "auto":
            model = fit_auto(nominal, early, settings)
        else:
            model = fit(nominal, early, method=method, settings=settings)
        seen = evaluate(model, stated.subset(np.arange(EARLY, EARLY + LATE)), payload=LOAD)
        gap = seen.after - rows.position[EARLY:] + true[EARLY:]
        error = float(np.linalg.norm(gap, axis=1).mean() / MM)
        out[name] = error, coverage(seen.after, seen.covariance).share
    return out


def main() -> None:
    """Prints error and coverage of the late rows, mean and worst draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--method", default="ripple")
    parser.add_argument("--drift", type=float, default=100.0, metavar="UM")
    asked = parser.parse_args()
    nominal = preset("KR160")
    results: list[dict[str, tuple[float, float]]] = []
    for draw in range(asked.draws):
        rng = np.random.default_rng(draw)
        arm = true_arm(nominal, rng, asked.drift * UM)
        results.append(judge(nominal, *measure_shift(nominal, arm, rng), asked.method))
    print(
        f"SIMULATED: {asked.draws} arms, drift {asked.drift:g} um in 8 h, method {asked.method}, "
        f"{EARLY} early rows, judged on {LATE} late ones"
    )
    print("stated       mean mm  worst mm  covered  worst")
    for name in results[0]:
        table = np.array([result[name] for result in results])
        print(
            f"{name:12s} {table[:, 0].mean():7.4f}  {table[:, 0].max():8.4f}  "
            f"{table[:, 1].mean():7.3f}  {table[:, 1].min():5.3f}"
        )


if __name__ == "__main__":
    main()
