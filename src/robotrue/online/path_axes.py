"""Axes of the path: where the tool is going, from where it has just been.

ABB's path correction is a displacement in these axes: x along the path, z as near the tool's z as a
right angle to x allows, y = z cross x.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final

import numpy as np

from robotrue.core.arrays import Array

_SPACING: Final = 0.25e-3
"""m between the points a direction is taken from; encoders are good to some hundredths of that."""
_POINTS: Final = 5
_LEAP: Final = 5e-3
"""m between two calls, some 10 ms apart, beyond which this is no cut and the points begin anew."""
_PLUNGE: Final = 0.1
"""Sine between path and tool axis below which y and z have no direction."""


class PathAxes:
    """Returns (3, 3) axes of the path in base, for joints as they come; x is left out.

    The column along the path is zero: a tool that is late is not off its path, and controllers take
    no correction along it. All columns are zero, so that nothing is corrected, until the tool has
    moved by a millimetre, after a leap, and where it plunges along its own axis. While it stands
    the last direction holds.

    Fails when: the path turns within a millimetre: the axes are those of the chord.
    """

    def __init__(self, T_base_tool: Callable[[Array], Array]) -> None:
        """Starts without a direction.

        Args:
            T_base_tool: (dof,) rad as displayed to the (4, 4) pose of the tool point.
        """
        self._pose = T_base_tool
        self._points: deque[Array] = deque(maxlen=_POINTS)
        self._along = np.zeros(3)
        self._last: Array | None = None

    def __call__(self, joints: Array) -> Array:
        """Returns the axes at these joints (dof,) rad."""
        pose = self._pose(joints)
        point = pose[:3, 3]
        if self._last is not None and np.linalg.norm(point - self._last) > _LEAP:
            self._points.clear()
            self._along = np.zeros(3)
        self._last = point
        if not self._points or np.linalg.norm(point - self._points[-1]) >= _SPACING:
            self._points.append(point)
            chord = point - self._points[0]
            length = float(np.linalg.norm(chord))
            if len(self._points) == _POINTS and length >= _SPACING:
                self._along = chord / length
        return _across(self._along, pose[:3, 2])


def _across(along: Array, tool: Array) -> Array:
    axes = np.zeros((3, 3))
    upright = tool - along * float(along @ tool)
    size = float(np.linalg.norm(upright))
    if along.any() and size > _PLUNGE:
        axes[:, 2] = upright / size
        axes[:, 1] = np.cross(axes[:, 2], along)
    return axes
