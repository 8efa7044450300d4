"""New measurements of the same set-up: the model moves, nothing is fitted from nothing.

The posterior of everything the model holds is the prior of what it learns from the new rows. In one
linearisation blocks one after the other give what all rows give at once, in any order; taken again
at the new mean it is Gauss-Newton. Noise and scales stay those of the model: a change between
campaigns is the business of :mod:`robotrue.calibration.transfer`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.calibration.belief import (
    Belief,
    drop_nuisances,
    with_centres,
)
from robotrue.calibration.calibrated_model import CalibratedModel, model_of
from robotrue.calibration.model import (
    ErrorModel,
    history,
    merged_document,
    record_step,
    require_belief,
    widen_region,
)
from robotrue.calibration.new_rows import (
    NewRows,
    condition_on_rows,
    new_rows,
    weigh_innovations,
)
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.terms.smooth import add_centres
from robotrue.calibration.training_summary import TrainingSummary, describe_parameters, read_step
from robotrue.core.arrays import Array
from robotrue.errors import ModelMismatchError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import parameter_names

UNCARRIED: Final = 0.05
"""Share of the smooth residual's variance at a new pose from which it gets a centre."""
MOST_CENTRES: Final = 100


def update_model(
    model: ErrorModel, measurements: MeasurementSet, *, settings: FitSettings | None = None
) -> CalibratedModel:
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
        ImplausibleDataError: Points that are impossible for this robot.
        ConfigurationError: A model without a joint covariance.
    """
    settings = FitSettings() if settings is None else settings
    require_joints(model, measurements)
    belief = require_belief(model)
    if not len(measurements):
        return model_of(belief, model.training_summary().document)
    belief = carry_residual(belief, measurements.joints)
    angular = model.training_summary().white_turn_sd
    if angular is None:
        measurements = points_only(measurements)
    rows = new_rows(belief, measurements, settings, fresh=False)
    prior = rows.prior(belief)
    noise = np.array([belief.white**2, (angular or 0.0) ** 2])
    u = weigh_innovations(
        prior, rows.pieces(prior), noise, rows.count, settings.solver.loss, belief.inflation
    )
    after, rows = condition_on_rows(prior, rows, noise, u)
    origin = merged_document([model], measurements.provenance)
    known = model.training_summary()
    summary = {**known, **widen_region(known, measurements), "provenance": origin}
    step = record_step(
        "update",
        [model],
        measurements,
        {"loss": settings.solver.loss, "rotation_sd": settings.rotation_sd},
        np.flatnonzero(u == 0.0).tolist(),
    )
    return model_of(
        without_nuisances(after, rows), renew_summary(summary, [*history(model), step], after)
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


def carry_residual(belief: Belief, joints: Array) -> Belief:
    """Returns the belief with centres of its smooth residual at poses it does not carry yet."""
    smooth = belief.smooth
    if not smooth.size or smooth.amplitude <= 0.0:
        return belief
    left = 1.0 - (smooth.basis.columns(joints) ** 2).sum(axis=1)
    far = np.flatnonzero(left > UNCARRIED)
    if not len(far):
        return belief
    basis = add_centres(smooth.basis, joints[far], most=MOST_CENTRES, enough=UNCARRIED)
    return with_centres(belief, basis, smooth.amplitude)


def without_nuisances(belief: Belief, rows: NewRows) -> Belief:
    """Returns the belief of the arm; set-ups and reflectors that were estimated stay as poses."""
    before = belief.end - rows.layout.robot_size
    reflectors = {}
    for k, T in rows.T_flange_target.items():
        first = before + rows.layout.blocks[f"target/{k}"].start
        reflectors[k] = (T, belief.root[:, first : first + 3] @ T[:3, :3])
    return replace(
        drop_nuisances(belief),
        T_tracker_base={**belief.T_tracker_base, **rows.T_tracker_base},
        reflectors=reflectors,
    )


def renew_summary(
    summary: dict[str, object], lineage: list[dict[str, object]], belief: Belief
) -> dict[str, object]:
    """Returns the summary after a step: rows, parameters and lineage are new."""
    known = TrainingSummary(summary).parameters or {}
    place = [i for i, name in enumerate(parameter_names(belief.robot.dof)) if name in known]
    parameters = describe_parameters(
        known,
        belief.errors[place],
        np.sqrt(belief.variance[place]),
        [parameter.kind for parameter in known.values()],
    )
    return {
        **summary,
        "rows": sum(read_step(step).rows for step in lineage),
        "parameters": parameters,
        "lineage": lineage,
    }
