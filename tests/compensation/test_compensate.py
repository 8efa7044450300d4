"""The compiled chain against the package's NumPy kinematics, and every status."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import cases
import numpy as np
import pytest

from robotrue.calibration.model import Query
from robotrue.calibration.terms.term import rigid_tables
from robotrue.compensation import CompensationSettings, Status, compensate, zero_correction
from robotrue.core.arm_words import NO_WORD
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError
from robotrue.program.program import Motion, Reason
from robotrue.robot.configuration import configuration_words, kuka_status_turn
from robotrue.robot.forward import forward
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load

PAYLOAD = Load(mass=np.array([60.0]), com=np.array([[0.05, 0.0, 0.15]]))
WRENCH = np.array([150.0, -300.0, 80.0, 2.0, -5.0, 9.0])
LOADED = Load(mass=PAYLOAD.mass, com=PAYLOAD.com, wrench=WRENCH[None])


def settings_at(joints: np.ndarray, **more) -> CompensationSettings:
    return CompensationSettings(home=joints[0], **more)


def direction(joints: np.ndarray) -> np.ndarray:
    return np.sign(np.diff(joints, axis=0, prepend=joints[:1]))


@pytest.mark.parametrize("build", [cases.rigid_model, cases.rich_model])
@pytest.mark.parametrize("tool", [cases.TOOL, np.eye(4)])
def test_actual_tool_lands_on_target(build, tool):
    model = build()
    joints = cases.path_joints(120)
    target = forward(model.robot.with_tool(tool), joints)
    program = cases.program_of(target, tool=tool)
    settings = settings_at(joints, load=PAYLOAD, wrench=WRENCH)
    result = compensate(model, program, settings=settings)
    assert (result.status == Status.COMPENSATED).all()
    query = Query(
        joints=result.joints,
        load=LOADED,
        approach=direction(joints),
        T_flange_tool=None if tool is cases.TOOL else tool,
    )
    robot, position, rotation = model.actual(query)
    assert np.abs(position - target[:, :3, 3]).max() < 1e-6
    assert np.abs(rotation - target[:, :3, :3]).max() < 1.5e-7
    left = position - target[:, :3, 3]
    assert np.abs(left - result.predicted_error_after).max() < 1e-9
    told = forward(robot.nominal(), result.joints)
    assert np.abs(told - cases.commanded(result, program)).max() < 1e-12


def test_error_before_is_that_of_the_numpy_route():
    model = cases.rich_model()
    joints = cases.path_joints(80)
    program = cases.program_of(forward(model.robot, joints))
    result = compensate(model, program, settings=settings_at(joints, wrench=WRENCH))
    load = Load(wrench=WRENCH[None])
    predicted = model.predict(Query(joints=joints, load=load, approach=direction(joints)))
    assert np.abs(predicted.error - result.predicted_error_before).max() < 1e-9


def test_tight_tolerance_is_reached():
    model = cases.rigid_model()
    joints = cases.path_joints(60)
    target = forward(model.robot, joints)
    settings = settings_at(joints, tolerance=1e-11, turn_tolerance=1e-11)
    result = compensate(model, cases.program_of(target), settings=settings)
    _, position, _ = model.actual(Query(joints=result.joints))
    assert np.abs(position - target[:, :3, 3]).max() < 1e-10


def test_prediction_route_agrees_with_compiled_route():
    flat, joints = cases.rich_model(harmonics=20, centres=40), cases.path_joints(40)
    hidden = replace(flat, flat=False)
    program = cases.program_of(forward(flat.robot, joints))
    settings = settings_at(joints, wrench=WRENCH, tolerance=1e-11, turn_tolerance=1e-11)
    first = compensate(flat, program, settings=settings)
    second = compensate(hidden, program, settings=settings)
    assert (second.status == Status.COMPENSATED).all()
    assert np.abs(first.replacement.position - second.replacement.position).max() < 1e-9
    assert np.abs(first.joints - second.joints).max() < 1e-8


def test_zero_error_changes_nothing():
    model = cases.TableModel(tables=rigid_tables(cases.kr160()))
    joints = cases.path_joints(30)
    program = cases.program_of(forward(model.robot, joints))
    result = compensate(model, program, settings=settings_at(joints, wrench=WRENCH))
    assert (result.status == Status.UNCHANGED_NO_ERROR).all()
    assert not result.replacement.changed.any()
    assert np.array_equal(result.replacement.position, program.position)
    assert not zero_correction(program).changed.any()


def test_force_to_plus_x_moves_the_command_to_minus_x():
    soft = cases.kr160()
    errors = np.zeros_like(soft.errors)
    errors[36:42] = 1e-6
    model = cases.TableModel(
        tables=rigid_tables(replace(soft, link_mass=np.zeros(6)).with_errors(errors))
    )
    joints = cases.path_joints(10)
    program = cases.program_of(forward(model.robot, joints))
    force = np.array([500.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    result = compensate(model, program, settings=settings_at(joints, wrench=force))
    assert (result.predicted_error_before[:, 0] > 1e-5).all()
    assert (result.shift[:, 0] < -1e-5).all()


def test_wrench_per_target_is_that_of_its_row():
    model, joints = cases.rigid_model(), cases.path_joints(12)
    program = cases.program_of(forward(model.robot, joints))
    rows = np.outer(np.linspace(0.0, 1.0, 12), WRENCH)
    each = compensate(model, program, settings=settings_at(joints, wrench=rows))
    for k in (0, 7):
        alone = compensate(model, program, settings=settings_at(joints, wrench=rows[k]))
        assert np.array_equal(each.joints[k], alone.joints[k])
    with pytest.raises(ConfigurationError, match="wrench of the load has 5 rows"):
        compensate(model, program, settings=settings_at(joints, wrench=rows[:5]))


def test_parallelogram_and_numeric_arms():
    for name, start in (("IRB 6660", None), ("UR10", np.radians([20, -70, 80, -60, -80, 10]))):
        robot = preset(name).with_tool(cases.TOOL)
        middle = robot.limits.mean(axis=1) + np.radians([10, 5, 10, 20, 40, 15])
        centre = middle if start is None else start
        joints = centre + 0.2 * np.sin(np.linspace(0, 3, 40)[:, None] + np.arange(6))
        model = cases.TableModel(tables=rigid_tables(cases.with_errors(robot, 4, size=0.5)))
        target = forward(robot, joints)
        result = compensate(model, cases.program_of(target), settings=settings_at(joints))
        assert (result.status == Status.COMPENSATED).all(), (name, result.notes)
        _, position, _ = model.actual(Query(joints=result.joints))
        assert np.abs(position - target[:, :3, 3]).max() < 1e-6
        assert np.abs(result.joints - joints).max() < 0.05  # the same branch all along


def one_status(model, program, settings) -> Status:
    result = compensate(model, program, settings=settings)
    assert not result.replacement.changed[-1]
    assert np.array_equal(result.replacement.position[-1], program.position[-1], equal_nan=True)
    return Status(int(result.status[-1]))


def test_guards_have_their_status():
    model, joints = cases.rigid_model(), cases.path_joints(3)
    target = forward(model.robot, joints)
    program, settings = cases.program_of(target), settings_at(joints)
    assert compensate(model, program, settings=settings).counts() == {"compensated": 3}

    far = np.array(target)
    far[-1, :3, 3] += 5.0
    assert one_status(model, cases.program_of(far), settings) is Status.UNCHANGED_UNREACHABLE
    tight = settings_at(joints, max_shift=1e-4)
    assert one_status(model, program, tight) is Status.UNCHANGED_STEP
    narrow = cases.narrowed(model.tables.robot, 0, -3.0, float(joints[-1, 0]) - 0.01)
    limited = cases.TableModel(tables=rigid_tables(narrow))
    assert one_status(limited, program, settings) is Status.UNCHANGED_JOINT_LIMIT

    stretched = np.array(joints)
    stretched[-1, 4] = 0.2 * DEG
    straight = cases.program_of(forward(model.robot, stretched))
    wide = settings_at(joints, max_joint_step=10.0)
    assert one_status(model, straight, wide) is Status.UNCHANGED_WRIST_SINGULAR
    picky = settings_at(joints, min_singular_value=0.9)
    assert one_status(model, program, picky) is Status.UNCHANGED_SINGULAR

    turned = np.array(joints)
    turned[-1] = joints[-2] + np.radians([110.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    jump = cases.program_of(forward(model.robot, turned))
    assert one_status(model, jump, settings) is Status.UNCHANGED_BRANCH_JUMP
    free = cases.program_of(forward(model.robot, turned), motion=Motion.PTP)
    assert compensate(model, free, settings=settings).counts() == {"compensated": 3}

    blocked = cases.program_of(target, reason=np.array([0, 0, int(Reason.EXPRESSION)]))
    assert one_status(model, blocked, settings) is Status.UNCHANGED_SOURCE


def test_note_names_lines():
    model, joints = cases.rigid_model(), cases.path_joints(3)
    far = forward(model.robot, joints)
    far[1, :3, 3] += 5.0
    result = compensate(model, cases.program_of(far), settings=settings_at(joints))
    assert result.notes == ("line 11: unchanged, out of the robot's reach.",)
    assert result.summary()["compensated"] == 2


def test_axis_targets_on_request_only():
    model, joints = cases.rigid_model(), cases.path_joints(5)
    program = cases.axis_program(model.robot.controller.to_controller(joints))
    left = compensate(model, program)
    assert (left.status == Status.UNCHANGED_AXIS_TARGET).all()
    done = compensate(model, program, settings=CompensationSettings(axis_targets=True))
    assert (done.status == Status.COMPENSATED).all()
    moved = model.robot.controller.to_model(done.replacement.axes)
    _, position, _ = model.actual(Query(joints=moved))
    assert np.abs(position - forward(model.robot, joints)[:, :3, 3]).max() < 1e-6


EDGE_DEG = (0.0005, -0.0005)


def test_status_and_turn_choose_the_branch_and_follow_the_axes():
    model = cases.rigid_model()
    joints = np.radians(
        [[10, -25, 20, -150, -55, 200], *([10, -25, 20, x, 55, 40] for x in EDGE_DEG)]
    )
    shape, turn = kuka_status_turn(model.robot, joints)
    program = cases.program_of(
        forward(model.robot, joints), motion=Motion.PTP, words=np.stack([shape, turn], axis=1)
    )
    result = compensate(model, program)
    assert (result.status == Status.COMPENSATED).all()
    assert np.abs(result.joints - joints).max() < 0.05
    new_shape, new_turn = kuka_status_turn(model.robot, result.joints)
    renewed = result.replacement.words[:, 1]
    assert (renewed != NO_WORD).sum() == 1  # one of the two crosses zero
    assert np.array_equal(np.where(renewed == NO_WORD, turn, renewed), new_turn)
    assert np.array_equal(new_shape, shape)


def test_covariance_and_doubt():
    model = replace(cases.rigid_model(), sigma=1e-3)
    joints = cases.path_joints(4)
    program = cases.program_of(forward(model.robot, joints))
    result = compensate(model, program, settings=settings_at(joints, covariance=True))
    assert np.allclose(np.trace(result.covariance, axis1=1, axis2=2), 1e-6)
    assert "outside the range of the calibration, predicted to 1000 um" in result.notes[-1]


def test_settings_refuse_what_cannot_be():
    with pytest.raises(ConfigurationError, match="max_shift is 0"):
        CompensationSettings(max_shift=0.0)
    with pytest.raises(ConfigurationError, match="given twice"):
        CompensationSettings(load=LOADED, wrench=WRENCH)


def test_import_leaves_numba_alone():
    code = "import robotrue.compensation, sys; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0  # noqa: S603


@pytest.mark.parametrize("maker", ["abb", "fanuc", "yaskawa"])
def test_words_of_every_maker_choose_the_branch_and_follow_the_axes(maker):
    robot = replace(cases.kr160(), maker=maker)
    model = cases.rigid_model(robot=robot)
    edge, step = (0.5 * np.pi, 3e-4) if maker == "abb" else (np.pi, 3e-5)
    joints = np.radians([[10, -25, 20, -150, -55, 200], [10, -25, 20, 30, 55, 40]])
    axis = edge + step * np.array([1.0, -1.0])[:, None]
    joints = np.concatenate([joints, np.repeat(joints[1:], 2, axis=0)])
    joints[2:, [3]] = axis  # on both sides of where the word of axis 4 changes
    words = configuration_words(robot, maker, joints)
    assert (words[2] != words[3]).any()
    program = cases.program_of(
        forward(robot, joints), motion=Motion.PTP, words=words, words_of=maker
    )
    result = compensate(model, program)
    assert (result.status == Status.COMPENSATED).all()
    assert np.abs(result.joints - joints).max() < 0.05
    new = result.replacement.words
    follows = configuration_words(robot, maker, result.joints)
    assert np.array_equal(np.where(new == NO_WORD, words, new), follows)
    assert (new == NO_WORD).all(axis=1).sum() == 3  # one of the two crosses the edge
