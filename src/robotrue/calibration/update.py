"""New measurements of the same set-up: the model moves, nothing is fitted from nothing.

The posterior of everything the model holds is the prior of what it learns from the new rows. In one
linearisation blocks one after the other give what all rows give at once, in any order; taken again
at the new mean it is Gauss-Newton. Noise and scales stay those of the model: a change between
campaigns is the business of :mod:`robotrue.calibration.transfer`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from robotrue.calibration.belief import (
    Belief,
    conditioned,
    widened,
    with_centres,
    with_nuisances,
)
from robotrue.calibration.lineage import added, history, merged_document
from robotrue.calibration.model import ErrorModel, require_belief
from robotrue.calibration.new_rows import NUISANCE_SD, NewRows, Piece, new_rows, whitened
from robotrue.calibration.residual import LearnedModel, model_of
from robotrue.calibration.robust import Loss, weights
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.terms.smooth import SmoothBasis, features
from robotrue.core.arrays import Array
from robotrue.errors import ModelMismatchError
from robotrue.measurement.measurement_set import MeasurementSet

LINEARISATIONS: Final = 3
UNCARRIED: Final = 0.05
"""Share of the smooth residual's variance at a new pose from which it gets a centre."""
MOST_CENTRES: Final = 100


def updated(
    model: ErrorModel, measurements: MeasurementSet, *, settings: FitSettings | None = None
) -> LearnedModel:
    """Returns the model with the measurements added; mean, covariance and lineage move.

    Args:
        model: A model of this arm, from a fit, an earlier update or a transfer.
        measurements: Rows of the same campaign, in base, in a tracker set-up the model knows, or
            in a new one (which is then estimated with them). Orientations count where the model
            has learned how noisy they are; otherwise its points alone.
        settings: Payload, robust rule, sd of orientations; repeatability and noise are the
            model's.

    Raises:
        ModelMismatchError: Another number of joints.
        ObservabilityError: A new set-up with fewer than 3 points, or all on one line.
        ImplausibleDataError: Points that cannot be this robot's.
        ConfigurationError: A model without a joint covariance.
    """
    settings = FitSettings() if settings is None else settings
    require_joints(model, measurements)
    belief = require_belief(model)
    if not len(measurements):
        return model_of(belief, model.training_summary().document)
    belief = centred(belief, measurements.joints)
    angular = model.training_summary().white_turn_sd
    if angular is None:
        measurements = points_only(measurements)
    rows = new_rows(belief, measurements, settings, fresh=False)
    prior = with_nuisances(belief, np.full(rows.nuisances, NUISANCE_SD))
    noise = np.array([belief.white**2, (angular or 0.0) ** 2])
    u = innovation_weights(
        prior, rows.pieces(prior), noise, rows.count, settings.solver.loss, belief.inflation
    )
    after, rows = settled(prior, rows, noise, u)
    origin = merged_document([model], measurements.provenance)
    summary = {**model.training_summary(), "provenance": origin}
    step = added(
        "update",
        [model],
        measurements,
        {"loss": settings.solver.loss, "rotation_sd": settings.rotation_sd},
        np.flatnonzero(u == 0.0).tolist(),
    )
    return model_of(
        without_nuisances(after, rows), moved_summary(summary, [*history(model), step], after)
    )


def points_only(measurements: MeasurementSet) -> MeasurementSet:
    """Returns the set without its orientations, for models that do not know their noise."""
    empty = np.full((len(measurements), 3, 3), np.nan)
    return replace(measurements, rotation=empty, rotation_covariance=empty)


def require_joints(model: ErrorModel, measurements: MeasurementSet) -> None:
    """Refuses measurements of an arm with another number of joints.

    Raises:
        ModelMismatchError: It has.
    """
    if len(measurements) and measurements.dof != model.robot.dof:
        raise ModelMismatchError(
            f"measurements have {measurements.dof} joints, the model of {model.robot.name} has "
            f"{model.robot.dof}."
        )


