"""An XYZAB head: two rotary axes that carry each other, and the tip that must not move.

A turns about x, B about y. With order ``"AB"`` A carries B and the spindle axis is
n = Rx(a) Ry(b) z; with ``"BA"`` B carries A and n = Ry(b) Rx(a) z.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.columns import Column, Columns
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ShapeError

AxisOrder: TypeAlias = Literal["AB", "BA"]
AXIS_ORDER: Final[AxisOrder] = "AB"
"""Of a head that does not state it."""
SENSE: Final = (1.0, 1.0)
"""Likewise: A and B count by the right-hand rule."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Head(Columns):
    """Rotary axes of a five-axis head.

    Attributes:
        order: Which axis carries the other: the first named carries the second.
        p_pivot_tip: (3,) m from the crossing of the axes to the tool tip, at a = b = 0; NaN where
            it is not known, and with it how X, Y and Z have to follow.
        sense: (2,) +1 or -1: what the machine counts positive against the right-hand rule.
    """

    order: AxisOrder = AXIS_ORDER
    p_pivot_tip: Annotated[Array, Column("3", unit="m", nan=True)]
    sense: tuple[float, float] = SENSE

    def _check_rules(self) -> None:
        """Checks order and sense."""
        if self.order not in ("AB", "BA"):
            raise ConfigurationError(f"axis order {self.order!r}, expected 'AB' or 'BA'.")
        if set(np.abs(self.sense)) != {1.0} or len(self.sense) != 2:
            raise ConfigurationError(f"sense of the axes is {self.sense}, expected +1 or -1 each.")


def rotation(order: AxisOrder, tilt: Array) -> Array:
    """Returns the rotation (..., 3, 3) of a head at (a, b) rad, by the right-hand rule."""
    tilt = np.asarray(tilt, dtype=np.float64)
    zero = np.zeros_like(tilt[..., 0])
    about_x = matrix_from_rotation_vector(np.stack([tilt[..., 0], zero, zero], axis=-1))
    about_y = matrix_from_rotation_vector(np.stack([zero, tilt[..., 1], zero], axis=-1))
    out: Array = about_x @ about_y if order == "AB" else about_y @ about_x
    return out


def normal_from_tilt(order: AxisOrder, tilt: Array) -> Array:
    """Returns the unit normal (..., 3) of a tilt (..., 2) = (a, b) rad."""
    tilt = np.asarray(tilt, dtype=np.float64)
    ca, sa = np.cos(tilt[..., 0]), np.sin(tilt[..., 0])
    cb, sb = np.cos(tilt[..., 1]), np.sin(tilt[..., 1])
    if order == "AB":
        return np.stack([sb, -sa * cb, ca * cb], axis=-1)
    return np.stack([ca * sb, -sa, ca * cb], axis=-1)


def tilt_from_normal(order: AxisOrder, normal: Array) -> Array:
    """Returns the tilt (..., 2) = (a, b) rad at which the spindle axis is this normal.

    Raises:
        ShapeError: A normal that points away from the spindle (z not above 0).
    """
    n = np.asarray(normal, dtype=np.float64)
    if not np.all(n[..., 2] > 0.0):
        raise ShapeError("a normal with z not above 0 is behind the foot.")
    n = n / np.linalg.norm(n, axis=-1, keepdims=True)
    x, y, z = n[..., 0], n[..., 1], n[..., 2]
    if order == "AB":
        return np.stack([np.arctan2(-y, z), np.arcsin(x)], axis=-1)
    return np.stack([np.arcsin(-y), np.arctan2(x, z)], axis=-1)


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadMove:
    """Move of the five axes that squares the spindle.

    Attributes:
        axes: (2,) rad, A and B as the machine counts them, after the move.
        turn: (2,) rad, the change of A and B.
        shift: (3,) m, the change of X, Y and Z that leaves the tip where it was; NaN without
            ``p_pivot_tip``.
    """

    axes: Array
    turn: Array
    shift: Array


def squaring_move(head: Head, axes: Array, normal: Array) -> HeadMove:
    """Returns the move that lays the spindle along the normal and leaves its tip in place.

    Args:
        head: The machine's rotary axes.
        axes: (2,) rad, A and B now, as the machine counts them.
        normal: (3,) unit, the surface's normal in the spindle's frame now.

    Raises:
        ShapeError: The normal points away from the spindle.
    """
    sense = np.asarray(head.sense, dtype=np.float64)
    now = sense * frozen(axes, (2,), "axes")
    before = rotation(head.order, now)
    after_tilt = tilt_from_normal(head.order, before @ frozen(normal, (3,), "normal"))
    after = rotation(head.order, after_tilt)
    target = sense * after_tilt
    return HeadMove(axes=target, turn=target - axes, shift=(before - after) @ head.p_pivot_tip)


def tilt_between(first: Array, second: Array) -> Array:
    """Returns the angle (...) rad between unit vectors (..., 3), exact for small angles, too."""
    cross = np.linalg.norm(np.cross(first, second), axis=-1)
    out: Array = np.arctan2(cross, np.sum(np.asarray(first) * second, axis=-1))
    return out


def gcode(move: HeadMove, *, feed_mm_per_min: float) -> str:
    """Returns the move of an XYZAB machine: relative X, Y, Z with A and B, then absolute again.

    Raises:
        ConfigurationError: X, Y and Z are not known: the tip would leave the hole.
    """
    if not np.isfinite(move.shift).all():
        raise ConfigurationError(
            "X, Y and Z of the move are unknown: the tip would leave the hole.",
            hint="give [head] pivot_to_tip_mm in the foot file and fit the model again.",
        )
    words = [f"{a}{v / MM:+.4f}" for a, v in zip("XYZ", move.shift, strict=True)]
    words += [f"{a}{v / DEG:+.5f}" for a, v in zip("AB", move.turn, strict=True)]
    return f"G91\nG1 {' '.join(words)} F{feed_mm_per_min:g}\nG90\n"
