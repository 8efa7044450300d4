"""Nominal joints of straight runs: those of the closed form one by one, however a run is cut."""

from __future__ import annotations

import cases
import numpy as np
import pytest

from robotrue.compensation.branch_lanes import choose_closed
from robotrue.compensation.branches import Closed
from robotrue.compensation.memory import LANES
from robotrue.compensation.pack import pack_tables
from robotrue.compensation.status import Route
from robotrue.core.poses import inverse
from robotrue.core.sines import arc_tangents
from robotrue.core.units import DEG
from robotrue.robot.forward import forward
from robotrue.robot.inverse import inverse_batch


def arm(model: cases.TableModel) -> Closed:
    pack = pack_tables(model.tables, model.robot.T_flange_tool[None], np.array([True]))
    return Closed(
        lengths=pack.opw, sign=pack.opw_sign, offset=pack.opw_offset, end=pack.opw_end,
        uncoupling=pack.uncoupling, coupled=pack.coupled, limits=pack.limits,
    )  # fmt: skip


def rows_of(T: np.ndarray) -> np.ndarray:
    return np.concatenate([T[:, :3, :3].reshape(-1, 9), T[:, :3, 3]], axis=1)


def chosen(p: Closed, target: np.ndarray, route: np.ndarray, home: np.ndarray, cuts: list[int]):
    near, branch = home.copy(), np.zeros(4, dtype=np.int64)
    out = np.full((len(target), 6), np.nan)
    for first, last in zip([0, *cuts], [*cuts, len(target)], strict=True):
        tool, given = np.zeros(last - first, dtype=np.int64), np.zeros((last - first, 6))
        choose_closed(
            p, target[first:last], route[first:last], tool, given, near, branch, out[first:last]
        )
    return out


def test_joints_of_a_straight_run() -> None:
    model, joints = cases.rigid_model(), cases.path_joints(5 * LANES + 3)
    T = forward(model.robot, joints)
    found = chosen(arm(model), rows_of(T), np.full(len(T), int(Route.LINEAR)), joints[0], [])
    assert np.abs(found - joints).max() < 1e-13
    assert np.abs(forward(model.robot, found) - T)[:, :3, 3].max() < 1e-13  # m


@pytest.mark.parametrize("seed", range(4))
def test_cutting_a_run_changes_no_bit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model, joints = cases.rigid_model(), cases.path_joints(9 * LANES)
    joints[100:130, 4] = np.linspace(0.2, -0.2, 30)  # through the stretched wrist
    joints[150:, 3] += np.pi  # a jump to another branch
    target = rows_of(forward(model.robot, joints))
    target[60, 9:] += 9.0  # out of reach
    route = np.full(len(target), int(Route.LINEAR))
    route[rng.integers(0, len(route), 12)] = Route.FREE
    route[rng.integers(0, len(route), 12)] = Route.SKIP
    whole = chosen(arm(model), target, route, joints[0], [])
    assert np.isnan(whole[60]).all()
    cuts = np.unique(rng.integers(1, len(target), 20)).tolist()
    assert np.array_equal(chosen(arm(model), target, route, joints[0], cuts), whole, equal_nan=True)


def test_solutions_are_those_of_the_other_inverse() -> None:
    model, joints = cases.rigid_model(), cases.path_joints(2 * LANES)
    T = forward(model.robot, joints)
    flange = model.robot.with_tool(np.eye(4))
    expected = inverse_batch(flange, T @ inverse(model.robot.T_flange_tool), near=joints)
    found = chosen(arm(model), rows_of(T), np.full(len(T), int(Route.LINEAR)), joints[0], [])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


def test_arc_tangents() -> None:
    rng = np.random.default_rng(4)
    angle = np.concatenate([rng.uniform(-np.pi, np.pi, 2000), np.arange(-180, 181, 22.5) * DEG])
    size = 10.0 ** rng.uniform(-5, 3, len(angle))
    n = len(angle)
    rows = np.concatenate([size * np.sin(angle), size * np.cos(angle), np.zeros(n)])
    arc_tangents(rows, 0, n, n, 2 * n)
    assert np.abs(rows[2 * n :] - np.arctan2(rows[:n], rows[n : 2 * n])).max() < 5e-16
    odd = np.array([0.0, np.nan, 1.0, np.inf, 0.0, 1.0, np.nan, 1.0, 7.0, 7.0, 7.0, 7.0])
    arc_tangents(odd, 0, 4, 4, 8)
    assert odd[8] == 0.0
    assert np.isnan(odd[9:]).all()
