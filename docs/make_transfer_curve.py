"""Draws docs/_static/ur10_transfer_curve.png: a transfer on a measured arm, point by point.

    ROBOTRUE_DATA=path/to/data python docs/make_transfer_curve.py

Data and split as in ``make_transfer_picture.py``: UR10 series A, y < -200 mm to y > 200 mm. Every
tenth row of the far side, drawn once, is the test; 0 to 40 of the others are given to the
candidates of the guard, in seven random nested subsets.
"""

from __future__ import annotations

import sys

import numpy as np
from make_transfer_picture import HERE, regions

from robotrue.calibration.methods import fit
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.transfer import TransferSource
from robotrue.core.files import write_atomic
from robotrue.report.transfer_report import curves_of
from robotrue.robot.presets import preset
from robotrue.validation.guarded_transfer import contestants
from robotrue.validation.learning_curve import learning_curve

REPEATS = 7
SPARE = 200
OUT = HERE / "_static" / "ur10_transfer_curve.png"


def main() -> None:
    """Fits, runs the curve, draws it, and says the medians on stderr."""
    source, target = regions()
    order = np.random.default_rng(0).permutation(len(target))
    tenth = len(target) // 10
    test, known = target.subset(order[:tenth]), target.subset(order[tenth : tenth + SPARE])
    model = fit(preset("UR10"), source, method="gp")
    given = [TransferSource(model=model, relation="region", name="y < -200 mm")]
    candidates = contestants(preset("UR10"), None, given, FitSettings()).all
    curve = learning_curve(candidates, known, test=test, repeats=REPEATS)
    for name, found in curve.to_json()["candidates"].items():
        sys.stderr.write(f"{name}: {found}\n")
    title = f"UR10: from y < -200 mm ({len(source)} poses) to y > 200 mm, {tenth} test poses"
    write_atomic(OUT, curves_of(curve, "transfer", title=title).png())


if __name__ == "__main__":
    main()
