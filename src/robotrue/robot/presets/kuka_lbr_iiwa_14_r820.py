"""KUKA LBR iiwa 14 R820, seven joints.

Geometry: standard DH with the lengths of KUKA's data sheet (360, 420, 400 mm) and the plain flange
(126 mm past the wrist point); a media flange is longer and belongs into the tool. Joints are the
controller's own. Limits: the same sheet. Read 2026-11.

Link masses and centres of mass: Drake's ``iiwa14`` (BSD-3, numbers only), moved to the DH frames.
KUKA prints none. Public sets differ by half for single links; this one adds up to the weight of the
arm (29.9 kg with its base).
"""

from __future__ import annotations

import numpy as np

from robotrue.core.units import DEG, MM
from robotrue.robot.model import RobotModel


def robot() -> RobotModel:
    """Returns the nominal arm, flange without tool."""
    most = np.array([170.0, 120.0, 170.0, 120.0, 170.0, 120.0, 175.0])
    return RobotModel(
        name="KUKA LBR iiwa 14 R820",
        convention="dh",
        theta=np.zeros(7),
        alpha=np.array([-90.0, 90.0, 90.0, -90.0, -90.0, 90.0, 0.0]) * DEG,
        d=np.array([360.0, 0.0, 420.0, 0.0, 400.0, 0.0, 126.0]) * MM,
        a=np.zeros(7),
        limits=np.stack([-most, most], axis=1) * DEG,
        link_mass=np.array([5.76, 6.35, 3.5, 3.5, 3.5, 1.8, 1.2]),
        link_com=np.array(
            [
                [0.0, 82.5, -30.0],
                [-0.3, 42.0, 59.0],
                [0.0, -85.5, -30.0],
                [0.0, -34.0, 67.0],
                [-0.1, 139.5, -21.0],
                [0.0, 0.4, 0.6],
                [0.0, 0.0, -25.0],
            ]
        )
        * MM,
        maker="kuka",
    )
