"""Coverage of the stated regions with few poses on the measured UR5 and UR10, drawn at random.

    python benchmarks/few_pose_coverage.py [--draws N] [--poses 20 30 60 120] [--arms NAME ...]
                                           [--record FILE] [--picture FILE] [--perfect]

Each draw fits ``auto`` and every method on n rows of a series, in the order they were measured, and
looks at up to 300 other rows of it. One line of the record holds one draw: a run that is repeated
goes on where it stopped, and prints the table of everything recorded. The picture shows stated
against true coverage of ``auto``. ``--perfect`` prints instead what a faultless width would give:
true errors drawn from the joint covariance that ``auto`` states for all test rows, their coverage
per draw and the worst of 20 draws. Rows share the errors of the arm, so a draw is far from 300
independent tests. Only positions are used; no robot moved again. Data: the folder
ROBOTRUE_DATA (default ../shared/data).
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from real_arms import ROOT, points
from scipy.linalg import block_diag
from scipy.special import chdtri

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.learned import share_waves
from robotrue.calibration.methods import METHODS, FitSettings, fit
from robotrue.calibration.model import ErrorModel, Query
from robotrue.core.units import MM
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.presets import preset
from robotrue.validation.evaluation import evaluate, row_loads
from robotrue.validation.metrics import squared_distance
from robotrue.validation.selection import fit_auto

SERIES = {"ur5": "UR5", "A": "UR10", "B": "UR10"}
"""Series of :mod:`real_arms` and its preset."""
SIZES = (20, 30, 60, 120)
DRAWS = 20
TEST_ROWS = 300
PERFECT_DRAWS = 1000
PERFECT_FITS = 3
LEVELS = (0.5, 0.8, 0.9, 0.95, 0.99)
RECORD = Path(__file__).parents[1] / "docs" / "_static" / "few_pose_coverage.jsonl"
NAMES = ("auto", *METHODS)


def examine(model: ErrorModel, test: MeasurementSet) -> dict[str, Any]:
    """Returns mean error in mm and the true coverage at every stated level."""
    seen = evaluate(model, test)
    squared = squared_distance(seen.after, seen.covariance)
    return {
        "mean_mm": float(np.linalg.norm(seen.after, axis=1).mean()) / MM,
        "inside": [float((squared <= chdtri(3.0, 1.0 - level)).mean()) for level in LEVELS],
    }


def draw_rows(rows: MeasurementSet, n: int, draw: int) -> tuple[MeasurementSet, MeasurementSet]:
    """Returns n rows in the order they were measured, and up to :data:`TEST_ROWS` others."""
    order = np.random.default_rng([draw, n]).permutation(len(rows))
    return rows.subset(np.sort(order[:n])), rows.subset(np.sort(order[n : n + TEST_ROWS]))


def run(arm: str, rows: MeasurementSet, n: int, draw: int) -> dict[str, Any]:
    """Returns the record of one draw."""
    train, test = draw_rows(rows, n, draw)
    robot = preset(SERIES[arm])
    begin = time.process_time()
    model = fit_auto(robot, train)
    record: dict[str, Any] = {"arm": arm, "n": n, "draw": draw, "auto": examine(model, test)}
    record["auto"]["cpu_s"] = round(time.process_time() - begin, 2)
    record["auto"]["winner"] = model.training_summary().method
    settings = FitSettings()
    with share_waves():
        for method in METHODS:
            record[method] = examine(fit(robot, train, method=method, settings=settings), test)
    return record


def draw_shares(model: CalibratedModel, test: MeasurementSet, seed: int) -> np.ndarray:
    """Returns the coverage (PERFECT_DRAWS,) of errors drawn from what the model states of them."""
    stated = model.joint_covariance(
        Query(joints=test.joints, load=row_loads(test), approach=test.approach)
    ) + block_diag(*model.in_base(test).covariance)
    draws = np.random.default_rng(seed).standard_normal((len(stated), PERFECT_DRAWS))
    errors = (np.linalg.cholesky(stated) @ draws).reshape(len(test), 3, PERFECT_DRAWS)
    own = np.array([stated[k : k + 3, k : k + 3] for k in range(0, len(stated), 3)])
    squared = (errors * np.linalg.solve(own, errors)).sum(axis=1)
    return np.asarray((squared <= chdtri(3.0, 0.05)).mean(axis=0))


def print_perfect(arms: list[str], sizes: list[int], fits: int) -> None:
    """Prints the spread of coverage between draws that faultless widths would have."""
    print("drawn from the stated joint covariance: coverage of one draw, and worst of 20 draws")
    print(
        f"{'series':7s}{'poses':>6s}{'mean':>8s}{'sd':>8s}{'worst, mean':>13s}{'5 % to 95 %':>16s}"
    )
    for arm in arms:
        rows = points(arm)
        for n in sizes:
            shares = []
            for draw in range(fits):
                train, test = draw_rows(rows, n, draw)
                model = fit_auto(preset(SERIES[arm]), train)
                assert isinstance(model, CalibratedModel)
                shares.append(draw_shares(model, test, draw))
            joined = np.random.default_rng(0).permutation(np.concatenate(shares))
            worst = joined.reshape(-1, DRAWS).min(axis=1)
            low, high = np.quantile(worst, [0.05, 0.95])
            print(f"{arm:7s}{n:6d}{joined.mean():8.3f}{joined.std():8.3f}{worst.mean():13.3f}"
                  f"{low:9.2f} to {high:.2f}", flush=True)  # fmt: skip


def print_table(records: list[dict[str, Any]]) -> None:
    """Prints mean error and coverage (mean, worst draw) of every series and number of poses."""
    print("measured rows, never seen by the fit; coverage of the stated 95 % region")
    print(f"{'series':7s}{'poses':>6s}{'draws':>6s}  " + "".join(f"{m:>24s}" for m in NAMES))
    place = LEVELS.index(0.95)
    for arm in SERIES:
        for n in sorted({r["n"] for r in records}):
            mine = [r for r in records if (r["arm"], r["n"]) == (arm, n)]
            if not mine:
                continue
            cells = []
            for method in NAMES:
                inside = np.array([r[method]["inside"][place] for r in mine])
                mean = np.mean([r[method]["mean_mm"] for r in mine])
                cells.append(f"{mean:9.4f} {inside.mean():.3f} ({inside.min():.2f})")
            print(f"{arm:7s}{n:6d}{len(mine):6d}  " + "".join(f"{c:>24s}" for c in cells))


def draw_picture(records: list[dict[str, Any]], path: Path) -> None:
    """Draws stated against true coverage of ``auto`` for every number of poses, all series."""
    mpl.use("svg" if path.suffix == ".svg" else "agg")
    from matplotlib import pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.8), layout="constrained")
    sizes = sorted({r["n"] for r in records})
    for n, colour in zip(sizes, ("#b5452c", "#d98e04", "#1f6f8b", "#3b3f46"), strict=False):
        inside = np.array([r["auto"]["inside"] for r in records if r["n"] == n])
        left.plot(LEVELS, inside.mean(axis=0), "o-", ms=4, color=colour, label=f"{n} poses")
    left.plot((0.4, 1.0), (0.4, 1.0), color="#8a8f98", lw=0.8, ls="--")
    left.set(xlabel="stated", ylabel="true", title="coverage of auto, mean of draws")
    left.legend(frameon=False, fontsize=8)
    place = LEVELS.index(0.95)
    for k, arm in enumerate(SERIES):
        for i, n in enumerate(sizes):
            mine = [r["auto"]["inside"][place] for r in records if (r["arm"], r["n"]) == (arm, n)]
            x = np.full(len(mine), i + 0.2 * (k - 1))
            label = {"ur5": "UR5", "A": "UR10 A", "B": "UR10 B"}[arm] if i == 0 else None
            right.plot(x, mine, "_", ms=9, color=("#b5452c", "#1f6f8b", "#3b3f46")[k], label=label)
    right.axhspan(0.93, 0.97, color="#8a8f98", alpha=0.2, lw=0)
    right.set_xticks(range(len(sizes)), [f"{n}" for n in sizes])
    right.set(xlabel="poses", title="true coverage of the 95 % region, each draw")
    right.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=110)


def main(arguments: list[str]) -> int:
    """Runs the draws that are not recorded yet; prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=DRAWS)
    parser.add_argument("--poses", nargs="+", type=int, default=list(SIZES))
    parser.add_argument("--arms", nargs="+", choices=list(SERIES), default=list(SERIES))
    parser.add_argument("--record", type=Path, default=RECORD)
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--perfect", action="store_true")
    options = parser.parse_args(arguments)
    if options.perfect:
        print_perfect(options.arms, options.poses, PERFECT_FITS)
        return 0
    lines = options.record.read_text("utf-8").splitlines() if options.record.is_file() else []
    records = [json.loads(line) for line in lines]
    known = {(r["arm"], r["n"], r["draw"]) for r in records}
    wanted = [
        (arm, n, draw)
        for draw in range(options.draws)
        for n in options.poses
        for arm in options.arms
        if (arm, n, draw) not in known
    ]
    if wanted and not ROOT.is_dir():
        sys.stderr.write(f"no measured data at {ROOT}; set ROBOTRUE_DATA.\n")
        return 1
    series = {arm: points(arm) for arm in sorted({arm for arm, _, _ in wanted})}
    for arm, n, draw in wanted:
        records.append(run(arm, series[arm], n, draw))
        with options.record.open("a", encoding="utf-8") as file:
            file.write(json.dumps(records[-1]) + "\n")
        found = records[-1]["auto"]
        sys.stderr.write(f"{arm} {n} poses, draw {draw}: {found}\n")
    print_table(records)
    if options.picture is not None:
        draw_picture(records, options.picture)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
