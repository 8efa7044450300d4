"""Parts of a workspace: cylinder slabs about joint 1 and cubes. Pure geometry, base frame, SI.

Both kinds have three coordinates with a lower and an upper limit: angle, radius, height about the
base's z axis, or x, y, z. Everything else follows from that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, TypeAlias, TypeVar

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.rotations import wrap
from robotrue.core.units import DEG, MM
from robotrue.errors import ShapeError

Interval: TypeAlias = tuple[float, float]
"""Lower and upper limit."""
SLACK: Final = 1e-9
"""m or rad: a point on the boundary is inside, rounding of a rotation included."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CylinderRegion:
    """A part of a hollow cylinder about the base's z axis.

    Attributes:
        angle: Lower and upper angle about z, rad; at most one turn.
        radius: Lower and upper distance from z, m.
        height: Lower and upper z, m.
    """

    angle: Interval
    radius: Interval
    height: Interval

    def __post_init__(self) -> None:
        """Checks the limits."""
        _check(angle=self.angle, radius=self.radius, height=self.height)
        if self.angle[1] - self.angle[0] > 2.0 * np.pi + SLACK:
            raise ShapeError(f"angle {self.angle} rad spans more than one turn.")
        if self.radius[0] < 0.0:
            raise ShapeError(f"radius {self.radius[0]:g} m, expected 0 or more.")

    @property
    def limits(self) -> Array:
        """(3, 2) lower and upper angle (rad), radius, height (m)."""
        return np.array([self.angle, self.radius, self.height])


@dataclass(frozen=True, slots=True, kw_only=True)
class CubeRegion:
    """A box along the base axes.

    Attributes:
        x: Lower and upper x, m.
        y: Lower and upper y, m.
        z: Lower and upper z, m.
    """

    x: Interval
    y: Interval
    z: Interval

    def __post_init__(self) -> None:
        """Checks the limits."""
        _check(x=self.x, y=self.y, z=self.z)

    @property
    def limits(self) -> Array:
        """(3, 2) lower and upper x, y, z, m."""
        return np.array([self.x, self.y, self.z])


Region: TypeAlias = CylinderRegion | CubeRegion
_Either = TypeVar("_Either", CylinderRegion, CubeRegion)


def points_at(region: Region, coordinates: Array) -> Array:
    """Returns points (n, 3) m in base from the region's own coordinates (n, 3).

    Args:
        region: Defines the coordinates; its limits are not used.
        coordinates: (n, 3) angle, radius, height, or x, y, z.
    """
    values = np.asarray(coordinates, dtype=np.float64)
    if isinstance(region, CubeRegion):
        return values.copy()
    angle, radius, height = values.T
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)


def coordinates_of(region: Region, points: Array) -> Array:
    """Returns the region's own coordinates (n, 3) of points (n, 3) m in base.

    Angles come out within half a turn of the region's middle.

    Fails when: a point lies on the z axis; its angle is then the one of x.
    """
    values = np.asarray(points, dtype=np.float64)
    if isinstance(region, CubeRegion):
        return values.copy()
    x, y, z = values.T
    middle = 0.5 * (region.angle[0] + region.angle[1])
    angle = middle + wrap(np.arctan2(y, x) - middle)
    return np.stack([angle, np.hypot(x, y), z], axis=1)


def contains(region: Region, points: Array, *, slack: float = SLACK) -> BoolArray:
    """Returns (n,) True for points (n, 3) m in base inside the region or on its boundary.

    Args:
        region: Where.
        points: (n, 3) m.
        slack: Largest distance outside, in m and in rad.
    """
    low, high = region.limits.T
    values = coordinates_of(region, points)
    inside: BoolArray = ((values >= low - slack) & (values <= high + slack)).all(axis=1)
    return inside


def grid_coordinates(region: Region, counts: tuple[int, int, int]) -> Array:
    """Returns the coordinates (n, 3) of a complete grid, boundaries included, last one fastest.

    Args:
        region: Where.
        counts: Grid values along each coordinate; 1 is the middle of its range.

    Raises:
        ShapeError: A count below 1.
    """
    if min(counts) < 1:
        raise ShapeError(f"grid of {counts} points, expected 1 or more each way.")
    axes = [
        np.linspace(low, high, count) if count > 1 else np.array([0.5 * (low + high)])
        for (low, high), count in zip(region.limits, counts, strict=True)
    ]
    return np.stack([g.ravel() for g in np.meshgrid(*axes, indexing="ij")], axis=1)


