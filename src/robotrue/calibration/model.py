"""Contract between error models and their users, and the lineage of a model.

A lineage is the steps that made a model, oldest first, and its hash.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Final, Protocol, Self, cast

import numpy as np

from robotrue.calibration.belief import Belief
from robotrue.calibration.terms.term import MeanTables
from robotrue.calibration.training_summary import TrainingSummary, read_step
from robotrue.core.archive import Archive, archive_bytes
from robotrue.core.arrays import Array
from robotrue.core.conditions import ArmConditions, no_conditions
from robotrue.core.files import sha256
from robotrue.core.model_identity import ModelIdentity
from robotrue.core.provenance import Provenance, merge, provenance_from
from robotrue.errors import ConfigurationError, ModelMismatchError, ShapeError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.program.external_axes import ExternalAxis
from robotrue.robot.model import RobotModel, nominal_identity
from robotrue.robot.statics import NO_LOAD, Load


@dataclass(frozen=True, slots=True, kw_only=True)
class Query:
    """Poses and loads at which the error is predicted.

    Attributes:
        joints: (n, dof) rad, commanded.
        load: Payload and wrench, one row or n.
        approach: (n, dof) sign of the last motion of each joint, 0 or empty = unknown.
        conditions: Temperature, time, external axes: one row or n.
        T_flange_tool: (4, 4) requested tool point; None is the point that was measured.
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

    def under(self, conditions: ArmConditions) -> ErrorModel:
        """Returns the model at conditions (1 row) that hold where a query states none.

        Raises:
            ConfigurationError: No part of the model depends on them.
        """
        ...

    def remarks_on(self, conditions: ArmConditions) -> list[str]:
        """Returns what a user should know of a program under conditions (1 row)."""
        ...

    def require_stated(self, conditions: ArmConditions) -> None:
        """Refuses conditions that leave out what the error depends on far too much.

        Raises:
            ConfigurationError: A value that the model needs is not stated.
        """
        ...

    def require_axes(self, axes: Sequence[ExternalAxis]) -> None:
        """Refuses a cell whose external axes are not those of the calibration.

        Raises:
            ConfigurationError: They differ.
        """
        ...

    def tables_hold(self, conditions: ArmConditions) -> bool:
        """Returns whether the mean tables are all at postures under conditions (n rows)."""
        ...

    def training_summary(self) -> TrainingSummary:
        """Returns method, data hash, row counts, region, held-out result, warnings."""
        ...

    def to_archive(self) -> Archive:
        """Returns everything needed to rebuild the model."""
        ...


class UnconditionalModel:
    """The part of :class:`ErrorModel` about conditions, set-ups and further reflectors.

    For a model that depends on no conditions, estimates no set-up and knows one reflector.
    """

    __slots__ = ()

    def in_base(self, measurements: MeasurementSet) -> MeasurementSet:
        """Returns the set, which must be in base already.

        Raises:
            ModelMismatchError: It is in a tracker frame.
        """
        if measurements.frame != "base":
            raise ModelMismatchError(
                "the measurements are in a tracker frame, which this model does not estimate.",
                hint="register the tracker to the base first, or calibrate with a method that "
                "estimates it.",
            )
        return measurements

    def at_reflector(self, number: int) -> Self:
        """Returns the model itself for reflector 0.

        Raises:
            ModelMismatchError: Another reflector.
        """
        if number:
            raise unknown_reflector(number, ())
        return self

    def under(self, conditions: ArmConditions) -> ErrorModel:
        """Refuses stated conditions.

        Raises:
            ConfigurationError: Always.
        """
        raise no_dependence()

    def remarks_on(self, conditions: ArmConditions) -> list[str]:
        """Returns no remarks."""
        return []

    def require_stated(self, conditions: ArmConditions) -> None:
        """Accepts all conditions."""

    def require_axes(self, axes: Sequence[ExternalAxis]) -> None:
        """Accepts all axes."""

    def tables_hold(self, conditions: ArmConditions) -> bool:
        """Returns true."""
        return True


def unknown_reflector(number: int, known: Iterable[int]) -> ModelMismatchError:
    """Returns the error for rows of a reflector that a model does not know."""
    return ModelMismatchError(
        f"reflector {number} is not in the model, which has {[0, *sorted(known)]}.",
        hint="calibrate with rows of that reflector, or correct the column target.",
    )


def no_dependence() -> ConfigurationError:
    """Returns the error for stated conditions on which no part of a model depends."""
    return ConfigurationError(
        "a temperature, time or place is stated, and no part of the model depends on it.",
        hint="calibrate with a column temperature_C, time_s or e1_mm, method auto, ripple or gp.",
    )


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


RANGES: Final = ("joint_range_rad", "position_range_m")
"""Keys of the region of the rows in a summary."""
_HASHES: Final[dict[int, str]] = {}
"""By the identity of models that exist."""


