"""Universal Robots UR10 (CB series).

Geometry: standard DH as Universal Robots prints it ("DH parameters for calculations of kinematics
and dynamics") and as the measured data sets of this package use it. The CB3 manual prints an older
series (d1 118, a2 -612.7, a3 -571.6 mm): check which one stands in the cell. The base frame is the
controller's own; ROS turns it by 180 deg about z. Limits: +-360 deg each. Read 2026-11.

Link masses and centres of mass: the same article, in the DH frames; the centres were read there,
the masses of this series are from memory.
"""

from __future__ import annotations

import numpy as np

from robotrue.core.units import DEG, MM
from robotrue.robot.model import RobotModel


def robot() -> RobotModel:
    """Returns the nominal arm, flange without tool."""
    return RobotModel(
        name="UR10",
        convention="dh",
        theta=np.zeros(6),
        alpha=np.array([90.0, 0.0, 0.0, 90.0, -90.0, 0.0]) * DEG,
        d=np.array([127.3, 0.0, 0.0, 163.941, 115.7, 92.2]) * MM,
        a=np.array([0.0, -612.0, -572.3, 0.0, 0.0, 0.0]) * MM,
        limits=np.tile([-360.0, 360.0], (6, 1)) * DEG,
        link_mass=np.array([7.1, 12.7, 4.27, 2.0, 2.0, 0.365]),
        link_com=np.array(
            [
                [21.0, 0.0, 27.0],
                [380.0, 0.0, 158.0],
                [240.0, 0.0, 68.0],
                [0.0, 7.0, 18.0],
                [0.0, 7.0, 18.0],
                [0.0, 0.0, -26.0],
            ]
        )
        * MM,
        maker="ur",
    )
