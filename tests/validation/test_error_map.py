"""Maps of a workspace: truth of the numbers, empty cells, symmetry about joint 1."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.settings import FitSettings
from robotrue.core.regions import CubeRegion, CylinderRegion
from robotrue.core.units import DEG
from robotrue.errors import ReachError, ShapeError
from robotrue.robot.forward import forward
from robotrue.robot.model import parameter_slice
from robotrue.robot.presets import preset
from robotrue.validation.error_map import (
    build_prior_model,
    error_map,
    radius_95,
    sector_similarities,
)

TOOL = np.array([0.0, 150.0, 0.0]) * DEG
POSTURE = np.array([0.0, 0.0, 0.0, 0.0, -60.0, 0.0]) * DEG
CYLINDER = CylinderRegion(angle=(-40 * DEG, 40 * DEG), radius=(0.9, 1.8), height=(0.7, 1.3))


def model_of(seed: int = 0, *, base: float = 0.0) -> CalibratedModel:
    robot = preset("kr160")
    rng = np.random.default_rng(seed)
    errors = np.zeros_like(robot.errors)
    for group in ("theta", "d", "a", "alpha"):
        errors[parameter_slice(6, group)] = 3e-4 * rng.standard_normal(6)
    errors[parameter_slice(6, "base")] = base * rng.standard_normal(6)
    return CalibratedModel(
        robot=robot,
        errors=errors,
        covariance=1e-10 * np.eye(len(errors)),
        repeatability=1e-5,
        white=0.0,
    )


def test_error_is_actual_minus_commanded_where_the_map_says():
    model = model_of()
    found = error_map(model, CYLINDER, (8, 4, 3), tool_abc=TOOL, near=POSTURE)
    able = found.reachable
    joints = found.joints[able]
    nominal = forward(model.robot, joints)[:, :3, 3]
    assert np.abs(nominal - found.point[able]).max() < 1e-9
    actual = forward(model.actual, joints)[:, :3, 3]
    assert np.abs(actual - nominal - found.error[able]).max() < 1e-12
    radius = np.hypot(found.point[:, 0], found.point[:, 1])
    assert 0 < (~able).sum() < len(able) / 2
    assert radius[~able].min() > 1.3
    assert np.isnan(found.error[~able]).all()
    assert np.isnan(found.bound[~able]).all()
    assert np.isnan(found.norm[~able]).all()


def test_without_base_errors_a_turning_attitude_sees_the_same_length_in_every_sector():
    found = error_map(model_of(), CYLINDER, (8, 4, 3), tool_abc=TOOL, near=POSTURE)
    lengths = found.grid(found.norm)
    assert np.nanmax(np.abs(lengths - lengths[:1])) < 1e-9
    alike = sector_similarities(found)
    assert [(s.first, s.second) for s in alike][:3] == [(0, 1), (0, 2), (0, 3)]
    assert all(s.norm == pytest.approx(1.0) for s in alike)
    assert alike[0].vector > alike[2].vector
    other = error_map(model_of(base=1e-3), CYLINDER, (8, 4, 3), tool_abc=TOOL, near=POSTURE)
    lengths = other.grid(other.norm)
    assert np.nanmax(np.abs(lengths - lengths[:1])) > 1e-4


def test_attitude_is_what_was_asked_for():
    cube = CubeRegion(x=(0.9, 1.2), y=(-0.4, 0.4), z=(0.7, 1.1))
    model = model_of()
    fixed = error_map(model, cube, (2, 4, 2), tool_abc=TOOL, attitude="fixed", near=POSTURE)
    rotation = forward(model.robot, fixed.joints)[:, :3, :3]
    assert np.abs(rotation - rotation[0]).max() < 1e-9
    turning = error_map(model, cube, (2, 4, 2), tool_abc=TOOL, near=POSTURE)
    assert np.abs(turning.joints[:, [3, 5]]).max() < 1e-9
    assert fixed.along == 1
    assert fixed.grid(fixed.sector)[0, :, 0].tolist() == [0, 1, 2, 3]


def test_an_arm_without_a_closed_inverse_is_mapped_too():
    robot = preset("ur10")
    cube = CubeRegion(x=(0.4, 0.7), y=(-0.4, 0.4), z=(0.2, 0.5))
    down = np.array([0.0, 180.0, 0.0]) * DEG
    found = error_map(
        build_prior_model(robot, FitSettings()), cube, (2, 4, 2), tool_abc=down, attitude="fixed"
    )
    assert found.reachable.all()
    nominal = forward(robot, found.joints)[:, :3, 3]
    assert np.abs(nominal - found.point).max() < 1e-8
    low, high = robot.limits.T
    assert ((found.joints >= low) & (found.joints <= high)).all()


@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 1, 0), (1, 0, 0), (1, 0.5, 0.1), (1, 0.9, 0.0)])
def test_radius_holds_95_percent(shape):
    rng = np.random.default_rng(3)
    covariance = np.diag(np.square(shape))
    drawn = rng.standard_normal((400_000, 3)) * shape
    radius = radius_95(covariance[None])[0]
    held = (np.linalg.norm(drawn, axis=1) <= radius).mean()
    assert held == pytest.approx(0.95, abs=0.004)


def test_refusals():
    model = model_of()
    with pytest.raises(ShapeError, match="7 grid values do not fall into 4 sectors"):
        error_map(model, CYLINDER, (7, 4, 3), tool_abc=TOOL)
    far = CylinderRegion(angle=(0.0, 1.0), radius=(5.0, 6.0), height=(0.0, 1.0))
    with pytest.raises(ReachError, match="none of 16 points of the region can be taken"):
        error_map(model, far, (4, 2, 2), tool_abc=TOOL)
