"""A milling arm's estimator and streams to feed it with, small enough for every test."""

import numpy as np

from robotrue.dynamics.oscillators import join_oscillators
from robotrue.dynamics.pose_modes import pose_modes
from robotrue.online.blocks import ForceBlock, JointBlock
from robotrue.online.sensing_models import JointCompliance, MeasuredResponse, SensingModels
from robotrue.simulation.milling_arm import milling_arm, milling_robot, pass_joints

RATE = 5000.0
JOINT_RATE = 250.0
ARM = milling_arm(1)
ROBOT = milling_robot()
HOME = pass_joints(np.array([0.25]))[0]


def compliance(sd=0.1):
    known = 1.0 / ARM.arm.stiffness
    return JointCompliance(compliance=known, covariance=np.diag((sd * known) ** 2))


def response(frame="base", **changes):
    own = join_oscillators([pose_modes(ARM.arm, HOME).oscillators(), ARM.tool])
    return MeasuredResponse(oscillators=own, joints=HOME, frame=frame, **changes)


def models(**changes):
    given = {"robot": ROBOT, "rate": RATE, "compliance": compliance(), "response": response()}
    return SensingModels(**{**given, **changes})


def joints_at(model_joints, time, **changes):
    n = len(time)
    given = {
        "controller_time": time,
        "host_time": time,
        "joints": ROBOT.controller.to_controller(model_joints),
        "T_frame_tool": np.full((n, 4, 4), np.nan),
        "sequence": np.arange(n),
        "flags": np.zeros(n, dtype=np.int64),
    }
    return JointBlock(**{**given, **changes})


def still(seconds=10.0, joints=HOME):
    """Joint samples of an arm that stands, a little before and after."""
    time = np.arange(-0.1, seconds, 1.0 / JOINT_RATE)
    return joints_at(np.tile(joints, (len(time), 1)), time)


def forces(values, frame="base", start=0.0, **changes):
    """A block of forces (n, 3) or wrenches (n, 6), evenly sampled."""
    n = len(values)
    wrench = np.full((n, 6), np.nan)
    wrench[:, : values.shape[1]] = values
    time = start + np.arange(n) / RATE
    given = {
        "controller_time": time,
        "host_time": time,
        "wrench": wrench,
        "frame": frame,
        "sequence": np.arange(n),
        "status": np.zeros(n, dtype=np.int64),
        "flags": np.zeros(n, dtype=np.int64),
    }
    return ForceBlock(**{**given, **changes})


def cutting(seconds, seed=0):
    """Forces (n, 3) N like those of a cut: two teeth, noise, a mean."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    waves = np.sin(2.0 * np.pi * 120.0 * time[:, None] + np.array([0.0, 1.0, 2.0]))
    return (
        np.array([-30.0, -4.0, 8.0])
        + np.array([40.0, 35.0, 10.0]) * waves
        + rng.normal(size=(len(time), 3))
    )


def part(block, which):
    """Rows of a block."""
    return block.take(which)
