"""``robotrue calibrate``: measurements in, model file out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path

from robotrue.app.outputs import check_output
from robotrue.calibration.lineage import provenance_of
from robotrue.calibration.methods import METHODS, fit
from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell
from robotrue.cell.config import read_cell
from robotrue.cli.console import emit_facts, emit_json, progress, say, say_mark
from robotrue.cli.inputs import measured
from robotrue.errors import ConfigurationError, ObservabilityError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.planning.information import settings_of
from robotrue.report.model_view import remarks, result_facts
from robotrue.store.model_file import write_model
from robotrue.validation.auto import fit_auto
from robotrue.validation.contest import Selection, selection_from_summary
from robotrue.validation.validate import validate

"""Relative standard deviation taken for a stiffness stated in the cell."""
SHOWN_ROWS = 10


def run(
    cell_path: Path,
    paths: Sequence[Path],
    output: Path,
    *,
    method: str,
    mapping: Path | None,
    report: Path | None,
    as_json: bool,
) -> None:
    """Calibrates and writes the model file; prints what was learned and what was not."""
    require_method(method)
    sources = [cell_path, *paths, *([mapping] if mapping else [])]
    for target in [output, *([report] if report else [])]:
        check_output(target, sources)
    cell = read_cell(cell_path)
    for doubt in cell.doubts:
        say(f"note: {doubt}")
    measurements = measured(cell, paths, mapping)
    try:
        model, selection = calibrated(cell, measurements, method)
    except ObservabilityError as cause:  # the fit knows rows, not files
        raise ObservabilityError(
            cause.message, source=", ".join(map(str, paths)), hint=cause.hint
        ) from cause
    write_model(output, model, cell)
    origin = provenance_of(model)
    say_mark(origin)
    say(f"model written to {output}")
    if report is not None:
        write_report(report, model, measurements, cell, selection)
    summary = model.training_summary()
    for line in screened_remarks(measurements, summary.screened_rows):
        say(line)
    if as_json:
        emit_json({"model": str(output), **summary}, origin)
    else:
        emit_facts(f"calibration of {model.robot.name}", result_facts(summary), origin)
        for line in remarks(summary):
            say(line)


def require_method(method: str) -> None:
    """Passes if there is such a method.

    Raises:
        ConfigurationError: There is not.
    """
    if method != "auto" and method not in METHODS:
        raise ConfigurationError(
            f"method {method!r}, expected auto, {', '.join(METHODS)}.", hint="--method auto"
        )


def screened_remarks(measurements: MeasurementSet, rows: Sequence[int]) -> list[str]:
    """Returns which lines of which files the fit left out, the first ten by number."""
    out = [
        f"screened out: line {measurements.source_row[row]} of "
        f"{measurements.group_names[measurements.group[row]]}, too far off to be this robot"
        for row in rows[:SHOWN_ROWS]
    ]
    if len(rows) > SHOWN_ROWS:
        out.append(f"screened out: {len(rows) - SHOWN_ROWS} more rows, all in --json")
    return out


def calibrated(
    cell: Cell,
    measurements: MeasurementSet,
    method: str,
    *,
    told: Callable[[str, int, int], None] | None = None,
) -> tuple[ErrorModel, Selection | None]:
    """Returns the model of a cell by a method's name; ``auto`` lets held-out poses choose.

    Args:
        cell: Arm, tool, instrument.
        measurements: All rows.
        method: Of ``METHODS``, or ``auto``.
        told: How far it is: what, done, of; None: a bar on the terminal.
    """
    robot, settings = cell.measured_robot, settings_of(cell)
    with nullcontext(told) if told is not None else progress() as step:
        if method != "auto":
            step(method, 0, 1)
            return fit(robot, measurements, method=method, settings=settings), None
        model = fit_auto(robot, measurements, settings, progress=step)
    selection = selection_from_summary(model.training_summary().selection or {})
    say(f"method {selection.winner}: {selection.reason}")
    return model, selection


def write_report(
    path: Path,
    model: ErrorModel,
    measurements: MeasurementSet,
    cell: Cell,
    selection: Selection | None,
) -> None:
    """Writes the page of a calibration, validated on its own poses."""
    from robotrue.app.calibration_page import write_page

    result = validate(model, measurements, payload=cell.payload)
    write_page(
        path,
        model,
        result,
        title="Calibration, on its own poses",
        measured=measurements.provenance,
        selection=selection,
    )
    say(f"report written to {path} (fit residuals; hold poses out and validate for the truth)")
