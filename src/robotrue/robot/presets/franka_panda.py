"""Franka Emika Panda, seven joints.

Geometry: modified DH as Franka prints it ("Robot and interface specifications", Denavit-Hartenberg
parameters); the flange is that of the table, 107 mm past joint 7. The hand is mounted turned by
-45 deg about z. Research 3 has the same lengths and other limits. Limits: the same page. Read
2026-11.

Link masses and centres of mass: Gaz et al. 2019, "Dynamic identification of the Franka Emika Panda
robot with retrieval of feasible parameters", as in the maker's ``franka_description`` (Apache-2.0,
numbers only); **identified** from joint torques, single masses are not those of the parts. That of
link 7 is moved to the flange frame.
"""

from __future__ import annotations

import numpy as np

from robotrue.core.units import DEG, MM
from robotrue.robot.model import RobotModel


def robot() -> RobotModel:
    """Returns the nominal arm, flange without tool."""
    return RobotModel(
        name="Franka Panda",
        convention="mdh",
        theta=np.zeros(7),
        alpha=np.array([0.0, -90.0, 90.0, 90.0, -90.0, 90.0, 90.0]) * DEG,
        d=np.array([333.0, 0.0, 316.0, 0.0, 384.0, 0.0, 107.0]) * MM,
        a=np.array([0.0, 0.0, 0.0, 82.5, -82.5, 0.0, 88.0]) * MM,
        limits=np.array(
            [
                [-2.8973, 2.8973],
                [-1.7628, 1.7628],
                [-2.8973, 2.8973],
                [-3.0718, -0.0698],
                [-2.8973, 2.8973],
                [-0.0175, 3.7525],
                [-2.8973, 2.8973],
            ]
        ),
        link_mass=np.array([4.970684, 0.646926, 3.228604, 3.587895, 1.225946, 1.666555, 0.735522]),
        link_com=np.array(
            [
                [3.875, 2.081, -47.62],
                [-3.141, -28.72, 3.495],
                [27.518, 39.252, -66.502],
                [-53.17, 104.419, 27.454],
                [-11.953, 41.065, -38.437],
                [60.149, -14.117, -10.517],
                [10.517, -4.252, -45.403],
            ]
        )
        * MM,
        maker="franka",
    )
