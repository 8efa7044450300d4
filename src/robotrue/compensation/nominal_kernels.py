"""Nominal joints of the targets of a program, in order: closed form where the arm allows it.

Source of the closed form: Brandstoetter, Angerer, Hofbaur 2014, eq. 1-16, with the parameters of
:class:`robotrue.robot.opw.OpwGeometry`.
"""

from __future__ import annotations

import math

import numpy as np

from robotrue.compensation.status import Route
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.compiled import EXACT, compile_kernel
from robotrue.core.sines import arc_tangent
from robotrue.robot.chain import ORIGIN, Record, X, Y, Z
from robotrue.robot.chain_kernels import deviation, invert_matrix, multiply, walk, write_jacobian

SKIP, LINEAR = int(Route.SKIP), int(Route.LINEAR)
GIVEN, PASS, AXES = int(Route.GIVEN), int(Route.PASS), int(Route.AXES)
TURN = 2.0 * math.pi
NEAR = 0.3
"""rad; a smaller step cannot lead to another branch."""
OUTSIDE = 1e6
"""rad^2 added to the distance of a solution beyond a joint limit."""
STRETCHED = 1e-9
"""Sine of joint 5 below which only the sum of theta 4 and 6 exists."""
STILL = 1e-7
"""rad of joint motion that has no direction."""
ITERATIONS = 40
WIDEST_STEP = 0.3
"""rad; shorter steps stay on the branch."""


@compile_kernel(EXACT)
def write_base_targets(
    frames: Array, frame: IntArray, route: IntArray, rotation: Array, position: Array, out: Array
) -> None:
    """Writes the targets (n, 3, 4) in base.

    Args:
        frames: (f, 4, 4) work frames in base.
        frame: (n,) index of the frame.
        route: (n,) :class:`Route`.
        rotation: (n, 9) in the frame.
        position: (n, 3) m.
        out: Written.
    """
    for n in range(len(route)):
        if route[n] == SKIP or route[n] == PASS or route[n] == AXES:
            continue
        T = frames[frame[n]]
        for r in range(3):
            a, b, c = T[r, X], T[r, Y], T[r, Z]
            for k in range(3):
                out[n, r, k] = a * rotation[n, k] + b * rotation[n, 3 + k] + c * rotation[n, 6 + k]
            out[n, r, ORIGIN] = (
                T[r, ORIGIN] + a * position[n, 0] + b * position[n, 1] + c * position[n, 2]
            )


@compile_kernel(EXACT)
def choose_joints(
    arms: Record, target: Array, route: IntArray, tool: IntArray, given: Array, state: Record,
    work: Record, joints: Array, first: int,
) -> int:  # fmt: skip
    """Writes the nominal joints (n, 6) rad of the targets from row ``first`` on, in order.

    Args:
        arms: (t,) of ``ARM_DTYPE``.
        target: (n, 3, 4) in base.
        route: (n,) :class:`Route`.
        tool: (n,).
        given: (n, 6) rad, joints where the route has them.
        state: (1,) of ``STATE_DTYPE``; changed.
        work: (1,) of ``WORK_DTYPE``.
        joints: Written; unchanged where the closed form has none.
        first: Row to begin with.

    Returns:
        The number of rows, or the row that Newton did not reach from the target before: the
        caller may set its route to ``GIVEN`` with joints, or to ``SKIP``, and go on.
    """
    at, w = state[0], work[0]
    for n in range(first, len(route)):
        if route[n] == SKIP:
            continue
        arm = arms[tool[n]]
        if route[n] == GIVEN or route[n] == PASS or route[n] == AXES:
            for k in range(6):
                w.joints[k] = given[n, k]
            at.shoulder = 0
        else:
            for r in range(3):
                for k in range(4):
                    w.target[r, k] = target[n, r, k]
            if arm.closed.exists:
                free = route[n] != LINEAR or at.reached == 0
                if not _closed_joints(arm, w, at, free):
                    continue
            elif not _iterated_joints(arm, w, at.near):
                return n
        at.reached = 1
        for k in range(6):
            at.near[k] = joints[n, k] = w.joints[k]
    return len(route)


