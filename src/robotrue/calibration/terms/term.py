"""Contract of one physical error term of an arm; all code about a term is in its file.

A calibrated arm is its nominal tables, the error vector of :class:`RobotModel` (geometry and
compliance) and any number of terms with parameters v:

    q_drive = (1 + gear) q + compliance * torque + sum of drive_shift(v)
    x       = chain(q_drive) + sum of tip_shift(v)

Fits, updates, registration, transfer and prediction use a term through its columns: the derivative
of whatever is observed by v. A term that is not linear in v linearises at v.

:class:`MeanTables` is the mean of all terms as flat arrays, which a scalar kernel evaluates in a
microsecond:

    q_drive  = (1 + gear) q + ripple(q) + backlash * approach + compliance * torque(q, load)
    T_actual = chain(theta = joint_map @ q_drive + theta_0 + dtheta) ; p += residual(q)

with ``ripple_i(q_i) = sum_k A[i, k] sin(N_k q_i) + B[i, k] cos(N_k q_i)`` and
``residual(q) = sum_m W[m] exp(-|s(q) - C[m]|^2 / 2)``, ``s(q) = scale * [sin q, cos q]``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Final, Literal, Self, TypeAlias

import numpy as np

from robotrue.calibration.evidence import PriorGroup
from robotrue.core.arrays import Array
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.core.conditions import ArmConditions, no_conditions
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.program.external_axes import ExternalAxis
from robotrue.robot.forward import Sensitivity
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.statics import add_moments

REST_SHIFT: Final = 1e-6
REST_TURN: Final = 1e-7
"""Sd of harmonics for which the data show no effect, in m and rad."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeanTables(Columns):
    """Mean of a rigid-flexible model with joint ripple and a smooth residual.

    Attributes:
        robot: The actual robot: nominal geometry plus identified errors.
        harmonics: (h,) cycles per revolution N.
        ripple_sin: (dof, h) rad, A.
        ripple_cos: (dof, h) rad, B.
        backlash: (dof,) rad per unit of approach sign.
        centres: (m, 2 dof) scaled feature centres C; m = 0 without a smooth residual.
        scale: (2 dof,) 1 / length of each feature.
        weights: (m, 3) m, W, base axes.
    """

    robot: RobotModel
    harmonics: Annotated[Array, Column("h")]
    ripple_sin: Annotated[Array, Column("dof h", unit="rad")]
    ripple_cos: Annotated[Array, Column("dof h", unit="rad")]
    backlash: Annotated[Array, Column("dof", unit="rad")]
    centres: Annotated[Array, Column("m features")]
    scale: Annotated[Array, Column("features")]
    weights: Annotated[Array, Column("m 3", unit="m")]

    def __post_init__(self) -> None:
        """Checks shapes and values."""
        dof = self.robot.dof
        self._check_columns(dof=dof, features=2 * dof)


def rigid_tables(robot: RobotModel) -> MeanTables:
    """Returns tables without ripple, backlash or residual: geometry and compliance alone."""
    dof = robot.dof
    return MeanTables(
        robot=robot,
        harmonics=np.zeros(0),
        ripple_sin=np.zeros((dof, 0)),
        ripple_cos=np.zeros((dof, 0)),
        backlash=np.zeros(dof),
        centres=np.zeros((0, 2 * dof)),
        scale=np.ones(2 * dof),
        weights=np.zeros((0, 3)),
    )


