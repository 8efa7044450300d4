"""Settings that all targets of a program share: load, guards, the arm, its model."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final, Literal, TypeAlias

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.calibration.terms.term import rigid_tables
from robotrue.compensation.arm_state import ArmState, state_at
from robotrue.compensation.calibrated_arm import CalibratedArm, calibrated_arm
from robotrue.core.arrays import Array, BoolArray, frozen
from robotrue.core.conditions import no_conditions
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.program.compensation_defaults import MAX_SHIFT_MM
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import NO_LOAD, Load

ApproachRule: TypeAlias = Literal["path", "unknown"]
"""``path``: the sign of each joint's last motion is that between targets; ``unknown``: none."""
SAME_TOOL: Final = 1e-9
"""m and rad by which a program's tool may differ from the measured one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CompensationSettings:
    """Load, guards and tolerances. SI.

    Attributes:
        load: Payload, and the wrench if ``wrench`` is not given; one row for the program or one
            per target.
        wrench: (6,) for the program or (n, 6) per target: N and N m on the tool, at the tool
            point, in base axes. Empty takes the wrench of ``load``.
        home: (6,) rad, joints before the first target, unless the program states them; empty: not
            known, assumed in the middle of the limits.
        alike: m by which the predicted errors of two configurations of the arm may differ where the
            configuration is not stated; targets with more are left alone.
        axis_targets: Compensate axis targets too.
        approach: Source of the sign of the last motion, for backlash.
        max_shift: m, largest correction of the position.
        max_turn: rad, largest correction of the rotation.
        min_shift: m and rad; a correction smaller than this is none.
        min_singular_value: Of the Jacobian with metres divided by half the reach.
        min_wrist_angle: rad between axes 4 and 6.
        max_joint_step: rad a joint may turn between two targets of a straight or circular move.
        tolerance: m left between actual tool and target.
        turn_tolerance: rad left.
        covariance: Also predict the covariance at every target (slower).
        max_sigma: m; with ``covariance``, targets with a larger predicted deviation are noted.
    """

    load: Load = NO_LOAD
    wrench: Array = field(default_factory=lambda: np.empty(0))
    home: Array = field(default_factory=lambda: np.empty(0))
    axis_targets: bool = False
    approach: ApproachRule = "path"
    alike: float = 0.05e-3
    max_shift: float = MAX_SHIFT_MM * MM
    max_turn: float = 1.0 * DEG
    min_shift: float = 1e-9
    min_singular_value: float = 5e-3
    min_wrist_angle: float = 0.5 * DEG
    max_joint_step: float = 90.0 * DEG
    tolerance: float = 1e-7
    turn_tolerance: float = 1e-7
    covariance: bool = False
    max_sigma: float = 0.2e-3

    def __post_init__(self) -> None:
        """Checks that every limit is a positive number and freezes the arrays."""
        for name in ("max_shift", "max_turn", "max_joint_step", "tolerance", "turn_tolerance"):
            self._require_positive(name, zero=False)
        for name in ("min_shift", "min_singular_value", "min_wrist_angle", "max_sigma", "alike"):
            self._require_positive(name, zero=True)
        if self.approach not in ("path", "unknown"):
            raise ConfigurationError(f"approach {self.approach!r}, expected 'path' or 'unknown'.")
        wrench = np.asarray(self.wrench, dtype=np.float64)
        if wrench.size:
            rows = frozen(np.atleast_2d(wrench), (None, 6), "wrench")
            object.__setattr__(self, "wrench", rows)
            if self.load.wrench.any():
                raise ConfigurationError(
                    "the wrench is given twice, in load and in wrench.",
                    hint="leave it out of the load.",
                )
        if np.size(self.home):
            object.__setattr__(self, "home", frozen(self.home, (6,), "home"))

    def _require_positive(self, name: str, *, zero: bool) -> None:
        value = float(getattr(self, name))
        if not (value > 0.0 or (zero and value == 0.0)):
            raise ConfigurationError(
                f"{name} is {value}, expected a number {'not below' if zero else 'above'} 0."
            )

    def load_for(self, count: int) -> Load:
        """Returns payload and wrench, checked against the number of targets.

        Raises:
            ConfigurationError: Neither one row nor one per target.
        """
        wrench = self.wrench if self.wrench.size else self.load.wrench
        load = replace(self.load, wrench=wrench)
        for name in ("mass", "com", "wrench"):
            rows = len(getattr(load, name))
            if rows not in (1, count):
                raise ConfigurationError(
                    f"{name} of the load has {rows} rows, the program {count} targets.",
                    hint="give one row, or one per target in file order.",
                )
        return load


@dataclass(frozen=True, slots=True, kw_only=True)
class CompensationSetup:
    """Model, tools and settings, the same for every target of a program.

    Attributes:
        robot: The nominal arm.
        arm: Mean of the model for the tools of the program; that of the nominal arm where the
            model has no tables.
        measured: (t,) which of the tools is the one the model was measured with.
        settings: Guards and tolerances.
        model: For predictions; None where they are not needed.
        has_tables: Whether ``arm`` is the mean of the model; errors are predicted otherwise.
    """

    robot: RobotModel
    arm: CalibratedArm
    measured: BoolArray
    settings: CompensationSettings
    model: ErrorModel | None
    has_tables: bool

    def start_state(self) -> ArmState:
        """Returns the arm before the first target of the program."""
        home = self.settings.home
        stated = len(home) > 0
        return state_at(home if stated else self.arm.limits.mean(axis=1), stated=stated)


def is_on_table(model: ErrorModel, external: Array | None) -> bool:
    """Returns whether the model has errors of axes that carry a target; external (n, 6)."""
    if external is None:
        return False
    return not model.tables_hold(replace(no_conditions(len(external)), external=external))


def compensation_setup(
    model: ErrorModel,
    T_flange_tool: Array,
    start: Array,
    settings: CompensationSettings,
    external: Array | None = None,
) -> CompensationSetup:
    """Returns the setup for a program.

    Args:
        model: Error of the robot.
        T_flange_tool: (t, 4, 4) tools of the program.
        start: Axis values (6,) at which the program states its start, controller's sense; or empty.
        settings: Guards and tolerances.
        external: (n, 6) m or rad, external axes of the targets; None: none is described.

    Raises:
        ConfigurationError: The arm has not six joints.
    """
    robot = model.robot.nominal()
    if len(start) == robot.dof:
        settings = replace(settings, home=robot.controller.to_model(start[None])[0])
    measured = np.array(
        [np.allclose(t, robot.T_flange_tool, rtol=0.0, atol=SAME_TOOL) for t in T_flange_tool]
    )
    tables = None if is_on_table(model, external) else model.mean_tables()
    return CompensationSetup(
        robot=robot,
        arm=calibrated_arm(tables or rigid_tables(robot), T_flange_tool, measured),
        measured=measured,
        settings=settings,
        model=model,
        has_tables=tables is not None,
    )
