"""The identity of a model: of a calibration everything it holds, of a nominal arm its geometry."""

from __future__ import annotations

from robotrue.calibration.lineage import model_hash
from robotrue.calibration.model import ErrorModel
from robotrue.core.identity import ModelIdentity
from robotrue.robot.identity import nominal_identity


def identity_of(model: ErrorModel) -> ModelIdentity:
    """Returns which description of the arm this is.

    Everything in an error model's archive counts; the cell in its file does not. A nominal arm is
    its geometry.
    """
    if not model.calibrated:
        return nominal_identity(model.robot)
    return ModelIdentity(kind="calibrated", robot=model.robot.name, sha256=model_hash(model))