@compile_kernel(EXACT)
def _closed_joints(arm: Record, w: Record, at: Record, free: bool) -> bool:
    """Writes the joints of a target nearest to those before; False where there are none.

    Args:
        arm: Of ``ARM_DTYPE``.
        w: Working memory with the target; ``joints`` are written.
        at: State of the arm; its branch is changed.
        free: The turns may be chosen again to stay within the joint limits.
    """
    closed, theta = arm.closed, w.theta
    _write_wrist(w.target, closed.T_tool_wrist, w.hand)
    turn4 = closed.sign[3] * at.near[3] + closed.offset[3]
    if at.shoulder != 0 and not free:
        exists, rest = _write_forearm(closed, w.hand, at.shoulder, at.elbow, theta)
        if exists:
            _write_hand(w.hand, rest, at.flip, turn4, theta)
            _write_nearest(arm, theta, at.near, False, w.joints)
            widest = 0.0
            for i in range(6):
                widest = max(widest, abs(w.joints[i] - at.near[i]))
            if widest < NEAR:
                return True
    least = np.inf
    for code in range(4):
        shoulder, elbow = 1 - 2 * (code & 1), 1 - (code & 2)
        exists, rest = _write_forearm(closed, w.hand, shoulder, elbow, theta)
        # Joints 1 to 3 alone are often further away than a solution that is known.
        if not exists or _forearm_distance(arm, theta, at.near) >= least:
            continue
        first, second, third = theta[0], theta[1], theta[2]
        for flip in (1, -1):
            theta[0], theta[1], theta[2] = first, second, third
            _write_hand(w.hand, rest, flip, turn4, theta)
            distance = _write_nearest(arm, theta, at.near, free, w.trial)
            if distance < least - 1e-12:
                least = distance
                at.shoulder, at.elbow, at.flip = shoulder, elbow, flip
                for i in range(6):
                    w.joints[i] = w.trial[i]
    return least < np.inf


@compile_kernel(EXACT)
def _write_wrist(target: Array, T_tool_wrist: Array, hand: Array) -> None:
    """Writes the wrist flange in base (3, 4)."""
    for r in range(3):
        a, b, c = target[r, X], target[r, Y], target[r, Z]
        for k in range(4):
            hand[r, k] = a * T_tool_wrist[X, k] + b * T_tool_wrist[Y, k] + c * T_tool_wrist[Z, k]
        hand[r, ORIGIN] += target[r, ORIGIN]


@compile_kernel(EXACT)
def _write_forearm(
    g: Record, hand: Array, shoulder: int, elbow: int, theta: Array
) -> tuple[bool, tuple[float, float, float, float]]:
    """Writes theta_opw 1 to 3, rad, of one of four branches.

    Args:
        g: Of ``CLOSED_FORM_DTYPE``.
        hand: (3, 4) wrist flange in base, z along axis 6.
        shoulder: +1 facing the target, -1 reaching over the back.
        elbow: +1 or -1, the two sides of the elbow.
        theta: Written.

    Returns:
        Whether the branch exists; sine and cosine of theta 1, and of theta 2 + 3.
    """
    nothing = (0.0, 1.0, 0.0, 1.0)
    x = hand[X, ORIGIN] - g.c4 * hand[X, Z]
    y = hand[Y, ORIGIN] - g.c4 * hand[Y, Z]
    z = hand[Z, ORIGIN] - g.c4 * hand[Z, Z]
    flat2 = x * x + y * y
    if flat2 < g.b * g.b:
        return False, nothing
    ahead = shoulder * math.sqrt(flat2 - g.b * g.b)
    sine1, cosine1 = 0.0, 1.0
    if flat2 > 0.0:
        sine1, cosine1 = (y * ahead - x * g.b) / flat2, (x * ahead + y * g.b) / flat2
    ahead, up = ahead - g.a1, z - g.c1
    fore2, s2 = g.a2 * g.a2 + g.c3 * g.c3, ahead * ahead + up * up
    fore, s = math.sqrt(fore2), math.sqrt(s2)
    cosine_lift = (s2 + g.c2 * g.c2 - fore2) / (2.0 * s * g.c2)
    cosine_bend = (s2 - g.c2 * g.c2 - fore2) / (2.0 * g.c2 * fore)
    if not (abs(cosine_lift) < 1.0 + 1e-12 and abs(cosine_bend) < 1.0 + 1e-12):
        return False, nothing
    cosine_lift = min(1.0, max(-1.0, cosine_lift))
    cosine_bend = min(1.0, max(-1.0, cosine_bend))
    sine_lift = elbow * math.sqrt((1.0 - cosine_lift) * (1.0 + cosine_lift))
    sine_bend = elbow * math.sqrt((1.0 - cosine_bend) * (1.0 + cosine_bend))
    sine2 = (ahead * cosine_lift - up * sine_lift) / s
    cosine2 = (up * cosine_lift + ahead * sine_lift) / s
    sine3 = (sine_bend * g.c3 - cosine_bend * g.a2) / fore
    cosine3 = (cosine_bend * g.c3 + sine_bend * g.a2) / fore
    theta[0] = arc_tangent(sine1, cosine1)
    theta[1] = arc_tangent(sine2, cosine2)
    theta[2] = arc_tangent(sine3, cosine3)
    s23, c23 = sine2 * cosine3 + cosine2 * sine3, cosine2 * cosine3 - sine2 * sine3
    return True, (sine1, cosine1, s23, c23)


