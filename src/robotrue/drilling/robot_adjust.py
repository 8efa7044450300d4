"""The same adjustment on a six-axis robot: turn about the tip, through the calibrated model.

The sensors are on the actual spindle, so the turn starts from the actual pose, and the joints to
command are those at which the *actual* axis lies on the normal and the *actual* tip is where it
was.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel, Query
from robotrue.core.arrays import Array, frozen
from robotrue.core.poses import pose
from robotrue.core.rotations import (
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
)
from robotrue.core.units import DEG, MM
from robotrue.drilling.head import tilt_between
from robotrue.errors import ConfigurationError, ConvergenceError, ReachError, ShapeError
from robotrue.program.lang import languages
from robotrue.robot.forward import forward, joint_jacobian, walk
from robotrue.robot.statics import NO_LOAD, Load

STEPS: Final = 12
TOLERANCE: Final = 1e-10
"""m and rad left between actual and wanted pose."""
FARTHEST: Final = 45.0 * DEG
"""rad a joint may turn in one adjustment: more is another way of standing there."""
LEAST: Final = 5e-3
"""Smallest singular value of the Jacobian in units of the reach that is still no singularity."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotMove:
    """Robot move that squares the spindle.

    Attributes:
        joints: (n,) rad, model's sense, to be commanded.
        T_base_tool: (4, 4) nominal pose of those joints: the command to the controller.
        turn: rad, angle the spindle axis turns by.
        rotation_known: Whether the model predicts the rotation error there; if not, the error of
            the tool axis is that of the nominal robot.
    """

    joints: Array
    T_base_tool: Array
    turn: float
    rotation_known: bool


def squaring_joints(
    model: ErrorModel,
    joints: Array,
    normal: Array,
    *,
    R_tool_foot: Array | None = None,
    load: Load = NO_LOAD,
) -> RobotMove:
    """Returns the joints that lay the spindle along the normal and leave its tip in place.

    The turn is the smallest one; the spin about the drill stays as it is.

    Args:
        model: The calibrated robot, its tool at the drill's tip.
        joints: (n,) rad, commanded now.
        normal: (3,) unit, the surface's normal in the foot's frame (z along the spindle).
        R_tool_foot: (3, 3) foot in tool; identity where the tool's z is the foot's.
        load: Payload and clamp force.

    Raises:
        ShapeError: A normal that points away from the spindle.
        ReachError: A joint limit, a singularity, or joints that would have to turn far.
        ConvergenceError: The joints were not found.
    """
    q = np.array(frozen(joints, (model.robot.dof,), "joints"))
    n = frozen(normal, (3,), "normal") / np.linalg.norm(normal)
    if not n[2] > 0.0:
        raise ShapeError("a normal with z not above 0 is behind the foot.")
    seat = np.eye(3) if R_tool_foot is None else frozen(R_tool_foot, (3, 3), "R_tool_foot")
    start, known = actual_pose(model, q, load)
    turn = seat @ _shortest(n) @ seat.T
    goal = pose(start[:3, :3] @ turn, start[:3, 3])
    found = _solve_pose(model, q, goal, load)
    _require_near(model, q, found)
    nominal = forward(model.robot.nominal(), found[None])[0]
    angle = float(tilt_between(np.array([0.0, 0.0, 1.0]), n))
    return RobotMove(joints=found, T_base_tool=nominal, turn=angle, rotation_known=known)


def actual_pose(model: ErrorModel, joints: Array, load: Load = NO_LOAD) -> tuple[Array, bool]:
    """Returns where the tool really is (4, 4) in base, and whether its rotation error is known."""
    nominal = forward(model.robot.nominal(), joints[None])[0]
    found = model.predict(Query(joints=joints[None], load=load))
    turn = found.rotation_error[0]
    known = bool(np.isfinite(turn).all())
    rotation = matrix_from_rotation_vector(turn if known else np.zeros(3)) @ nominal[:3, :3]
    return pose(rotation, nominal[:3, 3] + found.error[0]), known


def _shortest(normal: Array) -> Array:
    """(3, 3) smallest rotation that takes z to the normal."""
    axis = np.array([-normal[1], normal[0], 0.0])
    sine = float(np.linalg.norm(axis))
    if sine == 0.0:
        return np.eye(3)
    return matrix_from_rotation_vector(axis / sine * np.arctan2(sine, normal[2]))


def _solve_pose(model: ErrorModel, joints: Array, goal: Array, load: Load) -> Array:
    """(n,) rad: Newton on the actual pose with the nominal Jacobian."""
    robot, q = model.robot.nominal(), np.array(joints)
    scale = np.repeat([1.0 / robot.reach, 1.0], 3)
    for _ in range(STEPS):
        now, _ = actual_pose(model, q, load)
        turn = rotation_vector_from_matrix(goal[:3, :3] @ now[:3, :3].T)
        left = np.concatenate([goal[:3, 3] - now[:3, 3], turn])
        if np.abs(left).max() < TOLERANCE:
            return q
        slope = joint_jacobian(robot, walk(robot, q[None]))[0]
        if np.linalg.svd(scale[:, None] * slope, compute_uv=False)[-1] < LEAST:
            raise ReachError(
                "the arm is singular at this hole.",
                hint="turn the part or the spin about the drill, and clamp again.",
            )
        q = q + np.linalg.lstsq(slope, left, rcond=None)[0]
    raise ConvergenceError(
        f"{np.abs(left[:3]).max() / MM:.6f} mm and {np.abs(left[3:]).max() / DEG:.6f} deg "
        f"residual after {STEPS} steps.",
        hint="clamp nearer to the nominal normal.",
    )


def _require_near(model: ErrorModel, before: Array, after: Array) -> None:
    limits = model.robot.limits
    outside = np.flatnonzero((after < limits[:, 0]) | (after > limits[:, 1]))
    if len(outside):
        k = int(outside[0])
        raise ReachError(
            f"joint {k + 1} would be at {after[k] / DEG:.2f} deg, allowed are "
            f"{limits[k, 0] / DEG:.1f} to {limits[k, 1] / DEG:.1f} deg.",
            hint="another spin about the drill, and clamp again.",
        )
    step = np.abs(after - before)
    if step.max() > FARTHEST:
        raise ReachError(
            f"joint {int(np.argmax(step)) + 1} would turn by {step.max() / DEG:.1f} deg for one "
            "adjustment: the arm is near a singularity.",
            hint="another spin about the drill, and clamp again.",
        )


def robot_fragment(language: str, T_base_tool: Array) -> str:
    """Returns one straight move to a pose in the robot's own base, without approximation.

    In RAPID the tool is called ``drill`` and the work object ``base``: one at the robot's base.

    Args:
        language: One that prints a move: ``"krl"``, ``"rapid"`` or ``"urscript"``.
        T_base_tool: (4, 4), pose commanded to the controller.

    Raises:
        ConfigurationError: Another language.
    """
    printers = {known.name: known.print_move for known in languages().values() if known.print_move}
    if language not in printers:
        raise ConfigurationError(
            f"no fragments in {language!r}; there are {', '.join(printers)}.", hint="--as krl"
        )
    return printers[language](T_base_tool)
