"""Functions for computed targets do at run time what compensating the target would have done."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import cases
import numpy as np
import pytest

from robotrue.calibration.terms.term import rigid_tables
from robotrue.compensation import fit_correction_table
from robotrue.compensation.compensate import compensate
from robotrue.compensation.fit_correction_table import FittedTable, fit_table
from robotrue.compensation.region_corrections import open_region, random_shares
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.status import Status
from robotrue.core.poses import inverse, pose, pose_from_xyz_abc
from robotrue.core.rotations import (
    abc_from_matrix,
    matrix_from_quat_wxyz,
    matrix_from_rotation_vector,
    quat_wxyz_from_matrix,
)
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ReachError, StepError
from robotrue.program.correction_krl import write_krl_module
from robotrue.program.correction_rapid import write_rapid_module
from robotrue.program.correction_table import (
    CorrectionTable,
    PoseRegion,
    TableModule,
    require_module_name,
)
from robotrue.program.formats import read_job
from robotrue.program.program import FrameTable
from robotrue.robot.statics import Load

sys.path.insert(0, str(Path(__file__).parents[1] / "program"))
from controller_interpreter import Controller, krl_frame, krl_matrix, rapid_pose

MODEL = cases.TableModel(tables=rigid_tables(cases.with_errors(cases.kr160(), 3)))
HOME = MODEL.robot.controller.to_model(np.array([[0, -80, 80, 0, 40, 0]]) * DEG)[0]
LOAD = Load(mass=np.array([30.0]), com=np.array([[0.0, 0.0, 0.1]]))
WORLD = pose_from_xyz_abc(np.array([50.0, -80.0, 20.0]) * MM, np.array([10.0, 0.0, 0.0]) * DEG)
"""The robot's base in the controller's world."""
TURNED = pose_from_xyz_abc(np.array([3.0, -5.0, 2.0]) * MM, np.array([20.0, 3.0, -8.0]) * DEG)
"""Another work frame in that of the region."""
MIDDLE = pose_from_xyz_abc(np.zeros(3), np.array([175.0, -62.0, 8.0]) * DEG)[:3, :3]
TOLERANCE = 0.02 * MM
PRINTED = 0.6e-6
"""m: five decimals of the table, and 32 bits of a pose within 1.5 m of the frames."""


def region(*turn: float) -> PoseRegion:
    return PoseRegion(
        T_base_frame=cases.FRAME,
        low=np.array([-50.0, 20.0, 30.0]) * MM,
        high=np.array([250.0, 320.0, 180.0]) * MM,
        R_frame_tool=MIDDLE,
        turn=np.array(turn or (8.0, 6.0, 6.0)) * DEG,
    )


SETTINGS = CompensationSettings(approach="unknown", home=HOME, load=LOAD)


@cache
def fitted(*, grid: bool = False) -> FittedTable:
    arm = open_region(MODEL, region(), cases.TOOL, SETTINGS)
    terms = fit_correction_table.MOST_TERMS
    fit_correction_table.MOST_TERMS = 20 if grid else terms
    try:
        made = fit_table(arm, tolerance=TOLERANCE, most_numbers=10_000)
    finally:
        fit_correction_table.MOST_TERMS = terms
    assert made.table.cells.any() == grid
    return made


def module(*, grid: bool = False) -> TableModule:
    return TableModule(
        table=fitted(grid=grid).table,
        name="rt_fix",
        T_world_base=WORLD,
        T_flange_tool=cases.TOOL,
        remarks=("Simulated.",),
    )


def compensated(table: FittedTable, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 4, 4) targets in the work frame, and what compensating a program makes of them."""
    place = table.table.region.place_poses(share)
    targets = pose(place[1], place[0])
    program = cases.program_of(cases.FRAME @ targets)
    result = compensate(MODEL, program, settings=replace(SETTINGS, max_joint_step=10.0))
    assert (result.status == Status.COMPENSATED).all()
    return targets, pose(result.replacement.rotation, result.replacement.position)


def krl(made: TableModule) -> Controller:
    controller = Controller(rapid=False)
    for data in write_krl_module(made).values():
        controller.load(data.decode())
    controller.values |= {
        "$tool": krl_frame(mm(cases.TOOL)),
        "$base": krl_frame(mm(WORLD @ cases.FRAME)),
        "$ipo_mode": "#BASE",
    }
    return controller


def rapid(made: TableModule) -> Controller:
    controller = Controller(rapid=True)
    (data,) = write_rapid_module(made).values()
    controller.load(data.decode())
    return controller


