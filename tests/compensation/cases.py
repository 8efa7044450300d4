"""Arms, models and programs for the tests of this room."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robotrue.calibration.model import Prediction, Query, UnconditionalModel
from robotrue.calibration.terms.term import MeanTables, rigid_tables
from robotrue.core.arm_words import NO_WORD
from robotrue.core.poses import inverse, pose_from_xyz_abc
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.program.program import Motion, Program, Reason
from robotrue.robot.forward import forward, walk
from robotrue.robot.model import RobotModel, moment_slice, parameter_slice
from robotrue.robot.presets import preset
from robotrue.robot.statics import drive_torque

TOOL = pose_from_xyz_abc(np.array([120.0, -35.0, 260.0]) * MM, np.array([30.0, 80.0, -15.0]) * DEG)
FRAME = pose_from_xyz_abc(np.array([900.0, -200.0, 300.0]) * MM, np.array([15.0, -4.0, 8.0]) * DEG)


def oracle(tables: MeanTables, query: Query, robot: RobotModel) -> tuple[np.ndarray, np.ndarray]:
    """Actual position and rotation by the package's NumPy kinematics and the formula of tables."""
    q = query.joints
    shift = drive_torque(robot, q, query.load) * robot.error("compliance")
    angle = q[:, :, None] * tables.harmonics
    shift = shift + np.sum(
        tables.ripple_sin * np.sin(angle) + tables.ripple_cos * np.cos(angle), axis=2
    )
    if np.size(query.approach):
        shift = shift + tables.backlash * query.approach
    state = walk(robot, q, shift)
    feature = tables.scale * np.concatenate([np.sin(q), np.cos(q)], axis=1)
    square = np.sum((feature[:, None] - tables.centres) ** 2, axis=2)
    return state.position + np.exp(-0.5 * square) @ tables.weights, state.rotation


@dataclass(frozen=True, kw_only=True)
class TableModel(UnconditionalModel):
    """An ErrorModel that is its tables; ``flat=False`` hides them, as a model without would."""

    tables: MeanTables
    flat: bool = True
    turn_known: bool = True
    sigma: float = 30e-6

    @property
    def robot(self) -> RobotModel:
        return self.tables.robot.nominal()

    def mean_tables(self):
        return self.tables if self.flat else None

    def actual(self, query: Query):
        robot = self.tables.robot
        if query.T_flange_tool is not None:
            robot = robot.with_tool(query.T_flange_tool)
        return robot, *oracle(self.tables, query, robot)

    def predict(self, query: Query) -> Prediction:
        robot, position, rotation = self.actual(query)
        told = forward(robot.nominal(), query.joints)
        turn = rotation_vector_from_matrix(rotation @ np.swapaxes(told[:, :3, :3], 1, 2))
        n = len(query.joints)
        return Prediction(
            error=position - told[:, :3, 3],
            rotation_error=turn if self.turn_known else np.full((n, 3), np.nan),
            covariance=np.tile(np.eye(3) * self.sigma**2 / 3.0, (n, 1, 1)),
        )


def kr160(tool: np.ndarray = TOOL) -> RobotModel:
    return preset("KR160").with_tool(tool)


def with_errors(robot: RobotModel, seed: int, *, size: float = 1.0) -> RobotModel:
    """Errors of every kind: about 1.5 mm at the tool of a large arm for size 1."""
    rng = np.random.default_rng(seed)
    errors, moments = np.zeros(len(robot.errors)), moment_slice(robot.dof)
    drawn = np.r_[: moments.start, moments.stop : len(errors)]
    errors[drawn] = rng.normal(size=len(drawn))
    errors[moments] = 2.0 * size * np.random.default_rng(seed).normal(size=2 * robot.dof)
    for group, scale in {
        "theta": 3e-4, "d": 3e-4, "a": 3e-4, "alpha": 3e-4, "beta": 3e-4, "gear": 1e-4,
        "compliance": 1.0,
        "base": 4e-4, "tool": 3e-4,
    }.items():  # fmt: skip
        errors[parameter_slice(robot.dof, group)] *= scale * size
    stiffness = 1e6 * np.array([1.75, 1.72, 1.95, 0.73, 0.51, 0.44])
    errors[parameter_slice(robot.dof, "compliance")] = size / stiffness
    return robot.with_errors(errors)


