"""The paper's tool: its route gives it, its printed parameters set as they are do not."""

from __future__ import annotations

import numpy as np

from robotrue.cell.registration.tool import tool_from_table
from robotrue.core.arrays import Array
from robotrue.core.poses import inverse, pose, pose_from_xyz_abc
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue_reproductions.feng2018.printed_tool import (
    printed_parameters,
    touched_point,
    turned_then_shifted,
)

TIP = np.array([12.0, -7.0, 310.0]) * MM


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
