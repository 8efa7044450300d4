"""The error model of a calibrated arm: its error vector, further terms, and what is known of them.

    error = chain(actual, q + wind-up + drive shifts) + tip shifts - chain(nominal, q)
    covariance = factor (F S F' + uncarried I + (r^2 + w^2) I)

S is the joint posterior of all coefficients, F the derivative of the error by them, r the
repeatability, w the learned white noise; ``factor`` was set on held-out blocks of the training
rows. A model without terms has geometry and compliance alone, and S is the covariance of those.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Final

import numpy as np

from robotrue.calibration.archive import robot_arrays, robot_document
from robotrue.calibration.arm import ArmWithTerms, LinearArm, parts_of, prepare_arm
from robotrue.calibration.belief import (
    Belief,
    compress_root,
    root_of_covariance,
    spread_columns,
    standard_terms,
)
from robotrue.calibration.evidence import spread
from robotrue.calibration.held_out_blocks import HeldOutRows
from robotrue.calibration.model import Prediction, Query, no_dependence, unknown_reflector
from robotrue.calibration.observations import take_to_base
from robotrue.calibration.terms.term import ArmPostures, MeanTables, Term, rigid_tables
from robotrue.calibration.terms.term_registry import STANDARD
from robotrue.calibration.training_summary import TrainingSummary
from robotrue.core.archive import Archive
from robotrue.core.arrays import Array
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.core.conditions import ArmConditions
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.errors import ConfigurationError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.program.external_axes import ExternalAxis
from robotrue.robot.model import RobotModel, parameter_slice

RIGID_FLEXIBLE: Final = "error-model/rigid-flexible"
LEARNED: Final = "error-model/learned"
"""Kinds of archive: a covariance of the error vector, or a root over it and further terms."""
SCHEMA: Final = 1
"""Of both."""
_ROWS: Final = 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class Reflector:
    """A further reflector on the flange, as identified in addition to the robot's own tool.

    Attributes:
        T_flange_tool: (4, 4) where it is.
        covariance: (9 dof + 12, 9 dof + 12) of the robot errors, its place in that of the tool.
        root: (p, 3) the model's root over its place, along its own axes, where the model has one.
    """

    T_flange_tool: Array
    covariance: Array
    root: Array | None = None


@dataclass(frozen=True, slots=True, kw_only=True, weakref_slot=True)
class CalibratedModel(Columns):
    """One arm as identified: geometry, compliance, and any further terms learned with them.

    Attributes:
        robot: The nominal arm, with the tool that was measured.
        errors: (9 dof + 12,) SI, identified.
        covariance: (9 dof + 12, 9 dof + 12) of ``errors``.
        repeatability: m, sd per axis of one visit.
        white: m, sd per axis of the white noise learned beyond instrument and repeatability.
        T_tracker_base: (4, 4) of every tracker set-up that was estimated.
        reflectors: Further reflectors by number; 0 is the robot's own tool.
        summary: JSON values for :meth:`training_summary`.
        terms: Ripple, backlash, smooth residual, then others; none without a root.
        values: (k,) their parameters, one term after the other, SI.
        columns: (c,) which of [robot errors, parameters] the root is over.
        root: (p, c) R; R'R is the posterior covariance of those. None: ``covariance`` is all.
        inflation: Factor on the covariance from held-out blocks.
        held_out: The rows of the fit, predicted from other blocks; not archived.
        actual: The arm with its identified errors and the measured tool.
    """

    robot: RobotModel
    errors: Annotated[Array, Column("e")]
    covariance: Annotated[Array, Column("e e")]
    repeatability: float
    white: float
    T_tracker_base: Mapping[int, Array] = field(default_factory=dict)
    reflectors: Mapping[int, Reflector] = field(default_factory=dict)
    summary: Mapping[str, object] = field(default_factory=dict)
    terms: tuple[Term, ...] = ()
    values: Annotated[Array, Column("k")] = EMPTY
    columns: Annotated[Array, Column("c")] = EMPTY
    root: Annotated[Array | None, Column("p c")] = None
    inflation: float = 1.0
    held_out: HeldOutRows | None = field(default=None, repr=False, compare=False)
    actual: RobotModel = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Checks shapes and values; drops errors the robot may carry."""
        self._check_columns(e=len(self.robot.errors), k=sum(term.size for term in self.terms))
        robot = self.robot.nominal()
        object.__setattr__(self, "robot", robot)
        object.__setattr__(self, "actual", robot.with_errors(self.errors))

    @property
    def calibrated(self) -> bool:
        """True: it comes from measurements."""
        return True

    def belief(self) -> Belief:
        """Returns the joint posterior; terms that were never learned are zero and certain."""
        terms = self.terms or standard_terms(self.robot.dof)
        mean = np.zeros(len(self.errors) + sum(term.size for term in terms))
        mean[: len(self.errors) + len(self.values)] = np.concatenate([self.errors, self.values])
        if self.root is None:
            part, columns = root_of_covariance(self.covariance), np.arange(len(self.errors))
        else:
            part, columns = self.root, self.columns.astype(np.int64)
        # Old archives may name a base column twice, once for its station: the last one counts.
        root = spread_columns(part, columns, len(mean))
        return Belief(
            robot=self.robot,
            terms=terms,
            mean=mean,
            root=root,
            white=self.white,
            repeatability=self.repeatability,
            inflation=self.inflation,
            T_tracker_base=self.T_tracker_base,
        )

    def compact(self) -> CalibratedModel:
        """Returns the same model with a root of no more rows than columns, where it had more.

        Squaring the root of a large model costs more than many predictions by it.
        """
        if self.root is None:
            return self
        rooted = {k: r for k, r in self.reflectors.items() if r.root is not None}
        whole = np.hstack([self.root, *(r.root for r in rooted.values() if r.root is not None)])
        square = compress_root(whole)
        if len(square) == len(whole):
            return self
        end = self.root.shape[1]
        reflectors = {
            k: replace(r, root=square[:, end + 3 * i : end + 3 * i + 3])
            for i, (k, r) in enumerate(rooted.items())
        }
        return replace(self, root=square[:, :end], reflectors={**self.reflectors, **reflectors})

    def predict(self, query: Query) -> Prediction:
        """Returns mean and covariance of the error at every query row, base frame.

        With another tool in the query the errors of the measured one, and their covariance, do not
        apply; physics, ripple and backlash move with the chain. The smooth residual was learned at
        the measured point: it is carried over, with its whole prior variance added.

        Raises:
            ShapeError: Joints or approach of another robot.
        """
        query = query.expand(self.robot.dof)
        n = len(query.joints)
        error, rotation, covariance = np.zeros((n, 3)), np.zeros((n, 3, 3)), np.zeros((n, 3, 3))
        arm, postures = self._arm(query)
        for start in range(0, n, _ROWS):
            part = slice(start, start + _ROWS)
            at, columns = self._linear(arm, postures.take(part))
            error[part], rotation[part] = at.error, at.rotation
            if self.root is None:
                covariance[part] = columns @ self.covariance @ np.swapaxes(columns, 1, 2)
            else:
                covariance[part] = spread(self.root, columns)
            covariance[part] += (at.uncarried + self._visit)[:, None, None] * np.eye(3)
        return Prediction(
            error=error,
            rotation_error=rotation_vector_from_matrix(rotation),
            covariance=self.inflation * covariance,
        )

    def joint_covariance(self, query: Query) -> Array:
        """Returns the covariance (3n, 3n) m^2 of the errors of all rows together.

        Its diagonal blocks are those of :meth:`predict`; the others are the covariances between
        rows.

        Raises:
            ShapeError: Joints or approach of another robot.
        """
        at, columns = self._linear(*self._arm(query.expand(self.robot.dof)))
        rows = columns.reshape(3 * len(columns), -1)
        own = np.diag(np.repeat(at.uncarried + self._visit, 3))
        if self.root is None:
            shared = rows @ self.covariance @ rows.T
        else:
            half = rows @ self.root.T
            shared = half @ half.T
        return np.asarray(self.inflation * (shared + own))

    @property
    def _visit(self) -> float:
        """Variance per axis of one visit, m^2, over the factor on it.

        A factor below one applies to the parameters of a rigid-flexible arm, not to its visits.
        Learned models also narrow their visits, where many rows support it.
        """
        visit = self.white**2 + self.repeatability**2
        return visit / min(self.inflation, 1.0) if self.root is None else visit

    def _arm(self, query: Query) -> tuple[ArmWithTerms, ArmPostures]:
        """The arm with the tool of a query, and its postures."""
        arm = prepare_arm(self.actual, query.T_flange_tool, terms=self.terms, values=self.values)
        return arm, arm.postures(query.joints, query.load, query.approach, query.conditions)

    def _linear(self, arm: ArmWithTerms, rows: ArmPostures) -> tuple[LinearArm, Array]:
        """Returns the linearised arm, and d(error)/d(columns of the posterior)."""
        at = arm.linearise_at(rows)
        if self.root is None:
            return at, at.columns
        return at, at.columns[:, :, self.columns.astype(np.int64)]

    def under(self, conditions: ArmConditions) -> CalibratedModel:
        """Returns the model at conditions (1 row) that hold where a query states none.

        Raises:
            ConfigurationError: No part of the model depends on them.
        """
        terms = tuple(term.under(conditions) for term in self.terms)
        if all(new is old for new, old in zip(terms, self.terms, strict=True)):
            raise no_dependence()
        return replace(self, terms=terms)

    def remarks_on(self, conditions: ArmConditions) -> list[str]:
        """Returns what a user should know of a program under conditions (1 row)."""
        return [said for term in self.terms if (said := term.remark(conditions))]

    def require_stated(self, conditions: ArmConditions) -> None:
        """Refuses conditions that leave out what the error depends on far too much.

        Raises:
            ConfigurationError: Where the arm is on its rail is not stated.
        """
        for term in self.terms:
            if missing := term.lacking(conditions):
                raise ConfigurationError(
                    f"{missing}.",
                    hint="describe the rail in the cell ([[controller.external]]) and write its "
                    "value with each target, or state it: --e1-mm 1500.",
                )

    def require_axes(self, axes: Sequence[ExternalAxis]) -> None:
        """Refuses a cell whose external axes are not those of the calibration.

        Raises:
            ConfigurationError: They differ.
        """
        for term in self.terms:
            if fault := term.contradicts(axes):
                raise ConfigurationError(
                    f"{fault}.",
                    hint="use the cell it was calibrated with, whose about, through_mm, at_deg and "
                    "carries its errors count from, or calibrate with --table again.",
                )

    def tables_hold(self, conditions: ArmConditions) -> bool:
        """Returns whether :meth:`mean_tables` is all at postures under conditions (n rows)."""
        return not any(term.beyond_tables(conditions) for term in self.terms)

    def mean_tables(self) -> MeanTables | None:
        """Returns the mean as flat tables, or None if a term has no such form.

        The load enters when they are evaluated.
        """
        tables: MeanTables | None = rigid_tables(self.actual)
        for term, part in parts_of(self.terms, self.values):
            tables = None if tables is None else term.in_tables(tables, part)
        return tables

    def in_base(self, measurements: MeasurementSet) -> MeasurementSet:
        """Returns the set with positions, orientations and covariances in base.

        Raises:
            ModelMismatchError: A station the model has never seen.
        """
        return take_to_base(measurements, self.T_tracker_base)

    def at_reflector(self, number: int) -> CalibratedModel:
        """Returns the model of a reflector: its place is the tool.

        Raises:
            ModelMismatchError: A reflector the model has never seen.
        """
        if number == 0:
            return self
        if number not in self.reflectors:
            raise unknown_reflector(number, self.reflectors)
        reflector = self.reflectors[number]
        tool = parameter_slice(self.robot.dof, "tool")
        errors = self.errors.copy()
        errors[tool] = 0.0
        columns, root = self.columns, self.root
        if root is not None and reflector.root is not None:
            arm = (columns < tool.start) | (columns >= tool.stop)
            columns = np.concatenate([columns[arm], tool.start + np.arange(3.0)])
            root = np.hstack([root[:, arm], reflector.root])
        return replace(
            self,
            robot=self.robot.with_tool(reflector.T_flange_tool),
            errors=errors,
            covariance=reflector.covariance,
            columns=columns,
            root=root,
            reflectors={},
        )

    def training_summary(self) -> TrainingSummary:
        """Returns method, data, row counts, verdict and warnings."""
        return TrainingSummary(self.summary)

    def to_archive(self) -> Archive:
        """Returns everything needed to rebuild the model, bit for bit."""
        document, arrays = self._archived_errors()
        if self.root is None:
            document["summary"] = dict(self.summary)
            return Archive(kind=RIGID_FLEXIBLE, schema=SCHEMA, document=document, arrays=arrays)
        document = {
            "physics": {"schema": SCHEMA, "document": {**document, "summary": {}}},
            "inflation": self.inflation,
            "summary": dict(self.summary),
        }
        arrays = {f"physics/{name}": array for name, array in arrays.items()}
        further: dict[str, object] = {}
        for term, part in parts_of(self.terms, self.values):
            if term.name in STANDARD:
                document |= term.document()
                arrays |= term.arrays(part)
            else:
                further[term.name] = dict(term.document())
                named = term.arrays(part).items()
                arrays |= {f"terms/{term.name}/{name}": array for name, array in named}
        if further:
            document["terms"] = further
        arrays |= {"columns": self.columns, "root": self.root}
        for k, reflector in self.reflectors.items():
            if reflector.root is not None:
                arrays[f"reflector{k}_root"] = reflector.root
        return Archive(kind=LEARNED, schema=SCHEMA, document=document, arrays=arrays)

    def _archived_errors(self) -> tuple[dict[str, object], dict[str, Array]]:
        """Document and arrays of the error vector, its covariance, stations and reflectors."""
        stations, reflectors = sorted(self.T_tracker_base), sorted(self.reflectors)
        document = {
            "robot": robot_document(self.robot),
            "repeatability": self.repeatability,
            "white": self.white,
            "stations": stations,
            **({"reflectors": reflectors} if reflectors else {}),
            **({"inflation": self.inflation} if self.root is None and self.inflation != 1 else {}),
        }
        arrays = {
            **robot_arrays(self.robot),
            "errors": self.errors,
            "covariance": self.covariance,
            "T_tracker_base": np.array(
                [self.T_tracker_base[k] for k in stations], dtype=np.float64
            ).reshape(-1, 4, 4),
            **{f"reflector{k}": self.reflectors[k].T_flange_tool for k in reflectors},
            **{f"reflector{k}_covariance": self.reflectors[k].covariance for k in reflectors},
        }
        return document, arrays


