"""Tool point, tool axis and datums from touches of a simulated arm: truth, regions, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotrue.calibration.nominal import NominalModel
from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ImplausibleDataError, ObservabilityError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.inverse import inverse_batch
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset
from robotrue.validation.registration_frame import RegistrationSettings
from robotrue.validation.tool_calibration import axis_between, axis_on_plane, calibrate_tool

PROBE = pose(np.eye(3), np.array([0.0, 0.0, 0.3]))
TIP = np.array([8.0, -5.0, 240.0]) * MM
ROBOT = preset("KUKA KR160 R1570").with_tool(PROBE)
ARM = NominalModel(robot=ROBOT)
SETTINGS = RegistrationSettings(T_flange_tool=PROBE)
TABLE = np.array([[0, 0, 0], [400, 0, 0], [0, 300, 0], [400, 300, 0], [200, 100, 50]]) * MM
T_BASE_TABLE = pose(
    matrix_from_rotation_vector(np.array([0.01, -0.02, 0.03])), np.array([0.9, -0.15, 0.6])
)
DOWN = np.diag([1.0, -1.0, -1.0])
LEANS = np.array([[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0.5]]) * 15.0 * DEG


def touched(tip: Array, points: Array, leans: Array, shift: Array | float = 0.0) -> ProbingSet:
    """Touches of points of the table by a perfect arm with a tip."""
    robot: RobotModel = ROBOT.with_tool(pose(np.eye(3), tip))
    at = points @ T_BASE_TABLE[:3, :3].T + T_BASE_TABLE[:3, 3] + shift
    wanted = pose(matrix_from_rotation_vector(leans) @ DOWN, at)
    near = np.array([0.0, -80.0, 80.0, 0.0, 80.0, 0.0]) * DEG
    joints = inverse_batch(robot, wanted, near=near)
    assert np.isfinite(joints).all()
    names = tuple(f"t{i + 1}" for i in range(len(points)))
    return ProbingSet(names=names, point=points, joints=joints)


PROBED = touched(PROBE[:3, 3], TABLE, np.zeros((5, 3)))


def test_one_touch_of_the_table_gives_the_whole_tool_point() -> None:
    tool = touched(TIP, TABLE[4:], LEANS[:1])
    found = calibrate_tool(ARM, tool, table=PROBED, settings=SETTINGS)
    np.testing.assert_allclose(found.p_flange_tool, TIP, atol=1e-7)
    assert "One touch has no redundancy" in found.doubts[0]
    more = calibrate_tool(ARM, touched(TIP, TABLE, LEANS), table=PROBED, settings=SETTINGS)
    np.testing.assert_allclose(more.p_flange_tool, TIP, atol=1e-7)
    assert more.rms < 1e-7
    assert more.region < found.region
    assert more.doubts == ()


def test_what_arm_and_tip_share_falls_out() -> None:
    # In one posture the arm's own error cancels between probe and tool: far less than the arm's.
    found = calibrate_tool(ARM, touched(TIP, TABLE, LEANS * 0.0), table=PROBED, settings=SETTINGS)
    alone = calibrate_tool(ARM, touched(TIP, TABLE[[4] * 5], LEANS), settings=SETTINGS)
    assert found.region < alone.region


def test_one_fixed_point_in_several_orientations() -> None:
    found = calibrate_tool(ARM, touched(TIP, TABLE[[4] * 5], LEANS), settings=SETTINGS)
    np.testing.assert_allclose(found.p_flange_tool, TIP, atol=1e-7)
    assert found.table is None


def test_a_touch_that_is_not_of_the_table_is_named() -> None:
    shift = np.zeros((5, 3))
    shift[2] = [0.0, 20.0 * MM, 0.0]
    wrong = touched(TIP, TABLE, LEANS * 0.0, shift)
    with pytest.raises(ImplausibleDataError, match=r"touch t3 is 16\.\d{3} mm from where"):
        calibrate_tool(ARM, wrong, table=PROBED, settings=SETTINGS)
    pivot = touched(TIP, TABLE[[4] * 5], LEANS, shift)
    with pytest.raises(ImplausibleDataError, match="touch t3 is"):
        calibrate_tool(ARM, pivot, settings=SETTINGS)


def test_bad_touches_are_refused() -> None:
    tool = touched(TIP, TABLE, LEANS)
    with pytest.raises(ConfigurationError, match=r"places up to 400\.000 mm apart, and no table"):
        calibrate_tool(ARM, tool, settings=SETTINGS)
    measured = ProbingSet(names=PROBED.names, point=TABLE, position=TABLE)
    with pytest.raises(ConfigurationError, match="needs the joints they were touched with"):
        calibrate_tool(ARM, tool, table=measured, settings=SETTINGS)
    with pytest.raises(ConfigurationError, match="touches with a tool's tip need joints"):
        calibrate_tool(ARM, measured, settings=SETTINGS)
    with pytest.raises(ObservabilityError, match="2 flange poses, a tool point needs 3"):
        calibrate_tool(ARM, touched(TIP, TABLE[[4] * 2], LEANS[:2]), settings=SETTINGS)
    small = replace(PROBED, point=PROBED.point * 1e-3)
    with pytest.raises(ImplausibleDataError, match="the nominal points are in metres"):
        calibrate_tool(ARM, tool, table=small, settings=SETTINGS)
    line = PROBED.subset(np.array([0, 1]))
    with pytest.raises(ObservabilityError, match="2 points"):
        calibrate_tool(ARM, tool, table=line, settings=SETTINGS)


def test_the_axis_between_two_gauges() -> None:
    axis = np.array([0.02, -0.01, 1.0])
    axis /= np.linalg.norm(axis)
    short = touched(TIP, TABLE[[4] * 5], LEANS)
    long = touched(TIP + 0.15 * axis, TABLE[[4] * 5], 0.6 * LEANS)
    found = axis_between(ARM, short, long, settings=SETTINGS)
    np.testing.assert_allclose(found.axis_in_flange, axis, atol=1e-6)
    assert 0.0 < found.region < 2.0 * DEG
    with pytest.raises(ObservabilityError, match="the two gauges end"):
        axis_between(ARM, short, touched(TIP + 1e-4 * axis, TABLE[[4] * 5], LEANS))


def test_the_axis_between_two_gauges_on_the_table() -> None:
    axis = np.array([0.02, -0.01, 1.0])
    axis /= np.linalg.norm(axis)
    upright, once = LEANS * 0.0, np.array([4])
    short, long = (touched(tip, TABLE, upright) for tip in (TIP, TIP + 0.15 * axis))
    found = axis_between(ARM, short, long, table=PROBED, settings=SETTINGS)
    np.testing.assert_allclose(found.axis_in_flange, axis, atol=1e-6)
    one = axis_between(ARM, short.subset(once), long.subset(once), table=PROBED, settings=SETTINGS)
    np.testing.assert_allclose(one.axis_in_flange, axis, atol=1e-6)
    assert one.region > found.region
    # in one posture the arm's errors of the two gauges and of the table cancel
    about = (
        touched(TIP, TABLE[[4] * 5], LEANS),
        touched(TIP + 0.15 * axis, TABLE[[4] * 5], 0.6 * LEANS),
    )
    fixed = axis_between(ARM, *about, settings=SETTINGS)
    assert found.region < fixed.region
    off = np.zeros((5, 3))
    off[2] = [0.0, 20.0 * MM, 0.0]
    with pytest.raises(ImplausibleDataError, match="touch t3 is"):
        axis_between(ARM, short, touched(TIP + 0.15 * axis, TABLE, upright, off), table=PROBED)


def test_the_axis_of_a_tool_squared_on_a_plane() -> None:
    spins = np.outer([0.0, 0.5, 1.0, -0.5], [0.0, 0.0, 1.0])
    squared = touched(TIP, TABLE[[4] * 4], spins)
    up = np.array([0.0, 0.0, 1.0])
    found = axis_on_plane(ARM, squared, up, sigma=0.05 * DEG, settings=SETTINGS)
    np.testing.assert_allclose(found.axis_in_flange, up, atol=1e-9)
    leaning = spins.copy()
    leaning[2] = [0.3, 0.0, 0.0]
    with pytest.raises(ImplausibleDataError, match=r"squaring t3 puts the axis \d+\.\d\d deg"):
        axis_on_plane(ARM, touched(TIP, TABLE[[4] * 4], leaning), up, sigma=0.05 * DEG)
    with pytest.raises(ConfigurationError, match="a normal of length 0"):
        axis_on_plane(ARM, squared, 0.0 * up, sigma=0.05 * DEG)
