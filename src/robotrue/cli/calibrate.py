"""``robotrue calibrate``: measurements in, model file out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from robotrue.calibration.methods import METHODS, FitSettings, fit
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.priors import StiffnessPrior
from robotrue.cell.cell import Cell
from robotrue.cell.config import read_cell
from robotrue.cli.console import emit_json, emit_table, progress, say
from robotrue.cli.inputs import measured
from robotrue.errors import ConfigurationError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.store.model_file import write_model
from robotrue.validation.contest import Selection, selection_from_summary
from robotrue.validation.selection import fit_auto
from robotrue.validation.validate import validate

STIFFNESS_SD = 0.3
"""Relative standard deviation taken for a stiffness stated in the cell."""


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
    if method != "auto" and method not in METHODS:
        raise ConfigurationError(
            f"method {method!r}, expected auto, {', '.join(METHODS)}.", hint="--method auto"
        )
    cell = read_cell(cell_path)
    for doubt in cell.doubts:
        say(f"note: {doubt}")
    measurements = measured(cell, paths, mapping)
    model, selection = calibrated(cell, measurements, method)
    write_model(output, model, cell)
    say(f"model written to {output}")
    summary = dict(model.training_summary())
    for row in summary.get("screened_rows", ()):
        line, name = measurements.source_row[row], measurements.group_names[measurements.group[row]]
        say(f"screened out: line {line} of {name}, too far off to be this robot")
    if report is not None:
        from robotrue.cli.pages import write_page

        result = validate(model, measurements, payload=cell.payload)
        write_page(
            report, model, result, title="Calibration, on its own poses", selection=selection
        )
        say(
            f"report written to {report} (fit residuals; hold poses out and validate for the truth)"
        )
    if as_json:
        emit_json({"model": str(output), **summary})
    else:
        show(summary)


def calibrated(
    cell: Cell, measurements: MeasurementSet, method: str
) -> tuple[ErrorModel, Selection | None]:
    """Returns the model of a cell by a method's name; ``auto`` lets held-out poses choose."""
    robot, settings = cell.measured_robot, fit_settings(cell)
    if method != "auto":
        with progress() as step:
            step(method, 0, 1)
            return fit(robot, measurements, method=method, settings=settings), None
    with progress() as step:
        model = fit_auto(robot, measurements, settings, progress=step)
    selection = selection_from_summary(model.training_summary()["selection"])
    say(f"method {selection.winner}: {selection.reason}")
    return model, selection


def fit_settings(cell: Cell) -> FitSettings:
    """Returns what the cell says about noise, load and stiffness."""
    stated = np.isfinite(cell.compliance_prior)
    stiffness = None
    if stated.all():
        stiffness = StiffnessPrior(
            stiffness=1.0 / cell.compliance_prior, relative_sd=np.array(STIFFNESS_SD)
        )
    return FitSettings(payload=cell.payload, repeatability=cell.repeatability, stiffness=stiffness)


def show(summary: dict[str, Any]) -> None:
    """Prints a training summary as a table: scalars first, lists below."""
    rows = [(k, _text(v)) for k, v in summary.items() if isinstance(v, str | int | float)]
    emit_table("model", ("", "value"), rows)
    for line in summary.get("doubts", ()):
        say(f"doubt: {line}")
    for direction in summary.get("unseen", ()):
        if not direction.get("harmless"):
            say(f"not seen by the data: {direction['name']}. {direction['cure']}")


def _text(value: str | float) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
