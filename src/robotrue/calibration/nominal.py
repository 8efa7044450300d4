"""The unmeasured arm: its controller's kinematics, and the typical errors of its type."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from robotrue.calibration.archive import robot_arrays, robot_document, robot_from
from robotrue.calibration.belief import Belief
from robotrue.calibration.calibrated_model import model_of
from robotrue.calibration.model import Prediction, Query, UnconditionalModel
from robotrue.calibration.settings import FitSettings, prior_belief
from robotrue.calibration.terms.term import MeanTables, rigid_tables
from robotrue.calibration.training_summary import TrainingSummary
from robotrue.core.archive import Archive, archive_reader
from robotrue.core.arrays import Array
from robotrue.core.document_decoder import decode
from robotrue.robot.model import RobotModel

KIND: Final = "error-model/nominal"
SCHEMA: Final = 1


@dataclass(frozen=True, slots=True, kw_only=True, weakref_slot=True)
class NominalModel(UnconditionalModel):
    """An error model that corrects nothing: the nominal arm, with the priors of its type.

    Attributes:
        robot: The nominal arm and its tool.
        settings: Priors and repeatability; they decide the covariance alone.
    """

    robot: RobotModel
    settings: FitSettings = field(default_factory=FitSettings)

    def __post_init__(self) -> None:
        """Drops errors the robot may carry."""
        object.__setattr__(self, "robot", self.robot.nominal())

    @property
    def calibrated(self) -> bool:
        """False: it was not measured."""
        return False

    def belief(self) -> Belief:
        """Returns the priors of a fit, the base held."""
        return prior_belief(self.robot, self.settings)

    def predict(self, query: Query) -> Prediction:
        """Returns an error of zero, with the covariance of an arm of this type.

        Raises:
            ShapeError: Joints of another robot.
        """
        typical = model_of(self.belief(), {}).predict(query)
        return Prediction(
            error=0.0 * typical.error,
            rotation_error=0.0 * typical.rotation_error,
            covariance=typical.covariance,
        )

    def joint_covariance(self, query: Query) -> Array:
        """Returns the covariance (3n, 3n) m^2 of the errors of all rows together.

        Raises:
            ShapeError: Joints of another robot.
        """
        return model_of(self.belief(), {}).joint_covariance(query)

    def mean_tables(self) -> MeanTables | None:
        """Returns the nominal chain."""
        return rigid_tables(self.robot)

    def training_summary(self) -> TrainingSummary:
        """Returns a summary without rows, and a warning that states it."""
        return TrainingSummary(
            {
                "method": "none",
                "rows": 0,
                "verdict": "conditional",
                "doubts": ["no measurements: the nominal arm, and the priors of its type."],
            }
        )

    def to_archive(self) -> Archive:
        """Returns the arm; priors are those of the program that opens it."""
        return Archive(
            kind=KIND,
            schema=SCHEMA,
            document={
                "robot": robot_document(self.robot),
                "repeatability": self.settings.repeatability,
            },
            arrays=robot_arrays(self.robot),
        )


@archive_reader
def from_archive(archive: Archive) -> NominalModel:
    """Returns the nominal arm in an archive.

    Raises:
        ArchiveError: Another kind, a newer schema, or parts that are missing or cannot be.
    """
    archive.expect(KIND, SCHEMA)
    repeatability = decode(float, archive.document["repeatability"], key="repeatability")
    return NominalModel(
        robot=robot_from(archive), settings=FitSettings(repeatability=repeatability)
    )
