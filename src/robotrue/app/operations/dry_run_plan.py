"""Pick points at equal steps along a program: the sheet of a dry run for the measuring crew."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Note
from robotrue.app.request import Item, Option, Output, Reference, Request
from robotrue.core.units import DEG, MM
from robotrue.validation.validation_defaults import DRY_RUN_POINTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from robotrue.cell.cell import Cell
    from robotrue.compensation.difference import Difference
    from robotrue.core.arrays import Array, IntArray
    from robotrue.core.provenance import Provenance
    from robotrue.program.program import Program

NEXT: Final = (
    "Stop the robot at each line, measure the tool point in base, write point, x_mm, y_mm, z_mm: "
    "one file for the program as it was, one for the compensated one."
)


class DryRunPlanRequest(Request):
    """Along which program, how many points, and what predicts their errors."""

    program: Annotated[
        Reference, Item(noun="program", argument="PROGRAM", help="Program as CAM made it.")
    ]
    output: Annotated[
        Path,
        Output(
            names=("--output", "-o"),
            what="a CSV table",
            suffixes=(".csv",),
            help="Sheet (CSV) to write.",
        ),
    ]
    points: Annotated[int, Option(help="How many; 2 at least.")] = DRY_RUN_POINTS
    after: Annotated[
        Reference | None, Item(noun="program", help="Its compensated copy: commands of both.")
    ] = None
    model: Annotated[
        Reference | None, Item(noun="model", help="Model file: predicted errors and their band.")
    ] = None
    cell: Annotated[
        Reference | None, Item(noun="cell", help="Registered cell with the part frame.")
    ] = None


def run(request: DryRunPlanRequest, context: Context) -> PlainResult:
    """Writes the sheet of a dry run.

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
    cell, differences, origin = _predict(request, context, (paths, changed))
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
    columns |= _band(differences, rows, request.after is not None)
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


def _predict(
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


def _band(differences: Sequence[Difference], rows: IntArray, compensated: bool) -> dict[str, Array]:
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
    from robotrue.core.provenance import MEASURED
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


OPERATION: Final = Operation(request=DryRunPlanRequest, run=run)
