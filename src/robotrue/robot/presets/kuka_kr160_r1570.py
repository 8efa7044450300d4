"""KUKA KR160 R1570: the machining arm of the transfer-learning paper this package reproduces.

Geometry: Deng et al. 2022, Table 1 (standard DH), joints in the sense of that table: q = 0 is the
upper arm vertical and the forearm horizontal, KUKA's A = (0, -90, 90, 0, 0, 0) deg. Checked against
three postures computed by hand (tests/truths). Read 2026-11.

Link masses and centres of mass are **assumed**: the paper prints none. They are chosen so that its
Tables 1 to 3 give its raw error; the last link is the bare flange, without spindle or tool.

Limits: A1 +-185, A2 -185..65, A3 -138..175, A4 +-350, A5 +-125 and A6 +-350 deg, the usual values
of this series; **assumed**, the paper prints none. Check them against the machine's own.
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
    axes = np.array([[-185, 185], [-185, 65], [-138, 175], [-350, 350], [-125, 125], [-350, 350]])
    return RobotModel(
        name="KUKA KR160 R1570",
        convention="dh",
        theta=np.array([0.0, 90.0, -180.0, 0.0, 0.0, 0.0]) * DEG,
        alpha=np.array([90.0, 0.0, -90.0, 90.0, -90.0, 0.0]) * DEG,
        d=np.array([500.0, 0.0, 0.0, 710.0, 0.0, 215.0]) * MM,
        a=np.array([250.0, 610.0, 70.0, 0.0, 0.0, 0.0]) * MM,
        limits=np.sort(controller.to_model(axes.T * DEG).T, axis=1),
        link_mass=np.array([230.0, 130.0, 170.0, 45.0, 25.0, 15.0]),
        link_com=np.array(
            [
                [-150.0, -120.0, 40.0],
                [-330.0, 0.0, 80.0],
                [-40.0, 20.0, -10.0],
                [0.0, -180.0, 0.0],
                [0.0, 20.0, 30.0],
                [0.0, 0.0, -20.0],
            ]
        )
        * MM,
        controller=controller,
        maker="kuka",
    )
