"""Simple bodies of an arm for drawing, made from its chain: columns, housings, limbs and booms.

Each body moves with one link and is stated in that link's frame. A link is built from the axis of
its own joint to the axis of the next one. A part along its own axis is a column, whose first half
belongs to the link before; a part between parallel axes is a boom, any other a limb.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Final, Literal, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import inverse, pose
from robotrue.robot.forward import ChainState, walk
from robotrue.robot.model import RobotModel

Kind: TypeAlias = Literal["drum", "limb", "boom"]
"""A cylinder with bevelled ends; a cone with round ends; a flat bar with round ends."""
Paint: TypeAlias = Literal["body", "joint", "accent", "tool"]

SPLIT: Final = 0.5
"""Share of a column that belongs to the link before its joint."""
HOUSING: Final = 1.12
"""Half the length of a joint's housing, over its radius."""
FOOT: Final = 1.9
"""Radius of the base plate, over that of the first link."""
PLATE: Final = 0.35
"""Thickness of the base plate, over that radius."""
RING: Final = 0.16
"""Width of the ring that marks the joint of a column, over its radius."""
FLANGE: Final = 0.4
"""Thickness of the flange disc, over its radius."""
TAPER: Final = 0.78
"""Radius at the end of the last column, over that of its link."""
TIP: Final = 0.25
"""Radius of the tool at its point, over that of the last link."""
PARALLEL: Final = 0.99
"""Cosine between axes that count as parallel."""
SHORT: Final = 0.35
"""A part shorter than this share of its radius is inside the housing and not drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmShape:
    """One body, in the frame of its link.

    Attributes:
        link: It moves with; 0 is the base.
        kind: Of the body.
        paint: Which of the arm's colours.
        start: m, middle of one end.
        end: m, middle of the other.
        radii: m at both ends.
        boom_axis: Unit vector across a boom; zero for other kinds.
    """

    link: int
    kind: Kind
    paint: Paint
    start: tuple[float, ...]
    end: tuple[float, ...]
    radii: tuple[float, float]
    boom_axis: tuple[float, ...] = (0.0, 0.0, 0.0)

    def document(self) -> dict[str, object]:
        """Returns JSON values; m."""
        return asdict(self)


def link_poses(state: ChainState) -> Array:
    """Returns the frames T_base_link (n, dof + 1, 4, 4) of base and links."""
    base = np.broadcast_to(np.eye(4), (len(state.position), 1, 4, 4))
    return np.concatenate([base, pose(state.link_rotation, state.link_position)], axis=1)


def arm_shapes(robot: RobotModel, radius: Array) -> list[ArmShape]:
    """Returns the bodies of an arm and its tool.

    Args:
        robot: The arm with its tool.
        radius: (dof,) m of the links.
    """
    state = walk(robot, np.zeros((1, robot.dof)))
    frames = inverse(link_poses(state)[0])
    return [_in_link(shape, frames[shape.link]) for shape in _build(robot, state, radius)]


def _build(robot: RobotModel, state: ChainState, radius: Array) -> Iterator[ArmShape]:
    """Gives the bodies in base, at zero joints."""
    origins, axes = state.joint_origin[0], state.joint_axis[0]
    flange, last = state.flange_position[0], robot.dof - 1
    foot, up = _foot(origins[0], axes[0], radius[0])
    yield _drum(0, "joint", foot, foot + PLATE * radius[0] * up, FOOT * radius[0])
    for k in range(robot.dof):
        start = foot if k == 0 else origins[k]
        end, across = (flange, axes[k]) if k == last else (origins[k + 1], axes[k + 1])
        bend = start + axes[k] * float(axes[k] @ (end - start))
        thin = radius[min(k + 1, last)]
        if np.linalg.norm(bend - start) > SHORT * radius[k]:
            yield from _column(k, start, bend, radius[k], TAPER * radius[k] if k == last else thin)
        else:
            half = HOUSING * radius[k] * axes[k]
            yield _drum(k + 1, "joint", start - half, start + half, radius[k])
        if np.linalg.norm(end - bend) > SHORT * thin:
            boom = abs(float(axes[k] @ across)) > PARALLEL
            yield ArmShape(
                link=k + 1,
                kind="boom" if boom else "limb",
                paint="body",
                start=tuple(bend),
                end=tuple(end),
                radii=(0.92 * radius[k], 0.92 * thin),
                boom_axis=tuple(axes[k]) if boom else (0.0, 0.0, 0.0),
            )
    out = state.flange_rotation[0, :, 2]
    disc = FLANGE * radius[last] * out
    yield _drum(robot.dof, "joint", flange - disc, flange, TAPER * radius[last])
    point = state.position[0]
    if np.linalg.norm(point - flange) > SHORT * radius[last]:
        yield ArmShape(
            link=robot.dof,
            kind="limb",
            paint="tool",
            start=tuple(flange),
            end=tuple(point),
            radii=(0.5 * radius[last], TIP * radius[last]),
        )


def _foot(origin: Array, axis: Array, radius: float) -> tuple[Array, Array]:
    """Where the first axis meets the mounting plane of the base, and the way up from there.

    An axis along the plane, or an origin below it, is mounted where its joint is.
    """
    if abs(axis[2]) < 0.5:
        return origin - np.array([0.0, 0.0, radius]), np.array([0.0, 0.0, 1.0])
    return origin - axis * (origin[2] / axis[2]), np.array([0.0, 0.0, 1.0])


def _column(k: int, start: Array, end: Array, wide: float, thin: float) -> Iterator[ArmShape]:
    """Gives the parts of a link along its own axis: fixed part, ring, turning part."""
    middle = start + SPLIT * (end - start)
    along = (end - start) / np.linalg.norm(end - start)
    ring = 0.5 * RING * wide * along
    yield ArmShape(
        link=k,
        kind="limb" if k else "drum",  # the base plate is flat
        paint="body",
        start=tuple(start),
        end=tuple(middle),
        radii=(1.08 * wide, wide),
    )
    yield _drum(k, "accent", middle - ring, middle + ring, 1.1 * wide)
    yield ArmShape(
        link=k + 1, kind="limb", paint="body", start=tuple(middle), end=tuple(end),
        radii=(wide, thin),
    )  # fmt: skip


def _drum(link: int, paint: Paint, start: Array, end: Array, radius: float) -> ArmShape:
    return ArmShape(
        link=link, kind="drum", paint=paint, start=tuple(start), end=tuple(end),
        radii=(radius, radius),
    )  # fmt: skip


def _in_link(shape: ArmShape, T_link_base: Array) -> ArmShape:
    """Returns a body that is stated in base in the frame of its link."""
    rotation, origin = T_link_base[:3, :3], T_link_base[:3, 3]

    def move(point: tuple[float, ...], shift: Array) -> tuple[float, ...]:
        return tuple(float(v) for v in rotation @ np.array(point) + shift)

    return ArmShape(
        link=shape.link,
        kind=shape.kind,
        paint=shape.paint,
        start=move(shape.start, origin),
        end=move(shape.end, origin),
        radii=(float(shape.radii[0]), float(shape.radii[1])),
        boom_axis=move(shape.boom_axis, np.zeros(3)),
    )
