"""A machining cell whose truth is known: KR160, a block to be probed and cut from three sides.

The cell of every simulated figure of registration. All sizes are **assumed**, in the range of
production arms; the paper (Feng, Liang, Xi 2018) prints none of its robot.

===================  =======================================================================
arm                  nominal + a, d N(0, .3 mm), alpha, theta N(0, .02 deg), beta of link 2 same
gravity              200 kg at the wrist point, 60 kg at the elbow; joints 2 and 3 wind up by
                     abs(N(0, .02 deg)) per 200 kg m
no model has it      one harmonic per joint, abs(N(0, .008 deg)), 2 to 8 cycles per turn
tool                 300 mm along flange z, true tip off by N(0, .3 mm) per axis
scatter              .03 mm per axis and visit; touch .1 mm per axis; tracker .03 mm per axis
block                400 x 200 x 400 mm around (1000, 0, 600), N(0, 3 deg) about each axis through
                     its centre and N(0, 6 mm)
===================  =======================================================================

Frame ``part`` sits at the block's corner: x 0..400, y 0..200, z 0..400 mm. The front is y = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np

from robotrue.calibration.model import ErrorModel, Query
from robotrue.core.arrays import Array, frozen
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import apply, inverse, pose
from robotrue.core.provenance import Provenance
from robotrue.core.rotations import matrix_from_abc, matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ReachError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.inverse import branch_of, inverse_batch
from robotrue.robot.inverse_numeric import solve
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.presets import preset
from robotrue.robot.statics import NO_LOAD
from robotrue.simulation.virtual_robot import UnmodelledEffects, VirtualRobot, drive_shift

Posture: TypeAlias = Literal["R", "L", "T"]
"""Side the tool comes from. R: axis along +y, at the front; L: along -y, at the back; T: above."""

START: Final[dict[Posture, Array]] = {
    "R": np.array([-27.2, -29.9, -1.4, 75.0, -113.0, 55.6]) * DEG,
    "L": np.array([27.2, -29.9, -1.4, -75.0, -113.0, -55.6]) * DEG,
    "T": np.array([0.0, -3.4, 9.6, 0.0, -96.1, 180.0]) * DEG,
}
"""Joints (6,) rad with the tip near the block; they fix the branch and the attitude."""
SIZE: Final = np.array([400.0, 200.0, 400.0]) * MM
"""Edges of the block, part axes."""
T_BASE_DRAWN: Final = pose(np.eye(3), np.array([800.0, -100.0, 400.0]) * MM)
"""Where the drawing has the block, (4, 4)."""
T_BASE_FLIPPED: Final = pose(np.diag([-1.0, -1.0, 1.0]), np.array([1200.0, 100.0, 400.0]) * MM)
"""Where the drawing has the block after half a turn about the vertical through its centre."""
TOOL: Final = pose(np.eye(3), np.array([0.0, 0.0, 300.0]) * MM)
"""The tip of the controller, T_flange_tool."""
WRIST_MASS: Final = 200.0
ELBOW_MASS: Final = 60.0
FACES: Final[dict[Posture, tuple[int, float]]] = {
    "R": (1, 0.0),
    "L": (1, SIZE[1]),
    "T": (2, SIZE[2]),
}
"""Face each posture looks at: axis across it, and its coordinate in part, m."""
EDGE: Final = 10.0 * MM
"""Nothing is touched nearer to an edge than this."""
_ROUNDS: Final = 6
_NEAR: Final = 1e-9
"""m; a touch found nearer than this is found."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CellSizes:
    """Sizes of the true errors and of the probing noise. SI.

    Attributes:
        arm: Factor on all errors of the arm, harmonics included.
        tip: m per axis, N(0, tip), of the true tool tip.
        spindle: rad about each flange axis, N(0, spindle), by which the spindle is mounted askew.
        touch: m per axis of one touch.
        repeatability: m per axis of one visit.
        tracker: m per axis of the instrument.
    """

    arm: float = 1.0
    tip: float = 0.3 * MM
    spindle: float = 0.0
    touch: float = 0.1 * MM
    repeatability: float = 0.03 * MM
    tracker: float = 0.03 * MM

    def __post_init__(self) -> None:
        """Refuses negative sizes.

        Raises:
            ConfigurationError: One is negative or no number.
        """
        for name in self.__slots__:
            if not getattr(self, name) >= 0.0:
                raise ConfigurationError(f"{name} is {getattr(self, name)}, expected 0 or more.")


