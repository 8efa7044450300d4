"""A small arm, measured by a perfect or noisy instrument, and models that know exactly so much."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from robotrue.calibration.model import Prediction, Query, UnconditionalModel
from robotrue.calibration.terms.term import MeanTables
from robotrue.calibration.training_summary import TrainingSummary
from robotrue.core.archive import Archive
from robotrue.core.arrays import Array
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel

SIGMA = 0.05e-3


def arm() -> RobotModel:
    half = np.pi / 2
    return RobotModel(
        name="test arm",
        convention="dh",
        theta=np.zeros(6),
        d=np.array([0.5, 0.0, 0.0, 0.7, 0.0, 0.2]),
        a=np.array([0.25, 0.6, 0.07, 0.0, 0.0, 0.0]),
        alpha=np.array([half, 0.0, half, -half, half, 0.0]),
        T_flange_tool=np.array([[1.0, 0, 0, 0.05], [0, 1, 0, 0.02], [0, 0, 1, 0.1], [0, 0, 0, 1]]),
    )


@dataclass(frozen=True)
class FakeModel(UnconditionalModel):
    """Predicts ``mean(joints)`` with an isotropic sigma."""

    mean: Callable[[Array], Array] = lambda joints: np.zeros((len(joints), 3))
    sigma: float = SIGMA
    robot: RobotModel = field(default_factory=arm)
    summary: Mapping[str, Any] = field(default_factory=dict)
    turn: Array = field(default_factory=lambda: np.full(3, np.nan))

    def predict(self, query: Query) -> Prediction:
        n = len(query.joints)
        return Prediction(
            error=self.mean(query.joints),
            rotation_error=np.tile(self.turn, (n, 1)),
            covariance=np.tile(self.sigma**2 * np.eye(3), (n, 1, 1)),
        )

    @property
    def calibrated(self) -> bool:
        return True

    def belief(self) -> None:
        return None

    def mean_tables(self) -> MeanTables | None:
        return None

    def in_base(self, measurements: MeasurementSet) -> MeasurementSet:
        return measurements

    def training_summary(self) -> TrainingSummary:
        return TrainingSummary(self.summary)

    def to_archive(self) -> Archive:
        return Archive(kind="fake", schema=1, document={}, arrays={})


def measured(
    n: int,
    *,
    seed: int = 0,
    error: Callable[[Array], Array] | None = None,
    instrument: float = 0.0,
    robot: RobotModel | None = None,
    **columns: Any,
) -> MeasurementSet:
    """Poses of the arm (or ``robot``) plus ``error(joints)`` plus noise of the model's sigma."""
    rng = np.random.default_rng(seed)
    joints = rng.uniform(-1.0, 1.0, (n, 6))
    position = forward(arm() if robot is None else robot, joints)[:, :3, 3]
    if error is not None:
        position = position + error(joints)
    total = np.hypot(SIGMA, instrument)
    return MeasurementSet(
        joints=joints,
        position=position + rng.normal(0.0, total, (n, 3)),
        covariance=np.tile(instrument**2 * np.eye(3), (n, 1, 1)),
        **columns,
    )
