"""The arm as tubes, and what a posture runs into or hides.

A tube runs straight from one joint of the DH table to the next, from the flange to the tool and
from the flange to the reflector; cabinets, cables and bent links are not in it. Radii come from the
cell or, without them, are a share of the reach. The first tube is the fixed foot: it is checked for
collisions with the arm alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.cell.obstacles import Box, HalfSpace, Obstacle, Sphere
from robotrue.core.arrays import Array, BoolArray, frozen
from robotrue.errors import ConfigurationError
from robotrue.robot.forward import walk
from robotrue.robot.model import RobotModel

_SHORT: Final = 1e-12
"""m^2; a segment with a smaller squared length is a point."""
_HALVINGS: Final = 60
"""Steps of the search along a segment; each takes a third off."""


def between_segments(a: Array, b: Array) -> Array:
    """Returns the distance (...) m of segments a and b, both (..., 2, 3) m.

    Source: Ericson 2005, "Real-Time Collision Detection", section 5.1.9 (closest points of two
    segments).
    """
    along_a, along_b = a[..., 1, :] - a[..., 0, :], b[..., 1, :] - b[..., 0, :]
    apart = a[..., 0, :] - b[..., 0, :]
    aa, bb = (along_a**2).sum(axis=-1), (along_b**2).sum(axis=-1)
    ab = (along_a * along_b).sum(axis=-1)
    ar, br = (along_a * apart).sum(axis=-1), (along_b * apart).sum(axis=-1)
    square = aa * bb - ab * ab
    skewed = square > 1e-12 * aa * bb
    s = np.where(skewed, (ab * br - ar * bb) / np.where(skewed, square, 1.0), 0.0)
    s = np.clip(s, 0.0, 1.0)
    t = _share(ab * s + br, bb)
    s = np.where(
        aa > _SHORT, np.clip((ab * t - ar) / np.where(aa > _SHORT, aa, 1.0), 0.0, 1.0), 0.0
    )
    gap = apart + s[..., None] * along_a - t[..., None] * along_b
    return np.asarray(np.linalg.norm(gap, axis=-1))


def to_point(segment: Array, point: Array) -> Array:
    """Returns the distance (...) m of segments (..., 2, 3) to points (..., 3), m."""
    along = segment[..., 1, :] - segment[..., 0, :]
    apart = point - segment[..., 0, :]
    t = _share((along * apart).sum(axis=-1), (along**2).sum(axis=-1))
    return np.asarray(np.linalg.norm(apart - t[..., None] * along, axis=-1))


def to_obstacle(segment: Array, obstacle: Obstacle) -> Array:
    """Returns the distance (...) m of segments (..., 2, 3) m to a body; zero or less is inside."""
    if isinstance(obstacle, Box):
        return _to_box(segment, obstacle)
    if isinstance(obstacle, HalfSpace):
        return np.asarray(((segment - obstacle.point) @ obstacle.normal).min(axis=-1))
    return to_point(segment, obstacle.centre) - obstacle.radius


def _to_box(segment: Array, box: Box) -> Array:
    """The distance to a convex body is convex along a segment: thirds find its minimum."""

    def distance(t: Array) -> Array:
        point = segment[..., 0, :] + t[..., None] * (segment[..., 1, :] - segment[..., 0, :])
        outside = np.maximum(np.maximum(box.low - point, point - box.high), 0.0)
        return np.asarray(np.linalg.norm(outside, axis=-1))

    low, high = np.zeros(segment.shape[:-2]), np.ones(segment.shape[:-2])
    for _ in range(_HALVINGS):
        third = (high - low) / 3.0
        nearer = distance(low + third) <= distance(high - third)
        low, high = np.where(nearer, low, low + third), np.where(nearer, high - third, high)
    return distance(0.5 * (low + high))


def _share(numerator: Array, square: Array) -> Array:
    long = square > _SHORT
    return np.where(long, np.clip(numerator / np.where(long, square, 1.0), 0.0, 1.0), 0.0)


THICK: Final = 0.06
THIN: Final = 0.04
"""Radius of the first three links and of the others, over the reach, where the cell is silent."""
TOOL: Final = 0.5
"""Radius of the tubes to tool and reflector, over that of the last link."""
POINT: Final = 1e-3
"""m; a shorter tube is none."""
OPEN: Final = 0.8
"""Share of its distance to the reflector that a tube on the flange may fill: the reflector is
mounted to be seen."""
INSTRUMENT: Final = 0.25
"""m, radius of the ball around the instrument and its tripod head."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """The tubes of one arm and its surroundings.

    Attributes:
        cell: Robot, reflector, obstacles, instrument.
        radius: (s,) m of each tube: links, then flange to tool and to reflector.
        pairs: (p, 2) tubes that could touch and should not.
        clearance: m kept from everything.
    """

    cell: Cell
    radius: Array
    pairs: Array
    clearance: float

    @property
    def robot(self) -> RobotModel:
        """The nominal arm with the reflector as its tool."""
        return self.cell.measured_robot

    def tubes(self, joints: Array) -> tuple[Array, Array, Array]:
        """Returns axes (n, s, 2, 3) m, reflectors (n, 3) m and flange rotations of postures."""
        state = walk(self.robot.nominal(), joints)
        n, dof = joints.shape
        knots = np.concatenate([np.zeros((n, 1, 3)), state.link_position], axis=1)
        tip = state.flange_position + state.flange_rotation @ self.cell.robot.T_flange_tool[:3, 3]
        axes = np.empty((n, dof + 2, 2, 3))
        axes[:, :dof, 0], axes[:, :dof, 1] = knots[:, :-1], knots[:, 1:]
        axes[:, dof:, 0] = state.flange_position[:, None]
        axes[:, dof, 1], axes[:, dof + 1, 1] = tip, state.position
        return axes, state.position, state.flange_rotation


def scene_of(cell: Cell, *, clearance: float) -> Scene:
    """Returns the scene of a cell.

    Two tubes are watched unless the arm between them is shorter than their radii: such tubes
    overlap in every posture.

    Raises:
        ConfigurationError: The tracker is inside the robot's foot or inside an obstacle.
    """
    robot = cell.measured_robot.nominal()
    dof = robot.dof
    share = np.where(np.arange(dof) < 3, THICK, THIN)
    link = share * robot.reach if cell.link_radius is None else cell.link_radius
    radius = np.append(link, [TOOL * link[-1]] * 2)
    scene = Scene(cell=cell, radius=radius, pairs=np.empty((0, 2)), clearance=clearance)
    axes = scene.tubes(np.zeros((1, dof)))[0][0]
    length = np.linalg.norm(axes[:, 1] - axes[:, 0], axis=1)
    start = np.append(
        np.concatenate([[0.0], np.cumsum(length[: dof - 1])]), [length[:dof].sum()] * 2
    )
    real = np.flatnonzero(length > POINT)
    pairs = [
        (i, j)
        for i in real
        for j in real
        if i < j and i < dof and start[j] - start[i] - length[i] > radius[i] + radius[j] + clearance
    ]
    place = cell.tracker_place
    if place is not None:
        _require_room(cell, place, axes[0], float(radius[0]))
    found = np.array(pairs, dtype=np.float64).reshape(-1, 2)
    return Scene(
        cell=cell, radius=radius, pairs=frozen(found, (None, 2), "pairs"), clearance=clearance
    )


def _require_room(cell: Cell, place: Array, foot: Array, radius: float) -> None:
    if to_point(foot[None], place)[0] < radius + INSTRUMENT:
        x, y, z = place * 1e3
        raise ConfigurationError(
            f"the tracker at ({x:.0f}, {y:.0f}, {z:.0f}) mm is inside the robot's foot.",
            source=cell.source or None,
            hint="tracker.xyz_mm or tracker.place_mm in the robot base, some metres away.",
        )
    for body in cell.obstacles:
        if to_obstacle(np.stack([place, place])[None], body)[0] <= 0.0:
            raise ConfigurationError(
                f"the tracker is inside obstacle {body.name!r}.",
                source=cell.source or None,
                hint="move the tracker, or check the obstacle.",
            )


def collisions(scene: Scene, joints: Array) -> dict[str, BoolArray]:
    """Returns, per reason, a mask (n,) of postures that collide, clearance included."""
    axes, _, _ = scene.tubes(joints)
    out: dict[str, BoolArray] = {"self collision": np.zeros(len(joints), dtype=bool)}
    for i, j in scene.pairs.astype(np.int64):
        gap = between_segments(axes[:, i], axes[:, j])
        out["self collision"] |= gap < scene.radius[i] + scene.radius[j] + scene.clearance
    bodies = list(scene.cell.obstacles)
    if scene.cell.tracker_place is not None:
        stand = Sphere(name="tracker", centre=scene.cell.tracker_place, radius=INSTRUMENT)
        bodies.append(stand)
    moving = axes[:, 1:]
    for body in bodies:
        near = to_obstacle(moving, body) < scene.radius[1:] + scene.clearance
        hit = near.any(axis=1)
        reason = f"collision with {body.name}"
        out[reason] = hit | out.get(reason, np.zeros_like(hit))
    return out


def hidden(scene: Scene, joints: Array) -> dict[str, BoolArray]:
    """Returns, per reason, at which postures (n,) the tracker cannot read the reflector.

    Without a place of the tracker nothing counts as hidden; a plan notes that this was not checked.
    """
    place = scene.cell.tracker_place
    if place is None:
        return {}
    axes, reflector, turn = scene.tubes(joints)
    n, dof = joints.shape
    sight = np.stack([np.broadcast_to(place, (n, 3)), reflector], axis=1)
    blocked = np.zeros(n, dtype=bool)
    for k in range(dof + 1):  # not the tube to the reflector itself
        radius: Array | float = scene.radius[k]
        if k >= dof - 1:  # moves with the reflector
            radius = np.minimum(radius, OPEN * to_point(axes[:, k], reflector))
        if np.linalg.norm(axes[0, k, 1] - axes[0, k, 0]) > POINT:
            blocked |= between_segments(sight, axes[:, k]) < radius
    out = {"line of sight: the arm": blocked}
    for body in scene.cell.obstacles:
        reason = f"line of sight: {body.name}"
        behind = to_obstacle(sight, body) <= 0.0
        out[reason] = behind | out.get(reason, np.zeros(n, dtype=bool))
    if scene.cell.target_axis is not None:
        ray = place - reflector
        ray = ray / np.linalg.norm(ray, axis=1)[:, None]
        cosine = np.einsum("ni,ni->n", turn @ scene.cell.target_axis, ray)
        out["acceptance angle of the reflector"] = cosine < np.cos(scene.cell.acceptance)
    return out
