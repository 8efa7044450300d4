"""Physics-informed transfer: a calibration carried to another region, campaign or arm of its type.

Every source is a posterior over the same coefficients: geometry, compliance, ripple, backlash,
smooth residual. The first source of the same arm is the prior of the target, widened by possible
changes (:mod:`robotrue.calibration.drift_prior`); every other source is one more observation of the
same coefficients with its own drift. Sources that are other units of the type determine the common
part: parameters = type mean + unit + drift. From five units on their own scatter is the spread of
units (:mod:`robotrue.calibration.sources`). The target rows then update everything, the scales of
the drift included. Without target rows the prediction is the prior's, with its full width.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.belief import Belief, with_centres
from robotrue.calibration.calibrated_model import CalibratedModel, model_of
from robotrue.calibration.drift_prior import (
    DriftScales,
    Relation,
    SourceDrift,
    drift_of,
    prior_mean,
    prior_of,
)
from robotrue.calibration.drift_scales import (
    DriftEvidence,
    learn_drift,
    leave_rows_out,
    mean_slopes,
    stack_rows,
)
from robotrue.calibration.methods import fit
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
from robotrue.calibration.parameters import State, station_as_base
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.sources import (
    DRIFT,
    FEWEST_ARMS,
    TransferSource,
    carry_to_reflector,
    combine_sources,
    fleet_belief,
)
from robotrue.calibration.terms.smooth import add_centres
from robotrue.calibration.update import (
    MOST_CENTRES,
    UNCARRIED,
    points_only,
    renew_summary,
    require_joints,
    without_nuisances,
)
from robotrue.core.arrays import Array, IntArray
from robotrue.core.robust import Loss, robust_variance, student_factor, weights
from robotrue.errors import ConfigurationError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel, parameter_slice

__all__ = ["TransferSource", "fit_transfer"]

LEARNING_ROWS: Final = 120
"""Target rows on which the drift scales are learned; all rows move the coefficients."""
ROUNDS: Final = 3
FIELD_LENGTH: Final = 1.5
"""In units of sin q and cos q: length of a smooth residual the sources do not have."""
DEFAULTS_WORTH: Final[Mapping[Relation, int]] = {"region": 12, "campaign": 4, "unit": 4}
"""Weight of the default scales, in rows; in one campaign the source's held-out blocks count too."""
SEED: Final = 21


@dataclass(frozen=True, slots=True, kw_only=True)
class _Landing:
    """Posterior of the prior given the target rows.

    Attributes:
        belief: Posterior, nuisances at its end.
        rows: The rows at the present state.
        drift: With the scales learned.
        weights: (n,) robust weights.
    """

    belief: Belief
    rows: NewRows
    drift: SourceDrift
    weights: Array


def fit_transfer(
    robot: RobotModel,
    target: MeasurementSet | None,
    sources: Sequence[TransferSource],
    settings: FitSettings | None = None,
    *,
    scales: DriftScales | None = None,
    learn: bool = True,
    method: str = "gp",
) -> CalibratedModel:
    """Returns the error model of the target: sources transferred, target rows added.

    Possible changes lengthen its root: apply :meth:`CalibratedModel.compact` before a model is
    saved.

    Args:
        robot: Nominal arm of the target with the nominal reflector.
        target: Rows of the target, of which the points are used; None or no rows: the prediction
            is the sources' alone.
        sources: At least one. The first of the same arm (``region`` before ``campaign``) leads.
        settings: Of the fits of sources that are given as measurements; payload and robust rule.
        scales: Where the drift of the leading source starts; None is its relation's default.
        learn: Move the drift scales by the target rows.
        method: Of :data:`robotrue.calibration.methods.METHODS`, for sources given as measurements.

    Raises:
        ConfigurationError: No source, an unknown relation, or a model without covariance.
        ModelMismatchError: A source of another robot type, or of other joints.
        ImplausibleDataError: Target rows that are impossible for this robot, or in other units or
            frames.
        ObservabilityError: A target in a separate tracker frame with fewer than 3 points.
    """
    settings = FitSettings() if settings is None else settings
    if not sources:
        raise ConfigurationError("a transfer needs at least one source.", hint="use fit instead.")
    ordered = sorted(sources, key=lambda s: ("region", "campaign", "unit").index(s.relation))
    models = [_model_of_source(robot, s, settings, method) for s in ordered]
    relation = ordered[0].relation
    beliefs = [
        carry_to_reflector(robot, require_belief(m), s, settings)
        for m, s in zip(models, ordered, strict=True)
    ]
    if relation == "unit" and len(beliefs) >= FEWEST_ARMS:
        lead = fleet_belief(beliefs, settings.scales)
        scales = DRIFT if scales is None else scales
    else:
        lead = combine_sources(beliefs, [s.relation for s in ordered])
    if target is None or not len(target):
        drift = drift_of(lead, relation, scales)
        after, screened = prior_of(drift), np.zeros(0, dtype=np.int64)
    else:
        require_joints(models[0], target)
        landing = _add_target_rows(lead, relation, points_only(target), settings, scales, learn)
        drift, screened = landing.drift, np.flatnonzero(landing.weights == 0.0)
        after = _with_gauge(landing.belief, landing.rows, relation)
    counted = 0 if target is None else len(target) - len(screened)
    after = replace(after, inflation=student(counted, relation))
    return model_of(
        after,
        _summary(after, drift, relation, ordered, models, target, screened, settings),
        compact=False,
    )


