"""What the next touch should read: honest from the first one on, and what explains a wrong one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotrue.calibration.nominal import NominalModel
from robotrue.core.poses import apply, pose
from robotrue.core.units import MM
from robotrue.measurement.probing_set import ProbingSet
from robotrue.validation.part_registration import register
from robotrue.validation.registration_frame import RegistrationSettings
from robotrue.validation.touch_expectation import (
    TouchBelief,
    check_reading,
    expected_readings,
    find_suspicions,
    machined_radius,
    update_belief,
)
from robotrue_reproductions.feng2018 import machining_cell as virtual

SETTINGS = RegistrationSettings(T_flange_tool=virtual.TOOL)
ROUGH = {0: virtual.T_BASE_DRAWN}
TIP = np.array([0.0, 0.0, 1.0])


def touched(seed: int, count: int = 4) -> tuple[virtual.FengCell, ProbingSet]:
    """Simulated touches of three sides in turn."""
    cell, rng = virtual.feng_cell(seed=seed), np.random.default_rng(100 + seed)
    sides = {side: virtual.touch_points(side, count, rng) for side in virtual.START}
    joints = {side: virtual.touch(cell, points, side, rng) for side, points in sides.items()}
    turn = [(side, i) for i in range(count) for side in sides]
    return cell, ProbingSet(
        names=tuple(f"{side}{i}" for side, i in turn),
        point=np.array([sides[side][i] for side, i in turn]),
        joints=np.array([joints[side][i] for side, i in turn]),
    )


def after(cell: virtual.FengCell, touches: ProbingSet, n: int) -> TouchBelief:
    made = touches.subset(np.arange(n)) if n else None
    return update_belief(
        NominalModel(robot=cell.nominal),
        made,
        ROUGH,
        settings=SETTINGS,
        rough_sigma=20.0 * MM,
        joints=True,
    )


def test_readings_scatter_as_expected_from_the_first_touch_on() -> None:
    square = []
    for seed in range(8):
        cell, touches = touched(seed)
        for n in range(len(touches)):
            square.append(check_reading(after(cell, touches, n), touches.subset([n])).sigmas ** 2)
    assert 0.6 < np.mean(square) / 3.0 < 1.5
    assert np.mean(np.sqrt(square) > 4.0) < 0.02


def test_machined_points_get_known_with_every_touch_and_are_as_well_known_as_said() -> None:
    cell, touches = touched(3)
    radius = [machined_radius(after(cell, touches, n), touches).max() for n in range(13)]
    assert (np.diff(radius) < 0.0).all()
    found = register(
        NominalModel(robot=cell.nominal), touches, settings=replace(SETTINGS, fit="joint")
    )
    np.testing.assert_allclose(radius[-1], found.frames[0].region.max(), rtol=0.5)


def test_the_place_is_that_of_registering_once_touches_decide_it() -> None:
    rng = np.random.default_rng(2)
    point = rng.uniform(0.0, 0.4, (8, 3))
    T = pose(np.eye(3), np.array([0.81, -0.11, 0.39]))
    touches = ProbingSet(
        names=tuple("ABCDEFGH"),
        point=point,
        position=apply(T, point) + 1e-4 * rng.normal(size=(8, 3)),
    )
    robot = virtual.feng_cell(seed=0).nominal
    known = update_belief(
        NominalModel(robot=robot), touches, ROUGH, settings=SETTINGS, rough_sigma=1.0, joints=False
    )
    found = register(NominalModel(robot=robot), touches, settings=SETTINGS)
    np.testing.assert_allclose(
        known.T_base_part[0], found.frames[0].registration.T_base_part, atol=1e-8
    )


def test_surfaces_are_judged_along_their_normal_and_with_the_ball() -> None:
    normal = np.tile(np.eye(3), (4, 1))
    point = np.random.default_rng(1).uniform(0.0, 0.3, (12, 3))
    touches = ProbingSet(
        names=tuple(f"S{k}" for k in range(12)),
        point=point,
        normal=normal,
        radius=3.0 * MM,
        position=point + 3.0 * MM * normal,
    )
    robot = virtual.feng_cell(seed=0).nominal
    rough = {0: pose(np.eye(3), np.array([0.004, -0.003, 0.002]))}
    known = update_belief(
        NominalModel(robot=robot),
        touches.subset(np.arange(11)),
        rough,
        settings=SETTINGS,
        rough_sigma=0.02,
        joints=False,
    )
    last = touches.subset([11])
    slid = replace(last, position=last.position + np.array([[0.05, 0.04, 0.0]]))
    assert check_reading(known, last).sigmas < 0.5
    assert check_reading(known, slid).sigmas < 2.0
    forgotten = replace(last, position=last.position - 3.0 * MM * last.normal)
    judged = check_reading(known, forgotten)
    assert judged.outlier
    (why,) = find_suspicions(
        known, forgotten, judged, others=touches.subset([]), before=None, tip_axis=TIP
    )
    assert why.kind == "ball"
    assert why.length == pytest.approx(-3.0 * MM, abs=0.3 * MM)


def explained(touch: ProbingSet, known: TouchBelief, touches: ProbingSet, n: int) -> str:
    judged = check_reading(known, touch)
    assert judged.outlier
    found = find_suspicions(
        known,
        touch,
        judged,
        others=touches.subset(np.arange(len(touches)) != n),
        before=touches.subset(np.arange(n)),
        tip_axis=TIP,
    )
    return f"{found[0].kind} {found[0].name}".strip() if found else ""


def test_what_is_wrong_with_joints_is_named() -> None:
    cell, touches = touched(1)
    known, good = after(cell, touches, 9), touches.subset([9])
    there = replace(good, joints=touches.joints[[11]])
    assert explained(there, known, touches, 9) == f"feature {touches.names[11]}"
    radians = replace(good, joints=np.radians(good.joints))
    assert explained(radians, known, touches, 9) == "radians"
    turned = good.joints.copy()
    turned[0, 2] *= -1.0
    assert explained(replace(good, joints=turned), known, touches, 9) == "sign 3"
    again = replace(good, joints=touches.joints[[4]])
    assert explained(again, known, touches, 9) == f"repeated {touches.names[4]}"


def test_what_is_wrong_with_positions_is_named() -> None:
    rng = np.random.default_rng(2)
    point = rng.uniform(0.0, 0.4, (8, 3))
    touches = ProbingSet(
        names=tuple("ABCDEFGH"),
        point=point,
        position=apply(virtual.T_BASE_DRAWN, point) + 1e-4 * rng.normal(size=(8, 3)),
    )
    robot = virtual.feng_cell(seed=0).nominal
    known = update_belief(
        NominalModel(robot=robot),
        touches.subset(np.arange(6)),
        ROUGH,
        settings=SETTINGS,
        rough_sigma=0.02,
        joints=False,
    )
    good = touches.subset([6])
    assert not check_reading(known, good).outlier
    inches = replace(good, position=good.position / 25.4)
    assert explained(inches, known, touches, 6) == "scale inch"
    turned = replace(good, position=good.position * np.array([1.0, -1.0, 1.0]))
    assert explained(turned, known, touches, 6) == "sign y"


def test_what_is_expected_of_a_touch_that_was_not_made() -> None:
    cell, touches = touched(0)
    known = after(cell, touches, 9)
    expected = expected_readings(known, touches.subset([10]))
    from robotrue.validation.registration_frame import tips

    read = tips(NominalModel(robot=cell.nominal), touches.joints[[10]], SETTINGS)
    assert np.linalg.norm(read - expected.position) < expected.band[0] < 2.0 * MM
