"""Axis conventions of the makers for a six-axis arm with a spherical wrist.

In the angles of :class:`robotrue.robot.opw.OpwGeometry` (arm and forearm straight up at zero, axes
2, 3 and 5 turning forward, 1, 4 and 6 about the upward line) every arm of a maker counts alike,
whatever the zeros and senses of its DH table: ``A = sense * theta_opw + zero``. Read off the
presets and the URDF files of ros-industrial, which agree for every arm of a maker.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.rotations import wrap
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError
from robotrue.robot.model import Configuration, RobotModel
from robotrue.robot.opw import TOLERANCE, OpwGeometry, opw_geometry

MAKERS: Final = ("kuka", "abb", "fanuc", "yaskawa", "ur", "staubli")
"""Makers a cell may name."""
FROM_HORIZONTAL: Final[Array] = np.eye(6) - np.outer(np.eye(6)[2], np.eye(6)[1])
"""Fanuc's display: J3 is the angle of the forearm to the horizontal, whatever J2 is."""
_COUNTING: Final[Mapping[str, tuple[tuple[int, ...], tuple[float, ...]]]] = {
    "kuka": ((-1, 1, 1, -1, 1, -1), (0.0, -90.0, 0.0, 0.0, 0.0)),
    "abb": ((1, 1, 1, 1, 1, 1), (0.0, 0.0, -90.0, 0.0, 0.0)),
    "fanuc": ((1, 1, -1, -1, -1, -1), (0.0, 0.0, 90.0, 0.0, 0.0)),
    "yaskawa": ((1, 1, -1, -1, -1, -1), (0.0, 0.0, 90.0, 0.0, 0.0)),
}
"""Sense, and zero in deg of axes 1 to 5; that of axis 6 depends on the flange."""
_SAME: Final = 1e-4  # rad; a zero that is printed with four digits in deg is met


def count_axes(
    maker: str, dof: int, *, sign: Array | None = None, offset: Array | None = None
) -> Configuration:
    """Returns how a maker counts the axes of an arm; arguments as :func:`apply_maker`."""
    return Configuration(
        sign=np.ones(dof) if sign is None else sign,
        offset=np.zeros(dof) if offset is None else offset,
        coupling=FROM_HORIZONTAL if maker == "fanuc" and dof == 6 else np.empty((0, 0)),
    )


def apply_maker(
    robot: RobotModel, maker: str, *, sign: Array | None = None, offset: Array | None = None
) -> RobotModel:
    """Returns the arm with its maker and the way the controller counts its axes.

    Without sign and offset the axes are the joints q, which is checked against the maker's way.

    Args:
        robot: The arm.
        maker: One of ``MAKERS``.
        sign: (n,) +1 or -1 of ``A = sign * q + offset``.
        offset: (n,) rad likewise.

    Raises:
        ConfigurationError: q does not follow the maker's convention, and no other is stated.
    """
    stated = sign is not None or offset is not None
    counting = count_axes(maker, robot.dof, sign=sign, offset=offset)
    made = replace(robot, maker=maker, controller=counting)
    geometry = opw_geometry(made) if maker in _COUNTING else None
    if geometry is None:
        return made
    wrong = _otherwise(geometry, counting, maker)
    if stated:  # only axes that separate front from back must agree: an arm without a1 has no front
        over = geometry.a1 < TOLERANCE
        wrong = [axis for axis in wrong if over and axis == 1]
    if wrong:
        raise ConfigurationError(
            f"maker {maker!r}: joint{'s' * (len(wrong) > 1)} {', '.join(map(str, wrong))} of the "
            "geometry do not follow this maker's convention (sense or zero), so its configuration "
            "words would select a wrong posture.",
            hint="state what the pendant shows: axes_sign = [...] and axes_offset_deg = [...] of "
            "A = sign * q + offset.",
        )
    return made


def joints_of_posture(robot: RobotModel, kuka_axes: Array) -> Array:
    """Returns the joints q (6,) rad of the posture a KUKA arm displays as these axes (6,) rad.

    An arm of another maker has the same posture; one that is not ortho-parallel takes the values as
    its own controller's.
    """
    geometry = None if robot.maker == "kuka" else opw_geometry(robot)
    if geometry is None:
        return robot.controller.to_model(kuka_axes)
    sense, zero = _COUNTING["kuka"]
    return geometry.joints(np.array(sense) * (kuka_axes - np.array([*zero, 0.0]) * DEG))


def _otherwise(geometry: OpwGeometry, counting: Configuration, maker: str) -> list[int]:
    """Returns the axes (from 1) whose sense or zero is not the maker's."""
    sense, zero = _COUNTING[maker]
    own = counting.sign * geometry.sign
    at = counting.offset - own * geometry.offset
    out = []
    for i in range(6):
        # The zero of axis 1 separates front from back only where axis 2 is over it; the mark of
        # axis 4 may be half a turn away, which then shows in the sense of axis 5.
        period = np.pi if i == 3 else 2.0 * np.pi
        zeroed = i < 5 and not (i == 0 and geometry.a1 > TOLERANCE)
        off = float(wrap((at[i] - zero[i] * DEG) * (2.0 * np.pi / period))) if zeroed else 0.0
        if own[i] != sense[i] or abs(off) > _SAME:
            out.append(i + 1)
    return out
