"""Mastering check: the axis that lost its zero, from touches of one fixed point.

    tip(q; w, d) = p + noise,    w ~ belief in the arm,    p ~ nothing known (or touched before),
    d_j ~ N(0, s^2) for the axes that lost their zero by a hypothesis, 0 for the others

The hypotheses are: no axis, each axis, each pair. Their odds are marginal likelihoods, averaged
over the sizes s (MacKay 2003, "Information Theory, Inference, and Learning Algorithms", chapter
28). The arm's own geometry w may explain the touches as well, as far as it is uncertain: an offset
that geometry explains is then not called lost. Turning everything about axis 1 moves the point
alike, so axis 1 shows only where the point is known in base; the last axis only where the tip is
off the axis and known in the flange.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np
from scipy.special import logsumexp

from robotrue.calibration.belief import Belief
from robotrue.calibration.drift_scales import Stack, stack_rows
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.new_rows import NUISANCE_SD, NewRows
from robotrue.calibration.probing import before_touching
from robotrue.calibration.probing_estimate import ProbingSettings
from robotrue.calibration.probing_start import tips
from robotrue.calibration.touches import find_agreeing_touches, noise_factor, touch_rows
from robotrue.calibration.update import carry_residual
from robotrue.core.arrays import Array, BoolArray
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import pose
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ImplausibleDataError, ObservabilityError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.validation.mastering_evidence import (
    OffsetEvidence,
    SolvedTouches,
    loosen_zeros,
    solve_touches,
    weigh_offsets,
)
from robotrue.validation.touch_checks import file_of, list_names
from robotrue.validation.validation_defaults import POINT_SIGMA_MM

SIZES: Final = (0.03 * DEG, 0.1 * DEG, 0.3 * DEG, 1.0 * DEG)
"""Standard deviations s of a lost zero that are tried, equally likely."""
CHANCES: Final = (0.5, 0.4, 0.1)
"""Before the touches: that no axis, one, or two have lost their zero."""
SURE: Final = 0.95
"""Probability from which an axis is named."""
SEEN: Final = 0.5
"""An axis shows where touches leave less than this share of :data:`TRIED`."""
TRIED: Final = SIZES[2]
CERTAIN: Final = 4.0
"""Standard deviations of an offset that are seen against the chance that no axis lost its zero."""
FEWEST: Final = 8
"""Fewest touches; the point needs three numbers, and two axes must differ from wrong touches."""
ONE_PLACE: Final = 1e-6
"""m; nominal points closer together are one place."""
BEYOND: Final = 1.75
"""Factor on the sd of a calibrated arm at touches outside the joint range of its calibration, where
loads have another sign; the intervals of offsets of simulated arms then hold about 95 %."""
MISFIT: Final = 3.0
"""Touches this many times further off than even the best hypothesis lets expect."""
Verdict: TypeAlias = Literal["holds", "lost", "undecided"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LostZeros:
    """One hypothesis: these axes have lost their zero, and no others.

    Attributes:
        joints: Which, counted from 0; empty: none has.
        probability: After the touches.
        offset: (k,) rad, what is to be added to each joint's reading.
        covariance: (k, k) rad^2 of it, the arm's own geometry included.
    """

    joints: tuple[int, ...]
    probability: float
    offset: Array
    covariance: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class MasteringCheck(Columns):
    """Evidence from touches of one point on the zeros of the axes.

    Attributes:
        verdict: ``holds``, ``lost`` or ``undecided``.
        lost: The axes named, with offset and covariance; no joints unless the verdict is lost.
        hypotheses: All, the most probable first.
        probability: (n,) that each joint lost its zero; NaN where the touches cannot show it.
        least: (n,) rad, offset from which each joint would be seen; infinite where never.
        p_base: (3,) m, the point as found.
        rms_before: m, distance of the touches from one point by the model as it was.
        rms_after: m, the same with the best hypothesis.
        outliers: Labels of touches that agree with no hypothesis.
        noise_factor: Variance of a touch over the stated one, 1 or more.
    """

    verdict: Verdict
    lost: LostZeros
    hypotheses: tuple[LostZeros, ...]
    probability: Annotated[Array, Column("n", nan=True)]
    least: Annotated[Array, Column("n", unit="rad", inf=True)]
    p_base: Annotated[Array, Column("3", unit="m")]
    rms_before: float
    rms_after: float
    outliers: tuple[str, ...]
    noise_factor: float


def check_mastering(
    arm: ErrorModel,
    touches: ProbingSet,
    settings: ProbingSettings,
    *,
    point: Array | None = None,
    point_sigma: float = POINT_SIGMA_MM * MM,
) -> MasteringCheck:
    """Returns the axes that lost their zero, the offsets, and their probability.

    Args:
        arm: The model made while the arm was good; :class:`NominalModel` without one.
        touches: In joints, all of one fixed point.
        settings: Noise, tool, payload; priors of an arm that was not calibrated.
        point: (3,) m in base, the point as touched while the arm was good; None: unknown.
        point_sigma: m per axis, of it.

    Raises:
        ConfigurationError: Touches without joints, of several places, or of surfaces.
        ObservabilityError: Fewer than eight touches, or none that shows any axis.
        ImplausibleDataError: Touches that no one or two lost zeros explain.
        ModelMismatchError: Joints of another robot.
    """
    socket = _as_socket(touches)
    before = carry_residual(before_touching(arm, settings), touches.joints)
    start = point
    if start is None:
        start = np.median(tips(before, touches.joints, settings.payload), axis=0)
    rows = touch_rows(
        before,
        socket,
        {0: pose(np.eye(3), start)},
        touch_sigma=settings.touch_sigma,
        payload=settings.payload,
    )
    loose = NUISANCE_SD if point is None else point_sigma
    keep, factor = _find_noise(before, rows, touches, loose)
    more = (factor - 1.0) * (settings.touch_sigma**2 + before.repeatability**2 + before.white**2)
    before = replace(before, white=float(np.sqrt(before.white**2 + more)))
    robot = before.robot
    single = [solve_touches(before, (j,), TRIED, rows, keep, loose) for j in range(robot.dof)]
    solved: dict[tuple[int, ...], SolvedTouches] = {(j,): each for j, each in enumerate(single)}
    stated = np.ones(len(touches))
    sd = np.sqrt([weigh_offsets(each, TRIED, stated).covariance[0, 0] for each in single])
    seen = np.flatnonzero(sd < SEEN * TRIED)
    if not len(seen):
        raise ObservabilityError(
            f"{len(touches)} touches determine no axis: the best has an uncertainty of "
            f"{sd.min() / DEG:.3f} deg.",
            source=file_of(touches),
            hint="touch the point with the elbow and the wrist as different as they can be.",
        )
    stretch = _find_stretch(arm, touches)
    found = _weigh(before, rows, keep, loose, seen.tolist(), solved, stretch)
    best = found[0]
    nothing, after = solved[()], solved[best.joints]
    _check_explained(after, best, touches)
    probability = np.full(robot.dof, np.nan)
    probability[seen] = [sum(h.probability for h in found if j in h.joints) for j in seen]
    named = tuple(int(j) for j in seen if probability[j] >= SURE)
    none = next(h for h in found if not h.joints)
    lost = next((h for h in found if h.joints == named), none)
    return MasteringCheck(
        verdict="lost" if named else "holds" if none.probability >= 0.5 else "undecided",
        lost=lost,
        hypotheses=found,
        probability=probability,
        least=np.where(sd < SEEN * TRIED, CERTAIN * sd, np.inf),
        p_base=after.rows.T_tracker_base[0][:3, 3] * -1.0,
        rms_before=_rms(nothing.residuals),
        rms_after=_rms(after.residuals),
        outliers=tuple(label for label, good in zip(touches.labels, keep, strict=True) if not good),
        noise_factor=factor,
    )


def _find_stretch(arm: ErrorModel, touches: ProbingSet) -> Array:
    """Factor (n,) on the sd of the arm at each touch: the inflation of its covariance."""
    joint_range = arm.training_summary().joint_range if arm.calibrated else None
    if joint_range is None:
        return np.ones(len(touches))
    low, high = joint_range
    return np.where(((touches.joints < low) | (touches.joints > high)).any(axis=1), BEYOND, 1.0)


def _as_socket(touches: ProbingSet) -> ProbingSet:
    """The touches as those of a place."""
    if not len(touches) or not touches.has_joints or not touches.full.all():
        raise ConfigurationError(
            "the zeros of the axes need touches of one point, in joints and without normals.",
            source=file_of(touches),
            hint="name,px_mm,py_mm,pz_mm,j1_deg,j2_deg,... with equal px_mm, py_mm, pz_mm.",
        )
    spread = float(np.ptp(touches.point, axis=0).max())
    if spread > ONE_PLACE or len(touches.parts) > 1:
        raise ConfigurationError(
            f"touches of places up to {spread / MM:.3f} mm apart; the zeros of the axes need one "
            "fixed point, touched in many postures.",
            source=file_of(touches),
            hint="one file per point.",
        )
    if len(touches) < FEWEST:
        raise ObservabilityError(
            f"{len(touches)} touches of the point, at least {FEWEST} separate the axes.",
            source=file_of(touches),
            hint="12 to 20, as `robotrue mastering-plan` chooses them.",
        )
    n = len(touches)
    return replace(touches, point=np.zeros((n, 3)), part=np.zeros(n, dtype=np.int64), sockets=(0,))


def _find_noise(
    before: Belief, rows: NewRows, touches: ProbingSet, loose: float
) -> tuple[BoolArray, float]:
    """Returns the touches that agree with some offsets of all axes, and the noise factor."""
    everyone = np.ones(len(touches), dtype=bool)
    every = tuple(range(before.robot.dof))
    prior = loosen_zeros(before, every, SIZES[-1], rows.nuisances, loose)
    keep, factor = everyone, 1.0
    for _ in range(2):
        solved = solve_touches(before, every, SIZES[-1], rows, keep, loose)
        stack = stack_rows(solved.rows.pieces(solved.at))  # of all, accepted or not
        keep = find_agreeing_touches(stack, prior, prior.noise, len(touches))
        if 2 * int(keep.sum()) <= len(touches):
            wrong = [name for name, good in zip(touches.labels, keep, strict=True) if not good]
            raise ImplausibleDataError(
                f"{len(wrong)} of {len(touches)} touches agree with no zeros of the axes: "
                f"{list_names(wrong)}.",
                source=file_of(touches),
                hint="check that all are of one fixed point, the tool, units, joint signs and "
                "--touch-sigma-mm.",
            )
        factor = noise_factor(prior, _select_rows(stack, keep), prior.noise)
    return keep, factor


def _select_rows(stack: Stack, keep: BoolArray) -> Stack:
    good = np.flatnonzero(keep[stack.row])
    return Stack(
        columns=stack.columns[good],
        values=stack.values[good],
        known=stack.known[np.ix_(good, good)],
        white=stack.white[good],
        row=stack.row[good],
    )


def _list_hypotheses(seen: list[int]) -> Iterator[tuple[tuple[int, ...], float]]:
    """Every hypothesis with the logarithm of its probability before the touches."""
    for size, chance in enumerate(CHANCES):
        of_size = list(combinations(seen, size))
        for joints in of_size:
            yield joints, float(np.log(chance / len(of_size)))


def _weigh(
    before: Belief,
    rows: NewRows,
    keep: BoolArray,
    loose: float,
    seen: list[int],
    solved: dict[tuple[int, ...], SolvedTouches],
    stretch: Array,
) -> tuple[LostZeros, ...]:
    """All hypotheses after the touches, the most probable first; adds to what is solved.

    The odds are by the covariance that the arm states of itself: errors of the arm beyond it are
    alike under all hypotheses.
    """
    tried: dict[tuple[int, ...], list[OffsetEvidence]] = {}
    logs: dict[tuple[int, ...], Array] = {}
    for joints, chance in _list_hypotheses(seen):
        sizes = SIZES if joints else SIZES[:1]
        if joints not in solved:
            solved[joints] = solve_touches(before, joints, TRIED, rows, keep, loose)
        first = solved[joints]
        tried[joints] = [weigh_offsets(first, size, stretch) for size in sizes]
        logs[joints] = np.array([each.log for each in tried[joints]]) + chance - np.log(len(sizes))
    total = float(logsumexp(np.concatenate(list(logs.values()))))
    found = [_mix_sizes(joints, tried[joints], log, total) for joints, log in logs.items()]
    return tuple(sorted(found, key=lambda h: -h.probability))


def _mix_sizes(
    joints: tuple[int, ...], tried: Sequence[OffsetEvidence], log: Array, total: float
) -> LostZeros:
    """Averages a hypothesis over its sizes; their spread is in the covariance."""
    mine = float(logsumexp(log))
    weight = np.exp(log - mine)
    means = np.stack([each.offset for each in tried])
    offset = weight @ means
    apart = means - offset
    covariance = np.einsum("s,sij->ij", weight, np.stack([each.covariance for each in tried]))
    return LostZeros(
        joints=joints,
        probability=float(np.exp(mine - total)),
        offset=offset,
        covariance=covariance + np.einsum("s,si,sj->ij", weight, apart, apart),
    )


def _check_explained(solved: SolvedTouches, best: LostZeros, touches: ProbingSet) -> None:
    """Passes touches that the best hypothesis explains.

    Raises:
        ImplausibleDataError: They lie far from what one or two lost zeros can do.
    """
    surprise = weigh_offsets(solved, TRIED, np.ones(len(touches))).surprise
    if surprise <= MISFIT:
        return
    raise ImplausibleDataError(
        f"the residuals of the touches are {surprise:.3g} times larger than the best of all "
        f"explanations ({'joint ' if best.joints else 'no lost zero'}"
        f"{', '.join(str(j + 1) for j in best.joints)}) allows, at most {MISFIT:g}.",
        source=file_of(touches),
        hint="three axes or more lost their zero, the point or the tool moved, or the touches are "
        "noisier than --touch-sigma-mm.",
    )


def _rms(residuals: Array) -> float:
    return float(np.sqrt((residuals**2).sum(axis=1).mean()))
