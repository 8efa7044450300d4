"""The learned error model: geometry, compliance, ripple, backlash and smooth residual together.

    error = chain(actual, q + ripple + backlash + wind-up) + smooth(q) - chain(nominal, q)
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
from robotrue.calibration.belief import Belief, compressed_root
from robotrue.calibration.design import smooth_columns
from robotrue.calibration.evidence import spread
from robotrue.calibration.model import Prediction, Query
from robotrue.calibration.rigid_flexible import RigidFlexibleModel, reflector_of
from robotrue.calibration.ripple import ripple_columns, ripple_shift
from robotrue.calibration.smooth import SmoothBasis
from robotrue.calibration.tables import MeanTables
from robotrue.core.archive import Archive, archive_reader
from robotrue.core.arrays import Array, frozen
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.errors import ArchiveError, ShapeError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import ChainState, drive_jacobian, forward, parameter_jacobian
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.statics import NO_LOAD, Load, deflected

KIND: Final = "error-model/learned"
SCHEMA: Final = 1
_ROWS: Final = 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedModel:
    """Physics and residual of one arm, as learned together.

    Attributes:
        physics: Geometry and compliance at the joint posterior mean, stations, noise.
        cycles: (h,) 1, 2, ..., h per revolution.
        ripple_sin: (dof, h) rad.
        ripple_cos: (dof, h) rad.
        backlash: (dof,) rad per unit of approach sign.
        basis: Centres of the smooth residual; None without one.
        smooth_weights: (m, 3) m, of the basis columns.
        amplitude: m, prior sd of the smooth residual.
        columns: (k,) which of [robot errors, ripple, backlash, smooth] the root speaks of.
        root: (p, k) R; R'R is the posterior covariance of those.
        inflation: Factor on the covariance from held-out blocks.
        reflector_roots: Per further reflector of ``physics`` (p, 3): the root over its place.
        summary: JSON values for :meth:`training_summary`.
    """

    physics: RigidFlexibleModel
    cycles: Array
    ripple_sin: Array
    ripple_cos: Array
    backlash: Array
    basis: SmoothBasis | None
    smooth_weights: Array
    amplitude: float
    columns: Array
    root: Array
    inflation: float
    reflector_roots: Mapping[int, Array] = field(default_factory=dict)
    summary: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Checks shapes and freezes."""
        dof, h = self.robot.dof, len(self.cycles)
        m = 0 if self.basis is None else len(self.basis.centres)
        for name, shape in (
            ("cycles", (h,)),
            ("ripple_sin", (dof, h)),
            ("ripple_cos", (dof, h)),
            ("backlash", (dof,)),
            ("smooth_weights", (m, 3)),
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
        dof, h = self.robot.dof, len(self.cycles)
        waves = np.stack([self.ripple_sin, self.ripple_cos], axis=-1)
        mean = np.concatenate(
            [
                self.physics.errors,
                waves.reshape(2 * dof * h),
                self.backlash,
                self.smooth_weights.ravel(),
            ]
        )
        root = np.zeros((len(self.root), len(mean)))
        # A column may be named twice (a station that stands for the base): the last one speaks.
        root[:, self.columns.astype(np.int64)] = self.root
        return Belief(
            robot=self.robot,
            cycles=self.cycles,
            basis=self.basis,
            amplitude=self.amplitude,
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
        joints = np.asarray(query.joints, dtype=np.float64)
        if joints.ndim != 2 or joints.shape[1] != self.robot.dof:
            raise ShapeError(f"joints has shape {joints.shape}, expected (any, {self.robot.dof}).")
        n = len(joints)
        approach = np.zeros_like(joints) if np.size(query.approach) == 0 else query.approach
        if approach.shape != joints.shape:
            raise ShapeError(f"approach has shape {approach.shape}, expected {joints.shape}.")
        error, turn, covariance = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3, 3))
        for start in range(0, n, _ROWS):
            part = slice(start, start + _ROWS)
            error[part], turn[part], covariance[part] = self._rows(
                joints[part],
                approach[part],
                rows_of(query.load, part),
                query.T_flange_tool,
            )
        return Prediction(error=error, rotation_error=turn, covariance=covariance)

    def _rows(
        self, joints: Array, approach: Array, load: Load, T_flange_tool: Array | None
    ) -> tuple[Array, Array, Array]:
        error, turn, jacobian, uncarried = self._linear(joints, approach, load, T_flange_tool)
        covariance = spread(self.root, jacobian)
        covariance = covariance + uncarried[:, None, None] * np.eye(3)
        white = self.physics.white**2 + self.physics.repeatability**2
        covariance = covariance + white * np.eye(3)
        return error, turn, self.inflation * covariance

    def joint_covariance(self, query: Query) -> Array:
        """Returns the covariance (3n, 3n) m^2 of the errors of all rows together.

        Its diagonal blocks are those of :meth:`predict`; the others say what rows share.

        Raises:
            ShapeError: Joints or approach of another robot.
        """
        joints = np.asarray(query.joints, dtype=np.float64)
        if joints.ndim != 2 or joints.shape[1] != self.robot.dof:
            raise ShapeError(f"joints has shape {joints.shape}, expected (any, {self.robot.dof}).")
        n = len(joints)
        approach = np.zeros_like(joints) if np.size(query.approach) == 0 else query.approach
        _, _, jacobian, uncarried = self._linear(joints, approach, query.load, query.T_flange_tool)
        half = jacobian.reshape(3 * n, -1) @ self.root.T
        white = self.physics.white**2 + self.physics.repeatability**2
        own = np.repeat(uncarried + white, 3)
        return np.asarray(self.inflation * (half @ half.T + np.diag(own)))

    def _linear(
        self, joints: Array, approach: Array, load: Load, T_flange_tool: Array | None
    ) -> tuple[Array, Array, Array, Array]:
        """Error, rotation error, d(error)/d(columns of the root), variance no column carries."""
        nominal, actual = self.robot, self.physics.actual
        if T_flange_tool is not None:
            nominal, actual = nominal.with_tool(T_flange_tool), actual.with_tool(T_flange_tool)
        shift = ripple_shift(joints, self.cycles, self.ripple_sin, self.ripple_cos)
        believed = forward(nominal, joints)
        state, torque = deflected(actual, joints, load, shift + self.backlash * approach)
        error = state.position - believed[:, :3, 3]
        uncarried = np.zeros(len(joints))
        carried = np.zeros((len(joints), 0))
        if self.basis is not None:
            carried = self.basis.columns(joints)
            error = error + carried @ self.smooth_weights
            left = np.maximum(1.0 - (carried**2).sum(axis=1), 0.0)
            uncarried = self.amplitude**2 * (left + (T_flange_tool is not None))
        jacobian = self._jacobian(actual, state, joints, torque, approach, carried)
        if T_flange_tool is not None:
            jacobian[:, :, parameter_slice(actual.dof, "tool")] = 0.0
        turn = rotation_vector_from_matrix(state.rotation @ np.swapaxes(believed[:, :3, :3], 1, 2))
        return error, turn, jacobian[:, :, self.columns.astype(np.int64)], uncarried

    def _jacobian(
        self,
        actual: RobotModel,
        state: ChainState,
        joints: Array,
        torque: Array,
        approach: Array,
        carried: Array,
    ) -> Array:
        """d(error)/d(robot errors, ripple, backlash, smooth), (n, 3, all)."""
        drive = drive_jacobian(actual, state)[:, :3]
        axes = np.broadcast_to(np.eye(3), (len(joints), 3, 3))
        return np.concatenate(
            [
                parameter_jacobian(actual, state, joints, torque)[:, :3],
                ripple_columns(drive, joints, self.cycles),
                drive * approach[:, None, :],
                smooth_columns(axes, carried),
            ],
            axis=2,
        )

    def mean_tables(self, load: Load = NO_LOAD) -> MeanTables | None:
        """Returns the mean as flat tables; the load enters when they are evaluated."""
        dof = self.robot.dof
        empty = self.basis is None
        return MeanTables(
            robot=self.physics.actual,
            harmonics=self.cycles,
            ripple_sin=self.ripple_sin,
            ripple_cos=self.ripple_cos,
            backlash=self.backlash,
            centres=np.zeros((0, 2 * dof)) if self.basis is None else self.basis.centres,
            scale=np.ones(2 * dof) if self.basis is None else self.basis.scale,
            weights=np.zeros((0, 3))
            if empty or self.basis is None
            else self.basis.table_weights(self.smooth_weights),
        )

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

    def training_summary(self) -> Mapping[str, Any]:
        """Returns JSON values: method, data, scales learned, held-out blocks, doubts."""
        return dict(self.summary)

    def to_archive(self) -> Archive:
        """Returns everything needed to rebuild the model."""
        physics = self.physics.to_archive()
        arrays = {f"physics/{name}": array for name, array in physics.arrays.items()}
        dof = self.robot.dof
        basis = self.basis or SmoothBasis(centres=np.zeros((0, 2 * dof)), scale=np.ones(2 * dof))
        return Archive(
            kind=KIND,
            schema=SCHEMA,
            document={
                "physics": {"schema": physics.schema, "document": dict(physics.document)},
                "amplitude": self.amplitude,
                "inflation": self.inflation,
                "summary": dict(self.summary),
            },
            arrays={
                **arrays,
                "cycles": self.cycles,
                "ripple_sin": self.ripple_sin,
                "ripple_cos": self.ripple_cos,
                "backlash": self.backlash,
                "smooth_centres": basis.centres,
                "smooth_scale": basis.scale,
                "smooth_weights": self.smooth_weights,
                "columns": self.columns,
                "root": self.root,
                **{f"reflector{k}_root": root for k, root in self.reflector_roots.items()},
            },
        )


