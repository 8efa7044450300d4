"""The joined model of eq. 26: one expert for the source domain, one for the target domain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from robotrue.calibration.archive import robot_arrays, robot_document, robot_from
from robotrue.calibration.belief import Belief
from robotrue.calibration.deng2022.committee import Committee, restore_committee
from robotrue.calibration.deng2022.domains import LEVER, Labelled, pose_features
from robotrue.calibration.deng2022.readings import Outside
from robotrue.calibration.model import Prediction, Query, UnconditionalModel, describe_rows
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.terms.term import MeanTables
from robotrue.calibration.training_summary import TrainingSummary
from robotrue.core.archive import Archive, archive_reader
from robotrue.core.archive_tables import pack_table
from robotrue.core.arrays import Array, IntArray, frozen
from robotrue.core.document_decoder import decode
from robotrue.core.regions import CylinderRegion, contains, coordinates_of
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import (
    ArchiveError,
    ConfigurationError,
    ModelMismatchError,
    ReachError,
)
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel

KIND: Final = "error-model/deng2022"
SCHEMA: Final = 2
"""2: with the inflation of each expert; a file of schema 1 has none, which is 1."""
BOUNDARY: Final = 1.0 * MM
"""A pose this far outside a domain, m or the same on a circle of 1 m, still belongs to it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Expert:
    """A committee and the domain it answers for.

    Attributes:
        region: Its domain.
        committee: Predicts there.
        white: m, sd per axis of what a single visit adds to the process, instrument left out.
        inflation: Factor on the variance of both, from held-out rows.
    """

    region: CylinderRegion
    committee: Committee
    white: float
    inflation: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, weakref_slot=True)
