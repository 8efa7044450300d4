"""The mean of an error model, laid out as the kernels read it.

Between two joint rotations every transform of the chain is constant, so a chain of six joints is
seven constant transforms ``C`` and six turns about z::

    T_base_tool = C_0 Rz(theta_1) C_1 Rz(theta_2) ... Rz(theta_6) C_6

A transform is one row of twelve numbers, the rotation row by row and then the position in m.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robotrue.calibration.tables import MeanTables
from robotrue.compensation.memory import LANES
from robotrue.core.arrays import Array, BoolArray
from robotrue.core.poses import inverse, pose
from robotrue.core.rotations import matrix_from_abc
from robotrue.errors import ConfigurationError
from robotrue.robot.model import RobotModel
from robotrue.robot.opw import opw_geometry

MOST_FILLED = 8  # harmonics of the recurrence per harmonic that is there


class Pack(NamedTuple):
    """Flat arrays for :mod:`robotrue.compensation.lanes`; SI units.

    Attributes:
        nominal: (6, 12) C_0..C_5 of what the controller computes with.
        nominal_end: (t, 12) C_6 per tool.
        actual: (6, 12) the same of the calibrated arm.
        actual_end: (t, 12).
        zero: (6,) rad, joint offset of the DH table.
        coupling: (6, 6) joint_map.
        uncoupling: (6, 6) its inverse.
        coupled: Whether joint_map differs from the identity.
        dtheta: (6,) rad, joint offset errors.
        gear: (6,) gear errors.
        compliance: (6,) rad/(N m).
        backlash: (6,) rad per approach sign.
        harmonics: (h,) cycles per revolution.
        consecutive: Whether they are 1, 2, ..., h, with h a multiple of four.
        ripple: (h, 12) rad, sine then cosine amplitudes of the six drives.
        mass_out: (6,) kg of each link and everything outboard of it.
        com: (6, 4) kg m first moment (x, y, z) of each link behind its joint, and its mass.
        flange: (12,) flange behind joint 6.
        gravity: (3,) m/s^2.
        table: (b, 16 * LANES) as many centres of the smooth residual at a time as there are
            lanes: 12 scaled features, minus half the squared length, and 3 weights in m.
        scale: (12,) 1 / length of each feature.
        opw: (7,) a1, a2, b, c1, c2, c3, c4 in m; NaN for an arm of another kind.
        opw_sign: (6,).
        opw_offset: (6,) rad.
        opw_end: (t, 12) wrist flange in the tool.
        limits: (6, 2) rad.
        length: m that make a metre of translation comparable to a radian: half the reach.
    """

    nominal: Array
    nominal_end: Array
    actual: Array
    actual_end: Array
    zero: Array
    coupling: Array
    uncoupling: Array
    coupled: bool
    dtheta: Array
    gear: Array
    compliance: Array
    backlash: Array
    harmonics: Array
    consecutive: bool
    ripple: Array
    mass_out: Array
    com: Array
    flange: Array
    gravity: Array
    table: Array
    scale: Array
    opw: Array
    opw_sign: Array
    opw_offset: Array
    opw_end: Array
    limits: Array
    length: float


def pack_tables(tables: MeanTables, tools: Array, keep_tool_error: BoolArray) -> Pack:
    """Returns the tables as the kernels read them.

    Args:
        tables: Mean of the error model.
        tools: (t, 4, 4) ``T_flange_tool`` of the program.
        keep_tool_error: (t,) True where the tool is the one that was measured, whose identified
            errors then belong to it.

    Raises:
        ConfigurationError: The arm has not six joints.
    """
    robot = tables.robot
    if robot.dof != 6:
        raise ConfigurationError(
            f"robot {robot.name!r} has {robot.dof} joints; programs are compensated for arms of 6."
        )
    nominal_links, nominal_last, _ = _constants(robot.nominal())
    actual_links, actual_last, _ = _constants(robot)
    error_tool = _error_pose(robot.error("tool"))
    ends = [
        t @ (error_tool if keep else np.eye(4))
        for t, keep in zip(tools, keep_tool_error, strict=True)
    ]
    opw, sign, offset, opw_end = _opw(robot, tools)
    _, _, behind = _constants(robot.nominal())
    first = np.empty((6, 4))
    for i in range(6):
        centre = behind[i][:3, :3] @ robot.link_com[i] + behind[i][:3, 3]
        first[i] = [*(robot.link_mass[i] * centre), robot.link_mass[i]]
    harmonics, ripple = _ripple(tables)
    return Pack(
        nominal=_rows(nominal_links),
        nominal_end=_rows([nominal_last @ t for t in tools]),
        actual=_rows(actual_links),
        actual_end=_rows([actual_last @ t for t in ends]),
        zero=_own(robot.theta),
        coupling=_own(robot.joint_map),
        uncoupling=np.array(np.linalg.inv(robot.joint_map), dtype=np.float64),
        coupled=not np.array_equal(robot.joint_map, np.eye(6)),
        dtheta=_own(robot.error("theta")),
        gear=_own(robot.error("gear")),
        compliance=_own(robot.error("compliance")),
        backlash=_own(tables.backlash),
        harmonics=harmonics,
        consecutive=bool(np.array_equal(harmonics, np.arange(1, len(harmonics) + 1))),
        ripple=ripple,
        mass_out=_own(np.cumsum(robot.link_mass[::-1])[::-1]),
        com=first,
        flange=_rows([behind[5]])[0],
        gravity=_own(robot.gravity),
        table=_table(tables),
        scale=_own(tables.scale),
        opw=opw,
        opw_sign=sign,
        opw_offset=offset,
        opw_end=opw_end,
        limits=_own(robot.limits),
        length=0.5 * robot.reach,
    )


def _ripple(tables: MeanTables) -> tuple[Array, Array]:
    """Returns harmonics (h,) and amplitudes (h, 12), gaps between harmonics filled with zeros.

    Filled they are summed by recurrence, which is ten times faster than sines one by one.
    """
    harmonics = tables.harmonics
    amplitude = _own(np.concatenate([tables.ripple_sin, tables.ripple_cos]).T)
    whole = np.asarray(np.rint(harmonics), dtype=np.int64)
    last = int(whole.max(initial=0))
    if not np.array_equal(whole, harmonics) or whole.min(initial=1) < 1:
        return _own(harmonics), amplitude
    if last > MOST_FILLED * max(len(whole), 1):
        return _own(harmonics), amplitude
    filled = -(-last // 4) * 4
    dense = np.zeros((filled, 12))
    np.add.at(dense, whole - 1, amplitude)
    return np.arange(1.0, filled + 1.0), dense


def _table(tables: MeanTables) -> Array:
    """Returns the centres of the smooth residual in blocks of LANES; blanks have no weight."""
    count = len(tables.centres)
    blocks = -(-count // LANES)
    rows = np.zeros((blocks * LANES, 16))
    rows[:count, :12] = tables.centres
    rows[:count, 12] = -0.5 * np.sum(tables.centres**2, axis=1)
    rows[:count, 13:] = tables.weights
    return _own(np.swapaxes(rows.reshape(blocks, LANES, 16), 1, 2)).reshape(blocks, 16 * LANES)


def _own(values: Array) -> Array:
    """Returns a writeable, contiguous copy: one array type for every pack, one compilation."""
    return np.array(values, dtype=np.float64, order="C")


def _rows(transforms: list[Array]) -> Array:
    return _own(np.array([np.concatenate([t[:3, :3].ravel(), t[:3, 3]]) for t in transforms]))


def _constants(robot: RobotModel) -> tuple[list[Array], Array, list[Array]]:
    """Returns C_0..C_5, what follows joint 6 up to the flange, and what stands behind each joint.

    The last are the link frames in the frame turned by their joint: centres of mass are given
    in them.
    """
    d = robot.d + robot.error("d")
    a = robot.a + robot.error("a")
    alpha = robot.alpha + robot.error("alpha")
    beta = robot.error("beta")
    before, behind = [], []
    for i in range(robot.dof):
        along_z = _shift(0.0, d[i])
        side = _shift(a[i], 0.0)
        if robot.convention == "dh":
            before.append(np.eye(4))
            behind.append(along_z @ side @ _turn("x", alpha[i]) @ _turn("y", beta[i]))
        else:
            before.append(_turn("x", alpha[i]) @ side @ _turn("y", beta[i]))
            behind.append(along_z)
    links = [_error_pose(robot.error("base")) @ before[0]]
    links += [behind[i] @ before[i + 1] for i in range(robot.dof - 1)]
    return links, behind[-1], behind


def _shift(x: float, z: float) -> Array:
    return pose(np.eye(3), np.array([x, 0.0, z]))


def _turn(axis: str, angle: float) -> Array:
    order = {"z": 0, "y": 1, "x": 2}
    abc = np.zeros(3)
    abc[order[axis]] = angle
    return pose(matrix_from_abc(abc), np.zeros(3))


def _error_pose(values: Array) -> Array:
    """Returns Tx Ty Tz Rx Ry Rz."""
    turned = _turn("x", values[3]) @ _turn("y", values[4]) @ _turn("z", values[5])
    return pose(turned[:3, :3], values[:3])


def _opw(robot: RobotModel, tools: Array) -> tuple[Array, Array, Array, Array]:
    geometry = opw_geometry(robot)
    if geometry is None:
        return np.full(7, np.nan), np.ones(6), np.zeros(6), np.zeros((len(tools), 12))
    g = geometry
    lengths = np.array([g.a1, g.a2, g.b, g.c1, g.c2, g.c3, g.c4])
    back = [inverse(g.T_opw_flange @ tool) for tool in tools]
    return lengths, _own(g.sign), _own(g.offset), _rows(back)
