"""Rounds at the machine: drive to the points, probe, correct the frame, until it is stable.

The recursion of Feng, Liang, Xi 2018 as a user does it, with three differences because of the
paper's oscillation. A correction is made from the touches of all rounds together. It is made only
where it is larger than its own uncertainty and takes the run nearer to the touches than they
scatter. A part that moved between two rounds is noticed, since touches of one place differ by
touching alone, whatever frame was run; the rounds before are then left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np
from scipy.stats import chi2

from robotrue.cell.registration.baselines import check_corner, feature_frame, fit_feature_frame
from robotrue.cell.registration.fit import check_pattern, fit_points
from robotrue.core.arrays import Array, frozen
from robotrue.core.poses import apply, fit_rigid, inverse
from robotrue.core.rotations import (
    abc_from_matrix,
    matrix_from_abc,
    rotation_vector_from_matrix,
)
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ImplausibleDataError

RoundVerdict: TypeAlias = Literal["run again", "settled", "as it was", "not settled"]
"""``run again``: a correction was made and not probed since; ``settled``: no significant correction
is left; ``as it was``: no correction of the first frame was significant; ``not settled``: the last
of the rounds still moved the part."""
RoundFit: TypeAlias = Literal["touches", "feng2018"]

CERTAIN: Final = 0.99
"""A correction within what touching alone makes in this share of rounds is not made."""
MOVED: Final = 0.9999
"""Touches that differ by more than touching does in this share of rounds are of a moved part."""
MARGIN: Final = 3.0
"""Standard deviations of one mean touch by which a correction has to lower the worst deviation."""
MOST_ROUNDS: Final = 3
MOST_TURN: Final = 60.0 * DEG
"""Largest first correction; further round, points are exchanged or the frame is another's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pass:
    """One pass: run the model's points, touch the part's, correct the model.

    Attributes:
        deviation: (n, 3) m in base, touched less run points, before the correction.
        angles: (3,) rad, correction about the model's z, y, x.
        shift: (3,) m, correction of K in base.
        significance: Squared length of the correction over that expected from touching alone (the
            new touches and, after the first pass, those the model was placed on); 6 degrees of
            freedom, so below 12.6 in 95 of 100 passes with nothing left to correct.
    """

    deviation: Array
    angles: Array
    shift: Array
    significance: float

    @property
    def error(self) -> Array:
        """Distances of the touched points from the run ones, (n,) m."""
        return np.asarray(np.linalg.norm(self.deviation, axis=1))

    @property
    def worst(self) -> float:
        """Largest of the errors, m."""
        return float(self.error.max())

    @property
    def angle(self) -> float:
        """Angle of the whole rotation, rad."""
        return float(np.linalg.norm(rotation_vector_from_matrix(matrix_from_abc(self.angles))))


@dataclass(frozen=True, slots=True, kw_only=True)
class Adjustment:
    """Result of the passes.

    Attributes:
        T_base_part: (4, 4) the adjusted model's pose.
        covariance: (6, 6) of its origin (m) and left rotation vector (rad), from the touching
            alone; the robot's own error is not in it.
        passes: Every pass.
        verdict: Why it ended; of rounds a word of :data:`RoundVerdict`.
        floor: m, worst of the three mean deviations over the settled passes, in which the touching
            averages out; NaN without one.
        oscillation: m, standard deviation of the worst error over them; NaN with fewer than two.
        swing: m, largest less smallest of them; NaN with fewer than two.
        distortion: (n,) m, touched minus drawn distance from each point to the next, mean over the
            settled passes: no pose of the model removes it.
    """

    T_base_part: Array
    covariance: Array
    passes: tuple[Pass, ...]
    verdict: str
    floor: float
    oscillation: float
    swing: float
    distortion: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Moved:
    """A part, or a table, that moved since the round before.

    Attributes:
        round: Number of the round that found it, from 1.
        shift: m, at the middle of the points.
        turn: rad.
        times: Length of the motion over its standard deviation.
    """

    round: int
    shift: float
    turn: float
    times: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundsResult:
    """Result of the rounds.

    Attributes:
        adjustment: Pose, covariance, passes, floor and oscillation; verdict of
            :data:`RoundVerdict`.
        frames: (k, 4, 4) ``T_base_part`` that was run in each round.
        touched: (n, 3) m in base, mean of the touches that count.
        counted: Rounds whose touches are in that mean.
        moved: Motions of the part between rounds.
    """

    adjustment: Adjustment
    frames: Array
    touched: Array
    counted: int
    moved: tuple[Moved, ...]


