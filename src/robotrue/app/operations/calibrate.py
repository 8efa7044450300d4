"""Learn the error of a robot: from measured poses, or from lengths of draw wire and ball bar."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Facts, Note, PlainResult, Table
from robotrue.app.request import ALL, ON_COMMAND_LINE, InputFile, Item, Option, Reference, Request
from robotrue.app.request_fields import (
    CellFile,
    ForeignColumns,
    ModelOutput,
    SavedPage,
    model_output,
)
from robotrue.core.provenance import Provenance
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ObservabilityError

if TYPE_CHECKING:
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.calibration.calibrated_model import CalibratedModel
    from robotrue.calibration.model import ErrorModel
    from robotrue.cell.cell import Cell
    from robotrue.measurement.measurement_set import MeasurementSet
    from robotrue.measurement.table_set import TableSet
    from robotrue.store.workspace import Transaction
    from robotrue.validation.contest import Selection


TITLE: Final = "Calibration, on its own poses"
FIT_REMARK: Final = " (fit residuals; validate on held-out poses for the accuracy)"
SHOWN_ROWS: Final = 10
"""Screened rows that are named one by one."""


class CalibrateRequest(Request):
    """Cell and measurements to calibrate with, and the method."""

    cell: CellFile
    measurements: Annotated[
        tuple[Reference, ...], Item(noun="measurement", argument="MEAS...", sent=True)
    ]
    """Measurements."""
    output: ModelOutput
    method: Literal["auto", "nominal", "geometric", "elastic", "ripple", "gp"] = "auto"
    """auto, or one of nominal, geometric, elastic, ripple, gp."""
    mapping: ForeignColumns = None
    cure: Annotated[str | None, Option(shells=ON_COMMAND_LINE)] = None
    """Correct a cause that the data doctor reported; files stay unchanged."""
    table: Annotated[Path | None, InputFile(shells=ALL, advanced=True)] = None
    """Points on a rotary table, measured at several angles (CSV: point, e2_deg, x_mm, y_mm,
    z_mm): its errors are learned, too."""
    report: SavedPage = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibrated:
    """A calibration.

    Attributes:
        model: The error model.
        output: Its file.
        page: Report page that was written, if requested.
        rows: Measured poses.
        measured: Source of the poses.
        provenance: Of the model.
    """

    model: ErrorModel
    output: Path
    page: Path | None
    rows: int
    measured: Provenance
    provenance: Provenance

    def document(self) -> Mapping[str, object]:
        """Returns the training summary as JSON values."""
        return {"model": str(self.output), **self.model.training_summary()}

    def blocks(self) -> Iterable[Block]:
        """Returns what was learned, and what was not."""
        yield from model_blocks(self.model)


def model_blocks(model: ErrorModel) -> Iterable[Block]:
    """Returns what a model learned, and what it did not."""
    from robotrue.report.model_view import remarks, result_facts

    facts = result_facts(model.training_summary())
    yield Facts(title=f"calibration of {model.robot.name}", rows=tuple(facts))
    for line in remarks(model):
        yield Note(line)


@operation("calibrate")
def run(request: CalibrateRequest, context: Context) -> Calibrated:
    """Calibrate the robot from measured poses and write a model file.

    Raises:
        ObservabilityError: Too few measurements for the request.
    """
    from robotrue.app.data_doctor import read_examined
    from robotrue.calibration.model import provenance_of
    from robotrue.store.model_file import write_model
    from robotrue.validation.validate import validate

    cell = context.cell(request.cell)
    examined = read_examined(cell, request.measurements, request.mapping, request.cure, context)
    rows = examined.rows
    table = None if request.table is None else _read_table(cell, request.table)
    model, selection = _fit(request, cell, rows, context)
    model = examined.mark(model)
    if table is not None:
        model = _add_table(model, cell, table)
    output = context.output(request.output)
    write_model(output, model, cell)
    context.wrote("model", output)
    page = None
    if request.report is not None:
        from robotrue.app.report_pages import write_calibration_page

        page = context.output(request.report)
        result = validate(model, rows, payload=cell.payload)
        write_calibration_page(
            page, model, result, title=TITLE, measured=rows.provenance, selection=selection
        )
        context.wrote("report", page, FIT_REMARK)
    for line in _screened_lines(rows, model.training_summary().screened_rows):
        context.inform(line)
    return Calibrated(
        model=model,
        output=output,
        page=page,
        rows=len(rows),
        measured=rows.provenance,
        provenance=provenance_of(model),
    )


def _fit(
    request: CalibrateRequest, cell: Cell, rows: MeasurementSet, context: Context
) -> tuple[ErrorModel, Selection | None]:
    """The model by a method's name; ``auto`` lets held-out poses choose."""
    from robotrue.calibration.methods import fit
    from robotrue.planning.information import settings_of
    from robotrue.validation.contest import selection_from_summary
    from robotrue.validation.selection import fit_auto

    robot, settings = cell.measured_robot, settings_of(cell)
    try:
        if request.method != "auto":
            context.step(request.method, 0, 1)
            return fit(robot, rows, method=request.method, settings=settings), None
        model = fit_auto(robot, rows, settings, progress=context.step)
    except ObservabilityError as cause:  # the fit knows rows, not where they come from
        raise ObservabilityError(
            cause.message,
            source=", ".join(context.name(each) for each in request.measurements),
            hint=cause.hint,
        ) from cause
    selection = selection_from_summary(model.training_summary().selection or {})
    context.inform(f"method {selection.winner}: {selection.reason}")
    return model, selection


