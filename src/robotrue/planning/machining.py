"""Several sides of a part as one job: each posed, lifted, and reached without touching anything.

Every side gets a lift before its first and after its last point: along the tool axis until the tip
has left the box around part and paths by the lift height (none where the CAM system already ends
outside). The box holds the mesh, where there is one, and all points that cut. The job begins and
ends at home; between sides the arm moves by :func:`robotrue.planning.transit.transit`. Sides are
cut in the order given.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Final

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.cell.obstacles import Box
from robotrue.core.arm_words import Maker
from robotrue.core.arrays import Array, frozen
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import apply
from robotrue.core.surfaces import TriangleMesh
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ReachError
from robotrue.planning.arm_scene import Scene
from robotrue.planning.plan_defaults import LIFT_MM
from robotrue.planning.tool_axis import Posed, resolve_spin
from robotrue.planning.transit import find_collisions, scene_without_reflector, transit
from robotrue.program.posts.machining_moves import (
    JobSpeeds,
    JointMoves,
    MachiningMoves,
    SideMoves,
)
from robotrue.program.toolpath import Toolpath
from robotrue.robot.configuration import axis_relation, configuration_words, controller_axes
from robotrue.robot.forward import forward
from robotrue.robot.inverse import branch_of
from robotrue.robot.makers import joints_of_posture
from robotrue.robot.model import RobotModel
from robotrue.robot.spin import SHAPES, SpinSettings

MOVED: Final = 30.0 * MM
"""Frames of sides that move a corner of the part further apart are different clampings."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Side(Columns):
    """One side of the part and its frame.

    Attributes:
        path: The tool path, in the part frame.
        T_base_part: (4, 4).
    """

    path: Toolpath
    T_base_part: Annotated[Array, Column("4 4")]


def require_one_clamping(sides: Sequence[Side], box: Box) -> None:
    """Passes for part frames near enough to be readings of one clamping.

    Raises:
        ConfigurationError: They move a corner of the box by more than 30 mm.
    """
    corners = _corners(box)
    first = apply(sides[0].T_base_part, corners)
    for side in sides[1:]:
        apart = np.linalg.norm(apply(side.T_base_part, corners) - first, axis=1).max()
        if apart > MOVED:
            raise ConfigurationError(
                f"the part frames of {sides[0].path.source} and {side.path.source} put a corner of "
                f"the part {apart / MM:.0f} mm apart (at most {MOVED / MM:.0f} mm): it is clamped "
                "again between them.",
                hint="write one program per clamping.",
            )


def box_around(sides: Sequence[Side], mesh: TriangleMesh | None) -> Box:
    """Returns the box around the mesh and all points that cut, in the part frame.

    Raises:
        ConfigurationError: Nothing cuts.
    """
    points = [side.path.position[side.path.cutting] for side in sides]
    if mesh is not None:
        points.append(mesh.vertices)
    found = np.concatenate(points)
    if not len(found):
        raise ConfigurationError(
            "no move of any tool path cuts.", source=sides[0].path.source, hint="check RAPID."
        )
    low, high = found.min(axis=0), found.max(axis=0)
    flat = 0.5 * MM * (high - low < MM)  # a box must have a volume
    return Box(name="the part", low=low - flat, high=high + flat)


def with_lifts(path: Toolpath, box: Box, lift: float) -> Toolpath:
    """Returns the path with a rapid point before and after it, where it is not outside already."""
    ends = np.array([0, len(path) - 1])
    way = _way_out(path.position[ends], path.axis[ends], box, lift)
    count = len(path)
    before, after = bool(way[0] > 0.0), bool(way[1] > 0.0)
    if not (before or after):
        return path
    pick = np.concatenate([[0] * before, np.arange(count), [count - 1] * after]).astype(np.int64)
    position = path.position[pick]
    rapid = path.rapid[pick]
    if before:
        position[0] += way[0] * path.axis[0]
        rapid[0] = True
    if after:
        position[-1] += way[1] * path.axis[-1]
        rapid[-1] = True
    return path.with_points(pick, position=position, rapid=rapid)


def _corners(box: Box) -> Array:
    """The eight corners (8, 3) m."""
    low_high = np.stack([box.low, box.high])
    index = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    return np.asarray(low_high[index, np.arange(3)])


def _way_out(points: Array, axes: Array, box: Box, lift: float) -> Array:
    """Returns the retraction (k,) m of points along their axes to clear the box by the lift."""
    low, high = box.low - lift, box.high + lift
    with np.errstate(divide="ignore"):
        out = np.where(
            np.abs(axes) < 1e-9,
            np.inf,
            np.where(axes > 0.0, high - points, low - points) / np.where(axes == 0.0, 1.0, axes),
        )
    inside = ((points > low) & (points < high)).all(axis=1)
    return np.where(inside, out.min(axis=1), 0.0)