def adjust_in_rounds(
    in_part: Array,
    T_base_part: Array,
    touched: Array,
    *,
    sigma: float,
    names: tuple[str, ...],
    method: RoundFit = "touches",
) -> RoundsResult:
    """Returns the frame after the rounds so far, and whether another is needed.

    Args:
        in_part: (n, 3) m, three points or more in part; with ``feng2018`` three, the right angle
            first.
        T_base_part: (4, 4) the frame of the first round.
        touched: (k, n, 3) m in base, the same points as touched in each round.
        sigma: m per axis of one touch against the next round's: probe, repeatability, another tilt
            of the wrist; the arm's own repeated error is not in it.
        names: Of the points.
        method: ``touches``: all points count; ``feng2018``: the first point is exact.

    Raises:
        ConfigurationError: No round, or a sigma that is not positive.
        ObservabilityError: Points on one line.
        ImplausibleDataError: Points that changed among each other between rounds, a first
            correction of more than 60 deg, no right angle for ``feng2018``.
    """
    part: Array = frozen(in_part, (None, 3), "in_part")
    rounds: Array = frozen(touched, (None, len(part), 3), "touched")
    if not len(rounds) or not sigma > 0.0:
        raise ConfigurationError(
            f"{len(rounds)} rounds with sigma {sigma / MM:g} mm, expected one or more and a size."
        )
    check_pattern(part, names)
    if method == "feng2018":
        check_corner(part, names)
    T: Array = np.array(T_base_part, dtype=np.float64)
    frames, passes, moved = [], [], []
    first = settled = 0  # of the touches that count; of the passes with nothing but touching left
    touches_behind = 0  # rounds whose touches the frame that was run is made of
    verdict: RoundVerdict = "run again"
    for k, now in enumerate(rounds):
        frames.append(T)
        if k > first and (motion := _find_motion(part, rounds[first:k], now, sigma, k + 1, names)):
            moved.append(motion)
            first, touches_behind = k, 0
        mean = rounds[first : k + 1].mean(axis=0)
        count = k + 1 - first
        proposed, covariance = _fit(part, mean, sigma / np.sqrt(count), method, names)
        passes.append(_judge(part, T, now, proposed, covariance, _share(touches_behind, count)))
        if k == 0:
            _check_turn(passes[0], names)
        significant = passes[-1].significance > chi2.ppf(CERTAIN, 6)
        gain = _worst(mean, apply(T, part)) - _worst(mean, apply(proposed, part))
        if significant and gain > MARGIN * sigma / np.sqrt(count):
            T, touches_behind, settled = proposed, count, k + 1
            verdict = "run again" if k + 1 < MOST_ROUNDS + len(moved) else "not settled"
        elif touches_behind:
            T, touches_behind = proposed, count  # the same frame from more touches
            verdict = "settled"
        else:
            verdict = "as it was"
    mean = rounds[first:].mean(axis=0)
    lengths = [side_lengths(each) - side_lengths(part) for each in rounds]
    covariance = _fit(part, mean, sigma / np.sqrt(len(rounds) - first), method, names)[1]
    return RoundsResult(
        adjustment=summarise(T, covariance, passes, lengths, verdict, first=settled),
        frames=np.array(frames),
        touched=mean,
        counted=len(rounds) - first,
        moved=tuple(moved),
    )


def _share(behind: int, count: int) -> float:
    """Variance of a correction over that of the fit to ``count`` rounds.

    A frame made of the touches before shares them with the correction.
    """
    return 1.0 if not behind else count / behind - 1.0


def side_lengths(points: Array) -> Array:
    """Returns the distance (n,) m of each point (n, 3) m from the next, the last from the first."""
    return np.asarray(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1))


