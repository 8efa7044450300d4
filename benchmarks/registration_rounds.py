"""Rounds at the machine in simulated cells: how many, and whether any ends worse than it began.

python benchmarks/registration_rounds.py [--cells N] [--method touches|feng2018]
"""

from __future__ import annotations

import argparse

import numpy as np

from robotrue.core.units import MM
from robotrue_reproductions.feng2018.rounds_experiment import STARTS, run_rounds


def main() -> None:
    """Prints a row a start."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=200)
    parser.add_argument("--method", default="touches", choices=("touches", "feng2018"))
    asked = parser.parse_args()
    ends = [end for seed in range(1, asked.cells + 1) for end in run_rounds(seed, asked.method)]
    print(f"simulated, {asked.cells} cells, method {asked.method}; mm, medians")
    print("start | error at start | at the end [p5 p95] | rounds 1, 2, 3, more | ended worse")
    for start in STARTS:
        mine = [end for end in ends if end.start == start]
        first = np.array([end.error[0] for end in mine]) / MM
        last = np.array([end.error[-1] for end in mine]) / MM
        count = np.bincount([min(end.rounds, 4) for end in mine], minlength=5)[1:]
        low, high = np.percentile(last, [5, 95])
        print(
            f"{start} | {np.median(first):.3f} | {np.median(last):.3f} [{low:.3f} {high:.3f}] | "
            f"{', '.join(map(str, count))} | {(last > first + 1e-9).sum()}"
        )


if __name__ == "__main__":
    main()
