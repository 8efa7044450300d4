"""Models of an estimate: kinematics, stiffness, frequency response, tool, deviation.

Nothing is counted twice. A response measured at one pose holds the static deflection of that pose,
arm and tool together. What the stiffness adds at another pose is the *change* of the arm's
compliance since then, with J the Jacobian of the tool point and C the compliance of the joints::

    e = G * f + [J C J^T (q) - J C J^T (q0)] F

G * f is the response in time, F the slow force. A learned deviation contains the changes along the
direction it was learned in; the bracket is then left out along it.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.units import DEG
from robotrue.dynamics.flange_sensor import HeldTool
from robotrue.dynamics.force import MOST
from robotrue.dynamics.learned_deviation import LearnedDeviation
from robotrue.dynamics.oscillators import Oscillators, join_oscillators
from robotrue.dynamics.pose_modes import FlexibleArm, pose_modes
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.robot.forward import drive_jacobian, walk
from robotrue.robot.model import RobotModel

_UNLIKE: Final = 30.0
"""A response this much stiffer or softer at rest than the arm alone is of another unit."""

Axes: TypeAlias = Literal["base", "tool"]


@dataclass(frozen=True, slots=True, kw_only=True)
class JointCompliance(Columns):
    """Joint compliance and its covariance.

    Attributes:
        compliance: (n,) rad/(N m); zero for a joint taken as stiff.
        covariance: (n, n) of it.
    """

    compliance: Annotated[Array, Column("dof", unit="rad/(N m)")]
    covariance: Annotated[Array, Column("dof dof")]

    def _check_rules(self) -> None:
        """Checks the values."""
        if not (self.compliance >= 0.0).all() or not self.compliance.any():
            raise ConfigurationError(
                f"joint compliance {self.compliance} rad/(N m), expected zero or more and one "
                "above zero: joints yield the way they are pushed.",
                hint="state [robot] stiffness_Nm_per_rad, or calibrate with payloads.",
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredResponse(Columns):
    """The tool's frequency response of a hammer test at one pose, as modes.

    Attributes:
        oscillators: In the axes of ``frame``.
        joints: (n,) rad, model joints of the hammer test.
        frame: Frame of the axes it was measured along; with ``tool`` it turns with the tool.
        misfit: Relative error of the response, one standard deviation.
        room: rad, largest distance of a joint from the hammer test.
    """

    oscillators: Oscillators
    joints: Annotated[Array, Column("dof", unit="rad")]
    frame: Axes
    misfit: float = 0.05
    room: float = 45.0 * DEG

    def _check_rules(self) -> None:
        """Checks the values."""
        if self.frame not in ("base", "tool"):
            raise ConfigurationError(
                f"a frequency response along the axes of {self.frame!r}, expected 'base' or 'tool'."
            )
        if not (self.misfit >= 0.0 and self.room > 0.0):
            raise ConfigurationError(
                f"misfit {self.misfit:g} and room {self.room:g} rad, expected zero or more and "
                "more than zero."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseResponse:
    """The tool's response from the arm's masses and stiffness at every pose.

    Attributes:
        arm: Masses, stiffness, damping; its static deflection is that of the whole arm.
        tool: Modes of spindle and tool, base axes.
        misfit: Relative error of the response, one standard deviation.
        refresh: rad, turn of a joint after which the modes are computed again.
    """

    arm: FlexibleArm
    tool: Oscillators
    misfit: float = 0.1
    refresh: float = 0.2 * DEG

    def at(self, joints: Array) -> Oscillators:
        """Returns the response at a pose (n,) rad, base axes."""
        return join_oscillators([pose_modes(self.arm, joints).oscillators(), self.tool])


Response: TypeAlias = MeasuredResponse | PoseResponse


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedPart:
    """The deviation learned of windows, and what cuts a stream into such.

    Attributes:
        model: As fitted.
        spindle: Turns per second.
        window: s, length of a window.
    """

    model: LearnedDeviation
    spindle: float
    window: float = 1.0

    def __post_init__(self) -> None:
        """Checks."""
        if not (self.spindle > 0.0 and self.window * self.spindle >= 1.0):
            raise ConfigurationError(
                f"windows of {self.window:g} s at {self.spindle:g} turns per second, expected a "
                "turn or more in each."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class SensingModels(Columns):
    """Everything :class:`robotrue.online.sensing.Sensing` knows before the first sample.

    Attributes:
        robot: Nominal arm with the tool point; its ``controller`` turns displayed joints into
            model joints.
        rate: Force samples per second.
        compliance: Of the joints, or None: then the response is all there is.
        response: Of the tool, or None: then only the static part is estimated.
        held: Load on the sensor, or None: then gravity and offset stay in the force.
        T_flange_sensor: (4, 4) m, where the sensor sits.
        learned: Deviation, or None.
    """

    robot: RobotModel
    rate: float
    compliance: JointCompliance | None = None
    response: Response | None = None
    held: HeldTool | None = None
    T_flange_sensor: Annotated[Array, Column("4 4")] = field(default_factory=lambda: np.eye(4))
    learned: LearnedPart | None = None

    def _check_rules(self) -> None:
        """Checks that the parts belong together.

        Raises:
            ConfigurationError: Neither compliance nor response; a rate that is not above zero.
            ModelMismatchError: Parts of different arms, or of different units.
        """
        object.__setattr__(self, "robot", self.robot.nominal())
        if not (np.isfinite(self.rate) and self.rate > 0.0):
            raise ConfigurationError(f"{self.rate:g} force samples per second, expected above 0.")
        if self.compliance is None and self.response is None:
            raise ConfigurationError(
                "neither stiffness nor frequency response: the deflection under a force is "
                "unknown.",
                hint="--model of `robotrue calibrate`, [robot] stiffness_Nm_per_rad in the cell, "
                "or --frf of a hammer test.",
            )
        if self.learned is not None and not isinstance(self.response, MeasuredResponse):
            raise ConfigurationError(
                "a learned deviation without a measured frequency response: it is what the "
                "prediction by the response leaves out.",
                hint="--frf with the response its windows were predicted with.",
            )
        self._check_dof()
        self._check_arms()
        self._check_units()

    def _check_dof(self) -> None:
        n = self.robot.dof
        sizes = {}
        if self.compliance is not None:
            sizes["stiffness"] = len(self.compliance.compliance)
        if isinstance(self.response, MeasuredResponse):
            sizes["the pose of the frequency response"] = len(self.response.joints)
        for name, size in sizes.items():
            if size != n:
                raise ModelMismatchError(f"{name} has {size} joints, {self.robot.name} has {n}.")

    def _check_arms(self) -> None:
        others = {}
        if self.learned is not None:
            others["the learned deviation"] = self.learned.model.arm.robot
        if isinstance(self.response, PoseResponse):
            others["the flexible arm"] = self.response.arm.robot
        for name, other in others.items():
            if not _same_arm(self.robot, other):
                raise ModelMismatchError(
                    f"{name} is of {other.name}, with another geometry or tool point than "
                    f"{self.robot.name} of the cell.",
                    hint="the same cell.toml for all of them.",
                )

    def _check_units(self) -> None:
        """A response that is no receptance in m/N is thousands of times off at rest."""
        if self.compliance is None or not isinstance(self.response, MeasuredResponse):
            return
        arm = self.arm_at(self.response.joints, self.response.frame)
        rest = self.response.oscillators.static
        moved = np.flatnonzero(np.abs(rest).any(axis=1) & (np.diag(rest) != 0.0))
        for i in moved:
            ratio = rest[i, i] / max(arm[i, i], 1e-300)
            if not 1.0 / _UNLIKE < ratio < _UNLIKE:
                raise ModelMismatchError(
                    f"at rest the frequency response yields {rest[i, i]:.3g} m/N along "
                    f"{'xyz'[i]}, the joints of the arm {arm[i, i]:.3g} m/N.",
                    hint="a receptance in m/N, not an accelerance; its axes as stated; the pose "
                    "of the hammer test.",
                )

    def arm_at(self, joints: Array, frame: Axes = "base") -> Array:
        """Returns J C J^T (3, 3) m/N of the tool point at a pose, zero without compliance."""
        if self.compliance is None:
            return np.zeros((3, 3))
        state = walk(self.robot, np.asarray(joints)[None])
        jacobian = drive_jacobian(self.robot, state)[0, :3]
        bend = (jacobian * self.compliance.compliance) @ jacobian.T
        if frame == "tool":
            turn = state.rotation[0]
            bend = turn.T @ bend @ turn
        return np.asarray(bend)


def _same_arm(one: RobotModel, two: RobotModel) -> bool:
    names = ("theta", "d", "a", "alpha", "joint_map", "T_flange_tool")
    return one.convention == two.convention and all(
        np.shape(getattr(one, name)) == np.shape(getattr(two, name))
        and np.allclose(getattr(one, name), getattr(two, name), atol=1e-6)
        for name in names
    )


_MAY_BE_ZERO: Final = ("bridged", "force_noise", "force_zero", "acceleration_samples")


@dataclass(frozen=True, slots=True, kw_only=True)
class SensingSettings:
    """Settings for computing estimates from samples.

    Attributes:
        joints_age: s; joints older than this do not determine the arm's pose.
        static_band: Hz; a change of the arm's compliance acts below it. Below the arm's first
            mode, above the changes of the cut.
        bridged: Missing or invalid force samples in a row that a straight line crosses; after more
            the filters restart.
        force_noise: N, standard deviation of a force sample; that of the held tool where known.
        force_zero: N, standard deviation of the sensor's zero, each axis; of the held tool's
            offset and weight where that is known.
        force_most: N; the sensor's range. A force at or beyond it is saturated or not in N.
        lever: m; the cut's moment about the tool point over its force. Beyond it the stated sensor
            axes or tool point are wrong.
        acceleration_samples: Joint samples in the parabola that gives the acceleration of the
            payload; 0 subtracts none.
    """

    joints_age: float = 0.1
    static_band: float = 2.0
    bridged: int = 2
    force_noise: float = 0.5
    force_zero: float = 0.4
    force_most: float = MOST
    lever: float = 0.05
    acceleration_samples: int = 25

    def __post_init__(self) -> None:
        """Checks.

        Raises:
            ConfigurationError: A value below zero, or zero where that has no sense.
        """
        for name, value in asdict(self).items():
            least = name in _MAY_BE_ZERO
            if not (np.isfinite(value) and (value >= 0.0 if least else value > 0.0)):
                raise ConfigurationError(
                    f"{name} is {value}, expected {'zero or more' if least else 'above zero'}."
                )
        if 0 < self.acceleration_samples < 5:
            raise ConfigurationError(
                f"acceleration_samples is {self.acceleration_samples}, expected 5 or more, or 0."
            )
