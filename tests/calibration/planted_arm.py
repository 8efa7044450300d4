"""A small heavy arm for the tests of this room: planted errors, simulated measurements."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.statics import Load, deflect_arm

PAYLOAD = Load(mass=np.array([60.0]), com=np.array([[0.05, 0.0, 0.15]]))


def arm(tool: tuple[float, float, float] = (0.08, 0.05, 0.30)) -> RobotModel:
    T = np.eye(4)
    T[:3, 3] = tool
    return RobotModel(
        name="heavy",
        convention="mdh",
        theta=np.array([0.0, 0.0, -np.pi / 2, 0.0, 0.0, np.pi]),
        d=np.array([0.645, 0.0, 0.0, 1.220, 0.0, 0.240]),
        a=np.array([0.0, 0.330, 1.150, 0.115, 0.0, 0.0]),
        alpha=np.array([0.0, -1.0, 0.0, -1.0, 1.0, -1.0]) * np.pi / 2,
        limits=np.deg2rad(
            [[-120, 120], [-100, -25], [-10, 110], [-150, 150], [-100, 100], [-170, 170]]
        ),
        link_mass=0.4 * np.array([250.0, 180.0, 120.0, 40.0, 20.0, 10.0]),
        link_com=np.array(
            [
                [0, 0, -0.1],
                [0.45, 0, 0.1],
                [0.1, 0.05, 0.1],
                [0, 0, -0.3],
                [0, 0, 0],
                [0, 0, -0.05],
            ]
        ),
        T_flange_tool=T,
    )


def planted(robot: RobotModel, rng: np.random.Generator, base: float = 1e-3) -> RobotModel:
    """The arm with random errors of 0.4 mm and 0.3 mrad, and compliance."""
    errors = np.zeros(len(robot.errors))
    dof = robot.dof
    for group, sd in (("theta", 3e-4), ("d", 4e-4), ("a", 4e-4), ("alpha", 3e-4), ("beta", 2e-4)):
        errors[parameter_slice(dof, group)] = sd * rng.standard_normal(dof)
    stiffness = 1e6 * np.array([2.5, 2.2, 1.8, 0.4, 0.35, 0.25])
    errors[parameter_slice(dof, "compliance")] = 1.0 / stiffness
    errors[parameter_slice(dof, "base")] = base * rng.standard_normal(6)
    errors[parameter_slice(dof, "tool")][:3] = 3e-4 * rng.standard_normal(3)
    return robot.with_errors(errors)


def postures(robot: RobotModel, n: int, rng: np.random.Generator) -> Array:
    low, high = robot.limits.T
    return low + (high - low) * rng.random((n, robot.dof))


def measure(
    actual: RobotModel,
    joints: Array,
    rng: np.random.Generator,
    *,
    sd: float = 2e-5,
    pose_sd: float | None = None,
    wrench: Array | None = None,
    T_tracker_base: Array | None = None,
) -> MeasurementSet:
    """Simulated measurements of the actual, loaded arm; ``sd`` m per axis, ``pose_sd`` rad."""
    n = len(joints)
    push = np.zeros((n, 6)) if wrench is None else wrench
    load = Load(mass=PAYLOAD.mass, com=PAYLOAD.com, wrench=push)
    state, _ = deflect_arm(actual, joints, load)
    T = np.eye(4) if T_tracker_base is None else T_tracker_base
    noise = sd * rng.standard_normal((n, 3))
    extra = {}
    if pose_sd is not None:
        turn = matrix_from_rotation_vector(pose_sd * rng.standard_normal((n, 3)))
        extra = {
            "rotation": T[:3, :3] @ turn @ state.rotation,
            "rotation_covariance": np.tile(pose_sd**2 * np.eye(3), (n, 1, 1)),
        }
    return MeasurementSet(
        joints=joints,
        position=(state.position + noise) @ T[:3, :3].T + T[:3, 3],
        covariance=np.tile(sd**2 * np.eye(3), (n, 1, 1)),
        frame="base" if T_tracker_base is None else "tracker",
        wrench=push,
        **extra,
    )


def ripple_shift(joints, cycles, sine, cosine):
    """Drive-side shift (n, dof) rad of amplitudes (dof, h) rad."""
    phase = joints[:, :, None] * cycles
    return (np.sin(phase) * sine + np.cos(phase) * cosine).sum(axis=2)
