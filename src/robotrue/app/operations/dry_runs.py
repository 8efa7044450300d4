"""Dry runs: points along a program for the measuring crew, and what they measured there."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Note, PlainResult, Table
from robotrue.app.request import InputFile, Item, Output, Reference, Request
from robotrue.app.request_fields import OUTPUT
from robotrue.core.provenance import MEASURED, Provenance, merge
from robotrue.core.units import DEG, MM
from robotrue.validation.validation_defaults import DRY_RUN_POINTS

if TYPE_CHECKING:
    from robotrue.cell.cell import Cell
    from robotrue.compensation.difference import Difference
    from robotrue.core.arrays import Array, IntArray
    from robotrue.measurement.formats.sheet import Sheet
    from robotrue.program.program import Program
    from robotrue.validation.dry_run_points import AxisErrors


NEXT: Final = (
    "Stop the robot at each line, measure the tool point in base, write point, x_mm, y_mm, z_mm: "
    "one file for the program from CAM, one for the compensated one."
)


class DryRunPlanRequest(Request):
    """The program, the number of points, and the model that predicts their errors."""

    program: Annotated[Reference, Item(noun="program", argument="PROGRAM")]
    """Program from CAM."""
    output: Annotated[Path, Output(names=OUTPUT, what="a CSV table", suffixes=(".csv",))]
    """Sheet (CSV) to write."""
    points: int = DRY_RUN_POINTS
    """Number of points; at least 2."""
    after: Annotated[Reference | None, Item(noun="program")] = None
    """Its compensated copy; the sheet then holds the commands of both."""
    model: Annotated[Reference | None, Item(noun="model")] = None
    """Model file: predicted errors and their band."""
    cell: Annotated[Reference | None, Item(noun="cell")] = None
    """Registered cell with the part frame."""


@operation("dry_run_plan")
def plan_dry_run(request: DryRunPlanRequest, context: Context) -> PlainResult:
    """Choose points at equal steps along a program and write the sheet of a dry run.

    Raises:
        ConfigurationError: Fewer than two points, or no path in the program.
        ModelMismatchError: A compensated copy of another program.
    """
    import numpy as np

    from robotrue.cell.cell import frame_table
    from robotrue.program.formats import read_job
    from robotrue.program.program import FrameTable
    from robotrue.program.target_poses import target_poses
    from robotrue.validation.dry_run_points import pick_points

    paths = context.program_files([request.program])
    changed = paths
    if request.after is not None:
        changed = context.program_files([request.after], folder="after")
    cell, differences, origin = _predict_errors(request, context, (paths, changed))
    frames = FrameTable() if cell is None else frame_table(cell)
    jobs = [read_job(files, frames) for files in (paths, changed)]
    wanted, commanded = (np.concatenate([target_poses(p) for p in job]) for job in jobs)
    rows, along = pick_points(
        wanted[:, :3, 3],
        np.concatenate([p.motion for p in jobs[0]]),
        request.points,
        source=jobs[0][0].name,
    )
    columns = _commands("", wanted[rows])
    if request.after is not None:
        columns |= _commands("after_", commanded[rows])
    columns |= _predicted_columns(differences, rows, request.after is not None)
    output = context.output(request.output)
    _write_sheet(output, jobs[0], rows, along, columns, origin)
    gaps = np.diff(along) / MM
    return PlainResult(
        values={
            "output": str(output),
            "points": len(rows),
            "way_mm": float(along[-1] / MM),
            "step_mm": [float(gaps.min()), float(gaps.max())],
        },
        shown=(
            Note(
                f"{len(rows)} points along {along[-1] / MM:.1f} mm, {gaps.min():.1f} to "
                f"{gaps.max():.1f} mm apart, written to {output}"
            ),
            Note(NEXT),
        ),
        provenance=origin,
    )


def _predict_errors(
    request: DryRunPlanRequest, context: Context, files: tuple[Sequence[Path], Sequence[Path]]
) -> tuple[Cell | None, list[Difference], Provenance | None]:
    """The cell, predicted errors of every file before and after, and where the model is from."""
    import numpy as np

    from robotrue.app.registered import open_model, provenance_used
    from robotrue.compensation.difference import compare_jobs
    from robotrue.compensation.stance import start_joints

    place = None if request.cell is None else context.cell_file(request.cell)
    if request.model is None:
        return (None if place is None else open_model(place)[0]), [], None
    cell, model = open_model(context.model_file(request.model), place)
    home = start_joints(cell.robot, cell.controller.start, None)
    found = compare_jobs(*files, cell, model, np.empty(0), home)
    return cell, [each for _, each in found], provenance_used(cell, model)


def _commands(prefix: str, poses: Array) -> dict[str, Array]:
    from robotrue.core.rotations import abc_from_matrix

    places, angles = poses[:, :3, 3].T / MM, abc_from_matrix(poses[:, :3, :3]).T / DEG
    named = {f"{prefix}{n}_mm": v for n, v in zip("xyz", places, strict=True)}
    return named | {f"{prefix}{n}_deg": v for n, v in zip("abc", angles, strict=True)}


def _predicted_columns(
    differences: Sequence[Difference], rows: IntArray, compensated: bool
) -> dict[str, Array]:
    """Predicted errors before and after, and their standard deviation, mm in base."""
    import numpy as np

    if not differences:
        return {}
    before, after = (
        np.concatenate([getattr(each, name) for each in differences])[rows] / MM
        for name in ("error_before", "error_after")
    )
    covariance = np.concatenate([each.covariance for each in differences])[rows]
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)) / MM
    out = {f"predicted_before_{n}_mm": before[:, k] for k, n in enumerate("xyz")}
    if compensated:
        out |= {f"predicted_after_{n}_mm": after[:, k] for k, n in enumerate("xyz")}
    return out | {f"sigma_{n}_mm": sigma[:, k] for k, n in enumerate("xyz")}


def _write_sheet(
    path: Path,
    job: Sequence[Program],
    rows: IntArray,
    along: Array,
    columns: dict[str, Array],
    origin: Provenance | None,
) -> None:
    from robotrue.measurement.formats.sheet import write_columns

    places = [(program.name, int(line)) for program in job for line in program.line]
    chosen = [places[row] for row in rows.tolist()]
    table = {
        "point": [str(k + 1) for k in range(len(rows))],
        "file": [name for name, _ in chosen],
        "line": [str(line) for _, line in chosen],
        "along_mm": [f"{v / MM:.3f}" for v in along],
    }
    table |= {
        name: [f"{v:.6f}" if v == v else "" for v in values] for name, values in columns.items()
    }
    write_columns(path, table, origin or MEASURED)


NAMES: Final = ("x", "y", "z", "length")


class DryRunRequest(Request):
    """Planned points, and the measurements before and after."""

    sheet: Annotated[Path, InputFile(argument="SHEET")]
    """Points (CSV) of `dry-run-plan`."""
    before: Annotated[Path, InputFile(argument="BEFORE")]
    """Measured with the program from CAM: point, x_mm, y_mm, z_mm in base."""
    after: Annotated[Path | None, InputFile(argument="[AFTER]")] = None
    """The same with the compensated program."""


@operation("dry_run")
def evaluate_dry_run(request: DryRunRequest, context: Context) -> PlainResult:
    """Evaluate a dry run: the measured error of a program's points, before and after compensation.

    Raises:
        FormatError: A column that is missing or no number; with file and line.
        ConfigurationError: A point that was not planned or measured twice.
        ImplausibleDataError: A point far from its target.
    """
    from robotrue.measurement.formats.sheet_file import read_sheet
    from robotrue.validation.dry_run_points import match_points, summarise_errors

    sheet = read_sheet(request.sheet)
    names = sheet.words("point")
    wanted = sheet.numbers(("x_mm", "y_mm", "z_mm")) * MM
    runs, missing, origins = {}, {}, [sheet.provenance]
    for name, path in (("before", request.before), ("after", request.after)):
        if path is None:
            continue
        measured = read_sheet(path)
        place = measured.numbers(("x_mm", "y_mm", "z_mm")) * MM
        found = measured.words("point")
        rows, error = match_points(names, wanted, found, place, measured.lines, measured.source)
        predicted, sigma = _read_band(sheet, name, rows)
        runs[name] = summarise_errors(error, predicted, sigma)
        missing[name] = tuple(each for each in names if each not in set(found))
        origins.append(measured.provenance)
    return PlainResult(
        values={name: _run_document(errors, missing[name]) for name, errors in runs.items()},
        shown=(*_run_tables(runs, len(names)), *_run_notes(runs, missing)),
        provenance=merge(origins),
    )


def _run_document(errors: AxisErrors, missing: Sequence[str]) -> dict[str, object]:
    return {
        "points": errors.count,
        "not_measured": list(missing),
        **{
            f"{axis}_mm": {
                "mean": float(errors.mean[k] / MM),
                "max": float(errors.largest[k] / MM),
                "sd": float(errors.deviation[k] / MM),
            }
            for k, axis in enumerate(NAMES)
        },
        "bias_mm": (errors.bias / MM).tolist(),
        "in_band_95": None if math.isnan(errors.inside) else errors.inside,
    }


def _run_tables(runs: Mapping[str, AxisErrors], planned: int) -> tuple[Table, Table]:
    """The layout of Table 9, and each axis."""
    lengths = Table(
        title=f"Dry run, {planned} points: length of the error, mm",
        columns=("", "points", "mean", "max", "sd"),
        rows=tuple(
            (name, str(e.count), *(f"{v[3] / MM:.3f}" for v in (e.mean, e.largest, e.deviation)))
            for name, e in runs.items()
        ),
    )
    axes = Table(
        title="Each axis of base, mm: size of the error, and its mean with sign",
        columns=("", "axis", "mean", "max", "sd", "mean with sign"),
        rows=tuple(
            (name, NAMES[k], *(f"{v[k] / MM:.3f}" for v in e.sizes), f"{e.bias[k] / MM:+.3f}")
            for name, e in runs.items()
            for k in range(3)
        ),
    )
    return lengths, axes


def _run_notes(
    runs: Mapping[str, AxisErrors], missing: Mapping[str, Sequence[str]]
) -> Iterable[Note]:
    for name, e in runs.items():
        if e.inside == e.inside:
            yield Note(
                f"{name}: {100.0 * e.inside:.0f} % of the points lie in the model's 95 % band "
                "in x, y and z (86 % are expected of three independent axes)"
            )
        if missing[name]:
            yield Note(f"{name}: not measured: {', '.join(missing[name])}")


def _read_band(sheet: Sheet, run_name: str, rows: IntArray) -> tuple[Array, Array]:
    """Predicted errors of some points and their deviation, (m, 3) m; NaN where not predicted."""
    import numpy as np

    predicted = tuple(f"predicted_{run_name}_{n}_mm" for n in "xyz")
    sigma = tuple(f"sigma_{n}_mm" for n in "xyz")
    if not all(sheet.has(name) for name in (*predicted, *sigma)):
        return np.empty((0, 3)), np.empty((0, 3))
    error, deviation = (
        np.column_stack([sheet.parse(name) for name in names])[rows] * MM
        for names in (predicted, sigma)
    )
    return error, deviation
