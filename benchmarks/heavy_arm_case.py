"""The synthetic heavy arm of the peer comparison, rebuilt without any method of the library.

The truth lies inside the joint-spring class with exact masses: a best case, and simulated.
Its published sizes come out to all printed digits, mean / max in mm: nominal error 3.497 / 8.055
(3.42 / 7.77 under force), gravity sag 2.890 / 4.815, force effect 0.845 / 2.134. The readings that
do it, where the description leaves a choice: the wrist test of a pose is on the origin of frame 6,
beta turns before the shift along a, and torques are those of the true arm on a level base.
Kinematics and statics are written out here in plain NumPy, so that truth and method are two codes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

A = np.array([0.0, 0.330, 1.150, 0.115, 0.0, 0.0])
D = np.array([0.645, 0.0, 0.0, 1.220, 0.0, 0.240])
ALPHA = np.array([0.0, -np.pi / 2, 0.0, -np.pi / 2, np.pi / 2, -np.pi / 2])
THETA = np.array([0.0, 0.0, -np.pi / 2, 0.0, 0.0, np.pi])
MASS = 0.4 * np.array([250.0, 180.0, 120.0, 40.0, 20.0, 10.0])
COM = np.array(
    [[0, 0, -0.1], [0.45, 0, 0.1], [0.1, 0.05, 0.1], [0, 0, -0.3], [0, 0, 0], [0, 0, -0.05]],
    dtype=np.float64,
)
PAYLOAD_MASS = 60.0
PAYLOAD_COM = np.array([0.05, 0.0, 0.15])
TOOL = np.array([0.08, 0.05, 0.30])
STIFFNESS = 1e6 * np.array([2.5, 2.2, 1.8, 0.4, 0.35, 0.25])
GRAVITY = np.array([0.0, 0.0, -9.81])
TRACKER = np.array([3.5, -3.0, 1.2])
REPEATABILITY_SD = 0.03e-3 / np.sqrt(3.0)
FORCE = np.array([0.0, 300.0, -150.0])
LIMITS = np.deg2rad([[-120, 120], [-100, -25], [-10, 110], [-150, 150], [-100, 100], [-170, 170]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """Modified-DH numbers of one arm; ``base`` is (4, 4), the rest (6,), tool (3,).

    ``mass`` (6,) kg and ``com`` (6, 3) m are those of its links.
    """

    a: Array
    d: Array
    alpha: Array
    theta: Array
    beta: Array
    tool: Array
    base: Array
    mass: Array = field(default_factory=lambda: MASS)
    com: Array = field(default_factory=lambda: COM)


def nominal_arm() -> Arm:
    return Arm(a=A, d=D, alpha=ALPHA, theta=THETA, beta=np.zeros(6), tool=TOOL, base=np.eye(4))


def true_arm() -> Arm:
    rng = np.random.default_rng(7)
    a = A + rng.normal(0, 0.4e-3, 6)
    d = D + rng.normal(0, 0.4e-3, 6)
    alpha = ALPHA + rng.normal(0, 3.5e-4, 6)
    theta = THETA + rng.normal(0, 3.5e-4, 6)
    beta = np.zeros(6)
    beta[2] = rng.normal(0, 3e-4)
    tool = TOOL + rng.normal(0, 0.3e-3, 3)
    base = _turn(0, np.array([1e-3]))[0] @ _turn(2, np.array([1.5e-3]))[0]
    base[:3, 3] = [0.8e-3, -0.6e-3, 0.5e-3]
    return Arm(a=a, d=d, alpha=alpha, theta=theta, beta=beta, tool=tool, base=base)


def frames(arm: Arm, q: Array) -> Array:
    """Link frames (n, 6, 4, 4) in the tracker's world, base error included."""
    out = np.empty((len(q), 6, 4, 4))
    T = np.broadcast_to(arm.base, (len(q), 4, 4))
    one = np.ones(len(q))
    for i in range(6):
        T = T @ _turn(0, arm.alpha[i] * one) @ _turn(1, arm.beta[i] * one) @ _shift(0, arm.a[i])
        T = T @ _turn(2, q[:, i] + arm.theta[i]) @ _shift(2, arm.d[i])
        out[:, i] = T
    return out


def points(
    arm: Arm, q: Array, compliance: Array | None = None, force: Array | None = None
) -> Array:
    """Tool point (n, 3) m; deflection = compliance * torque at the unloaded posture."""
    if compliance is not None:
        q = q + compliance * torque(arm, q, np.zeros(3) if force is None else force)
    last = frames(arm, q)[:, -1]
    return last[:, :3, :3] @ arm.tool + last[:, :3, 3]


def torque(arm: Arm, q: Array, force: Array) -> Array:
    """Gravity, payload and force at the tool about every axis (n, 6), N m.

    The base stands level here: its 1 mrad belongs to the instrument's alignment.
    """
    T = frames(replace(arm, base=np.eye(4)), q)
    where = [T[:, k, :3, :3] @ arm.com[k] + T[:, k, :3, 3] for k in range(6)]
    where.append(T[:, 5, :3, :3] @ PAYLOAD_COM + T[:, 5, :3, 3])
    weight = [m * GRAVITY for m in (*arm.mass, PAYLOAD_MASS)]
    carried = [*range(6), 5]
    where.append(T[:, 5, :3, :3] @ arm.tool + T[:, 5, :3, 3])
    weight.append(np.asarray(force))
    carried.append(5)
    out = np.zeros((len(q), 6))
    for i in range(6):
        axis, origin = T[:, i, :3, 2], T[:, i, :3, 3]
        for x, f, link in zip(where, weight, carried, strict=True):
            if link >= i:
                out[:, i] += np.einsum("nk,nk->n", axis, np.cross(x - origin, f))
    return out


def poses(count: int, seed: int = 1) -> Array:
    """The first ``count`` poses (count, 6) rad that the case keeps, drawn one by one."""
    rng = np.random.default_rng(seed)
    arm, kept = nominal_arm(), []
    while len(kept) < count:
        q = rng.uniform(LIMITS[:, 0], LIMITS[:, 1])
        wrist = frames(arm, q[None])[0, 5, :3, 3]
        if wrist[2] > 0.3 and 0.9 < np.hypot(wrist[0], wrist[1]) < 2.6:
            kept.append(q)
    return np.array(kept)


def tracker_sd(position: Array) -> Array:
    """Sd per axis (n,) m of the tracker at each point."""
    distance = np.linalg.norm(position - TRACKER, axis=1)
    return (15e-6 + 6e-6 * distance) / 2.0 / np.sqrt(3.0)


def measured(position: Array, rng: np.random.Generator) -> Array:
    sd = np.hypot(tracker_sd(position), REPEATABILITY_SD)[:, None]
    return position + sd * rng.standard_normal(position.shape)


def _turn(axis: int, angle: Array) -> Array:
    out = np.tile(np.eye(4), (len(angle), 1, 1))
    j, k = (axis + 1) % 3, (axis + 2) % 3
    out[:, j, j] = out[:, k, k] = np.cos(angle)
    out[:, k, j] = np.sin(angle)
    out[:, j, k] = -np.sin(angle)
    return out


def _shift(axis: int, length: float) -> Array:
    out = np.eye(4)
    out[axis, 3] = length
    return out
