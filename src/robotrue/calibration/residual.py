"""The learned error model: geometry, compliance and all further terms together.

    error = chain(actual, q + wind-up + drive shifts) + tip shifts - chain(nominal, q)
    covariance = factor (F S F' + uncarried I + (r^2 + w^2) I)

S is the joint posterior of everything, F the derivative of the error by it, r the repeatability,
w the learned white noise; ``factor`` was set on held-out blocks of the training rows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from robotrue.calibration import rigid_flexible
from robotrue.calibration.arm import LinearArm, linearise_arm, parts_of
from robotrue.calibration.belief import Belief, compress_root
from robotrue.calibration.evidence import spread
from robotrue.calibration.model import Prediction, Query
from robotrue.calibration.rigid_flexible import RigidFlexibleModel, reflector_of
from robotrue.calibration.tables import MeanTables, rigid_tables
from robotrue.calibration.terms.registry import STANDARD, term_of
from robotrue.calibration.terms.term import Term
from robotrue.calibration.training_summary import TrainingSummary
from robotrue.core.archive import Archive, archive_reader
from robotrue.core.arrays import Array, frozen
from robotrue.errors import ArchiveError, ShapeError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.statics import NO_LOAD, Load

KIND: Final = "error-model/learned"
SCHEMA: Final = 1
_ROWS: Final = 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedModel:
    """Physics and further terms of one arm, as learned together.

    Attributes:
        physics: Geometry and compliance at the joint posterior mean, stations, noise.
        terms: Ripple, backlash, smooth residual, then others.
        values: (k,) their parameters, one term after the other, SI.
        columns: (c,) which of [robot errors, parameters] the root speaks of.
        root: (p, c) R; R'R is the posterior covariance of those.
        inflation: Factor on the covariance from held-out blocks.
        reflector_roots: Per further reflector of ``physics`` (p, 3): the root over its place.
        summary: JSON values for :meth:`training_summary`.
    """

    physics: RigidFlexibleModel
    terms: tuple[Term, ...]
    values: Array
    columns: Array
    root: Array
    inflation: float
    reflector_roots: Mapping[int, Array] = field(default_factory=dict)
    summary: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Checks shapes and freezes."""
        for name, shape in (
            ("values", (sum(term.size for term in self.terms),)),
            ("columns", (None,)),
            ("root", (None, len(self.columns))),
        ):
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name))

    @property
    def robot(self) -> RobotModel:
        """The nominal robot with the tool that was measured."""
        return self.physics.robot

    @property
    def calibrated(self) -> bool:
        """True: it comes from measurements."""
        return True

    def belief(self) -> Belief:
        """Returns the joint posterior of all coefficients."""
        mean = np.concatenate([self.physics.errors, self.values])
        root = np.zeros((len(self.root), len(mean)))
        # A column may be named twice (a station that stands for the base): the last one speaks.
        root[:, self.columns.astype(np.int64)] = self.root
        return Belief(
            robot=self.robot,
            terms=self.terms,
            mean=mean,
            root=root,
            white=self.physics.white,
            repeatability=self.physics.repeatability,
            inflation=self.inflation,
            T_tracker_base=self.physics.T_tracker_base,
        )

    def predict(self, query: Query) -> Prediction:
        """Returns mean and covariance of the error at every query row, base frame.

        With another tool in the query, physics, ripple and backlash move with the chain. The
        smooth residual was learned at the measured point: it is carried over, with its whole prior
        variance added.

        Raises:
            ShapeError: Joints or approach of another robot.
        """
        joints, approach, temperature = self._checked(query)
        n = len(joints)
        error, turn, covariance = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3, 3))
        for start in range(0, n, _ROWS):
            part = slice(start, start + _ROWS)
            rows = Query(
                joints=joints[part],
                load=query.load.take(part),
                approach=approach[part],
                temperature=temperature[part],
                T_flange_tool=query.T_flange_tool,
            )
            at, columns = self._linear(rows)
            error[part], turn[part] = at.error, at.turn
            covariance[part] = spread(self.root, columns)
            covariance[part] += (at.uncarried + self._visit)[:, None, None] * np.eye(3)
        return Prediction(error=error, rotation_error=turn, covariance=self.inflation * covariance)

    def joint_covariance(self, query: Query) -> Array:
        """Returns the covariance (3n, 3n) m^2 of the errors of all rows together.

        Its diagonal blocks are those of :meth:`predict`; the others say what rows share.

        Raises:
            ShapeError: Joints or approach of another robot.
        """
        joints, approach, temperature = self._checked(query)
        at, columns = self._linear(
            replace(query, joints=joints, approach=approach, temperature=temperature)
        )
        half = columns.reshape(3 * len(joints), -1) @ self.root.T
        own = np.repeat(at.uncarried + self._visit, 3)
        return np.asarray(self.inflation * (half @ half.T + np.diag(own)))

    @property
    def _visit(self) -> float:
        """Variance per axis of one visit, m^2."""
        return self.physics.white**2 + self.physics.repeatability**2

    def _checked(self, query: Query) -> tuple[Array, Array, Array]:
        """Joints, approach and temperature of a query, one row each."""
        joints = np.asarray(query.joints, dtype=np.float64)
        if joints.ndim != 2 or joints.shape[1] != self.robot.dof:
            raise ShapeError(f"joints has shape {joints.shape}, expected (any, {self.robot.dof}).")
        approach = np.zeros_like(joints) if np.size(query.approach) == 0 else query.approach
        if approach.shape != joints.shape:
            raise ShapeError(f"approach has shape {approach.shape}, expected {joints.shape}.")
        n = len(joints)
        stated = np.asarray(query.temperature, dtype=np.float64)
        temperature = np.full(n, np.nan) if stated.size == 0 else stated
        if temperature.shape != (n,):
            raise ShapeError(f"temperature has shape {temperature.shape}, expected ({n},).")
        return joints, approach, temperature

    def _linear(self, rows: Query) -> tuple[LinearArm, Array]:
        """The arm, linearised, and d(error)/d(columns of the root)."""
        at = linearise_arm(
            self.physics.actual,
            rows.joints,
            rows.load,
            rows.T_flange_tool,
            terms=self.terms,
            values=self.values,
            approach=rows.approach,
            temperature=rows.temperature,
        )
        return at, at.columns[:, :, self.columns.astype(np.int64)]

    def mean_tables(self, load: Load = NO_LOAD) -> MeanTables | None:
        """Returns the mean as flat tables, or None if a term has no such form.

        The load enters when they are evaluated.
        """
        tables: MeanTables | None = rigid_tables(self.physics.actual)
        for term, part in parts_of(self.terms, self.values):
            tables = None if tables is None else term.in_tables(tables, part)
        return tables

    def in_base(self, measurements: MeasurementSet) -> MeasurementSet:
        """Returns the set with its positions in base.

        Raises:
            ModelMismatchError: A station the model has never seen.
        """
        return self.physics.in_base(measurements)

    def at_reflector(self, number: int) -> LearnedModel:
        """Returns the model of a reflector: its place is the tool.

        Raises:
            ModelMismatchError: A reflector the model has never seen.
        """
        physics = self.physics.at_reflector(number)
        if physics is self.physics:
            return self
        tool = parameter_slice(self.robot.dof, "tool")
        arm = (self.columns < tool.start) | (self.columns >= tool.stop)
        place = tool.start + np.arange(3.0)
        return replace(
            self,
            physics=physics,
            columns=np.concatenate([self.columns[arm], place]),
            root=np.hstack([self.root[:, arm], self.reflector_roots[number]]),
            reflector_roots={},
        )

    def training_summary(self) -> TrainingSummary:
        """Returns method, data, row counts, verdict and warnings."""
        return TrainingSummary(self.summary)

    def to_archive(self) -> Archive:
        """Returns everything needed to rebuild the model."""
        physics = self.physics.to_archive()
        document: dict[str, Any] = {
            "physics": {"schema": physics.schema, "document": dict(physics.document)},
            "inflation": self.inflation,
            "summary": dict(self.summary),
        }
        arrays = {f"physics/{name}": array for name, array in physics.arrays.items()}
        further: dict[str, Any] = {}
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
        arrays |= {f"reflector{k}_root": root for k, root in self.reflector_roots.items()}
        return Archive(kind=KIND, schema=SCHEMA, document=document, arrays=arrays)


