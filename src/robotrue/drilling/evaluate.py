"""Residual tilt after one move on clamps with known tilt; evaluation of a drilling model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.provenance import marked_document
from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.campaign import Campaign, conditions, tilt_seen
from robotrue.drilling.correction import learning_errors, residual_tilt
from robotrue.drilling.correction_trials import Trial, squared_distance
from robotrue.drilling.foot_model import NormalModel, Residuals, estimate_tilt
from robotrue.drilling.head import normal_from_tilt, tilt_between
from robotrue.drilling.regression import LinearCorrection, fit_linear, significance
from robotrue.errors import ConfigurationError

REGION: Final = -2.0 * float(np.log(0.05))
"""Squared Mahalanobis distance inside which a two-dimensional error lies with 95 %."""
ENOUGH: Final = 16
"""Clamps above which eight terms with interactions are shown for other kinds than patent."""
CLEAR: Final = 3.0
"""|t| from which a term is called significant."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TiltEvaluation:
    """Residual tilt of a test.

    Attributes:
        clamps: How many.
        uncorrected: Of the readings as they are.
        patent: Of the patent's regression; None where the campaign could not determine it.
        ours: Of the model.
        left: (n, 2) rad, true tilt less that of the model at every clamp.
        before: (n, 2) rad, true tilt less that of the readings as they are.
        covered: Share of clamps whose true tilt lies in the model's 95 % region.
    """

    clamps: int
    uncorrected: Residuals
    patent: Residuals | None
    ours: Residuals
    left: Array
    before: Array
    covered: float


def evaluate_test(model: NormalModel, test: Campaign) -> TiltEvaluation:
    """Returns what one move leaves on clamps the model was not learned from.

    Raises:
        ConfigurationError: No clamps, or tilts in another axis order.
    """
    if not len(test):
        raise ConfigurationError("the test holds no clamps.", source=test.source or None)
    if test.order != model.head.order:
        raise ConfigurationError(
            f"the test's tilts are in order {test.order}, the head's is {model.head.order}."
        )
    found = estimate_tilt(model, test.clamps)
    left = tilt_between(normal_from_tilt(model.head.order, found.tilt), test.normal)
    before = residual_tilt(model.foot, None, test)
    raw = tilt_seen(model.foot, model.head.order, test.clamps.readings)
    distance = squared_distance(found.tilt - test.tilt, found.covariance)
    return TiltEvaluation(
        clamps=len(test),
        uncorrected=residuals(before),
        patent=None
        if model.patent is None
        else residuals(residual_tilt(model.foot, model.patent, test)),
        ours=residuals(left),
        left=test.tilt - found.tilt,
        before=test.tilt - raw,
        covered=float(np.mean(distance <= REGION)),
    )


def residuals(left: Array) -> Residuals:
    """Returns mean, 95th percentile and largest of tilts left (n,) rad."""
    return Residuals(
        mean=float(np.mean(left)),
        p95=float(np.percentile(left, 95.0)),
        largest=float(np.max(left)),
    )


def model_document(model: NormalModel, trials: Sequence[Trial] = ()) -> dict[str, object]:
    """Returns a model as JSON values in deg, mm and N, with the trials it was chosen by."""
    values = {
        "kind": model.kind,
        "inputs": list(model.correction.inputs),
        "corrects": model.correction.corrects,
        "held_out_mean_deg": model.left / DEG,
        "trials": [{"kind": trial.kind, **trial_document(trial)} for trial in trials],
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


def trial_document(trial: Trial) -> dict[str, object]:
    """Returns what a trial left on held-out blocks as JSON values in deg."""
    known = len(trial.residual) > 0
    return {
        "held_out_mean_deg": trial.mean / DEG,
        "held_out_p95_deg": float(np.percentile(trial.residual, 95.0)) / DEG if known else None,
        "reason": trial.reason,
    }


def terms_of(model: NormalModel, data: Campaign) -> list[dict[str, object]]:
    """Returns the significance of each term.

    The terms are the patent's five where the patent's regression was requested or the clamps are
    few, and the eight with interactions otherwise; machine positions that are inputs come last. Of
    a correction of joint targets they are those of a and b, in deg.
    """
    if model.patent is None:
        return []
    causes = conditions(model.foot, data.order, data.clamps)
    fitted = model.patent
    if len(data) > ENOUGH and model.kind != "patent":
        learned = model.correction
        fitted = fit_linear(
            "interactions",
            causes,
            learning_errors(model.foot, data, learned.corrects),
            inputs=learned.inputs,
            corrects=learned.corrects,
        )
    if not isinstance(fitted, LinearCorrection):
        return []
    outputs, size, unit = slice(None), UM, "um"
    if fitted.corrects == "joints":
        outputs, size, unit = slice(2), DEG * float(np.mean(model.foot.radius)), "deg"
    return [
        {
            "term": term.term,
            f"coefficient_{unit}": (term.coefficient[outputs] / size).tolist(),
            f"deviation_{unit}": (term.deviation[outputs] / size).tolist(),
            "t": term.t.tolist(),
            "significant": bool(np.max(np.abs(term.t)) > CLEAR),
        }
        for term in significance(fitted, causes)
    ]


def evaluation_document(result: TiltEvaluation) -> dict[str, object]:
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
