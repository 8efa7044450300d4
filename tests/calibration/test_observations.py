"""Analytic Jacobians of every observation against central differences."""

from __future__ import annotations

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, measure, planted, postures

from robotrue.calibration.observations import observations_of
from robotrue.calibration.parameters import ParameterLayout, State, difference, retract
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.measurement.measurement_set import concatenate

STEP = 1e-6


def problem(kind):
    rng = np.random.default_rng(3)
    robot = arm()
    actual = planted(robot, rng)
    joints = postures(robot, 8, rng)
    wrench = 300.0 * rng.standard_normal((8, 6))
    station = pose(matrix_from_rotation_vector(np.array([0.2, -0.3, 2.0])), np.array([3.0, -2, 1]))
    options = {"wrench": wrench, "pose_sd": 1e-2 if kind in ("pose", "target pose") else None}
    if kind != "base":
        options["T_tracker_base"] = station
    data = measure(actual, joints, rng, **options)
    targets = {}
    if kind.startswith("target"):
        other = measure(actual, joints, rng, **options)
        moved = concatenate([data, other])
        data = type(moved)(
            **{
                name: getattr(moved, name)
                for name, each in moved.__dataclass_fields__.items()
                if each.init and name != "target"
            },
            target=np.repeat([0, 1], 8),
        )
        targets = {1: pose(matrix_from_rotation_vector(np.array([0.1, 0.2, 0.3])), [0.1, 0.2, 0.3])}
    layout = ParameterLayout(
        dof=6,
        stations=() if data.frame == "base" else (0,),
        targets=((1, 6 if kind == "target pose" else 3),) if targets else (),
    )
    state = State(
        robot=robot.with_errors(0.5 * actual.errors),
        T_tracker_base={} if data.frame == "base" else {0: station},
        T_flange_target=targets,
    )
    (seen,) = observations_of(robot, data, PAYLOAD, repeatability=1e-5, rotation_sd=1e-4)
    return layout, state, seen


@pytest.mark.parametrize("kind", ["base", "tracker", "pose", "target point", "target pose"])
def test_jacobian_is_the_derivative(kind):
    layout, state, seen = problem(kind)
    analytic = seen.linearise(layout, state).jacobian
    for i, name in enumerate(layout.names):
        step = np.zeros(layout.size)
        step[i] = 1e-9 if name.startswith("compliance") else STEP
        up = seen.linearise(layout, retract(layout, state, step)).residual
        down = seen.linearise(layout, retract(layout, state, -step)).residual
        numeric = (down - up) / (2.0 * step[i])
        scale = 1.0 + np.abs(numeric).max()
        np.testing.assert_allclose(analytic[:, :, i], numeric, atol=1e-7 * scale, err_msg=name)


def test_retract_and_difference_are_inverse():
    layout, state, _ = problem("target pose")
    step = 1e-3 * np.random.default_rng(0).standard_normal(layout.size)
    np.testing.assert_allclose(
        difference(layout, retract(layout, state, step), state), step, atol=1e-15
    )
