"""ABB IRB 6660-205/1.9, a press-tending arm with a parallel rod.

Geometry and limits: ros-industrial ``abb_experimental``, ``irb6660_205_190_macro.xacro`` (numbers
only), read 2026-11. That file is serial; the real arm drives the forearm through a rod, so ABB's q3
is the **absolute** pitch of the forearm and the serial angle is q3 - q2. With it the printed joints
of a straight machining pass lie on a line to 0.02 mm (tests/truths); without it they miss by
0.33 mm.

Link masses: none published; zeros.
"""

from __future__ import annotations

import numpy as np

from robotrue.core.units import DEG, MM
from robotrue.robot.model import RobotModel


def robot() -> RobotModel:
    """Returns the nominal arm, flange without tool."""
    rod = np.eye(6)
    rod[2, 1] = -1.0
    return RobotModel(
        name="ABB IRB 6660-205/1.9",
        convention="dh",
        theta=np.array([0.0, -90.0, 0.0, 0.0, 0.0, 180.0]) * DEG,
        alpha=np.array([-90.0, 0.0, -90.0, 90.0, -90.0, 0.0]) * DEG,
        d=np.array([814.5, 0.0, 0.0, 893.0, 0.0, 200.0]) * MM,
        a=np.array([300.0, 700.0, 280.0, 0.0, 0.0, 0.0]) * MM,
        joint_map=rod,
        limits=np.array([[-180, 180], [-42, 85], [-20, 120], [-300, 300], [-120, 120], [-360, 360]])
        * DEG,
        maker="abb",
    )
