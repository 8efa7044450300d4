"""The order of a plan: short travel from pose to pose.

The time from one pose to the next is taken as that of the joint that moves furthest, all joints
equally fast (PTP motion starts and ends all axes together).
"""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array, IntArray


def travel(joints: Array) -> float:
    """Returns the sum in rad of the largest joint move from each pose to the next."""
    return float(np.abs(np.diff(joints, axis=0)).max(axis=1).sum()) if len(joints) > 1 else 0.0


def short_order(joints: Array) -> IntArray:
    """Returns an order (n,) of the poses (n, dof) rad that is never longer than the one given.

    Nearest neighbour from the first pose, then 2-opt on the open path; 2-opt alone on the given
    order; the shorter of the two.
    """
    n = len(joints)
    if n < 3:
        return np.arange(n)
    distance = np.abs(joints[:, None] - joints[None]).max(axis=2)
    tries = [_two_opt(distance, _nearest(distance)), _two_opt(distance, np.arange(n))]
    return min(tries, key=lambda order: travel(joints[order]))


def _nearest(distance: Array) -> IntArray:
    left = np.ones(len(distance), dtype=bool)
    order = [0]
    left[0] = False
    while left.any():
        order.append(int(np.argmin(np.where(left, distance[order[-1]], np.inf))))
        left[order[-1]] = False
    return np.array(order)


def _two_opt(distance: Array, order: IntArray) -> IntArray:
    """Reverses stretches of the open path as long as that shortens it."""
    order = order.copy()
    n = len(order)
    improved = True
    while improved:
        improved = False
        for i in range(n - 1):
            for j in range(i + 1, n):
                before = distance[order[i - 1], order[i]] if i else 0.0
                after = distance[order[i - 1], order[j]] if i else 0.0
                if j < n - 1:
                    before += distance[order[j], order[j + 1]]
                    after += distance[order[i], order[j + 1]]
                if after < before - 1e-12:
                    order[i : j + 1] = order[i : j + 1][::-1]
                    improved = True
    return order
