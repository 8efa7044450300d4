"""Yaskawa GP225.

Geometry and limits: ros-industrial ``motoman``, ``gp225_macro.xacro`` (BSD, numbers only), read
2026-11; the turning parts that file couples to joint 2 are the balancer, not the arm. The base
frame is the controller's own, at the height of axis 2, 650 mm above the floor. Link masses: none
published; zeros.
"""

from __future__ import annotations

import numpy as np

from robotrue.core.units import DEG, MM
from robotrue.robot.model import RobotModel


def robot() -> RobotModel:
    """Returns the nominal arm, flange without tool."""
    return RobotModel(
        name="Yaskawa GP225",
        convention="dh",
        theta=np.array([0.0, -90.0, 0.0, 0.0, 0.0, 0.0]) * DEG,
        alpha=np.array([-90.0, 180.0, -90.0, 90.0, -90.0, 180.0]) * DEG,
        d=np.array([0.0, 0.0, 0.0, -1225.0, 0.0, -250.0]) * MM,
        a=np.array([325.0, 1150.0, 300.0, 0.0, 0.0, 0.0]) * MM,
        limits=np.array([[-180, 180], [-60, 76], [-86, 90], [-360, 360], [-125, 125], [-360, 360]])
        * DEG,
        maker="yaskawa",
    )