@compile_kernel(EXACT)
def _write_hand(
    hand: Array, forearm: tuple[float, float, float, float], flip: int, turn4: float, theta: Array
) -> None:
    """Writes theta_opw 4 to 6, rad.

    Args:
        hand: (3, 4) wrist flange in base, z along axis 6.
        forearm: Of :func:`_write_forearm`.
        flip: +1 or -1, sign of theta 5.
        turn4: rad, theta 4 to take where the wrist is stretched and only theta 4 + 6 exists.
        theta: Written.
    """
    sine1, cosine1, s23, c23 = forearm
    # Rows of (Rz(theta1) Ry(theta2 + theta3))^T times the columns of the hand.
    ahead = cosine1 * hand[X, Z] + sine1 * hand[Y, Z]
    m13 = c23 * ahead - s23 * hand[Z, Z]
    m23 = cosine1 * hand[Y, Z] - sine1 * hand[X, Z]
    m33 = s23 * ahead + c23 * hand[Z, Z]
    m31 = s23 * (cosine1 * hand[X, X] + sine1 * hand[Y, X]) + c23 * hand[Z, X]
    m32 = s23 * (cosine1 * hand[X, Y] + sine1 * hand[Y, Y]) + c23 * hand[Z, Y]
    sine5 = math.sqrt(m13 * m13 + m23 * m23)
    theta[4] = arc_tangent(flip * sine5, m33)
    if sine5 > STRETCHED:
        theta[3] = arc_tangent(flip * m23, flip * m13)
        theta[5] = arc_tangent(flip * m32, -flip * m31)
        return
    m11 = c23 * (cosine1 * hand[X, X] + sine1 * hand[Y, X]) - s23 * hand[Z, X]
    m21 = cosine1 * hand[Y, X] - sine1 * hand[X, X]
    theta[3] = turn4
    theta[5] = arc_tangent(m21, m11) - turn4 if m33 > 0.0 else arc_tangent(-m21, -m11) + turn4


@compile_kernel(EXACT)
def _forearm_distance(arm: Record, theta: Array, near: Array) -> float:
    """Returns the least squared distance, rad^2, that joints 1 to 3 can have; 0 if coupled."""
    distance = 0.0
    if not arm.coupled:
        for i in range(3):
            gap = arm.closed.sign[i] * (theta[i] - arm.closed.offset[i]) - near[i]
            gap -= TURN * math.floor(gap / TURN + 0.5)
            distance += gap * gap
    return distance


