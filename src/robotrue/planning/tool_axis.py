"""Joints along a tool path: the rotation about the tool axis that CAM leaves open, by a rule.

A point with a tool axis fixes five of six degrees of freedom. The sixth, the spin of the tool frame
about the axis, does not change the cut; it is chosen so that the arm stays away from its joint
limits and singularities and moves smoothly, by dynamic programming over a grid of spins
(:mod:`robotrue.robot.spin` states the cost). The grid is laid over stations along the path, not
more than 20 mm or 5 deg of tool axis apart, straight moves between far points included; two finer
grids around the first result follow; spins between stations are interpolated. Every point and every
station is then checked once more as the controller will move: position straight, orientation by one
rotation, joints of one branch.

The spin is counted from a frame that is carried along the path without turning about the axis, so a
spin that stays the same turns the tool as little as the tool axis allows.

One side keeps one branch of the arm. A path that would need two is refused with the line where the
first one ends: split it there into two sides.

The path has points between far ones: moves are straight, and a point is added every 20 mm and every
5 deg of tool axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import inverse as inverse_pose
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ReachError
from robotrue.program.carried import about_z, carried_frames, to_z
from robotrue.program.toolpath import Toolpath
from robotrue.robot.inverse import (
    BRANCHES,
    ClosedArm,
    branch_of,
    inverse,
    inverse_branches,
    require_closed,
)
from robotrue.robot.model import RobotModel
from robotrue.robot.spin import (
    TRIES,
    SpinPath,
    SpinSettings,
    can_be_taken,
    cannot_follow,
    limit_room,
    refined_way,
    stations_of,
)

_TURN_LENGTH: Final = 0.2
"""m of path that a radian of tool axis counts as."""
_TILT: Final = 5.0 * DEG
_APART: Final = 20.0 * MM


@dataclass(frozen=True, slots=True, kw_only=True)
class DensePath:
    """A path with points between far ones.

    Attributes:
        position: (d, 3) m in part.
        frame: (d, 3, 3) carried frame, z against the tool axis.
        along: (d,) m of path so far; a turn of the tool axis counts as well.
        target: (d,) the target at the end of the move each belongs to.
        at: (n,) where the targets are.
    """

    position: Array
    frame: Array
    along: Array
    target: IntArray
    at: IntArray


def as_driven(dense: DensePath, T_part_target: Array) -> Array:
    """Returns poses (d, 4, 4) on the way as a controller interpolates: straight, one rotation."""
    last = dense.target
    first = np.maximum(last - 1, 0)
    begin, end = dense.at[first], dense.at[last]
    span = dense.along[end] - dense.along[begin]
    share = np.where(span > 0.0, dense.along - dense.along[begin], 1.0) / np.where(
        span > 0.0, span, 1.0
    )
    share = np.where(np.arange(len(last)) == end, 1.0, share)
    R0, R1 = T_part_target[first, :3, :3], T_part_target[last, :3, :3]
    turn = rotation_vector_from_matrix(np.swapaxes(R0, 1, 2) @ R1)
    rotation = R0 @ matrix_from_rotation_vector(share[:, None] * turn)
    return pose(rotation, dense.position)


def dense_path(path: Toolpath) -> DensePath:
    """Returns the path with points between far ones."""
    steps = np.linalg.norm(np.diff(path.position, axis=0), axis=1)
    cosine = np.clip((path.axis[1:] * path.axis[:-1]).sum(axis=1), -1.0, 1.0)
    tilt = np.arccos(cosine)
    parts = np.maximum(np.ceil(np.maximum(steps / _APART, tilt / _TILT)), 1.0).astype(int)
    target = np.concatenate([[0], np.repeat(np.arange(1, len(path)), parts)])
    at = np.concatenate([[0], np.cumsum(parts)])
    share = np.concatenate([[1.0], _shares(parts)])
    first = np.maximum(target - 1, 0)
    blend = share[:, None]
    position = (1.0 - blend) * path.position[first] + blend * path.position[target]
    axis = _between(path.axis[first], path.axis[target], share)
    move = np.concatenate([[0.0], (steps + _TURN_LENGTH * tilt) / parts])
    along = np.cumsum(np.where(np.arange(len(target)) == 0, 0.0, move[target]))
    frame = carried_frames(axis, _perpendicular(axis[0]))
    return DensePath(position=position, frame=frame, along=along, target=target, at=at)


def _shares(parts: IntArray) -> Array:
    """1/p .. p/p for every move."""
    ends = np.cumsum(parts)
    count = np.arange(1, int(ends[-1]) + 1) if len(parts) else np.arange(0)
    return np.asarray((count - np.repeat(ends - parts, parts)) / np.repeat(parts, parts))


def _between(first: Array, last: Array, share: Array) -> Array:
    """Unit vectors on the great circle between two, (d, 3)."""
    cosine = np.clip((first * last).sum(axis=1), -1.0, 1.0)
    angle = np.arccos(cosine)
    aside = last - cosine[:, None] * first
    length = np.linalg.norm(aside, axis=1)
    opposite = (length < 1e-12) & (cosine < 0.0)
    if opposite.any():
        aside[opposite] = [_perpendicular(axis) for axis in first[opposite]]
    aside /= np.where(length < 1e-12, 1.0, length)[:, None]
    turned = share * angle
    return np.asarray(np.cos(turned)[:, None] * first + np.sin(turned)[:, None] * aside)


def _perpendicular(axis: Array) -> Array:
    """The unit vector across an axis nearest to the coordinate axis most across it."""
    aside = np.eye(3)[int(np.argmin(np.abs(axis)))]
    aside = aside - (aside @ axis) * axis
    return np.asarray(aside / np.linalg.norm(aside))


@dataclass(frozen=True, slots=True, kw_only=True)
class Posed(Columns):
    """A tool path with the arm that follows it.

    Attributes:
        path: The tool path.
        T_base_part: (4, 4) frame of the part.
        rotation: (n, 3, 3) of the tool frame in the part.
        joints: (n, 6) rad, model sense, continuous.
        spin: (n,) rad about the tool axis, from a frame carried along the path.
        branch: Of the arm, see :mod:`robotrue.robot.inverse`.
        limit_margin: rad, smallest distance of a joint from a limit, on points and between.
        wrist_angle: rad, smallest angle between axes 4 and 6, on points and between.
    """

    path: Toolpath
    T_base_part: Annotated[Array, Column("4 4")]
    rotation: Annotated[Array, Column("n 3 3")]
    joints: Annotated[Array, Column("n 6", unit="rad")]
    spin: Annotated[Array, Column("n", unit="rad")]
    branch: int
    limit_margin: float
    wrist_angle: float

    def __post_init__(self) -> None:
        """Checks shapes and values."""
        self._check_columns(n=len(self.path))


def resolve_spin(
    robot: RobotModel,
    T_base_part: Array,
    path: Toolpath,
    settings: SpinSettings,
    *,
    near: Array | None = None,
) -> Posed:
    """Returns tool orientation and joints of every point, by the rule in the head of this module.

    Args:
        robot: The nominal arm with the tool that cuts.
        T_base_part: (4, 4) frame of the part.
        path: One side, in the part frame.
        settings: Cutter axis, grid, margins.
        near: (6,) rad, where the arm comes from; its shoulder and elbow are kept if they can be.

    Raises:
        ReachError: A point no spin reaches, or a path no single branch follows; with the line.
        ConfigurationError: An arm without closed branches.
    """
    fault: ReachError | None = None
    side = _SideTask(
        robot=robot.nominal(),
        geometry=require_closed(robot),
        T_base_part=T_base_part,
        path=path,
        dense=dense_path(path),
        settings=settings,
    )
    spacing = settings.spacing
    shape = None if near is None else branch_of(side.robot, near)
    for _ in range(TRIES):
        stations = stations_of(side.dense.along, spacing)
        way = _find_way(side, stations, shape)
        if way.branch < 0:
            raise _no_way(side, stations, way)
        try:
            return _pose_targets(side, stations, way)
        except ReachError as error:  # a narrow place between two stations
            fault, spacing = error, 0.5 * spacing
    raise fault or ReachError("no way was found.", source=path.source)


@dataclass(frozen=True, slots=True, kw_only=True)
class _SideTask:
    """A side whose spins are to be chosen: what every step of it needs."""

    robot: RobotModel
    geometry: ClosedArm
    T_base_part: Array
    path: Toolpath
    dense: DensePath
    settings: SpinSettings

    def rotations(self, at: IntArray, spin: Array) -> Array:
        """Returns tool rotations (..., 3, 3) in part at dense points, turned by spins."""
        frame = self.dense.frame[at]
        frame = frame[:, None] if spin.ndim == 2 else frame
        return np.asarray(frame @ (about_z(spin) @ to_z(self.settings.cutter)))

    def flange_poses(self, T_part_tool: Array) -> Array:
        """Returns T_base_flange (..., 4, 4) of tool poses in part."""
        return np.asarray(self.T_base_part @ T_part_tool @ inverse_pose(self.robot.T_flange_tool))


def _find_way(side: _SideTask, stations: IntArray, shape: int | None) -> SpinPath:
    """The way over all branches and spins of the stations."""
    along = side.dense.along[stations]

    def stand(spin: Array) -> tuple[Array, None]:
        return _all_joints(side, stations, spin), None

    length = np.diff(along, prepend=along[0])
    return refined_way(side.robot, side.geometry, stand, length, side.settings, shape=shape)


def _all_joints(side: _SideTask, stations: IntArray, spin: Array) -> Array:
    """Joints (m, 8, k, 6) of every branch at every spin (m, k) of the stations."""
    m, k = spin.shape
    position = np.broadcast_to(side.dense.position[stations][:, None], (m, k, 3))
    T_part_tool = pose(side.rotations(stations, spin), position)
    joints = inverse_branches(
        side.robot,
        side.flange_poses(T_part_tool).reshape(-1, 4, 4),
        reference=side.robot.limits.mean(axis=1),
    )
    return np.moveaxis(joints.reshape(m, k, BRANCHES, 6), 2, 1)


def _pose_targets(side: _SideTask, stations: IntArray, way: SpinPath) -> Posed:
    """Spins and joints of the targets, checked at every dense point."""
    robot, geometry, dense, settings = side.robot, side.geometry, side.dense, side.settings
    at = dense.along[stations]
    spin = np.interp(dense.along[dense.at], at, way.spin)
    rotation = side.rotations(dense.at, spin)
    T_base_flange = side.flange_poses(as_driven(dense, pose(rotation, side.path.position)))
    guess = np.stack([np.interp(dense.along, at, q) for q in way.joints.T], axis=1)
    joints = inverse_branches(robot, T_base_flange, reference=guess)[:, way.branch]
    bad = cannot_follow(robot, geometry, joints, settings)
    if bad.any():
        raise _narrow(side.path, int(dense.target[int(np.argmax(bad))]))
    wrist = np.arcsin(np.clip(geometry.singular_measures(joints)[:, 0].min(), 0.0, 1.0))
    return Posed(
        path=side.path,
        T_base_part=side.T_base_part,
        rotation=rotation,
        joints=joints[dense.at],
        spin=spin,
        branch=way.branch,
        limit_margin=float(limit_room(robot, joints).min()),
        wrist_angle=float(wrist),
    )


def _narrow(path: Toolpath, target: int) -> ReachError:
    return ReachError(
        "the arm cannot follow the straight move to this point with the tool rotation there: a "
        "joint limit or a singularity lies in between.",
        source=path.source,
        line=int(path.line[target]),
        hint="split the tool path there into two sides, or move the part.",
    )


def _no_way(side: _SideTask, stations: IntArray, way: SpinPath) -> ReachError:
    """Returns the error with the blocking point: out of reach, or out of reach of this way only."""
    path, settings = side.path, side.settings
    at = stations[[way.reached]]
    line = int(path.line[int(side.dense.target[at[0]])])
    spins = np.arange(0.0, 360.0, 10.0) * DEG
    here = _all_joints(side, at, spins[None])[0]
    if np.isfinite(can_be_taken(side.robot, side.geometry, here, settings)).any():
        return ReachError(
            "the arm reaches this point, but not on the way from the previous points: every "
            "configuration up to here meets a joint limit or a singularity.",
            source=path.source,
            line=line,
            hint="split the tool path there into two sides, or move the part.",
        )
    why = (
        f"Every solution has a joint within {settings.limit_margin / DEG:g} deg of its limit or "
        f"the arm within {settings.wrist_margin / DEG:g} deg of a singularity."
    )
    T_part_tool = pose(side.rotations(at, spins[None])[0], side.dense.position[at[0]])
    for T_base_tool in side.T_base_part @ T_part_tool:
        try:
            inverse(side.robot, T_base_tool)
        except ReachError as error:
            why = error.message
        else:
            break
    return ReachError(
        f"out of reach at every rotation about the tool axis. {why}",
        source=path.source,
        line=line,
        hint="check tool, part frame and unit, or move the part.",
    )
