"""Checks of a part in its cell: it lies inside its blank, its datums are where they were."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Facts, Note, PlainResult, Table
from robotrue.app.request import InputFile, Item, Reference, Request
from robotrue.app.request_fields import TouchSigma, cell_output
from robotrue.core.provenance import merge
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.validation.validation_defaults import (
    LEFT_OVER_MM,
    MESH_UNIT,
    PROBE_RADIUS_MM,
    TOUCH_MM,
)

if TYPE_CHECKING:
    from robotrue.calibration.model import ErrorModel
    from robotrue.cell.cell import Cell
    from robotrue.cell.part import PartTable
    from robotrue.measurement.probing_set import ProbingSet
    from robotrue.validation.blank import BlankCheck
    from robotrue.validation.slot_test import DatumCheck


class BlankCheckRequest(Request):
    """Part and its blank."""

    cell: Annotated[Reference, Item(noun="cell", argument="CELL")]
    """cell.toml, preferably written by `register`."""
    blank: Annotated[Path, InputFile(argument="BLANK")]
    """CSV of touches of the blank, with normals of its faces."""
    mesh: Annotated[Path, InputFile()]
    """The finished part (STL)."""
    mesh_unit: str = MESH_UNIT
    """mm, m or inch."""
    part: str | None = None
    """Part frame the part will be cut in; default: the only one."""
    leave_mm: float = LEFT_OVER_MM
    """Minimum stock over the part on every face."""
    probe_radius_mm: float = PROBE_RADIUS_MM
    """Radius of the probe's ball."""
    touch_sigma_mm: TouchSigma = TOUCH_MM
    output: Annotated[Path | None, cell_output()] = None
    """Also write the registered cell with the part shifted."""


@operation("blank_check")
def check_blank_part(request: BlankCheckRequest, context: Context) -> PlainResult:
    """Check that the finished part lies inside its blank, and find the best shift.

    Raises:
        ConfigurationError: Touches without normals, or a shift of a cell that is not registered.
        ImplausibleDataError: Exchanged faces, or wrong units.
        ModelMismatchError: Joints of another robot.
    """
    from robotrue.app.registered import open_arm, registered_cell
    from robotrue.measurement.formats.part_points import read_points
    from robotrue.robot.configuration import axis_relation

    source = context.cell_file(request.cell)
    cell, arm = open_arm(source)
    if request.output is not None and cell.part is None:
        raise ConfigurationError(
            "-o writes shifted part frames, and the cell has none.",
            source=source,
            hint="robotrue register CELL|MODEL POINTS -o CELL_OUT.",
        )
    touches = read_points(request.blank, axis_relation(cell.robot)).touches
    check = _fit_blank(request, cell, arm, touches)
    if request.output is not None and cell.part is not None:
        shifted = _shift_part(cell.part, check)
        data = registered_cell(cell, source, shifted, context.output(request.output))
        context.write(request.output, data, "cell with the part shifted")
    return PlainResult(
        values=_blank_document(check),
        shown=_blank_blocks(check),
        provenance=merge(
            [touches.provenance, *([] if cell.part is None else [cell.part.provenance])]
        ),
    )


def _fit_blank(
    request: BlankCheckRequest, cell: Cell, arm: ErrorModel, touches: ProbingSet
) -> BlankCheck:
    """The part in its blank, in the frame it will be cut in."""
    from robotrue.app.touch_settings import mesh_scale, registration_settings
    from robotrue.core.surfaces import read_mesh
    from robotrue.validation.blank import check_blank
    from robotrue.validation.part_registration import check_rows
    from robotrue.validation.registration_frame import tips
    from robotrue.validation.touch_checks import check_units, naming

    touches = replace(touches, radius=request.probe_radius_mm * MM)
    settings = registration_settings(cell, request.touch_sigma_mm)
    check_rows(arm, touches, tuple(map(str, touches.parts)))
    T_base_part = cell.T_base_frame
    if cell.part is not None:
        T_base_part = cell.part.frame(request.part).T_base_part
    with naming(touches):
        at = tips(arm, touches.joints, settings) if touches.has_joints else touches.position
        check_units(touches, at)
        return check_blank(
            read_mesh(request.mesh, unit=mesh_scale(request.mesh_unit)),
            touches,
            at,
            T_base_part,
            sigma=settings.touch,
            required=request.leave_mm * MM,
        )


def _shift_part(part: PartTable, check: BlankCheck) -> PartTable:

    from robotrue.core.poses import pose
    from robotrue.core.rotations import matrix_from_rotation_vector

    step = pose(matrix_from_rotation_vector(check.turn), check.shift)
    moved = tuple(replace(frame, T_base_part=frame.T_base_part @ step) for frame in part.frames)
    return replace(part, frames=moved)


