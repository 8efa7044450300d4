"""Information that a pose adds about the arm, computed before it is measured.

The calibration is linear around the nominal arm, ``y = J w + noise``, so the information gain of a
pose is known without its result. ``w`` are the errors the fit estimates (geometry, compliance,
base, tool), the slow ripple of every drive and its backlash, with the priors of
:mod:`calibration.priors`. Effects outside this linear model do not average out like noise, but over
few poses they act like it: fast ripple is mapped through the arm's Jacobian, and a smooth residual
is added to every axis. Both sizes are stated in :class:`UnmodelledErrors`; without them a plan is
too optimistic and prefers a stretched arm.

Rows come whitened and in units of the prior: in these coordinates the prior precision is I, and
that of the data the sum of ``A' A`` over the poses.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Annotated, Final

import numpy as np

from robotrue.calibration.belief import Belief, root_of_covariance, standard_terms
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.observations import linear_rows, observations_of
from robotrue.calibration.parameters import ParameterLayout, State
from robotrue.calibration.settings import FitSettings, prior_belief
from robotrue.calibration.terms.error_vector import PriorScales, StiffnessPrior
from robotrue.calibration.terms.ripple import harmonics
from robotrue.cell.cell import Cell
from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import EMPTY, Column, Columns, Rows
from robotrue.errors import ModelMismatchError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.tracker import point_covariance
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.statics import NO_LOAD, Load

LOOSE: Final = 0.1
"""m and rad, prior sd of the base where the tracker's frame is not known."""
STIFFNESS_SD: Final = 0.3
"""Relative standard deviation taken for a stiffness stated in the cell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UnmodelledErrors(Columns):
    """Errors beyond geometry and compliance, one standard deviation each.

    Drive errors are given by their effect at the end of the stretched arm: large arms have finer
    drives, and the sizes in metres differ less than those in rad. The defaults are of the size that
    the learned model has on a measured UR5 and UR10 (coefficients of 20 to 120 urad below 8 cycles,
    10 to 80 urad from 8 to 44, white residual 17 and 25 um).

    Attributes:
        ripple: (h,) m, of the sine and of the cosine of N = 1, 2, ..., h cycles per revolution.
        fast: m per joint, of everything faster.
        backlash: m per joint, half of it.
        white: m per axis, of a smooth residual and of drift.
    """

    ripple: Annotated[Array, Column("_", unit="rad")] = field(
        default_factory=lambda: 8e-5 / np.sqrt(np.arange(1.0, 17.0))
    )
    fast: float = 4e-5
    backlash: float = 2e-5
    white: float = 2e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class Postures(Columns):
    """n visits of the arm: joints, load, and approach direction.

    Attributes:
        joints: (n, dof) rad, commanded.
        load: Payload and wrench, one row or n rows.
        approach: (n, dof) sign of the last motion of each joint, 0 = unknown.
    """

    joints: Annotated[Array, Column("n dof", unit="rad")]
    load: Load = NO_LOAD
    approach: Annotated[Array, Column("n dof", fill=0.0)] = EMPTY

    def __len__(self) -> int:
        return len(self.joints)

    def take(self, rows: Rows) -> Postures:
        """Returns the chosen rows; a single load serves all and stays single."""
        return Postures(
            joints=self.joints[rows], load=self.load.take(rows), approach=self.approach[rows]
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkErrorPrior(Columns):
    """The error where the arm will work, before measuring.

    Attributes:
        columns: (m, 3, k) m, G: errors that calibration learns, in the coordinates of the linear
            model.
        rest: (m, 3, 3) m^2, the others: fast ripple, smooth residual, repeatability, approach.
        instrument: (m, 3, 3) m^2, noise of checking it.
    """

    columns: Annotated[Array, Column("_ 3 _")]
    rest: Annotated[Array, Column("_ 3 _")]
    instrument: Annotated[Array, Column("_ 3 _")]

    @property
    def weight(self) -> Array:
        """(k, k) m^2, mean of G' G."""
        flat = self.columns.reshape(-1, self.columns.shape[2])
        return np.asarray(flat.T @ flat / len(self.columns))


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearModel(Columns):
    """The linear model of a calibration that has not been made, or not been finished.

    Attributes:
        robot: The arm, with the measured reflector as its tool and the present estimate of its
            errors.
        cell: What measures it; gives the instrument's covariance.
        settings: Noise and default load of the fit.
        unmodelled: Sizes of what the linear model leaves out.
        root: (p, k) R; R R' is the present covariance of [robot errors, ripple, backlash].
    """

    robot: RobotModel
    cell: Cell
    settings: FitSettings
    unmodelled: UnmodelledErrors
    root: Annotated[Array, Column("p _")]

    def __post_init__(self) -> None:
        """Checks shapes and values."""
        dof = self.robot.dof
        self._check_columns(p=len(self.robot.errors) + 2 * dof * len(self.unmodelled.ripple) + dof)

    @property
    def size(self) -> int:
        """k, the number of directions that are not known."""
        return int(self.root.shape[1])

    def rows(self, postures: Postures) -> Array:
        """Returns the whitened rows A (n, 3, k) that measuring each posture once would give."""
        out = np.empty((len(postures), 3, self.size))
        for part, jacobian, drive, instrument in self._blocks(postures, self.robot):
            noise = instrument + self._rest(drive)
            whiten = np.linalg.inv(np.linalg.cholesky(noise))
            out[part] = whiten @ (jacobian @ self.root)
        return out

    def work_errors(self, postures: Postures, T_flange_tool: Array | None = None) -> WorkErrorPrior:
        """Returns what the error at the postures where the arm will work is made of, base frame.

        Args:
            postures: Where the arm will work.
            T_flange_tool: (4, 4) the requested point; None is the measured reflector.
        """
        robot = self.robot
        if T_flange_tool is not None:
            robot = robot.with_tool(T_flange_tool)
        n = len(postures)
        columns, rest, seen = np.empty((n, 3, self.size)), np.empty((n, 3, 3)), np.empty((n, 3, 3))
        repeat = self.settings.repeatability_sd**2 * np.eye(3)
        for part, jacobian, drive, instrument in self._blocks(postures, robot):
            if T_flange_tool is not None:
                jacobian[:, :, parameter_slice(robot.dof, "tool")] = 0.0
            columns[part] = jacobian @ self.root
            # From which side each joint will come is not known: half its backlash is left.
            half = self.unmodelled.backlash / self.robot.reach
            unknown = np.where(postures.approach[part] == 0.0, half, 0.0)
            back = drive * unknown[:, None, :]
            rest[part] = self._rest(drive) + repeat + back @ np.swapaxes(back, 1, 2)
            seen[part] = instrument - repeat
        return WorkErrorPrior(columns=columns, rest=rest, instrument=seen)

    def _blocks(
        self, postures: Postures, robot: RobotModel
    ) -> Iterator[tuple[IntArray, Array, Array, Array]]:
        """Rows, Jacobian (n, 3, p), drive Jacobian, covariance of instrument and repeatability."""
        layout = ParameterLayout(dof=robot.dof)
        terms = standard_terms(robot.dof, harmonics(len(self.unmodelled.ripple)))
        seen = observations_of(
            robot,
            _build_ideal_set(self.cell, robot, postures),
            self.settings.payload,
            repeatability=self.settings.repeatability_sd,
            rotation_sd=self.settings.rotation_sd,
        )
        at, none = np.zeros(layout.size), np.zeros(sum(term.size for term in terms))
        for item in linear_rows(seen, layout, State(robot=robot), at, terms, none):
            drive = item.columns[:, :, parameter_slice(robot.dof, "theta")] @ robot.joint_map
            yield item.rows, item.columns, drive, item.covariance

    def _rest(self, drive: Array) -> Array:
        """Covariance (n, 3, 3) m^2 of what the linear model leaves out."""
        fast = (self.unmodelled.fast / self.robot.reach) ** 2 * drive @ np.swapaxes(drive, 1, 2)
        return np.asarray(fast + self.unmodelled.white**2 * np.eye(3))


