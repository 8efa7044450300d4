"""Write points of a part, measured points or targets as a list of SpatialAnalyzer or PolyWorks."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import PlainResult
from robotrue.app.request import InputFile, Output, Request
from robotrue.app.request_fields import OUTPUT, Columns
from robotrue.core.files import sha256
from robotrue.core.provenance import file_provenance, merge
from robotrue.errors import FormatError

if TYPE_CHECKING:
    from robotrue.measurement.formats.point_list import PointList
    from robotrue.measurement.formats.sheet import Sheet
    from robotrue.program.program import Program


class ExportPointsRequest(Request):
    """File with points, and the list to write."""

    points: Annotated[Path, InputFile(argument="POINTS")]
    """Points of a part, measured points or a robot program."""
    output: Annotated[
        Path, Output(names=OUTPUT, what="a list of points", suffixes=(".txt", ".csv"))
    ]
    """.csv: collection, group, name, x, y, z; any other name: name x y z and blanks."""
    mapping: Columns = None


@operation()
def run(request: ExportPointsRequest, context: Context) -> PlainResult:
    """Writes the points in mm, in the frame that the file states them in.

    Raises:
        FormatError: No points, or points in several frames for a list without groups.
    """
    from robotrue.core.units import MM
    from robotrue.measurement.formats.point_list import comma_list, plain_list

    found = _read(request)
    if not len(found.position):
        raise FormatError(
            "no point with a position.",
            source=request.points,
            hint="points of a part (px_mm, py_mm, pz_mm), measured points, or Cartesian targets.",
        )
    groups = list(dict.fromkeys(found.group))
    grouped = request.output.suffix.lower() == ".csv"
    if not grouped and len(set(found.frame)) > 1:
        raise FormatError(
            f"points in {len(set(found.frame))} frames, a list without groups holds one.",
            source=request.points,
            hint="write .csv: each frame is a group there.",
        )
    text = comma_list(found, request.points.stem) if grouped else plain_list(found)
    context.write(request.output, text, f"{len(found.position)} points")
    frames = list(dict.fromkeys(found.frame))
    context.note(f"points are in mm, in {', '.join(frames)}.")
    values = {
        "written": str(request.output),
        "points": len(found.position),
        "groups": groups,
        "frames": frames,
        "low_mm": found.position.min(axis=0) / MM,
        "high_mm": found.position.max(axis=0) / MM,
    }
    return PlainResult(values=values, provenance=found.provenance)


def _read(request: ExportPointsRequest) -> PointList:
    """Returns the points of the file: of a part, measured, or targets of a program."""
    import numpy as np

    from robotrue.measurement.formats.mapping import read_mapping
    from robotrue.measurement.formats.measured_files import open_sheet
    from robotrue.measurement.formats.part_points import POINT
    from robotrue.measurement.formats.point_list import PointList, part_list
    from robotrue.measurement.formats.sheet_file import WORKBOOKS, read_sheet
    from robotrue.measurement.formats.table import read_run

    tables = (".csv", ".tsv", ".txt", *WORKBOOKS)
    if request.mapping is None and request.points.suffix.lower() not in tables:
        return _targets(request.points)
    if request.mapping is None:
        sheet = read_sheet(request.points)
        if all(map(sheet.has, POINT)):
            return part_list(sheet)
    mapping = None if request.mapping is None else read_mapping(request.mapping)
    sheet, layout = open_sheet(request.points, mapping)
    rows = read_run(sheet, layout, relation=np.asarray).rows
    column = layout.point_name[0] if layout.point_name else ""
    return PointList(
        name=tuple(_names(sheet, column, rows.source_row.tolist())),
        group=tuple(rows.group_names[int(k)] for k in rows.group),
        frame=(f"the {rows.frame} frame",) * len(rows),
        position=rows.position,
        provenance=rows.provenance,
    )


def _names(sheet: Sheet, column: str, lines: list[int]) -> Iterator[str]:
    """Names of measured points by their lines; P1, P2, ... where no column names them."""
    named = dict(zip(sheet.lines, sheet.column(column), strict=True)) if sheet.has(column) else {}
    for number, line in enumerate(lines, 1):
        yield named.get(line) or f"P{number}"


def _targets(path: Path) -> PointList:
    """Returns the Cartesian targets of a program, each in its work frame, named by their lines."""
    import numpy as np

    from robotrue.measurement.formats.point_list import PointList
    from robotrue.program.formats import read_job

    job = read_job(path)
    rows = [
        (program, int(row))
        for program in job
        for row in np.flatnonzero(np.isfinite(program.position).all(axis=1) & ~program.held)
    ]
    return PointList(
        name=tuple(f"N{program.line[row]}" for program, row in rows),
        group=tuple(f"{program.name} frame {program.frame[row]}" for program, row in rows),
        frame=tuple(_work_frame(program, int(program.frame[row])) for program, row in rows),
        position=np.array([program.position[row] for program, row in rows]).reshape(-1, 3),
        provenance=merge(file_provenance(each.name, sha256(each.data)) for each in job),
    )


def _work_frame(program: Program, number: int) -> str:
    """Returns the work frame in words, with its pose where the program or its files state it."""
    import numpy as np

    from robotrue.core.rotations import abc_from_matrix
    from robotrue.core.units import DEG, MM

    T_base_frame = program.T_base_frame[number]
    name = f"work frame {number} of {program.name}"
    if not np.isfinite(T_base_frame).all():
        return f"{name} (stored in the controller)"
    pose = [*(T_base_frame[:3, 3] / MM), *(abc_from_matrix(T_base_frame[:3, :3]) / DEG)]
    return f"{name} (X, Y, Z, A, B, C {', '.join(f'{round(value, 6) + 0.0:g}' for value in pose)})"
