"""Touches of one point name the axis that lost its zero, and refuse to where they cannot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotrue.calibration.methods import fit
from robotrue.calibration.model import with_summary
from robotrue.calibration.nominal import NominalModel
from robotrue.calibration.probing_estimate import ProbingSettings
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.terms.error_vector import PriorScales
from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ImplausibleDataError, ObservabilityError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.forward import forward
from robotrue.robot.inverse import inverse_branches
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.presets import preset
from robotrue.validation.mastering import check_mastering
from robotrue.validation.mastering_evidence import offset_columns

POINT = np.array([1.05, 0.15, 0.75])
SMALL = PriorScales(theta=2e-5, d=2e-5, a=2e-5, alpha=2e-5, beta=2e-5, gear=1e-7, tool=2e-5)
SETTINGS = ProbingSettings(touch_sigma=0.05 * MM, priors=FitSettings(scales=SMALL))
ROBOT = preset("kr160").with_tool(pose(np.eye(3), np.array([140.0, 0.0, 300.0]) * MM))


def touch(robot: RobotModel, offset: Array, seed: int, n: int = 16) -> ProbingSet:
    """Readings of an arm that is exact but for its zeros."""
    rng = np.random.default_rng(seed)
    lean = rng.uniform(-1.0, 1.0, (200, 3)) * np.array([0.8, 0.8, 3.0])
    turn = np.stack([_turn(v) for v in lean])
    aim = POINT + 0.05 * MM * rng.standard_normal((200, 3))
    flange = pose(turn, aim) @ np.linalg.inv(robot.T_flange_tool)
    joints = inverse_branches(robot, flange).reshape(-1, 6)
    joints = joints[~np.isnan(joints).any(axis=1)]
    joints = joints[rng.permutation(len(joints))[:n]]
    return ProbingSet(
        names=tuple(f"t{k + 1}" for k in range(n)), point=np.zeros((n, 3)), joints=joints - offset
    )


def _turn(v: Array) -> Array:
    down = np.diag([1.0, -1.0, -1.0])
    cx, sx, cy, sy, cz, sz = (f(v[i]) for i in range(3) for f in (np.cos, np.sin))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_x @ about_y @ down @ about_z)


@pytest.mark.parametrize("lost", [{2: 0.06}, {1: -0.04}, {4: 0.2}, {2: 0.1, 3: -0.15}])
def test_the_axes_that_lost_their_zero_are_named(lost: dict[int, float]) -> None:
    offset = np.zeros(6)
    for joint, size in lost.items():
        offset[joint] = size * DEG
    found = check_mastering(NominalModel(robot=ROBOT), touch(ROBOT, offset, 5), SETTINGS)
    assert found.verdict == "lost"
    assert found.lost.joints == tuple(lost)
    off = np.abs(found.lost.offset - offset[list(lost)])
    assert (off < 4.0 * np.sqrt(np.diagonal(found.lost.covariance))).all()
    assert off.max() < 0.02 * DEG
    assert found.rms_after < 0.5 * found.rms_before


def test_a_good_arm_is_left_alone() -> None:
    found = check_mastering(NominalModel(robot=ROBOT), touch(ROBOT, np.zeros(6), 6), SETTINGS)
    assert found.verdict == "holds"
    assert found.lost.joints == ()
    assert sum(h.probability for h in found.hypotheses) == pytest.approx(1.0)


def test_axis_1_shows_only_where_the_point_is_known() -> None:
    offset = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]) * DEG
    touches = touch(ROBOT, offset, 7)
    arm = NominalModel(robot=ROBOT)
    blind = check_mastering(arm, touches, SETTINGS)
    assert blind.verdict == "holds"
    assert np.isnan(blind.probability[0])
    assert np.isinf(blind.least[0])
    seen = check_mastering(arm, touches, SETTINGS, point=POINT, point_sigma=0.05 * MM)
    assert seen.lost.joints == (0,)
    assert seen.lost.offset[0] == pytest.approx(offset[0], abs=0.01 * DEG)


def test_an_offset_that_geometry_explains_is_not_called_lost() -> None:
    offset = np.array([0.0, 0.0, 0.05, 0.0, 0.0, 0.0]) * DEG
    wide = ProbingSettings(touch_sigma=0.05 * MM, tool_sigma=1.0 * MM)  # priors of any arm
    found = check_mastering(NominalModel(robot=ROBOT), touch(ROBOT, offset, 5), wide)
    assert found.verdict != "lost"
    assert found.least[2] > 0.05 * DEG


def test_a_lost_zero_is_known_no_better_than_the_zero_the_arm_had() -> None:
    own = np.zeros(len(ROBOT.errors))
    own[parameter_slice(6, "theta")][1] = 1.5e-4  # of sd 1e-4: the touches cannot tell it apart
    offset = np.array([0.0, 0.1, 0.0, 0.0, 0.0, 0.0]) * DEG
    touches = touch(ROBOT.with_errors(own), offset, 5)
    settings = replace(SETTINGS, priors=FitSettings(scales=replace(SMALL, theta=1e-4)))
    found = check_mastering(NominalModel(robot=ROBOT), touches, settings)
    assert found.lost.joints == (1,)
    sd = np.sqrt(found.lost.covariance[0, 0])
    assert 1e-4 < sd < 1.2e-4
    assert abs(found.lost.offset[0] - offset[1]) < 2.0 * sd


def test_touches_beyond_the_calibrated_range_widen_the_interval_not_the_odds() -> None:
    rng = np.random.default_rng(3)
    joints = np.array([0.1, -0.7, 1.4, 0.2, -1.0, 0.3]) + 0.5 * rng.uniform(-1.0, 1.0, (40, 6))
    rows = MeasurementSet(
        joints=joints,
        position=forward(ROBOT, joints)[:, :3, 3] + 2e-5 * rng.standard_normal((40, 3)),
        covariance=np.broadcast_to(2e-5**2 * np.eye(3), (40, 3, 3)),
        frame="base",
    )
    beyond = fit(ROBOT, rows, method="geometric")
    everywhere = [[-4.0] * 6, [4.0] * 6]
    within = with_summary(beyond, {"joint_range_rad": everywhere})
    touches = touch(ROBOT, np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0]) * DEG, 5)
    found, narrow = (check_mastering(arm, touches, SETTINGS) for arm in (beyond, within))
    assert found.lost.joints == narrow.lost.joints == (2,)
    assert found.lost.covariance > 1.1 * narrow.lost.covariance
    np.testing.assert_array_equal(found.lost.offset, narrow.lost.offset)
    np.testing.assert_array_equal(found.probability, narrow.probability)


def test_touches_of_two_points_are_refused_and_a_slipped_one_is_named() -> None:
    arm, touches = NominalModel(robot=ROBOT), touch(ROBOT, np.zeros(6), 8)
    longer = ROBOT.with_tool(pose(np.eye(3), np.array([140.0, 8.0, 300.0]) * MM))
    other = touch(longer, np.zeros(6), 8)
    half = np.where(np.arange(16)[:, None] < 8, touches.joints, other.joints)
    with pytest.raises(ImplausibleDataError, match=r"one fixed point|further off"):
        check_mastering(arm, replace(touches, joints=half), SETTINGS)
    slipped = touches.joints.copy()
    slipped[3] = other.joints[3]
    found = check_mastering(arm, replace(touches, joints=slipped), SETTINGS)
    assert found.outliers == ("t4",)
    assert found.verdict == "holds"


def test_too_few_touches_and_several_places_are_refused() -> None:
    arm, touches = NominalModel(robot=ROBOT), touch(ROBOT, np.zeros(6), 9)
    with pytest.raises(ObservabilityError, match="7 touches of the point, at least 8"):
        check_mastering(arm, touches.subset(range(7)), SETTINGS)
    apart = replace(touches, point=np.arange(48.0).reshape(16, 3) * MM)
    with pytest.raises(ConfigurationError, match=r"places up to 45\.000 mm apart"):
        check_mastering(arm, apart, SETTINGS)


def test_a_zero_of_a_coupled_joint_moves_every_axis_it_drives() -> None:
    step = 1e-6
    robot = ROBOT
    coupled = replace(robot, joint_map=np.eye(6) + np.diag([0, -1.0, 0, 0, 0], -1))
    columns = offset_columns(coupled)
    joints = np.array([[0.3, -0.9, 1.2, 0.4, 0.7, 0.2]])
    for j in range(6):
        moved = coupled.with_errors(step * columns[:, j])
        shifted = joints.copy()
        shifted[0, j] += step
        wanted = forward(coupled, shifted)
        assert np.allclose(forward(moved, joints), wanted, atol=1e-11)
    assert columns[parameter_slice(6, "theta")].shape == (6, 6)