def centred(belief: Belief, joints: Array) -> Belief:
    """Returns the belief with centres of its smooth residual at poses it does not carry yet."""
    smooth = belief.smooth
    if not smooth.size or smooth.amplitude <= 0.0:
        return belief
    left = 1.0 - (smooth.basis.columns(joints) ** 2).sum(axis=1)
    far = np.flatnonzero(left > UNCARRIED)
    if not len(far):
        return belief
    wider = with_centres(belief, further_centres(smooth.basis, joints[far]))
    variance = np.zeros(len(wider.mean))
    variance[belief.place("smooth").stop : wider.place("smooth").stop] = smooth.amplitude**2
    return widened(wider, variance)


def further_centres(basis: SmoothBasis, joints: Array, *, most: int = MOST_CENTRES) -> SmoothBasis:
    """Returns the basis with centres among some poses (n, dof) rad behind those it had.

    The next centre is always the pose carried worst.
    """
    for _ in range(most):
        left = 1.0 - (basis.columns(joints) ** 2).sum(axis=1)
        worst = int(np.argmax(left))
        if left[worst] <= UNCARRIED:
            break
        centre = features(joints[[worst]]) * basis.scale
        basis = SmoothBasis(centres=np.vstack([basis.centres, centre]), scale=basis.scale)
    return basis


def innovation_weights(
    belief: Belief,
    pieces: list[Piece],
    noise: Array,
    count: int,
    loss: Loss,
    inflation: float = 1.0,
) -> Array:
    """Returns the robust weight (n,) of rows by how far they lie from what the belief predicts."""
    out = np.ones(count)
    for piece in pieces:
        n, m, p = piece.columns.shape
        half = (piece.columns.reshape(n * m, p) @ belief.root.T).reshape(n, m, -1)
        spread = half @ np.swapaxes(half, 1, 2)
        total = inflation * (spread + piece.covariance + (noise @ piece.white) * np.eye(m))
        off = piece.values - piece.columns @ belief.mean
        solved = np.linalg.solve(total, off[:, :, None])[:, :, 0]
        length = np.sqrt(np.maximum((off * solved).sum(axis=1), 0.0))
        out[piece.rows] = weights(length, m, loss)
    return out


def settled(
    prior: Belief, rows: NewRows, noise: Array, u: Array, *, start: Belief | None = None
) -> tuple[Belief, NewRows]:
    """Returns the posterior of the rows, linearised at its own mean, and the rows moved there.

    Args:
        prior: With the nuisances of the rows at its end.
        rows: The rows.
        noise: (2,) white variance of lengths and angles.
        u: (n,) robust weights.
        start: Where the mean already is; one linearisation is then enough.
    """
    at = prior if start is None else start
    for _ in range(LINEARISATIONS if start is None else 1):
        columns, values = whitened(rows.pieces(at), noise, u)
        at = conditioned(prior, columns, values)
        rows = rows.moved(at.mean[at.end :])
    return at, rows


def without_nuisances(belief: Belief, rows: NewRows) -> Belief:
    """Returns the belief of the arm; set-ups and reflectors that were estimated stay as poses."""
    end = belief.end
    before = end - rows.layout.robot_size
    reflectors = {}
    for k, T in rows.T_flange_target.items():
        first = before + rows.layout.blocks[f"target/{k}"].start
        reflectors[k] = (T, belief.root[:, first : first + 3] @ T[:3, :3])
    return replace(
        belief,
        mean=belief.mean[:end],
        root=belief.root[:, :end],
        nuisances=0,
        T_tracker_base={**belief.T_tracker_base, **rows.T_tracker_base},
        reflectors=reflectors,
    )


def moved_summary(
    summary: dict[str, Any], lineage: list[dict[str, Any]], belief: Belief
) -> dict[str, Any]:
    """Returns the summary after a step: rows, parameters and lineage are new."""
    parameters = {
        name: {**dict(entry), "value": float(value), "sd": float(sd)}
        for (name, entry), value, sd in zip(
            summary.get("parameters", {}).items(),
            belief.errors,
            np.sqrt(belief.variance[: len(belief.errors)]),
            strict=False,
        )
    }
    return {
        **summary,
        "rows": sum(int(step.get("rows", 0)) for step in lineage),
        "parameters": parameters,
        "lineage": lineage,
    }