def carry_source(
    robot: RobotModel,
    target: MeasurementSet | None,
    source: TransferSource,
    settings: FitSettings,
) -> CalibratedModel:
    """Returns a source without an update, widened by the changes of its relation.

    The target rows determine only a new tracker frame and further reflectors; the arm counts as
    noise of the size of its uncertainty at them.

    Raises:
        As :func:`fit_transfer`.
    """
    model = fit_transfer(robot, None, [source], settings)
    if target is None or target.frame == "base" or source.relation == "region":
        return model
    lead = _without_base(replace(model.belief(), T_tracker_base={}))
    rows = new_rows(lead, points_only(target), settings, fresh=True)
    pieces = rows.pieces(rows.prior(lead))
    spreads = [((piece.columns[:, :, : lead.end] @ lead.root.T) ** 2).mean() for piece in pieces]
    noise = lead.noise + np.array([float(np.mean(spreads)) * len(lead.root), 0.0])
    certain = replace(lead, root=np.zeros((0, lead.end)))
    placed, rows = condition_on_rows(rows.prior(certain), rows, noise, np.ones(rows.count))
    arm = np.hstack([lead.root, np.zeros((len(lead.root), rows.nuisances))])
    placed = replace(placed, root=np.vstack([placed.root, arm]))
    return model_of(_with_gauge(placed, rows, source.relation), model.summary, compact=False)


def _model_of_source(
    robot: RobotModel, source: TransferSource, settings: FitSettings, method: str
) -> ErrorModel:
    if source.measurements is not None:
        return fit(robot, source.measurements, method=method, settings=settings)
    if source.model is None:
        raise ConfigurationError(f"source {source.name!r} holds neither measurements nor a model.")
    return source.model


def _add_target_rows(
    lead: Belief,
    relation: Relation,
    target: MeasurementSet,
    settings: FitSettings,
    scales: DriftScales | None,
    learn: bool,
) -> _Landing:
    """Adds the target rows: scales, weights and linearisation are renewed in turns."""
    fresh = relation != "region"
    if fresh:
        lead = replace(lead, T_tracker_base={})
    rows = new_rows(lead, target, settings, fresh=fresh)
    if rows.layout.stations and not lead.T_tracker_base:
        lead = _without_base(lead)
    lead, field_from = _with_field(lead, target.joints)
    drift = drift_of(lead, relation, scales, field_from=field_from)
    rng = np.random.default_rng(SEED)
    chosen = np.zeros(rows.count, dtype=bool)
    chosen[rng.choice(rows.count, min(LEARNING_ROWS, rows.count), replace=False)] = True
    u = np.ones(rows.count)
    at = rows.prior(prior_mean(drift))
    for step in range(ROUNDS):
        stack = stack_rows(rows.pieces(at, chosen))
        problem = DriftEvidence(drift, stack)
        u = _weights(drift, problem, stack.row, u, settings.solver.loss, first=step == 0)
        problem.weigh(u[stack.row])
        if learn:
            drift = learn_drift(drift, problem)
        at = replace(at, mean=problem.means(drift.log_scale[None])[0])
        rows = rows.move(at.mean[at.end :])
    prior = rows.prior(prior_of(drift))
    if not chosen.all():
        some, _ = condition_on_rows(prior, rows, prior.noise, np.where(chosen, u, 0.0))
        others = weigh_innovations(
            some, rows.pieces(some, ~chosen), prior.noise, rows.count, settings.solver.loss, 1.0
        )
        u = np.where(chosen, u, others)
    at, rows = condition_on_rows(prior, rows, prior.noise, u, start=at)
    if learn:
        at = _unsure(at, drift, problem)
    return _Landing(belief=at, rows=rows, drift=drift, weights=u)


