"""Values of many samples checked at once: as ``JointSample`` and ``ForceSample`` check one."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.online.samples import FARTHEST, MOST_TURNS, STRONGEST, Flag


def checked_wrench(wrench: Array, flags: IntArray) -> tuple[Array, IntArray]:
    """Returns wrenches (n, 6) with NaN for what no sensor gives, and the flags (n,) with it.

    Torques that are all NaN were not measured: no fault.
    """
    size = np.abs(wrench)
    if (size <= STRONGEST).all():
        return wrench, flags
    measured = np.ones(wrench.shape, dtype=bool)
    measured[:, 3:] = ~np.isnan(wrench[:, 3:]).all(axis=1, keepdims=True)
    return _checked(wrench, size, STRONGEST, measured, flags)


def checked_joints(joints: Array, flags: IntArray) -> tuple[Array, IntArray]:
    """Returns joints (n, dof) rad with NaN for what no arm has, and the flags (n,) with it."""
    size = np.abs(joints)
    if (size <= MOST_TURNS).all():
        return joints, flags
    return _checked(joints, size, MOST_TURNS, np.ones(joints.shape, dtype=bool), flags)


def checked_poses(poses: Array, flags: IntArray) -> tuple[Array, IntArray]:
    """Returns poses (n, 4, 4) m, known whole or NaN whole, and the flags (n,) with it."""
    if (np.abs(poses) <= FARTHEST).all():  # as nearly all are; no entry of a rotation is larger
        return poses, flags
    known = ~np.isnan(poses).all(axis=(1, 2))
    finite = np.isfinite(poses).all(axis=(1, 2))
    near = finite & ~(np.abs(poses[:, :3, 3]).max(axis=1) > FARTHEST)
    flags = flags | np.where(known & ~finite, int(Flag.NOT_FINITE), 0)
    flags = flags | np.where(finite & ~near, int(Flag.IMPLAUSIBLE), 0)
    if (near | ~known).all():
        return poses, flags
    return np.where(near[:, None, None], poses, np.nan), flags


def _checked(
    values: Array, size: Array, most: float | Array, measured: BoolArray, flags: IntArray
) -> tuple[Array, IntArray]:
    finite = np.isfinite(values)
    strange = (measured & ~finite).any(axis=1)
    large = (measured & finite & (size > most)).any(axis=1)
    flags = flags | np.where(strange, int(Flag.NOT_FINITE), 0)
    flags = flags | np.where(large, int(Flag.IMPLAUSIBLE), 0)
    return np.where(size <= most, values, np.nan), flags
