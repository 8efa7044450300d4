"""Choose postures to touch one fixed point in, so that an axis without its zero shows."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Note
from robotrue.app.request import Option, Request
from robotrue.app.request_fields import CellOrModel, ToolSigma, TouchSigma, table_output
from robotrue.core.units import DEG, MM
from robotrue.planning.plan_defaults import SEED
from robotrue.validation.validation_defaults import MASTERING_TOUCHES, TOOL_LEAN_DEG, TOUCH_MM


class MasteringPlanRequest(Request):
    """Where the point is, and how it may be touched."""

    cell: CellOrModel
    point_mm: Annotated[str, Option(help="X,Y,Z: roughly where the point is, in base.")]
    output: Annotated[Path, table_output(help="CSV of the touches to write.")]
    postures: Annotated[int, Option(names=("--postures", "-n"), help="How many.")] = (
        MASTERING_TOUCHES
    )
    tool_lean_deg: Annotated[float, Option(help="Largest lean of the tool off straight down.")] = (
        TOOL_LEAN_DEG
    )
    touch_sigma_mm: TouchSigma = TOUCH_MM
    tool_sigma_mm: ToolSigma = None
    seed: Annotated[int, Option(help="Of the attitudes that are tried.")] = SEED


def run(request: MasteringPlanRequest, context: Context) -> PlainResult:
    """Chooses the postures and writes them.

    Raises:
        ConfigurationError: No point, too few touches, or a lean that cannot be.
        ReachError: Too few postures reach the point.
    """
    from robotrue.app.number_options import parse_numbers
    from robotrue.app.registered import open_model, provenance_used
    from robotrue.app.touching_tool import settings_for_touches
    from robotrue.calibration.nominal import NominalModel
    from robotrue.core.files import write_atomic
    from robotrue.planning.arm_scene import scene_of
    from robotrue.planning.mastering_postures import plan_mastering
    from robotrue.planning.order import travel
    from robotrue.planning.plan_sheets import touch_sheet

    point = MM * parse_numbers("--point-mm", request.point_mm, 3, form="X,Y,Z")
    cell, model = open_model(context.cell_file(request.cell))
    arm = NominalModel(robot=cell.robot.nominal()) if model is None else model
    touches = plan_mastering(
        arm,
        cell.robot,
        scene_of(cell, clearance=0.0),
        point,
        request.postures,
        settings=settings_for_touches(cell, arm, request.touch_sigma_mm, request.tool_sigma_mm),
        lean=request.tool_lean_deg * DEG,
        seed=request.seed,
    )
    output = context.output(request.output)
    write_atomic(output, touch_sheet(touches, ("point",)))
    way = travel(touches.joints) / DEG
    return PlainResult(
        values={
            "touches_csv": str(output),
            "touches": len(touches),
            "point_mm": (point / MM).tolist(),
            "joints_deg": (touches.joints / DEG).tolist(),
            "travel_deg": way,
        },
        shown=(
            Note(
                f"{len(touches)} touches written to {output}, {way:.0f} deg of the axis that moves "
                "furthest from one to the next"
            ),
            Note(
                "Touch the point in each posture, put the joints at the touch in place of the "
                "planned ones, then delete the first line."
            ),
        ),
        provenance=provenance_used(cell, model),
    )


OPERATION: Final = Operation(request=MasteringPlanRequest, run=run)