def _read_table(cell: Cell, path: Path) -> TableSet:
    """Returns points on the table, with the covariance of the tracker where they state none."""
    from robotrue.cell.cell import tracker_covariance
    from robotrue.measurement.table_set import read_table_points

    return read_table_points(
        path, frame=cell.frame, instrument=lambda position: tracker_covariance(cell, position)
    )


def _add_table(model: ErrorModel, cell: Cell, rows: TableSet) -> ErrorModel:
    """Returns the model with the errors of the rotary table of the cell.

    Raises:
        ConfigurationError: The model has no posterior, or as ``calibrate_table``.
    """
    from robotrue.calibration.calibrated_model import CalibratedModel
    from robotrue.calibration.table_fit import calibrate_table

    if not isinstance(model, CalibratedModel):
        raise ConfigurationError(
            f"--table with a {type(model).__name__}, which learns no errors.",
            hint="--method auto, geometric, elastic, ripple or gp.",
        )
    return calibrate_table(model, rows, cell.controller.external)


def _screened_lines(rows: MeasurementSet, screened: Sequence[int]) -> list[str]:
    """Returns lines and files of the rows that the fit excluded, the first ten by number."""
    lines = [
        f"screened out: line {rows.source_row[row]} of "
        f"{rows.group_names[rows.group[row]]}, implausible for this robot"
        for row in screened[:SHOWN_ROWS]
    ]
    if len(screened) > SHOWN_ROWS:
        lines.append(f"screened out: {len(screened) - SHOWN_ROWS} more rows, all in --json")
    return lines


@run.saves
def save(
    request: CalibrateRequest, result: Calibrated, into: Transaction, context: WorkspaceContext
) -> Mapping[str, object]:
    """Leaves a model with its page, linked to the cell and the poses."""
    from robotrue.app.workspace_context import ref_document
    from robotrue.store import models
    from robotrue.store.nouns import CELL

    cell = context.record(CELL, request.cell)
    made = models.add(
        into,
        result.output,
        name=context.naming.name or f"{cell.name}, {result.rows} poses",
        note=context.naming.note,
        data=context.keep_measured(into, request.measurements, cell.ref, request.mapping),
        cell=cell.ref,
        settings={"method": request.method},
        reports=[] if result.page is None else [result.page],
        job=context.work.job.id,
    )
    return {
        "model": ref_document(made.ref),
        "method": made.method,
        "rows": result.rows,
        "simulated": result.measured.simulated,
    }


class CalibrateLengthsRequest(Request):
    """Cell and measured lengths to calibrate with, and the method."""

    cell: CellFile
    lengths: Annotated[Path, InputFile(argument="LENGTHS")]
    """CSV: j1_deg ..., length_mm, anchor with ax_mm, ay_mm, az_mm, or k1_deg ..."""
    output: Annotated[Path, model_output()]
    """Model file to write."""
    method: Literal["nominal", "geometric", "elastic"] = "elastic"
    """nominal, geometric or elastic."""
    points: Annotated[Path | None, InputFile()] = None
    """Measured points in addition to the lengths: they determine the base."""


@operation("calibrate_lengths")
def calibrate_from_lengths(request: CalibrateLengthsRequest, context: Context) -> PlainResult:
    """Calibrate the robot from lengths: draw wire, ball bar, gauge bar.

    Raises:
        ObservabilityError: Too few lengths for the requested parameters.
    """
    from robotrue.app.measured_rows import read_together
    from robotrue.calibration.length_estimate import estimate_lengths, model_of_lengths
    from robotrue.calibration.model import provenance_of
    from robotrue.measurement.length_set import read_lengths
    from robotrue.planning.information import settings_of
    from robotrue.store.model_file import write_model

    cell = context.cell(request.cell)
    lengths = read_lengths(request.lengths)
    points = None
    if request.points is not None:  # a file in jobs, too
        points = read_together(cell, [request.points], None, reporter=context)
    settings = settings_of(cell)
    context.step(request.method, 0, 1)
    found = estimate_lengths(cell.measured_robot, lengths, settings, request.method, points)
    model = model_of_lengths(found, settings, request.method)
    output = context.output(request.output)
    write_model(output, model, cell)
    context.wrote("model", output)
    names, summary = found.lengths.anchor_names, model.training_summary()
    anchors = {n: (place / MM).tolist() for n, place in zip(names, found.anchors, strict=True)}
    return PlainResult(
        values={"model": str(output), **summary, "anchors_mm": anchors},
        shown=tuple(_length_blocks(model, anchors)),
        provenance=provenance_of(model),
    )


def _length_blocks(
    model: CalibratedModel, anchors: Mapping[str, Sequence[float]]
) -> Iterable[Block]:
    """Returns the learned parameters, the anchors, and what lengths cannot determine."""
    from robotrue.report.model_view import remarks, result_facts

    title = f"calibration of {model.robot.name} from lengths"
    yield Facts(title=title, rows=tuple(result_facts(model.training_summary())))
    if anchors:
        yield Table(
            title="anchors in base",
            columns=("", "x mm", "y mm", "z mm"),
            rows=tuple((name, *(f"{v:.3f}" for v in at)) for name, at in anchors.items()),
        )
    yield from map(Note, remarks(model))
