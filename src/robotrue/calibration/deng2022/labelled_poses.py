"""Poses and their errors, the paper's D = {x, y}."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from robotrue.calibration.deng2022.domains import pose_features
from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.errors import ModelMismatchError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel


@dataclass(frozen=True, slots=True, kw_only=True)
class Labelled(Columns):
    """Poses and their errors: the paper's D = {x, y}.

    Attributes:
        features: (n, 6) m and rad.
        errors: (n, 3) m, measured minus commanded, base.
        covariance: (n, 3, 3) m^2 of the measurement.
    """

    features: Annotated[Array, Column("n 6", unit="m, rad")]
    errors: Annotated[Array, Column("n 3", unit="m")]
    covariance: Annotated[Array, Column("n 3 3", unit="m^2")]


def label_poses(robot: RobotModel, measurements: MeasurementSet, reference: Array) -> Labelled:
    """Returns poses and errors of a set in base.

    Args:
        robot: Nominal arm whose tool is the measured point.
        measurements: In base.
        reference: (3,) rad, A, B, C near which attitudes are read.

    Raises:
        ModelMismatchError: Another number of joints, or a set in a tracker frame.
    """
    if measurements.dof != robot.dof:
        raise ModelMismatchError(
            f"the measurements have {measurements.dof} joints, {robot.name} has {robot.dof}."
        )
    if measurements.frame != "base":
        raise ModelMismatchError(
            "the measurements are in a tracker frame; the paper's method has no registration.",
            hint="register the tracker to the base first.",
        )
    poses = forward(robot.nominal(), measurements.joints)
    return Labelled(
        features=pose_features(poses, reference),
        errors=measurements.position - poses[:, :3, 3],
        covariance=measurements.covariance,
    )
