"""The identity of an error model, and of no error model: the nominal arm."""

from __future__ import annotations

from robotrue.calibration.lineage import model_hash
from robotrue.calibration.model import ErrorModel
from robotrue.core.identity import ModelIdentity
from robotrue.robot.identity import nominal_identity
from robotrue.robot.model import RobotModel


def identity_of(model: ErrorModel | RobotModel) -> ModelIdentity:
    """Returns which description of the arm this is.

    Everything in an error model's archive counts; the cell in its file does not. A robot is its
    nominal geometry.
    """
    if isinstance(model, RobotModel):
        return nominal_identity(model)
    return ModelIdentity(kind="calibrated", robot=model.robot.name, sha256=model_hash(model))
