"""One move by every method on simulated drilling machines; few clamps; a shifted zero.

    python benchmarks/drilling.py [--quick] [--machines 50]

Machines of seeds 1 to n (``simulation/drilling_machine.py``), 120 or 15 clamps, 400 test clamps at
forces and heights in between; ``ours`` is what wins on forces and tilts held out of the campaign.
The floor is the scatter of the readings: 2 um on a radius of 60 mm. Simulated throughout; the
friction of the machines is of a form the ``physics`` correction knows.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

from robotrue.core.units import DEG, UM
from robotrue.simulation.drilling_machine import AS_LEFT
from robotrue_reproductions.drill_patent.experiment import CASES, CLAMPS, one_move, production

MACHINES, QUICK = 50, 4
REACH = {
    "additive errors": (0.002, 0.004),
    "with nonlinearity": (0.003, 0.006),
    "with friction, one way of approach": (0.015, 0.038),
    "friction, 15 clamps": (np.inf, 0.070),
}
LATE_MEAN, SOON = 0.045, 15
ONE_MOVE_P95 = 0.1


def met(value: float, reach: float) -> bool:
    """Whether a value reaches what is asked for, to its printed digit."""
    return round(value, 3) <= reach


def result(case: str, reference: str, reach: str, measured: str, good: bool) -> None:
    """Prints a row of the common table."""
    print(
        f"RESULT | {case} | {reference} | {reach} | {measured} | {'reached' if good else 'missed'}"
    )


def one_moves(machines: int) -> int:
    """Prints a table per case; returns how many numbers are out of reach."""
    bad = 0
    for name, nonlinear, friction, clamps in CASES:
        start = time.process_time()
        runs = [
            one_move(seed, nonlinear=nonlinear, friction=friction, clamps=clamps)
            for seed in range(1, machines + 1)
        ]
        took = (time.process_time() - start) / machines
        print(f"\n{name}, {clamps} clamps ({took:.1f} CPU s a machine)")
        print("              mean deg   p95 deg   max deg   within .1 deg")
        stated: dict[str, tuple[float, float]] = {}
        for method in ("none", "patent", "interactions", "gp", "ours"):
            pooled = np.concatenate([r.left[method] for r in runs if method in r.left]) / DEG
            mean, p95 = float(pooled.mean()), float(np.percentile(pooled, 95.0))
            stated[method] = mean, p95
            line = f"{method:13} {mean:9.4f} {p95:9.4f} {pooled.max():9.4f} "
            line += f"{100.0 * np.mean(pooled <= 0.1):13.1f} %"
            print(line, flush=True)
        patent = "patent's regression {:.4f} / {:.4f}".format(*stated["patent"])
        mean, p95 = stated["ours"]
        good = met(mean, REACH[name][0]) and met(p95, REACH[name][1])
        bad += not good
        result(
            f"one move, {name}, mean / p95 deg (simulated)",
            patent,
            " / ".join(f"{v:g}" if np.isfinite(v) else "-" for v in REACH[name]),
            f"{mean:.4f} / {p95:.4f}",
            good,
        )
        cover = [run.covered for run in runs]
        kinds = sorted({run.kind for run in runs})
        print(
            f"chosen: {', '.join(f'{k} {sum(r.kind == k for r in runs)}' for k in kinds)}; "
            f"in the 95 % regions {100.0 * np.mean(cover):.1f} % "
            f"[{100.0 * np.percentile(cover, 5):.0f} - {100.0 * np.percentile(cover, 95):.0f}]"
        )
    return bad


def histories(machines: int) -> None:
    """Prints what is left where the foot comes down as the clamp before left it."""
    runs = [
        one_move(seed, nonlinear=True, friction=True, clamps=CLAMPS, approach=AS_LEFT)
        for seed in range(1, machines + 1)
    ]
    pooled = np.concatenate([r.left["ours"] for r in runs]) / DEG
    print(
        f"\nfriction, any approach: mean {pooled.mean():.4f}, "
        f"p95 {np.percentile(pooled, 95):.4f} deg "
        "(nothing can take it out; prototypes .043 / .097)"
    )


def shifted(machines: int) -> int:
    """Prints what becomes of a shifted zero; returns how many numbers are out of reach."""
    runs = [production(seed) for seed in range(1, machines + 1)]
    late = float(np.mean([r.left[600:].mean() for r in runs])) / DEG
    stale = float(np.mean([r.stale[600:].mean() for r in runs])) / DEG
    delay = np.array([r.delay for r in runs])
    false = sum(r.false for r in runs)
    spans = ((0, 50), (200, 400), (400, 450), (600, 800))
    each = "  ".join(
        f"{a}-{b}: {np.mean([r.left[a:b].mean() for r in runs]) / DEG:.4f}" for a, b in spans
    )
    print(f"\nzero shifted at hole 400, 15 clamps, a gauge behind every hole\n  {each} deg mean")
    print(
        f"  as learned 600-800: {stale:.4f}; refined {late:.4f} (reach {LATE_MEAN})\n"
        f"  holes to the alarm: median {np.median(delay):.0f}, most {delay.max():.0f} "
        f"(reach {SOON}); "
        f"false alarms {false} in {400 * machines} holes"
    )
    result(
        "zero shifted at hole 400, mean deg at holes 600-800 (simulated)",
        f"frozen {stale:.4f}",
        f"<= {LATE_MEAN}",
        f"{late:.4f}",
        late <= LATE_MEAN,
    )
    result(
        "the same, holes to the alarm, worst machine (simulated)",
        "-",
        f"<= {SOON}",
        f"{delay.max():.0f}",
        delay.max() <= SOON,
    )
    return int(late > LATE_MEAN) + int(delay.max() > SOON)


def main() -> int:
    """Prints the tables; 1 if a number is out of reach."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} machines")
    parser.add_argument("--machines", type=int, default=MACHINES)
    options = parser.parse_args()
    machines = QUICK if options.quick else options.machines
    floor = np.sqrt(2.0 / 3.0) / 0.060 * 2.0 * UM / DEG
    print(
        f"SIMULATED: {machines} machines, seeds 1 to {machines}; floor of the scatter: mean ",
        end="",
    )
    print(f"{floor * np.sqrt(np.pi / 2.0):.4f}, p95 {floor * np.sqrt(-2.0 * np.log(0.05)):.4f} deg")
    bad = one_moves(machines)
    histories(max(QUICK, machines // 5))
    bad += shifted(machines)
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
