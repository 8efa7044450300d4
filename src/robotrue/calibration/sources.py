"""Sources of a transfer, and their combination into one belief.

The leading source represents the target's arm. Every other source observes the same coefficients
with variance S_i + Q_i; where it disagrees with the leading one by more than both allow, its
variance grows until it does not. Where all sources are other units the first one is widened by the
spread of units: it then represents the mean of the type.

Many calibrated arms of one type, a fleet, give mean and covariance of the next arm's parameters.
Arm i has the posterior N(m_i, S_i) of its parameters w_i ~ N(mu, L). One step of expectation and
maximisation from these posteriors gives

    mu = mean m_i,    L = mean S_i + scatter of the m_i about mu

(the law of total variance): a direction that no arm determined keeps the prior's width, one that
all determined has the width of their scatter. Few arms determine a scatter of 40 parameters poorly,
so its variances are shrunk to those of their physical group and its correlations to zero, as if
:data:`PRIOR_ARMS` further arms had shown the group's variance and nothing else (the mode of an
inverse Wishart posterior about the diagonal). The next arm's covariance includes the error of mu, 1
/ N.

Ripple has no common mean: gears of one type are alike in kind and not in phase. Base and reflector
are specific to each arm, and so is a smooth residual.

A source may be reduced to a few postures (:func:`see_at_postures`). At n postures the ripple of a
joint is n shifts of its drive, whatever number of cycles it has. With b the sines and cosines of a
joint at the postures and v the prior variance of their amplitudes w,

    b diag(v)^(1/2) = L Q'  (thin),      u = Q' diag(v)^(-1/2) w,      b w = L u

u has unit prior variance, as the drift between campaigns needs it, and no more coefficients than
there are postures. Fits of rows at these postures, and predictions at them, are the same with u as
with w: a comparison that holds out ten parts of 30 poses costs far less than ten fits of 3,000
columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve, solve_triangular, svd

from robotrue.calibration.belief import (
    Belief,
    add_variance,
    condition,
    root_of_covariance,
    standard_terms,
    widen_tool,
    with_harmonics,
    with_tool,
)
from robotrue.calibration.calibrated_model import CalibratedModel, model_of
from robotrue.calibration.drift_prior import (
    NO_DRIFT,
    RELATIONS,
    Relation,
    carry_over,
    drift_of,
    shape_variance,
)
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.terms.error_vector import PriorScales
from robotrue.calibration.terms.ripple import Ripple
from robotrue.calibration.terms.term import ArmPostures, Effect
from robotrue.core.arrays import Array, IntArray
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import Sensitivity
from robotrue.robot.model import MOMENTS, PER_JOINT, RobotModel, parameter_slice

SAME: Final = 1e-6
"""m and rad by which the nominal tables of one robot type may differ."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TransferSource:
    """Prior knowledge from another calibration.

    Attributes:
        measurements: Rows of the source; fitted by the transfer. Either these or ``model``.
        model: A calibration of the source.
        relation: ``"region"``: same arm, same campaign, another part of the workspace.
            ``"campaign"``: same arm, another time, instrument or reflector set-up. ``"unit"``:
            another arm of the same type.
        name: For messages and the summary.
    """

    measurements: MeasurementSet | None = None
    model: ErrorModel | None = None
    relation: Relation = "campaign"
    name: str = "source"

    def __post_init__(self) -> None:
        """Checks that exactly one kind of knowledge is given."""
        if (self.measurements is None) == (self.model is None):
            raise ConfigurationError(
                f"source {self.name!r} needs either measurements or a model, not both or none."
            )
        if self.relation not in RELATIONS:
            raise ConfigurationError(
                f"source {self.name!r} has relation {self.relation!r}; "
                f"relations are {list(RELATIONS)}."
            )


def require_same_type(robot: RobotModel, other: RobotModel, name: str) -> None:
    """Refuses a source whose nominal tables are those of another robot.

    Raises:
        ModelMismatchError: They are.
    """
    if robot.dof != other.dof:
        raise ModelMismatchError(
            f"source {name!r} is an arm of {other.dof} joints, the target {robot.name} has "
            f"{robot.dof}."
        )
    for table in ("theta", "d", "a", "alpha", "joint_map"):
        mine, its = getattr(robot, table), getattr(other, table)
        worst = float(np.max(np.abs(mine - its)))
        if robot.convention != other.convention or worst > SAME:
            at = int(np.argmax(np.abs(mine - its))) % robot.dof
            raise ModelMismatchError(
                f"source {name!r} is a {other.name}, the target a {robot.name}: {table} of joint "
                f"{at + 1} differs by {worst:.6g} (m or rad).",
                hint="only arms of one type share what they have learned.",
            )


