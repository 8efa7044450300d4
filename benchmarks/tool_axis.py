"""Angle of the tool's axis on the measured UR10, held out: nominal, and calibrated by poses.

    python benchmarks/tool_axis.py [--quick]

What a drill spindle on a robot starts from: the angle between the measured and the predicted axis
of the tool on contiguous blocks of rows the fit never saw, base and tool frame fitted in both.
Data: the folder ROBOTRUE_DATA (default ../shared/data).
"""

from __future__ import annotations

import argparse
import sys

import numpy as np
from real_arms import FILES, FOLDS, ROOT, thin

from robotrue.calibration.methods import fit
from robotrue.core.units import DEG
from robotrue.measurement.formats.measured_files import read_measurements
from robotrue.robot.presets import preset
from robotrue.validation.validate import validate

NOMINAL = {"A": 0.094, "B": 0.076}
"""deg, mean of the nominal arm as published with the data's analysis."""


def main() -> int:
    """Prints a row per fold; 1 if the angle is not half of what the nominal arm has."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one fold")
    quick = parser.parse_args().quick
    print("series  fold  method      n   mean deg   p95 deg   max deg")
    missed = 0
    for name, published in NOMINAL.items():
        rows = read_measurements(ROOT / FILES[name])
        fold = np.arange(len(rows)) * FOLDS // len(rows)
        found: dict[str, list[float]] = {"nominal": [], "elastic": []}
        for k in range(1 if quick else FOLDS):
            train = rows.subset(thin(np.flatnonzero(fold != k), quick=True))
            test = rows.subset(np.flatnonzero(fold == k))
            for method in found:
                angle = validate(fit(preset("UR10"), train, method=method), test).axis_after
                if angle is None:
                    raise SystemExit(f"{method}: no orientation is predicted")
                found[method].append(angle.mean / DEG)
                print(
                    f"{name:6}  {k + 1:4d}  {method:8} {angle.n:5d}  {angle.mean / DEG:9.4f} "
                    f"{angle.p95 / DEG:9.4f} {angle.max / DEG:9.4f}",
                    flush=True,
                )
        nominal, ours = (float(np.mean(each)) for each in found.values())
        reached = ours <= 0.5 * published
        missed += not reached
        reference = f"published nominal {published:.3f}, with base and tool fitted {nominal:.4f}"
        verdict = "reached" if reached else "missed"
        print(
            f"RESULT | UR10 {name}, tool axis held out, mean deg | {reference} | "
            f"<= {0.5 * published:.3f} | {ours:.4f} | {verdict}"
        )
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
