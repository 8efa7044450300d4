"""The identity of a nominal arm: its geometry, whatever file it came from."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.files import sha256
from robotrue.core.identity import ModelIdentity
from robotrue.robot.model import RobotModel

DIGITS: Final = 9
"""Decimals of m and rad that count; a table written in mm and deg and read again is the same."""


def nominal_identity(robot: RobotModel) -> ModelIdentity:
    """Returns the identity of the arm as its controller computes it.

    Convention, DH table, joint coupling and the sense of the joints count; tool, limits, masses and
    identified errors do not: they may differ between touching and machining.
    """
    parts = [robot.convention.encode()]
    for name in ("theta", "d", "a", "alpha", "joint_map"):
        # A rounded -0.0 is 0.0.
        values = np.round(np.asarray(getattr(robot, name), dtype=np.float64), DIGITS) + 0.0
        parts.append(name.encode() + values.tobytes())
    return ModelIdentity(kind="nominal", robot=robot.name, sha256=sha256(b"\0".join(parts)))
