"""What compensation promises about any error model."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "compensation"))
import cases

from robotrue.calibration.model import Query
from robotrue.calibration.terms.term import rigid_tables
from robotrue.compensation import CompensationSettings, Status, compensate
from robotrue.robot.forward import forward
from robotrue.robot.statics import Load

WRENCH = np.array([150.0, -300.0, 80.0, 2.0, -5.0, 9.0])
MODELS = {
    "rigid": cases.rigid_model,
    "ripple": lambda: cases.rich_model(harmonics=6, centres=0),
    "learned": lambda: cases.rich_model(harmonics=6, centres=20),
}


def tight(joints: np.ndarray, **more) -> CompensationSettings:
    return CompensationSettings(home=joints[0], tolerance=1e-11, turn_tolerance=1e-11, **more)


@pytest.mark.parametrize("kind", MODELS)
def test_what_is_commanded_and_then_bent_is_the_target(kind):
    model, joints = MODELS[kind](), cases.path_joints(20)
    target = forward(model.robot, joints)
    program = cases.program_of(target)
    settings = tight(joints, wrench=WRENCH, approach="unknown")
    result = compensate(model, program, settings=settings)
    assert (result.status == Status.COMPENSATED).all()
    bent = model.predict(Query(joints=result.joints, load=Load(wrench=WRENCH[None])))
    undone = cases.commanded(result, program)[:, :3, 3] + bent.error
    assert np.abs(undone - target[:, :3, 3]).max() < 1e-9


@pytest.mark.parametrize("kind", MODELS)
def test_tables_and_predictions_command_the_same(kind):
    model, joints = MODELS[kind](), cases.path_joints(20)
    program = cases.program_of(forward(model.robot, joints))
    settings = tight(joints, wrench=WRENCH)
    first = compensate(model, program, settings=settings)
    second = compensate(replace(model, flat=False), program, settings=settings)
    assert np.array_equal(first.status, second.status)
    assert np.abs(first.replacement.position - second.replacement.position).max() < 1e-9


@pytest.mark.parametrize("flat", [True, False])
def test_no_error_no_change(flat):
    model = cases.TableModel(tables=rigid_tables(cases.kr160()), flat=flat)
    joints = cases.path_joints(10)
    program = cases.program_of(forward(model.robot, joints))
    result = compensate(model, program, settings=tight(joints, wrench=WRENCH))
    assert not result.replacement.changed.any()
    assert np.array_equal(result.replacement.position, program.position)


@pytest.mark.parametrize("flat", [True, False])
def test_command_leans_against_the_wrench(flat):
    robot = replace(cases.kr160(), link_mass=np.zeros(6))
    errors = np.zeros_like(robot.errors)
    errors[36:42] = 1e-6
    model = cases.TableModel(tables=rigid_tables(robot.with_errors(errors)), flat=flat)
    joints = cases.path_joints(8)
    program = cases.program_of(forward(model.robot, joints))
    for axis in range(3):
        push = np.zeros(6)
        push[axis] = 500.0
        result = compensate(model, program, settings=tight(joints, wrench=push))
        assert (result.predicted_error_before[:, axis] > 0.0).all()
        assert (result.shift[:, axis] < 0.0).all()