@dataclass(frozen=True, slots=True, kw_only=True)
class FengCell(Columns):
    """One frozen cell.

    Attributes:
        seed: It was drawn from.
        sizes: It was drawn with.
        robot: The arm: ``nominal`` is what the user knows, ``actual`` and ``effects`` the truth.
        T_base_part: (4, 4) where the block truly is.
    """

    seed: int
    sizes: CellSizes
    robot: VirtualRobot
    T_base_part: Annotated[Array, Column("4 4")]

    @property
    def nominal(self) -> RobotModel:
        """Model of controller and user: geometry, masses, nominal tool, no errors."""
        return self.robot.nominal


def feng_cell(seed: int, sizes: CellSizes | None = None) -> FengCell:
    """Returns the cell of a seed; equal seeds give equal cells, whatever the sizes scale.

    Args:
        seed: Any non-negative integer.
        sizes: Of errors and noise; default as in the table above.
    """
    own = CellSizes() if sizes is None else sizes
    rng = np.random.default_rng([seed, 41])
    nominal = replace(
        preset("KUKA KR160 R1570").with_tool(TOOL),
        link_mass=np.array([0.0, ELBOW_MASS, 0.0, WRIST_MASS, 0.0, 0.0]),
        link_com=np.zeros((6, 3)),
        # Limits left aside: one branch then serves every point of the block.
        limits=np.tile([-2.0 * np.pi, 2.0 * np.pi], (6, 1)),
    )
    errors = np.zeros_like(nominal.errors)
    for group, sigma in (
        ("a", 0.3 * MM),
        ("d", 0.3 * MM),
        ("alpha", 0.02 * DEG),
        ("theta", 0.02 * DEG),
    ):
        errors[parameter_slice(6, group)] = own.arm * sigma * rng.normal(size=6)
    errors[parameter_slice(6, "beta")][1] = own.arm * 0.02 * DEG * rng.normal()
    moment = WRIST_MASS * float(np.linalg.norm(nominal.gravity))  # N m per metre of overhang
    wind_up = own.arm * np.abs(0.02 * DEG * rng.normal(size=2)) / moment
    errors[parameter_slice(6, "compliance")][1:3] = wind_up
    amplitude = own.arm * 0.008 * DEG * np.abs(rng.normal(size=6))
    order, phase = rng.integers(2, 9, 6), rng.uniform(0.0, 2.0 * np.pi, 6)
    tool = TOOL.copy()
    tool[:3, 3] += own.tip * rng.normal(size=3)
    askew = pose(matrix_from_rotation_vector(own.spindle * rng.normal(size=3)), np.zeros(3))
    turn = pose(matrix_from_abc(3.0 * DEG * rng.normal(size=3)), np.zeros(3))
    shift = pose(np.eye(3), 6.0 * MM * rng.normal(size=3))
    centre = pose(np.eye(3), 0.5 * SIZE)
    robot = VirtualRobot(
        name=f"simulated KR160, cell {seed}",
        nominal=nominal,
        actual=nominal.with_tool(askew @ tool).with_errors(errors),
        payload=NO_LOAD,
        effects=_harmonics(seed, amplitude, order.astype(np.float64), phase),
        repeatability=own.repeatability,
    )
    place = shift @ T_BASE_DRAWN @ centre @ turn @ inverse(centre)
    return FengCell(seed=seed, sizes=own, robot=robot, T_base_part=place)


def _harmonics(seed: int, amplitude: Array, order: Array, phase: Array) -> UnmodelledEffects:
    """One sine per joint and nothing else."""
    return UnmodelledEffects(
        seed=seed,
        level=1.0,
        cycles=order[:, None],
        sine=(amplitude * np.cos(phase))[:, None],
        cosine=(amplitude * np.sin(phase))[:, None],
        backlash=np.zeros(6),
        torque_0=np.ones(6),
        approach=np.zeros(6),
        stiffening=np.zeros(6),
        bending=0.0,
        tilt=np.zeros(2),
    )


def with_tip(cell: FengCell, shift: Array) -> FengCell:
    """Returns the cell with its true tip moved by (3,) m in tool axes."""
    tool = cell.robot.actual.T_flange_tool.copy()
    tool[:3, 3] += tool[:3, :3] @ shift
    actual = replace(cell.robot.actual, T_flange_tool=tool)
    return replace(cell, robot=replace(cell.robot, actual=actual))


def with_tool_change(cell: FengCell, rng: np.random.Generator) -> FengCell:
    """Returns the cell after an unmeasured tool change: tip moved by N(0, .3 mm) per axis."""
    return with_tip(cell, 0.3 * MM * rng.normal(size=3))


