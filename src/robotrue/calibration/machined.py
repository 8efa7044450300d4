"""Uncertainty of machined points: probing and machining share the errors of the arm.

The tip in the part is ``p = h(q, w, f)``: joints, the arm's errors w, the part's frame f. The
covariance of a machined point is that of its deviation from the programmed position, at one visit.

(a) The program is compensated by the model and the frame of one estimate. The remaining error
follows from the estimate's uncertainty of h::

    error = H_m d[w, f]            covariance = H_m S H_m' + rest,   H_m = [J_m, -G] in the part

with S the *joint* posterior: arm and frame are strongly correlated, and it is this correlation that
makes a probed side better known than the arm itself.

(b) The model stays as it was and the frame is a least-squares fit to the touches,
``step of the frame = L (touch errors)``::

    M = J_m - G L J_p              covariance = M S M' + G L N L' G' + rest

with S the covariance of the arm (a nominal one or a calibrated one), N the noise of the touches.
Errors that touching and machining share cancel in M only where both postures are alike: a side that
was not probed keeps the whole error of the arm.

``rest`` differs from visit to visit: repeatability, learned white noise, and the part of a smooth
residual that the centres do not carry.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

from robotrue.calibration.arm import parts_of, prepare_arm
from robotrue.calibration.belief import Belief
from robotrue.calibration.model import Query
from robotrue.calibration.parameters import ParameterLayout
from robotrue.calibration.probing import ProbingEstimate
from robotrue.calibration.terms.term import ArmPostures
from robotrue.core.arrays import Array, IntArray, frozen
from robotrue.core.rotations import skew
from robotrue.errors import ModelMismatchError, ShapeError

ROWS: Final = 512
"""Postures linearised at a time; bounds the memory."""


def tip_columns(
    belief: Belief,
    query: Query,
    *,
    T_base_part: Mapping[int, Array] | None = None,
    part: npt.ArrayLike = 0,
    layout: ParameterLayout | None = None,
) -> Array:
    """Returns the derivative (n, 3, p) of the tip by every column of a belief, nuisances included.

    In base without frames; in the part with them. Taken at the belief's mean.

    Args:
        belief: The arm, and at its end the nuisances of the estimate.
        query: ArmPostures, loads, approach, and the tool point if it is not the touching one.
        T_base_part: (4, 4) of every frame that was estimated. Not given: none, and the columns of
            nuisances are zero.
        part: (n,) or one number: the frame each tip is seen in.
        layout: Of the nuisances; the frames in the order of their numbers if not given.

    Raises:
        ShapeError: Joints of another robot, or parts that are not one per posture.
        ModelMismatchError: A part of which the estimate has no frame, or nuisances that are not
            those of the layout.
    """
    query = query.expand(belief.robot.dof)
    n = len(query.joints)
    frames = {} if T_base_part is None else dict(T_base_part)
    placed = layout or ParameterLayout(dof=belief.robot.dof, stations=tuple(sorted(frames)))
    extra = placed.size - placed.robot_size
    if frames and extra != belief.nuisances:
        raise ModelMismatchError(
            f"the belief has {belief.nuisances} nuisance columns, its frames {extra}.",
            hint="take belief and frames from the same estimate.",
        )
    columns, tip = np.zeros((n, 3, len(belief.mean))), np.empty((n, 3))
    arm = prepare_arm(belief.actual, query.T_flange_tool, terms=belief.terms, values=belief.values)
    postures = arm.postures(query.joints, query.load, query.approach, query.conditions)
    for start in range(0, n, ROWS):
        rows = slice(start, start + ROWS)
        at = arm.linearise_at(postures.take(rows))
        columns[rows, :, : belief.end], tip[rows] = at.columns, at.tip
    number = _frame_numbers(frames, part, n)
    for k, T in frames.items():
        mine, turn = number == k, T[:3, :3].T
        columns[mine] = turn @ columns[mine]
        first = placed.blocks[f"station/{k}"].start - placed.robot_size + belief.end
        columns[mine, :, first : first + 3] = np.eye(3)
        if k not in placed.places:
            columns[mine, :, first + 3 : first + 6] = -skew(tip[mine] @ turn.T)
    return columns


def machined_covariance(
    estimate: ProbingEstimate, query: Query, *, part: npt.ArrayLike = 0
) -> Array:
    """Returns the covariance (n, 3, 3) m^2, in the part, of points run by an estimate's own model.

    Args:
        estimate: Whose arm compensates the program and whose frame places it.
        query: Postures of the machining, as commanded.
        part: Frame of each point.

    Raises:
        ShapeError: Joints of another robot, or parts that are not one per posture.
        ModelMismatchError: A part that was not touched.
    """
    return compensated_covariance(
        estimate.belief,
        query,
        T_base_part=estimate.T_base_part,
        part=part,
        layout=estimate.layout,
    )


def compensated_covariance(
    belief: Belief,
    query: Query,
    *,
    T_base_part: Mapping[int, Array] | None = None,
    part: npt.ArrayLike = 0,
    layout: ParameterLayout | None = None,
) -> Array:
    """Returns the covariance (n, 3, 3) m^2 of machined points, run compensated by this estimate.

    In the part frame; without frames, in base (a frame that is known exactly).

    Args:
        belief: Joint posterior of arm and frames.
        query: Postures of the machining, as commanded.
        T_base_part: Frames of the estimate.
        part: Frame of each point.
        layout: Of the belief's nuisances, where there are others than frames.

    Raises:
        ShapeError: As :func:`tip_columns`.
        ModelMismatchError: As :func:`tip_columns`.

    Fails when: the run is not compensated by this estimate; see :func:`unchanged_covariance`.
    """
    columns = tip_columns(belief, query, T_base_part=T_base_part, part=part, layout=layout)
    half = columns @ belief.root.T
    rest = uncarried_variance(belief, query) + belief.visit
    spread = half @ np.swapaxes(half, 1, 2)
    return np.asarray(belief.inflation * (spread + rest[:, None, None] * np.eye(3)))


def unchanged_covariance(
    belief: Belief,
    touches: Query,
    machined: Query,
    *,
    points: Array,
    T_base_part: Array,
    gain: Array,
    touch_sigma: npt.ArrayLike = 0.0,
) -> Array:
    """Returns the covariance (m, 3, 3) m^2, in the part, of points run with an unchanged model.

    Args:
        belief: Of the arm: its mean is the model that probed and that runs.
        touches: Postures of the n touches.
        machined: Postures of the m machined points.
        points: (m, 3) m, the machined points in the part.
        T_base_part: (4, 4) the least-squares frame.
        gain: (6, 3 n) L: the frame's step (origin, left rotation vector, base axes) per error of
            the touches, as ``frame_gain`` of the point fits gives it.
        touch_sigma: m per axis, one number or one per touch: probe and surface, without the arm.

    Raises:
        ShapeError: Arrays that do not belong together.
    """
    m, n = len(machined.joints), len(touches.joints)
    L = frozen(gain, (6, 3 * n), "gain")
    lever = frozen(points, (m, 3), "points") @ T_base_part[:3, :3].T
    G = np.concatenate([np.broadcast_to(np.eye(3), (m, 3, 3)), -skew(lever)], axis=2)
    at_touch = (tip_columns(belief, touches) @ belief.root.T).reshape(3 * n, -1)
    at_work = tip_columns(belief, machined) @ belief.root.T
    seen = at_work - G @ (L @ at_touch)
    visit = belief.inflation * belief.visit
    touch = np.broadcast_to(np.asarray(touch_sigma, dtype=np.float64), (n,))
    frame = (L * np.repeat(visit + touch**2, 3)) @ L.T
    both = belief.inflation * (seen @ np.swapaxes(seen, 1, 2))
    both = both + G @ frame @ np.swapaxes(G, 1, 2) + visit * np.eye(3)
    if belief.smooth.size:
        rest = _uncarried_beyond_frame(belief, touches, machined, G, L)
        both = both + belief.inflation * rest
    turn = T_base_part[:3, :3]
    return np.asarray(turn.T @ both @ turn)


def _uncarried_beyond_frame(
    belief: Belief, touches: Query, machined: Query, G: Array, L: Array
) -> Array:
    """(m, 3, 3) of the uncarried residual, less what the frame took of it when touching."""
    there = smooth_rest(belief, touches)
    cross = smooth_rest(belief, touches, machined)
    n = len(cross)
    lift = L.reshape(6, n, 3)
    frame = np.einsum("anx,nk,bkx->ab", lift, there, lift, optimize=True)
    taken = np.einsum("anx,nm->max", lift, cross, optimize=True)  # L cov(touch, work)
    shared = G @ taken
    here = uncarried_variance(belief, machined)[:, None, None] * np.eye(3)
    out = here - shared - np.swapaxes(shared, 1, 2) + G @ frame @ np.swapaxes(G, 1, 2)
    return np.asarray(out)


def uncarried_variance(belief: Belief, query: Query) -> Array:
    """Returns the variance (n,) m^2 per axis of the smooth residual that no centre carries."""
    out = np.zeros(len(query.joints))
    for term, values in parts_of(belief.terms, belief.values):
        effect = term.effect(belief.actual, _postures(query), values)
        if effect.uncarried is not None:
            out += effect.uncarried
        if query.T_flange_tool is not None:
            out += effect.other_tool
    return out


def smooth_rest(belief: Belief, query: Query, other: Query | None = None) -> Array:
    """Returns the covariance (n, k) m^2 per axis of the uncarried residual between postures."""
    second = query if other is None else other
    out = np.zeros((len(query.joints), len(second.joints)))
    for term in belief.terms:
        shared = term.uncarried_covariance(_postures(query), _postures(second))
        if shared is not None:
            out += shared
    if other is None:
        out[np.diag_indices(len(out))] = uncarried_variance(belief, query)
    return out


def _postures(query: Query) -> ArmPostures:
    """Postures of a query; what no parameter carries does not depend on loads."""
    return ArmPostures(
        joints=query.joints,
        torque=np.zeros_like(query.joints),
        conditions=query.conditions.spread(len(query.joints)),
    )


def _frame_numbers(frames: Mapping[int, Array], part: npt.ArrayLike, n: int) -> IntArray:
    """Number of the frame of each of n tips."""
    if not frames:
        return np.full(n, -1)
    number = np.asarray(part, dtype=np.int64)
    if number.shape not in ((), (n,)):
        raise ShapeError(f"part has shape {number.shape}, expected ({n},) or one number.")
    unknown = sorted(set(np.unique(number).tolist()) - set(frames))
    if unknown:
        raise ModelMismatchError(
            f"part {unknown[0]} was not registered; the estimate has {sorted(frames)}.",
            hint="touch that part too.",
        )
    return np.broadcast_to(number, (n,))
