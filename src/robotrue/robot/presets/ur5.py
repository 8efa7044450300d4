"""Universal Robots UR5 (CB series).

Geometry: standard DH, table "UR5 series 3" of the CB3 manual, appendix C; the targets of the
measured data set of this package agree with it to 0.01 mm. The base frame is the controller's own.
Limits: +-360 deg each. Read 2026-11.

Link masses and centres of mass: Universal Robots, "DH parameters for calculations of kinematics and
dynamics", in the DH frames; the centres were read there, the masses of this series are from memory.
"""

from __future__ import annotations

import numpy as np

from robotrue.core.units import DEG, MM
from robotrue.robot.model import RobotModel


def robot() -> RobotModel:
    """Returns the nominal arm, flange without tool."""
    return RobotModel(
        name="UR5",
        convention="dh",
        theta=np.zeros(6),
        alpha=np.array([90.0, 0.0, 0.0, 90.0, -90.0, 0.0]) * DEG,
        d=np.array([89.159, 0.0, 0.0, 109.15, 94.65, 82.3]) * MM,
        a=np.array([0.0, -425.0, -392.25, 0.0, 0.0, 0.0]) * MM,
        limits=np.tile([-360.0, 360.0], (6, 1)) * DEG,
        link_mass=np.array([3.7, 8.393, 2.275, 1.219, 1.219, 0.1879]),
        link_com=np.array(
            [
                [0.0, -25.61, 1.93],
                [212.5, 0.0, 113.36],
                [150.0, 0.0, 26.5],
                [0.0, -1.8, 16.34],
                [0.0, 1.8, 16.34],
                [0.0, 0.0, -1.159],
            ]
        )
        * MM,
        maker="ur",
    )