def model_of(belief: Belief, summary: Mapping[str, Any]) -> LearnedModel:
    """Returns the error model of a belief without nuisances."""
    dof, h = belief.robot.dof, len(belief.cycles)
    ripple, backlash, smooth, end = belief.starts
    waves = belief.mean[ripple:backlash].reshape(dof, h, 2)
    places = [place for _, place in belief.reflectors.values()]
    whole = compressed_root(np.hstack([belief.root, *places]))
    root = whole[:, :end]
    roots = {k: whole[:, end + 3 * i : end + 3 * i + 3] for i, k in enumerate(belief.reflectors)}
    columns = np.flatnonzero((root != 0.0).any(axis=0))
    physical = root[:, :ripple]
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
        cycles=belief.cycles,
        ripple_sin=waves[:, :, 0],
        ripple_cos=waves[:, :, 1],
        backlash=belief.mean[backlash:smooth],
        basis=belief.basis,
        smooth_weights=belief.mean[smooth:end].reshape(-1, 3),
        amplitude=belief.amplitude,
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
    centres = archive.array("smooth_centres")
    basis = SmoothBasis(centres=centres, scale=archive.array("smooth_scale"))
    physics = rigid_flexible.from_archive(inner)
    amplitude, inflation = float(document["amplitude"]), float(document["inflation"])
    dof = physics.robot.dof
    if (
        centres.ndim != 2
        or centres.shape[1] != 2 * dof
        or basis.scale.shape != (2 * dof,)
        or not (basis.scale > 0.0).all()
        or not 0.0 <= amplitude < 1.0
        or not 0.0 < inflation < 1e6
    ):
        raise ArchiveError("the smooth part of the learned error is damaged.")
    columns = archive.array("columns")
    count = len(physics.errors) + dof * (2 * len(archive.array("cycles")) + 1) + 3 * len(centres)
    if not ((columns >= 0.0) & (columns < count) & (columns == np.round(columns))).all():
        raise ArchiveError(f"columns of the learned error are whole numbers below {count}.")
    return LearnedModel(
        physics=physics,
        basis=basis if len(centres) else None,
        amplitude=amplitude,
        inflation=inflation,
        reflector_roots={k: archive.array(f"reflector{k}_root") for k in physics.reflectors},
        summary=dict(document["summary"]),
        **{
            name: archive.array(name)
            for name in (
                "cycles",
                "ripple_sin",
                "ripple_cos",
                "backlash",
                "smooth_weights",
                "columns",
                "root",
            )
        },
    )


def rows_of(load: Load, part: slice) -> Load:
    """Returns a run of rows of a load; columns of one row stay as they are."""
    return Load(
        **{
            name: value if len(value) == 1 else value[part]
            for name in ("mass", "com", "wrench")
            for value in [getattr(load, name)]
        }
    )
