"""Compiled pose quantities of an estimate: rotations, lever arms, deflection under a wrench.

The slow wrench w = (F, M) on the tool point bends joint j of compliance c_j by c_j (a_j.F + b_j.M),
with a_j, b_j the tool point's way and turn per drive. With h_j the way at the pose of the
frequency response, turned along with its axes::

    K_j = a_j (own a_j, b_j)^T - h_j (h_j, 0)^T      added = sum_j c_j K_j w
    T   = sum_j c_j a_j (a_j, b_j)^T + R rest R^T    still = T w

``own`` is 1, or 0 where the response itself knows the arm at every pose.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robotrue.core.arrays import Array, Records
from robotrue.core.compiled import EXACT, compile_kernel
from robotrue.robot.chain import ORIGIN
from robotrue.robot.chain_kernels import walk, write_jacobian

BASE, TOOL, SENSOR = 0, 1, 2
"""Frames a force comes in."""


class Constants(NamedTuple):
    """Models as the kernels take them.

    Attributes:
        links: (1,) of ``links_dtype``, up to the tool.
        chain: (1,) of ``chain_dtype``, work space.
        zero_angle: (dof,) rad of the DH table.
        joint_map: (dof, dof).
        limits: (dof, 2) rad.
        T_tool_sensor: (4, 4) m.
        weight: (3,) N of the held tool, in base.
        centre: (3,) m of it, in the sensor.
        force_offset: (3,) N of the sensor.
        moment_offset: (3,) N m.
        compliance: (dof,) rad/(N m).
        covariance: (dof, dof).
        home: (dof,) rad, pose of the response; NaN without.
        home_jacobian: (3, dof) m/rad at it, in the response's axes; zero without.
        rest: (3, 3) m/N in the response's axes: its static deflection less that of the arm there.
        learned_compliance: (dof,) rad/(N m), compliance times the learned factor.
        learned_tool: (3,) m/N of the tool along the learned direction.
        direction: (3,) base, unit; zero without a learned deviation.
        force_low: (3,) N, lowest force the deviation was learned from.
        force_high: (3,) N, highest.
        own: 1 where the arm's compliance is added to the response, 0 where it is in it.
        turns: Whether the response turns with the tool.
        zero_sd: N, standard deviation of the sensor's zero.
        projected: Whether what the joints are unsure of counts only across ``direction``.
    """

    links: Records
    chain: Records
    zero_angle: Array
    joint_map: Array
    limits: Array
    T_tool_sensor: Array
    weight: Array
    centre: Array
    force_offset: Array
    moment_offset: Array
    compliance: Array
    covariance: Array
    home: Array
    home_jacobian: Array
    rest: Array
    learned_compliance: Array
    learned_tool: Array
    direction: Array
    force_low: Array
    force_high: Array
    own: float
    turns: bool
    zero_sd: float
    projected: bool


@compile_kernel(EXACT)
def walk_drives(
    joints: Array, zero_angle: Array, joint_map: Array, links: np.record, chain: np.record
) -> None:
    """Walks a chain at drive joints (dof,) rad."""
    for i in range(len(joints)):
        theta = zero_angle[i]
        for j in range(len(joints)):
            theta += joint_map[i, j] * joints[j]
        chain.theta[i] = theta
    walk(links, chain)


@compile_kernel(EXACT)
def write_pose(joints: Array, frame: int, c: Constants, poses: Records) -> None:
    """Writes the numbers of a pose.

    Args:
        joints: (dof,) rad.
        frame: BASE, TOOL or SENSOR: axes of the force that comes.
        c: Models.
        poses: (1,) of ``POSE_DTYPE``: ``read`` rotation of the force's axes in base; ``lever`` m
            from its origin to the tool point, base; ``turned`` rotation of the response's axes;
            ``added``, ``still`` m/N and m/(N m); ``physics`` m/N along the learned direction;
            ``spread`` variance per wrench squared; ``zero`` m^2.
    """
    n, chain, pose = len(joints), c.chain[0], poses[0]
    walk_drives(joints, c.zero_angle, c.joint_map, c.links[0], chain)
    write_jacobian(chain)
    tool = chain.frame[n]
    for r in range(3):
        pose.lever[r] = 0.0
        for k in range(3):
            same = 1.0 if r == k else 0.0
            pose.turned[r, k] = tool[r, k] if c.turns else same
            pose.read[r, k] = same
            if frame == TOOL:
                pose.read[r, k] = tool[r, k]
            elif frame == SENSOR:
                pose.lever[r] -= tool[r, k] * c.T_tool_sensor[k, ORIGIN]
                pose.read[r, k] = 0.0
                for a in range(3):
                    pose.read[r, k] += tool[r, a] * c.T_tool_sensor[a, k]
    twist = np.zeros((n, 6))  # of the tool per drive
    for k in range(n):
        for j in range(n):
            for r in range(6):
                twist[j, r] += c.joint_map[k, j] * chain.jacobian[r, k]
    _write_bending(n, c, twist, pose)


@compile_kernel(EXACT)
def _write_bending(n: int, c: Constants, twist: Array, pose: np.record) -> None:
    """Writes added, still, physics, spread and zero from the tool's twist per drive (n, 6)."""
    d = c.direction
    pose.added[:], pose.still[:], pose.physics[:] = 0.0, 0.0, 0.0
    pose.spread[:], pose.zero[:] = 0.0, 0.0
    push, home = np.zeros((n, 3, 6)), np.zeros((n, 3))
    for j in range(n):
        along = d[0] * twist[j, 0] + d[1] * twist[j, 1] + d[2] * twist[j, 2]
        for r in range(3):
            pose.physics[r] += c.learned_compliance[j] * along * twist[j, r]
            for k in range(3):
                home[j, r] += pose.turned[r, k] * c.home_jacobian[k, j]
        for r in range(3):
            for k in range(6):
                size = twist[j, r] * twist[j, k]
                pose.still[r, k] += c.compliance[j] * size
                if k < 3:
                    size = c.own * size - home[j, r] * home[j, k]
                push[j, r, k] = size
                pose.added[r, k] += c.compliance[j] * size
        if c.projected:
            for k in range(6):
                size = d[0] * push[j, 0, k] + d[1] * push[j, 1, k] + d[2] * push[j, 2, k]
                for r in range(3):
                    push[j, r, k] -= d[r] * size
    for r in range(3):
        pose.physics[r] -= c.learned_tool[r]
        across = 1.0 - d[r] ** 2 if c.projected else 1.0
        for k in range(3):
            size = 0.0
            for a in range(3):
                for b in range(3):
                    size += pose.turned[r, a] * c.rest[a, b] * pose.turned[k, b]
            pose.still[r, k] += size
            pose.zero[r] += across * (pose.still[r, k] * c.zero_sd) ** 2
    _write_spread(n, c.covariance, push, pose)


@compile_kernel(EXACT)
def _write_spread(n: int, covariance: Array, push: Array, pose: np.record) -> None:
    """Writes the variance per wrench squared that uncertain compliances leave."""
    for i in range(n):
        for j in range(n):
            size = covariance[i, j]
            if size != 0.0:
                for r in range(3):
                    for a in range(6):
                        for b in range(6):
                            pose.spread[r, a, b] += size * push[i, r, a] * push[j, r, b]
