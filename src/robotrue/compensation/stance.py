"""Pose of the arm before and at the first target of a program, which fixes its configuration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias, TypedDict

import numpy as np

from robotrue.compensation.plan import Plan
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.status import Route
from robotrue.core.arrays import Array, frozen, parse_number_list
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError
from robotrue.program.program import Program
from robotrue.robot.model import RobotModel

_AT_LIMIT: Final = 1e-4
"""rad; a printed posture may be at a limit."""
ChosenBy: TypeAlias = Literal["words", "axis target", "start posture", "middle of the limits"]

_SAID: Final[dict[str, str]] = {
    "words": "from the program's configuration words",
    "axis target": "from the program's axis values",
    "start posture": "the nearest to the start posture",
    "middle of the limits": "the nearest to the middle of the joint limits, since none is stated",
}


class StanceDocument(TypedDict):
    """JSON values of a :class:`Stance`, deg."""

    line: int
    axes_deg: list[float]
    chosen_by: ChosenBy


@dataclass(frozen=True, slots=True, kw_only=True)
class Stance:
    """The arm at the first target that it reaches.

    Attributes:
        line: One-based line of the target.
        axes: (6,) rad, the controller's axis values there, of the nominal arm.
        chosen_by: What chose among the configurations that reach it.
    """

    line: int
    axes: Array
    chosen_by: ChosenBy

    def __post_init__(self) -> None:
        """Freezes the axes."""
        object.__setattr__(self, "axes", frozen(self.axes, (None,), "axes"))

    def document(self) -> StanceDocument:
        """Returns JSON values, deg."""
        degrees = [round(value, 4) + 0.0 for value in (self.axes / DEG).tolist()]
        return {"line": self.line, "axes_deg": degrees, "chosen_by": self.chosen_by}


def sentence(stated: StanceDocument) -> str:
    """Returns :meth:`Stance.document` in words."""
    axes = ", ".join(f"{value:.1f}" for value in stated["axes_deg"])
    return f"line {stated['line']}: the arm is at {axes} deg, {_SAID[stated['chosen_by']]}"


def first_stance(
    robot: RobotModel,
    program: Program,
    plan: Plan,
    settings: CompensationSettings,
    nominal: Array,
) -> Stance | None:
    """Returns the arm at the first target that it reaches, None if there is none.

    Args:
        robot: The nominal arm.
        program: The targets.
        plan: Their treatment.
        settings: Whether a start posture is stated.
        nominal: (n, 6) rad, their nominal joints.
    """
    reached = np.isfinite(nominal[:, 0]) & (plan.route != Route.SKIP)
    if not reached.any():
        return None
    row = int(np.argmax(reached))
    by: ChosenBy = "start posture" if len(settings.home) else "middle of the limits"
    if plan.known[row] > 0:
        by = "words" if plan.route[row] == Route.GIVEN else "axis target"
    axes = robot.controller.to_controller(nominal[row])
    return Stance(line=int(program.line[row]), axes=axes, chosen_by=by)


def start_joints(robot: RobotModel, cell: Array, text: str | None = None) -> Array:
    """Returns the joints (6,) rad of the start posture, empty where none is stated.

    Args:
        robot: The arm.
        cell: (6,) rad, the controller's axis values the cell states; empty: none.
        text: ``A1,..,A6`` in deg, which goes before the cell; None: not stated.

    Raises:
        ConfigurationError: Not one number for each axis, or an axis beyond its limit.
    """
    axes = cell if text is None else _read(text, robot.dof)
    if not len(axes):
        return np.empty(0)
    if len(axes) != robot.dof:
        raise ConfigurationError(
            f"the start posture has {len(axes)} axes, {robot.name} has {robot.dof}.",
            hint="one number for each axis, as the pendant shows them.",
        )
    joints: Array = robot.controller.to_model(axes)
    low, high = robot.limits[:, 0] - _AT_LIMIT, robot.limits[:, 1] + _AT_LIMIT
    beyond = np.flatnonzero((joints < low) | (joints > high))
    if len(beyond):
        axis = int(beyond[0])
        ends = np.tile(joints, (2, 1))
        ends[:, axis] = robot.limits[axis]
        least, most = np.sort(robot.controller.to_controller(ends)[:, axis]) / DEG
        raise ConfigurationError(
            f"the start posture has axis {axis + 1} at {axes[axis] / DEG:g} deg, its limits are "
            f"{least:g} to {most:g} deg.",
            hint="the axis values the pendant shows where the program begins.",
        )
    return joints


def _read(text: str, count: int) -> Array:
    numbers = parse_number_list(text)
    if numbers.size != count:
        raise ConfigurationError(
            f"start posture {text!r}, expected {count} numbers in deg, as the pendant shows the "
            "axes.",
            hint="--start 0,-90,90,0,45,0",
        )
    return numbers * DEG
