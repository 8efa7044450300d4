"""The rigid-flexible error model: identified geometry and joint compliance, with their covariance.

    error = forward(actual, loaded) - forward(nominal),  covariance = J S J^T + (r^2 + w^2) I

with S the posterior covariance of the errors, r the repeatability and w the white noise the data
asked for beyond it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from robotrue.calibration.archive import check_pose, robot_arrays, robot_document, robot_from
from robotrue.calibration.arm import linearise_arm
from robotrue.calibration.belief import Belief, standard_terms
from robotrue.calibration.model import Prediction, Query
from robotrue.calibration.stations import take_to_base
from robotrue.calibration.tables import MeanTables, rigid_tables
from robotrue.calibration.training_summary import TrainingSummary
from robotrue.core.archive import Archive, archive_reader
from robotrue.core.arrays import Array, frozen
from robotrue.errors import ArchiveError, ModelMismatchError, ShapeError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.statics import NO_LOAD, Load

KIND: Final = "error-model/rigid-flexible"
SCHEMA: Final = 1
_ROWS: Final = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Reflector:
    """A further reflector on the flange, as identified beside the robot's own tool.

    Attributes:
        T_flange_tool: (4, 4) where it is.
        covariance: (7 dof + 12, 7 dof + 12) of the robot errors, its place in that of the tool.
    """

    T_flange_tool: Array
    covariance: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidFlexibleModel:
    """Geometry and compliance of one arm, as identified.

    Attributes:
        robot: The nominal arm, with the tool that was measured.
        errors: (7 dof + 12,) SI, identified.
        covariance: (7 dof + 12, 7 dof + 12) of ``errors``.
        repeatability: m, sd per axis of one visit.
        white: m, sd per axis of the white noise learned beyond instrument and repeatability.
        T_tracker_base: (4, 4) of every tracker set-up that was estimated.
        reflectors: Further reflectors by number; 0 is the robot's own tool.
        summary: JSON values for :meth:`training_summary`.
    """

    robot: RobotModel
    errors: Array
    covariance: Array
    repeatability: float
    white: float
    T_tracker_base: Mapping[int, Array] = field(default_factory=dict)
    reflectors: Mapping[int, Reflector] = field(default_factory=dict)
    summary: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Checks shapes and freezes."""
        size = len(self.robot.errors)
        object.__setattr__(self, "robot", self.robot.nominal())
        object.__setattr__(self, "errors", frozen(self.errors, (size,), "errors"))
        object.__setattr__(self, "covariance", frozen(self.covariance, (size, size), "covariance"))

    @property
    def calibrated(self) -> bool:
        """True: it comes from measurements."""
        return True

    @property
    def actual(self) -> RobotModel:
        """The arm with its identified errors and the measured tool."""
        return self.robot.with_errors(self.errors)

    def belief(self) -> Belief:
        """Returns the posterior of the errors; backlash, never learned, is zero and certain."""
        dof = self.robot.dof
        values, vectors = np.linalg.eigh(self.covariance)
        seen = values > 1e-16 * values[-1]
        part = np.sqrt(values[seen])[:, None] * vectors[:, seen].T
        return Belief(
            robot=self.robot,
            terms=standard_terms(dof),
            mean=np.concatenate([self.errors, np.zeros(dof)]),
            root=np.hstack([part, np.zeros((len(part), dof))]),
            white=self.white,
            repeatability=self.repeatability,
            inflation=1.0,
            T_tracker_base=self.T_tracker_base,
        )

    def predict(self, query: Query) -> Prediction:
        """Returns mean and covariance of the error at every query row, base frame.

        With another tool in the query the errors of the measured one, and their covariance, do not
        apply; what is left is the error of the arm at that tool point.

        Raises:
            ShapeError: Joints of another robot.
        """
        joints = np.asarray(query.joints, dtype=np.float64)
        if joints.ndim != 2 or joints.shape[1] != self.robot.dof:
            raise ShapeError(f"joints has shape {joints.shape}, expected (any, {self.robot.dof}).")
        n = len(joints)
        error, turn, covariance = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3, 3))
        for start in range(0, n, _ROWS):
            part = slice(start, start + _ROWS)
            at = linearise_arm(
                self.actual, joints[part], query.load.take(part), query.T_flange_tool
            )
            error[part], turn[part] = at.error, at.turn
            turned = np.swapaxes(at.columns, 1, 2)
            covariance[part] = at.columns @ self.covariance @ turned
        noise = (self.repeatability**2 + self.white**2) * np.eye(3)
        return Prediction(error=error, rotation_error=turn, covariance=covariance + noise)

    def joint_covariance(self, query: Query) -> Array:
        """Returns the covariance (3n, 3n) m^2 of the errors of all rows together.

        Its diagonal blocks are those of :meth:`predict`; the others say what rows share.

        Raises:
            ShapeError: Joints of another robot.
        """
        joints = np.asarray(query.joints, dtype=np.float64)
        if joints.ndim != 2 or joints.shape[1] != self.robot.dof:
            raise ShapeError(f"joints has shape {joints.shape}, expected (any, {self.robot.dof}).")
        at = linearise_arm(self.actual, joints, query.load, query.T_flange_tool)
        rows = at.columns.reshape(3 * len(joints), -1)
        white = (self.repeatability**2 + self.white**2) * np.eye(len(rows))
        return np.asarray(rows @ self.covariance @ rows.T + white)

    def mean_tables(self, load: Load = NO_LOAD) -> MeanTables | None:
        """Returns the mean as flat tables; the load enters when they are evaluated."""
        return rigid_tables(self.actual)

    def in_base(self, measurements: MeasurementSet) -> MeasurementSet:
        """Returns the set with positions, orientations and covariances in base.

        Raises:
            ModelMismatchError: A station the model has never seen.
        """
        return take_to_base(measurements, self.T_tracker_base)

    def at_reflector(self, number: int) -> RigidFlexibleModel:
        """Returns the model of a reflector: its place is the tool.

        Raises:
            ModelMismatchError: A reflector the model has never seen.
        """
        if number == 0:
            return self
        if number not in self.reflectors:
            raise unknown_reflector(number, self.reflectors)
        reflector = self.reflectors[number]
        errors = self.errors.copy()
        errors[parameter_slice(self.robot.dof, "tool")] = 0.0
        return replace(
            self,
            robot=self.robot.with_tool(reflector.T_flange_tool),
            errors=errors,
            covariance=reflector.covariance,
            reflectors={},
        )

    def training_summary(self) -> TrainingSummary:
        """Returns method, data, row counts, verdict and warnings."""
        return TrainingSummary(self.summary)

    def to_archive(self) -> Archive:
        """Returns everything needed to rebuild the model, bit for bit."""
        stations, reflectors = sorted(self.T_tracker_base), sorted(self.reflectors)
        return Archive(
            kind=KIND,
            schema=SCHEMA,
            document={
                "robot": robot_document(self.robot),
                "repeatability": self.repeatability,
                "white": self.white,
                "stations": stations,
                **({"reflectors": reflectors} if reflectors else {}),
                "summary": dict(self.summary),
            },
            arrays={
                **robot_arrays(self.robot),
                "errors": self.errors,
                "covariance": self.covariance,
                "T_tracker_base": np.array(
                    [self.T_tracker_base[k] for k in stations], dtype=np.float64
                ).reshape(-1, 4, 4),
                **{f"reflector{k}": self.reflectors[k].T_flange_tool for k in reflectors},
                **{f"reflector{k}_covariance": self.reflectors[k].covariance for k in reflectors},
            },
        )


