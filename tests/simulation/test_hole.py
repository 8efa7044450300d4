from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotrue.core.poses import inverse
from robotrue.core.units import MM, UM
from robotrue.errors import ConfigurationError, FormatError
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Motion
from robotrue.program.target_poses import target_poses
from robotrue.simulation.flange_hole import (
    SIDE,
    SLOT,
    EndMillPass,
    FlangeHole,
    check_rows,
    cutting_wrench,
    hole_program,
    mean_force,
    side_rows,
    slot_rows,
    to_part,
)
from robotrue.simulation.milling import (
    commanded_path,
    dry_run,
    feed_directions,
    mill_hole,
)
from robotrue.simulation.presets import deng2022


@pytest.fixture(scope="module")
def cell():
    return deng2022(1)


@pytest.fixture(scope="module")
def hole():
    return FlangeHole(depth=3 * MM)


@pytest.fixture(scope="module")
def program(cell, hole):
    data = hole_program(hole, cell.known.robot)
    return find_language("krl").read(data, name="hole.src", frames=FrameTable())


def test_the_written_krl_is_read_back(program, hole, cell):
    assert not program.notes
    np.testing.assert_allclose(program.T_flange_tool[-1], cell.known.robot.T_flange_tool, atol=1e-7)
    poses = target_poses(program)
    cartesian = np.isfinite(program.position).all(axis=1)
    assert cartesian.sum() == len(program) - 1  # one axis target to start from
    np.testing.assert_allclose(poses[cartesian][:, 2, 2], -1.0, atol=1e-9)  # tool straight down
    for level in (1, 2, 3):
        assert slot_rows(program, hole, level).sum() == 157
        assert side_rows(program, hole, level).sum() == 16


def test_the_39_checks_are_equally_spaced_on_the_slot(program, hole):
    rows = check_rows(program, hole, 2)
    assert len(rows) == 39
    flat = program.position[rows, :2] - hole.centre
    step = np.diff(np.unwrap(np.arctan2(flat[:, 1], flat[:, 0])))
    np.testing.assert_allclose(step, 2.0 * np.pi / 39, atol=1e-5)
    with pytest.raises(ConfigurationError, match="level 9"):
        check_rows(program, hole, 9)


def test_the_commanded_side_pass_is_a_circle(program, hole):
    path = commanded_path(program, side_rows(program, hole, 1), 1 * MM)
    local = to_part(hole, path[:, :3, 3])
    radius = np.linalg.norm(local[:, :2] - hole.centre, axis=1)
    np.testing.assert_allclose(radius, hole.side_radius, atol=0.2 * UM)  # four decimals of a mm
    turn = np.unwrap(np.arctan2(*(local[:, :2] - hole.centre).T[::-1]))
    assert (np.diff(turn) > 0.0).all()  # counter-clockwise
    assert turn[-1] - turn[0] == pytest.approx(2.0 * np.pi, abs=0.02)
    along = feed_directions(path)
    inward = np.cross([0.0, 0.0, 1.0], along)
    outward = (local - [*hole.centre, 0.0]) @ inverse(hole.T_base_part)[:3, :3]
    assert (np.sum(inward * outward, axis=1) < 0.0).all()


def test_a_joint_move_cannot_be_followed(program):
    rows = np.zeros(len(program), dtype=bool)
    rows[np.flatnonzero(program.motion == Motion.PTP)[0]] = True
    with pytest.raises(FormatError, match="PTP"):
        commanded_path(program, rows, 1 * MM)


def test_an_exact_arm_mills_the_nominal_hole(program, hole):
    perfect = deng2022(1, exact=True, level=0.0, repeatability=0.0)
    arm = replace(perfect.robot, actual=perfect.robot.nominal)
    result = mill_hole(replace(perfect, robot=arm), hole, program, program, campaign=0)
    assert result.position < 2 * UM
    assert np.abs(result.form).mean() < 25 * UM  # the tracker's noise on single points


def test_the_uncompensated_arm_misses_as_the_papers_did(cell, hole, program):
    rows = check_rows(program, hole, 2)
    error = np.linalg.norm(dry_run(cell, program, program, rows, campaign=1), axis=1) / MM
    assert 0.8 < error.mean() < 2.2  # Table 9: 1.459
    result = mill_hole(cell, hole, program, program, campaign=2)
    assert result.position > 0.3 * MM


def test_slot_force_is_the_closed_form():
    force = mean_force(SLOT)
    chip = SLOT.teeth * SLOT.depth * SLOT.feed_per_tooth
    np.testing.assert_allclose(force[:2], [-chip / 4 * 240e6, chip / 4 * 800e6])
    assert SIDE.feed == pytest.approx(0.015)
    assert np.linalg.norm(mean_force(SIDE)) < np.linalg.norm(force)
    wrench = cutting_wrench(SLOT, np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]]))
    np.testing.assert_allclose(wrench[0, :3], force)  # feed x, left y, up z
    with pytest.raises(ConfigurationError, match="width of cut"):
        EndMillPass(
            spindle=1.0, teeth=3, feed_per_tooth=1e-4, depth=1e-3, width=0.02, diameter=0.01
        )
