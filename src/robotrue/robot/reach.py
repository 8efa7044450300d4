"""How far an arm's wrist gets from its first axis, within its joint limits."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.robot.forward import walk
from robotrue.robot.model import RobotModel

STEPS: Final = 91
"""Postures of shoulder and of elbow that are tried."""


def wrist_reach(robot: RobotModel) -> float:
    """Returns the largest distance in m of the wrist from the first axis, to about 0.1 %.

    The wrist is where the last axis but one lies; shoulder and elbow are the axes that move it in a
    plane. :attr:`RobotModel.reach` is a bound that no posture exceeds, tool included.
    """
    elbow = 2 if robot.dof < 7 else 3
    low, high = robot.limits[:, 0], robot.limits[:, 1]
    low, high = np.where(np.isfinite(low), low, -np.pi), np.where(np.isfinite(high), high, np.pi)
    joints = np.zeros((STEPS, STEPS, robot.dof))
    joints[..., 1] = np.linspace(low[1], high[1], STEPS)[:, None]
    joints[..., elbow] = np.linspace(low[elbow], high[elbow], STEPS)[None]
    wrist = walk(robot.nominal(), joints.reshape(-1, robot.dof)).joint_origin[:, -2]
    return float(np.hypot(wrist[:, 0], wrist[:, 1]).max())
