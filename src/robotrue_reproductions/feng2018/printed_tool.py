"""How Feng, Liang, Xi 2018 print a tool: eq. 3 and 6, angles first, then shifts.

:func:`robotrue.cell.registration.tool.tool_from_table` is the route itself (eq. 7).
"""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.poses import inverse
from robotrue.core.rotations import abc_from_matrix


def printed_parameters(T_flange_tool: Array) -> tuple[Array, Array]:
    """Returns eq. 6's angles (3,) rad about z, y, x and shifts (3,) m along the turned axes.

    They describe the inverse, flange in tool: J3^-1 = Rz Ry Rx T(px, py, pz). Set on a tool model
    as they are they place the wrong tool; see ``turned_then_shifted``.
    """
    T_tool_flange = inverse(frozen(T_flange_tool, (4, 4), "T_flange_tool"))
    return turned_then_shifted(T_tool_flange)


def turned_then_shifted(transform: Array) -> tuple[Array, Array]:
    """Returns angles (3,) rad about z, y, x, then shifts (3,) m along the turned axes, of a pose.

    Eq. 3's order: turn first, then shift, so the shifts are R^T p.
    """
    R = transform[:3, :3]
    return abc_from_matrix(R), np.asarray(R.T @ transform[:3, 3])


def touched_point(T_base_flange: Array, T_flange_tool: Array) -> Array:
    """Returns the touched point(s) (..., 3) m in base, eq. 8: the tool's origin."""
    return np.asarray((T_base_flange @ T_flange_tool)[..., :3, 3])