def carry_to_reflector(
    robot: RobotModel, belief: Belief, source: TransferSource, settings: FitSettings
) -> Belief:
    """Returns the belief of a source with the target's reflector.

    Raises:
        ModelMismatchError: Another robot type.
    """
    require_same_type(robot, belief.robot, source.name)
    gap = robot.T_flange_tool - belief.robot.T_flange_tool
    if np.max(np.abs(gap[:3, 3])) <= SAME:
        return belief
    return widen_tool(with_tool(belief, robot.T_flange_tool), settings.scales.tool)


def combine_sources(beliefs: Sequence[Belief], relations: Sequence[Relation]) -> Belief:
    """Returns one belief about the leading source's arm, or about the type if all are units.

    Args:
        beliefs: Of the sources, the leading one first.
        relations: Of the sources to the target.
    """
    lead = beliefs[0]
    if relations[0] == "unit":
        lead = _spread(lead, "unit")
    for other, relation in zip(beliefs[1:], relations[1:], strict=True):
        lead = _join(lead, other, relation, again=relations[0] != "unit")
    return lead


def _spread(belief: Belief, relation: Relation) -> Belief:
    drift = drift_of(belief, relation)
    keep, variance = carry_over(drift, np.exp(drift.log_scale))
    wide = replace(belief, mean=keep * belief.mean, root=belief.root * keep)
    return add_variance(wide, variance)


def _join(lead: Belief, other: Belief, relation: Relation, *, again: bool) -> Belief:
    """The lead after one more source; ``again``: units differ on both sides of the type mean."""
    count = max(len(lead.ripple.cycles), len(other.ripple.cycles))
    lead, other = _with_waves(lead, other, count), with_harmonics(other, count)
    spread = _spread(other, relation)
    if relation == "unit" and again:
        spread = _spread(spread, relation)
    columns = _shared_columns(lead, spread, relation)
    theirs = spread.root[:, columns]
    noise = theirs.T @ theirs
    off = spread.mean[columns] - lead.mean[columns]
    mine = lead.root[:, columns]
    total = cho_factor(noise + mine.T @ mine, lower=True)
    surprise = float(off @ cho_solve(total, off)) / len(columns)
    lower = np.linalg.cholesky(max(surprise, 1.0) * noise)
    rows = np.zeros((len(columns), len(lead.mean)))
    rows[:, columns] = solve_triangular(lower, np.eye(len(columns)), lower=True)
    values = solve_triangular(lower, spread.mean[columns], lower=True)
    return condition(lead, rows, values)


def _with_waves(lead: Belief, other: Belief, count: int) -> Belief:
    """Returns the lead with harmonics that only another source has, with that source's prior."""
    before, wider = len(lead.ripple.cycles), with_harmonics(lead, count)
    if before == count:
        return lead
    waves, _ = shape_variance(with_harmonics(other, count))
    place = wider.place("ripple")
    variance = np.zeros(len(wider.mean))
    variance[place] = np.where(wider.ripple.order > before, waves[place], 0.0)
    return add_variance(wider, variance)


def _shared_columns(lead: Belief, other: Belief, relation: Relation) -> IntArray:
    """Returns columns two sources share: the arm, without stations, reflectors, smooth weights."""
    smooth = lead.place("smooth").start
    able = (lead.variance[:smooth] > 0.0) & (other.variance[:smooth] > 0.0)
    for frame in ("base", "tool"):
        able[parameter_slice(lead.robot.dof, frame)] = False
    if relation == "unit":
        able[len(lead.errors) :] = False
    return np.flatnonzero(able)


