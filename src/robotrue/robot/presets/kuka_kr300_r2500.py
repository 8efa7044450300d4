"""KUKA KR300 R2500 ultra, the arm of the two-encoder data set.

Geometry: the QUANTEC ultra series shares base, link arm and elbow (675, 350, 1150 and 41 mm, as
printed for its R2700 in public robot collections, e.g. ARTE "KR90 R2700 pro"); the R2500 has a
forearm 200 mm shorter, which gives the reach in its name. The flange distance of 240 mm is that of
the series' heavy wrist, **from memory, not checked on a data sheet**. Read 2026-11.

Limits: the usual ones of the series, from memory. Link masses: none published in a form that can be
checked, so zeros; gravity sag needs ``mass_kg`` in the cell file.

Joints in the sense of the KR160's table: q = 0 is A = (0, -90, 90, 0, 0, 0) deg.
"""

from __future__ import annotations

import numpy as np

from robotrue.core.units import DEG, MM
from robotrue.robot.model import Configuration, RobotModel


def robot() -> RobotModel:
    """Returns the nominal arm, flange without tool."""
    controller = Configuration(
        sign=-np.ones(6), offset=np.array([0.0, -90.0, 90.0, 0.0, 0.0, 0.0]) * DEG
    )
    axes = np.array(
        [[-185, 185], [-140, -5], [-120, 155], [-350, 350], [-122.5, 122.5], [-350, 350]]
    )
    return RobotModel(
        name="KUKA KR300 R2500",
        convention="dh",
        theta=np.array([0.0, 90.0, -180.0, 0.0, 0.0, 0.0]) * DEG,
        alpha=np.array([90.0, 0.0, -90.0, 90.0, -90.0, 0.0]) * DEG,
        d=np.array([675.0, 0.0, 0.0, 1000.0, 0.0, 240.0]) * MM,
        a=np.array([350.0, 1150.0, 41.0, 0.0, 0.0, 0.0]) * MM,
        limits=np.sort(controller.to_model(axes.T * DEG).T, axis=1),
        controller=controller,
        maker="kuka",
    )
