"""Plan a campaign: which tilts, forces and heights to clamp at, in which order."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Note, count
from robotrue.app.request import InputFile, Option, Request
from robotrue.app.request_fields import table_output
from robotrue.core.units import DEG, MM
from robotrue.drilling.drill_defaults import CHOSEN_BY, By
from robotrue.errors import ConfigurationError

NEXT: Final = (
    "Turn the head to a_deg, b_deg off the calibration plane, bring the foot down out of its "
    "rest position every time, clamp, and fill in the readings less their zero."
)


class DrillPlanRequest(Request):
    """Which foot is clamped, how often, and between which limits."""

    foot: Annotated[Path, InputFile(argument="FOOT", help="Foot file (TOML).")]
    output: Annotated[Path, table_output(help="Execution sheet (CSV) to write.")]
    clamps: Annotated[int, Option(help="How many; 15 at least.")] = 60
    forces_N: Annotated[str, Option(names=("--forces-n",), help="Clamp forces in N.")] = (
        "0,250,500,750,1000"
    )
    z_mm: Annotated[str, Option(help="Heights in mm.")] = "-100,0,100"
    tilt_deg: Annotated[float, Option(help="Largest tilt in deg.")] = 4.0
    by: Annotated[By, Option(help="information or chance.")] = CHOSEN_BY
    seed: Annotated[int, Option(help="Of tilts and order.")] = 0


def run(request: DrillPlanRequest, context: Context) -> PlainResult:
    """Writes the execution sheet of a campaign.

    Raises:
        ConfigurationError: More tilt than the foot follows, or too few clamps.
    """
    from robotrue.app.number_options import parse_numbers
    from robotrue.drilling.campaign_csv import write_sheet
    from robotrue.drilling.campaign_plan import plan_campaign
    from robotrue.drilling.foot_file import read_foot

    foot = read_foot(request.foot).foot
    if request.tilt_deg * DEG > foot.max_tilt:
        raise ConfigurationError(
            f"--tilt-deg {request.tilt_deg:g}, the foot follows up to {foot.max_tilt / DEG:g} deg.",
            hint="a smaller tilt, or max_tilt_deg of the foot.",
        )
    plan = plan_campaign(
        request.clamps,
        forces=parse_numbers("--forces-n", request.forces_N, hint="--forces-n 0,250,500"),
        heights=parse_numbers("--z-mm", request.z_mm, hint="--z-mm 0,250,500") * MM,
        largest=request.tilt_deg * DEG,
        seed=request.seed,
        by=request.by,
    )
    output = context.output(request.output)
    write_sheet(output, plan, len(foot.radius))
    planned = f"{count(len(plan), 'clamp')} planned by {request.by}, written to {output}"
    return PlainResult(
        values={
            "output": str(output),
            "clamps": len(plan),
            "by": request.by,
            "seed": request.seed,
        },
        shown=(Note(planned), Note(NEXT)),
    )


OPERATION: Final = Operation(request=DrillPlanRequest, run=run)
