"""The contract between everything that learns a robot's error and everything that uses it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from robotrue.calibration.belief import Belief
from robotrue.calibration.mean_tables import MeanTables
from robotrue.calibration.training_summary import TrainingSummary
from robotrue.core.archive import Archive
from robotrue.core.arrays import Array
from robotrue.core.conditions import ArmConditions, no_conditions
from robotrue.errors import ConfigurationError, ShapeError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import NO_LOAD, Load


@dataclass(frozen=True, slots=True, kw_only=True)
class Query:
    """Poses and loads at which the error is predicted.

    Attributes:
        joints: (n, dof) rad, commanded.
        load: Payload and wrench, one row or n.
        approach: (n, dof) sign of the last motion of each joint, 0 or empty = unknown.
        conditions: Temperature, time, external axes: one row or n.
        T_flange_tool: (4, 4) tool point asked about; None is the point that was measured.
    """

    joints: Array
    load: Load = NO_LOAD
    approach: Array = field(default_factory=lambda: np.empty(0))
    conditions: ArmConditions = field(default_factory=no_conditions)
    T_flange_tool: Array | None = None

    def expand(self, dof: int) -> Query:
        """Returns the query with joints, approach and conditions of one row each.

        Raises:
            ShapeError: Joints, approach or conditions of another shape.
        """
        joints = np.asarray(self.joints, dtype=np.float64)
        if joints.ndim != 2 or joints.shape[1] != dof:
            raise ShapeError(f"joints has shape {joints.shape}, expected (any, {dof}).")
        approach = np.zeros_like(joints) if np.size(self.approach) == 0 else self.approach
        if approach.shape != joints.shape:
            raise ShapeError(f"approach has shape {approach.shape}, expected {joints.shape}.")
        conditions = self.conditions.spread(len(joints))
        return replace(self, joints=joints, approach=approach, conditions=conditions)


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """Error = actual minus commanded, in the base frame.

    Attributes:
        error: (n, 3) m, of the tool point.
        rotation_error: (n, 3) rad, left rotation vector; NaN where the model cannot know.
        covariance: (n, 3, 3) m^2 of the *actual* position about its prediction at one visit:
            parameters, learned residual and repeatability, without the instrument.
    """

    error: Array
    rotation_error: Array
    covariance: Array


class ErrorModel(Protocol):
    """Contract of a calibration, the only one that compensation, validation and online use."""

    @property
    def robot(self) -> RobotModel:
        """The nominal robot, as the controller computes it, with the tool that was measured."""
        ...

    @property
    def calibrated(self) -> bool:
        """True if fitted to measurements; False for the arm as the controller computes it."""
        ...

    def predict(self, query: Query) -> Prediction:
        """Returns mean and covariance of the error at every query row."""
        ...

    def belief(self) -> Belief | None:
        """Returns the joint posterior of its coefficients; None if it keeps none."""
        ...

    def joint_covariance(self, query: Query) -> Array:
        """Returns the covariance (3n, 3n) m^2 of the errors of all rows together.

        Raises:
            ConfigurationError: A model without :meth:`belief`.
        """
        ...

    def mean_tables(self) -> MeanTables | None:
        """Returns the mean as flat tables for fast inversion; None if it has no such form."""
        ...

    def in_base(self, measurements: MeasurementSet) -> MeasurementSet:
        """Returns the set with its positions in base, by the station the model estimated.

        Sets already in base come back as they are.

        Raises:
            ModelMismatchError: The set comes from a station the model has never seen.
        """
        ...

    def at_reflector(self, number: int) -> ErrorModel:
        """Returns the model of one of the reflectors it was made of; 0 is the model itself.

        Raises:
            ModelMismatchError: A reflector the model has never seen.
        """
        ...

    def training_summary(self) -> TrainingSummary:
        """Returns method, data hash, row counts, region, held-out result, warnings."""
        ...

    def to_archive(self) -> Archive:
        """Returns everything needed to rebuild the model."""
        ...


def require_belief(model: ErrorModel) -> Belief:
    """Returns the joint posterior of a model's coefficients.

    Raises:
        ConfigurationError: A model that keeps none.
    """
    belief = model.belief()
    if belief is None:
        raise ConfigurationError(
            f"a {type(model).__name__} has no covariance to which new measurements could be added.",
            hint="calibrate with a method of robotrue.calibration.methods.",
        )
    return belief
