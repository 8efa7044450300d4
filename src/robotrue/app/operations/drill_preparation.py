"""Before a campaign: the zero of a foot, and the sheet of clamps."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Note, PlainResult, Table, count
from robotrue.app.request import InputFile, Option, Output, Request
from robotrue.app.request_fields import OUTPUT, table_output
from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.drill_defaults import CHOSEN_BY, By
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.drilling.campaign_plan import Plates
    from robotrue.drilling.head import Head


class DrillZeroRequest(Request):
    """Foot file and sensor readings on the zero tool."""

    foot: Annotated[Path, InputFile(argument="FOOT")]
    """Foot file (TOML)."""
    readings: Annotated[Path, InputFile(argument="READINGS")]
    """raw1_mm, ... or raw1_counts, ... on the tool (CSV or workbook); seat names each mounting."""
    output: Annotated[
        Path, Output(names=OUTPUT, what="a foot file", suffixes=(".toml",), renews="foot")
    ]
    """Foot file to write: FOOT with this zero."""


@operation("drill_zero")
def take_zero(request: DrillZeroRequest, context: Context) -> PlainResult:
    """Set the zero of a foot on its calibration tool, with its uncertainty."""
    from robotrue.drilling.foot_file import read_foot
    from robotrue.drilling.foot_zero import check_exchange, read_zero, with_zero, zero_residual

    setup = read_foot(request.foot)
    found = read_zero(request.readings, setup)
    check_exchange(found, setup)
    text = with_zero(request.foot.read_text(encoding="utf-8"), found, setup)
    output = context.write(request.output, text)
    if setup.zero is not None:
        moved = (found.zero - setup.zero) / UM
        context.note(f"the zero moved by {', '.join(f'{v:+.1f}' for v in moved)} um")
    a, b = (found.tilt_sigma / DEG).tolist()
    rows = zip(found.zero / MM, found.sigma / UM, found.scatter / UM, strict=True)
    return PlainResult(
        values={
            "output": str(output),
            "zero_mm": (found.zero / MM).tolist(),
            "zero_sigma_um": (found.sigma / UM).tolist(),
            "scatter_um": (found.scatter / UM).tolist(),
            "tilt_sigma_deg": [a, b],
            "off_plane_um": zero_residual(found, setup) / UM,
            "rows": found.rows,
            "seats": found.seats,
        },
        shown=(
            Table(
                title=f"Zero of {found.rows} readings, {found.seats or 'unnamed'} seats",
                columns=("sensor", "zero mm", "sigma um", "scatter um"),
                rows=tuple(
                    (str(k), f"{zero:.4f}", f"{sigma:.2f}", f"{scatter:.2f}")
                    for k, (zero, sigma, scatter) in enumerate(rows, start=1)
                ),
            ),
            Note(f"the zero leaves {a:.4f} deg in a and {b:.4f} deg in b uncertain (one sigma)"),
            Note(f"written to {output}"),
        ),
        provenance=found.provenance,
    )


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
    """Foot, number of clamps, and their limits."""

    foot: Annotated[Path, InputFile(argument="FOOT")]
    """Foot file (TOML)."""
    output: Annotated[Path, table_output()]
    """Execution sheet (CSV) to write."""
    clamps: int = 60
    """Number of clamps; at least 15."""
    forces_N: Annotated[str, Option(names=("--forces-n",))] = "0,250,500,750,1000"
    """Clamp forces in N."""
    z_mm: str = "-100,0,100"
    """Heights in mm."""
    tilt_deg: float = 4.0
    """Largest tilt in deg."""
    by: By = CHOSEN_BY
    """information or chance."""
    seed: int = 0
    """Seed of tilts and order."""
    axis_a_deg: str | None = None
    """Range of the machine's A over which the plates are placed, such as -30,30; the fit can
    then include the effect of A itself, a sag."""
    axis_b_deg: str | None = None
    """The same for the machine's B."""
    plates: int = PLATES
    """With such a range: number of plates."""


@operation("drill_plan")
def plan_clamps(request: DrillPlanRequest, context: Context) -> PlainResult:
    """Plan a campaign: tilts, forces and heights of the clamps, and their order.

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
    """Returns the plates for the requested ranges; None if no ranges are requested."""
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
