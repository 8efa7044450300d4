"""Prior scales and noise of a linear Gaussian model, of greatest evidence.

Scales and noise move by MacKay's fixed point ("Bayesian interpolation", 1992, eq. 4.9-4.10 and
their groups): with gamma the number of parameters of a group that the data determine,

    s_g^2 = (PULL r_g^2 + |w_g|^2) / (PULL + gamma_g)      tau_c = |y - F w|_c^2 / (n_c - gamma_c)

``r_g`` is the scale at rest: a group without information goes there instead of to zero.

With few rows that is too sure of itself: a group with little information by chance is set to zero.
Groups that are *held* have a log-normal prior about their scale at rest and one factor in common,
learned with them; with many rows the fixed point is MacKay's again.

Learning uses the directions that the rows show (:mod:`robotrue.calibration.seen_directions`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.special import wrightomega

from robotrue.calibration.evidence import PriorGroup, Sums, Weights, posterior
from robotrue.calibration.seen_directions import find_seen
from robotrue.core.arrays import Array

PULL: Final = 0.5
"""Weight of the scale at rest in a learned one, in parameters."""
LEAST_GAIN: Final = 1.0
"""Default gain in log evidence per step below which learning stops."""
COMMON_HOLD: Final = 0.5
"""Hold of the factor that held groups have in common: a factor of e in the scale is one sigma."""


def learn(
    channels: Sequence[Sums],
    groups: Sequence[PriorGroup],
    noise: Array,
    *,
    steps: int = 40,
) -> Weights:
    """Returns :func:`find_scales` with the root of the posterior made."""
    return find_scales(channels, groups, noise, steps=steps).with_root()


def find_scales(
    channels: Sequence[Sums],
    groups: Sequence[PriorGroup],
    noise: Array,
    *,
    steps: int,
    least_gain: float = LEAST_GAIN,
) -> Weights:
    """Returns the posterior at scales and noise of (locally) greatest evidence.

    Args:
        channels: Sums per noise channel.
        groups: Starting scales.
        noise: (c,) starting tau; 1 is the noise of the whitening.
        steps: Most fixed-point steps.
        least_gain: Learning also stops when a step gains less log evidence; with few rows, where
            steps are cheap, not before the fourth.
    """
    few = all(s.few for s in channels)
    seen = None if few else find_seen(channels, groups, noise)
    if seen is not None:
        channels, groups = [seen.turn_sums(s) for s in channels], seen.groups
    least = 3 if few else 0
    best = posterior(channels, groups, noise)
    for step in range(1, steps + 1):
        groups, noise = _move_scales(best, channels)
        trial = posterior(channels, groups, noise)
        gain = trial.evidence - best.evidence
        best = replace(trial, steps=step)
        if step > least and gain < least_gain:
            break
    return best if seen is None else seen.expand(best)


def _move_scales(at: Weights, channels: Sequence[Sums]) -> tuple[tuple[PriorGroup, ...], Array]:
    squares = np.array([float(((at.mean[g.columns] / g.unit) ** 2).sum()) for g in at.groups])
    seen = np.maximum(at.determined, 0.0)
    held = held_scales(at.groups, squares, seen)
    groups = []
    for k, group in enumerate(at.groups):
        if group.learned and group.hold:
            group = replace(group, sd=held[k])
        elif group.learned:
            group = replace(group, sd=float(pulled_scale(squares[k], seen[k], group.rest)))
        groups.append(group)
    noise = np.empty(len(channels))
    for k, s in enumerate(channels):
        free = max(s.count - at.spent[k], 0.05 * s.count)
        noise[k] = max(max(s.misfit(at.mean), 1e-30) / free, s.least)
    return tuple(groups), noise


def pulled_scale(squares: Array, seen: Array, rest: float) -> Array:
    """Returns the next scale (g,) of groups: MacKay's fixed point, pulled to the scale at rest.

    Args:
        squares: (g,) sum of the squared weights over their relative sizes.
        seen: (g,) number of weights the data determine.
        rest: Scale at rest.
    """
    return np.asarray(np.sqrt((PULL * rest**2 + squares) / (PULL + seen)))


def scale_groups(deviation: Array, known: Array, base: Array, group: Array) -> Array:
    """Returns the prior sd (p,) of parameters after one update of the factor of each group.

    Args:
        deviation: (p,) from the centre of the prior.
        known: (p,) share of each that the data determine.
        base: (p,) stated sd.
        group: (p,) number of the group; -1: its sd stays.
    """
    number = group.astype(np.int64) + 1  # 0: parameters whose sd stays
    seen = np.asarray(np.bincount(number, known), dtype=np.float64)
    squares = np.asarray(np.bincount(number, (deviation / base) ** 2), dtype=np.float64)
    factor = pulled_scale(squares, seen, 1.0)
    factor[0] = 1.0
    return np.asarray(base * factor[number])


def held_scales(groups: Sequence[PriorGroup], squares: Array, seen: Array) -> dict[int, float]:
    """Returns the next sd of every held group, by its number.

    With x the log variance of a group, r that at rest, h its hold and e the common factor,

        squares exp(-x) = seen + h (x - r - e),      sum h (x - r - e) = COMMON_HOLD e

    are the zeros of the slope of log evidence plus log prior. The first is solved by the Wright
    omega function, the second, whose left side falls with e, by bisection.

    Args:
        groups: All groups.
        squares: (g,) sum of the squared weights over their relative sizes.
        seen: (g,) number of weights the data determine.
    """
    held = [k for k, g in enumerate(groups) if g.learned and g.hold]
    if not held:
        return {}
    hold = np.array([groups[k].hold for k in held])
    rest = 2.0 * np.log([groups[k].rest for k in held])
    free = np.asarray(seen)[held] / hold
    height = np.log(np.maximum(np.asarray(squares)[held], 1e-300) / hold) + free

    def logs(common: float) -> Array:
        start = rest + common
        return np.asarray(start - free + wrightomega(height - start), dtype=np.float64)

    low, high = -14.0, 14.0  # factors of a thousand
    for _ in range(40):
        common = 0.5 * (low + high)
        pull = float((hold * (logs(common) - rest - common)).sum()) - COMMON_HOLD * common
        low, high = (common, high) if pull > 0.0 else (low, common)
    return dict(zip(held, np.exp(0.5 * logs(common)).tolist(), strict=True))
