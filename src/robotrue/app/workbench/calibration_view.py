"""A model on the screen: what was learned, how sure, and what the data cannot tell."""

from __future__ import annotations

from collections.abc import Iterable

from robotrue.app.workbench.arm_body import answer
from robotrue.calibration.lineage import provenance_of
from robotrue.calibration.model import ErrorModel
from robotrue.core.provenance import merge
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.report.model_view import (
    StiffnessRow,
    drive_errors,
    list_geometric_errors,
    stiffness,
)
from robotrue.report.warning_groups import group_warnings
from robotrue.store import items, measurements, models
from robotrue.store.nouns import MODEL
from robotrue.store.workspace import Workspace
from robotrue.validation.contest import Selection, selection_from_summary


def show_model(workspace: Workspace, model_id: str, version: int) -> bytes:
    """Returns parameters with deviations, doubts, the contest of methods, and numbers held out."""
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
            "doubts": group_warnings(model, summary.warnings),
            "unseen": [
                {"name": unseen.name, "cure": unseen.cure}
                for unseen in summary.unseen
                if not unseen.harmless
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
    """Returns whether anything this rests on was simulated, as the data themselves say."""
    origins = [] if model is None else [provenance_of(model)]
    return merge([*origins, *(each.provenance for each in rows)]).simulated