def _weights(
    drift: SourceDrift, problem: DriftEvidence, row: IntArray, u: Array, loss: Loss, *, first: bool
) -> Array:
    """Returns robust weights of the learning rows, each from the prediction by all others.

    In the first turn the scales are the defaults: lengths are divided by their median, so that a
    drift larger than expected makes no outlier of a good row.
    """
    out = u.copy()
    problem.weigh(u[row])
    rows, lengths, sizes = leave_rows_out(drift, problem, row)
    unit = 1.0
    if first:
        unit = max(1.0, float(np.sqrt(robust_variance(lengths, int(sizes[0])))))
    for size in np.unique(sizes):
        mine = sizes == size
        out[rows[mine]] = weights(lengths[mine] / unit, int(size), loss)
    return out


def _without_base(belief: Belief) -> Belief:
    """Returns the belief without the source's base: a new tracker frame replaces it."""
    root = belief.root.copy()
    root[:, parameter_slice(belief.robot.dof, "base")] = 0.0
    return replace(belief, root=root)


def _with_field(belief: Belief, joints: Array) -> tuple[Belief, int]:
    """The belief with centres of the target's own smooth residual, and their first column."""
    basis = belief.smooth.basis
    if not len(basis.centres):
        basis = replace(basis, scale=np.full(len(basis.scale), 1.0 / FIELD_LENGTH))
    basis = add_centres(basis, joints, most=MOST_CENTRES, enough=UNCARRIED)
    return with_centres(belief, basis), belief.place("smooth").stop


def _unsure(belief: Belief, drift: SourceDrift, problem: DriftEvidence) -> Belief:
    """The belief with what the mean would do if the drift scales were others."""
    values, vectors = np.linalg.eigh(drift.log_cov)
    half = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    return replace(belief, root=np.vstack([belief.root, half @ mean_slopes(drift, problem)]))


def student(rows: int, relation: Relation) -> float:
    """Returns the factor on a covariance whose size was learned from some rows.

    Variances learned from few rows make a prediction Student's, not Gauss's. The factor makes the
    Gaussian 95 % region of a point hold what Hotelling's does with ``rows + DEFAULTS_WORTH``
    degrees of freedom: rows of one campaign err together, so a row counts as one.
    """
    return student_factor(rows + DEFAULTS_WORTH[relation])


def _with_gauge(belief: Belief, rows: NewRows, relation: Relation) -> Belief:
    """Returns the belief of the arm, its base defined by the target's first set-up."""
    out = without_nuisances(belief, rows)
    state = State(robot=belief.robot, T_tracker_base=rows.T_tracker_base)
    gauge = station_as_base(rows.layout, state)
    if gauge is None or relation == "region":
        return out
    shift = belief.end - rows.layout.robot_size
    at_station = belief.root[:, gauge[0].start + shift : gauge[0].stop + shift]
    root = out.root.copy()
    root[:, parameter_slice(belief.robot.dof, "base")] = at_station @ gauge[1].T
    return replace(out, root=root)


def _summary(
    belief: Belief,
    drift: SourceDrift,
    relation: Relation,
    sources: Sequence[TransferSource],
    models: Sequence[ErrorModel],
    target: MeasurementSet | None,
    screened: IntArray,
    settings: FitSettings,
) -> dict[str, object]:
    """JSON values of the transfer; the leading source's summary below them."""
    data = [] if target is None else [target.provenance]
    lead = {**models[0].training_summary(), "provenance": merged_document(models, *data)}
    lead |= {} if target is None else widen_region(lead, target)
    step = record_step(
        "transfer",
        models,
        target,
        {"relation": relation, "loss": settings.solver.loss},
        screened.tolist(),
    )
    summary = renew_summary(lead, [*history(models[0]), step], belief)
    rows = 0 if target is None else len(target)
    said = f"in source {sources[0].name!r}: "
    doubts = [
        d if d.startswith("in source ") else said + d for d in models[0].training_summary().warnings
    ]
    return {
        **summary,
        "method": "transfer",
        "target_rows": rows,
        "screened_rows": [int(i) for i in screened],
        "relation": relation,
        "transfer_sources": [
            {"name": s.name, "relation": s.relation, "rows": m.training_summary().rows}
            for s, m in zip(sources, models, strict=True)
        ],
        "drift_scales": drift.scales,
        "drift_defaults": dict(zip(drift.names, np.exp(drift.rest).tolist(), strict=True)),
        "drift_log_sd": dict(
            zip(drift.names, np.sqrt(np.diagonal(drift.log_cov)).tolist(), strict=True)
        ),
        "white_sd_m": belief.white,
        "covariance_factor": belief.inflation,
        "doubts": doubts,
    }
