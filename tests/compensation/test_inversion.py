"""Inversion of the calibrated arm: chunks of any length, neighbours that fail, hard targets."""

from __future__ import annotations

from dataclasses import replace

import cases
import numpy as np
import pytest

from robotrue.calibration.model import Query
from robotrue.compensation import CompensationSettings, Status, compensate
from robotrue.compensation.compensate import CHUNK
from robotrue.core.units import DEG
from robotrue.program.program import Motion
from robotrue.robot.forward import forward


def solved(model, joints, **more):
    program = cases.program_of(forward(model.robot, joints), motion=Motion.PTP)
    return compensate(model, program, settings=CompensationSettings(home=joints[0], **more))


@pytest.mark.parametrize("count", [1, 31, 33, 101, CHUNK + 7])
def test_number_of_targets_changes_no_bit(count):
    model, path = cases.rigid_model(), cases.path_joints(CHUNK + 40)
    whole, part = solved(model, path), solved(model, path[:count])
    assert (part.status == Status.COMPENSATED).all()
    assert np.array_equal(part.joints, whole.joints[:count])
    assert np.array_equal(part.replacement.position, whole.replacement.position[:count])
    assert np.array_equal(part.predicted_error_after, whole.predicted_error_after[:count])


@pytest.mark.parametrize("bad", ["unreachable", "stretched"])
def test_failing_target_leaves_its_neighbours(bad):
    joints = cases.path_joints(35)
    model = cases.rich_model(harmonics=8, centres=10)
    program = cases.program_of(forward(model.robot, joints), motion=Motion.PTP)
    poses = forward(model.robot, joints)
    if bad == "unreachable":
        poses[7, :3, 3] += 5.0
    else:
        straight = np.array(joints[7])
        straight[4] = 0.0
        poses[7] = forward(model.robot, straight[None])[0]
    # Backlash would rightly carry the direction of the changed target on to the next.
    settings = CompensationSettings(home=joints[0], approach="unknown")
    good = compensate(model, program, settings=settings)
    mixed = compensate(model, cases.program_of(poses, motion=Motion.PTP), settings=settings)
    expected = {
        "unreachable": {Status.UNCHANGED_UNREACHABLE},
        "stretched": {Status.UNCHANGED_WRIST_SINGULAR},
    }[bad]
    assert Status(int(mixed.status[7])) in expected
    others = np.arange(len(joints)) != 7
    assert np.array_equal(mixed.joints[others], good.joints[others])
    assert np.array_equal(mixed.replacement.rotation[others], good.replacement.rotation[others])


def test_nearly_singular_targets_arrive():
    model, joints = cases.rigid_model(), cases.path_joints(6)
    joints = np.array(joints)
    joints[:, 4] = 0.02 * DEG  # far below the usual limit of the singular value
    loose = {"min_wrist_angle": 0.0, "min_singular_value": 0.0, "max_turn": 1.0}
    result = solved(model, joints, **loose, max_shift=1.0)
    done = result.status == Status.COMPENSATED
    reachable = result.status != Status.UNCHANGED_NOT_CONVERGED
    assert (done == reachable).all()
    assert np.isfinite(result.singular_value).all()
    assert (result.singular_value < 1e-3).all()
    _, position, _ = model.actual(Query(joints=result.joints[done]))
    target = forward(model.robot, joints)[done, :3, 3]
    assert np.abs(position - target).max(initial=0.0) < 2e-7


def test_not_converged_has_its_status():
    model = cases.rich_model(harmonics=4, centres=5)
    wild = replace(model.tables, weights=np.full((5, 3), 1e5))
    joints = cases.path_joints(3)
    loose = {"min_wrist_angle": 0.0, "min_singular_value": 0.0}
    result = solved(replace(model, tables=wild), joints, **loose)
    assert (result.status == Status.UNCHANGED_NOT_CONVERGED).all()
    assert not result.replacement.changed.any()


def test_ripple_of_any_harmonics():
    joints = cases.path_joints(32)
    model = cases.rich_model(harmonics=5, centres=3)
    for cycles in ([1.0, 2.5, 7.25, 33.1, 101.0], [2.0, 3.0, 9.0, 17.0, 30.0]):
        tables = replace(model.tables, harmonics=np.array(cycles))
        result = solved(replace(model, tables=tables), joints, approach="unknown")
        _, position, _ = replace(model, tables=tables).actual(Query(joints=result.joints))
        left = position - forward(model.robot, joints)[:, :3, 3]
        assert np.abs(left - result.predicted_error_after).max() < 1e-9
