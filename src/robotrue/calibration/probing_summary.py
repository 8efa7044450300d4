"""What a model refined by touches says of itself: its lineage, and what it leans on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from robotrue.calibration.belief import Belief
from robotrue.calibration.identifiability import visibility
from robotrue.calibration.lineage import history, merged_document, record_step
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.update import renew_summary
from robotrue.core.files import sha256
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.model import parameter_names

NOISY: Final = 1.5
"""Noise of the touches over that stated, from which it is said."""


def touches_hash(touches: ProbingSet) -> str:
    """Returns the SHA-256 of joints, nominal points and parts."""
    return sha256(touches.joints.tobytes() + touches.point.tobytes() + touches.part.tobytes())


def probing_summary(
    before: Belief,
    after: Belief,
    touches: ProbingSet,
    outliers: Sequence[str],
    parents: Sequence[ErrorModel],
    settings: Mapping[str, Any],
    rms: float,
    scatter: float,
) -> dict[str, Any]:
    """Returns the summary of the refined model, JSON values.

    Args:
        before: Prior of the arm.
        after: Posterior.
        touches: All of them.
        outliers: Labels of those not believed.
        parents: The model it began with; none for a nominal arm.
        settings: What decided the result besides the data.
        rms: m, of the believed residuals.
        scatter: Noise of the touches as learned, over that stated.
    """
    screened = [i for i, label in enumerate(touches.labels) if label in outliers]
    step = {
        **record_step("probing", parents, None, settings, ()),
        "rows": len(touches),
        "data_sha256": touches_hash(touches),
        "sources": [touches.source] if touches.source else [],
        "screened_rows": screened,
        "outliers": list(outliers),
    }
    doubts = [
        f"touches scatter {scatter:.1f} times the stated noise: touch_sigma is too small, the part "
        "is not as drawn, or the tool is not the one stated."
    ] * (scatter > NOISY)
    if parents:
        past = [old for parent in parents for old in history(parent)]
        origin = merged_document(parents, touches.provenance)
        summary = {**parents[0].training_summary(), "provenance": origin}
        summary["doubts"] = [*parents[0].training_summary().warnings, *doubts]
        return renew_summary(summary, [*past, step], after)
    return {
        "method": "probing",
        "rows": len(touches),
        "numbers": 3 * int(touches.full.sum()) + int((~touches.full).sum()),
        "screened_rows": screened,
        "data_sha256": step["data_sha256"],
        "sources": step["sources"],
        "provenance": touches.provenance.to_document(),
        "joint_range_rad": [
            touches.joints.min(axis=0).tolist(),
            touches.joints.max(axis=0).tolist(),
        ],
        "verdict": "conditional",
        "doubts": [
            "calibrated by touches alone: arm, tool and part are known together, at the postures "
            "that were touched; elsewhere the stated uncertainty counts.",
            *doubts,
        ],
        "unseen": [],
        "parameters": _parameters(before, after),
        "white_sd_m": after.white,
        "rms_m": rms,
        "lineage": [step],
    }


def _parameters(before: Belief, after: Belief) -> dict[str, dict[str, Any]]:
    size = len(after.errors)
    sd = np.sqrt(after.inflation * after.variance[:size])
    known = np.sqrt(before.inflation * before.variance[:size])
    kinds = [
        visibility(float(now / prior)) if prior > 0.0 else "fixed"
        for now, prior in zip(sd, known, strict=True)
    ]
    return {
        name: {"value": float(value), "sd": float(spread), "class": kind}
        for name, value, spread, kind in zip(
            parameter_names(after.robot.dof), after.errors, sd, kinds, strict=True
        )
    }
