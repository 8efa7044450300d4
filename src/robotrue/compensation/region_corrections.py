"""Corrections of any poses of a region, with the arm in one configuration.

The chain of a compensated program, without the program: the configuration is chosen once, at the
middle of the region, and every pose takes its joints in that one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.compensation.compensate import empty_outcome
from robotrue.compensation.plan import Plan, flange_poses
from robotrue.compensation.settings import (
    CompensationSettings,
    CompensationSetup,
    compensation_setup,
)
from robotrue.compensation.solve_targets import other_configurations, solve_targets
from robotrue.compensation.status import Route, Status
from robotrue.core.arm_words import NO_WORD
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.rotations import abc_from_matrix, rotation_vector_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ReachError
from robotrue.program.correction_table import PoseRegion
from robotrue.program.program import Motion, Program, Reason
from robotrue.robot.inverse import inverse_branches
from robotrue.robot.model import RobotModel

_TURN: Final = 2.0 * np.pi
_ASKED: Final = 64
"""Poses at which other configurations are compared."""
_FINE: Final = (Status.COMPENSATED, Status.UNCHANGED_NO_ERROR)


class RegionSolution(NamedTuple):
    """What n poses of a region come to.

    Attributes:
        correction: (n, 6) shift m and rotation vector rad, axes of the tool at the middle attitude.
        joints: (n, 6) rad, nominal.
        fine: (n,) whether the pose is compensated.
        status: (n,) :class:`Status`.
    """

    correction: Array
    joints: Array
    fine: BoolArray
    status: IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class RegionArm:
    """An arm in one configuration over a region.

    Attributes:
        setup: Model and settings.
        region: Of the poses.
        T_flange_tool: (4, 4).
        branch: Number of the closed branch.
        middle: (6,) rad, nominal joints in the middle of the region.
    """

    setup: CompensationSetup
    region: PoseRegion
    T_flange_tool: Array
    branch: int
    middle: Array

    def solve(self, share: Array) -> RegionSolution:
        """Returns the corrections of poses (n, 6), see :meth:`PoseRegion.place_poses`."""
        program = region_program(self.region, share, self.T_flange_tool)
        joints = joints_in_branch(self.setup.robot, program, self.branch, self.middle)
        return solve_program(self.setup, self.region, program, joints)

    def require_fine(self, share: Array, solved: RegionSolution) -> None:
        """Passes where all poses are compensated.

        Raises:
            ReachError: One is not, with the reason and such a pose.
        """
        wrong = np.flatnonzero(~solved.fine)
        if not len(wrong):
            return
        row = int(wrong[0])
        position, rotation = self.region.place_poses(share[[row]])
        values = [*position[0] / MM, *abc_from_matrix(rotation[0]) / DEG]
        pose = " ".join(f"{name} {value:.1f}" for name, value in zip("XYZABC", values, strict=True))
        raise ReachError(
            f"{len(wrong)} of {len(share)} poses of the region cannot be compensated in the "
            f"configuration of its middle; {pose}: {Status(int(solved.status[row])).explanation}.",
            hint="a smaller --box-mm, less --turn-deg, or another --start.",
        )


def open_region(
    model: ErrorModel, region: PoseRegion, T_flange_tool: Array, settings: CompensationSettings
) -> RegionArm:
    """Returns the arm in its configuration in the middle of a region.

    Args:
        model: Error of the robot; with closed inverse kinematics.
        region: Of the poses.
        T_flange_tool: (4, 4) tool.
        settings: One row of load; ``home`` chooses the configuration, the nearest to it. Without it
            the corrections of all configurations must agree. Backlash is not corrected: the
            approach direction of the joints is unknown.

    Raises:
        ConfigurationError: No closed inverse; or the configuration is not stated, and matters.
        ReachError: The middle is out of reach.
    """
    setup = compensation_setup(model, T_flange_tool[None], np.empty(0), settings)
    program = region_program(region, np.array([[0.5, 0.5, 0.5, 0.0, 0.0, 0.0]]), T_flange_tool)
    stated = len(settings.home) > 0
    near = settings.home if stated else setup.arm.limits.mean(axis=1)
    bare = setup.robot.with_tool(np.eye(4))
    options = inverse_branches(bare, flange_poses(program, np.arange(1)), reference=near)[0]
    options = _turn_inside(setup.robot, options)
    far = np.where(np.isfinite(options[:, 0]), ((options - near) ** 2).sum(axis=1), np.inf)
    branch = int(np.argmin(far))
    if not np.isfinite(far[branch]):
        raise ReachError(
            "the middle of the region is out of the robot's reach, or beyond its joint limits.",
            hint="--box-mm in the work frame; --attitude-deg of the tool in it; base and tool of "
            "the cell.",
        )
    arm = RegionArm(
        setup=setup,
        region=region,
        T_flange_tool=T_flange_tool,
        branch=branch,
        middle=options[branch],
    )
    if not stated:
        _require_alike(arm)
    return arm


def _require_alike(arm: RegionArm) -> None:
    """Refuses a region that other configurations reach with other corrections."""
    share = random_shares(_ASKED, seed=1)
    program = region_program(arm.region, share, arm.T_flange_tool)
    own = arm.solve(share)
    poses = flange_poses(program, np.arange(len(share)))
    options = other_configurations(arm.setup.robot, poses, own.joints)
    worst = 0.0
    for k in range(options.shape[1]):
        reached = np.isfinite(options[:, k, 0]) & own.fine
        other = solve_program(
            arm.setup, arm.region, program.take(reached), np.ascontiguousarray(options[reached, k])
        )
        apart = np.linalg.norm(other.correction - own.correction[reached], axis=1)
        worst = max(worst, float(apart[other.fine].max(initial=0.0)))
    if worst > arm.setup.settings.alike:
        raise ConfigurationError(
            "nothing says in which configuration the arm reaches the region, and the corrections "
            f"of those inside the joint limits are up to {worst / MM:.2f} mm apart.",
            hint="--start A1,..,A6 in the configuration of the program; one table for each.",
        )


def random_shares(n: int, *, seed: int) -> Array:
    """Returns n poses (n, 6) anywhere in a region, see :meth:`PoseRegion.place_poses`."""
    share = np.random.default_rng(seed).uniform(-1.0, 1.0, (n, 6))
    share[:, :3] = 0.5 + 0.5 * share[:, :3]
    return share


def region_program(region: PoseRegion, share: Array, T_flange_tool: Array) -> Program:
    """Returns the poses (n, 6) of a region as targets."""
    n = len(share)
    position, rotation = region.place_poses(share)
    zeros = np.zeros(n, dtype=np.int64)
    return Program(
        name="region",
        dialect="",
        data=b"",
        position=position,
        rotation=rotation,
        axes=np.full((n, 6), np.nan),
        motion=np.full(n, int(Motion.LIN)),
        reason=np.full(n, int(Reason.NONE)),
        words=np.full((n, 0), NO_WORD),
        words_of="",
        line=zeros,
        frame=zeros,
        tool=zeros,
        T_base_frame=region.T_base_frame[None],
        T_flange_tool=T_flange_tool[None],
    )


def joints_in_branch(robot: RobotModel, program: Program, branch: int, near: Array) -> Array:
    """Returns the nominal joints (n, 6) rad of one branch, on turns inside the limits."""
    bare = robot.with_tool(np.eye(4))
    poses = flange_poses(program, np.arange(len(program)))
    return _turn_inside(robot, inverse_branches(bare, poses, reference=near)[:, branch])


def _turn_inside(robot: RobotModel, joints: Array) -> Array:
    """Returns joints (n, 6) turned into the limits where whole turns do so, else NaN rows."""
    lower, upper = robot.limits[:, 0], robot.limits[:, 1]
    with np.errstate(invalid="ignore"):
        joints = joints - _TURN * np.ceil(np.maximum(joints - upper, 0.0) / _TURN)
        joints = joints + _TURN * np.ceil(np.maximum(lower - joints, 0.0) / _TURN)
        inside = np.asarray(((joints >= lower) & (joints <= upper)).all(axis=1))
    return np.where(inside[:, None], joints, np.nan)


def solve_program(
    setup: CompensationSetup, region: PoseRegion, program: Program, joints: Array
) -> RegionSolution:
    """Returns the corrections of targets with these nominal joints (n, 6); NaN: out of reach."""
    n = len(program)
    outcome = empty_outcome(program, n, covariance=False)
    known = np.isfinite(joints[:, 0])
    route = np.where(known, int(Route.GIVEN), int(Route.SKIP)).astype(np.int64)
    away, fine = int(Status.UNCHANGED_UNREACHABLE), int(Status.COMPENSATED)
    plan = Plan(
        route=route,
        status=np.where(known, fine, away).astype(np.int64),
        joints=joints,
        worded=np.empty(0, np.int64),
        known=np.ones(n, np.int64),
        notes=(),
    )
    if n:
        solve_targets(
            setup, program, plan, setup.settings.load_for(1), setup.start_state(), outcome
        )
    R = region.R_frame_tool
    shift = (outcome.position - program.position) @ R
    turned = outcome.rotation.reshape(n, 3, 3) @ np.swapaxes(program.rotation, 1, 2)
    turn = rotation_vector_from_matrix(turned) @ R
    return RegionSolution(
        correction=np.concatenate([shift, turn], axis=1),
        joints=joints,
        fine=np.isin(outcome.status, _FINE),
        status=outcome.status,
    )
