"""A model on the screen: what was learned, how sure, and how it sees a measurement set."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np

from robotrue.app.workbench.arm_body import answer
from robotrue.app.workbench.errors_along import count_sizes
from robotrue.app.workbench.file_imports import cell_of
from robotrue.calibration.model import ErrorModel, provenance_of
from robotrue.core.arrays import Array
from robotrue.core.provenance import merge
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.screening import screen
from robotrue.report.model_view import StiffnessRow, drive_errors, list_geometric_errors, stiffness
from robotrue.report.warning_groups import count_warnings
from robotrue.robot.configuration import controller_axes
from robotrue.robot.model import RobotModel
from robotrue.store import items, measurements, models
from robotrue.store.measurements import RowQuery
from robotrue.store.model_file import ModelFile
from robotrue.store.nouns import CELL, MEASUREMENT, MODEL, MeasurementRecord
from robotrue.store.workspace import Workspace
from robotrue.validation.contest import Selection, selection_from_summary
from robotrue.validation.evaluation import Evaluation, evaluate
from robotrue.validation.metrics import coverage, error_statistics


def show_model(workspace: Workspace, model_id: str, version: int) -> bytes:
    """Returns parameters, warnings, the contest of methods, and numbers held out."""
    record = items.get(workspace, MODEL, model_id, version=version)
    held = models.model_of(workspace, record)
    rows = measurements.read_data(workspace, record)
    model, summary = held.model, held.model.training_summary()
    return answer(
        {
            "simulated": from_simulation(model, rows),
            "method": summary.method,
            "poses": summary.rows,
            "screened": len(summary.screened_rows),
            "verdict": summary.verdict,
            "held_out_m": summary.held_out_mean,
            "rms_m": summary.rms,
            "noise_m": summary.white_sd,
            "terms": list(summary.terms),
            "warnings": [
                {"text": text, "names": names}
                for text, names in count_warnings(model, summary.warnings)
            ],
            "parameters": list_geometric_errors(model),
            "stiffness": _stiffness(model),
            "drives": drive_errors(model),
            "contest": _contest(model),
        }
    )


def _stiffness(model: ErrorModel) -> dict[str, StiffnessRow]:
    return {name: row for name, row in stiffness(model).items() if row["Nm_per_rad"] is not None}


def _contest(model: ErrorModel) -> dict[str, object] | None:
    stated = model.training_summary().selection
    if not stated:
        return None
    found: Selection = selection_from_summary(stated)
    return {
        "winner": found.winner,
        "reason": found.reason,
        "rule": found.rule,
        "table": [
            {
                "method": each.name,
                "mean_m": each.mean,
                "max_m": each.max,
                "coverage": each.coverage,
                "failure": each.failure,
            }
            for each in found.table
        ],
    }


def from_simulation(model: ErrorModel | None, rows: Iterable[MeasurementSet] = ()) -> bool:
    """Returns whether any of its data are marked as simulated."""
    origins = [] if model is None else [provenance_of(model)]
    return merge([*origins, *(each.provenance for each in rows)]).simulated


WORST: Final = 15
MOST_DRAWN: Final = 300
"""Poses in a chart of errors."""


def evaluate_set(
    workspace: Workspace, set_id: str, version: int, held: ModelFile
) -> tuple[MeasurementSet, Evaluation]:
    """Returns a stored set, and its errors before and after by a model."""
    record = items.get(workspace, MEASUREMENT, set_id, version=version)
    rows = measurements.rows_of(workspace, record)
    return rows, evaluate(held.model, rows, payload=held.cell.payload)


def judge_measurement(
    workspace: Workspace, set_id: str, version: int, model_id: str, model_version: int
) -> bytes:
    """Returns the accuracy of a model on a set, its worst poses and screened rows."""
    record = items.get(workspace, MODEL, model_id, version=model_version)
    held = models.model_of(workspace, record)
    rows, seen = evaluate_set(workspace, set_id, version, held)
    fitted = any(to.id == set_id for to in record.refs("data"))
    inside = coverage(seen.after, seen.covariance)
    return answer(
        {
            "fitted": fitted,
            "simulated": from_simulation(held.model, [rows]),
            "model": record.name,
            "before_m": _sizes(seen.before),
            "after_m": _sizes(seen.after),
            "coverage": inside.share,
            "worst": _worst(seen),
            "poses": _errors_by_pose(seen),
            "sizes": count_sizes(*(np.linalg.norm(e, axis=1) for e in (seen.before, seen.after))),
            "screening": _screen_poses(seen),
        }
    )


def _errors_by_pose(seen: Evaluation) -> list[dict[str, object]]:
    """Error of each pose before and after; of a long set some, evenly spaced, and the worst."""
    before, after = np.linalg.norm(seen.before, axis=1), np.linalg.norm(seen.after, axis=1)
    shown = np.unique(np.linspace(0, len(after) - 1, min(len(after), MOST_DRAWN)).astype(np.int64))
    rows = np.union1d(shown, np.argsort(-after)[:WORST])
    return [
        {
            "row": int(k) + 1,
            "line": int(seen.measured.source_row[k]),
            "before_m": float(before[k]),
            "after_m": float(after[k]),
        }
        for k in rows
    ]


def list_rows(
    workspace: Workspace, set_id: str, version: int, sort: str, offset: int, limit: int
) -> bytes:
    """Returns a page of the rows of a set: line of the file, axes in deg, position in mm.

    The axes are those the controller displays, where the set knows the cell it was measured in.
    """
    record = items.get(workspace, MEASUREMENT, set_id, version=version)
    joints = tuple(f"joints_{k + 1}" for k in range(record.dof))
    position = tuple(f"position_{axis}" for axis in "xyz")
    columns = ("source_row", *joints, *position)
    by_axis = sort.removeprefix("-") in joints  # a controller may count in reverse
    shown = RowQuery(columns=columns, sort=sort, offset=offset, limit=limit)
    if by_axis:
        shown = RowQuery(columns=columns, limit=record.poses)
    page = measurements.some_rows(workspace, record, shown)
    robot = _robot_of(workspace, record)
    axes = np.stack([page.columns[name] for name in joints], axis=1)
    if robot is not None:
        axes = controller_axes(robot, axes)
    points = np.stack([page.columns[name] for name in position], axis=1) / MM
    values = np.column_stack([page.columns["source_row"], np.degrees(axes), points])
    if by_axis:
        order = np.argsort(values[:, columns.index(sort.removeprefix("-"))], kind="stable")
        values = values[order[::-1] if sort.startswith("-") else order][offset : offset + limit]
    return answer(
        {
            "columns": columns,
            "letter": "j" if robot is None else "A",
            "rows": values,
            "total": page.total,
            "offset": offset,
        }
    )


def _robot_of(workspace: Workspace, record: MeasurementRecord) -> RobotModel | None:
    """The arm of the cell a set was measured in; None where the set does not state it."""
    for to in record.refs("cell"):
        return cell_of(workspace, items.get(workspace, CELL, to.id, version=to.version)).robot
    return None


def _sizes(errors: Array) -> dict[str, float]:
    found = error_statistics(errors)
    return {"mean": found.mean, "p95": found.p95, "max": found.max}


def _worst(seen: Evaluation) -> list[dict[str, object]]:
    before, after = (np.linalg.norm(e, axis=1) for e in (seen.before, seen.after))
    order = np.argsort(-after, kind="stable")[:WORST]
    return [
        {
            "row": int(row) + 1,
            "line": int(seen.measured.source_row[row]),
            "group": seen.measured.group_names[int(seen.measured.group[row])],
            "before_m": float(before[row]),
            "after_m": float(after[row]),
        }
        for row in order
    ]


def _screen_poses(seen: Evaluation) -> dict[str, object]:
    try:
        found = screen(seen.measured, seen.after, seen.covariance)
    except ImplausibleDataError as error:  # the model is wrong here, not the rows
        return {"dropped": 0, "findings": [], "refused": error.message}
    return {
        "dropped": int((~found.kept).sum()),
        "findings": [str(each) for each in found.findings[:20]],
        "refused": "",
    }