def reflector_of(T_flange_tool: Array, root: Array, place: Array) -> Reflector:
    """Returns a further reflector from a root of the posterior.

    Args:
        T_flange_tool: (4, 4) where it is.
        root: (p, 7 dof + 12) over the robot errors.
        place: (p, 3) over the reflector's place, along its own axes.
    """
    full = root.copy()
    full[:, -6:-3], full[:, -3:] = place, 0.0  # the tool errors are the last six
    return Reflector(T_flange_tool=T_flange_tool, covariance=full.T @ full)


def unknown_reflector(number: int, known: Iterable[int]) -> ModelMismatchError:
    """Returns the error for rows of a reflector that a model does not know."""
    return ModelMismatchError(
        f"reflector {number} is not in the model, which knows {[0, *sorted(known)]}.",
        hint="calibrate with rows of that reflector, or correct the column target.",
    )


@archive_reader
def from_archive(archive: Archive) -> RigidFlexibleModel:
    """Returns the model in an archive.

    Raises:
        ArchiveError: Another kind, a newer schema, or parts that are missing or cannot be.
    """
    archive.expect(KIND, SCHEMA)
    document = archive.document
    stations = [int(k) for k in document["stations"]]
    T_tracker_base = archive.array("T_tracker_base")
    if T_tracker_base.ndim != 3:
        raise ArchiveError(f"T_tracker_base has shape {T_tracker_base.shape}.")
    check_pose(T_tracker_base, "T_tracker_base")
    errors, covariance = archive.array("errors"), archive.array("covariance")
    _check_posterior(errors, covariance)
    sizes = {name: float(document[name]) for name in ("repeatability", "white")}
    if not all(0.0 <= size < 1.0 for size in sizes.values()):
        raise ArchiveError(f"repeatability and white noise in m are {sizes}.")
    return RigidFlexibleModel(
        robot=robot_from(archive),
        errors=errors,
        covariance=covariance,
        T_tracker_base=dict(zip(stations, T_tracker_base, strict=True)),
        reflectors={int(k): _reflector(archive, int(k)) for k in document.get("reflectors", ())},
        summary=dict(document["summary"]),
        **sizes,
    )


def _check_posterior(errors: Array, covariance: Array) -> None:
    """Refuses what no arm has: metres and radians of error, or a covariance that is none."""
    if not float(np.abs(errors).max(initial=0.0)) <= 10.0:
        raise ArchiveError("errors are not those of an arm.")
    _check_covariance(covariance)


def _check_covariance(covariance: Array) -> None:
    variance = np.diagonal(covariance)
    if not (variance >= 0.0).all() or not (variance <= 100.0).all():
        raise ArchiveError("variances of the errors are not those of an arm.")
    bound = np.sqrt(np.outer(variance, variance)) * (1.0 + 1e-6)
    if not np.allclose(covariance, covariance.T, rtol=1e-6) or (np.abs(covariance) > bound).any():
        raise ArchiveError("the covariance of the errors is none.")


def _reflector(archive: Archive, number: int) -> Reflector:
    T = archive.array(f"reflector{number}")
    check_pose(T, f"reflector{number}")
    covariance = archive.array(f"reflector{number}_covariance")
    _check_covariance(covariance)
    return Reflector(T_flange_tool=T, covariance=covariance)