def flip_block(cell: FengCell, rng: np.random.Generator) -> FengCell:
    """Returns the cell with the block turned end for end, its back to the front, clamped again.

    The new clamping has errors of N(0, 3 deg) and N(0, 6 mm) like the first, about the drawing of
    the turned block, :data:`T_BASE_FLIPPED`.
    """
    turn = pose(matrix_from_abc(3.0 * DEG * rng.normal(size=3)), np.zeros(3))
    shift = pose(np.eye(3), 6.0 * MM * rng.normal(size=3))
    centre = pose(np.eye(3), 0.5 * SIZE)
    return replace(cell, T_base_part=shift @ T_BASE_FLIPPED @ centre @ turn @ inverse(centre))


@cache
def attitude(posture: Posture) -> Array:
    """Returns the tool's attitude R_base_tool (3, 3) in a posture, nominal."""
    robot = preset("KUKA KR160 R1570").with_tool(TOOL)
    rotation: Array = frozen(forward(robot, START[posture][None])[0, :3, :3], (3, 3), "attitude")
    return rotation


@cache
def _branch(posture: Posture) -> int:
    return branch_of(preset("KUKA KR160 R1570"), START[posture])


def touch_points(posture: Posture, count: int, rng: np.random.Generator) -> Array:
    """Returns points (n, 3) m in part, spread over the face a posture looks at.

    Uniform within 10 mm of the edges.
    """
    axis, level = FACES[posture]
    points: Array = rng.uniform(EDGE, SIZE - EDGE, (count, 3))
    points[:, axis] = level
    return points


def touch(
    cell: FengCell,
    p_part: Array,
    posture: Posture,
    rng: np.random.Generator,
    *,
    tilt: float = 0.0,
) -> Array:
    """Returns the commanded joints (n, 6) rad at which the true tip touches points of the block.

    Every touch scatters by the touch and by the arm's repeatability.

    Args:
        cell: The truth.
        p_part: (n, 3) m.
        posture: Side the tool comes from.
        rng: Of the scatter.
        tilt: rad, the wrist leans by this in a different direction at every touch.
    """
    lean = rng.normal(size=(len(p_part), 3))
    lean *= tilt / np.linalg.norm(lean, axis=1)[:, None]
    turned = matrix_from_rotation_vector(lean) @ attitude(posture)
    scatter = np.hypot(cell.sizes.touch, cell.sizes.repeatability)
    aim = apply(cell.T_base_part, p_part) + scatter * rng.normal(size=(len(p_part), 3))
    return joints_touching(cell, aim, turned, posture)


def joints_touching(cell: FengCell, p_base: Array, R_base_tool: Array, posture: Posture) -> Array:
    """Returns the commanded joints (n, 6) rad at which the true tip is at points (n, 3) m in base.

    ``R_base_tool`` (n, 3, 3) or (3, 3) is the attitude the controller displays there.

    Raises:
        ReachError: A point the arm cannot touch in this posture.
    """
    shown, joints = p_base, nominal_joints(cell.nominal, _poses(R_base_tool, p_base), posture)
    for _ in range(_ROUNDS):  # the error hardly changes from round to round
        off = p_base - machine(cell, joints)
        if np.abs(off).max(initial=0.0) < _NEAR:
            break
        shown = shown + off
        joints = nominal_joints(cell.nominal, _poses(R_base_tool, shown), posture)
    return joints


def machine(cell: FengCell, joints: Array, rng: np.random.Generator | None = None) -> Array:
    """Returns where the true tip is (n, 3) m in base for commanded joints (n, 6) rad.

    With ``rng`` every visit scatters by the arm's repeatability.
    """
    robot, effects = cell.robot.actual, cell.robot.effects
    torque = _weight(robot, joints)
    still = np.zeros_like(joints)
    compliance = robot.error("compliance")
    shift = compliance * torque + drive_shift(effects, joints, torque, compliance, still)
    reached: Array = forward(robot, joints, shift)[:, :3, 3]
    if rng is not None:
        reached = reached + cell.sizes.repeatability * rng.normal(size=reached.shape)
    return reached


def _weight(robot: RobotModel, joints: Array) -> Array:
    """Torques (n, 6) N m of the two masses: :func:`robotrue.robot.statics.drive_torque`, shorter.

    Overhang of the wrist point over joint 3 and over joint 2, and of the elbow over joint 2.
    """
    upper = joints[:, 1] + robot.theta[1]
    fore = upper + joints[:, 2] + robot.theta[2]
    wrist = -robot.d[3] * np.sin(fore) + robot.a[2] * np.cos(fore)
    elbow = robot.a[1] * np.cos(upper)
    torque = np.zeros_like(joints)
    torque[:, 1] = WRIST_MASS * (elbow + wrist) + ELBOW_MASS * elbow
    torque[:, 2] = WRIST_MASS * wrist
    return float(robot.gravity[2]) * torque