@compile_kernel(EXACT)
def _write_nearest(arm: Record, theta: Array, near: Array, free: bool, joints: Array) -> float:
    """Writes q (6,) rad at the turn nearest to ``near``; returns its squared distance, rad^2.

    With ``free`` a joint beyond its limit may take another turn, and a solution that stays beyond
    is ranked after all others.
    """
    for i in range(6):
        theta[i] = arm.closed.sign[i] * (theta[i] - arm.closed.offset[i])
    multiply(arm.uncoupling, theta, joints)
    distance = 0.0
    for i in range(6):
        q = joints[i] + TURN * math.floor((near[i] - joints[i]) / TURN + 0.5)
        if free:
            low, high = arm.limits[i, 0], arm.limits[i, 1]
            if q > high and q - TURN >= low:
                q -= TURN
            elif q < low and q + TURN <= high:
                q += TURN
            if q > high or q < low:
                distance += OUTSIDE
        joints[i] = q
        distance += (q - near[i]) * (q - near[i])
    return distance


@compile_kernel(EXACT)
def _iterated_joints(arm: Record, w: Record, near: Array) -> bool:
    """Writes the joints of a target by Newton from ``near``; False if it does not arrive."""
    chain, tool = w.nominal, w.nominal.frame[6]
    for i in range(6):
        w.joints[i] = near[i]
    shift = turn = np.inf
    for _ in range(ITERATIONS):
        write_theta(arm, w)
        walk(arm.nominal, chain)
        shift, turn = deviation(tool, w.target, w.error)
        if shift < 1e-12 and turn < 1e-12:
            return True
        write_jacobian(chain)
        write_drive_jacobian(arm, chain.jacobian, w)
        if not invert_matrix(w.jacobian, w.pivot, w.inverse):
            return False
        write_step(arm, w)
        widest = 0.0
        for i in range(6):
            widest = max(widest, abs(w.step[i]))
        damping = min(1.0, WIDEST_STEP / widest) if widest > 0.0 else 1.0
        for i in range(6):
            w.joints[i] -= damping * w.step[i]
        if widest < 1e-13:
            break
    return shift < 1e-9 and turn < 1e-9


@compile_kernel(EXACT)
def write_theta(arm: Record, w: Record) -> None:
    """Writes the angles of the nominal chain from the joints."""
    multiply(arm.coupling, w.joints, w.nominal.theta)
    for i in range(6):
        w.nominal.theta[i] += arm.zero[i]


@compile_kernel(EXACT)
def write_drive_jacobian(arm: Record, jacobian: Array, w: Record) -> None:
    """Writes dx/dshift (6, 6) on the drive side, linear rows divided by ``length``."""
    for r in range(6):
        unit = 1.0 / arm.length if r < 3 else 1.0
        for i in range(6):
            total = 0.0
            for k in range(6):
                total += jacobian[r, k] * arm.coupling[k, i]
            w.jacobian[r, i] = total * unit


@compile_kernel(EXACT)
def write_step(arm: Record, w: Record) -> None:
    """Writes the Newton step (6,) rad: inverse Jacobian times the error."""
    for r in range(3):
        w.error[r] /= arm.length
    multiply(w.inverse, w.error, w.step)


@compile_kernel(EXACT)
def follow_joints(
    nominal: Array, route: IntArray, reached: bool, follow_approach: bool, max_joint_step: float,
    state: Record, approach: Array, jump: BoolArray,
) -> None:  # fmt: skip
    """Writes the sign of the last motion of every joint, and where a straight move jumps.

    Args:
        nominal: (n, 6) rad, NaN where the arm does not go.
        route: (n,) :class:`Route`.
        reached: The arm has been at a target before these.
        follow_approach: Otherwise every sign is 0, unknown.
        max_joint_step: rad.
        state: (1,) of ``STATE_DTYPE``; its ``joints`` and ``sign`` are changed.
        approach: (n, 6), written.
        jump: (n,), written.
    """
    joints, sign = state[0].joints, state[0].sign
    for n in range(len(route)):
        if route[n] == SKIP or not nominal[n, 0] == nominal[n, 0]:
            continue
        widest = 0.0
        for k in range(6):
            change = nominal[n, k] - joints[k]
            widest = max(widest, abs(change))
            if not follow_approach or not reached:
                sign[k] = 0.0
            elif abs(change) > STILL:
                sign[k] = 1.0 if change > 0.0 else -1.0
            joints[k] = nominal[n, k]
            approach[n, k] = sign[k]
        jump[n] = route[n] == LINEAR and reached and widest > max_joint_step
        reached = True
