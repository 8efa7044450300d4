"""Held-out error of the learned deviation on virtual milling, beside its peers. All SIMULATED.

    python benchmarks/dynamic_deviation.py [FIRST LAST] [--no-paper] [--no-passes]

One line of JSON per seed, then the table. Peers: frequency response and force alone (e_w), the
paper's components and support vectors, and the prototype the method comes from: the same compliant
joints with white noise between windows (factors 1 +- 0.35, noise 1.5 um). Seeds 1 to 5 served to
choose priors; figures are to be read from others.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import UM
from robotrue.dynamics.deviation_physics import CompliantArm, physics_terms
from robotrue.dynamics.deviation_validation import Score, scores
from robotrue.dynamics.window_folds import folds
from robotrue.dynamics.windows import WindowSet
from robotrue_reproductions.jin2022.jin_tables import arm_of, row_of_hammer
from robotrue_reproductions.jin2022.milling_experiment import milling_experiment

KINDS: Final = ("blocks", "passes", "unseen")
REACH: Final = {"blocks": 1.4, "passes": 1.6, "unseen": 2.8}
PAPER_SEEDS: Final = 3
"""Of the paper's regression only so many: its search takes most of the time."""
_DEVIATION: Final = 1.5 * UM


def white(train: WindowSet, test: WindowSet, arm: CompliantArm) -> Array:
    """Returns the error (m,) m by compliant joints in closed form, noise taken as white."""

    def basis(windows: WindowSet) -> Array:
        bent = physics_terms(arm, windows).by_joint
        one = np.ones((len(windows), 1))
        centred = (windows.predicted - train.predicted.mean())[:, None]
        return np.concatenate([bent, -windows.force[:, :2], one, centred], axis=1)

    mean = np.concatenate([np.ones(6), np.zeros(4)])
    spread = np.array([0.35] * 6 + [UM, UM, 3 * UM, 0.2])
    rows = basis(train)
    precision = rows.T @ rows / _DEVIATION**2 + np.diag(spread**-2)
    weighed = rows.T @ train.deviation / _DEVIATION**2 + mean / spread**2
    return np.asarray(test.predicted + basis(test) @ np.linalg.solve(precision, weighed))


def of_seed(seed: int, kinds: Sequence[str], *, paper: bool) -> dict[str, float]:
    """Returns RMSE in um and coverage of every method and split."""
    experiment = milling_experiment(seed)
    arm, windows = arm_of(experiment.arm), experiment.windows
    row = row_of_hammer(experiment)
    printed = windows.take(windows.pass_index == 0)
    out: dict[str, float] = {}
    methods = ("prediction", "paper", "deviation") if paper else ("prediction", "deviation")
    for kind in kinds:
        data = printed if kind == "blocks" else windows
        for found in scores(data, arm, kinds=[kind], methods=methods, row=row):
            out[f"{kind} {found.method}"] = found.rmse / UM
            if found.coverage is not None:
                out[f"{kind} coverage"] = 100.0 * found.coverage
        miss = [
            white(data.take(a), data.take(b), arm) - data.take(b).measured
            for a, b in folds(data, kind)
        ]
        joined = Score(split=kind, method="prediction", residual=np.concatenate(miss), sd=None)
        out[f"{kind} white"] = joined.rmse / UM
    return out


def main(arguments: list[str]) -> None:
    numbers = [int(a) for a in arguments if a.isdigit()]
    first, last = numbers if numbers else (6, 25)
    paper = "--no-paper" not in arguments
    kinds = tuple(k for k in KINDS if k != "passes" or "--no-passes" not in arguments)
    rows = []
    for seed in range(first, last + 1):
        start = time.process_time()
        rows.append(of_seed(seed, kinds, paper=paper and seed < first + PAPER_SEEDS))
        spent = time.process_time() - start
        print(json.dumps({"seed": seed, "cpu_s": round(spent, 1), **rows[-1]}), flush=True)
    table(rows)


def table(rows: list[dict[str, float]]) -> None:
    print(f"\nSIMULATED, {len(rows)} seeds, low noise: RMSE um, mean over seeds")
    print(f"{'':9s}{'e_w':>8s}{'paper':>8s}{'white':>8s}{'ours':>8s}{'reach':>8s}{'in 95 %':>9s}")
    for kind in (k for k in KINDS if f"{k} deviation" in rows[0]):
        cells = []
        for method in ("prediction", "paper", "white", "deviation"):
            values = [r[f"{kind} {method}"] for r in rows if f"{kind} {method}" in r]
            cells.append(f"{np.mean(values):7.2f}" if values else "      -")
        inside = np.mean([r[f"{kind} coverage"] for r in rows])
        print(f"{kind:9s} {' '.join(cells)} {REACH[kind]:7.2f} {inside:6.1f} %")


if __name__ == "__main__":
    main(sys.argv[1:])