# How values carry over to another campaign or arm: with the correlation of drive errors, of the
# smooth residual, or unchanged.
Carry: TypeAlias = Literal["waves", "field", "same"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmPostures(Columns):
    """n postures, and the conditions that a term may depend on.

    Attributes:
        joints: (n, dof) rad, commanded.
        torque: (n, dof) N m on the drives by stated masses, payload and wrench, at the nominal
            posture.
        weight: (n, dof, 2, dof) m^2/s^2, torque on the drives per first moment of the links.
        approach: (n, dof) sign of the last motion of each joint; 0 or empty: unknown.
        conditions: Temperature, time, external axes; not stated if empty.
    """

    joints: Annotated[Array, Column("n dof", unit="rad")]
    torque: Annotated[Array, Column("n dof", unit="N m")]
    weight: Annotated[Array, Column("n dof 2 dof", unit="m^2/s^2", fill=0.0)] = EMPTY
    approach: Annotated[Array, Column("n dof", fill=0.0)] = EMPTY
    conditions: Annotated[ArmConditions, Column("n", fill=no_conditions)] = EMPTY

    def __len__(self) -> int:
        return len(self.joints)

    def torque_on(self, robot: RobotModel) -> Array:
        """Returns the torque (n, dof) N m on the drives of an arm, its own moments included."""
        if not robot.moments.any():
            return self.torque
        return self.torque + add_moments(self.weight, robot.moments)


def without_errors(tables: MeanTables, groups: Sequence[str]) -> MeanTables:
    """Returns the tables with some groups of the robot's error vector at zero."""
    errors = np.array(tables.robot.errors)
    for group in groups:
        errors[parameter_slice(tables.robot.dof, group)] = 0.0
    return replace(tables, robot=tables.robot.with_errors(errors))


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """Effect of a term at n postures; None is no effect.

    Attributes:
        drive_shift: (n, dof) rad added to the drive angles.
        tip_shift: (n, 3) m added to the tool point, base axes.
        error_shift: (n, 9 dof + 12) added to the error vector of the arm, as far as the pose of
            the tool is linear in it.
        uncarried: (n,) m^2 per axis of the term's prior variance that no parameter carries.
        other_tool: m^2 per axis added for another tool point than the measured one.
    """

    drive_shift: Array | None = None
    tip_shift: Array | None = None
    error_shift: Array | None = None
    uncarried: Array | None = None
    other_tool: float = 0.0


class Term(ABC):
    """One physical error: its parameters, columns, prior, needs and archive.

    A new term is one file with a subclass and one call of
    :func:`~robotrue.calibration.terms.term_registry.register`; see CONTRIBUTING, "An error term".
    """

    __slots__ = ()

    name: ClassVar[str]
    """Unique; a term that is not of the standard set names its arrays in an archive by it."""
    carry: ClassVar[Carry] = "same"
    linear: ClassVar[bool] = True
    """Whether the effect is linear in the parameters."""
    export_name: ClassVar[str] = ""
    """The part that exports may leave out; empty: the tables hold it in the robot's errors."""

    @property
    @abstractmethod
    def parameters(self) -> tuple[str, ...]:
        """Names of the k parameters."""

    @property
    @abstractmethod
    def unit(self) -> str:
        """Unit of the parameters."""

    @property
    def size(self) -> int:
        """k, the number of parameters."""
        return len(self.parameters)

    @abstractmethod
    def columns(self, robot: RobotModel, at: ArmPostures, by: Sensitivity, values: Array) -> Array:
        """Returns d(observed)/d(parameters), shape (n, m, k).

        Args:
            robot: The arm with the errors it is linearised at.
            at: Postures and conditions.
            by: How the observed numbers answer to drives, tool point and error vector.
            values: (k,) indices of the parameters.
        """

    @abstractmethod
    def effect(self, robot: RobotModel, at: ArmPostures, values: Array) -> Effect:
        """Returns what the term with parameters ``values`` (k,) does; arguments as above."""

    @abstractmethod
    def groups(self, *, few: bool) -> Sequence[PriorGroup]:
        """Returns the prior: groups of parameters that share a learned scale, columns from 0.

        Args:
            few: The rows are too few for the scale of each group.
        """

    def uncarried_covariance(self, at: ArmPostures, other: ArmPostures) -> Array | None:
        """Returns the covariance (n, k) m^2 per axis between postures of what is uncarried."""
        return None

    def under(self, conditions: ArmConditions) -> Term:
        """Returns the term with conditions (1 row) that hold where a posture states none.

        The term itself where they do not touch it.
        """
        return self

    def remark(self, conditions: ArmConditions) -> str:
        """Returns what a user should know of a program under conditions (1 row); or empty."""
        return ""

    def lacking(self, conditions: ArmConditions) -> str:
        """Returns what postures of a program must state and do not; empty by default."""
        return ""

    def prior_variance(self, values: Array, variance: Array) -> Array:
        """Returns the prior variance (k,) that a posterior of mean and variance (k,) came from."""
        return np.asarray(values**2 + variance)

    @abstractmethod
    def in_tables(self, tables: MeanTables, values: Array) -> MeanTables | None:
        """Returns the tables with the term's mean added; None if they cannot hold it."""

    def contradicts(self, axes: Sequence[ExternalAxis]) -> str:
        """Returns which external axes of a cell are not those of the term; empty by default."""
        return ""

    def beyond_tables(self, conditions: ArmConditions) -> bool:
        """Returns whether a posture under some conditions (n rows) needs more than the tables."""
        return False

    @staticmethod
    def out_of_tables(tables: MeanTables) -> MeanTables:
        """Returns the tables without this term, where :attr:`export_name` names it."""
        return tables

    @classmethod
    @abstractmethod
    def begin(cls, robot: RobotModel, measurements: MeasurementSet, few: bool) -> Self | None:
        """Returns the term a fit of these rows should try; None where they cannot show it."""

    def sentences(self, values: Array, variance: Array) -> Sequence[str]:
        """Returns what a reader of the calibration should know; nothing by default.

        Args:
            values: (k,) posterior mean of the parameters.
            variance: (k,) posterior variance; 0 where a parameter was not learned.
        """
        return ()

    @abstractmethod
    def arrays(self, values: Array) -> Mapping[str, Array]:
        """Returns structure and parameters as named arrays for an archive."""

    def document(self) -> Mapping[str, object]:
        """Returns JSON values that belong to :meth:`arrays`."""
        return {}

    @classmethod
    @abstractmethod
    def restore(
        cls, robot: RobotModel, document: Mapping[str, object], arrays: Mapping[str, Array]
    ) -> tuple[Self, Array]:
        """Returns the term and its parameters (k,) from what it archived.

        Raises:
            ArchiveError: Parts that are missing or cannot be.
        """