FEWEST_ARMS: Final = 5
"""Arms from which their scatter is more reliable than the tolerances of manufacture."""
PRIOR_ARMS: Final = 4.0
"""Arms that the shrinkage of the scatter counts for."""
DRIFT: Final = replace(NO_DRIFT, theta=1e-4, length=5e-5, angle=5e-5, gear=2e-6, compliance=0.02)
"""Uncertainty of a fleet's belief beyond the scatter of its arms; an arm unlike them grows it."""


def fleet_belief(beliefs: Sequence[Belief], scales: PriorScales) -> Belief:
    """Returns the belief about the next arm of the type.

    Args:
        beliefs: Of :data:`FEWEST_ARMS` or more arms of one type, with one reflector.
        scales: Uncertainty of the next arm's base and reflector.
    """
    count = max(len(belief.ripple.cycles) for belief in beliefs)
    beliefs = [with_harmonics(belief, count) for belief in beliefs]
    first = beliefs[0]
    end = first.place("smooth").start
    means = np.array([belief.mean[:end] for belief in beliefs])
    within = [belief.root[:, :end].T @ belief.root[:, :end] for belief in beliefs]
    known = np.array([np.diagonal(covariance) > 0.0 for covariance in within])
    arms = np.maximum(known.sum(axis=0), 1)
    mean = np.where(known, means, 0.0).sum(axis=0) / arms
    mean[first.place("ripple")] = 0.0
    covariance = sum(within) / np.maximum(known.T.astype(float) @ known, 1.0)
    apart = np.where(known, means - mean, 0.0)
    unit = _relative_units(first, mean, np.sqrt(np.diagonal(covariance)))
    covariance = covariance + _shrink_scatter(apart, arms, _column_groups(first, end), unit)
    covariance *= np.sqrt(np.outer(1.0 + 1.0 / arms, 1.0 + 1.0 / arms))
    _place_anew(first, scales, mean, covariance)
    terms = standard_terms(first.robot.dof, first.ripple.cycles)
    return Belief(
        robot=first.robot,
        terms=terms,
        mean=mean,
        root=root_of_covariance(covariance),
        white=float(np.sqrt(np.mean([belief.white**2 for belief in beliefs]))),
        repeatability=first.repeatability,
        inflation=float(np.mean([belief.inflation for belief in beliefs])),
        T_tracker_base={},
    )


def _relative_units(belief: Belief, mean: Array, sd: Array) -> Array:
    """Unit (p,) in which the scatter of a group is of one size: its own for what loads a drive."""
    unit = np.ones(len(mean))
    for name in ("compliance", *MOMENTS):
        place = parameter_slice(belief.robot.dof, name)
        size = np.hypot(mean[place], sd[place])
        unit[place] = np.where(size > 0.0, size, 1.0)
    return unit


def _shrink_scatter(apart: Array, arms: IntArray, groups: Sequence[IntArray], unit: Array) -> Array:
    """The covariance (p, p) of arms about their mean, from deviations (N, p), shrunk."""
    own = (apart**2).sum(axis=0) / np.maximum(arms - 1, 1)
    variance = own.copy()
    for columns in groups:
        share = arms[columns] / (arms[columns] + PRIOR_ARMS)
        usual = (own[columns] / unit[columns] ** 2).mean() * unit[columns] ** 2
        variance[columns] = share * own[columns] + (1.0 - share) * usual
    sd = np.sqrt(np.maximum(own, 1e-300))
    correlation = apart.T @ apart / np.maximum(len(apart) - 1, 1) / np.outer(sd, sd)
    correlation *= len(apart) / (len(apart) + PRIOR_ARMS)
    correlation[np.diag_indices(len(own))] = 1.0
    return np.asarray(correlation * np.sqrt(np.outer(variance, variance)))


def _column_groups(belief: Belief, end: int) -> list[IntArray]:
    """Columns whose scatter is of one size: each group of the error vector, each wave's cycles."""
    dof = belief.robot.dof
    groups = [np.r_[parameter_slice(dof, name)] for name in PER_JOINT]
    ripple = belief.place("ripple")
    waves = np.arange(ripple.start, ripple.stop)
    order = belief.ripple.order
    groups += [waves[order == cycles] for cycles in np.unique(order)]
    backlash = np.arange(ripple.stop, end)
    return [columns for columns in (*groups, backlash) if len(columns)]


