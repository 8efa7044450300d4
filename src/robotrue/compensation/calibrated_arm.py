"""The mean of an error model as the compiled inversion reads it; see :mod:`robotrue.robot.chain`.

q_drive  = (1 + gear) q + ripple(q) + backlash * approach + compliance * torque(q, load)
T_actual = chain(theta = joint_map @ q_drive + theta_0 + dtheta); position += residual(q)
"""

from __future__ import annotations

from typing import Final, NamedTuple, TypeAlias

import numpy as np

from robotrue.calibration.terms.term import MeanTables
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import inverse
from robotrue.errors import ConfigurationError
from robotrue.robot.chain import (
    chain_dtype,
    error_pose,
    link_constants,
    link_frames,
    link_masses,
    links_dtype,
    masses_dtype,
)
from robotrue.robot.opw import OpwGeometry, opw_geometry

MOST_FILLED = 8
"""Harmonics of the recurrence for each harmonic that is present."""
DOF: Final = 6

CLOSED_FORM_DTYPE: Final = np.dtype(
    [
        ("exists", np.bool_),
        *((name, np.float64) for name in ("a1", "a2", "b", "c1", "c2", "c3", "c4")),
        ("sign", np.float64, (DOF,)),
        ("offset", np.float64, (DOF,)),
        ("T_tool_wrist", np.float64, (3, 4)),
    ],
    align=True,
)
"""Nominal arm with a spherical wrist, see :class:`robotrue.robot.opw.OpwGeometry`; m, rad."""
ARM_DTYPE: Final = np.dtype(
    [
        ("nominal", links_dtype(DOF)),
        ("actual", links_dtype(DOF)),
        ("masses", masses_dtype(DOF)),
        ("closed", CLOSED_FORM_DTYPE),
        ("coupled", np.bool_),
        ("coupling", np.float64, (DOF, DOF)),
        ("uncoupling", np.float64, (DOF, DOF)),
        ("zero", np.float64, (DOF,)),
        ("offset", np.float64, (DOF,)),
        ("gear", np.float64, (DOF,)),
        ("compliance", np.float64, (DOF,)),
        ("backlash", np.float64, (DOF,)),
        ("flange", np.float64, (3, 4)),
        ("feature_scale", np.float64, (2 * DOF,)),
        ("limits", np.float64, (DOF, 2)),
        ("length", np.float64),
    ],
    align=True,
)
"""One arm with one tool.

``nominal`` what the controller computes with, ``actual`` the calibrated chain; ``coupling`` the
joint_map and its inverse, ``coupled`` whether it differs from the identity; ``zero`` rad of the DH
table, ``offset`` rad of its error; ``gear`` relative error; ``compliance`` rad/(N m); ``backlash``
rad per sign of approach; ``flange`` in the frame turned by joint 6; ``feature_scale`` 1 / length;
``length`` m that make translation comparable to rotation: half the reach.
"""
WORK_DTYPE: Final = np.dtype(
    [
        ("nominal", chain_dtype(DOF)),
        ("actual", chain_dtype(DOF)),
        ("target", np.float64, (3, 4)),
        ("joints", np.float64, (DOF,)),
        ("approach", np.float64, (DOF,)),
        ("payload", np.float64, (4,)),
        ("wrench", np.float64, (6,)),
        ("shift", np.float64, (DOF,)),
        ("feature", np.float64, (2 * DOF,)),
        ("residual", np.float64, (3,)),
        ("residual_at", np.float64, (DOF,)),
        ("before", np.float64, (3,)),
        ("singular", np.float64),
        ("error", np.float64, (6,)),
        ("step", np.float64, (DOF,)),
        ("jacobian", np.float64, (6, DOF)),
        ("inverse", np.float64, (DOF, 6)),
        ("pivot", np.int64, (DOF,)),
        ("theta", np.float64, (DOF,)),
        ("trial", np.float64, (DOF,)),
        ("hand", np.float64, (3, 4)),
    ],
    align=True,
)
"""Working memory of one thread for one target."""
WorkArray: TypeAlias = np.ndarray[tuple[int], np.dtype[np.void]]


class CalibratedArm(NamedTuple):
    """An arm with every tool of a program, and its tables of any length.

    Attributes:
        arms: (t,) of ``ARM_DTYPE``, one per tool.
        harmonics: (h,) cycles per revolution.
        consecutive: Whether they are 1, 2, ..., h.
        ripple: (h, 12) rad, sine then cosine amplitudes of the six drives.
        centres: (12, m) scaled features of the smooth residual.
        half_square: (m,) half the squared length of each centre.
        weights: (3, m) m.
    """

    arms: np.ndarray[tuple[int], np.dtype[np.void]]
    harmonics: Array
    consecutive: bool
    ripple: Array
    centres: Array
    half_square: Array
    weights: Array

    @property
    def limits(self) -> Array:
        """(6, 2) rad."""
        limits: Array = self.arms["limits"][0]
        return limits

    @property
    def has_closed_form(self) -> bool:
        """True if the nominal inverse has a closed form."""
        return bool(self.arms["closed"]["exists"].all())


