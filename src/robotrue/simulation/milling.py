"""A program run on the virtual cell: dry, with the tracker on the tool, and cutting.

The controller drives straight lines and arcs between the targets of the program.
"""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.core.units import MM
from robotrue.errors import FormatError, ReachError
from robotrue.program.program import Motion, Program
from robotrue.program.target_poses import target_poses
from robotrue.robot.inverse import inverse_path
from robotrue.simulation.flange_hole import (
    EndMillPass,
    FlangeHole,
    cutting_wrench,
    side_rows,
    to_part,
)
from robotrue.simulation.plans import POSTURE
from robotrue.simulation.presets import VirtualCell
from robotrue.simulation.virtual_robot import actual_pose
from robotrue.simulation.virtual_tracker import SECONDS_PER_POSE, measure, observe
from robotrue.validation.hole_contour import HoleResult, evaluate_hole


def commanded_path(program: Program, rows: BoolArray, step: float) -> Array:
    """Returns T_base_tool (m, 4, 4) along the moves that end at the chosen targets.

    Each move starts at the target before it in the file, chosen or not; its start is not part of
    the result, its end is. Orientation turns evenly from start to end, as controllers do on lines
    and, with the usual setting, on arcs.

    Args:
        program: As read from a file.
        rows: (n,) True for the targets whose moves are wanted, via points included.
        step: m, largest distance between two points.

    Raises:
        FormatError: A chosen move is neither a line nor a whole arc, or has no start.
    """
    poses = target_poses(program)
    pieces: list[Array] = []
    for k in np.flatnonzero(rows):
        motion = program.motion[k]
        start = k - 2 if motion == Motion.ARC_END else k - 1
        if motion == Motion.ARC_VIA:
            continue
        known = start >= 0 and bool(np.isfinite(poses[start]).all())
        if not known or motion not in (Motion.LIN, Motion.ARC_END):
            raise FormatError(
                f"the move to this target is {Motion(int(motion)).name}, or starts nowhere; only "
                "lines and arcs between Cartesian targets can be followed.",
                source=program.name,
                line=int(program.line[k]),
            )
        if motion == Motion.LIN:
            places = _line(poses[start, :3, 3], poses[k, :3, 3], step)
        else:
            places = _arc(poses[start, :3, 3], poses[k - 1, :3, 3], poses[k, :3, 3], step)
        pieces.append(pose(_turning(poses[start], poses[k], len(places)), places))
    return np.concatenate(pieces) if pieces else np.empty((0, 4, 4))


def feed_directions(path: Array) -> Array:
    """Returns unit vectors (m, 3) along a path (m, 4, 4) of at least two points.

    Fails when: two neighbours coincide; the direction there is NaN.
    """
    along = np.gradient(path[:, :3, 3], axis=0)
    out: Array = along / np.linalg.norm(along, axis=1)[:, None]
    return out


def _fractions(length: float, step: float) -> Array:
    count = max(int(np.ceil(length / step)), 1)
    return np.arange(1, count + 1) / count


def _line(start: Array, end: Array, step: float) -> Array:
    share = _fractions(float(np.linalg.norm(end - start)), step)
    out: Array = start + share[:, None] * (end - start)
    return out


def _arc(start: Array, via: Array, end: Array, step: float) -> Array:
    """Points of the circle through three points, from start over via to end."""
    u, v = via - start, end - start
    normal = np.cross(u, v)
    square = float(normal @ normal)
    if square < 1e-24:  # three points on a line
        return _line(start, end, step)
    to_centre = np.cross(normal, (v @ v) * u - (u @ u) * v)
    centre = start + to_centre / (2.0 * square)
    radius = float(np.linalg.norm(start - centre))
    x = (start - centre) / radius
    y = np.cross(normal / np.sqrt(square), x)
    angle = float(np.arctan2((end - centre) @ y, (end - centre) @ x) % (2.0 * np.pi))
    turn = angle * _fractions(radius * angle, step)
    out: Array = centre + radius * (np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * y)
    return out


def _turning(start: Array, end: Array, count: int) -> Array:
    between = rotation_vector_from_matrix(start[:3, :3].T @ end[:3, :3])
    share = np.arange(1, count + 1) / count
    out: Array = start[:3, :3] @ matrix_from_rotation_vector(share[:, None] * between)
    return out


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
        wanted: The program from CAM.
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

    Each pass is one visit, with one draw of the repeatability. The tool bends with the mean cutting
    force; the spindle and the mill itself are rigid.

    Args:
        cell: The virtual cell; its tracker must be registered to base.
        hole: The job.
        wanted: The program from CAM; it assigns targets to passes.
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
