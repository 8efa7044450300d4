"""What is told of a drilling model: how it was chosen, what it covers, what became of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from robotrue.core.provenance import marked_document
from robotrue.core.units import DEG, MM
from robotrue.drilling.choose import Trial
from robotrue.drilling.foot_model import NormalModel


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
