"""A model on the screen: what was learned, how sure, and what the data cannot tell."""

from __future__ import annotations

from typing import Any

from robotrue.calibration.model import ErrorModel
from robotrue.report.model_view import drive_errors, list_geometric_errors, stiffness
from robotrue.store import items, measurements, models
from robotrue.store.nouns import MEASUREMENT, MODEL
from robotrue.store.workspace import Workspace
from robotrue.validation.contest import Selection, selection_from_summary
from robotrue.web.questions.marks import from_simulation
from robotrue.web.questions.packing import answer


def shown(folder: str, model_id: str, version: int) -> bytes:
    """Returns parameters with deviations, doubts, the contest of methods, and numbers held out."""
    with Workspace.open(folder) as workspace:
        record = items.get(workspace, MODEL, model_id, version=version)
        held = models.model_of(workspace, record)
        rows = [
            measurements.rows_of(
                workspace, items.get(workspace, MEASUREMENT, to.id, version=to.version)
            )
            for to in record.refs("data")
        ]
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
            "doubts": list(summary.warnings),
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


def _stiffness(model: ErrorModel) -> dict[str, dict[str, Any]]:
    return {name: row for name, row in stiffness(model).items() if row["Nm_per_rad"] is not None}


def _contest(model: ErrorModel) -> dict[str, Any] | None:
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
