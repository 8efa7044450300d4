"""ABB IRB 120-3/0.6.

Geometry, limits, masses and centres of mass: ros-industrial ``abb``, ``irb120_3_58_macro.xacro``
(Apache-2.0 and BSD, numbers only), read 2026-11; centres of mass moved from its link frames to the
DH frames.
"""

from __future__ import annotations

import numpy as np

from robotrue.core.units import DEG, MM
from robotrue.robot.model import RobotModel


def robot() -> RobotModel:
    """Returns the nominal arm, flange without tool."""
    return RobotModel(
        name="ABB IRB 120-3/0.6",
        convention="dh",
        theta=np.array([0.0, -90.0, 0.0, 0.0, 0.0, 180.0]) * DEG,
        alpha=np.array([-90.0, 0.0, -90.0, 90.0, -90.0, 0.0]) * DEG,
        d=np.array([290.0, 0.0, 0.0, 302.0, 0.0, 72.0]) * MM,
        a=np.array([0.0, 270.0, 70.0, 0.0, 0.0, 0.0]) * MM,
        limits=np.array(
            [[-165, 165], [-110, 110], [-110, 70], [-160, 160], [-120, 120], [-400, 400]]
        )
        * DEG,
        link_mass=np.array([3.067, 3.909, 2.944, 1.328, 0.546, 0.137]),
        link_com=np.array(
            [
                [0.0977, 51.59, -0.12],
                [-168.76, 0.78, -2.12],
                [-12.09, -1.06, 22.81],
                [0.41, -77.3, 0.15],
                [0.0622, -0.0368, -1.09],
                [0.00132, -0.17, -7.06],
            ]
        )
        * MM,
        maker="abb",
    )
