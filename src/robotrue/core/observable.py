"""Motions of a part that its probing points leave undetermined."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import apply, inverse
from robotrue.core.units import MM
from robotrue.errors import ObservabilityError

WEAKEST: Final = 20.0
"""A motion known this many times worse than one touch, at the size of the pattern, is not known."""


def check_motions(centre: Array, normal: Array, T_base_part: Array) -> None:
    """Passes if the touches hold the part.

    Args:
        centre: (n, 3) m in base, the touches.
        normal: (n, 3) in base.
        T_base_part: (4, 4), to name the motion in part axes.

    Raises:
        ObservabilityError: A motion is free or nearly so; names it in part coordinates.
    """
    values, motions, size = motion_strengths(centre, normal)
    loose = values < 1.0 / WEAKEST
    if not loose.any():
        return
    named = _plain(motions[loose], T_base_part[:3, :3])
    scaled = np.hstack([normal, np.cross(centre - centre.mean(axis=0), normal) / size])
    listed = "; ".join(
        f"{_describe_motion(motion, size, centre.mean(axis=0), T_base_part)} "
        f"({_strength(float(np.linalg.norm(scaled @ motion)))})"
        for motion in named
    )
    raise ObservabilityError(
        f"{len(centre)} touches do not locate the part. Undetermined, in part axes: {listed}. "
        f"Allowed is {WEAKEST:.0f} times one touch.",
        hint="probe a face whose normal that motion changes, far from the others.",
    )


def motion_strengths(centre: Array, normal: Array) -> tuple[Array, Array, float]:
    """Returns singular values (6,), motions (6, 6) as rows, and the pattern's size in m.

    A motion is (shift of the touches' centroid, rotation vector times size) in base; a value is the
    change of the distances per unit of it, as a root of the sum of squares.
    """
    middle = centre.mean(axis=0)
    size = float(np.sqrt(((centre - middle) ** 2).sum(axis=1).mean()))
    size = max(size, np.finfo(float).tiny)
    scaled = np.hstack([normal, np.cross(centre - middle, normal) / size])
    _, values, motions = np.linalg.svd(scaled, full_matrices=True)
    full = np.zeros(6)
    full[: len(values)] = values
    return full, motions, size


def _plain(free: Array, R_base_part: Array) -> list[Array]:
    """Returns the same motions as shifts first, then turns, each near a part axis if it can be."""
    u, strength, _ = np.linalg.svd(free[:, 3:])
    mixed = u.T @ free
    still = np.concatenate([strength, np.zeros(len(mixed))])[: len(mixed)] < 1e-3
    out: list[Array] = []
    for group, columns in ((mixed[still], slice(0, 3)), (mixed[~still], slice(3, 6))):
        left = group
        while len(left):
            # Along the part axis this set of motions reaches best; what is left is orthogonal.
            along = left[:, columns] @ R_base_part
            best = int(np.argmax(np.linalg.norm(along, axis=0)))
            motion = along[:, best] @ left
            motion = motion / np.linalg.norm(motion)
            out.append(motion)
            kept = np.linalg.svd(left - np.outer(left @ motion, motion))[2]
            left = kept[: len(left) - 1]
    return out


def _strength(value: float) -> str:
    return "free" if value < 1e-5 else f"{1.0 / value:.0f} times one touch"


def _describe_motion(motion: Array, size: float, middle: Array, T_base_part: Array) -> str:
    R = T_base_part[:3, :3]
    shift, turn = R.T @ motion[:3], R.T @ motion[3:] / size
    rate = float(np.linalg.norm(turn))
    if rate * size < 0.1:
        axis = orient_line(shift / np.linalg.norm(shift))
        return f"shift along ({axis[0]:+.2f}, {axis[1]:+.2f}, {axis[2]:+.2f})"
    axis = turn / rate
    foot = apply(inverse(T_base_part), middle) + np.cross(turn, shift) / rate**2
    pitch = float(axis @ shift) / (rate * size)
    axis = orient_line(axis)
    x, y, z = foot / MM + 0.0
    screw = " with a shift along it" if abs(pitch) > 0.1 else ""
    return (
        f"turn about ({axis[0]:+.2f}, {axis[1]:+.2f}, {axis[2]:+.2f}) through "
        f"({x:.0f}, {y:.0f}, {z:.0f}) mm{screw}"
    )


def orient_line(axis: Array) -> Array:
    """Returns the same line with its largest component positive, zeros without a sign."""
    out: Array = np.round(axis * np.sign(axis[int(np.argmax(np.abs(axis)))]), 6) + 0.0
    return out
