"""One more touch: its expected reading after those before it, and the part's uncertainty then.

From the first touch on, when no frame can be fitted yet, the arm's errors w and a step f of every
frame about a rough place have a joint prior. With the tip of the model and R the part's attitude, a
touch of nominal point p reads

    tip - T p = G f - B w + e,        G = [I, -(R p) x],   w ~ N(0, I),   f ~ N(rough, S)

and Gauss-Newton over all touches gives mean and covariance of both, so also of the next reading and
of every machined point. ``register`` determines the frame; this module predicts readings, and lists
possible faults of an unexpected one: place, unit, sign, ball, repeat.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

import numpy as np

from robotrue.calibration.belief import Belief
from robotrue.calibration.machined import tip_columns, uncarried_variance
from robotrue.calibration.model import ErrorModel
from robotrue.cell.registration.fit import displace_frame
from robotrue.core.arrays import Array
from robotrue.core.poses import displacement_columns
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.forward import forward
from robotrue.validation.registered_part import REGION
from robotrue.validation.registration_frame import (
    CALIBRATED_ROBOT,
    GOOD,
    NOMINAL_ROBOT,
    RegistrationSettings,
    arm_belief,
    tips,
    touch_query,
)

ROUNDS: Final = 12
STILL: Final = 1e-10
"""m and rad; a step below this ends the iteration."""
TURN_PER_SHIFT: Final = 2.0
"""rad per m: a rough frame that is off by 20 mm may be turned by 0.04 rad."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchBelief:
    """Arm and frames after some touches.

    Attributes:
        arm: Model or nominal arm that touches.
        settings: Of the registration.
        T_base_part: (4, 4) of every part, by its number.
        belief: Of the arm; None where touches do not determine it (no joints): the arm's share is
            noise then.
        mean: (k + 6 f,) learned errors of the arm, in units of its prior, then zeros.
        covariance: (k + 6 f, k + 6 f), of the same and of the steps of the frames (m, rad).
        touches: Number of touches used.
    """

    arm: ErrorModel
    settings: RegistrationSettings
    T_base_part: Mapping[int, Array]
    belief: Belief | None
    mean: Array
    covariance: Array
    touches: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectedTouch:
    """Expected reading of touches, in base.

    Attributes:
        position: (n, 3) m of the tip, as the model or the instrument has it.
        covariance: (n, 3, 3) m^2, of one reading.
    """

    position: Array
    covariance: Array

    @property
    def band(self) -> Array:
        """Distance (n,) m within which 95 of 100 readings lie, or more."""
        return np.asarray(REGION * np.sqrt(np.linalg.eigvalsh(self.covariance)[:, -1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedTouch:
    """A reading with its expectation.

    Attributes:
        off: (3,) m in base, read minus expected; along the normal alone of a surface.
        sigmas: Its length in standard deviations of what was expected.
    """

    off: Array
    sigmas: float

    @property
    def distance(self) -> float:
        """Length of ``off``, m."""
        return float(np.linalg.norm(self.off))

    @property
    def outlier(self) -> bool:
        """True if a good touch is unlikely to read so."""
        return self.sigmas > GOOD


def update_belief(
    arm: ErrorModel,
    touches: ProbingSet | None,
    rough: Mapping[int, Array],
    *,
    settings: RegistrationSettings,
    rough_sigma: float,
    joints: bool,
) -> TouchBelief:
    """Returns arm and frames after the touches; without touches, at the rough place.

    Args:
        arm: Touching arm.
        touches: Made so far, with joints if ``joints``, else with positions; None: none.
        rough: (4, 4) roughly ``T_base_part`` of every part.
        settings: Noise and tool.
        rough_sigma: m per axis, standard deviation of that.
        joints: Whether readings are joints of the arm.
    """
    belief = arm_belief(arm, settings) if joints else None
    size = 0 if belief is None else len(belief.root)
    numbers = {part: k for k, part in enumerate(sorted(rough))}
    T = dict(rough)
    sd = np.tile(np.repeat([rough_sigma, TURN_PER_SHIFT * rough_sigma], 3), len(rough))
    precision = np.concatenate([np.ones(size), sd**-2.0])
    start = TouchBelief(
        arm=arm, settings=settings, T_base_part=T, belief=belief, mean=np.zeros(len(precision)),
        covariance=np.diag(1.0 / precision), touches=0,
    )  # fmt: skip
    if touches is None or not len(touches):
        return start
    in_base = tips(arm, touches.joints, settings) if joints else touches.position
    at, arm_columns = start.mean, _arm_columns(start, touches)
    weights = 1.0 / _noise(start, touches)
    for _ in range(ROUNDS):
        now = replace(start, T_base_part=T, mean=at)
        rows, gap, weight = _linearise_touches(now, touches, in_base, arm_columns, weights)
        prior = np.concatenate(
            [np.zeros(size), *(_step(T[part], rough[part]) for part in sorted(rough))]
        )
        normal = np.diag(precision) + (rows * weight[:, None]).T @ rows
        at = np.linalg.solve(normal, precision * prior + rows.T @ (weight * gap))
        steps = at[size:].reshape(-1, 6)
        T = {part: displace_frame(T[part], steps[k]) for part, k in numbers.items()}
        if np.abs(steps).max() < STILL:
            break
    at[size:] = 0.0
    covariance = np.linalg.inv(normal)
    covariance = 0.5 * (covariance + covariance.T)
    return replace(start, T_base_part=T, mean=at, covariance=covariance, touches=len(touches))


def expected_readings(known: TouchBelief, touches: ProbingSet) -> ExpectedTouch:
    """Returns what touches should read that have not been made.

    Args:
        known: After the touches made.
        touches: With the joints they will have, where joints are read; of surfaces the reading is
            expected where the nominal point is touched.
    """
    columns, centre, _ = _columns(known, touches, _arm_columns(known, touches))
    noise = _noise(known, touches)
    spread = columns @ known.covariance @ np.swapaxes(columns, 1, 2)
    position = centre + columns @ known.mean
    return ExpectedTouch(position=position, covariance=spread + noise[:, None, None] * np.eye(3))


def check_reading(known: TouchBelief, touch: ProbingSet) -> CheckedTouch:
    """Returns the deviation of a reading from its expectation.

    Args:
        known: After the touches before it.
        touch: One touch, with the joints or the position that was read.
    """
    has_arm = known.belief is not None or touch.has_joints
    tip = tips(known.arm, touch.joints, known.settings) if has_arm else touch.position
    expected = expected_readings(known, touch)
    off = tip[0] - expected.position[0]
    if touch.full[0]:
        square = float(off @ np.linalg.solve(expected.covariance[0], off))
        return CheckedTouch(off=off, sigmas=float(np.sqrt(square)))
    normal = known.T_base_part[int(touch.part[0])][:3, :3] @ touch.normal[0]
    along = float(off @ normal)
    sd = float(np.sqrt(normal @ expected.covariance[0] @ normal))
    return CheckedTouch(off=along * normal, sigmas=abs(along) / sd)


def machined_radius(known: TouchBelief, places: ProbingSet) -> Array:
    """Returns the 95 % bound (n,) m on the errors of points machined at places.

    With joints frame and arm together, of a run compensated by the touches; without, the frame's
    share alone.

    Args:
        known: After some touches.
        places: Nominal points and the joints they are machined with.
    """
    columns, _, _ = _columns(known, places, _arm_columns(known, places))
    covariance = columns @ known.covariance @ np.swapaxes(columns, 1, 2)
    belief = known.belief
    if belief is not None:
        rest = _visit(known, belief, places)
        covariance = covariance + rest[:, None, None] * np.eye(3)
    return np.asarray(REGION * np.sqrt(np.linalg.eigvalsh(covariance)[:, -1]))


def _step(T: Array, to: Array) -> Array:
    """The step (6,) from one frame to another: origin, left rotation vector."""
    turn = rotation_vector_from_matrix(to[:3, :3] @ T[:3, :3].T)
    return np.concatenate([to[:3, 3] - T[:3, 3], turn])


def _arm_columns(known: TouchBelief, touches: ProbingSet) -> Array:
    """Returns the derivative (n, 3, k) of the readings by the arm's unknowns; k is 0 without."""
    belief = known.belief
    if belief is None:
        return np.zeros((len(touches), 3, 0))
    query = touch_query(touches.joints, belief.robot, known.settings)
    return np.asarray(-np.sqrt(belief.inflation) * (tip_columns(belief, query) @ belief.root.T))


def _columns(
    known: TouchBelief, touches: ProbingSet, arm_columns: Array
) -> tuple[Array, Array, Array]:
    """Derivative (n, 3, k + 6 f) of the readings, the readings (n, 3) without the arm, normals."""
    parts = sorted(known.T_base_part)
    place = np.stack([known.T_base_part[int(part)] for part in touches.part])
    lever = (place[:, :3, :3] @ touches.point[:, :, None])[:, :, 0]
    normal = (place[:, :3, :3] @ np.nan_to_num(touches.normal)[:, :, None])[:, :, 0]
    centre = place[:, :3, 3] + lever + touches.radius * normal
    size = len(known.mean) - 6 * len(parts)
    out = np.zeros((len(touches), 3, len(known.mean)))
    out[:, :, :size] = arm_columns
    frame = displacement_columns(lever)
    for k, part in enumerate(parts):
        mine = touches.part == part
        first = size + 6 * k
        out[mine, :, first : first + 6] = frame[mine]
    return out, centre, normal


def _noise(known: TouchBelief, touches: ProbingSet) -> Array:
    """Variance (n,) m^2 per axis of one reading besides what is learned."""
    touch = known.settings.touch**2
    if known.belief is None:
        stated = known.settings.robot
        usual = CALIBRATED_ROBOT if known.arm.calibrated else NOMINAL_ROBOT
        return np.full(len(touches), touch + (usual if stated is None else stated) ** 2)
    return _visit(known, known.belief, touches) + touch


def _visit(known: TouchBelief, belief: Belief, touches: ProbingSet) -> Array:
    query = touch_query(touches.joints, belief.robot, known.settings)
    rest = uncarried_variance(belief, query) + belief.white**2 + belief.repeatability**2
    return np.asarray(belief.inflation * rest)


def _linearise_touches(
    known: TouchBelief, touches: ProbingSet, in_base: Array, arm_columns: Array, weight: Array
) -> tuple[Array, Array, Array]:
    """Rows (m, k + 6 f), what they read (m,), and one over their variances (m,)."""
    columns, centre, normal = _columns(known, touches, arm_columns)
    gap = in_base - centre
    full = touches.full
    rows = [columns[full].reshape(-1, columns.shape[2])]
    rows.append(np.einsum("ni,nik->nk", normal[~full], columns[~full]))
    gaps = [gap[full].reshape(-1), np.einsum("ni,ni->n", normal[~full], gap[~full])]
    weights = [np.repeat(weight[full], 3), weight[~full]]
    return np.concatenate(rows), np.concatenate(gaps), np.concatenate(weights)


Kind: TypeAlias = Literal["feature", "radians", "scale", "sign", "ball", "repeated"]
SCALES: Final[tuple[tuple[str, float], ...]] = (
    ("inch", 25.4),
    ("m", 1000.0),
    ("um", 1e-3),
)
"""Units a position may have been read in, and mm of one of them."""
SAME: Final = 1e-9
"""m and rad; closer touches are copies."""
ALONG: Final = 0.95
"""Cosine from which an offset counts as along the approach."""
BALL: Final = (0.4 * MM, 15.0 * MM)
"""Radii and lift-offs of probes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Suspicion:
    """One thing that would explain a reading.

    Attributes:
        kind: What it is.
        name: Feature that was touched, unit it was read in, number whose sign is wrong.
        length: m, signed, where it is a length.
        sigmas: What is left of the offset if it is so; NaN where nothing was tried.
    """

    kind: Kind
    name: str = ""
    length: float = float("nan")
    sigmas: float = float("nan")


def find_suspicions(
    known: TouchBelief,
    touch: ProbingSet,
    judged: CheckedTouch,
    *,
    others: ProbingSet,
    before: ProbingSet | None,
    tip_axis: Array,
) -> tuple[Suspicion, ...]:
    """Returns what would explain a reading, the best explanation first; nothing if nothing does.

    Args:
        known: After the touches before it.
        touch: The reading, one touch.
        judged: What was found of it.
        others: The other features of the part, with joints where joints are read.
        before: Readings made before.
        tip_axis: (3,) the way from the flange to the tip, in the tool frame.
    """
    tried = [*_elsewhere(known, touch, others), *_other_readings(known, touch)]
    good = [trial for trial in tried if trial.sigmas <= min(GOOD, 0.5 * judged.sigmas)]
    good.sort(key=lambda trial: trial.sigmas)
    return (*_find_repeats(touch, before), *good[:3], *_ball(known, touch, judged, tip_axis))


def _elsewhere(known: TouchBelief, touch: ProbingSet, others: ProbingSet) -> list[Suspicion]:
    out = []
    for k in range(len(others)):
        there = replace(
            touch, names=(others.names[k],), point=others.point[[k]],
            normal=others.normal[[k]], part=others.part[[k]],
        )  # fmt: skip
        sigmas = check_reading(known, there).sigmas
        out.append(Suspicion(kind="feature", name=others.names[k], sigmas=sigmas))
    return sorted(out, key=lambda each: each.sigmas)[:1]


def _other_readings(known: TouchBelief, touch: ProbingSet) -> list[Suspicion]:
    """The reading in another unit, or with the sign of one number changed."""
    values = touch.joints if touch.has_joints else touch.position
    trials: list[tuple[Kind, str, Array]] = []
    if not touch.has_joints:
        trials += [("scale", unit, factor * values) for unit, factor in SCALES]
    elif np.abs(values).max() < 2.0 * np.pi * DEG:
        trials.append(("radians", "", values / DEG))
    for k in range(values.shape[1]):
        other = values.copy()
        other[0, k] *= -1.0
        trials.append(("sign", f"{k + 1}" if touch.has_joints else "xyz"[k], other))
    read = [
        replace(touch, joints=value) if touch.has_joints else replace(touch, position=value)
        for _, _, value in trials
    ]
    return [
        Suspicion(kind=kind, name=name, sigmas=check_reading(known, reading).sigmas)
        for (kind, name, _), reading in zip(trials, read, strict=True)
    ]


def _find_repeats(touch: ProbingSet, before: ProbingSet | None) -> tuple[Suspicion, ...]:
    if before is None:
        return ()
    read, earlier = (
        (touch.joints, before.joints) if touch.has_joints else (touch.position, before.position)
    )
    same = np.flatnonzero(np.abs(earlier - read).max(axis=1) < SAME)
    return tuple(Suspicion(kind="repeated", name=before.names[k]) for k in same[:1])


def _ball(
    known: TouchBelief, touch: ProbingSet, judged: CheckedTouch, tip_axis: Array
) -> tuple[Suspicion, ...]:
    """An offset straight along the way of the approach: radius, tip length, or not at the part."""
    way = known.T_base_part[int(touch.part[0])][:3, :3] @ np.nan_to_num(touch.normal[0])
    if touch.full[0]:
        if not touch.has_joints:
            return ()
        robot = known.arm.robot.nominal()
        tool = known.settings.T_flange_tool
        robot = robot if tool is None else robot.with_tool(tool)
        way = -(forward(robot, touch.joints)[0, :3, :3] @ tip_axis)
    length = float(judged.off @ way)
    if abs(length) < ALONG * judged.distance or not BALL[0] < abs(length) < BALL[1]:
        return ()
    return (Suspicion(kind="ball", length=length),)
