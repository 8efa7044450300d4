"""Check the part's frame with datums that had no part in it, touched again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Facts, Note, Table
from robotrue.app.request import InputFile, Item, Option, Reference, Request
from robotrue.app.request_fields import TouchSigma
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.validation.validation_defaults import TOUCH_MM

if TYPE_CHECKING:
    from robotrue.validation.slot_test import DatumCheck


class DatumCheckRequest(Request):
    """Which datums were touched, and what they must keep."""

    cell: Annotated[
        Reference, Item(noun="registration", argument="CELL", help="Cell that `register` wrote.")
    ]
    datums: Annotated[
        Path, InputFile(argument="DATUMS", help="CSV of the datums as touched, like the touches.")
    ]
    tolerance_mm: Annotated[float, Option(help="What the part may be off.")]
    touches: Annotated[
        Path | None,
        InputFile(help="CSV the cell was registered with; default: the one it names, beside it."),
    ] = None
    part: Annotated[
        str | None, Option(help="Part frame to check; default: of the same name, or the only one.")
    ] = None
    touch_sigma_mm: TouchSigma = TOUCH_MM


def run(request: DatumCheckRequest, context: Context) -> PlainResult:
    """Says whether the datums hold, are off, or cannot tell.

    Raises:
        ConfigurationError: No registered cell, a datum the frame was made of, or no tolerance.
        ImplausibleDataError: Wrong units.
        ModelMismatchError: Joints of another robot.
    """
    from robotrue.app.registered import open_model
    from robotrue.calibration.nominal import NominalModel
    from robotrue.core.provenance import merge
    from robotrue.measurement.formats.part_points import read_points
    from robotrue.planning.information import settings_of
    from robotrue.validation.datum_touches import check_part
    from robotrue.validation.registration_frame import RegistrationSettings

    source = context.registration_file(request.cell)
    cell, model = open_model(source)
    if cell.part is None:
        raise ConfigurationError(
            "the cell is not registered: it has no part frame to check.",
            source=source,
            hint="robotrue register CELL|MODEL POINTS -o CELL_OUT.",
        )
    datums = read_points(request.datums)
    named = request.part or (datums.parts[0] if datums.parts[0] in cell.part.names else None)
    beside = source.parent / cell.part.points_file
    known = request.touches or (beside if cell.part.points_file and beside.is_file() else None)
    file = None if known is None else read_points(known)
    if file is not None and file.digest != cell.part.points_sha256:
        raise ConfigurationError(
            "these are not the touches the cell was registered with: another SHA-256.",
            source=known,
            hint=f"--touches with the file as it was ({cell.part.points_file}), or register anew.",
        )
    frame = cell.part.frame(named)
    used = None
    if file is not None:
        number = file.parts.index(frame.name) if frame.name in file.parts else 0
        used = file.touches.subset(file.touches.part == number)
    check, joint = check_part(
        NominalModel(robot=cell.robot) if model is None else model,
        frame,
        datums.touches,
        used=used,
        tolerance=request.tolerance_mm * MM,
        settings=RegistrationSettings(
            touch=request.touch_sigma_mm * MM,
            T_flange_tool=cell.robot.T_flange_tool,
            arm=settings_of(cell),
        ),
    )
    if file is None:
        context.note(
            f"{cell.part.points_file or 'the file of touches'} is not beside the cell: whether a "
            "datum was used for the frame cannot be told (--touches)."
        )
    return PlainResult(
        values=_document(check, joint),
        shown=(
            Facts(
                title=f"datums of {request.datums.name}",
                rows=(("verdict", f"{check.verdict}: {check.reason}"),),
            ),
            Table(
                title="datums",
                columns=("", "x, mm", "y, mm", "z, mm", "off, mm", "chance"),
                rows=tuple(
                    (name, *(f"{v / MM:+.3f}" for v in row), f"{far / MM:.3f}", f"{p:.3f}")
                    for name, row, far, p in zip(
                        check.names, check.deviation, check.distance, check.probability, strict=True
                    )
                ),
            ),
            Note(
                f"touching resolves {check.resolution / MM:.3f} mm (95 %)"
                f"{', without what the arm does alike both times' if joint else ''}."
            ),
        ),
        provenance=merge([datums.touches.provenance, cell.part.provenance]),
    )


def _document(check: DatumCheck, joint: bool) -> dict[str, object]:
    return {
        "verdict": check.verdict,
        "reason": check.reason,
        "tolerance_mm": check.tolerance / MM,
        "resolution_mm": check.resolution / MM,
        "with_the_arm": joint,
        "datums": [
            {
                "name": name,
                "deviation_mm": (row / MM).tolist(),
                "off_mm": far / MM,
                "chance": p,
                "covariance_mm2": (covariance / MM**2).tolist(),
            }
            for name, row, far, p, covariance in zip(
                check.names,
                check.deviation,
                check.distance.tolist(),
                check.probability.tolist(),
                check.covariance,
                strict=True,
            )
        ],
    }


OPERATION: Final = Operation(request=DatumCheckRequest, run=run)