def settings_of(cell: Cell) -> FitSettings:
    """Returns the cell's noise, load, reflector and stiffness."""
    stiffness = None
    if np.isfinite(cell.compliance_prior).all():
        stiffness = StiffnessPrior(
            stiffness=1.0 / cell.compliance_prior, relative_sd=np.array(STIFFNESS_SD)
        )
    return FitSettings(
        payload=cell.payload,
        repeatability=cell.repeatability,
        scales=PriorScales(tool=cell.target_sigma),
        stiffness=stiffness,
    )


def before_measuring(
    cell: Cell, *, settings: FitSettings | None = None, unmodelled: UnmodelledErrors | None = None
) -> LinearModel:
    """Returns the linear model of an arm of which only the type is known.

    Args:
        cell: Robot, reflector and instrument. With an unknown tracker frame the base is as good as
            free: the station takes its place.
        settings: Priors and noise of the fit; the cell's if not given.
        unmodelled: Sizes of what is left out.
    """
    settings = settings_of(cell) if settings is None else settings
    unmodelled = UnmodelledErrors() if unmodelled is None else unmodelled
    robot, scales = cell.measured_robot.nominal(), settings.scales
    if cell.frame == "tracker":
        scales = replace(scales, base=LOOSE, base_rotation=LOOSE)
    belief = prior_belief(
        robot,
        replace(settings, scales=scales),
        ripple=unmodelled.ripple / robot.reach,
        backlash=unmodelled.backlash / robot.reach,
        held="",
    )
    return LinearModel(
        robot=belief.actual,
        cell=cell,
        settings=settings,
        unmodelled=unmodelled,
        root=belief.root.T,
    )


