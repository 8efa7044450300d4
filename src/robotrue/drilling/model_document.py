"""What is told of a drilling model: how it was chosen, what it covers, what it leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from robotrue.core.provenance import marked_document
from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.campaign import Campaign, reading_errors
from robotrue.drilling.choose import Trial
from robotrue.drilling.evaluate import Residuals, TiltEvaluation
from robotrue.drilling.foot_model import NormalModel
from robotrue.drilling.regression import LinearCorrection, fit_linear, significance
from robotrue.drilling.terms import conditions

ENOUGH: Final = 16
"""Clamps above which eight terms with interactions are shown beside another kind than patent."""
CLEAR: Final = 3.0
"""|t| from which a term is called significant."""


def model_document(model: NormalModel, trials: Sequence[Trial] = ()) -> dict[str, Any]:
    """Returns a model as JSON values in deg, mm and N, with the trials it was chosen by."""
    values = {
        "kind": model.kind,
        "held_out_mean_deg": model.left / DEG,
        "trials": [
            {
                "kind": trial.kind,
                "held_out_mean_deg": trial.mean / DEG,
                "held_out_p95_deg": float(np.percentile(trial.residual, 95.0)) / DEG
                if len(trial.residual)
                else None,
                "reason": trial.reason,
            }
            for trial in trials
        ],
        "envelope": {
            "force_N": model.envelope.force.tolist(),
            "z_mm": (model.envelope.height / MM).tolist(),
            "tilt_deg": model.envelope.tilt / DEG,
            "approach": list(model.envelope.approach),
        },
        "campaign_sha256": model.campaign,
        "version": model.version,
        "frozen": None if model.frozen is None else asdict(model.frozen),
    }
    return marked_document(values, model.provenance)


def terms_of(model: NormalModel, data: Campaign) -> list[dict[str, Any]]:
    """Returns the significance of each term.

    The terms are the patent's five where the patent's regression was asked for or the clamps are
    few, and the eight with interactions otherwise.
    """
    if model.patent is None:
        return []
    causes = conditions(model.foot, data.order, data.clamps)
    fitted = model.patent
    if len(data) > ENOUGH and model.kind != "patent":
        fitted = fit_linear("interactions", causes, reading_errors(model.foot, data))
    if not isinstance(fitted, LinearCorrection):
        return []
    return [
        {
            "term": term.term,
            "coefficient_um": (term.coefficient / UM).tolist(),
            "deviation_um": (term.deviation / UM).tolist(),
            "t": term.t.tolist(),
            "significant": bool(np.max(np.abs(term.t)) > CLEAR),
        }
        for term in significance(fitted, causes)
    ]


def evaluation_document(result: TiltEvaluation) -> dict[str, Any]:
    """Returns an evaluation as JSON values."""
    return {
        "clamps": result.clamps,
        "uncorrected": residuals_document(result.uncorrected),
        "patent": None if result.patent is None else residuals_document(result.patent),
        "ours": residuals_document(result.ours),
        "covered_95": result.covered,
    }


def residuals_document(left: Residuals) -> dict[str, float]:
    """Returns residual tilts in degrees."""
    return {
        "mean_deg": left.mean / DEG,
        "p95_deg": left.p95 / DEG,
        "max_deg": left.largest / DEG,
    }