def rigid_model(seed: int = 3, *, robot: RobotModel | None = None, size: float = 1.0) -> TableModel:
    return TableModel(tables=rigid_tables(with_errors(robot or kr160(), seed, size=size)))


def rich_model(
    seed: int = 3, *, robot: RobotModel | None = None, harmonics: int = 64, centres: int = 500
) -> TableModel:
    """Ripple, backlash and a smooth residual on top; amplitudes as on a real arm."""
    rng = np.random.default_rng(seed)
    cycles = np.arange(1.0, harmonics + 1.0)
    amplitude = 2e-5 / np.sqrt(cycles)
    joints = rng.uniform(-2.0, 2.0, size=(centres, 6))
    scale = 1.0 / np.repeat([0.6, 0.9], 6)
    return TableModel(
        tables=MeanTables(
            robot=with_errors(robot or kr160(), seed),
            harmonics=cycles,
            ripple_sin=rng.normal(size=(6, harmonics)) * amplitude,
            ripple_cos=rng.normal(size=(6, harmonics)) * amplitude,
            backlash=rng.normal(size=6) * 2e-5,
            centres=np.concatenate([np.sin(joints), np.cos(joints)], axis=1) * scale,
            scale=scale,
            weights=rng.normal(size=(centres, 3)) * 3e-5,
        )
    )


def program_of(
    T_base_tool: np.ndarray,
    *,
    tool: np.ndarray = TOOL,
    frame: np.ndarray = FRAME,
    motion: int = Motion.LIN,
    **columns: np.ndarray,
) -> Program:
    """A program of poses given in the robot base, written in a work frame."""
    n = len(T_base_tool)
    T_frame_tool = inverse(frame) @ T_base_tool
    base = {
        "motion": np.full(n, int(motion)),
        "reason": np.zeros(n, dtype=int),
        "words": np.full((n, 2), NO_WORD),
        "words_of": "kuka",
        "frame": np.zeros(n, dtype=int),
        "tool": np.zeros(n, dtype=int),
        "axes": np.full((n, 6), np.nan),
        "position": T_frame_tool[:, :3, 3],
        "rotation": T_frame_tool[:, :3, :3],
    }
    return Program(
        name="part.src", dialect="krl", data=b"", line=np.arange(n) + 10,
        T_base_frame=frame[None], T_flange_tool=tool[None], **(base | columns),
    )  # fmt: skip


def axis_program(axes: np.ndarray, *, tool: np.ndarray = TOOL) -> Program:
    n = len(axes)
    return program_of(
        np.full((n, 4, 4), np.nan),
        tool=tool,
        motion=Motion.PTP,
        reason=np.full(n, int(Reason.JOINT_TARGET)),
        axes=axes,
    )


def path_joints(count: int, seed: int = 5) -> np.ndarray:
    """Joints along a smooth wander through the middle of the working space."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 2.0 * np.pi, count)[:, None]
    phase = rng.uniform(0.0, 2.0 * np.pi, size=6)
    middle = np.array([10.0, -25.0, 20.0, 30.0, 55.0, 40.0]) * DEG
    swing = np.array([25.0, 12.0, 15.0, 40.0, 20.0, 60.0]) * DEG
    return middle + swing * np.sin(t * np.array([1, 2, 1, 3, 2, 1]) + phase)


def commanded(result, program: Program) -> np.ndarray:
    """Poses (n, 4, 4) in base that the replacement tells the controller."""
    T = np.tile(np.eye(4), (len(program), 1, 1))
    T[:, :3, :3] = result.replacement.rotation
    T[:, :3, 3] = result.replacement.position
    return program.T_base_frame[program.frame] @ T


def narrowed(robot: RobotModel, joint: int, low: float, high: float) -> RobotModel:
    limits = np.array(robot.limits)
    limits[joint] = low, high
    return replace(robot, limits=limits)
