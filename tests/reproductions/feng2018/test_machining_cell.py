"""The virtual cell of registration, its slot and sculpture tests, and the ways compared in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotrue.core.poses import apply, pose, pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ReachError
from robotrue.robot.forward import forward
from robotrue.robot.inverse import branch_of, branches_of
from robotrue.robot.statics import drive_torque
from robotrue.simulation.virtual_robot import actual_pose
from robotrue_reproductions.feng2018.machining_cell import (
    SIZE,
    START,
    T_BASE_DRAWN,
    T_BASE_FLIPPED,
    TOOL,
    CellSizes,
    attitude,
    compensated_joints,
    feng_cell,
    flip_block,
    joints_touching,
    machine,
    nominal_joints,
    touch,
    touch_points,
    tracker_poses,
    with_tip,
)
from robotrue_reproductions.feng2018.planned_touches import touch_planned
from robotrue_reproductions.feng2018.recursion_experiment import CASES, run_recursion
from robotrue_reproductions.feng2018.registration_ways import (
    all_sides,
    frame_and_tip,
    session,
    together,
)
from robotrue_reproductions.feng2018.slot_experiment import (
    SlotSide,
    contour,
    cut_contour,
    cut_slots,
    reach_points,
)
from robotrue_reproductions.feng2018.way_results import WAYS, require_calibrated, results_of

EXACT = CellSizes(arm=0.0, tip=0.0, touch=0.0, repeatability=0.0, tracker=0.0)


def both(cell, model, place):
    return tuple(
        SlotSide(cell=cell, posture=posture, model=model, T_base_part=place) for posture in "RL"
    )


def test_equal_seeds_give_equal_cells_and_noise_leaves_the_truth_alone() -> None:
    first, again, other = feng_cell(3), feng_cell(3), feng_cell(4)
    np.testing.assert_array_equal(first.robot.actual.errors, again.robot.actual.errors)
    assert not np.array_equal(first.T_base_part, other.T_base_part)
    quiet = feng_cell(3, CellSizes(touch=0.0, repeatability=0.0))
    np.testing.assert_array_equal(first.robot.actual.errors, quiet.robot.actual.errors)
    np.testing.assert_array_equal(first.T_base_part, quiet.T_base_part)


def test_sizes_of_the_cell_are_those_stated() -> None:
    cells = [feng_cell(seed) for seed in range(300)]
    a = np.array([c.robot.actual.error("a") for c in cells])
    theta = np.array([c.robot.actual.error("theta") for c in cells])
    tip = np.array([c.robot.actual.T_flange_tool[:3, 3] - TOOL[:3, 3] for c in cells])
    off = np.array([apply(c.T_base_part, 0.5 * SIZE) for c in cells]) - [1.0, 0.0, 0.6]
    for values, sigma in ((a, 0.3 * MM), (theta, 0.02 * DEG), (tip, 0.3 * MM), (off, 6.0 * MM)):
        assert values.std() == pytest.approx(sigma, rel=0.08)
    amplitude = np.array([np.hypot(c.robot.effects.sine, c.robot.effects.cosine) for c in cells])
    assert amplitude.mean() == pytest.approx(0.008 * DEG * np.sqrt(2.0 / np.pi), rel=0.05)
    cycles = np.unique([c.robot.effects.cycles for c in cells])
    np.testing.assert_array_equal(cycles, np.arange(2.0, 9.0))
    compliance = np.array([c.robot.actual.error("compliance") for c in cells])
    assert (compliance[:, [0, 3, 4, 5]] == 0.0).all()
    assert (compliance[:, 1:3] > 0.0).all()


def test_the_short_form_of_the_arm_is_the_arm() -> None:
    cell = feng_cell(5)
    joints = np.random.default_rng(0).uniform(-2.0, 2.0, (40, 6))
    np.testing.assert_allclose(
        machine(cell, joints), actual_pose(cell.robot, joints)[:, :3, 3], atol=1e-14
    )


def test_gravity_is_that_of_the_two_masses() -> None:
    robot = feng_cell(0).nominal
    upright = drive_torque(robot, np.zeros((1, 6)))[0]  # upper arm up, forearm level
    g = 9.80665
    # Wrist point 0.71 m ahead of joint 3 and 0.07 m above it; joint 2 turns against the weight.
    assert abs(upright[2]) == pytest.approx(200.0 * g * 0.71, rel=1e-9)
    assert abs(upright[1]) == pytest.approx(200.0 * g * 0.71, rel=1e-9)
    assert (np.abs(upright[[0, 3, 4, 5]]) < 1e-9).all()


@pytest.mark.parametrize("posture", ["R", "L", "T"])
def test_a_touch_puts_the_true_tip_on_the_point(posture) -> None:
    cell = feng_cell(7, CellSizes(touch=0.0, repeatability=0.0, spindle=1.5 * DEG))
    rng = np.random.default_rng(1)
    points = touch_points(posture, 12, rng)
    joints = touch(cell, points, posture, rng, tilt=5.0 * DEG)
    np.testing.assert_allclose(machine(cell, joints), apply(cell.T_base_part, points), atol=1e-9)
    assert (branches_of(cell.nominal, joints) == branch_of(cell.nominal, START[posture])).all()


def test_touches_scatter_as_stated() -> None:
    cell = feng_cell(8, CellSizes(touch=0.1 * MM, repeatability=0.03 * MM))
    rng = np.random.default_rng(2)
    points = touch_points("R", 400, rng)
    off = machine(cell, touch(cell, points, "R", rng)) - apply(cell.T_base_part, points)
    assert off.std() == pytest.approx(np.hypot(0.1, 0.03) * MM, rel=0.06)


def test_planned_touches_are_on_the_block_and_mostly_where_it_is_cut() -> None:
    cell = feng_cell(17, CellSizes(touch=0.0, repeatability=0.0))
    points, joints = touch_planned(cell, 12, np.random.default_rng(11))
    np.testing.assert_allclose(machine(cell, joints), apply(cell.T_base_part, points), atol=1e-9)
    front, back, top = (points[:, 1] == 0.0), (points[:, 1] == SIZE[1]), (points[:, 2] == SIZE[2])
    assert (front | back | top).all()
    assert front.sum() >= 3
    assert back.sum() >= 3
    tool = forward(cell.nominal, joints)[:, :3, :3]
    turned = np.linalg.norm(tool - tool[0], axis=(1, 2))
    assert len(np.unique(turned.round(3))) > 6  # attitudes of their own


def test_what_is_out_of_reach_is_named() -> None:
    far = np.array([[3.0, 0.0, 0.6]])
    with pytest.raises(ReachError, match=r"posture R; the first is at \[3000.0, 0.0, 600.0\] mm"):
        joints_touching(feng_cell(0), far, attitude("R"), "R")


def test_a_compensated_run_with_the_truth_is_exact() -> None:
    cell = feng_cell(9)
    quiet = replace(
        cell.robot,
        effects=replace(
            cell.robot.effects,
            sine=np.zeros((6, 1)),
            cosine=np.zeros((6, 1)),
        ),
    )
    cell = replace(cell, robot=quiet)
    points = apply(cell.T_base_part, touch_points("L", 10, np.random.default_rng(3)))
    wanted = pose(np.broadcast_to(attitude("L"), (10, 3, 3)), points)
    joints = compensated_joints(cell.robot.actual, wanted, "L")
    np.testing.assert_allclose(machine(cell, joints), points, atol=1e-9)
    plain = machine(cell, compensated_joints(cell.nominal, wanted, "L"))
    assert np.linalg.norm(plain - points, axis=1).max() > 0.1 * MM
    np.testing.assert_array_equal(
        compensated_joints(cell.nominal, wanted, "L"), nominal_joints(cell.nominal, wanted, "L")
    )


def test_the_tracker_reads_the_tip_in_base() -> None:
    cell = feng_cell(10)
    measured = tracker_poses(cell, np.random.default_rng(4))
    assert len(measured) == 60
    off = measured.position - machine(cell, measured.joints)
    assert off.std() == pytest.approx(np.hypot(0.03, 0.03) * MM, rel=0.2)


def test_the_turned_block_shows_its_back() -> None:
    np.testing.assert_allclose(apply(T_BASE_FLIPPED, 0.5 * SIZE), apply(T_BASE_DRAWN, 0.5 * SIZE))
    centre_of_back = np.array([0.5, 1.0, 0.5]) * SIZE
    turned = flip_block(feng_cell(11), np.random.default_rng(5))
    place = apply(turned.T_base_part, centre_of_back)
    np.testing.assert_allclose(place, [1.0, -0.1, 0.6], atol=40.0 * MM)


@pytest.mark.parametrize(
    ("tip", "frame", "step", "error"),
    [(0.0, True, 0.0, 14.0), (0.35, False, 0.70, 0.35), (10.0, False, 20.0, 10.0)],
)
def test_the_step_sees_the_tip_twice_and_the_frame_not_at_all(tip, frame, step, error) -> None:
    cell = feng_cell(0, EXACT)
    place = cell.T_base_part
    if frame:
        place = pose_from_xyz_abc(np.full(3, 6.0 * MM), np.full(3, 1.0 * DEG)) @ place
    off = with_tip(cell, np.array([0.0, tip * MM, 0.0]))
    found = cut_slots(*both(off, cell.nominal, place), np.random.default_rng(6))
    assert found.mismatch / MM == pytest.approx(step, rel=2e-3, abs=1e-9)
    assert found.rms / MM >= 0.99 * error
    if tip:
        assert abs(found.evaluation.tip) / MM == pytest.approx(tip, rel=2e-3)


def test_an_exact_cell_is_cut_exactly() -> None:
    cell = feng_cell(12, EXACT)
    sides = both(cell, cell.nominal, cell.T_base_part)
    rng = np.random.default_rng(7)
    assert cut_slots(*sides, rng).rms < 1e-12
    assert cut_contour(*sides, rng).worst < 1e-12
    points, _ = contour()
    np.testing.assert_allclose(reach_points(sides[0], points), points, atol=1e-12)


def test_normals_of_the_outline_stand_on_it() -> None:
    points, normals = contour(720)
    along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    assert np.abs(np.einsum("ni,ni->n", along, normals)).max() < 1e-4
    assert (np.einsum("ni,ni->n", points - 0.5 * SIZE, normals) > 0.0).all()
    assert ((points > 0.0) & (points < SIZE)).all()


def test_frame_and_tip_are_found_where_the_arm_is_exact() -> None:
    found = session(13, sizes=CellSizes(arm=0.0, touch=0.0, repeatability=0.0), method=None)
    result = cut_slots(*frame_and_tip(found), np.random.default_rng(8))
    assert result.mismatch < 1e-9
    assert result.rms < 1e-9
    assert len(together(found.sides, 30).points) == 30


def test_a_session_without_tracker_has_no_model() -> None:
    with pytest.raises(ConfigurationError, match="no calibrated model"):
        require_calibrated(session(14, method=None))


def test_ways_stand_in_the_order_the_notes_measured() -> None:
    keys = ("drawn", "paper", "per-side", "touches-90", "calibrated", "changed", "refitted")
    ways = tuple(way for way in WAYS if way.key in keys)
    name = {way.key: way.name for way in ways}
    cells = [results_of(seed, ways) for seed in range(1, 4)]
    step = {k: np.median([c[name[k]].mismatch for c in cells]) / MM for k in keys}
    rms = {k: np.median([c[name[k]].rms for c in cells]) / MM for k in keys}
    assert step["drawn"] > 3.0
    assert 0.1 < step["paper"] < 2.0
    assert step["per-side"] < 0.3 * step["paper"]
    assert step["calibrated"] < 0.05
    assert step["refitted"] < 0.3 * step["changed"]
    assert rms["calibrated"] < 0.12
    assert rms["touches-90"] < 0.2 * rms["paper"]
    # The step of the paper's way is smaller than what it misses.
    assert rms["paper"] > step["paper"]


def test_without_noise_the_recursion_is_a_constant_from_its_first_pass() -> None:
    case = CASES[0]
    cell = feng_cell(15, case.sizes)
    run = run_recursion(case, cell, cell.nominal, np.random.default_rng(9))
    assert run.error[0] > 5.0 * MM
    assert np.ptp(run.error[2:]) < 1e-3 * MM
    assert 0.05 * MM < run.error[-1] < 2.0 * MM
    assert run.own.verdict != "diverges"


def test_touching_oscillates_and_a_calibrated_arm_lowers_the_floor() -> None:
    noisy, calibrated = CASES[3], CASES[-1]
    late: dict[str, list[float]] = {"noisy": [], "calibrated": [], "oscillation": []}
    for seed in (1, 2):
        found = session(seed, sizes=calibrated.sizes)
        for name, case, model in (
            ("noisy", noisy, found.nominal),
            ("calibrated", calibrated, require_calibrated(found)),
        ):
            cell = feng_cell(seed, case.sizes)
            run = run_recursion(case, cell, model, np.random.default_rng(seed))
            late[name].append(run.late.mean() / MM)
            if name == "noisy":
                late["oscillation"].append(run.late.std() / MM)
    assert np.median(late["calibrated"]) < 0.7 * np.median(late["noisy"])
    assert 0.03 < np.median(late["oscillation"]) < 0.4


def test_all_sides_puts_both_in_one_frame() -> None:
    found = session(16, method=None)
    first, second = all_sides(found, found.nominal)
    np.testing.assert_array_equal(first.T_base_part, second.T_base_part)
    result = cut_slots(first, second, np.random.default_rng(10))
    assert result.evaluation.per_frame == 0.0
    np.testing.assert_allclose(np.linalg.norm(result.evaluation.per_tip), 2.0, atol=0.01)
