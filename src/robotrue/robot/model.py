"""The robot as data: nominal geometry, as in the controller, and its errors.

The *nominal* robot is what the controller computes with: rigid, error-free. The *actual* robot is
the nominal one plus ``errors``, one flat vector with a fixed layout (:func:`parameter_names`).
All errors zero is the nominal robot, so "before" and "after" are the same code.

Kinematics (``convention``)::

    T_base_tool = base . link_1 ... link_n . T_flange_tool . tool
    dh   link_i = Rz(theta_i) Tz(d_i) Tx(a_i) Rx(alpha_i) Ry(beta_i)
    mdh  link_i = Rx(alpha_i) Tx(a_i) Ry(beta_i) Rz(theta_i) Tz(d_i)

``base`` and ``tool`` are error poses Tx Ty Tz Rx Ry Rz, in that order. The joint angle is

    theta = theta_0 + dtheta + joint_map @ ((1 + gear) * q + ripple + compliance * torque)

with ``torque`` on the drives from gravity, payload and wrench (:mod:`robotrue.robot.statics`).
``moment_x``, ``moment_y`` are first moments of the links that add to the torque of gravity.
In ``mdh`` alpha_i and a_i belong to the axis *before* joint i (Craig's alpha_{i-1}, a_{i-1}).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.core.files import sha256
from robotrue.core.model_identity import ModelIdentity
from robotrue.core.units import STANDARD_GRAVITY
from robotrue.errors import ConfigurationError, ShapeError

Convention: TypeAlias = Literal["dh", "mdh"]

MOMENTS: Final = ("moment_x", "moment_y")
"""First moments of the links beyond what ``link_mass`` and ``link_com`` give, see
:func:`robotrue.robot.statics.weight_torque`."""
PER_JOINT: Final = ("theta", "d", "a", "alpha", "beta", "gear", "compliance", *MOMENTS)
"""Error parameters that exist once per joint, in the order of the flat vector."""
_IDENTITY_DIGITS: Final = 9
"""Decimals of m and rad that count; a table written in mm and deg and read again is the same."""
POSE_TERMS: Final = ("x", "y", "z", "rx", "ry", "rz")
UNITS: Final[Mapping[str, str]] = {
    "theta": "rad",
    "d": "m",
    "a": "m",
    "alpha": "rad",
    "beta": "rad",
    "gear": "1",
    "compliance": "rad/(N m)",
    "moment_x": "kg m",
    "moment_y": "kg m",
    "base": "m or rad",
    "tool": "m or rad",
}


def parameter_names(dof: int) -> tuple[str, ...]:
    """Returns the names of the error vector: ``theta1 .. moment_y6, base_x .. tool_rz``."""
    joints = tuple(f"{term}{i + 1}" for term in PER_JOINT for i in range(dof))
    frames = tuple(f"{frame}_{term}" for frame in ("base", "tool") for term in POSE_TERMS)
    return joints + frames


def parameter_slice(dof: int, group: str) -> slice:
    """Returns the slice of a group (a name of ``PER_JOINT``, ``"base"`` or ``"tool"``).

    Raises:
        ConfigurationError: No such group.
    """
    if group in PER_JOINT:
        start = PER_JOINT.index(group) * dof
        return slice(start, start + dof)
    if group in ("base", "tool"):
        start = len(PER_JOINT) * dof + (6 if group == "tool" else 0)
        return slice(start, start + 6)
    raise ConfigurationError(
        f"no parameter group {group!r}; groups are {(*PER_JOINT, 'base', 'tool')}."
    )


def moment_slice(dof: int) -> slice:
    """Returns the place of the groups :data:`MOMENTS`, one after the other."""
    return slice(parameter_slice(dof, MOMENTS[0]).start, parameter_slice(dof, MOMENTS[-1]).stop)


@dataclass(frozen=True, slots=True, kw_only=True)
class Configuration:
    """Axis convention of the controller, for programs: ``A = coupling @ (sign * q + offset)``.

    Attributes:
        sign: (n,) +1 or -1.
        offset: (n,) rad.
        coupling: (n, n) where an axis is displayed against another than the one before it (Fanuc's
            J3 against the horizontal); empty where none is.
    """

    sign: Array
    offset: Array
    coupling: Array = field(default_factory=lambda: np.empty((0, 0)))

    def to_controller(self, joints: Array) -> Array:
        """Returns the controller's axis values in rad from model joints (..., n) rad."""
        axes: Array = self.sign * joints + self.offset
        return axes @ self.coupling.T if self.coupling.size else axes

    def to_model(self, axes: Array) -> Array:
        """Returns model joints in rad from the controller's axis values (..., n) rad."""
        if self.coupling.size:
            axes = axes @ np.linalg.inv(self.coupling).T
        return self.sign * (axes - self.offset)