class Chunk(NamedTuple):
    """n targets of a program as the inversion reads them; loads are n rows or one.

    Attributes:
        frames: (f, 4, 4) work frames in base.
        frame: (n,) index of the frame.
        tool: (n,) index of the tool.
        route: (n,) :class:`~robotrue.compensation.status.Route`.
        target: (n, 3, 4) tool in base.
        nominal: (n, 6) rad, nominal joints of the targets; NaN where there are none.
        approach: (n, 6) sign of the last motion.
        jump: (n,) a straight move that jumps.
        mass: kg.
        com: (.., 3) m.
        wrench: (.., 6) N, N m.
    """

    frames: Array
    frame: IntArray
    tool: IntArray
    route: IntArray
    target: Array
    nominal: Array
    approach: Array
    jump: BoolArray
    mass: Array
    com: Array
    wrench: Array


class InversionLimits(NamedTuple):
    """When the inversion has arrived, and what is refused; see ``CompensationSettings``.

    Attributes:
        reuse: rad of joint motion up to which the smooth residual is not computed again.
    """

    tolerance: float
    turn_tolerance: float
    min_singular_value: float
    min_wrist_sine: float
    min_shift: float
    max_shift: float
    max_turn: float
    reuse: float


class Outcome(NamedTuple):
    """Results of n targets while they are being written; columns as in ``Compensation``.

    Attributes:
        position: (n, 3) m, in the work frame.
        rotation: (n, 9).
        joints: (n, 6) rad.
        status: (n,).
        before: (n, 3) m.
        after: (n, 3) m.
        shift: (n, 3) m.
        turn: (n,) rad.
        singular: (n,).
        covariance: (n, 3, 3) m^2, or empty.
    """

    position: Array
    rotation: Array
    joints: Array
    status: IntArray
    before: Array
    after: Array
    shift: Array
    turn: Array
    singular: Array
    covariance: Array


def calibrated_arm(tables: MeanTables, tools: Array, keep_tool_error: BoolArray) -> CalibratedArm:
    """Returns the tables for the tools of a program.

    Args:
        tables: Mean of the error model.
        tools: (t, 4, 4) ``T_flange_tool`` of the program.
        keep_tool_error: (t,) True where the tool is the one that was measured, whose identified
            errors then belong to it.

    Raises:
        ConfigurationError: The arm has not six joints.
    """
    robot = tables.robot
    if robot.dof != DOF:
        raise ConfigurationError(
            f"robot {robot.name!r} has {robot.dof} joints; programs are compensated for arms of 6."
        )
    arms = np.zeros(len(tools), ARM_DTYPE)
    nominal, error_of_tool = robot.nominal(), error_pose(robot.error("tool"))
    for arm, tool, keep in zip(arms, tools, keep_tool_error, strict=True):
        arm["nominal"]["constant"] = link_constants(nominal, tool)
        arm["actual"]["constant"] = link_constants(robot, tool @ error_of_tool if keep else tool)
    frames, geometry = link_frames(nominal), opw_geometry(nominal)
    arms["masses"] = link_masses(robot, frames)
    arms["coupling"], arms["uncoupling"] = robot.joint_map, np.linalg.inv(robot.joint_map)
    arms["coupled"] = not np.array_equal(robot.joint_map, np.eye(DOF))
    arms["zero"], arms["offset"] = robot.theta, robot.error("theta")
    arms["gear"], arms["compliance"] = robot.error("gear"), robot.error("compliance")
    arms["backlash"], arms["feature_scale"] = tables.backlash, tables.scale
    arms["flange"] = frames[-1, :3]
    arms["limits"], arms["length"] = robot.limits, 0.5 * robot.reach
    if geometry is not None:
        _write_closed_form(arms["closed"], geometry, tools)
    harmonics, ripple = _ripple(tables)
    return CalibratedArm(
        arms=arms,
        harmonics=harmonics,
        consecutive=bool(np.array_equal(harmonics, np.arange(1, len(harmonics) + 1))),
        ripple=ripple,
        centres=np.array(tables.centres.T, order="C"),
        half_square=0.5 * np.sum(tables.centres**2, axis=1),
        weights=np.array(tables.weights.T, order="C"),
    )


def _write_closed_form(
    closed: np.ndarray[tuple[int], np.dtype[np.void]], geometry: OpwGeometry, tools: Array
) -> None:
    closed["exists"] = True
    for name in ("a1", "a2", "b", "c1", "c2", "c3", "c4", "sign", "offset"):
        closed[name] = getattr(geometry, name)
    closed["T_tool_wrist"] = inverse(geometry.T_opw_flange @ tools)[:, :3]


def _ripple(tables: MeanTables) -> tuple[Array, Array]:
    """Returns harmonics (h,) and amplitudes (h, 12), gaps between harmonics filled with zeros.

    Filled they are summed by recurrence, which is ten times faster than sines one by one.
    """
    harmonics = np.array(tables.harmonics)
    amplitude = np.concatenate([tables.ripple_sin, tables.ripple_cos]).T.copy(order="C")
    whole = np.asarray(np.rint(harmonics), dtype=np.int64)
    last = int(whole.max(initial=0))
    if not np.array_equal(whole, harmonics) or whole.min(initial=1) < 1:
        return harmonics, amplitude
    if last > MOST_FILLED * max(len(whole), 1):
        return harmonics, amplitude
    dense = np.zeros((last, 2 * DOF))
    np.add.at(dense, whole - 1, amplitude)
    return np.arange(1.0, last + 1.0), dense