def grid_points(region: Region, counts: tuple[int, int, int]) -> Array:
    """Returns the points (n, 3) m in base of a complete grid; see :func:`grid_coordinates`."""
    return points_at(region, grid_coordinates(region, counts))


def random_coordinates(region: Region, n: int, rng: np.random.Generator) -> Array:
    """Returns n coordinates (n, 3), each uniform within its limits."""
    low, high = region.limits.T
    return np.asarray(rng.uniform(low, high, (n, 3)))


def corners(region: Region) -> Array:
    """Returns the eight corner points (8, 3) m in base, the last coordinate changing fastest."""
    return grid_points(region, (2, 2, 2))


def divide_region(
    region: _Either, parts: int, *, axis: int = 0, gap: float = 0.0
) -> tuple[_Either, ...]:
    """Returns equal parts of the region along one coordinate, in rising order.

    Args:
        region: What is divided.
        parts: How many.
        axis: Which coordinate: 0 is the angle of a cylinder and x of a cube.
        gap: Distance left between neighbours, rad or m; negative is their overlap.

    Raises:
        ShapeError: No parts, no such coordinate, or gaps that leave nothing.
    """
    names = tuple(type(region).__dataclass_fields__)
    if parts < 1 or axis not in (0, 1, 2):
        raise ShapeError(f"{parts} parts along coordinate {axis}, expected 1 or more, along 0..2.")
    low, high = region.limits[axis]
    width = (high - low - (parts - 1) * gap) / parts
    if not 0.0 < width <= high - low + SLACK:
        raise ShapeError(
            f"{parts} parts with gaps of {gap:g} do not fit {names[axis]} {low:g} to {high:g}."
        )
    starts = low + (width + gap) * np.arange(parts)
    return tuple(replace(region, **{names[axis]: (float(s), float(s + width))}) for s in starts)


def turn_region(region: CylinderRegion, angle: float) -> CylinderRegion:
    """Returns the region turned about the base's z axis by an angle in rad."""
    low, high = region.angle
    return replace(region, angle=(low + angle, high + angle))


def bound_cylinder(points: Array) -> CylinderRegion:
    """Returns the smallest cylinder slab about joint 1 that holds points (n, 3) m."""
    angle = np.arctan2(points[:, 1], points[:, 0])
    middle = float(np.arctan2(np.sin(angle).mean(), np.cos(angle).mean()))
    turned = middle + wrap(angle - middle)
    radius, height = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
    return CylinderRegion(
        angle=(float(turned.min()), float(turned.max())),
        radius=(float(radius.min()), float(radius.max())),
        height=(float(height.min()), float(height.max())),
    )


def bound_cube(points: Array) -> CubeRegion:
    """Returns the smallest box along the base axes that holds points (n, 3) m."""
    x, y, z = ((float(low), float(high)) for low, high in zip(
        points.min(axis=0), points.max(axis=0), strict=True
    ))  # fmt: skip
    return CubeRegion(x=x, y=y, z=z)


def coordinate_units(region: Region) -> tuple[tuple[str, str, float], ...]:
    """Returns name, unit of messages (mm, deg) and its size in SI of each coordinate."""
    if isinstance(region, CylinderRegion):
        return (("angle", "deg", DEG), ("radius", "mm", MM), ("height", "mm", MM))
    return (("x", "mm", MM), ("y", "mm", MM), ("z", "mm", MM))


def describe_region(region: Region) -> str:
    """Returns the limits in words, e.g. ``angle -40 to -30 deg, radius 800 to 1400 mm, ...``."""
    return ", ".join(
        f"{name} {low / size:.4g} to {high / size:.4g} {unit}"
        for (name, unit, size), (low, high) in zip(
            coordinate_units(region), region.limits, strict=True
        )
    )


def describe_point(region: Region, point: Array) -> str:
    """Returns the region's coordinates of a point (3,) m in base, in words."""
    values = coordinates_of(region, point[None])[0]
    return ", ".join(
        f"{name} {value / size:.4g} {unit}"
        for (name, unit, size), value in zip(coordinate_units(region), values, strict=True)
    )


def _check(**intervals: Interval) -> None:
    for name, (low, high) in intervals.items():
        if not (np.isfinite([low, high]).all() and low <= high):
            raise ShapeError(f"{name} from {low:g} to {high:g}: the lower limit comes first.")