def mm(T: np.ndarray) -> np.ndarray:
    scaled = np.array(T)
    scaled[:3, 3] /= MM
    return scaled


def si(T: np.ndarray) -> np.ndarray:
    scaled = np.array(T, dtype=float)
    scaled[:3, 3] *= MM
    return scaled


def abb_pose(T: np.ndarray) -> dict[str, Any]:
    return rapid_pose(np.concatenate([T[:3, 3] / MM, quat_wxyz_from_matrix(T[:3, :3])]))


def wobj(T: np.ndarray) -> dict[str, Any]:
    return {"uframe": abb_pose(T), "oframe": abb_pose(np.eye(4)), "robhold": False, "ufprog": True}


def matrix(target: dict[str, Any]) -> np.ndarray:
    rot = np.array([float(target["rot"][k]) for k in ("q1", "q2", "q3", "q4")])
    R = matrix_from_quat_wxyz(rot / np.linalg.norm(rot))
    return pose(R, np.array([float(target["trans"][k]) for k in "xyz"]) * MM)


def apart(have: np.ndarray, wanted: np.ndarray) -> tuple[float, float]:
    """m and rad."""
    turned = have[:3, :3].T @ wanted[:3, :3]
    angle = np.linalg.norm(turned - turned.T) / np.sqrt(8.0)
    return float(np.linalg.norm(have[:3, 3] - wanted[:3, 3])), float(angle)


