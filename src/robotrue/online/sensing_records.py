"""Records of the sensing kernels: what their numbers are called.

All fields are float64, so that a record is also a row of numbers, as checkpoints keep it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array, Records
from robotrue.core.poses import inverse
from robotrue.core.units import STANDARD_GRAVITY
from robotrue.dynamics.oscillators import Oscillators
from robotrue.dynamics.predict import RINGS
from robotrue.dynamics.streaming import ModalFilter
from robotrue.dynamics.windows import force_range
from robotrue.errors import ReachError
from robotrue.online.sensing_models import (
    MeasuredResponse,
    PoseResponse,
    SensingModels,
    SensingSettings,
)
from robotrue.online.sensing_pose import Constants
from robotrue.robot.chain import chain_dtype, links_of
from robotrue.robot.forward import drive_jacobian, walk

HEAD: Final = 7
"""Columns of a row of joints before the joints, see ``JointTrack``."""


def record_dtype(*fields: tuple[str, tuple[int, ...]]) -> np.dtype[np.void]:
    """Returns a record of float64 fields with these names and shapes."""
    return np.dtype([(name, np.float64, shape) for name, shape in fields])


def state_dtype(dof: int) -> np.dtype[np.void]:
    """Returns the record of what one force sample leaves to the next.

    Fields: ``last_time`` s; ``anchor`` and ``steps`` of the grid of samples; ``pending`` samples
    missing before this; ``started``; ``left`` samples until the filters settled; ``window_left``
    samples until the window is full; ``row`` of the joints; ``lost`` joints since the last start;
    ``debt`` of missing samples; ``wrench`` the last; ``stage_1``, ``stage_2`` two low-passes of
    it; ``squares_1``, ``squares_2`` two of the squared displacement; joints (rad) that the pose
    and the modes are of.
    """
    one = ("last_time", "anchor", "steps", "pending", "started", "left", "window_left", "row",
           "lost", "debt")  # fmt: skip
    return record_dtype(
        *((name, ()) for name in one),
        ("wrench", (6,)),
        ("stage_1", (6,)),
        ("stage_2", (6,)),
        ("squares_1", (3,)),
        ("squares_2", (3,)),
        ("joints_of_pose", (dof,)),
        ("joints_of_modes", (dof,)),
    )


_PARAMETERS: Final = (
    "rate", "joints_age", "soft", "bridged", "force_most", "longest_lever", "room", "refresh",
    "memory", "held_mass", "learned", "offset", "window", "misfit",
)  # fmt: skip
PARAMETERS_DTYPE: Final = record_dtype(*((name, ()) for name in _PARAMETERS))
"""Numbers of models and settings: Hz, s, gain of the low-passes, samples, N, m, rad, rad, samples,
kg, 1 with a learned deviation, m, samples, part of the displacement."""
POSE_DTYPE: Final = record_dtype(
    ("read", (3, 3)), ("lever", (3,)), ("turned", (3, 3)), ("added", (3, 6)), ("still", (3, 6)),
    ("physics", (3,)), ("spread", (3, 6, 6)), ("zero", (3,)),
)  # fmt: skip
"""Numbers of a pose, see :func:`robotrue.online.sensing_pose.write_pose`."""
WORK_DTYPE: Final = record_dtype(
    ("index", ()), ("turned", (3, 3)), ("added", (3,)), ("still", (3,)), ("spread", (3,)),
    ("physics", ()), ("along", ()),
)  # fmt: skip
"""A sample that enters the filters: its index in the block, -1 inside a bridged gap, and what is
added to what the filters make of it."""


def new_record(dtype: np.dtype[np.void]) -> Records:
    """Returns one record of zeros, shape (1,)."""
    return np.zeros(1, dtype)


def numbers_of(record: Records) -> Array:
    """Returns the numbers of one record (k,), a view."""
    return record.view(np.float64)


_STAGES: Final = 1.5
"""Two low-passes take so much longer to forget than one."""


def parameters(
    models: SensingModels, settings: SensingSettings, own: Oscillators | None
) -> Records:
    """Returns ``PARAMETERS_DTYPE`` (1,); ``own`` is what is filtered with, or None."""
    record = new_record(PARAMETERS_DTYPE)
    p, held, learned, response = record[0], models.held, models.learned, models.response
    p["rate"], p["joints_age"] = models.rate, settings.joints_age
    p["soft"] = -np.expm1(-2.0 * np.pi * settings.static_band / models.rate)
    p["bridged"], p["force_most"] = settings.bridged, settings.force_most
    p["room"] = response.room if isinstance(response, MeasuredResponse) else np.inf
    p["longest_lever"] = settings.lever
    p["refresh"] = response.refresh if isinstance(response, PoseResponse) else np.inf
    p["misfit"] = 0.0 if response is None else response.misfit
    if held is not None:
        p["held_mass"] = held.mass if settings.acceleration_samples > 0 else 0.0
    forgets = _STAGES * RINGS / (2.0 * np.pi * settings.static_band)
    if own is not None and len(own):
        forgets = max(forgets, RINGS / float(-own.poles.real.max()))
    memory = float(np.ceil(forgets * models.rate))
    if learned is not None:
        rows = max(round(learned.window * models.rate), 1)
        memory = (np.ceil(memory / rows) + 1.0) * rows
        p["learned"], p["window"] = 1.0, rows
        p["offset"] = learned.model.by_sample.offset
    p["memory"] = memory
    return record


def constants(models: SensingModels, settings: SensingSettings) -> Constants:
    """Returns the models as the kernels take them.

    Raises:
        ReachError: A response measured at a pose outside the limits of the joints.
    """
    robot, response, dof = models.robot, models.response, models.robot.dof
    zero = settings.force_zero
    held = np.zeros((4, 3))
    if models.held is not None:
        tool = models.held
        held = np.array([tool.weight_in_base, tool.centre, tool.force_offset, tool.moment_offset])
        zero = float(np.hypot(tool.force_offset_sd.max(), tool.mass_sd * STANDARD_GRAVITY))
    compliance, covariance = np.zeros(dof), np.zeros((dof, dof))
    if isinstance(response, PoseResponse):
        compliance = 1.0 / response.arm.stiffness
    elif models.compliance is not None:
        compliance = np.array(models.compliance.compliance)
        covariance = np.array(models.compliance.covariance)
    home, jacobian, rest = np.full(dof, np.nan), np.zeros((3, dof)), np.zeros((3, 3))
    if isinstance(response, PoseResponse):
        rest = response.tool.static
    elif response is not None:
        _check_limits(models, response.joints)
        home = np.array(response.joints)
        state = walk(robot, home[None])
        jacobian = drive_jacobian(robot, state)[0, :3]
        if response.frame == "tool":
            jacobian = state.rotation[0].T @ jacobian
        rest = response.oscillators.static - (jacobian * compliance) @ jacobian.T
    return Constants(
        links=links_of(robot.nominal()),
        chain=np.zeros(1, chain_dtype(dof)),
        zero_angle=np.array(robot.theta),
        joint_map=np.array(robot.joint_map),
        limits=np.array(robot.limits),
        T_tool_sensor=np.ascontiguousarray(inverse(robot.T_flange_tool) @ models.T_flange_sensor),
        weight=held[0],
        centre=held[1],
        force_offset=held[2],
        moment_offset=held[3],
        compliance=compliance,
        covariance=np.ascontiguousarray(covariance),
        home=home,
        home_jacobian=np.ascontiguousarray(jacobian),
        rest=np.array(rest),
        **_learned_constants(models),
        own=float(not isinstance(response, PoseResponse)),
        turns=isinstance(response, MeasuredResponse) and response.frame == "tool",
        zero_sd=zero,
        projected=models.learned is not None,
    )


def noise_variance(
    own: Oscillators | None, models: SensingModels, settings: SensingSettings
) -> Array:
    """Returns (3,) m^2: what white noise of the force becomes in the filters' output."""
    if own is None:
        return np.zeros(3)
    size = settings.force_noise if models.held is None else models.held.force_noise
    steps = 2 + int(np.ceil(RINGS / float(-own.poles.real.max()) * models.rate)) if len(own) else 2
    total = np.zeros(3)
    for axis in range(3):
        knock = np.zeros((steps, 3))
        knock[1, axis] = size
        total += (ModalFilter(own, models.rate).push(knock) ** 2).sum(axis=0)
    return total


def _learned_constants(models: SensingModels) -> dict[str, Array]:
    """Returns the constants of the learned deviation; zeros without one."""
    if models.learned is None:
        dof = models.robot.dof
        empty = ("learned_tool", "direction", "force_low", "force_high")
        return {"learned_compliance": np.zeros(dof), **{name: np.zeros(3) for name in empty}}
    model = models.learned.model
    low, high = force_range(model.windows)
    return {
        "learned_compliance": np.array(model.by_sample.compliance),
        "learned_tool": np.array(model.by_sample.tool),
        "direction": np.array(model.arm.direction),
        "force_low": low,
        "force_high": high,
    }


def _check_limits(models: SensingModels, joints: Array) -> None:
    limits = models.robot.limits
    beyond = np.flatnonzero((joints < limits[:, 0]) | (joints > limits[:, 1]))
    if beyond.size:
        i = int(beyond[0])
        raise ReachError(
            f"the frequency response is of joint {i + 1} at {np.rad2deg(joints[i]):.2f} deg, "
            f"limits {np.rad2deg(limits[i, 0]):.1f} to {np.rad2deg(limits[i, 1]):.1f} deg.",
            hint="joints as the controller displays them, in deg.",
        )
