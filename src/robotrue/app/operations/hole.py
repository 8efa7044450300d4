"""Evaluate a probed or scanned hole: position, contour, diameter, roundness, with uncertainty."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Note, PlainResult, Table
from robotrue.app.request import InputFile, Request
from robotrue.core.provenance import Provenance, merge, read_provenance
from robotrue.core.units import MM, UM
from robotrue.validation.validation_defaults import HOLE_CENTRE_MM, PROBE_SIGMA_UM, WALL_MM

if TYPE_CHECKING:
    from robotrue.core.arrays import Array
    from robotrue.validation.hole_contour import HoleResult


class HoleRequest(Request):
    """Measured points of a hole, and the drawing's requirements."""

    before: Annotated[Path, InputFile(argument="POINTS")]
    """x_mm, y_mm, z_mm on the wall (CSV) or a scan (STL); part axes, z along the hole."""
    after: Annotated[Path | None, InputFile(argument="[AFTER]")] = None
    """The same hole of the compensated program."""
    diameter_mm: Annotated[float, Field(gt=0.0)]
    """Nominal diameter."""
    centre_mm: str = HOLE_CENTRE_MM
    """X,Y of the nominal axis in part axes."""
    probe_sigma_um: Annotated[float, Field(gt=0.0)] = PROBE_SIGMA_UM
    """Standard deviation of one point along the wall's normal."""
    wall_mm: Annotated[float, Field(gt=0.0)] = WALL_MM
    """For a scan: largest distance of used points from the nominal wall."""


@operation()
def run(request: HoleRequest, context: Context) -> PlainResult:
    """Evaluates the points of a hole against its drawing.

    Raises:
        FormatError: A column that is missing or no number; with file and line.
        ImplausibleDataError: Points on less than a third of the turn, or of a hole of another size.
        ShapeError: Fewer than six points.
        ConvergenceError: No cylinder fits.
    """
    rows, values, origins = [], {}, []
    for name, path in (("hole", request.before), ("after", request.after)):
        if path is None:
            continue
        shown = "before" if request.after is not None and name == "hole" else name
        document, origin = _evaluate(request, path)
        values[shown] = document
        rows.append((shown, document))
        origins.append(origin)
    keys = ("x_mm", "y_mm", "position_mm", "contour_mean_mm", "contour_max_mm", "contour_sd_mm")
    sizes = ("diameter_mm", "roundness_mm", "sigma_x_mm", "sigma_y_mm", "sigma_diameter_mm")
    return PlainResult(
        values=values,
        shown=(
            Table(
                title="Position of the axis and contour, mm",
                columns=("", "x", "y", "position", "contour", "max", "sd"),
                rows=tuple((name, *(f"{d[k]:.4f}" for k in keys)) for name, d in rows),
            ),
            Table(
                title="Size and form, and standard deviations, mm",
                columns=("", "diameter", "roundness", "sd x", "sd y", "sd diameter", "points"),
                rows=tuple(
                    (name, *(f"{d[k]:.4f}" for k in sizes), f"{d['points']:.0f}")
                    for name, d in rows
                ),
            ),
            Note(
                "contour: size of the distance from the fitted axis minus the nominal radius; "
                "roundness: largest less smallest distance, least squares"
            ),
        ),
        provenance=merge(origins),
    )


def _evaluate(request: HoleRequest, path: Path) -> tuple[dict[str, float], Provenance]:
    """Evaluates one file, mm."""
    from robotrue.app.number_options import parse_numbers
    from robotrue.validation.hole_contour import (
        evaluate_hole,
        hole_uncertainty,
        require_size,
        require_turn,
    )

    centre = parse_numbers("--centre-mm", request.centre_mm, 2, form="X,Y") * MM
    radius = 0.5 * request.diameter_mm * MM
    points, origin = _read_points(path, centre, radius, request.wall_mm * MM)
    if len(points) >= 6:
        require_turn(points, centre, source=str(path))
    result = evaluate_hole(points, centre=centre, radius=radius)
    require_size(result, radius, source=str(path))
    sigma, diameter_sigma = hole_uncertainty(points, result, request.probe_sigma_um * UM)
    return _document(result, sigma, diameter_sigma), origin


def _document(result: HoleResult, sigma: Array, diameter_sigma: float) -> dict[str, float]:
    import numpy as np

    size = np.abs(result.contour)
    metres = {
        "x": result.position_error[0],
        "y": result.position_error[1],
        "position": result.position,
        "contour_mean": size.mean(),
        "contour_max": size.max(),
        "contour_sd": size.std(ddof=1),
        "diameter": result.diameter,
        "roundness": result.roundness,
        "sigma_x": sigma[0],
        "sigma_y": sigma[1],
        "sigma_diameter": diameter_sigma,
    }
    return {
        **{f"{name}_mm": float(value / MM) for name, value in metres.items()},
        "points": float(len(size)),
    }


def _read_points(path: Path, centre: Array, radius: float, wall: float) -> tuple[Array, Provenance]:
    """(n, 3) m of a CSV, or the vertices of a scan near the nominal wall."""
    import numpy as np

    from robotrue.core.surfaces import read_scan
    from robotrue.measurement.formats.sheet_file import read_sheet

    if path.suffix.lower() == ".stl":
        vertices = read_scan(path)
        off = np.abs(np.linalg.norm(vertices[:, :2] - centre, axis=1) - radius)
        return vertices[off <= wall], read_provenance(path)
    sheet = read_sheet(path)
    return sheet.numbers(("x_mm", "y_mm", "z_mm")) * MM, sheet.provenance
