"""A program run on the virtual cell: dry, with the tracker on the tool, and cutting."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.units import MM
from robotrue.errors import ReachError
from robotrue.program.program import Program
from robotrue.robot.inverse import inverse_path
from robotrue.simulation.commanded_path import commanded_path, feed_directions, target_poses
from robotrue.simulation.cutting import EndMillPass, cutting_wrench
from robotrue.simulation.flange_hole import FlangeHole, side_rows, to_part
from robotrue.simulation.plans import POSTURE
from robotrue.simulation.presets import VirtualCell
from robotrue.simulation.virtual_robot import actual_pose
from robotrue.simulation.virtual_tracker import SECONDS_PER_POSE, measure, observe
from robotrue.validation.hole_contour import HoleResult, evaluate_hole

WALL_STEP = 2.0 * MM
"""Distance of two measured points on the wall of the hole."""


def dry_run(
    cell: VirtualCell, wanted: Program, driven: Program, rows: IntArray, *, campaign: int
) -> Array:
    """Returns the measured error (m, 3) m in base of the tool point at some targets, no force.

    The robot stops at each target and the tracker measures a reflector at the tool point, as in
    Table 9. Error is the measured point minus the target of the *wanted* program.

    Args:
        cell: The virtual cell; its tracker must be registered to base.
        wanted: The program as CAM made it.
        driven: The program the controller runs: the same one, or its compensated copy.
        rows: (m,) targets to stop at.
        campaign: Number of the campaign, for noise and drift.

    Raises:
        ReachError: A driven target cannot be reached.
    """
    tool = driven.T_flange_tool[driven.tool[rows[0]]]
    joints = _controller_joints(cell, target_poses(driven)[rows], tool, driven.name)
    measured = measure(
        cell.robot,
        cell.tracker,
        joints,
        seed=cell.seed,
        campaign=campaign,
        T_flange_tool=tool,
        name="dry run",
    )
    error: Array = measured.position - target_poses(wanted)[rows][:, :3, 3]
    return error


def mill_hole(
    cell: VirtualCell, hole: FlangeHole, wanted: Program, driven: Program, *, campaign: int
) -> HoleResult:
    """Returns the hole the side passes of a program leave, measured on its wall by the tracker.

    Each pass is one visit: it is off by one draw of the repeatability. The tool bends with the mean
    cutting force of :mod:`robotrue.simulation.cutting`; the spindle and the mill itself are rigid.

    Args:
        cell: The virtual cell; its tracker must be registered to base.
        hole: The job.
        wanted: The program as CAM made it; says which targets are whose.
        driven: The program the controller runs.
        campaign: Number of the campaign, for noise and drift.

    Raises:
        ReachError: A driven target cannot be reached.
    """
    rng = np.random.default_rng([cell.seed, 31, campaign])
    walls = []
    for level in range(1, hole.levels + 1):
        rows = side_rows(wanted, hole, level)
        path = commanded_path(driven, rows, WALL_STEP)
        tool = driven.T_flange_tool[driven.tool[np.flatnonzero(rows)[0]]]
        visit = cell.robot.repeatability * rng.standard_normal(3)
        start = SECONDS_PER_POSE * level
        walls.append(_wall(cell, hole.side, path, tool, driven.name, start, campaign) + visit)
    points = observe(cell.tracker, np.concatenate(walls), rng)
    return evaluate_hole(to_part(hole, points), centre=hole.centre, radius=0.5 * hole.diameter)


def _wall(
    cell: VirtualCell,
    cut: EndMillPass,
    path: Array,
    tool: Array,
    name: str,
    start: float,
    campaign: int,
) -> Array:
    """Points (m, 3) m in base that the mill leaves to the right of its feed."""
    joints = _controller_joints(cell, path, tool, name)
    along = feed_directions(path)
    spindle_axis = -path[:, :3, 2]
    wrench = cutting_wrench(cut, along, spindle_axis)
    approach = np.sign(np.gradient(joints, axis=0))
    length = WALL_STEP * np.arange(len(path), dtype=np.float64)
    actual = actual_pose(
        cell.robot,
        joints,
        cell.robot.payload_with(wrench),
        approach=approach,
        time=start + length / cut.feed,
        campaign=campaign,
        T_flange_tool=tool,
    )
    right = np.cross(along, spindle_axis)
    out: Array = actual[:, :3, 3] + 0.5 * cut.diameter * right
    return out


def _controller_joints(cell: VirtualCell, poses: Array, tool: Array, name: str) -> Array:
    joints = inverse_path(cell.robot.nominal.with_tool(tool), poses, near=POSTURE)
    lost = np.flatnonzero(~np.isfinite(joints).all(axis=1))
    if len(lost):
        x, y, z = poses[lost[0], :3, 3] / MM
        raise ReachError(
            f"{name}: {len(lost)} points of the path are out of reach, the first at "
            f"({x:.1f}, {y:.1f}, {z:.1f}) mm in base.",
            hint="move the part nearer to the robot.",
        )
    return joints