def model_of(
    belief: Belief, summary: Mapping[str, object], *, compact: bool = True
) -> CalibratedModel:
    """Returns the error model of a belief without nuisances.

    Args:
        belief: Without nuisances.
        summary: Of its training.
        compact: Whether the root is made square where it has far more rows than columns.
    """
    end = belief.end
    places = [place for _, place in belief.reflectors.values()]
    whole = np.hstack([belief.root, *places]) if places else belief.root
    whole = compress_root(whole) if compact else whole
    root = whole[:, :end]
    columns = np.flatnonzero(root.any(axis=0))
    kept = np.take(root, columns, axis=1)
    kept.flags.writeable = False  # the model then keeps it without another copy
    physical = root[:, : len(belief.errors)]
    variance = belief.inflation * np.einsum("ij,ij->j", root, root)
    said = [
        line
        for term in belief.terms
        for place in [belief.place(term.name)]
        for line in term.sentences(belief.mean[place], variance[place])
    ]
    return CalibratedModel(
        robot=belief.robot,
        errors=belief.errors,
        covariance=physical.T @ physical,
        repeatability=belief.repeatability,
        white=belief.white,
        T_tracker_base=belief.T_tracker_base,
        reflectors={
            k: _reflector_of(T, physical, whole[:, end + 3 * i : end + 3 * i + 3])
            for i, (k, (T, _)) in enumerate(belief.reflectors.items())
        },
        summary={**summary, "terms": said} if said else summary,
        terms=belief.terms,
        values=belief.values,
        columns=columns.astype(np.float64),
        root=kept,
        inflation=belief.inflation,
    )


def _reflector_of(T_flange_tool: Array, root: Array, place: Array) -> Reflector:
    """Returns a further reflector from a root of the posterior.

    Args:
        T_flange_tool: (4, 4) where it is.
        root: (p, 9 dof + 12) over the robot errors.
        place: (p, 3) over the reflector's place, along its own axes.
    """
    full = root.copy()
    full[:, -6:-3], full[:, -3:] = place, 0.0  # the tool errors are the last six
    return Reflector(T_flange_tool=T_flange_tool, covariance=full.T @ full, root=place)