def model_of(belief: Belief, summary: Mapping[str, Any]) -> LearnedModel:
    """Returns the error model of a belief without nuisances."""
    end = belief.end
    places = [place for _, place in belief.reflectors.values()]
    whole = compress_root(np.hstack([belief.root, *places]))
    root = whole[:, :end]
    roots = {k: whole[:, end + 3 * i : end + 3 * i + 3] for i, k in enumerate(belief.reflectors)}
    columns = np.flatnonzero((root != 0.0).any(axis=0))
    physical = root[:, : len(belief.errors)]
    return LearnedModel(
        physics=RigidFlexibleModel(
            robot=belief.robot,
            errors=belief.errors,
            covariance=physical.T @ physical,
            repeatability=belief.repeatability,
            white=belief.white,
            T_tracker_base=belief.T_tracker_base,
            reflectors={
                k: reflector_of(T, physical, roots[k]) for k, (T, _) in belief.reflectors.items()
            },
        ),
        terms=belief.terms,
        values=belief.values,
        columns=columns.astype(np.float64),
        root=root[:, columns],
        inflation=belief.inflation,
        reflector_roots=roots,
        summary=summary,
    )


@archive_reader
def from_archive(archive: Archive) -> LearnedModel:
    """Returns the model in an archive.

    Raises:
        ArchiveError: Another kind, a newer schema, or parts that are missing or cannot be.
    """
    archive.expect(KIND, SCHEMA)
    document = archive.document
    inner = Archive(
        kind=rigid_flexible.KIND,
        schema=int(document["physics"]["schema"]),
        document=document["physics"]["document"],
        arrays={
            name.removeprefix("physics/"): array
            for name, array in archive.arrays.items()
            if name.startswith("physics/")
        },
    )
    physics = rigid_flexible.from_archive(inner)
    inflation = float(document["inflation"])
    if not 0.0 < inflation < 1e6:
        raise ArchiveError("the factor on the covariance of the learned error is damaged.")
    restored = _restored(archive, physics.robot)
    values = np.concatenate([part for _, part in restored])
    columns = archive.array("columns")
    count = len(physics.errors) + len(values)
    if not ((columns >= 0.0) & (columns < count) & (columns == np.round(columns))).all():
        raise ArchiveError(f"columns of the learned error are whole numbers below {count}.")
    return LearnedModel(
        physics=physics,
        terms=tuple(term for term, _ in restored),
        values=values,
        columns=columns,
        root=archive.array("root"),
        inflation=inflation,
        reflector_roots={k: archive.array(f"reflector{k}_root") for k in physics.reflectors},
        summary=dict(document["summary"]),
    )


def _restored(archive: Archive, robot: RobotModel) -> list[tuple[Term, Array]]:
    """The terms of an archive with their parameters, the standard ones first.

    Raises:
        ArchiveError: A term nobody registered, or a damaged one.
    """
    for name in archive.arrays:
        archive.array(name)
    found: list[tuple[Term, Array]] = []
    for name in STANDARD:
        found.append(term_of(name).restore(robot, archive.document, archive.arrays))
    for name, document in archive.document.get("terms", {}).items():
        start = f"terms/{name}/"
        own = {k.removeprefix(start): a for k, a in archive.arrays.items() if k.startswith(start)}
        found.append(term_of(name).restore(robot, document, own))
    return found
