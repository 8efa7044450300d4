"""A plan of poses as a KRL program and as JSON values."""

from __future__ import annotations

from typing import Any

from robotrue.cell.cell import Cell
from robotrue.core.units import DEG, MM
from robotrue.errors import ModelMismatchError
from robotrue.planning.pose_plan import PosePlan
from robotrue.program.formats.krl_measure import Trigger, measuring_program
from robotrue.robot.configuration import controller_axes


def measuring_krl(cell: Cell, plan: PosePlan, name: str, trigger_output: int) -> bytes:
    """Returns the KRL program ``name`` that measures the poses.

    Raises:
        ModelMismatchError: The controller is no KUKA.
    """
    if cell.robot.maker != "kuka":
        raise ModelMismatchError(
            f"{cell.robot.name} is of maker {cell.robot.maker!r}; programs are written in KRL, for "
            "KUKA controllers.",
            hint="take the joints from the CSV.",
        )
    return measuring_program(
        name,
        controller_axes(cell.robot, plan.joints),
        controller_axes(cell.robot, plan.pre),
        Trigger(output=trigger_output),
    )


def plan_document(plan: PosePlan) -> dict[str, Any]:
    """Returns the plan as JSON values: mm, deg."""
    expected = plan.expected
    return {
        "poses": len(plan),
        "criterion": plan.criterion,
        "seed": plan.seed,
        "candidates": plan.candidates,
        "drawn": plan.drawn,
        "rejected": dict(plan.rejected),
        "stopped": plan.stopped,
        "expected_mean_mm": expected.mean / MM,
        "expected_rms_mm": expected.rms / MM,
        "random_mean_mm": expected.random_mean / MM,
        "random_low_mm": expected.random_low / MM,
        "random_high_mm": expected.random_high / MM,
        "floor_mean_mm": expected.floor_mean / MM,
        "joints_deg": plan.joints / DEG,
        "pre_position_deg": plan.pre / DEG,
        "approach": plan.approach.astype(int),
        "load": plan.load,
        "loads": [
            {"mass_kg": float(load.mass[0]), "centre_of_mass_mm": load.com[0] / MM}
            for load in plan.loads
        ],
        "commanded_mm": plan.position / MM,
        "rank": plan.rank,
        "travel_deg": plan.travel / DEG,
        "travel_as_chosen_deg": plan.travel_as_chosen / DEG,
        "notes": list(plan.notes),
    }
