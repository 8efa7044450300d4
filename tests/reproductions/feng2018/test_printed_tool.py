"""The paper's tool: its route gives it, its printed parameters set as they are do not.

Feng, Liang, Xi 2018 print a tool by eq. 3 and 6: angles first, then shifts.
"""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.poses import inverse, pose, pose_from_xyz_abc
from robotrue.core.rotations import abc_from_matrix, matrix_from_abc
from robotrue.core.units import DEG, MM

TIP = np.array([12.0, -7.0, 310.0]) * MM


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


def tool_from_table(T_base_flange: Array, T_base_table: Array) -> Array:
    """Returns ``T_flange_tool`` (4, 4) of a tool whose frame lies on a calibrated table's, eq. 7.

    It needs the tool's frame on the table's in full pose, and a tip touch gives three of the six
    equations; ``fit_tool_point`` needs nothing but touches.
    """
    return np.asarray(inverse(T_base_flange) @ T_base_table)


def touched_point(T_base_flange: Array, T_flange_tool: Array) -> Array:
    """Returns the touched point(s) (..., 3) m in base, eq. 8: the tool's origin."""
    return np.asarray((T_base_flange @ T_flange_tool)[..., :3, 3])


def test_the_paper_s_route_gives_the_tool_and_its_printed_parameters_do_not() -> None:
    T_flange_tool = pose_from_xyz_abc(TIP, np.array([10.0, 20.0, -5.0]) * DEG)
    T_base_table = pose_from_xyz_abc(np.array([1.2, 0.1, 0.5]), np.array([3.0, 2.3, 3.5]) * DEG)
    T_base_flange = T_base_table @ inverse(T_flange_tool)
    found = tool_from_table(T_base_flange, T_base_table)
    np.testing.assert_allclose(found, T_flange_tool, atol=1e-12)
    np.testing.assert_allclose(touched_point(T_base_flange, found), T_base_table[:3, 3])

    def rebuilt(angles: Array, shifts: Array) -> Array:
        return pose(matrix_from_abc(angles), matrix_from_abc(angles) @ shifts)

    np.testing.assert_allclose(rebuilt(*turned_then_shifted(found)), found, atol=1e-12)
    np.testing.assert_allclose(rebuilt(*printed_parameters(found)), inverse(found), atol=1e-12)
    wrong = rebuilt(*printed_parameters(found))
    assert np.linalg.norm(wrong[:3, 3] - TIP) > 0.3