def model_hash(model: ErrorModel) -> str:
    """Returns the SHA-256 of everything in the model's archive, its summary included.

    Packing takes .6 s, and each held-out fit of a transfer names the same parents.
    """
    key = id(model)
    if key not in _HASHES:
        _HASHES[key] = sha256(archive_bytes(model.to_archive()))
        weakref.finalize(model, _HASHES.pop, key)
    return _HASHES[key]


def data_hash(measurements: MeasurementSet) -> str:
    """Returns the SHA-256 of joints and positions, as fits record it."""
    return sha256(measurements.joints.tobytes() + measurements.position.tobytes())


def describe_rows(measurements: MeasurementSet) -> dict[str, object]:
    """Returns the number of rows of a fit, their sources, and their ranges; JSON values, SI."""
    joints, position = measurements.joints, measurements.position
    return {
        "rows": len(measurements),
        "data_sha256": data_hash(measurements),
        "sources": list(measurements.sources),
        "provenance": measurements.provenance.to_document(),
        "joint_range_rad": [joints.min(axis=0).tolist(), joints.max(axis=0).tolist()],
        "position_range_m": [position.min(axis=0).tolist(), position.max(axis=0).tolist()],
    }


def widen_region(summary: Mapping[str, object], measurements: MeasurementSet) -> dict[str, object]:
    """Returns the ranges of a summary, widened to the rows that a model was given later.

    Without stated ranges there is nothing to widen, and empty ranges come back. Positions of rows
    in another frame than the base do not define the region.
    """
    ranges: dict[str, object] = {}
    joint_range, position_range = RANGES
    later = {joint_range: measurements.joints}
    if measurements.frame == "base":
        later[position_range] = measurements.position
    for name, values in later.items():
        stated = np.asarray(summary.get(name, ()), dtype=np.float64)
        if len(values) and stated.shape == (2, values.shape[1]):
            both = np.vstack([stated, values])
            ranges[name] = [both.min(axis=0).tolist(), both.max(axis=0).tolist()]
    return ranges


def provenance_of(model: ErrorModel) -> Provenance:
    """Returns where everything a model was fitted to comes from.

    Raises:
        ArchiveError: The model's summary holds something else in its place.
    """
    recorded = [source for step in history(model) for source in read_step(step).sources]
    return provenance_from(model.training_summary().provenance, before=recorded)


def merged_document(models: Sequence[ErrorModel], *data: Provenance) -> dict[str, object]:
    """Returns the JSON values of the provenance of a model made of other models and of data."""
    return merge([*map(provenance_of, models), *data]).to_document()


def history(model: ErrorModel) -> list[dict[str, object]]:
    """Returns the steps that made the model, oldest first; a plain fit is one step."""
    summary = model.training_summary()
    if summary.lineage:
        return [dict(step) for step in summary.lineage]
    return [
        {
            "step": "fit",
            "method": summary.method or "unknown",
            "rows": summary.rows,
            "data_sha256": summary.data_sha256,
            "sources": list(summary.sources),
        }
    ]


def record_step(
    step: str,
    parents: Sequence[ErrorModel],
    measurements: MeasurementSet | None,
    settings: Mapping[str, object],
    screened: Sequence[int],
) -> dict[str, object]:
    """Returns the step that adds measurements to its parents.

    Args:
        step: ``"update"`` or ``"transfer"``.
        parents: The models it started from.
        measurements: Added data; None adds no rows.
        settings: What decided the result besides the data.
        screened: Rows that got no weight.
    """
    none = measurements is None
    return {
        "step": step,
        "parents_sha256": [model_hash(parent) for parent in parents],
        "rows": 0 if measurements is None else len(measurements),
        "data_sha256": "" if measurements is None else data_hash(measurements),
        "sources": [] if measurements is None else list(measurements.sources),
        "screened_rows": [] if none else [int(i) for i in screened],
        "settings": dict(settings),
    }


def identity_of(model: ErrorModel) -> ModelIdentity:
    """Returns which description of the arm this is.

    Everything in an error model's archive counts; the cell in its file does not. A nominal arm is
    its geometry.
    """
    if not model.calibrated:
        return nominal_identity(model.robot)
    return ModelIdentity(kind="calibrated", robot=model.robot.name, sha256=model_hash(model))


def with_summary(model: ErrorModel, more: Mapping[str, object]) -> ErrorModel:
    """Returns the model with further JSON values in its training summary, where it can take them.

    Only a dataclass with a ``summary`` field can; any other model comes back as it is.
    """
    if not is_dataclass(model) or "summary" not in {f.name for f in fields(model)}:
        return model
    summary = {**model.training_summary(), **more}
    return cast(ErrorModel, replace(cast(object, model), summary=summary))


def with_warnings(model: ErrorModel, doubts: Sequence[str]) -> ErrorModel:
    """Returns the model with further sentences at the head of its warnings."""
    if not doubts:
        return model
    return with_summary(model, {"doubts": [*doubts, *model.training_summary().warnings]})
