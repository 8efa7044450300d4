"""What all targets of a program are compensated with."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.mean_tables import rigid_tables
from robotrue.calibration.model import ErrorModel
from robotrue.compensation.arm_state import ArmState, state_at
from robotrue.compensation.calibrated_arm import CalibratedArm, calibrated_arm
from robotrue.compensation.settings import CompensationSettings
from robotrue.core.arrays import Array, BoolArray
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load

SAME_TOOL: Final = 1e-9
"""m and rad by which a program's tool may differ from the measured one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CompensationSetup:
    """Model, tools and settings, the same for every target of a program.

    Attributes:
        robot: The nominal arm.
        arm: Mean of the model for the tools of the program; that of the nominal arm where the
            model has no tables.
        measured: (t,) which of the tools is the one the model was measured with.
        settings: Guards and tolerances.
        model: For predictions; None where nothing asks for them.
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


def compensation_setup(
    model: ErrorModel,
    T_flange_tool: Array,
    start: Array,
    load: Load,
    settings: CompensationSettings,
) -> CompensationSetup:
    """Returns the setup for a program.

    Args:
        model: Error of the robot.
        T_flange_tool: (t, 4, 4) tools of the program.
        start: Axis values (6,) the program says it starts from, controller's sense; or empty.
        load: Payload and wrench of the program.
        settings: Guards and tolerances.

    Raises:
        ConfigurationError: The arm has not six joints.
    """
    robot = model.robot.nominal()
    measured = np.array(
        [np.allclose(t, robot.T_flange_tool, rtol=0.0, atol=SAME_TOOL) for t in T_flange_tool]
    )
    tables = model.mean_tables(load)
    return CompensationSetup(
        robot=robot,
        arm=calibrated_arm(tables or rigid_tables(robot), T_flange_tool, measured),
        measured=measured,
        settings=_with_start(robot, start, settings),
        model=model,
        has_tables=tables is not None,
    )


def _with_start(
    robot: RobotModel, start: Array, settings: CompensationSettings
) -> CompensationSettings:
    """Returns the settings with the arm at home where its program says it starts, if it does."""
    if len(start) != robot.dof or robot.controller is None:
        return settings
    return replace(settings, home=robot.controller.to_model(start[None])[0])
