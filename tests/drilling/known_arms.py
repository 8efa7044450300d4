"""A robot whose errors are known exactly, and where it stands to drill."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotrue.calibration.model import ErrorModel, Prediction, Query
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset

TOOL = pose_from_xyz_abc(np.array([120.0, -35.0, 260.0]) * MM, np.array([30.0, 80.0, -15.0]) * DEG)
_KR160 = preset("KR160")
HOME = _KR160.controller.to_model(  # type: ignore[union-attr]
    np.array([10.0, -80.0, 95.0, 20.0, 60.0, -30.0]) * DEG
)
TURNED = np.diag([1.0, -1.0, -1.0])
"""The tool's z points at the skin, the foot's z away from it."""


@dataclass(frozen=True, kw_only=True)
class KnownArm:
    """An error model that knows an arm's errors exactly, with or without its rotation."""

    arm: RobotModel
    turn_known: bool = True

    @property
    def robot(self) -> RobotModel:
        return self.arm.nominal()

    def predict(self, query: Query) -> Prediction:
        true, told = (forward(r, query.joints) for r in (self.arm, self.robot))
        turn = rotation_vector_from_matrix(true[:, :3, :3] @ np.swapaxes(told[:, :3, :3], 1, 2))
        return Prediction(
            error=true[:, :3, 3] - told[:, :3, 3],
            rotation_error=turn if self.turn_known else np.full_like(turn, np.nan),
            covariance=np.zeros((len(true), 3, 3)),
        )


def known_arm(*, turn_known: bool = True) -> ErrorModel:
    robot = preset("KR160").with_tool(TOOL)
    errors = np.random.default_rng(5).normal(0.0, 4e-4, robot.errors.shape)
    errors[6 * robot.dof : 7 * robot.dof] = 0.0
    return KnownArm(arm=robot.with_errors(errors), turn_known=turn_known)  # type: ignore[return-value]
