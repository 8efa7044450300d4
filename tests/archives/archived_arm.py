"""The measurements behind the archived models: simulated, deterministic, no preset involved."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.statics import Load, deflect_arm

PAYLOAD = Load(mass=np.array([40.0]), com=np.array([[0.02, 0.0, 0.1]]))
ROWS = 120
LOW = [-120, -100, -10, -150, -100, -170]
HIGH = [120, -25, 110, 150, 100, 170]
COM = [
    [0.0, 0.0, -0.1],
    [0.4, 0.0, 0.1],
    [0.1, 0.05, 0.1],
    [0.0, 0.0, -0.3],
    [0.0, 0.0, 0.0],
    [0.0, 0.0, -0.05],
]


def nominal() -> RobotModel:
    tool = np.eye(4)
    tool[:3, 3] = 0.06, 0.04, 0.25
    return RobotModel(
        name="archived arm",
        convention="mdh",
        theta=np.array([0.0, 0.0, -np.pi / 2, 0.0, 0.0, np.pi]),
        d=np.array([0.6, 0.0, 0.0, 1.1, 0.0, 0.2]),
        a=np.array([0.0, 0.3, 1.0, 0.1, 0.0, 0.0]),
        alpha=np.array([0.0, -1.0, 0.0, -1.0, 1.0, -1.0]) * np.pi / 2,
        limits=np.deg2rad([LOW, HIGH]).T,
        link_mass=np.array([100.0, 72.0, 48.0, 16.0, 8.0, 4.0]),
        link_com=np.array(COM),
        T_flange_tool=tool,
    )


def postures(n: int, seed: int) -> Array:
    low, high = nominal().limits.T
    return low + (high - low) * np.random.default_rng(seed).random((n, 6))


def measured() -> MeasurementSet:
    """Rows of an arm with geometric errors, compliance and a ripple on two joints."""
    rng = np.random.default_rng(10)
    robot = nominal()
    errors = np.zeros(len(robot.errors))
    for group, sd in (("theta", 3e-4), ("d", 3e-4), ("a", 3e-4), ("alpha", 3e-4)):
        errors[parameter_slice(6, group)] = sd * rng.standard_normal(6)
    errors[parameter_slice(6, "compliance")] = 1e-6 / np.array([2.5, 2.2, 1.8, 0.4, 0.35, 0.25])
    joints = postures(ROWS, seed=11)
    approach = np.where(rng.random((ROWS, 6)) < 0.5, -1.0, 1.0)
    turned = joints.copy()
    turned[:, 1] += 1.5e-4 * np.sin(2 * joints[:, 1])
    turned[:, 2] += 1.0e-4 * np.sin(3 * joints[:, 2])
    position = deflect_arm(robot.with_errors(errors), turned, PAYLOAD)[0].position
    return MeasurementSet(
        joints=joints,
        position=position + 1.5e-5 * rng.standard_normal(position.shape),
        covariance=np.tile(1.5e-5**2 * np.eye(3), (ROWS, 1, 1)),
        approach=approach,
        group_names=("simulated",),
    )