HOMES: Final = (
    np.array(
        [
            [0.0, -90.0, 90.0, 0.0, 0.0, 0.0],
            [0.0, -120.0, 90.0, 0.0, 0.0, 0.0],
            [0.0, -120.0, 120.0, 0.0, 90.0, 0.0],
            [0.0, -120.0, 120.0, 0.0, -90.0, 0.0],
        ]
    )
    * DEG
)
"""rad, axes of a KUKA arm where it is usually parked; the first that is clear is taken.

Arms of other makers have the same posture, if their wrist is spherical."""
PARALLEL_HOMES: Final = (
    np.array(
        [
            [0.0, -90.0, 90.0, -90.0, -90.0, 0.0],
            [0.0, -90.0, -90.0, -90.0, 90.0, 0.0],
            [180.0, -90.0, 90.0, -90.0, -90.0, 0.0],
        ]
    )
    * DEG
)
"""rad, axes of an upright arm of Universal Robots, tool down; the same use."""
LOOKED_AT: Final = 2000
"""Points of a side looked at for collisions while cutting, evenly over it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MachiningSettings:
    """Settings that turn sides into a job.

    Attributes:
        spin: How rotations about the tool axis are chosen.
        lift: m, from the box around the part, before and after each side.
        home: (6,) rad, controller's axes; empty takes the first of ``HOMES`` (of
            ``PARALLEL_HOMES`` for Universal Robots) that is clear.
    """

    spin: SpinSettings = field(
        default_factory=lambda: SpinSettings(cutter=np.array([0.0, 0.0, 1.0]))
    )
    lift: float = LIFT_MM * MM
    home: Array = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        """Checks.

        Raises:
            ConfigurationError: A lift below zero.
        """
        if np.size(self.home):
            object.__setattr__(self, "home", frozen(self.home, (6,), "home"))
        if not 0.0 <= self.lift < np.inf:
            raise ConfigurationError(
                f"the lift is {self.lift / MM:g} mm, expected 0 or more.", hint="--lift-mm 100"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class MachiningJob:
    """Sides with the arm that cuts them, and the moves between.

    Attributes:
        sides: In order, each with its lifts.
        moves: Postures (k, 6) rad, model sense, driven joint by joint before each side (the last of
            them is where the side begins) and after the last one. One more than sides.
        notes: What the user should know.
    """

    sides: tuple[Posed, ...]
    moves: tuple[Array, ...]
    notes: tuple[str, ...]


def plan_machining(
    cell: Cell,
    sides: Sequence[Side],
    settings: MachiningSettings,
    *,
    mesh: TriangleMesh | None = None,
) -> MachiningJob:
    """Returns the job: sides in the order given, each by one branch of the arm, and safe moves.

    Args:
        cell: Robot, tool, obstacles.
        sides: With their part frames.
        settings: Lift, home, cutter axis.
        mesh: Of the part.

    Raises:
        ReachError: A point out of reach, or no clear way between sides; with the line.
        ConfigurationError: Not an ortho-parallel arm, several tools, or sides of a part that is
            clamped again between them.
    """
    robot = cell.robot.nominal()
    _one_tool([side.path for side in sides])
    box = box_around(sides, mesh)
    require_one_clamping(sides, box)
    scene = scene_without_reflector(cell)
    homes = _homes(robot, scene, box, sides[0].T_base_part, settings)
    posed = [_pose_side(robot, side, box, settings, homes[0]) for side in sides]
    moves = _moves(scene, box, posed, homes)
    shape = branch_of(robot, homes[0])
    notes = [note for each in posed for note in _doubts(each, shape)]
    notes += [note for each in posed for note in _near_misses(scene, box, each)]
    return MachiningJob(sides=tuple(posed), moves=moves, notes=tuple(notes))


def job_moves(
    job: MachiningJob,
    robot: RobotModel,
    name: str,
    speeds: JobSpeeds,
    *,
    words_of: Maker = "",
    remarks: Sequence[str] = (),
) -> MachiningMoves:
    """Returns the program content of a job, for :func:`robotrue.program.posts.post_writer`.

    Args:
        job: Of this arm.
        robot: The nominal arm with the tool that cuts.
        name: Name of the program.
        speeds: Rapid, joint and default feed.
        words_of: Whose configuration words the targets carry; empty for none.
        remarks: Comments for the head.

    Raises:
        ConfigurationError: Not an ortho-parallel arm, of a maker with configuration words.
    """
    moves = [_joint_moves(robot, joints, words_of) for joints in job.moves]
    sides = [
        SideMoves(
            before=before,
            path=side.path,
            rotation=side.rotation,
            words=configuration_words(robot, words_of, side.joints),
            T_base_part=side.T_base_part,
        )
        for before, side in zip(moves[:-1], job.sides, strict=True)
    ]
    return MachiningMoves(
        name=name,
        T_flange_tool=robot.T_flange_tool,
        sides=tuple(sides),
        after=moves[-1],
        words_of=words_of,
        speeds=speeds,
        remarks=tuple(remarks),
    )


def _joint_moves(robot: RobotModel, joints: Array, words_of: Maker) -> JointMoves:
    return JointMoves(
        axes=controller_axes(robot, joints),
        T_base_tool=forward(robot.nominal(), joints),
        words=configuration_words(robot, words_of, joints),
    )


def _pose_side(
    robot: RobotModel, side: Side, box: Box, settings: MachiningSettings, home: Array
) -> Posed:
    """The side with its lifts; a lift out of reach is not blamed on the point under it."""
    frame, lifted = side.T_base_part, with_lifts(side.path, box, settings.lift)
    try:
        return resolve_spin(robot, frame, lifted, settings.spin, near=home)
    except ReachError as error:
        if error.line not in (side.path.line[0], side.path.line[-1]) or lifted is side.path:
            raise
        resolve_spin(robot, frame, side.path, settings.spin, near=home)  # or the point's own fault
        raise ReachError(
            f"the lift of {settings.lift / MM:g} mm over this point fails: {error.message}",
            source=error.source,
            line=error.line,
            hint="a smaller --lift-mm.",
        ) from error


def _one_tool(paths: Sequence[Toolpath]) -> None:
    tools = [(name, path.source, line) for path in paths for name, line in path.tools]
    for name, source, line in tools:
        if name != tools[0][0]:
            raise ConfigurationError(
                f"tool {name!r} is loaded after tool {tools[0][0]!r}; the cell has one tool.",
                source=source,
                line=line,
                hint="write one program per tool, each with its own [tool].",
            )


def _homes(
    robot: RobotModel, scene: Scene, box: Box, T_base_part: Array, settings: MachiningSettings
) -> list[Array]:
    """Postures (6,) rad the job may begin and end at: inside the limits and clear."""
    faults: list[str] = []
    good: list[Array] = []
    stated = np.size(settings.home) > 0
    if stated:
        homes = [axis_relation(robot)(settings.home)]
    elif robot.maker == "ur":
        homes = [axis_relation(robot)(axes) for axes in PARALLEL_HOMES]
    else:
        homes = [joints_of_posture(robot, axes) for axes in HOMES]
    for home in homes:
        beyond = (home < robot.limits[:, 0]) | (home > robot.limits[:, 1])
        hits = [
            k
            for k, hit in find_collisions(scene, box, T_base_part, home[None]).items()
            if hit.any()
        ]
        if not beyond.any() and not hits:
            good.append(np.asarray(home))
            continue
        joint = int(np.argmax(beyond))
        why = f"A{joint + 1} is beyond its limits" if beyond.any() else hits[0]
        shown = ", ".join(f"{value / DEG + 0.0:g}" for value in controller_axes(robot, home))
        faults.append(f"home (A1..A6 {shown} deg): {why}.")
    if not good:
        raise ConfigurationError(faults[0], hint="another --home-deg A1,..,A6, clear of the part.")
    return good


def _moves(
    scene: Scene, box: Box, posed: Sequence[Posed], homes: Sequence[Array]
) -> tuple[Array, ...]:
    """Moves from home to each side and home again, with the first home they all are clear from."""
    fault: ReachError | None = None
    for home in homes:
        here, moves = home, [home[None]]
        try:
            for side in posed:
                to = f"to the first point of {side.path.source}"
                way = transit(scene, box, side.T_base_part, here, side.joints[0], home, what=to)
                moves[-1] = np.concatenate([moves[-1], way, side.joints[:1]])
                moves.append(np.empty((0, 6)))
                here = side.joints[-1]
            way = transit(scene, box, posed[-1].T_base_part, here, home, home, what="home")
        except ReachError as error:
            fault = fault or error
        else:
            return (*moves[:-1], np.concatenate([way, home[None]]))
    raise fault or ReachError("no home was given.")


def _near_misses(scene: Scene, box: Box, posed: Posed) -> list[str]:
    """Sentences on obstacles that arm or tool come near to while cutting."""
    count = len(posed.joints)
    rows = np.unique(np.linspace(0, count - 1, min(count, LOOKED_AT)).astype(np.int64))
    hits = find_collisions(scene, box, posed.T_base_part, posed.joints[rows])
    hits.pop("collision with the part")  # cutting is meant to touch it
    return [
        f"{posed.path.place(int(rows[int(np.argmax(hit))]))}: {reason} while cutting."
        for reason, hit in hits.items()
        if hit.any()
    ]


def _doubts(posed: Posed, shape: int) -> list[str]:
    """Sentences on a tight fit, and on another shoulder or elbow than that of home's branch."""
    notes = []
    if posed.branch % SHAPES != shape % SHAPES:
        notes.append(
            f"{posed.path.source}: only reached with another shoulder or elbow than home's; watch "
            "the joint move to it."
        )
    if posed.limit_margin < 5.0 * DEG:
        notes.append(
            f"{posed.path.source}: a joint comes within {posed.limit_margin / DEG:.1f} deg of its "
            "limit."
        )
    if posed.wrist_angle < 10.0 * DEG:
        notes.append(
            f"{posed.path.source}: the wrist comes within {posed.wrist_angle / DEG:.1f} deg of "
            "stretched."
        )
    return notes