def _blank_document(check: BlankCheck) -> dict[str, object]:
    return {
        "verdict": check.verdict,
        "leave_mm": check.required / MM,
        "least_mm": check.least.allowance / MM,
        "least_at": check.least.name,
        "least_at_mm": (check.least.corner / MM).tolist(),
        "shift_mm": (check.shift / MM).tolist(),
        "turn_deg": (check.turn / DEG).tolist(),
        "least_after_mm": float(check.after.min()) / MM,
        "faces": [
            {
                "name": face.name,
                "normal": face.normal.tolist(),
                "touches": face.touches,
                "left_mm": face.allowance / MM,
                "sigma_mm": face.known / MM,
                "left_after_mm": after / MM,
                "at_mm": (face.corner / MM).tolist(),
                "flat_mm": face.flat / MM,
            }
            for face, after in zip(check.faces, check.after.tolist(), strict=True)
        ],
        "doubts": list(check.doubts),
    }


def _turn_row(check: BlankCheck) -> tuple[tuple[str, str], ...]:
    if not check.turn.any():
        return ()
    x, y, z = check.turn / DEG + 0.0
    return (("turn that leaves more", f"{x:+.3f}, {y:+.3f}, {z:+.3f} deg about the part's axes"),)


def _blank_blocks(check: BlankCheck) -> tuple[Block, ...]:
    least = check.least
    x, y, z = least.corner / MM
    dx, dy, dz = check.shift / MM + 0.0
    return (
        Facts(
            title="part in its blank",
            rows=(
                ("verdict", f"{check.verdict}, {check.required / MM:g} mm required"),
                ("least allowance", f"{least.allowance / MM:.3f} mm at {least.name}"),
                ("place, in the part", f"{x:.2f}, {y:.2f}, {z:.2f} mm"),
                *_turn_row(check),
                ("shift that balances it", f"{dx:+.3f}, {dy:+.3f}, {dz:+.3f} mm in the part"),
                ("least allowance then", f"{float(check.after.min()) / MM:.3f} mm"),
            ),
        ),
        Table(
            title="faces touched",
            columns=("", "touches", "left, mm", "one sigma", "after the shift", "out of flat"),
            rows=tuple(
                (
                    face.name,
                    str(face.touches),
                    f"{face.allowance / MM:.3f}",
                    f"{face.known / MM:.3f}",
                    f"{after / MM:.3f}",
                    f"{face.flat / MM:.3f}",
                )
                for face, after in zip(check.faces, check.after.tolist(), strict=True)
            ),
        ),
        *(Note(f"note: {doubt}") for doubt in check.doubts),
    )


class DatumCheckRequest(Request):
    """Measured datums and their tolerances."""

    cell: Annotated[Reference, Item(noun="registration", argument="CELL")]
    """Cell that `register` wrote."""
    datums: Annotated[Path, InputFile(argument="DATUMS")]
    """CSV of the probed datums, like the touches."""
    tolerance_mm: float
    """Tolerance on the position of the part."""
    touches: Annotated[Path | None, InputFile()] = None
    """CSV of the registration; default: the file that the cell names, in its folder."""
    part: str | None = None
    """Part frame to check; default: of the same name, or the only one."""
    touch_sigma_mm: TouchSigma = TOUCH_MM


@operation("datum_check")
def check_datums(request: DatumCheckRequest, context: Context) -> PlainResult:
    """Check the part frame with datums that were not used to find it.

    Raises:
        ConfigurationError: No registered cell, a datum the frame was made of, or no tolerance.
        ImplausibleDataError: Wrong units.
        ModelMismatchError: Joints of another robot.
    """
    from robotrue.app.registered import open_arm
    from robotrue.app.touch_settings import registration_settings
    from robotrue.measurement.formats.part_points import read_points
    from robotrue.robot.configuration import axis_relation
    from robotrue.validation.datum_touches import check_part

    source = context.registration_file(request.cell)
    cell, arm = open_arm(source)
    if cell.part is None:
        raise ConfigurationError(
            "the cell is not registered: it has no part frame to check.",
            source=source,
            hint="robotrue register CELL|MODEL POINTS -o CELL_OUT.",
        )
    relation = axis_relation(cell.robot)
    datums = read_points(request.datums, relation)
    named = request.part or (datums.parts[0] if datums.parts[0] in cell.part.names else None)
    beside = source.parent / cell.part.points_file
    known = request.touches or (beside if cell.part.points_file and beside.is_file() else None)
    file = None if known is None else read_points(known, relation)
    if file is not None and file.digest != cell.part.points_sha256:
        raise ConfigurationError(
            "these are not the touches the cell was registered with: another SHA-256.",
            source=known,
            hint=f"--touches with the file as it was ({cell.part.points_file}), or register again.",
        )
    frame = cell.part.frame(named)
    used = None
    if file is not None:
        number = file.parts.index(frame.name) if frame.name in file.parts else 0
        used = file.touches.subset(file.touches.part == number)
    check, joint = check_part(
        arm,
        frame,
        datums.touches,
        used=used,
        tolerance=request.tolerance_mm * MM,
        settings=registration_settings(cell, request.touch_sigma_mm),
    )
    if file is None:
        context.note(
            f"{cell.part.points_file or 'the file of touches'} is not beside the cell: cannot "
            "check whether a datum was used for the frame (--touches)."
        )
    return PlainResult(
        values=_datum_document(check, joint),
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
                f"{', without errors of the arm common to both times' if joint else ''}."
            ),
        ),
        provenance=merge([datums.touches.provenance, cell.part.provenance]),
    )


def _datum_document(check: DatumCheck, joint: bool) -> dict[str, object]:
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