def _place_anew(belief: Belief, scales: PriorScales, mean: Array, covariance: Array) -> None:
    """Resets base and reflector of the arms to their priors, in place."""
    for frame in ("base", "tool"):
        place = parameter_slice(belief.robot.dof, frame)
        seen = np.diagonal(covariance)[place] > 0.0
        sizes = scales.deviations(belief.robot.dof)[frame]
        mean[place], covariance[place], covariance[:, place] = 0.0, 0.0, 0.0
        covariance[place, place] = np.diag(np.where(seen, sizes**2, 0.0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeenRipple(Ripple):
    """Ripple by coefficients u of unit prior variance; amplitudes are blocks times u.

    Attributes:
        blocks: Of every joint, (2 h, k) rad, diag(v)^(1/2) Q.
    """

    blocks: tuple[Array, ...]

    @property
    def size(self) -> int:
        """Number of coefficients u."""
        return sum(block.shape[1] for block in self.blocks)

    @property
    def whole(self) -> Ripple:
        """The ripple by its amplitudes."""
        return Ripple(dof=self.dof, cycles=self.cycles)

    def amplitudes_of(self, values: Array) -> Array:
        """Returns the amplitudes (2 dof h,) rad that coefficients (k,) make."""
        ends = np.cumsum([block.shape[1] for block in self.blocks])
        parts = zip(self.blocks, np.split(values, ends[:-1]), strict=True)
        return np.concatenate([block @ part for block, part in parts])

    def columns(self, robot: RobotModel, at: ArmPostures, by: Sensitivity, values: Array) -> Array:
        """Returns d(observed)/d(u), shape (n, m, k)."""
        parts = []
        for joint, block in enumerate(self.blocks):
            shifts = _waves(at.joints[:, joint], self.cycles) @ block
            parts.append(by.drive[:, :, joint, None] * shifts[:, None, :])
        return np.concatenate(parts, axis=2)

    def effect(self, robot: RobotModel, at: ArmPostures, values: Array) -> Effect:
        """Returns the shift of the drives."""
        return self.whole.effect(robot, at, self.amplitudes_of(values))

    def prior_variance(self, values: Array, variance: Array) -> Array:
        """Returns one for every coefficient."""
        return np.ones(self.size)

    def arrays(self, values: Array) -> dict[str, Array]:
        """Returns cycles and the amplitudes that the coefficients make."""
        return dict(self.whole.arrays(self.amplitudes_of(values)))


def see_at_postures(model: CalibratedModel, joints: Array) -> CalibratedModel:
    """Returns the model with its ripple by what it does at postures (n, dof) rad, and nowhere else.

    A model with fewer amplitudes than that comes back as it is.
    """
    belief = model.belief()
    ripple = belief.ripple
    if ripple.size <= 2 * joints.size:
        return model
    place = belief.place(ripple.name)
    values, variance = belief.mean[place], belief.variance[place]
    sd = np.sqrt(ripple.prior_variance(values, variance))
    taken, blocks = [], []
    for angle, own in zip(joints.T, np.split(sd, ripple.dof), strict=True):
        turned = svd(_waves(angle, ripple.cycles) * own, full_matrices=False)[2]
        taken.append(turned / own)
        blocks.append(turned.T * own[:, None])
    seen = SeenRipple(dof=ripple.dof, cycles=ripple.cycles, blocks=tuple(blocks))
    return model_of(_replace_ripple(belief, place, seen, block_diag(*taken)), model.summary)


def _waves(angle: Array, cycles: Array) -> Array:
    """Sine and cosine (n, 2 h) of every cycle at angles (n,)."""
    phase = np.outer(angle, cycles)
    return np.stack([np.sin(phase), np.cos(phase)], axis=-1).reshape(len(angle), -1)


def _replace_ripple(belief: Belief, place: slice, seen: SeenRipple, taken: Array) -> Belief:
    """The belief with amplitudes at a place taken to the coefficients of another term."""

    def take(columns: Array) -> Array:
        before, own, behind = np.split(columns, [place.start, place.stop], axis=-1)
        return np.concatenate([before, own @ taken.T, behind], axis=-1)

    terms = tuple(seen if isinstance(term, Ripple) else term for term in belief.terms)
    return replace(belief, terms=terms, mean=take(belief.mean), root=take(belief.root))