def nominal_joints(robot: RobotModel, T_base_tool: Array, posture: Posture) -> Array:
    """Returns the controller's joints (n, 6) rad of tool poses (n, 4, 4), in a posture.

    Raises:
        ReachError: A pose out of reach in this posture.
    """
    joints = inverse_batch(robot, T_base_tool, near=START[posture], branch=_branch(posture))
    lost = np.flatnonzero(np.isnan(joints).any(axis=1))
    if len(lost):
        where = np.round(T_base_tool[lost[0], :3, 3] / MM, 1)
        raise ReachError(
            f"{len(lost)} of {len(joints)} poses cannot be reached in posture {posture}; the first "
            f"is at {where.tolist()} mm in base.",
            hint="another posture, or a block nearer to where it is drawn.",
        )
    return joints


def compensated_joints(
    model: ErrorModel | RobotModel, T_base_tool: Array, posture: Posture
) -> Array:
    """Returns the joints (n, 6) rad at which the tool reaches poses according to a model.

    Args:
        model: A robot without errors: the controller's run. A robot with errors, or an error model:
            a compensated run.
        T_base_tool: (n, 4, 4) wanted.
        posture: The branch.

    Raises:
        ReachError: A pose out of reach in this posture.
    """
    if isinstance(model, RobotModel):
        start = nominal_joints(model.nominal(), T_base_tool, posture)
        return solve(model, T_base_tool, start).joints if model.errors.any() else start
    shown = T_base_tool.copy()
    for _ in range(2):  # the error changes by a thousandth of itself from round to round
        joints = nominal_joints(model.robot, shown, posture)
        off = model.predict(Query(joints=joints))
        shown[:, :3, 3] = T_base_tool[:, :3, 3] - off.error
        if np.isfinite(off.rotation_error).all():
            back = matrix_from_rotation_vector(-off.rotation_error)
            shown[:, :3, :3] = back @ T_base_tool[:, :3, :3]
    return nominal_joints(model.robot, shown, posture)


def tracker_poses(
    cell: FengCell, rng: np.random.Generator, *, count: int = 60, tilt: float = 15.0 * DEG
) -> MeasurementSet:
    """Returns the calibration set: poses of all three postures, reflector at the tool tip.

    Points are uniform over the block and 50 mm around it (the block is not present yet), attitudes
    lean by N(0, ``tilt``) about each axis. Positions in base, one campaign.

    Args:
        cell: The truth.
        rng: Of the poses and of the scatter.
        count: Poses, a third in each posture.
        tilt: rad.

    Raises:
        ReachError: Half of the poses are out of reach.
    """
    rows = []
    low, high = T_BASE_DRAWN[:3, 3] - 50.0 * MM, T_BASE_DRAWN[:3, 3] + SIZE + 50.0 * MM
    for k, posture in enumerate(START):
        n = (count + 2 - k) // 3
        spare = 2 * n + 10  # a few leaning poses are out of reach
        lean = matrix_from_rotation_vector(tilt * rng.normal(size=(spare, 3)))
        wanted = pose(lean @ attitude(posture), rng.uniform(low, high, (spare, 3)))
        found = inverse_batch(cell.nominal, wanted, near=START[posture], branch=_branch(posture))
        reached = found[~np.isnan(found).any(axis=1)]
        if len(reached) < n:
            raise ReachError(
                f"{len(reached)} of {spare} poses can be reached in posture {posture}, {n} asked.",
                hint="a smaller tilt.",
            )
        rows.append(reached[:n])
    joints = np.concatenate(rows)
    read = machine(cell, joints, rng) + cell.sizes.tracker * rng.normal(size=(len(joints), 3))
    sigma = max(cell.sizes.tracker, 1e-6)
    return MeasurementSet(
        joints=joints,
        position=read,
        covariance=np.broadcast_to(sigma**2 * np.eye(3), (len(joints), 3, 3)),
        group_names=("simulated tracker",),
        sources=(f"simulated tracker, cell {cell.seed}",),
        provenance=Provenance(simulated=True, instrument="tracker"),
    )


def _poses(R_base_tool: Array, points: Array) -> Array:
    return pose(np.broadcast_to(R_base_tool, (len(points), 3, 3)), points)
