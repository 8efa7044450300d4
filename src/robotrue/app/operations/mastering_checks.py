"""Zeros of the axes by touches of one fixed point: postures, and the axis that lost its zero."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Facts, Note, PlainResult, Table
from robotrue.app.request import InputFile, Option, Request
from robotrue.app.request_fields import CellOrModel, ToolSigma, TouchSigma, table_output
from robotrue.core.files import write_atomic
from robotrue.core.provenance import merge
from robotrue.core.units import DEG, MM
from robotrue.planning.plan_defaults import SEED
from robotrue.validation.validation_defaults import (
    MASTERING_TOUCHES,
    POINT_SIGMA_MM,
    TOOL_LEAN_DEG,
    TOUCH_MM,
)

if TYPE_CHECKING:
    from robotrue.robot.model import RobotModel
    from robotrue.validation.mastering import LostZeros, MasteringCheck


class MasteringPlanRequest(Request):
    """Place of the point, and limits for the touches."""

    cell: CellOrModel
    point_mm: str
    """X,Y,Z: approximate position of the point in base."""
    output: Annotated[Path, table_output()]
    """CSV of the touches to write."""
    postures: Annotated[int, Option(names=("--postures", "-n"))] = MASTERING_TOUCHES
    """Number of postures."""
    tool_lean_deg: float = TOOL_LEAN_DEG
    """Largest lean of the tool from vertical."""
    touch_sigma_mm: TouchSigma = TOUCH_MM
    tool_sigma_mm: ToolSigma = None
    seed: int = SEED
    """Seed of the attitudes."""


@operation("mastering_plan")
def plan_postures(request: MasteringPlanRequest, context: Context) -> PlainResult:
    """Plan touches of one fixed point that show which axis lost its zero.

    Raises:
        ConfigurationError: No point, too few touches, or an invalid lean.
        ReachError: Too few postures reach the point.
    """
    from robotrue.app.number_options import parse_numbers
    from robotrue.app.registered import open_model, provenance_used
    from robotrue.app.touch_settings import settings_for_touches
    from robotrue.calibration.nominal import NominalModel
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
    write_atomic(output, touch_sheet(touches, ("point",), cell.robot))
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


class MasteringRequest(Request):
    """Measured touches, and the uncertainty of point and tool."""

    cell: CellOrModel
    touches: Annotated[Path, InputFile(argument="TOUCHES")]
    """CSV of the touches of one fixed point, in joints."""
    touch_sigma_mm: TouchSigma = TOUCH_MM
    tool_sigma_mm: ToolSigma = None
    point_mm: str | None = None
    """X,Y,Z in base: the point as the arm probed it before the fault; required to determine axis
    1."""
    point_sigma_mm: float = POINT_SIGMA_MM
    """Standard deviation of that point per axis."""


@operation("mastering")
def check_zeros(request: MasteringRequest, context: Context) -> PlainResult:
    """Find the axis that lost its zero from touches of one fixed point; no tracker is needed.

    Raises:
        ConfigurationError: Touches without joints, or of several places; an invalid point.
        ObservabilityError: Too few touches, or too much alike.
        ImplausibleDataError: Touches that no one or two lost zeros explain.
        ModelMismatchError: Joints of another robot.
    """
    from robotrue.app.number_options import parse_numbers
    from robotrue.app.registered import open_model
    from robotrue.app.touch_settings import settings_for_touches
    from robotrue.calibration.nominal import NominalModel
    from robotrue.measurement.formats.part_points import read_points
    from robotrue.robot.configuration import axis_relation
    from robotrue.validation.mastering import check_mastering

    point = None
    if request.point_mm is not None:
        point = MM * parse_numbers("--point-mm", request.point_mm, 3, form="X,Y,Z")
    cell, model = open_model(context.cell_file(request.cell))
    arm = NominalModel(robot=cell.robot.nominal()) if model is None else model
    touches = read_points(request.touches, axis_relation(cell.robot)).touches
    settings = settings_for_touches(cell, arm, request.touch_sigma_mm, request.tool_sigma_mm)
    found = check_mastering(
        arm, touches, settings, point=point, point_sigma=request.point_sigma_mm * MM
    )
    return PlainResult(
        values=_document(found, cell.robot),
        shown=_blocks(found, cell.robot, calibrated=model is not None),
        provenance=merge([touches.provenance]),
    )


SIGMAS: Final = 1.96
"""Half width of a 95 % interval."""
LISTED: Final = 4
"""Explanations in the printed table."""
SETTING: Final[Mapping[str, str]] = {
    "kuka": "Master the axis at its notch. Where the notch itself is no longer right, add the "
    "offset to $MAMES of the axis and master it there.",
    "fanuc": "SYSTEM, Master/Cal, SINGLE AXIS MASTER: move the axis to the reading above, enter 0 "
    "as its mastering position.",
    "abb": "Calibration, fine calibration of this axis, with the axis moved from its marks by the "
    "offset; then update the revolution counters.",
    "yaskawa": "ROBOT, HOME POSITION: change the absolute data of the axis by the offset times its "
    "pulses per degree.",
    "ur": "The zero of a joint is set by the maker's service; until then calibrate the arm again.",
}
"""Where each maker keeps the zero of an axis; compare with the manual of the controller."""
ANY: Final = "Move the axis to the reading above and set its zero there."


def _document(found: MasteringCheck, robot: RobotModel) -> dict[str, object]:
    """Returns JSON values; offsets are those of the controller's axes."""
    import numpy as np

    return {
        "verdict": found.verdict,
        "lost": [
            {
                "axis": name,
                "offset_deg": offset,
                "low_deg": offset - half,
                "high_deg": offset + half,
                "shown_at_zero_deg": -offset,
            }
            for name, offset, half in _axes(found.lost, robot)
        ],
        "axes": [
            {
                "axis": f"A{j + 1}",
                "probability": None if np.isnan(chance) else float(chance),
                "seen_from_deg": None if np.isinf(least) else float(least / DEG),
            }
            for j, (chance, least) in enumerate(zip(found.probability, found.least, strict=True))
        ],
        "explanations": [
            {"axes": [f"A{j + 1}" for j in each.joints], "probability": each.probability}
            for each in found.hypotheses[:LISTED]
        ],
        "point_mm": (found.p_base / MM).tolist(),
        "rms_before_mm": found.rms_before / MM,
        "rms_after_mm": found.rms_after / MM,
        "outliers": list(found.outliers),
        "noise_factor": found.noise_factor,
    }