def correct_by_table(
    table: CorrectionTable, position: np.ndarray, rotation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The poses to command (n, 3) m and (n, 3, 3), all in the work frame, in 64 bits."""
    space, R = table.region, table.region.R_frame_tool
    turns = abc_from_matrix(R.T @ rotation) / space.turn
    share = np.concatenate([(position - space.low) / (space.high - space.low), turns], axis=1)
    found = table.interpolate(share)
    turned = matrix_from_rotation_vector(found[:, 3:] @ R.T)
    return position + found[:, :3] @ R.T, turned @ rotation


def test_the_table_leaves_what_it_says() -> None:
    found = fitted()
    assert found.before.max() > 0.5 * MM
    assert found.largest <= TOLERANCE
    share = random_shares(200, seed=77)
    targets, wanted = compensated(found, share)
    position, _ = correct_by_table(found.table, targets[:, :3, 3], targets[:, :3, :3])
    left = np.linalg.norm(position - wanted[:, :3, 3], axis=1)
    assert left.max() <= found.left.max()
    assert left.max() > 0.1 * found.left.max()
    assert found.table.numbers == found.table.values.size


@pytest.mark.parametrize("grid", [False, True])
def test_krl_and_rapid_correct_as_the_model_does(*, grid: bool) -> None:
    found, made = fitted(grid=grid), module(grid=grid)
    targets, wanted = compensated(found, random_shares(10, seed=78))
    kuka, abb = krl(made), rapid(made)
    frame = wobj(WORLD @ cases.FRAME)
    for target, command in zip(targets, wanted, strict=True):
        by_krl = si(krl_matrix(kuka.call("rt_fix_f", krl_frame(mm(target)))))
        given = {**abb_pose(target), "robconf": "kept", "extax": [7.0]}
        answer = abb.call("rt_fix", given, WObj=frame)
        assert (answer["robconf"], answer["extax"]) == ("kept", [7.0])
        for have in (by_krl, matrix(answer)):
            shift, angle = apart(have, command)
            assert shift <= found.left.max() + PRINTED
            assert angle <= found.turn_left.max() + 1e-6
        alone = abb.call("rt_fix", given)
        assert apart(matrix(alone), matrix(answer))[0] < 1e-7
    assert (kuka.values["rt_fix_state"], kuka.stops) == (0, 0)
    assert (abb.values["rt_fixstate"], abb.stops) == (0, 0)


@pytest.mark.parametrize("grid", [False, True])
def test_rounding_to_32_bits_stays_below_a_micrometre(*, grid: bool) -> None:
    """The same against the table itself: what is left is rounding alone."""
    found, made = fitted(grid=grid), module(grid=grid)
    share = random_shares(6, seed=79)
    position, rotation = region().place_poses(share)
    wanted = pose(*correct_by_table(found.table, position, rotation)[::-1])
    kuka, abb = krl(made), rapid(made)
    frame = wobj(WORLD @ cases.FRAME)
    for target, command in zip(pose(rotation, position), wanted, strict=True):
        by_krl = si(krl_matrix(kuka.call("RT_FIX_F", krl_frame(mm(target)))))
        by_rapid = matrix(abb.call("rt_fix", abb_pose(target), WObj=frame))
        for have in (by_krl, by_rapid):
            shift, angle = apart(have, command)
            assert shift < PRINTED
            assert angle < 1e-6


def test_status_turn_and_external_axes_of_a_krl_point_stay() -> None:
    share = random_shares(1, seed=80)
    position, rotation = region().place_poses(share)
    controller = krl(module())
    target = krl_frame(mm(pose(rotation, position)[0]))
    frame = controller.call("RT_FIX_F", target)
    for name in ("RT_FIX", "RT_FIX_P"):
        answer = controller.call(name, {**target, "s": 2, "t": 35, "e1": 850.0})
        assert answer == {**frame, "s": 2, "t": 35, "e1": 850.0}


def test_another_work_frame_at_run_time_gives_the_same_place() -> None:
    """The correction is that of where the pose is, whatever base it is written in."""
    position, rotation = region().place_poses(random_shares(4, seed=81))
    kuka, abb = krl(module()), rapid(module())
    for target in pose(rotation, position):
        first = si(krl_matrix(kuka.call("RT_FIX_F", krl_frame(mm(target)))))
        elsewhere = inverse(TURNED) @ target
        kuka.values["$base"] = krl_frame(mm(WORLD @ cases.FRAME @ TURNED))
        second = TURNED @ si(krl_matrix(kuka.call("RT_FIX_F", krl_frame(mm(elsewhere)))))
        kuka.values["$base"] = krl_frame(mm(WORLD @ cases.FRAME))
        frame = wobj(WORLD @ cases.FRAME @ TURNED)
        third = TURNED @ matrix(abb.call("rt_fix", abb_pose(elsewhere), WObj=frame))
        for other in (second, third):
            assert apart(first, other)[0] < 1e-6


OUTSIDE = [
    ([1.01, 0.5, 0.5, 0.0, 0.0, 0.0], 1),
    ([0.5, -0.01, 0.5, 0.0, 0.0, 0.0], 1),
    ([0.5, 0.5, 0.5, 1.01, 0.0, 0.0], 2),
    ([0.5, 0.5, 0.5, 0.0, -1.01, 0.0], 2),
    ([0.5, 0.5, 0.5, 0.0, 0.0, 1.02], 2),
]


@pytest.mark.parametrize(("share", "state"), OUTSIDE)
def test_a_pose_outside_stays_raises_its_state_and_halts(share: list[float], state: int) -> None:
    position, rotation = region().place_poses(np.array([share]))
    target = pose(rotation, position)[0]
    kuka, abb = krl(module()), rapid(module())
    frame, point = krl_frame(mm(target)), abb_pose(target)
    assert kuka.call("RT_FIX_F", frame) == frame
    assert abb.call("rt_fix", point, WObj=wobj(WORLD @ cases.FRAME)) == point
    assert (kuka.values["rt_fix_state"], kuka.values["rt_fix_count"], kuka.stops) == (state, 1, 1)
    assert (abb.values["rt_fixstate"], abb.values["rt_fixcount"], abb.stops) == (state, 1, 1)
    kuka.values["rt_fix_halt"] = abb.values["rt_fixhalt"] = False
    assert kuka.call("RT_FIX_F", frame) == frame
    abb.call("rt_fix", point, WObj=wobj(WORLD @ cases.FRAME))
    assert (kuka.values["rt_fix_count"], kuka.stops, abb.stops) == (2, 1, 1)


def test_another_tool_or_a_part_on_the_robot_is_not_corrected() -> None:
    position, rotation = region().place_poses(np.array([[0.5, 0.5, 0.5, 0.0, 0.0, 0.0]]))
    target = pose(rotation, position)[0]
    other = cases.TOOL @ pose_from_xyz_abc(np.array([0.0, 0.0, 0.02]) * MM, np.zeros(3))
    turned = cases.TOOL @ pose_from_xyz_abc(np.zeros(3), np.array([0.0, 0.02, 0.0]) * DEG)
    kuka, abb = krl(module()), rapid(module())
    frame, point = krl_frame(mm(target)), abb_pose(target)
    place = wobj(WORLD @ cases.FRAME)
    for tool in (other, turned):
        kuka.values["$tool"] = krl_frame(mm(tool))
        assert kuka.call("RT_FIX_F", frame) == frame
        data = {"robhold": True, "tframe": abb_pose(tool)}
        assert abb.call("rt_fix", point, WObj=place, Tool=data) == point
        assert kuka.values["rt_fix_state"] == abb.values["rt_fixstate"] == 3
    kuka.values |= {"$tool": krl_frame(mm(cases.TOOL)), "$ipo_mode": "#TCP"}
    assert kuka.call("RT_FIX_F", frame) == frame
    data = {"robhold": True, "tframe": abb_pose(cases.TOOL)}
    assert abb.call("rt_fix", point, WObj=place, Tool=data) != point
    assert abb.call("rt_fix", point, WObj={**place, "robhold": True}, Tool=data) == point
    assert abb.call("rt_fix", point, WObj={**place, "ufprog": False}) == point
    assert abb.call("rt_fix", point, WObj=place, Tool={**data, "robhold": False}) == point
    assert kuka.values["rt_fix_state"] == abb.values["rt_fixstate"] == 4


def test_our_own_readers_read_the_modules_and_find_no_target_of_a_move(tmp_path: Path) -> None:
    writers = (write_krl_module, write_rapid_module)
    for files in (write(module(grid=grid)) for write in writers for grid in (False, True)):
        for name, data in files.items():
            (tmp_path / name).write_bytes(data)
            assert data.isascii()
            assert data.count(b"\n") == data.count(b"\r\n")
        programs = read_job([tmp_path / name for name in files], FrameTable())
        assert sum(len(program.path) for program in programs) == 0
        assert [note for program in programs for note in program.notes] == []


def test_a_region_with_a_pose_that_cannot_be_reached_is_refused_by_name() -> None:
    far = replace(region(), high=np.array([1500.0, 320.0, 180.0]) * MM)
    with pytest.raises(ReachError, match=r"poses of the region cannot be compensated.*reach"):
        fit_table(
            open_region(MODEL, far, cases.TOOL, SETTINGS), tolerance=TOLERANCE, most_numbers=10_000
        )
    away = replace(region(), T_base_frame=pose(np.eye(3), np.array([5.0, 0.0, 0.0])))
    with pytest.raises(ReachError, match="middle of the region"):
        open_region(MODEL, away, cases.TOOL, SETTINGS)


def test_a_configuration_that_nobody_states_is_refused_where_it_matters() -> None:
    unsaid = replace(SETTINGS, home=np.empty(0))
    with pytest.raises(ConfigurationError, match=r"nothing says in which configuration.*mm apart"):
        open_region(MODEL, region(), cases.TOOL, unsaid)
    open_region(MODEL, region(), cases.TOOL, replace(unsaid, alike=5.0 * MM))


def test_a_table_that_would_be_too_large_is_refused_with_its_size() -> None:
    arm = open_region(MODEL, region(), cases.TOOL, SETTINGS)
    with pytest.raises(StepError, match=r"no table of up to 100 numbers keeps 0.02 mm.*the next"):
        fit_table(arm, tolerance=TOLERANCE, most_numbers=100)
    with pytest.raises(ConfigurationError, match="expected above 0"):
        fit_table(arm, tolerance=0.0, most_numbers=100)


def test_regions_and_names_that_cannot_be() -> None:
    with pytest.raises(ConfigurationError, match="sides of 300, 0, 150 mm"):
        replace(region(), high=np.array([250.0, 20.0, 180.0]) * MM)
    with pytest.raises(ConfigurationError, match="may turn by 8, 85, 6 deg"):
        region(8.0, 85.0, 6.0)
    for name in ("1st", "a-b", "much_too_long_a_name", ""):
        with pytest.raises(ConfigurationError, match="name of the function"):
            require_module_name(name)
    require_module_name("rt_fix")


def test_a_model_without_flat_tables_makes_the_same_table(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fit_correction_table, "CHECKED", 10)
    monkeypatch.setattr(fit_correction_table, "_LINES", 4)
    slow = replace(MODEL, flat=False)
    arm = open_region(slow, region(), cases.TOOL, SETTINGS)
    other = fit_table(arm, tolerance=0.1 * MM, most_numbers=10_000)
    quick = open_region(MODEL, region(), cases.TOOL, SETTINGS)
    same = fit_table(quick, tolerance=0.1 * MM, most_numbers=10_000)
    np.testing.assert_allclose(other.table.values, same.table.values, atol=2e-7)
