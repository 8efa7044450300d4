"""Sources of a transfer: who they are, and how several become one belief.

The leading source stands for the target's own arm. Every other source observes the same
coefficients with variance S_i + Q_i; where it disagrees with the leading one by more than both
allow, its variance grows until it does not. Where all sources are other units the first one is
widened by the spread of units: what it then says is the mean of the type.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from robotrue.calibration.belief import Belief, add_variance, condition, with_harmonics
from robotrue.calibration.drift_prior import (
    RELATIONS,
    Relation,
    carry_over,
    drift_of,
    shape_variance,
)
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.settings import FitSettings
from robotrue.core.arrays import IntArray
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel, parameter_slice

SAME: Final = 1e-6
"""m and rad by which the nominal tables of one robot type may differ."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TransferSource:
    """What is known from elsewhere.

    Attributes:
        measurements: Rows of the source; fitted by the transfer. Either these or ``model``.
        model: A calibration of the source.
        relation: ``"region"``: same arm, same campaign, another part of the workspace.
            ``"campaign"``: same arm, another time, instrument or reflector set up anew.
            ``"unit"``: another arm of the same type.
        name: For messages and the summary.
    """

    measurements: MeasurementSet | None = None
    model: ErrorModel | None = None
    relation: Relation = "campaign"
    name: str = "source"

    def __post_init__(self) -> None:
        """Checks that exactly one kind of knowledge is there."""
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
    tool = parameter_slice(robot.dof, "tool")
    mean, root = belief.mean.copy(), belief.root.copy()
    mean[tool], root[:, tool] = 0.0, 0.0
    variance = np.zeros(len(mean))
    variance[tool.start : tool.start + 3] = settings.scales.tool**2
    return add_variance(
        replace(
            belief,
            robot=belief.robot.with_tool(robot.T_flange_tool),
            mean=mean,
            root=root,
        ),
        variance,
    )


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
    """The lead with harmonics that only another source has, as unknown as they are there."""
    before, wider = len(lead.ripple.cycles), with_harmonics(lead, count)
    if before == count:
        return lead
    waves, _ = shape_variance(with_harmonics(other, count))
    place = wider.place("ripple")
    variance = np.zeros(len(wider.mean))
    variance[place] = np.where(wider.ripple.order > before, waves[place], 0.0)
    return add_variance(wider, variance)


def _shared_columns(lead: Belief, other: Belief, relation: Relation) -> IntArray:
    """Columns two sources share: the arm's own, without stands, reflectors and smooth weights."""
    smooth = lead.place("smooth").start
    able = (lead.variance[:smooth] > 0.0) & (other.variance[:smooth] > 0.0)
    for frame in ("base", "tool"):
        able[parameter_slice(lead.robot.dof, frame)] = False
    if relation == "unit":
        able[len(lead.errors) :] = False
    return np.flatnonzero(able)
