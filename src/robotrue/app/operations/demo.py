"""Measure, calibrate, validate, compensate and re-measure a virtual cell (or real data)."""

from __future__ import annotations

from pathlib import Path

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Note, PlainResult, Table
from robotrue.app.request import Request
from robotrue.core.provenance import Provenance


class DemoRequest(Request):
    """Folder for the demo's files, and the data to run on."""

    out: Path = Path("demo-out")
    """Folder for all files of the demo."""
    data: Path | None = None
    """Folder of measured data: the same job on a real UR10."""
    seed: int = 1
    """Seed of the virtual cell."""


@operation()
def run(request: DemoRequest, context: Context) -> PlainResult:
    """Runs the demo; the folder keeps every file needed to repeat it.

    Raises:
        FormatError: The data are missing, or the folder cannot be written to.
    """
    if request.data is None:
        from robotrue.app.demo_virtual import run_virtual_demo

        result = run_virtual_demo(request.out, context, seed=request.seed)
    else:
        from robotrue.app.demo_measured import run_measured_demo

        result = run_measured_demo(request.data, request.out, context, seed=request.seed)
    tables = (
        Table(
            title=table.title,
            columns=tuple(f"{each.title} {each.unit}".strip() for each in table.columns),
            rows=tuple(tuple(map(_word, row)) for row in table.rows),
        )
        for table in result.tables
    )
    return PlainResult(
        values=result.results,
        shown=(
            *tables,
            Note(f"page: {result.page}"),
            Note(f"everything to run it again: {result.folder}"),
        ),
        provenance=Provenance(
            simulated=result.simulated, instrument="virtual cell" * result.simulated
        ),
    )


def _word(value: str | int | float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.3f}" if isinstance(value, float) else str(value)