class PoseModel(UnconditionalModel):
    """Errors learned on Cartesian poses, eq. 26, by the first expert whose domain holds a pose.

    A model of poses does not depend on joints, loads, approach or tool: it is valid for the
    measured payload and point. Rotation errors are NaN; the paper has none.

    Attributes:
        robot: The nominal arm, with the tool that was measured.
        experts: Target domain first, then the source.
        reference: (3,) rad, A, B, C near which attitudes are read.
        outside: Rule outside all domains: refuse, or use the expert of the nearest.
        summary: JSON values for :meth:`training_summary`.
    """

    robot: RobotModel
    experts: tuple[Expert, ...]
    reference: Array
    outside: Outside
    summary: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Freezes."""
        object.__setattr__(self, "robot", self.robot.nominal())
        object.__setattr__(self, "reference", frozen(self.reference, (3,), "reference"))

    @property
    def calibrated(self) -> bool:
        """True: it comes from measurements."""
        return True

    def belief(self) -> Belief | None:
        """Returns None: a model of poses has no coefficients of the arm."""
        return None

    def joint_covariance(self, query: Query) -> Array:
        """Raises: a model of poses has no covariance between rows.

        Raises:
            ConfigurationError: Always.
        """
        raise ConfigurationError(
            "a PoseModel keeps no joint covariance of its predictions.",
            hint="calibrate with a method of `robotrue calibrate`.",
        )

    def predict(self, query: Query) -> Prediction:
        """Returns mean and covariance of the error at every query row, base frame.

        Load and approach of the query do not enter.

        Raises:
            ShapeError: Joints of another robot.
            ModelMismatchError: A tool point that was not measured.
            ReachError: A pose outside every domain, where that is refused.
        """
        joints = query.expand(self.robot.dof).joints
        self._check_tool(query.T_flange_tool)
        features = pose_features(forward(self.robot, joints), self.reference)
        n = len(joints)
        error, covariance = np.zeros((n, 3)), np.zeros((n, 3, 3))
        speaks = self.speaker(features)
        for k, expert in enumerate(self.experts):
            rows = np.flatnonzero(speaks == k)
            if len(rows):
                error[rows], variance = expert.committee.predict(features[rows])
                spread = expert.inflation * (variance + expert.white**2)
                covariance[rows] = spread[:, None, None] * np.eye(3)
        return Prediction(
            error=error, rotation_error=np.full((n, 3), np.nan), covariance=covariance
        )

    def speaker(self, features: Array) -> IntArray:
        """Returns which expert answers for each pose, (n,), from features (n, 6) m and rad.

        Raises:
            ReachError: A pose outside every domain, where that is refused.
        """
        points = features[:, :3]
        inside = np.stack([contains(e.region, points, slack=BOUNDARY) for e in self.experts])
        speaks: IntArray = np.argmax(inside, axis=0)
        lost = np.flatnonzero(~inside.any(axis=0))
        if not len(lost):
            return speaks
        if self.outside == "raise":
            x, y, z = points[lost[0]] / MM
            raise ReachError(
                f"{len(lost)} of {len(points)} poses lie in none of the measured domains, the "
                f"first at ({x:.1f}, {y:.1f}, {z:.1f}) mm: {self._domains()}.",
                hint="measure a region that holds the job, or outside='nearest'.",
            )
        away = np.stack([_distance(e.region, points[lost]) for e in self.experts])
        speaks[lost] = np.argmin(away, axis=0)
        return speaks

    def mean_tables(self) -> MeanTables | None:
        """Returns None: a model of poses has no tables over joints."""
        return None

    def training_summary(self) -> TrainingSummary:
        """Returns method, data, row counts, verdict and warnings."""
        return TrainingSummary(self.summary)

    def to_archive(self) -> Archive:
        """Returns everything needed to rebuild the model."""
        arrays = {**robot_arrays(self.robot), "reference": self.reference}
        experts = []
        for k, expert in enumerate(self.experts):
            stated, rounds = pack_table(expert.committee, prefix=f"expert{k}/", leave=("learners",))
            arrays |= {**rounds, f"expert{k}/limits": expert.region.limits}
            experts.append({"white": expert.white, "inflation": expert.inflation, **stated})
        return Archive(
            kind=KIND,
            schema=SCHEMA,
            document={
                "robot": robot_document(self.robot),
                "experts": experts,
                "outside": self.outside,
                "summary": dict(self.summary),
            },
            arrays=arrays,
        )

    def _check_tool(self, T_flange_tool: Array | None) -> None:
        if T_flange_tool is None:
            return
        away = np.linalg.norm(T_flange_tool[:3, 3] - self.robot.T_flange_tool[:3, 3])
        if away > UM:
            raise ModelMismatchError(
                f"the tool point is {away / MM:.3f} mm from the measured point; a model of poses "
                "does not predict the error at another point.",
                hint="measure with the reflector at the tool point.",
            )

    def _domains(self) -> str:
        return "; ".join(
            f"angle {e.region.angle[0] / DEG:.0f} to {e.region.angle[1] / DEG:.0f} deg, "
            f"radius {e.region.radius[0] / MM:.0f} to {e.region.radius[1] / MM:.0f} mm, "
            f"height {e.region.height[0] / MM:.0f} to {e.region.height[1] / MM:.0f} mm"
            for e in self.experts
        )


@archive_reader
def from_archive(archive: Archive) -> PoseModel:
    """Returns the model in an archive.

    Raises:
        ArchiveError: Another kind, a newer schema, or parts that are missing or cannot be.
    """
    archive.expect(KIND, SCHEMA)
    for name in archive.arrays:
        archive.array(name)
    document = archive.document
    experts = []
    for k, stated in enumerate(decode(list[dict[str, object]], document["experts"], key="experts")):
        angle, radius, height = archive.array(f"expert{k}/limits").tolist()
        experts.append(
            Expert(
                region=CylinderRegion(angle=angle, radius=radius, height=height),
                committee=restore_committee(archive, stated, f"expert{k}/"),
                white=_white(stated["white"]),
                inflation=_inflation(stated.get("inflation", 1.0)),
            )
        )
    return PoseModel(
        robot=robot_from(archive),
        experts=tuple(experts),
        reference=archive.array("reference"),
        outside="nearest" if document["outside"] == "nearest" else "raise",
        summary=decode(dict[str, object], document["summary"], key="summary"),
    )


def _white(stated: object) -> float:
    """A standard deviation in m, of a file."""
    value = decode(float, stated, key="white")
    if not 0.0 <= value < 1.0:
        raise ArchiveError(f"a white noise of {value:g} m.")
    return value


def _inflation(stated: object) -> float:
    """A factor on a variance, of a file."""
    value = decode(float, stated, key="inflation")
    if not 0.0 < value < np.inf:
        raise ArchiveError(f"an inflation of the variance of {value:g}.")
    return value


def _distance(region: CylinderRegion, points: Array) -> Array:
    """Distance (n,) m from a region, angles times :data:`LEVER`."""
    low, high = region.limits.T
    values = coordinates_of(region, points)
    out: Array = np.maximum(np.maximum(low - values, values - high), 0.0)
    return np.asarray(np.linalg.norm(out * np.array([LEVER, 1.0, 1.0]), axis=1))


def expert_of(
    region: CylinderRegion, committee: Committee, rows: Labelled, settings: FitSettings
) -> Expert:
    """Returns the expert of a region; its noise is the learned one without the instrument's.

    That is repeatability and what no pose explains.
    """
    instrument = float(np.mean(np.trace(rows.covariance, axis1=1, axis2=2)) / 3.0)
    left = (committee.noise * MM) ** 2 - instrument
    white = float(np.sqrt(max(left, settings.repeatability_sd**2)))
    return Expert(region=region, committee=committee, white=white)


def pose_summary(
    rows: MeasurementSet,
    method: str,
    *,
    inside: str = ", and only inside its domains",
    doubts: Sequence[str] = (),
) -> dict[str, object]:
    """Returns the JSON values of a model of poses; lengths are SI like everything in an archive.

    Args:
        rows: All rows it was fitted to.
        method: Its name.
        inside: Its domain, the end of the warning.
        doubts: That come before it.
    """
    return {
        "method": method,
        **describe_rows(rows),
        "screened_rows": [],
        "verdict": "conditional",
        "doubts": [
            *doubts,
            "A model of poses: it is valid for the measured payload, tool point and arm "
            f"configuration{inside}.",
        ],
    }
