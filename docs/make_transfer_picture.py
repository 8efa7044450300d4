"""Draws docs/_static/ur10_transfer_joint2.png: what is left after a transfer to another region.

    ROBOTRUE_DATA=path/to/data python docs/make_transfer_picture.py

Data: Landgraf et al., CASE 2021, series A, laser tracker. Source: all rows with y < -200 mm;
target: 20 points with y > 200 mm (seed 0). Every third of the other rows there is predicted; what
is left is drawn as the turn of joint 2 that would explain it, against the angle of joint 2.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt

from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel, Query
from robotrue.calibration.transfer import TransferSource, fit_transfer
from robotrue.core.units import DEG, MM
from robotrue.measurement.formats.measured_files import read_measurements
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import drive_jacobian, forward, walk
from robotrue.robot.presets import preset

HERE: Final = Path(__file__).resolve().parent
DATA: Final = Path(os.environ.get("ROBOTRUE_DATA", HERE.parents[1] / "shared" / "data"))
SERIES: Final = DATA / "ur10-landgraf" / "Series_A" / "measurements_grid.csv"
TOOL_Z: Final = 109.0 * MM
SIDE: Final = 200.0 * MM
POINTS: Final = 20
JOINT: Final = 1
COLOURS: Final = ("#1f6f8b", "#b5452c")
OUT: Final = HERE / "_static" / "ur10_transfer_joint2.png"


def main() -> None:
    """Fits, transfers, draws, and prints the numbers."""
    source, target = regions()
    model = fit(preset("UR10"), source, method="gp")
    order = np.random.default_rng(0).permutation(len(target))
    known = target.subset(np.sort(order[:POINTS]))
    carried = fit_transfer(
        preset("UR10"), known, [TransferSource(model=model, relation="region", name="y < -200 mm")]
    )
    rows = carried.in_base(target.subset(np.sort(order[POINTS:])[::3]))
    left, turn = residual(carried, rows)
    angle = rows.joints[:, JOINT] / DEG
    dip = (angle > -108.0) & (angle < -101.0)
    size = np.linalg.norm(left, axis=1) / MM
    deepest = np.flatnonzero(dip)[np.argmax(np.abs(turn[dip]))]
    edge, near = float(source.joints[:, JOINT].min() / DEG), np.sort(known.joints[:, JOINT] / DEG)
    place = np.searchsorted(near, angle[deepest])
    sys.stdout.write(
        f"{len(rows)} rows, mean {size.mean():.4f} mm; joint 2 between -108 and -101 deg: "
        f"{dip.sum()} rows, {size[dip].mean():.4f} mm; elsewhere {size[~dip].mean():.4f} mm\n"
        f"largest turn of joint 2 there: {1e6 * turn[deepest]:.0f} urad at {angle[deepest]:.1f} deg"
        f"; the source ends at {edge:.1f} deg, the target points beside it are at "
        f"{', '.join(f'{a:.1f}' for a in near[max(0, place - 1) : place + 1])} deg\n"
    )
    draw(angle, turn, near, edge)


def regions() -> tuple[MeasurementSet, MeasurementSet]:
    """Returns the rows of both sides, positions only."""
    rows = read_measurements(SERIES)
    tool = np.eye(4)
    tool[2, 3] = TOOL_Z
    y = -forward(preset("UR10").with_tool(tool), rows.joints)[:, 1, 3]
    bare = MeasurementSet(
        joints=rows.joints, position=rows.position, covariance=rows.covariance, frame=rows.frame
    )
    return bare.subset(y < -SIDE), bare.subset(y > SIDE)


def residual(model: ErrorModel, rows: MeasurementSet) -> tuple[np.ndarray, np.ndarray]:
    """Returns measured minus predicted (n, 3) m and the turn of joint 2 (n,) rad nearest to it."""
    predicted = model.predict(Query(joints=rows.joints)).error
    left = rows.position - forward(model.robot, rows.joints)[:, :3, 3] - predicted
    lever = drive_jacobian(model.robot, walk(model.robot, rows.joints))[:, :3, JOINT]
    return left, (lever * left).sum(axis=1) / (lever**2).sum(axis=1)


def draw(angle: np.ndarray, turn: np.ndarray, known: np.ndarray, edge: float) -> None:
    """Writes the picture."""
    mpl.rcParams.update({"font.family": "DejaVu Sans", "font.size": 10})
    figure, axis = plt.subplots(figsize=(9.6, 3.4), layout="constrained")
    shown = angle < edge + 40.0
    axis.plot(angle[shown], 1e6 * turn[shown], ".", markersize=2, color=COLOURS[0])
    near = known[known < edge + 40.0]
    axis.plot(near, np.full(len(near), 420.0), "v", color=COLOURS[1], label="target points")
    axis.axvspan(edge, edge + 40.0, color="0.92", label="joint 2 seen by the source")
    axis.set_xlabel("joint 2 in deg")
    axis.set_ylabel("turn of joint 2 left, in urad")
    axis.legend(loc="lower left", frameon=False)
    figure.suptitle("Measured UR10 after a transfer with 20 target points: what is left", size=11)
    OUT.parent.mkdir(exist_ok=True)
    figure.savefig(OUT, dpi=140, metadata={"Software": None})


if __name__ == "__main__":
    main()
