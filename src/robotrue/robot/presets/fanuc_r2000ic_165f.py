"""Fanuc R-2000iC/165F.

Geometry and limits: ros-industrial ``fanuc``, ``r2000ic165f_macro.xacro`` (BSD, numbers only), read
2026-11. That file is serial; Fanuc's J3 is the angle of the forearm to the horizontal and stays
while J2 turns, so J3 = q3 - q2. The base frame
is the controller's own, at the height of J2, 670 mm above the floor; the flange is the zero tool
frame. Link masses: none published; zeros.
"""

from __future__ import annotations

import numpy as np

from robotrue.core.units import DEG, MM
from robotrue.robot.makers import FROM_HORIZONTAL
from robotrue.robot.model import Configuration, RobotModel


def robot() -> RobotModel:
    """Returns the nominal arm, flange without tool."""
    return RobotModel(
        name="Fanuc R-2000iC/165F",
        convention="dh",
        theta=np.array([0.0, -90.0, 0.0, 0.0, 0.0, 0.0]) * DEG,
        alpha=np.array([-90.0, 180.0, -90.0, 90.0, -90.0, 180.0]) * DEG,
        d=np.array([0.0, 0.0, 0.0, -1280.0, 0.0, -215.0]) * MM,
        a=np.array([312.0, 1075.0, 225.0, 0.0, 0.0, 0.0]) * MM,
        limits=np.array(
            [[-185, 185], [-60, 76], [-132, 180], [-360, 360], [-125, 125], [-360, 360]]
        )
        * DEG,
        controller=Configuration(sign=np.ones(6), offset=np.zeros(6), coupling=FROM_HORIZONTAL),
        maker="fanuc",
    )