def _axes(lost: LostZeros, robot: RobotModel) -> list[tuple[str, float, float]]:
    """Name, offset and half width of its 95 % interval in deg, as the controller counts."""
    offset, sigma = lost.offset / DEG, lost.covariance.diagonal() ** 0.5 / DEG
    return [
        (f"A{j + 1}", _sense(robot, j) * float(offset[k]), SIGMAS * float(sigma[k]))
        for k, j in enumerate(lost.joints)
    ]


def _sense(robot: RobotModel, joint: int) -> float:
    """Returns +1 or -1, the controller's sense of the joint; a zero belongs to one drive."""
    return float(robot.controller.sign[joint])


def _blocks(found: MasteringCheck, robot: RobotModel, *, calibrated: bool) -> tuple[Block, ...]:
    """Returns the verdict, the axes and their new readings.

    Args:
        found: The check.
        robot: For the convention of its controller, and its maker.
        calibrated: Whether the arm was calibrated while it was good.
    """
    import numpy as np

    rows = [(_name(found), _sentence(found))]
    for name, offset, half in _axes(found.lost, robot):
        band = f"{offset - half:+.4f} to {offset + half:+.4f} (95 %)"
        rows.append((name, f"add {offset:+.4f} deg to the reading of the pendant, {band}"))
        rows.append(("", f"is at its zero where the pendant shows {-offset:+.4f} deg"))
    rows.append(
        (
            "touches from one point",
            f"{found.rms_before / MM:.3f} mm rms before, {found.rms_after / MM:.3f} mm with these "
            "zeros",
        )
    )
    blocks: list[Block] = [
        Facts(title="zeros of the axes", rows=tuple(rows)),
        Table(
            title="axes",
            columns=("", "lost its zero", "detectable from deg"),
            rows=tuple(
                (
                    f"A{j + 1}",
                    "not determined" if np.isnan(p) else f"{100.0 * p:.1f} %",
                    "-" if np.isinf(least) else f"{least / DEG:.3f}",
                )
                for j, (p, least) in enumerate(zip(found.probability, found.least, strict=True))
            ),
        ),
    ]
    return (*blocks, *map(Note, _notes(found, robot, calibrated=calibrated)))


def _name(found: MasteringCheck) -> str:
    return {"holds": "no lost zero", "lost": "zero lost", "undecided": "undecided"}[found.verdict]


def _sentence(found: MasteringCheck) -> str:
    if found.verdict == "holds":
        return "none detected; an offset below the angles in the table is not detectable"
    if found.verdict == "lost":
        return " and ".join(f"A{j + 1}" for j in found.lost.joints)
    undetermined = [
        f"{' and '.join(f'A{j + 1}' for j in h.joints) or 'no axis'} {100.0 * h.probability:.0f} %"
        for h in found.hypotheses[:LISTED]
    ]
    return ", ".join(undetermined) + ": touch the point in more postures"


def _notes(found: MasteringCheck, robot: RobotModel, *, calibrated: bool) -> list[str]:
    import numpy as np

    notes = []
    if found.lost.joints:
        notes.append(SETTING.get(robot.maker, ANY))
        notes.append("Then touch the point again: this check should find no lost zero.")
    if np.isnan(found.probability[0]):
        notes.append("A1 rotates everything equally: state the place of the point (--point-mm).")
    if np.isnan(found.probability[-1]):
        last = len(found.probability)
        notes.append(
            f"A{last} is detectable only with a tip off its axis that is known in the flange "
            "(--tool-sigma-mm)."
        )
    if found.outliers:
        notes.append(f"left out, no explanation fits them: {', '.join(found.outliers)}")
    if found.noise_factor > 1.5:
        notes.append(
            f"the touches scatter {found.noise_factor**0.5:.1f} times more than stated; the "
            "intervals include this"
        )
    if not calibrated:
        notes.append(
            "The arm was not calibrated: an offset that its geometry errors may explain is not "
            "reported as lost. With a model from before the loss, smaller offsets are detectable."
        )
    return notes
