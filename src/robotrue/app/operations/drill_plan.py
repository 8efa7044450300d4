"""Plan a campaign: which tilts, forces and heights to clamp at, in which order."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Note, count
from robotrue.app.request import InputFile, Option, Request
from robotrue.app.request_fields import table_output
from robotrue.core.units import DEG, MM
from robotrue.drilling.drill_defaults import CHOSEN_BY, By
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.drilling.campaign_plan import Plates
    from robotrue.drilling.head import Head

PLATES: Final = 5
ON_PLATES: Final = (
    "Set a calibration plane up for each plate, square to the spindle at its A and B, clamp at "
    "every axis_A_deg, axis_B_deg, and fill in the readings and the tilt measured from outside."
)
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
    axis_a_deg: Annotated[
        str | None,
        Option(
            help="Range of the machine's A that plates face over, such as -30,30: what A itself "
            "does, a sag, can then be learned."
        ),
    ] = None
    axis_b_deg: Annotated[str | None, Option(help="Range of the machine's B likewise.")] = None
    plates: Annotated[int, Option(help="With such a range: how many plates.")] = PLATES


def run(request: DrillPlanRequest, context: Context) -> PlainResult:
    """Writes the execution sheet of a campaign.

    Raises:
        ConfigurationError: More tilt than the foot follows, or too few clamps.
    """
    from robotrue.app.number_options import parse_numbers
    from robotrue.drilling.campaign_csv import write_sheet
    from robotrue.drilling.campaign_plan import plan_campaign
    from robotrue.drilling.foot_file import read_foot

    setup = read_foot(request.foot)
    foot, plates = setup.foot, _plates(request, setup.head)
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
        plates=plates,
    )
    output = context.output(request.output)
    write_sheet(output, plan, len(foot.radius))
    attitudes = _attitudes(plates)
    planned = f"{count(len(plan), 'clamp')} planned by {request.by}, written to {output}"
    return PlainResult(
        values={
            "output": str(output),
            "clamps": len(plan),
            "by": request.by,
            "seed": request.seed,
            "plates": attitudes,
        },
        shown=(
            Note(planned),
            *(
                Note(f"plate {each['plate']}: A {each['A_deg']:g}, B {each['B_deg']:g} deg")
                for each in attitudes
            ),
            Note(NEXT if plates is None else ON_PLATES),
        ),
    )


def _attitudes(plates: Plates | None) -> list[dict[str, str | float]]:
    """A and B of each plate, as the machine counts them, deg."""
    if plates is None:
        return []
    return [
        {"plate": f"P{k}", "A_deg": round(a, 6), "B_deg": round(b, 6)}
        for k, (a, b) in enumerate((plates.shown / DEG).tolist(), start=1)
    ]


def _plates(request: DrillPlanRequest, head: Head | None) -> Plates | None:
    """The plates over the ranges that are asked for; None where none is."""
    import numpy as np

    from robotrue.app.number_options import parse_numbers
    from robotrue.drilling.campaign_plan import spread_plates
    from robotrue.drilling.head import Head

    if request.axis_a_deg is None and request.axis_b_deg is None:
        return None
    limits = [
        parse_numbers(name, stated or "0,0", 2, form="LOWEST,HIGHEST") * DEG
        for name, stated in (
            ("--axis-a-deg", request.axis_a_deg),
            ("--axis-b-deg", request.axis_b_deg),
        )
    ]
    known = head or Head(p_pivot_tip=np.full(3, np.nan))
    return spread_plates(known, request.plates, np.array(limits))


OPERATION: Final = Operation(request=DrillPlanRequest, run=run)