def _full_turns(joints: int, _: int) -> Array:
    """Limits (joints, 2) rad of an arm whose limits are not stated."""
    return np.tile([-2.0 * np.pi, 2.0 * np.pi], (joints, 1))


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotModel(Columns):
    """A serial arm of n revolute joints, its nominal geometry and its errors.

    Attributes:
        name: Preset or user name.
        convention: ``"dh"`` (standard) or ``"mdh"`` (modified, Craig).
        theta: (n,) rad, joint offset of the DH table.
        d: (n,) m.
        a: (n,) m.
        alpha: (n,) rad.
        beta: (n,) rad, turn about y that a factory calibration gives a link; else zeros.
        joint_map: (n, n), theta = joint_map @ q; identity, or the coupling of a parallelogram.
        limits: (n, 2) rad, lower and upper limit of q.
        link_mass: (n,) kg; zeros where unknown.
        link_com: (n, 3) m, centre of mass in the link's own DH frame.
        total_mass: kg of the whole arm with its foot, as on its plate; 0 where unknown.
        T_flange_tool: (4, 4), the tool the controller uses (or the reflector).
        gravity: (3,) m/s^2 in the base frame.
        errors: (9 n + 12,) SI, layout of :func:`parameter_names`; zero is nominal.
        controller: How the controller counts the axes; as q where not stated.
        maker: Brand, chooses the configuration bits (``"kuka"``, ``"abb"``, ...).
        dof: Number of joints n.
    """

    name: str
    convention: Convention
    theta: Annotated[Array, Column("n", unit="rad")]
    d: Annotated[Array, Column("n", unit="m")]
    a: Annotated[Array, Column("n", unit="m")]
    alpha: Annotated[Array, Column("n", unit="rad")]
    beta: Annotated[Array, Column("n", unit="rad", fill=0.0)] = EMPTY
    joint_map: Annotated[Array, Column("n n", fill=np.eye)] = EMPTY
    limits: Annotated[Array, Column("n 2", unit="rad", fill=_full_turns)] = EMPTY
    link_mass: Annotated[Array, Column("n", unit="kg", fill=0.0)] = EMPTY
    link_com: Annotated[Array, Column("n 3", unit="m", fill=0.0)] = EMPTY
    T_flange_tool: Annotated[Array, Column("4 4")] = field(default_factory=lambda: np.eye(4))
    gravity: Annotated[Array, Column("3", unit="m/s^2")] = field(
        default_factory=lambda: np.array([0.0, 0.0, -STANDARD_GRAVITY])
    )
    errors: Annotated[Array, Column("errors", fill=0.0)] = EMPTY
    controller: Configuration = EMPTY
    maker: str = "generic"
    total_mass: float = 0.0
    dof: int = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Checks shapes, convention and limits."""
        n = len(self.d)
        object.__setattr__(self, "dof", n)
        self._check_columns(n=n, errors=len(PER_JOINT) * n + 12)
        if self.convention not in ("dh", "mdh"):
            raise ConfigurationError(f"convention {self.convention!r}, expected 'dh' or 'mdh'.")
        if not self.controller:
            as_joints = Configuration(sign=np.ones(n), offset=np.zeros(n))
            object.__setattr__(self, "controller", as_joints)
        if (self.limits[:, 0] >= self.limits[:, 1]).any():
            raise ShapeError("limits: every lower joint limit must be below its upper one.")

    @property
    def reach(self) -> float:
        """Upper bound in m of the distance from the base origin to the tool point."""
        links = np.abs(self.a).sum() + np.abs(self.d).sum()
        return float(links + np.linalg.norm(self.T_flange_tool[:3, 3]))

    def error(self, group: str) -> Array:
        """Returns one group of the error vector, e.g. ``error("compliance")`` (n,) rad/(N m)."""
        return self.errors[parameter_slice(self.dof, group)]

    @property
    def moments(self) -> Array:
        """(2 n,) kg m, the groups :data:`MOMENTS`: along x of every link, then along y."""
        return self.errors[moment_slice(self.dof)]

    def nominal(self) -> RobotModel:
        """Returns the robot model of the controller: all errors zero, rigid."""
        if not self.errors.any():
            return self
        return replace(self, errors=np.zeros_like(self.errors))

    def with_errors(self, errors: Array) -> RobotModel:
        """Returns the robot with another error vector."""
        return replace(self, errors=errors)

    def with_tool(self, T_flange_tool: Array) -> RobotModel:
        """Returns the robot with another tool; the errors of the old tool do not carry over."""
        tool = parameter_slice(self.dof, "tool")
        if np.array_equal(T_flange_tool, self.T_flange_tool) and not self.errors[tool].any():
            return self
        errors = self.errors.copy()
        errors[tool] = 0.0
        return replace(self, T_flange_tool=T_flange_tool, errors=errors)


def nominal_identity(robot: RobotModel) -> ModelIdentity:
    """Returns the identity of the arm as its controller computes it.

    Convention, DH table, joint coupling and the sense of the joints count; tool, limits, masses and
    identified errors do not: they may differ between touching and machining.
    """
    return ModelIdentity(kind="nominal", robot=robot.name, sha256=sha256(_nominal_bytes(robot)))


def same_geometry(robot: RobotModel, other: RobotModel) -> bool:
    """Returns whether two arms have one :func:`nominal_identity`, whatever their names."""
    return _nominal_bytes(robot) == _nominal_bytes(other)


def _nominal_bytes(robot: RobotModel) -> bytes:
    parts = [robot.convention.encode()]
    names = ("theta", "d", "a", "alpha", "joint_map", *(("beta",) if robot.beta.any() else ()))
    for name in names:
        # A rounded -0.0 is 0.0.
        values = (
            np.round(np.asarray(getattr(robot, name), dtype=np.float64), _IDENTITY_DIGITS) + 0.0
        )
        parts.append(name.encode() + values.tobytes())
    return b"\0".join(parts)
