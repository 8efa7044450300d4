"""Staubli TX2-90L; the wrist point is 50 mm beside the arm's plane.

Geometry and limits: ros-industrial ``staubli_experimental``, ``tx2-90l_macro.xacro`` (Apache-2.0,
numbers only), read 2026-11. The base frame is the controller's own, at the height of axis 2, 478 mm
above the mounting face.

Link masses: zeros. The public file prints some, but its centres of mass are not in its own link
frames (the forearm's lies 50 mm beside the forearm), so they would give wrong torques.
"""

from __future__ import annotations

import numpy as np

from robotrue.core.units import DEG, MM
from robotrue.robot.model import RobotModel


def robot() -> RobotModel:
    """Returns the nominal arm, flange without tool."""
    return RobotModel(
        name="Staubli TX2-90L",
        convention="dh",
        theta=np.array([0.0, -90.0, 90.0, 0.0, 0.0, 0.0]) * DEG,
        alpha=np.array([-90.0, 0.0, 90.0, -90.0, 90.0, 0.0]) * DEG,
        d=np.array([0.0, 50.0, 0.0, 550.0, 0.0, 100.0]) * MM,
        a=np.array([50.0, 500.0, 0.0, 0.0, 0.0, 0.0]) * MM,
        limits=np.array(
            [[-180, 180], [-130, 147.5], [-145, 145], [-270, 270], [-115, 140], [-270, 270]]
        )
        * DEG,
        maker="staubli",
    )
