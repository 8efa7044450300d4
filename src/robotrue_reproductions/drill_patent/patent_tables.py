"""The patent's correction next to ours on simulated machines: one move, few clamps, a shifted zero.

The patent prints no residuals; the figures next to ours are those of the same methods on machines
of this kind, and results that were published for one move or a few.
"""

from __future__ import annotations

from collections import Counter
from typing import Final

import numpy as np

from robotrue.core.units import DEG
from robotrue.simulation.drilling_machine import AS_LEFT
from robotrue_reproductions.drill_patent.experiment import (
    CASES,
    CLAMPS,
    HOLES,
    TESTED,
    OneMove,
    ShiftedProduction,
    one_move,
    production,
)
from robotrue_reproductions.reproduction import (
    Figure,
    Paper,
    Progress,
    Reproduction,
    ReproductionRequest,
    TableLayout,
    figure,
)

CHANCE: Final = "approaches by chance"
SHIFTED: Final = "zero shifted"
REFERENCE: Final = {
    ("additive errors", "patent"): (0.010, 0.022),
    ("additive errors", "gp"): (0.002, 0.004),
    ("with nonlinearity", "patent"): (0.027, 0.057),
    ("with nonlinearity", "gp"): (0.002, 0.005),
    ("with friction, one way of approach", "patent"): (0.053, 0.112),
    ("with friction, one way of approach", "gp"): (0.016, 0.040),
    ("friction, 15 clamps", "patent"): (0.060, 0.126),
    ("friction, 15 clamps", "gp"): (0.033, 0.074),
}
"""Mean and 95th percentile in deg of prototypes of the same methods on such machines."""
UNMET: Final[tuple[tuple[str, str], ...]] = (
    (
        "the patent's example",
        "200 counts at no clamp force are met by construction; its figure at 100 kg is "
        "not legible in the document.",
    ),
    (
        "approaches by chance",
        "no correction takes out friction of an unknown history: approach one way.",
    ),
)
"""What cannot be met, and why."""


def run(request: ReproductionRequest, progress: Progress) -> Reproduction:
    """Returns residual tilts of the patent's method and ours over simulated machines.

    Args:
        request: Quick: the first case, and the productions of a tenth of the machines only.
        progress: Called for every machine.
    """
    machines = request.robots
    fewer = max(1, machines // 10) if request.quick else machines
    figures: list[Figure] = []
    remarks = [f"machines of seeds 1 to {machines}; {TESTED} test clamps each."]
    for name, nonlinear, friction, clamps in CASES[: 1 if request.quick else None]:
        moves = []
        for seed in request.seeds:
            moves.append(one_move(seed, nonlinear=nonlinear, friction=friction, clamps=clamps))
            progress(name, seed, machines)
        figures += _of_case(name, moves)
        kinds = Counter(move.kind for move in moves)
        remarks.append(
            f"{name}: chosen {', '.join(f'{k} {n}x' for k, n in kinds.most_common())}; "
            f"{100.0 * np.mean([move.covered for move in moves]):.1f} % in 95 % regions."
        )
    figures += _of_history(fewer, progress)
    drifts = []
    for seed in range(1, fewer + 1):
        drifts.append(production(seed))
        progress("shifted zero", seed, machines)
    figures += _of_drifts(drifts)
    return Reproduction(
        scenario="with friction and without",
        robots=machines,
        figures=tuple(figures),
        remarks=tuple(remarks),
        unmet=UNMET,
    )


def _of_case(name: str, runs: list[OneMove]) -> list[Figure]:
    out = []
    for method in ("none", "patent", "interactions", "gp", "ours"):
        each = [run.left[method] / DEG for run in runs if method in run.left]
        if not each:
            continue
        pooled = np.concatenate(each)
        printed = REFERENCE.get((name, method), (None, None))
        for quantity, value, paper in (
            ("mean deg", float(pooled.mean()), printed[0]),
            ("p95 deg", float(np.percentile(pooled, 95.0)), printed[1]),
            ("max deg", float(pooled.max()), None),
            ("within 0.1 deg", float(100.0 * np.mean(pooled <= 0.1)), None),
        ):
            unit = "%" if quantity.startswith("within") else "deg"
            out.append(figure(name, method, quantity, unit, paper, value))
    return out


def _of_history(machines: int, progress: Progress) -> list[Figure]:
    """Approaches as the clamp before left the foot: nothing can take that out."""
    left = []
    for seed in range(1, machines + 1):
        move = one_move(seed, nonlinear=True, friction=True, clamps=CLAMPS, approach=AS_LEFT)
        left.append(move.left["ours"] / DEG)
        progress(CHANCE, seed, machines)
    pooled = np.concatenate(left)
    name = CHANCE
    return [
        figure(name, "ours", "mean deg", "deg", 0.043, pooled.mean()),
        figure(name, "ours", "p95 deg", "deg", 0.097, np.percentile(pooled, 95.0)),
    ]


def _of_drifts(drifts: list[ShiftedProduction]) -> list[Figure]:
    name = SHIFTED
    late = slice(600, HOLES)
    refined = np.array([d.left[late].mean() for d in drifts]) / DEG
    stale = np.array([d.stale[late].mean() for d in drifts]) / DEG
    delay = np.array([min(d.delay, float(HOLES)) for d in drifts])
    false = np.array([float(d.false) for d in drifts])
    return [
        figure(name, "as learned", "holes 600-800, mean deg", "deg", 0.074, stale),
        figure(name, "refined", "holes 600-800, mean deg", "deg", 0.047, refined),
        figure(name, "refined", "holes to the alarm, median", "", None, delay),
        figure(name, "refined", "holes to the alarm, most", "", None, delay.max()),
        figure(name, "refined", "false alarms in 400 holes", "", None, false.mean()),
    ]


DRILL_PATENT: Final = Paper(
    authors="prototypes of the same methods",
    arms="machines",
    tables={
        table: TableLayout(title=title, beside="reference")
        for table, title in {
            **{case[0]: f"Tilt left after one move, {case[0]} (simulated)" for case in CASES},
            CHANCE: "Tilt left where the foot meets the skin as the clamp before left it "
            "(simulated)",
            SHIFTED: "A zero shifted by 50, -50 and 25 um at hole 400 of 800 (simulated)",
        }.items()
    },
    run=run,
)
