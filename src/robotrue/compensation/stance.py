"""How the arm stands at the first target of a program, and what said so."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias

import numpy as np

from robotrue.compensation.plan import Plan
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.status import Route
from robotrue.core.arrays import Array, frozen
from robotrue.core.units import DEG
from robotrue.program.program import Program
from robotrue.robot.model import RobotModel

ChosenBy: TypeAlias = Literal["words", "axis target", "start posture", "middle of the limits"]

_SAID: Final[dict[str, str]] = {
    "words": "as the program's configuration words say",
    "axis target": "as the program's axis values say",
    "start posture": "the nearest to the start posture",
    "middle of the limits": "the nearest to the middle of the joint limits, since nothing says it",
}


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

    def document(self) -> dict[str, Any]:
        """Returns JSON values, deg."""
        degrees = [round(value, 4) + 0.0 for value in (self.axes / DEG).tolist()]
        return {"line": self.line, "axes_deg": degrees, "chosen_by": self.chosen_by}


def sentence(stated: dict[str, Any]) -> str:
    """Returns :meth:`Stance.document` in words."""
    axes = ", ".join(f"{value:.1f}" for value in stated["axes_deg"])
    return f"line {stated['line']}: the arm stands at {axes} deg, {_SAID[stated['chosen_by']]}"


def first_stance(
    robot: RobotModel,
    program: Program,
    plan: Plan,
    settings: CompensationSettings,
    first: int,
    nominal: Array,
) -> Stance | None:
    """Returns the arm at the first target of a chunk that it reaches, None if there is none.

    Args:
        robot: The nominal arm.
        program: The targets.
        plan: Their treatment.
        settings: Whether a start posture is stated.
        first: Row of the first target of the chunk.
        nominal: (n, 6) rad, nominal joints of the chunk.
    """
    route = plan.route[first : first + len(nominal)]
    reached = np.isfinite(nominal[:, 0]) & (route != Route.SKIP)
    if not reached.any() or robot.controller is None:
        return None
    local = int(np.argmax(reached))
    by: ChosenBy = "start posture" if len(settings.home) else "middle of the limits"
    if plan.known[first + local] > 0:
        by = "words" if route[local] == Route.GIVEN else "axis target"
    axes = robot.controller.to_controller(nominal[local])
    return Stance(line=int(program.line[first + local]), axes=axes, chosen_by=by)
