"""Arms with seven joints: every method of a tracker calibration copes, and so do archives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.calibration.archive import open_model
from robotrue.calibration.methods import METHODS, fit
from robotrue.calibration.model import Query
from robotrue.core.archive import read_archive, write_archive
from robotrue.core.poses import pose
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.presets import preset
from robotrue.robot.statics import deflect_arm

NOISE = 2e-5


def measured(robot: RobotModel) -> tuple[MeasurementSet, MeasurementSet]:
    """Poses of an arm with planted errors: 90 to fit, 60 without noise to compare."""
    rng = np.random.default_rng(3)
    errors = np.zeros_like(robot.errors)
    for group, sd in (("theta", 1e-3), ("d", 3e-4), ("a", 3e-4), ("alpha", 5e-4)):
        errors[parameter_slice(7, group)] = sd * rng.normal(size=7)
    errors[parameter_slice(7, "compliance")] = 1e-5
    joints = rng.uniform(*robot.limits.T, (150, 7))
    position = deflect_arm(robot.with_errors(errors), joints)[0].position
    position[:90] += NOISE * rng.normal(size=(90, 3))
    rows = MeasurementSet(
        joints=joints, position=position, covariance=np.tile(NOISE**2 * np.eye(3), (150, 1, 1))
    )
    return rows.subset(np.arange(90)), rows.subset(np.arange(90, 150))


@pytest.mark.parametrize("name", ["panda", "iiwa14"])
@pytest.mark.parametrize("method", [m for m in METHODS if m != "nominal"])
def test_every_method_calibrates_an_arm_with_seven_joints(
    tmp_path: Path, name: str, method: str
) -> None:
    robot = preset(name).with_tool(pose(np.eye(3), np.array([0.03, 0.01, 0.14])))
    rows, truth = measured(robot)
    model = fit(robot, rows, method=method)
    found = model.predict(Query(joints=truth.joints))
    before = truth.position - forward(robot, truth.joints)[:, :3, 3]
    left = np.linalg.norm(before - found.error, axis=1)
    assert np.linalg.norm(before, axis=1).mean() > 0.8e-3
    # Without compliance what gravity bends is left over.
    assert left.mean() < (2.5e-4 if method == "geometric" else 3.0 * NOISE)
    write_archive(tmp_path / "model.rtm", model.to_archive())
    again = open_model(read_archive(tmp_path / "model.rtm"))
    np.testing.assert_array_equal(again.predict(Query(joints=truth.joints)).error, found.error)
