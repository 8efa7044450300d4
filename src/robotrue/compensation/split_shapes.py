"""The nominal path of every move: where the tool is between its targets, and under which force.

Straight moves run along the line, arcs along the circle through their three points. The tool turns
about one fixed axis (the shortest way) in proportion to the path, as KUKA's, ABB's and UR's
controllers interpolate. An auxiliary point's own orientation counts only where it lies on that way,
or where the way is not unique because the tool turns by nearly half a turn; KUKA, ABB and UR ignore
it otherwise, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.compensation.arcs import Circles, circles, on_circles
from robotrue.compensation.result import Compensation
from robotrue.compensation.settings import CompensationSettings
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.errors import ConfigurationError
from robotrue.program.insertion import Moves
from robotrue.program.program import Program
from robotrue.robot.statics import Load

_ON_THE_WAY: Final = 1e-3
"""rad a detour over the auxiliary orientation may add."""
_AMBIGUOUS: Final = 2.8
"""rad of turn above which the auxiliary orientation decides the direction."""
_TINY: Final = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class JobPoses:
    """The targets of a job in the robot base, one row per job row.

    Attributes:
        position: (n, 3) m, base; NaN where the target has no pose in a known frame.
        rotation: (n, 3, 3).
        tool: (n,) index into ``tools``.
        tools: (t, 4, 4) T_flange_tool.
        frame: (n,) index into ``frames``.
        frames: (f, 4, 4) T_base_frame.
    """

    position: Array
    rotation: Array
    tool: IntArray
    tools: Array
    frame: IntArray
    frames: Array


def job_poses(job: Sequence[Program]) -> JobPoses:
    """Returns the targets of a job in the robot base; parts held by the robot have no pose here."""
    position, rotation, tool, frame = [], [], [], []
    tools, frames = 0, 0
    for program in job:
        T = program.T_base_frame[program.frame]
        at = np.einsum("nij,nj->ni", T[:, :3, :3], program.position) + T[:, :3, 3]
        if len(program.held):
            at[program.held] = np.nan
        position.append(at)
        rotation.append(T[:, :3, :3] @ program.rotation)
        tool.append(program.tool + tools)
        frame.append(program.frame + frames)
        tools, frames = tools + len(program.T_flange_tool), frames + len(program.T_base_frame)
    return JobPoses(
        position=np.concatenate(position),
        rotation=np.concatenate(rotation),
        tool=np.concatenate(tool),
        tools=np.concatenate([program.T_flange_tool for program in job]),
        frame=np.concatenate(frame),
        frames=np.concatenate([program.T_base_frame for program in job]),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Shapes:
    """k moves in the robot base.

    Attributes:
        first: (k, 3) m, where each begins.
        last: (k, 3) m, where it ends.
        circular: (k,) it is an arc.
        circle: (k,) circles of the arcs; straight moves have NaN.
        normal: (k, 3) of the plane that an arc cannot leave; NaN for all others.
        R_first: (k, 3, 3).
        turn: (k, 3) rotation vector from there to the end, in the first tool's axes.
        bent: (k,) the tool turns over the auxiliary orientation, in two pieces.
        R_via: (k, 3, 3) that orientation.
        turns: (2, k, 3) rotation vectors of the two pieces.
        length: (k,) m of path.
        load: (k, 2, 6) N, N m, base, at begin and end, or empty.
        load_via: (k, 6) at the auxiliary point, or empty.
    """

    first: Array
    last: Array
    circular: BoolArray
    circle: Circles
    normal: Array
    R_first: Array
    turn: Array
    bent: BoolArray
    R_via: Array
    turns: Array
    length: Array
    load: Array
    load_via: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class JobMoves:
    """Parts of a compensated job that are needed to examine its moves.

    Attributes:
        model: Error of the robot.
        moves: The k moves.
        poses: Its targets in the base.
        joints: (n, 6) rad commanded at every job row.
        status: (n,) :class:`Status` of every job row.
        load: (n, 6) N, N m, base, of every job row where it changes; else empty.
        settings: Guards, and the load where it does not change.
    """

    model: ErrorModel
    moves: Moves
    poses: JobPoses
    joints: Array
    status: IntArray
    load: Array
    settings: CompensationSettings

    def shapes(self, rows: IntArray) -> Shapes:
        """Returns the shapes of some moves (k,)."""
        poses, moves, load = self.poses, self.moves, self.load
        start, end = moves.start[rows], moves.end[rows]
        circular = moves.via[rows] >= 0
        via = np.where(circular, moves.via[rows], end)
        first, last = poses.position[start], poses.position[end]
        arc = np.flatnonzero(circular)
        circle = circles(
            first, poses.position[via], last
        )  # a straight move has no third point: NaN
        R_first, R_via, R_last = (poses.rotation[each] for each in (start, via, end))
        turn, turns = np.zeros((len(rows), 3)), np.zeros((2, len(rows), 3))
        turning = np.flatnonzero((R_first != R_last).any(axis=(1, 2)))
        turn[turning] = _way(R_first[turning], R_last[turning])
        turns[0, arc], turns[1, arc] = _way(R_first[arc], R_via[arc]), _way(R_via[arc], R_last[arc])
        whole, detour = np.linalg.norm(turn, axis=1), np.linalg.norm(turns, axis=2).sum(axis=0)
        with np.errstate(invalid="ignore"):
            bent = circular & ((detour < whole + _ON_THE_WAY) | (whole > _AMBIGUOUS))
        straight = np.linalg.norm(last - first, axis=1)
        return Shapes(
            first=first,
            last=last,
            circular=circular,
            circle=circle,
            normal=_normals(poses, moves, rows),
            R_first=R_first,
            turn=turn,
            bent=np.asarray(bent),
            R_via=R_via,
            turns=turns,
            length=np.where(circular, circle.radius * circle.third, straight),
            load=np.stack([load[start], load[end]], axis=1) if len(load) else np.empty((0, 2, 6)),
            load_via=load[via] if len(load) else np.empty((0, 6)),
        )


def job_moves(
    model: ErrorModel,
    job: Sequence[Program],
    moves: Moves,
    results: Sequence[Compensation],
    settings: Sequence[CompensationSettings],
) -> JobMoves:
    """Returns a compensated job for the functions here; one result and settings per program.

    Raises:
        ConfigurationError: The payload changes from target to target.
    """
    for program, each in zip(job, settings, strict=True):
        if max(len(each.load.mass), len(each.load.com)) > 1:
            raise ConfigurationError(
                f"the payload changes from target to target of {program.name}; what it is between "
                "them is not known.",
                hint="give one payload, or leave the deviation and the splitting away.",
            )
    wrenches = [
        np.broadcast_to(each.load_for(len(program)).wrench, (len(program), 6))
        for program, each in zip(job, settings, strict=True)
    ]
    load = np.concatenate(wrenches)
    first = settings[0].load
    common = replace(
        settings[0],
        load=Load(mass=first.mass, com=first.com),
        wrench=load[:1] if load[:1].any() else np.empty(0),
    )
    if not len(load) or (load == load[0]).all():
        load = np.empty((0, 6))
    return JobMoves(
        model=model,
        moves=moves,
        poses=job_poses(job),
        joints=np.concatenate([each.joints for each in results]),
        status=np.concatenate([each.status for each in results]),
        load=load,
        settings=common,
    )


def _normals(poses: JobPoses, moves: Moves, rows: IntArray) -> Array:
    """Returns the normals (k, 3), base, of the planes that arcs cannot leave."""
    out = np.full((len(rows), 3), np.nan)
    flat = np.flatnonzero(moves.across[rows] >= 0)
    frames = poses.frames[poses.frame[moves.end[rows[flat]]]]
    out[flat] = frames[np.arange(len(flat)), :3, moves.across[rows[flat]]]
    return out


def _way(one: Array, other: Array) -> Array:
    """Returns the rotation vectors (k, 3) from one orientation to the other, in its axes."""
    return rotation_vector_from_matrix(np.swapaxes(one, 1, 2) @ other)


def along(shapes: Shapes, move: IntArray, t: Array) -> tuple[Array, Array]:
    """Returns position (n, 3) m and rotation (n, 3, 3), base, of moves (n,) at fractions (n,)."""
    position = shapes.first[move] + t[:, None] * (shapes.last[move] - shapes.first[move])
    arc = np.flatnonzero(shapes.circular[move])
    if len(arc):
        angle = t[arc] * shapes.circle.third[move[arc]]
        position[arc] = on_circles(shapes.circle, move[arc], angle)
    rotation = np.array(shapes.R_first[move])
    turning = np.flatnonzero(np.any(shapes.turn[move] != 0.0, axis=1) | shapes.bent[move])
    if len(turning):
        vector = t[turning, None] * shapes.turn[move[turning]]
        rotation[turning] = rotation[turning] @ matrix_from_rotation_vector(vector)
    bent = np.flatnonzero(shapes.bent[move])
    if len(bent):
        late, piece = _pieces(shapes, move[bent], t[bent])
        begin = np.where(late[:, None, None], shapes.R_via[move[bent]], shapes.R_first[move[bent]])
        vector = piece[:, None] * shapes.turns[late.astype(np.int64), move[bent]]
        rotation[bent] = begin @ matrix_from_rotation_vector(vector)
    return position, rotation


def loads(shapes: Shapes, move: IntArray, t: Array) -> Array:
    """Returns the wrench (n, 6) N, N m, base, of moves (n,) at fractions (n,), or an empty array.

    Between the targets force and moment turn the shortest way while their sizes change in
    proportion, so that a force along the tangent of an arc stays along it, and a constant one
    constant; an arc is handled in two pieces. At a corner the force of the move before turns into
    that of this one along the move.
    """
    if not len(shapes.load):
        return np.empty((0, 6))
    begin, end, piece = shapes.load[move, 0], shapes.load[move, 1], np.array(t)
    arc = shapes.circular[move]
    late, share = _pieces(shapes, move, t)
    begin = np.where((arc & late)[:, None], shapes.load_via[move], begin)
    end = np.where((arc & ~late)[:, None], shapes.load_via[move], end)
    piece = np.where(arc, share, piece)
    return np.concatenate(
        [_turning(begin[:, s], end[:, s], piece) for s in (slice(0, 3), slice(3, 6))], axis=1
    )


def _pieces(shapes: Shapes, move: IntArray, t: Array) -> tuple[BoolArray, Array]:
    """Returns the piece of an arc for each fraction (n,), and the fraction of that piece (n,)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        bend = shapes.circle.second[move] / shapes.circle.third[move]
        late = np.asarray(t > bend)
        share = np.where(late, (t - bend) / (1.0 - bend), t / bend)
    return late, share


def _turning(begin: Array, end: Array, t: Array) -> Array:
    """Returns vectors (n, 3) that turn from one to the other while their size changes evenly."""
    sizes = [np.linalg.norm(v, axis=1) for v in (begin, end)]
    size = (1.0 - t) * sizes[0] + t * sizes[1]
    straight = (1.0 - t)[:, None] * begin + t[:, None] * end
    with np.errstate(invalid="ignore", divide="ignore"):
        a, b = begin / sizes[0][:, None], end / sizes[1][:, None]
        cosine = np.clip(np.sum(a * b, axis=1), -1.0, 1.0)
        angle = np.arccos(cosine)
        sine = np.sin(angle)
        turned = (np.sin((1.0 - t) * angle) / sine)[:, None] * a
        turned += (np.sin(t * angle) / sine)[:, None] * b
    # What has no size has no direction, and half a turn has no shortest way.
    plain = ~(sine > _TINY) | (np.minimum(*sizes) <= _TINY * np.maximum(*sizes))
    return np.where(plain[:, None], straight, size[:, None] * np.where(plain[:, None], 0.0, turned))
