"""Effect of joint compliance on the error of a window, one term per joint.

Under the mean force F the tool moves along u by ``sum_i (u.J_i) (J^T F)_i / K_i``. With the
stiffnesses of a data sheet these are the regressors of the deviation; a factor near one on each is
learned. J carries the coupling of a parallel rod.

A prediction from the response of one pose contains its static compliance times the mean force, at
every pose. A deviation learned at other poses must subtract it; a known value saves another pass:
along a single pass a constant compliance and a factor on all joints cannot be separated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.columns import Column, Columns
from robotrue.dynamics.frf import AXES
from robotrue.dynamics.interpolation import ResponseCurve
from robotrue.dynamics.windows import WindowSet
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.robot.forward import drive_jacobian, walk
from robotrue.robot.model import RobotModel

LIMIT_SLACK: Final = 1e-3
"""rad; measured joints may lie this far beyond a limit."""
OWN_PART: Final = 0.10
ANY_PART: Final = 0.03
"""Standard deviation of an entry, relative to its size and to that of the whole row. The row of a
hammer test is that of an unloaded arm, tool included; not that of the arm that cuts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CompliantArm(Columns):
    """The user's knowledge of the arm: geometry, stiffness, direction of the error.

    Attributes:
        robot: Kinematics and tool.
        stiffness: (n,) N m/rad, as stated; inf for a joint taken as stiff.
        direction: (3,) unit vector in base along which the error counts positive.
    """

    robot: RobotModel
    stiffness: Annotated[Array, Column("dof", unit="N m/rad", inf=True)]
    direction: Annotated[Array, Column("3")]

    def __post_init__(self) -> None:
        """Checks the values."""
        self._check_columns(dof=self.robot.dof)
        if not (self.stiffness > 0.0).all():
            raise ConfigurationError(
                f"stiffness {self.stiffness} N m/rad, expected numbers above zero.",
                hint="stiffness of each joint from the data sheet, to a factor of 1.5.",
            )
        if not np.isfinite(self.stiffness).any():
            raise ConfigurationError(
                "no joint of the arm has a stiffness: nothing deflects.",
                hint="state [robot] stiffness in the cell file.",
            )
        if abs(float(np.linalg.norm(self.direction)) - 1.0) > 1e-6:
            raise ConfigurationError(
                f"direction {self.direction} of the error is not a unit vector."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class PhysicsTerms:
    """The compliant arm at n windows.

    Attributes:
        by_joint: (n, dof) m, error of each joint's bending under the mean force.
        compliance: (n, 3) m/N, error over force along base x, y, z.
        place: (n, 3) m, tool point.
        outside: (n,) a joint is beyond its limits.
    """

    by_joint: Array
    compliance: Array
    place: Array
    outside: BoolArray


def physics_terms(arm: CompliantArm, windows: WindowSet) -> PhysicsTerms:
    """Returns the bending of the stated arm in each window.

    Raises:
        ModelMismatchError: Windows of another number of joints.
    """
    robot = arm.robot
    if windows.joints.shape[1] != robot.dof:
        raise ModelMismatchError(
            f"windows with {windows.joints.shape[1]} joints, {robot.name} has {robot.dof}."
        )
    state = walk(robot.nominal(), windows.joints)
    jacobian = drive_jacobian(robot.nominal(), state)[:, :3]
    torque = np.einsum("nij,ni->nj", jacobian, windows.force)
    lever = np.einsum("i,nij->nj", arm.direction, jacobian) / arm.stiffness
    low, high = robot.limits[:, 0] - LIMIT_SLACK, robot.limits[:, 1] + LIMIT_SLACK
    return PhysicsTerms(
        by_joint=lever * torque,
        compliance=np.einsum("nj,nij->ni", lever, jacobian),
        place=state.position,
        outside=np.asarray(((windows.joints < low) | (windows.joints > high)).any(axis=1)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticCompliance(Columns):
    """Displacement along the direction of the error over a constant force.

    Attributes:
        value: (3,) m/N per force along base x, y, z, as the prediction contains it.
        sd: (3,) m/N, its standard deviation given the arm and the joints' factors.
    """

    value: Annotated[Array, Column("3", unit="m/N")]
    sd: Annotated[Array, Column("3", unit="m/N")]

    def _check_rules(self) -> None:
        """Checks the values."""
        if not (self.sd > 0.0).all():
            raise ConfigurationError(f"sd {self.sd} m/N of a static row, expected above zero.")

    def wider(self, times: float) -> StaticCompliance:
        """Returns the row with its standard deviations multiplied."""
        return replace(self, sd=self.sd * times)


def static_compliance(value: Array) -> StaticCompliance:
    """Returns a row (3,) m/N with the usual standard deviations."""
    value = np.asarray(value, dtype=np.float64)
    size = float(np.linalg.norm(value))
    return StaticCompliance(value=value, sd=OWN_PART * np.abs(value) + ANY_PART * size)


def compliance_of(curve: ResponseCurve, direction: Array) -> StaticCompliance:
    """Returns the static row of a response whose axes are those of base.

    Args:
        curve: As predictions are made with.
        direction: (3,) unit vector in base along which the error counts positive.

    Raises:
        ModelMismatchError: The response has no displacement along the direction.
    """
    frf = curve.frf
    missing = [
        axis
        for axis, part in zip(AXES, direction, strict=True)
        if abs(part) > 1e-9 and axis not in frf.response_axes
    ]
    if missing:
        raise ModelMismatchError(
            f"the response holds no displacement along {missing[0]}, the error has one.",
            source=frf.source,
            hint="--direction along an axis of the hammer test.",
        )
    value = np.zeros(3)
    rest = curve.at_rest
    for j, axis in enumerate(frf.excitation_axes):
        for i, moved in enumerate(frf.response_axes):
            value[AXES.index(axis)] += direction[AXES.index(moved)] * rest[i, j]
    return static_compliance(value)