def summarise(
    T_base_part: Array,
    covariance: Array,
    passes: list[Pass],
    lengths: list[Array],
    verdict: str,
    *,
    first: int,
) -> Adjustment:
    """Returns the final pose of passes, with floor and oscillation separated.

    Args:
        T_base_part: (4, 4) the adjusted pose.
        covariance: (6, 6) of it, from the touching alone.
        passes: All.
        lengths: (n,) m of each pass, see ``distortion``.
        verdict: Why it ended.
        first: Pass from which on nothing but touching changes the errors.
    """
    worst = np.array([p.worst for p in passes[first:]])
    deviation = np.array([p.deviation for p in passes[first:]])
    drift = np.array(lengths[first:] or [np.full(len(lengths[-1]), np.nan)])
    several = len(worst) > 1
    return Adjustment(
        T_base_part=frozen(T_base_part, (4, 4), "T_base_part"),
        covariance=frozen(covariance, (6, 6), "covariance"),
        passes=tuple(passes),
        verdict=verdict,
        floor=float(np.linalg.norm(deviation.mean(axis=0), axis=1).max())
        if len(worst)
        else float("nan"),
        oscillation=float(worst.std(ddof=1)) if several else float("nan"),
        swing=float(np.ptp(worst)) if several else float("nan"),
        distortion=frozen(drift.mean(axis=0), (None,), "distortion", allow_nan=True),
    )


def _fit(
    part: Array, touched: Array, sigma: float, method: RoundFit, names: tuple[str, ...]
) -> tuple[Array, Array]:
    """The frame and its covariance (6, 6), by touching alone."""
    if method == "feng2018":
        fit = fit_feature_frame(part, touched, sigma=sigma, names=names)
    else:
        fit = fit_points(part, touched, sigma=sigma, names=names)
    return fit.T_base_part, fit.covariance


def _judge(
    part: Array, T: Array, touched: Array, proposed: Array, covariance: Array, share: float
) -> Pass:
    """One round: errors of the run, and the correction from the frame run to the proposed one."""
    run, wanted = apply(T, part), apply(proposed, part)
    turn = proposed[:3, :3] @ T[:3, :3].T
    step = np.concatenate([proposed[:3, 3] - T[:3, 3], rotation_vector_from_matrix(turn)])
    axes = feature_frame(run[:3])[:3, :3]
    own = share * covariance
    return Pass(
        deviation=touched - run,
        angles=abc_from_matrix(axes.T @ turn @ axes),
        shift=wanted[0] - run[0],
        significance=float(step @ np.linalg.solve(own, step)),
    )


def _worst(touched: Array, run: Array) -> float:
    return float(np.linalg.norm(touched - run, axis=1).max())


def _check_turn(begun: Pass, names: tuple[str, ...]) -> None:
    if begun.angle > MOST_TURN:
        raise ImplausibleDataError(
            f"the first correction turns the part by {begun.angle / DEG:.0f} deg about "
            f"{names[0]}, allowed {MOST_TURN / DEG:.0f} deg.",
            hint="two points are exchanged (the part is seen as its mirror image), the points are "
            "of another side, or the frame to begin with is not the one that was run (--frame).",
        )


def _find_motion(
    part: Array, before: Array, now: Array, sigma: float, number: int, names: tuple[str, ...]
) -> Moved | None:
    """Returns the motion of the part since the last round; None if noise explains it.

    Raises:
        ImplausibleDataError: The points moved against each other: one was touched wrong.
    """
    mean = before.mean(axis=0)
    scale = sigma * np.sqrt(1.0 + 1.0 / len(before))
    T = fit_rigid(mean, now)
    left = now - apply(T, mean)
    loose = float((left**2).sum()) / scale**2
    if loose > chi2.ppf(MOVED, 3 * len(part) - 6):
        far = np.linalg.norm(left, axis=1)
        told = ", ".join(f"{n} {d / MM:.2f} mm" for n, d in zip(names, far, strict=True))
        raise ImplausibleDataError(
            f"the points of round {number} moved against each other since the rounds before by "
            f"more than the touch uncertainty ({sigma / MM:.3f} mm per axis): {told}.",
            hint="probe that round again; or state the real uncertainty of a touch with "
            "--touch-sigma-mm.",
        )
    rigid = float(((now - mean) ** 2).sum()) / scale**2 - loose
    if rigid <= chi2.ppf(MOVED, 6):
        return None
    middle = mean.mean(axis=0)
    turn = rotation_vector_from_matrix(inverse(T)[:3, :3])
    return Moved(
        round=number,
        shift=float(np.linalg.norm(apply(T, middle) - middle)),
        turn=float(np.linalg.norm(turn)),
        times=float(np.sqrt(rigid / 6.0)),
    )
