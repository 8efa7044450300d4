"""Nominal joints of straight runs: those of the closed form, however a run is cut."""

from __future__ import annotations

import cases
import numpy as np
import pytest

from robotrue.compensation.arm_state import state_at
from robotrue.compensation.calibrated_arm import WORK_DTYPE, calibrated_arm
from robotrue.compensation.nominal_kernels import choose_joints
from robotrue.compensation.status import Route
from robotrue.core.poses import inverse
from robotrue.robot.forward import forward
from robotrue.robot.inverse import inverse_batch


def chosen(
    model: cases.TableModel,
    target: np.ndarray,
    route: np.ndarray,
    home: np.ndarray,
    cuts: list[int],
) -> np.ndarray:
    arm = calibrated_arm(model.tables, model.robot.T_flange_tool[None], np.array([True]))
    state, work = state_at(home, stated=True), np.zeros(1, WORK_DTYPE)
    joints = np.full((len(target), 6), np.nan)
    for first, last in zip([0, *cuts], [*cuts, len(target)], strict=True):
        tool, given = np.zeros(last - first, dtype=np.int64), np.zeros((last - first, 6))
        done = choose_joints(
            arm.arms, target[first:last], route[first:last], tool, given, state.record, work,
            joints[first:last], 0,
        )  # fmt: skip
        assert done == last - first
    return joints


def test_joints_of_a_straight_run() -> None:
    model, joints = cases.rigid_model(), cases.path_joints(163)
    T = forward(model.robot, joints)
    found = chosen(
        model, np.ascontiguousarray(T[:, :3]), np.full(len(T), int(Route.LINEAR)), joints[0], []
    )
    assert np.abs(found - joints).max() < 1e-13
    assert np.abs(forward(model.robot, found) - T)[:, :3, 3].max() < 1e-13  # m


@pytest.mark.parametrize("seed", range(4))
def test_cutting_a_run_changes_no_bit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model, joints = cases.rigid_model(), cases.path_joints(288)
    joints[100:130, 4] = np.linspace(0.2, -0.2, 30)  # through the stretched wrist
    joints[150:, 3] += np.pi  # a jump to another branch
    target = np.ascontiguousarray(forward(model.robot, joints)[:, :3])
    target[60, :, 3] += 9.0  # out of reach
    route = np.full(len(target), int(Route.LINEAR))
    route[rng.integers(0, len(route), 12)] = Route.FREE
    route[rng.integers(0, len(route), 12)] = Route.SKIP
    whole = chosen(model, target, route, joints[0], [])
    assert np.isnan(whole[60]).all()
    cuts = np.unique(rng.integers(1, len(target), 20)).tolist()
    assert np.array_equal(chosen(model, target, route, joints[0], cuts), whole, equal_nan=True)


def test_solutions_are_those_of_the_other_inverse() -> None:
    model, joints = cases.rigid_model(), cases.path_joints(64)
    T = forward(model.robot, joints)
    flange = model.robot.with_tool(np.eye(4))
    expected = inverse_batch(flange, T @ inverse(model.robot.T_flange_tool), near=joints)
    found = chosen(
        model, np.ascontiguousarray(T[:, :3]), np.full(len(T), int(Route.LINEAR)), joints[0], []
    )
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
