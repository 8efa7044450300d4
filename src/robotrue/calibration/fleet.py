"""What calibrated arms of one type say of the next arm: mean and covariance of its parameters.

Arm i has the posterior N(m_i, S_i) of its parameters w_i ~ N(mu, L). One step of expectation and
maximisation from these posteriors gives

    mu = mean m_i,    L = mean S_i + scatter of the m_i about mu

(the law of total variance): a direction that no arm determined keeps the prior's width, one that
all determined has the width of their scatter. Few arms know a scatter of 40 parameters poorly, so
its variances are shrunk to those of their physical group and its correlations to zero, as if
:data:`PRIOR_ARMS` further arms had shown the group's variance and nothing else (the mode of an
inverse Wishart posterior about the diagonal). The next arm also pays for the error of mu, 1 / N.

Ripple has no common mean: gears of one type are alike in kind and not in phase. Base and reflector
are where each arm stands. A smooth residual belongs to one arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.calibration.belief import Belief, root_of_covariance, standard_terms, with_harmonics
from robotrue.calibration.drift_prior import NO_DRIFT
from robotrue.calibration.terms.geometry import PriorScales
from robotrue.core.arrays import Array, IntArray
from robotrue.robot.model import MOMENTS, PER_JOINT, parameter_slice

FEWEST_ARMS: Final = 5
"""Arms from which their scatter says more than the tolerances of manufacture."""
PRIOR_ARMS: Final = 4.0
"""Arms that the shrinkage of the scatter counts for."""
DRIFT: Final = replace(NO_DRIFT, theta=1e-4, length=5e-5, angle=5e-5, gear=2e-6, compliance=0.02)
"""What a fleet's belief leaves open beyond how far its arms differ; an arm unlike them grows it."""


def fleet_belief(beliefs: Sequence[Belief], scales: PriorScales) -> Belief:
    """Returns the belief about the next arm of the type.

    Args:
        beliefs: Of :data:`FEWEST_ARMS` or more arms of one type, with one reflector.
        scales: How well the next arm's base and reflector are known.
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
    """Forgets where the arms stood and their reflectors sat, in place."""
    for frame in ("base", "tool"):
        place = parameter_slice(belief.robot.dof, frame)
        seen = np.diagonal(covariance)[place] > 0.0
        sizes = scales.deviations(belief.robot.dof)[frame]
        mean[place], covariance[place], covariance[:, place] = 0.0, 0.0, 0.0
        covariance[place, place] = np.diag(np.where(seen, sizes**2, 0.0))
