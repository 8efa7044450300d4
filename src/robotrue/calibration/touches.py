"""Touches of a part as observations: the part is a station, its nominal points what is measured.

A touched feature point gives ``T_part_base tip(q) = p_part``: a tracker point whose set-up is the
part. On a surface a touch fixes only the distance along the normal there, and a gauge fixes the
distance between the origins of two parts. All linearise over the same parameters and can be
combined with tracker rows in one Gauss-Newton.

Touch i is compared with its prediction from all others
(:func:`robotrue.calibration.new_rows.left_out_lengths`). The bound then needs no guess of the arm's
error: that is in the covariance of all numbers, larger for a nominal arm, smaller for a calibrated
one and for touches of one neighbourhood.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from robotrue.calibration.belief import Belief
from robotrue.calibration.drift_scales import Stack
from robotrue.calibration.evidence import PriorGroup, Weights, sums_of
from robotrue.calibration.new_rows import NewRows, left_out_lengths
from robotrue.calibration.observations import (
    ArmVisits,
    Entries,
    Linearisation,
    Observation,
    PointObservation,
    seen_points,
)
from robotrue.calibration.parameters import ParameterLayout, State
from robotrue.calibration.scale_learning import COMMON_HOLD, learn
from robotrue.calibration.settings import LEARNED, Prior
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import inverse
from robotrue.core.robust import agreeing, chi_point, student_factor
from robotrue.core.rotations import skew
from robotrue.core.surfaces import Plane, Surface
from robotrue.errors import ImplausibleDataError
from robotrue.measurement.probing_set import KnownDistance, ProbingSet
from robotrue.robot.statics import Load, stated_torque

COINCIDENT: Final = 1e-3
"""m; parts nearer to one another than this have no direction between them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceObservation:
    """Touches that fix one direction each: the probe's centre is its radius away from a surface.

    Attributes:
        visits: Postures and loads; the station is the part.
        surfaces: (n) one per touch, in the part's frame.
        radius: m, of the probe's ball.
        variance: (n,) m^2 along the normal, touch and repeatability.
        rows: (n,) rows of the probing set.
    """

    visits: ArmVisits
    surfaces: tuple[Surface, ...]
    radius: float
    variance: Array
    rows: IntArray

    def linearise(
        self, layout: ParameterLayout, state: State, part: Entries = slice(None)
    ) -> Linearisation:
        """Returns the linearised rows; residual (n, 1) m: radius minus distance."""
        point, _, jacobian = seen_points(layout, state, self.visits, part, rotations=False)
        chosen = np.arange(len(self.rows))[part]
        distance, normal = np.empty(len(point)), np.empty((len(point), 3))
        kept = [self.surfaces[i] for i in chosen]
        for surface in {id(s): s for s in kept}.values():
            mine = np.array([s is surface for s in kept])
            distance[mine], normal[mine] = surface.nearest(point[mine])
        return Linearisation(
            residual=(self.radius - distance)[:, None],
            jacobian=normal[:, None, :] @ jacobian,
            covariance=self.variance[part][:, None, None],
            white=np.array([[1.0], [0.0]]),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class PartDistanceObservation:
    """Known distances between the origins of parts: sockets on one bar, holes of one drawing.

    Attributes:
        visits: As many as distances; no posture decides them.
        distances: Of the parts, which are stations of the layout.
        rows: (n,) after the touches.
    """

    visits: ArmVisits
    distances: tuple[KnownDistance, ...]
    rows: IntArray

    def linearise(
        self, layout: ParameterLayout, state: State, part: Entries = slice(None)
    ) -> Linearisation:
        """Returns the linearised rows; residual (n, 1) m.

        Raises:
            ImplausibleDataError: Parts in the same place.
        """
        chosen = [self.distances[i] for i in np.arange(len(self.distances))[part]]
        n = len(chosen)
        residual, jacobian = np.empty((n, 1)), np.zeros((n, 1, layout.size))
        for i, known in enumerate(chosen):
            a, of_a = _origin(state.T_tracker_base[known.first])
            b, of_b = _origin(state.T_tracker_base[known.second])
            length = float(np.linalg.norm(b - a))
            if length < COINCIDENT:
                raise ImplausibleDataError(
                    f"parts {known.first} and {known.second} are {length * 1e3:.3g} mm apart, "
                    f"their known distance is {known.length * 1e3:.6g} mm.",
                    hint="check which touches belong to which part.",
                )
            along = (b - a) / length
            for number, columns, sign in ((known.first, of_a, -1.0), (known.second, of_b, 1.0)):
                place = layout.blocks[f"station/{number}"]
                size = place.stop - place.start
                jacobian[i, 0, place] += sign * along @ columns[:, :size]
            residual[i, 0] = known.length - length
        variance = np.array([known.sigma**2 for known in chosen])
        return Linearisation(
            residual=residual,
            jacobian=jacobian,
            covariance=variance[:, None, None],
            white=np.zeros((2, 1)),
        )


def _origin(T_part_base: Array) -> tuple[Array, Array]:
    """The part's origin (3,) m in base, and its derivative (3, 6) by a step of ``T_part_base``."""
    back = T_part_base[:3, :3].T
    t = T_part_base[:3, 3]
    return -back @ t, np.hstack([-back, -back @ skew(t)])


def frame_displacement(T_base_part: Array, size: int = 6) -> Array:
    """Returns the map (size, size) from a step of the part's columns to one of ``T_base_part``.

    Columns are a shift and a left rotation vector of ``T_part_base``, in part axes. The result is
    the displacement of the part's origin (m) and its left rotation vector (rad), in base axes.

    Args:
        T_base_part: (4, 4).
        size: 6, or 3 for a place.
    """
    _, of_origin = _origin(inverse(T_base_part))
    turn = np.hstack([np.zeros((3, 3)), -T_base_part[:3, :3]])
    out: Array = np.vstack([of_origin, turn])
    return out[:size, :size]


def touch_rows(
    belief: Belief,
    touches: ProbingSet,
    T_base_part: Mapping[int, Array],
    *,
    touch_sigma: float,
    payload: Load,
) -> NewRows:
    """Returns the touches ready to be added to a belief, linearised about frames to start from.

    Rows 0 to n - 1 are the touches, the rows after them the known distances.

    Args:
        belief: Prior of the arm.
        touches: With joints.
        T_base_part: (4, 4) of every part, roughly.
        touch_sigma: m per axis of one touch: probe, surface, hand.
        payload: On the flange while touching.
    """
    n, dof = len(touches), belief.robot.dof
    torque, weight = stated_torque(belief.robot, touches.joints, payload)
    visits = ArmVisits(
        joints=touches.joints,
        torque=torque,
        weight=weight,
        target=np.zeros(n, dtype=np.int64),
        station=touches.part,
    )
    variance = touch_sigma**2 + belief.repeatability**2
    observations: list[Observation] = []
    full, along = np.flatnonzero(touches.full), np.flatnonzero(~touches.full)
    if len(full):
        observations.append(
            PointObservation(
                visits=visits.take(full),
                position=touches.point[full],
                covariance=np.broadcast_to(variance * np.eye(3), (len(full), 3, 3)),
                rows=full,
            )
        )
    if len(along):
        observations.append(
            SurfaceObservation(
                visits=visits.take(along),
                surfaces=tuple(_surface(touches, int(i)) for i in along),
                radius=touches.radius,
                variance=np.full(len(along), variance),
                rows=along,
            )
        )
    if touches.distances:
        observations.append(_part_distances(touches, dof))
    return NewRows(
        robot=belief.robot,
        observations=tuple(observations),
        layout=ParameterLayout(
            dof=dof, stations=touches.parts, places=tuple(sorted(touches.sockets))
        ),
        T_tracker_base={k: inverse(T_base_part[k]) for k in touches.parts},
        T_flange_target={},
        count=n + len(touches.distances),
    )


def _part_distances(touches: ProbingSet, dof: int) -> PartDistanceObservation:
    """The known distances, as rows after the touches."""
    size = len(touches.distances)
    none = np.zeros(size, dtype=np.int64)
    rest = np.zeros((size, dof))
    return PartDistanceObservation(
        visits=ArmVisits(joints=rest, torque=rest, target=none, station=none),
        distances=touches.distances,
        rows=len(touches) + np.arange(size),
    )


def _surface(touches: ProbingSet, row: int) -> Surface:
    if touches.touched[row] >= 0:
        return touches.surfaces[int(touches.touched[row])]
    return Plane(point=touches.point[row], normal=touches.normal[row])


FALSE_ALARM: Final = 0.01
"""Chance that a set without a wrong touch loses one."""
FAINT: Final = 1e-6
"""Weight of a rejected touch, whose number then has no effect."""


def surprise(stack: Stack, belief: Belief, noise: Array) -> float:
    """Returns the distance of the rows from the prior, relative to the expected distance.

    About 1 where belief and noise hold; the frames, of which nothing was known, take their share.
    NaN where nothing is left over.
    """
    freedom = len(stack.values) - belief.nuisances
    if freedom < 1:
        return float("nan")
    half = stack.columns @ belief.root.T
    offset = stack.values - stack.columns @ belief.mean
    total = half @ half.T + stack.known + np.diag(noise[0] * stack.white)
    return float(np.sqrt(offset @ np.linalg.solve(total, offset) / freedom))


def find_agreeing_touches(stack: Stack, belief: Belief, noise: Array, tested: int) -> BoolArray:
    """Returns which of the first ``tested`` rows agree.

    Args:
        stack: All rows, the touches first.
        belief: Of the arm and, at its end, the frames.
        noise: (2,) white variance of lengths and angles.
        tested: Number of touches; the rows after them are used without a test.

    Raises:
        ConvergenceError: Weights that never settle.
    """
    half = stack.columns @ belief.root.T
    shared = half @ half.T
    offset = stack.values - stack.columns @ belief.mean
    own = stack.known + np.diag(noise[0] * stack.white)
    rows = [np.flatnonzero(stack.row == i) for i in range(tested)]
    level = 1.0 - FALSE_ALARM / max(tested, 1)
    bound = np.array([chi_point(level, len(mine)) for mine in rows])

    def lengths(weights: Array) -> Array:
        weight = np.ones(int(stack.row.max()) + 1)
        weight[:tested] = np.maximum(weights, FAINT)
        root = 1.0 / np.sqrt(weight[stack.row])
        noisier = own * root[:, None] * root
        found = left_out_lengths(shared + noisier, offset, rows, own - noisier)
        return np.asarray(found / np.sqrt(belief.inflation) / bound)

    return agreeing(lengths, tested, 1.0)


BANDS: Final = (1, 4, 9, 17, 33)
"""First N of each band of ripple with its own scale."""
HOLD: Final = 0.5
"""Of each scale to its default: a factor of e is one sigma."""
STEPS: Final = 40
WORTH: Final = 8.0
"""Weight of the default scales: with 4, regions after 12 touches hold too much."""


def learn_scales(
    belief: Belief, stack: Stack, noise: Array, physical: Prior
) -> tuple[Belief, float]:
    """Returns the prior of a nominal arm with scales from the touches, and their noise factor.

    Groups: the learnable ones of the physical prior and the bands of ripple. All are held to their
    default: thirty touches determine a single group poorly, but the common scale well. A scale from
    few touches is uncertain, so the belief's inflation grows (:func:`few_factor`).

    Args:
        belief: Diagonal prior of the arm, the frames at its end.
        stack: The rows in use.
        noise: (2,) white variance of lengths and angles.
        physical: Names the groups of the robot errors.
    """
    sd = np.sqrt(belief.variance)
    waves, end = belief.place("ripple"), belief.end
    ripple, backlash = waves.start, waves.stop
    groups: list[PriorGroup] = []
    number = np.asarray(physical.group[:ripple])
    for k in np.unique(number[sd[:ripple] > 0.0]).tolist():
        columns = np.flatnonzero((number == k) & (sd[:ripple] > 0.0))
        name = "fixed" if k < 0 else LEARNED[int(k)]
        groups.append(_group(name, columns, sd, held=k >= 0))
    order = belief.ripple.order
    for low, high in pairwise(BANDS):
        columns = ripple + np.flatnonzero((order >= low) & (order < high))
        if len(columns):
            groups.append(_group(f"ripple/{low}", columns, sd, held=True))
    others = np.flatnonzero(sd[backlash:end] > 0.0) + backlash
    if len(others):
        groups.append(_group("other", others, sd, held=False))
    groups.append(_group("frames", np.arange(end, len(sd)), sd, held=False))
    found = _learn(stack.columns, stack, belief.mean, noise, groups)
    new = np.zeros(len(sd))
    for group in found.groups:
        new[group.columns] = group.sd * group.unit
    determined = sum(
        float(seen) for g, seen in zip(found.groups, found.determined, strict=True) if g.learned
    )
    # What the touches determine hardly depends on the scales; what they do not (a side that was
    # never touched) is as uncertain as the scales themselves, which the default holds loosely.
    # A scale that was lowered is widened so far, but not beyond the default.
    beyond = float(np.sqrt(few_factor(determined, COMMON_HOLD) / few_factor(determined)))
    for group in found.groups:
        if group.learned:
            new[group.columns] *= max(min(beyond, 1.0 / group.sd), 1.0)
    wider = replace(
        belief, root=np.diag(new)[new > 0.0], inflation=belief.inflation * few_factor(determined)
    )
    return wider, float(found.noise[0])


def few_factor(determined: float, worth: float = WORTH) -> float:
    """Returns the factor on a covariance whose scale was learned from some weights.

    Args:
        determined: Number of weights of learned groups that the touches determine.
        worth: Weight of the default scales.
    """
    return student_factor(determined + worth)


def noise_factor(belief: Belief, stack: Stack, noise: Array) -> float:
    """Returns the ratio of the touches' variance to the stated one; never below 1."""
    unit = stack.columns @ belief.root.T
    group = PriorGroup(name="all", columns=np.arange(unit.shape[1]), sd=1.0)
    offset = replace(stack, values=stack.values - stack.columns @ belief.mean)
    return float(_learn(unit, offset, np.zeros(unit.shape[1]), noise, [group]).noise[0])


def _group(name: str, columns: IntArray, sd: Array, *, held: bool) -> PriorGroup:
    return PriorGroup(
        name=name,
        columns=np.asarray(columns, dtype=np.int64),
        sd=1.0,
        rest=1.0 if held else 0.0,
        shape=sd[columns],
        hold=HOLD if held else 0.0,
    )


def _learn(
    columns: Array, stack: Stack, mean: Array, noise: Array, groups: list[PriorGroup]
) -> Weights:
    lower = np.linalg.cholesky(stack.known + np.diag(noise[0] * stack.white))
    values = np.linalg.solve(lower, stack.values - columns @ mean)
    rows = np.linalg.solve(lower, columns)
    sums = sums_of([(rows, values, float(len(values)))], columns.shape[1])
    return learn([replace(sums, least=1.0)], groups, np.ones(1), steps=STEPS)
