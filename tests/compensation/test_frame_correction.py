"""A corrected work frame: what it leaves is what a run of the program with it leaves."""

from __future__ import annotations

from dataclasses import replace

import cases
import numpy as np
import pytest

from robotrue.calibration.terms.term import rigid_tables
from robotrue.compensation.compensate import compensate
from robotrue.compensation.frame_correction import FrameCorrection, fit_frames
from robotrue.compensation.settings import CompensationSettings
from robotrue.core.poses import inverse, pose_from_xyz_abc
from robotrue.core.units import MM
from robotrue.program.program import FrameTable, Program, Reason
from robotrue.program.target_poses import target_poses
from robotrue.robot.forward import forward

COMPUTED = np.arange(2, 40, 5)
TABLE = FrameTable(bases={"3": cases.FRAME})


def path_on_a_part(model: cases.TableModel) -> tuple[Program, CompensationSettings]:
    """A small part: 40 places within 200 mm, the tool tilted a little from one to the next."""
    joints = cases.path_joints(40)
    middle = forward(model.robot, joints[:1])[0]
    rng = np.random.default_rng(4)
    small = pose_from_xyz_abc(rng.uniform(-0.1, 0.1, (40, 3)), rng.uniform(-0.05, 0.05, (40, 3)))
    reason = np.zeros(40, dtype=int)
    reason[COMPUTED] = Reason.EXPRESSION
    settings = CompensationSettings(max_joint_step=1.0, home=joints[0])
    return cases.program_of(middle @ small, reason=reason), settings


def error_with_frame(
    model: cases.TableModel, program: Program, settings: CompensationSettings, frame: np.ndarray
) -> np.ndarray:
    """Where the tip is, less where it is wanted, (n,) m, when the program runs in ``frame``."""
    known = replace(program, reason=np.zeros(len(program), dtype=int), T_base_frame=frame[None])
    result = compensate(model, known, settings=settings)
    actual = target_poses(known)[:, :3, 3] + result.predicted_error_before
    return np.linalg.norm(actual - target_poses(program)[:, :3, 3], axis=1)


def fitted(model: cases.TableModel, table: FrameTable = TABLE) -> tuple[Program, FrameCorrection]:
    program, settings = path_on_a_part(model)
    found = fit_frames(program, compensate(model, program, settings=settings), table)
    assert len(found) == 1
    return program, found[0]


def test_it_leaves_what_it_says_at_the_known_targets_and_at_the_computed_ones() -> None:
    model = cases.rigid_model()
    program, found = fitted(model)
    settings = path_on_a_part(model)[1]
    left = error_with_frame(model, program, settings, found.T_world_after)
    known = np.setdiff1d(np.arange(40), COMPUTED)
    np.testing.assert_allclose(left[known], found.after, atol=5e-6)
    was = error_with_frame(model, program, settings, cases.FRAME)
    assert left[COMPUTED].max() < 0.35 * was[COMPUTED].min()
    assert found.computed == len(COMPUTED)
    assert found.fitted == 40 - len(COMPUTED)
    assert found.after.max() < 0.35 * found.before.min()


def test_a_base_that_stands_elsewhere_is_corrected_in_full() -> None:
    robot = cases.kr160()
    errors = np.zeros(len(robot.errors))
    errors[-12:-6] = 8e-4, -5e-4, 3e-4, 2e-4, -4e-4, 3e-4
    model = cases.TableModel(tables=rigid_tables(robot.with_errors(errors)))
    program, found = fitted(model)
    assert found.before.min() > 1e-4
    settings = path_on_a_part(model)[1]
    assert found.after.max() < 2e-6
    assert error_with_frame(model, program, settings, found.T_world_after).max() < 2e-6


def test_the_frame_is_that_of_the_controllers_world() -> None:
    model = cases.rigid_model()
    world = pose_from_xyz_abc(np.array([0.2, -0.1, 0.5]), np.array([0.3, 0.0, 0.1]))
    _, plain = fitted(model)
    _, found = fitted(model, FrameTable(T_base_world=world))
    np.testing.assert_allclose(
        found.T_world_after, inverse(world) @ plain.T_world_after, atol=1e-12
    )
    assert (plain.name, found.name) == ("3", "")


def test_a_path_on_one_line_leaves_no_turn_open() -> None:
    model = cases.rigid_model()
    program, settings = path_on_a_part(model)
    T = np.tile(target_poses(program)[:1], (40, 1, 1))
    T[:, 0, 3] += np.linspace(0.0, 0.15, 40)
    line = cases.program_of(T, reason=program.reason)
    found = fit_frames(line, compensate(model, line, settings=settings), TABLE)[0]
    turn = inverse(found.T_world_before) @ found.T_world_after
    assert np.arccos((np.trace(turn[:3, :3]) - 1.0) / 2.0) < 5e-3
    assert found.after.max() < 0.35 * found.before.min()


@pytest.mark.parametrize("known", [0, 2])
def test_too_few_known_targets_make_no_frame(known: int) -> None:
    model = cases.rigid_model()
    program, settings = path_on_a_part(model)
    reason = np.full(40, int(Reason.EXPRESSION))
    reason[:known] = 0
    few = replace(program, reason=reason)
    assert fit_frames(few, compensate(model, few, settings=settings), TABLE) == ()


def test_a_program_without_computed_targets_needs_none() -> None:
    model = cases.rigid_model()
    program, settings = path_on_a_part(model)
    whole = replace(program, reason=np.zeros(40, dtype=int))
    assert fit_frames(whole, compensate(model, whole, settings=settings), TABLE) == ()


def test_the_sentence_states_frame_and_errors() -> None:
    _, found = fitted(cases.rigid_model())
    text = found.sentence()
    assert "8 computed targets are unchanged" in text
    assert "work frame 3 X " in text
    assert "in place of X 900.0000 Y -200.0000 Z 300.0000 A 15.000000" in text
    assert (
        f"{found.after.max() / MM:.3f} mm max instead of {found.before.max() / MM:.3f} mm" in text
    )