def after_fit(
    model: ErrorModel,
    cell: Cell,
    *,
    settings: FitSettings | None = None,
    unmodelled: UnmodelledErrors | None = None,
) -> LinearModel:
    """Returns the linear model of a calibrated arm, to plan the next poses.

    The model's parameters are used with their covariance; a drive error without a column has its
    prior. Its learned noise and smooth residual are part of the residual.

    Raises:
        ModelMismatchError: A model of another kind, or of another number of joints.
    """
    belief = model.belief()
    if belief is None or model.robot.dof != cell.robot.dof:
        raise ModelMismatchError(
            f"the model is of {model.robot.name} with {model.robot.dof} joints, the cell has "
            f"{cell.robot.name} with {cell.robot.dof}.",
            hint="plan with a model of this cell.",
        )
    settings = settings_of(cell) if settings is None else settings
    unmodelled = UnmodelledErrors() if unmodelled is None else unmodelled
    dof, h = cell.robot.dof, len(unmodelled.ripple)
    size = len(cell.robot.errors)
    full = np.zeros((size + 2 * dof * h + dof,) * 2)
    drives = _drive_sd(cell.measured_robot, unmodelled)
    full[np.diag_indices(len(full))] = np.concatenate([np.zeros(size), drives**2])
    place = _places(belief, size, dof, h)
    carried = place >= 0
    root = np.sqrt(belief.inflation) * belief.root[:, carried]
    full[np.ix_(place[carried], place[carried])] = root.T @ root
    white = float(np.hypot(belief.white, belief.smooth.amplitude))
    return LinearModel(
        robot=belief.actual,
        cell=cell,
        settings=settings,
        unmodelled=replace(unmodelled, white=max(white, unmodelled.white)),
        root=root_of_covariance(full).T,
    )


def _drive_sd(robot: RobotModel, unmodelled: UnmodelledErrors) -> Array:
    """Prior sd in rad of the ripple, joint by joint, sine and cosine, then of the backlash."""
    ripple = np.tile(np.repeat(unmodelled.ripple, 2), robot.dof)
    return np.append(ripple, np.full(robot.dof, unmodelled.backlash)) / robot.reach


def _places(belief: Belief, size: int, dof: int, h: int) -> IntArray:
    """Index of each learned column of a belief here; -1 for a column that does not exist here."""
    place = np.full(len(belief.mean), -1)
    place[:size] = np.arange(size)
    waves, order = belief.place("ripple"), belief.ripple.order
    joint, within = np.divmod(np.arange(len(order)), max(len(order) // dof, 1))
    place[waves] = np.where(order <= h, size + 2 * h * joint + within, -1)
    place[belief.place("backlash")] = size + 2 * dof * h + np.arange(dof)
    known = belief.variance > 0.0  # a drive error that was never learned stays unknown
    known[:size] = True
    return np.where(known, place, -1)


def _build_ideal_set(cell: Cell, robot: RobotModel, postures: Postures) -> MeasurementSet:
    """The set that measuring an error-free arm would give, in base."""
    position = forward(robot.nominal(), postures.joints)[:, :3, 3]
    n, load = len(postures), postures.load
    stated = load is not NO_LOAD
    return MeasurementSet(
        joints=postures.joints,
        position=position,
        covariance=point_covariance(cell.tracker, position, cell.tracker_place),
        wrench=np.broadcast_to(load.wrench, (n, 6)),
        payload_mass=np.broadcast_to(load.mass, (n,)) if stated else np.full(n, np.nan),
        payload_com=np.broadcast_to(load.com, (n, 3)) if stated else np.full((n, 3), np.nan),
        approach=postures.approach,
    )
