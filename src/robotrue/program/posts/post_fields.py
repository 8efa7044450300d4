"""Fields of the lines of a post: their names, and their values from moves.

==================  ==============================================================================
``x y z``           mm of the tool tip in the work frame; ``xm ym zm`` in m
``a b c``           deg of its rotation, R = Rz(a) Ry(b) Rx(c)
``u v w``           deg, R = Rx(u) Ry(v) Rz(w): about x, then the new y, then the new z
``q1 q2 q3 q4``     its unit quaternion, scalar first
``rx ry rz``        rad, its rotation vector
``i j k``           unit vector from the tip to the spindle
``j1`` .. ``j6``    deg, the controller's axes; ``r1`` .. ``r6`` in rad
``n``               number of the target; ``nl`` counts straight moves alone, ``nj`` joint moves
``feed``            mm/s; ``feed_min`` mm/min, ``feed_m`` m/s
==================  ==============================================================================

``tool_`` and ``frame_`` before the first five rows is the tool in the flange and the work frame in
the robot's base.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from robotrue.core.arm_words import Maker
from robotrue.core.arrays import Array, IntArray
from robotrue.core.poses import inverse
from robotrue.core.rotations import (
    abc_from_matrix,
    quat_wxyz_from_matrix,
    rotation_vector_from_matrix,
)
from robotrue.core.units import DEG, MM

PLACE: Final = ("x", "y", "z", "xm", "ym", "zm")
ROTATION: Final = ("a", "b", "c", "u", "v", "w", "q1", "q2", "q3", "q4", "rx", "ry", "rz")
AXIS: Final = ("i", "j", "k")
AXES: Final = tuple(f"{letter}{axis}" for letter in "jr" for axis in range(1, 7))
COUNTS: Final = ("n", "nl", "nj")
FEED: Final = ("feed", "feed_min", "feed_m")
TOOL: Final = tuple(f"tool_{name}" for name in PLACE + ROTATION)
FRAME: Final = (*(f"frame_{name}" for name in PLACE + ROTATION), "frame_n")
JOB: Final = ("blend", "blend_m", "joint_percent", "targets", "straight", "joint")
WORDS_OF: Final[dict[Maker, tuple[str, ...]]] = {
    "": (),
    "kuka": ("status", "turn"),
    "abb": ("cf1", "cf4", "cf6", "cfx"),
    "fanuc": ("flip", "up", "front", "turn4", "turn5", "turn6"),
    "yaskawa": ("no_flip", "lower", "rear", "beyond_r", "beyond_t", "beyond_s"),
}
"""Fields of configuration words, in the order of :mod:`robotrue.core.arm_words`."""


def pose_values(T: Array, names: frozenset[str], prefix: str = "") -> dict[str, Array]:
    """Returns the values (n,) of the fields of poses (n, 4, 4) m that a post names."""
    position, rotation = T[:, :3, 3], T[:, :3, :3]
    families: tuple[tuple[tuple[str, ...], Callable[[], Array]], ...] = (
        (PLACE[:3], lambda: position / MM),
        (PLACE[3:], lambda: position),
        (ROTATION[:3], lambda: abc_from_matrix(rotation) / DEG),
        (ROTATION[3:6], lambda: -abc_from_matrix(np.swapaxes(rotation, 1, 2))[:, ::-1] / DEG),
        (ROTATION[6:10], lambda: quat_wxyz_from_matrix(rotation)),
        (ROTATION[10:], lambda: rotation_vector_from_matrix(rotation)),
    )
    values: dict[str, Array] = {}
    for family, compute in families:
        named = [f"{prefix}{name}" for name in family]
        if names.intersection(named):
            values |= dict(zip(named, compute().T, strict=True))
    return values


def axes_values(axes: Array) -> dict[str, Array]:
    """Returns the values (n,) of the fields of the controller's axes (n, 6) rad."""
    return dict(zip(AXES, [*(axes / DEG).T, *axes.T], strict=True))


def word_values(
    words: IntArray, maker: Maker, spelled: dict[str, tuple[str, ...]]
) -> dict[str, Array | Sequence[str]]:
    """Returns the values (n,) of configuration words (n, w), as a post spells them."""
    values: dict[str, Array | Sequence[str]] = {}
    for name, column in zip(WORDS_OF[maker], words.T, strict=True):
        letters = spelled.get(name)
        numbers = column.astype(np.float64)
        values[name] = numbers if letters is None else [letters[k] for k in column.tolist()]
    return values


def feed_values(feed: Array) -> dict[str, Array]:
    """Returns the values (n,) of the fields of a feed (n,) m/s."""
    return dict(zip(FEED, (feed / MM, feed / MM * 60.0, feed), strict=True))


def part_poses(T_base_part: Array, T_base_tool: Array) -> Array:
    """Returns poses (n, 4, 4) of the tool in the work frame."""
    return np.asarray(inverse(T_base_part) @ T_base_tool)
