"""The measured UR10 and UR5 files: rows, spot values, and the nominal misfit we know them by.

Spot values are the files' own digits. Misfits are ours, with the nominal DH of each maker and only
a rigid frame fitted; see the reference of data sets.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.core.arrays import Array
from robotrue.core.poses import apply, fit_rigid
from robotrue.core.units import DEG, MM
from robotrue.errors import ImplausibleDataError
from robotrue.measurement.formats.measured_files import read_measurements
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.plausibility import check_plausible
from robotrue.measurement.screening import screen
from robotrue.robot.forward import forward, parameter_jacobian, walk
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset

pytestmark = pytest.mark.data

A = "ur10-landgraf/Series_A/measurements_grid.csv"
B = "ur10-landgraf/Series_B/measurements_joint_configurations.csv"
GRID = "ur5-jacobi/3D_UR5_uncalibrated_grid_cleaned.csv"
RANDOM = "ur5-jacobi/3D_UR5_uncalibrated_random_cleaned.csv"


def arm(name: str, tool_mm: float) -> RobotModel:
    tool = np.eye(4)
    tool[2, 3] = tool_mm * MM
    return preset(name).with_tool(tool)


def point(robot: RobotModel, joints: Array) -> Array:
    return forward(robot, joints)[:, :3, 3]


def rigid_residual(robot: RobotModel, m: MeasurementSet) -> Array:
    """Returns measured minus nominal (n, 3) m in base, best rigid frame taken out."""
    commanded = point(robot, m.joints)
    T_frame_base = fit_rigid(commanded, m.position)
    return (m.position - apply(T_frame_base, commanded)) @ T_frame_base[:3, :3]


def mean_mm(residual: Array) -> float:
    return float(np.linalg.norm(residual, axis=1).mean() / MM)


def test_series_a(data_dir: Path) -> None:
    m = read_measurements(data_dir / A)
    assert (len(m), m.frame, m.dof) == (11911, "tracker", 6)
    np.testing.assert_allclose(m.position[0] / MM, [2361.9831, -1368.5474, 119.39713])
    np.testing.assert_allclose(m.joints[0], [-1.5708, -1.5708, 0.0, -1.5708, 0.0, 0.0])
    assert m.temperature[0] == pytest.approx(296.83)
    assert m.has_rotation.all()
    assert m.source_row[-1] == 11912


def test_measured_orientation_is_the_t_mac(data_dir: Path) -> None:
    """One constant rotation on each side leaves the 0.09 deg known for series A."""
    m = read_measurements(data_dir / A).subset(np.arange(0, 11911, 10))
    robot = arm("UR10", 100.0)
    T = forward(robot, m.joints)
    R_tracker_base = fit_rigid(T[:, :3, 3], m.position)[:3, :3]
    seen = np.swapaxes(T[:, :3, :3], 1, 2) @ R_tracker_base.T @ m.rotation
    u, _, vt = np.linalg.svd(seen.mean(axis=0))
    off = np.swapaxes(seen, 1, 2) @ (u @ vt)
    cosine = np.clip((np.trace(off, axis1=1, axis2=2) - 1) / 2, -1, 1)
    assert np.degrees(np.arccos(cosine)).mean() < 0.25


def test_series_b(data_dir: Path) -> None:
    m = read_measurements(data_dir / B)
    assert (len(m), m.frame) == (1495, "tracker")
    np.testing.assert_allclose(m.position[0] / MM, [383.76294, -3240.8734, 201.93157])
    std = np.sqrt(np.diagonal(m.covariance, axis1=1, axis2=2)) / MM
    np.testing.assert_allclose(std[0], [0.031674, 0.013252, 0.0037622])
    turn = np.sqrt(np.trace(m.rotation_covariance[0])) / DEG
    # The three angle axes of the first row are 20 deg from orthogonal; the trace does not care.
    assert turn == pytest.approx(np.linalg.norm([0.0011832, 0.0013871, 0.0041345]), rel=1e-6)


def test_ur5(data_dir: Path) -> None:
    grid, random = (read_measurements(data_dir / name) for name in (GRID, RANDOM))
    assert (len(grid), len(random), grid.frame) == (1000, 20, "base")
    assert not grid.has_rotation.any()
    np.testing.assert_allclose(
        grid.position[0] / MM,
        [-430.32784075885013 + 2.144122241149887, -6.2740647628546 + 3.5212628, -99.4512617900406],
        rtol=1e-6,
    )
    raw = [grid.position - point(arm("UR5", 31.0), grid.joints)]
    raw.append(random.position - point(arm("UR5", 31.0), random.joints))
    # |target - actual| as the data set's notes give it: 2.635 and 2.565 mm.
    assert mean_mm(raw[0]) == pytest.approx(2.635, abs=0.01)
    assert mean_mm(raw[1]) == pytest.approx(2.565, abs=0.01)


@pytest.mark.parametrize(
    ("name", "file", "tool_mm", "known"),
    [("UR10", A, 100.0, 0.756), ("UR10", B, 100.0, 1.042), ("UR5", GRID, 31.0, 0.621)],
)
def test_nominal_misfit(data_dir: Path, name: str, file: str, tool_mm: float, known: float) -> None:
    """Nominal DH with base frame and tool point fitted, mean mm; held out it was ``known``."""
    m = read_measurements(data_dir / file)
    robot = arm(name, tool_mm)
    residual = rigid_residual(robot, m)
    columns = parameter_jacobian(robot, walk(robot, m.joints), m.joints)[:, :3, -12:-3]
    design = columns.reshape(-1, 9)
    step, *_ = np.linalg.lstsq(design, residual.ravel(), rcond=1e-9)
    assert mean_mm(residual - (design @ step).reshape(-1, 3)) == pytest.approx(known, rel=0.04)


@pytest.mark.parametrize(
    ("name", "file", "tool_mm"),
    [("UR10", A, 100.0), ("UR10", B, 100.0), ("UR5", GRID, 31.0), ("UR5", RANDOM, 31.0)],
)
def test_plausible_for_the_right_robot_only(
    data_dir: Path, name: str, file: str, tool_mm: float
) -> None:
    m = read_measurements(data_dir / file)
    right = arm(name, tool_mm)
    assert check_plausible(m, point(right, m.joints), right.reach) == ()
    for other in ("UR5", "UR10", "KUKA KR160 R1570", "ABB IRB 120-3/0.6"):
        wrong = preset(other)
        if other != name:
            with pytest.raises(ImplausibleDataError, match="not the measured robot"):
                check_plausible(m, point(wrong, m.joints), wrong.reach)


def test_gross_outliers_of_series_b(data_dir: Path) -> None:
    """Rows 532, 854 and 855 (lines 534, 856, 857), and no other, after a linear DH fit."""
    m = read_measurements(data_dir / B)
    robot = arm("UR10", 109.0)
    residual = rigid_residual(robot, m)
    columns = parameter_jacobian(robot, walk(robot, m.joints), m.joints)[:, :3]
    # Angles to 5 mrad, lengths to 3 mm, base and tool wide; gear and all that bends is fixed.
    prior = np.r_[
        np.full(6, 5e-3), np.full(12, 3e-3), np.full(12, 5e-3), np.zeros(24), np.full(9, 0.02)
    ]
    design = columns.reshape(-1, columns.shape[-1])[:, : len(prior)] * prior
    normal = design.T @ design + 1e-8 * np.eye(len(prior))
    left = residual - (design @ np.linalg.solve(normal, design.T @ residual.ravel())).reshape(-1, 3)
    assert mean_mm(left) == pytest.approx(0.39, abs=0.02)
    result = screen(m, left, np.tile(np.eye(3) * 5e-5**2, (len(m), 1, 1)))
    assert [finding.line for finding in result.findings] == [534, 856, 857]
