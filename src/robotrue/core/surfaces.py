"""Surfaces of a part that a probe can touch: planes, cylinders, triangle meshes.

Part frame, metres. Meshes are read from files by trimesh (extra ``mesh``).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Protocol

import numpy as np
from scipy.spatial import cKDTree

from robotrue.core.arrays import Array, IntArray, frozen
from robotrue.core.columns import Column, Columns
from robotrue.core.units import MM
from robotrue.errors import FormatError, ImplausibleDataError, MissingExtraError, ShapeError

if TYPE_CHECKING:
    from trimesh import Trimesh

_SLIVER: Final = 1e-12
"""Area over longest edge squared below which a triangle has no normal."""


class Surface(Protocol):
    """A surface that returns the distance and direction of a point from it."""

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """Returns signed distances (n,) m, positive outside, and outward normals (n, 3).

        Args:
            points: (n, 3) m in part.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Plane(Columns):
    """A plane face.

    Attributes:
        point: (3,) m, any point of it.
        normal: (3,) out of the material; normalised.
    """

    point: Annotated[Array, Column("3", unit="m")]
    normal: Annotated[Array, Column("3")]

    def _check_rules(self) -> None:
        """Normalises.

        Raises:
            ShapeError: A normal of length zero.
        """
        self._set_column("normal", _unit(self.normal, "normal"))

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """Returns signed distances (n,) m and the normal (n, 3)."""
        distance = (points - self.point) @ self.normal
        return distance, np.broadcast_to(self.normal, points.shape)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cylinder(Columns):
    """A round boss or, with ``hole``, a bore; without ends.

    Attributes:
        point: (3,) m, any point of the axis.
        axis: (3,) along it; normalised.
        radius: m.
        hole: True where the material is outside.
    """

    point: Annotated[Array, Column("3", unit="m")]
    axis: Annotated[Array, Column("3")]
    radius: float
    hole: bool = False

    def _check_rules(self) -> None:
        """Normalises.

        Raises:
            ShapeError: An axis of length zero or a radius that is not positive.
        """
        self._set_column("axis", _unit(self.axis, "axis"))
        if not 0.0 < self.radius < np.inf:
            raise ShapeError(f"radius is {self.radius:g} m, expected a positive number.")

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """Returns signed distances (n,) m and normals (n, 3).

        Fails when: a point lies on the axis; any direction across it then serves.
        """
        across = points - self.point
        across = across - (across @ self.axis)[:, None] * self.axis
        length = np.linalg.norm(across, axis=1)
        aside = np.eye(3)[int(np.argmin(np.abs(self.axis)))]
        aside = np.cross(self.axis, aside)
        on_axis = length < 1e-12
        normal = np.where(on_axis[:, None], aside, across / np.where(on_axis, 1.0, length)[:, None])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        sign = -1.0 if self.hole else 1.0
        return sign * (length - self.radius), sign * normal


def _unit(vector: Array, name: str) -> Array:
    v = frozen(vector, (3,), name)
    length = float(np.linalg.norm(v))
    if length < 1e-9:
        raise ShapeError(f"{name} has length {length:g}, expected a direction.")
    unit: Array = frozen(v / length, (3,), name)
    return unit


@dataclass(frozen=True, slots=True, kw_only=True)
class TriangleMesh(Columns):
    """A part as triangles, counter-clockwise seen from outside. Part frame, metres.

    Attributes:
        vertices: (v, 3) m.
        faces: (f, 3) indices into vertices.
        normals: (f, 3) outward, from the order of the vertices.
    """

    vertices: Annotated[Array, Column("_ 3", unit="m")]
    faces: Annotated[IntArray, Column("_ 3")]
    normals: Array = field(init=False)
    _tree: cKDTree = field(init=False, repr=False, compare=False)
    _reach: float = field(init=False, repr=False, compare=False)

    def _check_rules(self) -> None:
        """Checks the triangles.

        Raises:
            ShapeError: No triangles, or indices out of range.
            ImplausibleDataError: Triangles without area.
        """
        vertices, faces = self.vertices, self.faces
        if not len(faces) or faces.min() < 0 or faces.max() >= len(vertices):
            raise ShapeError(f"{len(faces)} triangles over {len(vertices)} vertices.")
        corners = vertices[faces]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(across, axis=1)
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        flat = np.flatnonzero(area <= _SLIVER * longest**2)
        if len(flat):
            raise ImplausibleDataError(
                f"{len(flat)} of {len(faces)} triangles have no area, the first is number "
                f"{flat[0]}; they have no normal.",
                hint="clean the mesh: remove degenerate faces.",
            )
        middle = corners.mean(axis=1)
        reach = float(np.linalg.norm(corners - middle[:, None], axis=2).max())
        normals = frozen(across / area[:, None], (len(faces), 3), "normals")
        object.__setattr__(self, "normals", normals)
        object.__setattr__(self, "_tree", cKDTree(middle))
        object.__setattr__(self, "_reach", reach)

    @property
    def centre(self) -> Array:
        """Middle of the box around it, (3,) m."""
        return np.asarray(0.5 * (self.vertices.min(axis=0) + self.vertices.max(axis=0)))

    @property
    def open_edges(self) -> int:
        """Edges that do not have exactly one triangle on either side: 0 for a closed part."""
        pairs = np.sort(
            np.concatenate([self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]]),
            axis=1,
        )
        counts = np.unique(pairs, axis=0, return_counts=True)[1]
        return int((counts != 2).sum())

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """Returns signed distances (n,) m and the normals (n, 3) of the distance there.

        Over a face the normal is the face's; over an edge or corner it points along the shortest
        way. The sign is that of the face, of those equally near, that looks most at the point.
        """
        closest, face = self.nearest_points(points)
        apart = points - closest
        length = np.linalg.norm(apart, axis=1)
        normal = self.normals[face]
        sign = np.where((apart * normal).sum(axis=1) < 0.0, -1.0, 1.0)
        clear = length > 1e-9
        direction = np.where(
            clear[:, None], sign[:, None] * apart / np.where(clear, length, 1.0)[:, None], normal
        )
        return sign * length, direction

    def nearest_points(self, points: Array) -> tuple[Array, IntArray]:
        """Returns the nearest mesh point (n, 3) m and its triangle (n,) for points (n, 3) m.

        Exact: every triangle that could hold a nearer point is looked at.
        """
        points = np.asarray(points, dtype=np.float64)
        first = np.asarray(self._tree.query(points)[1], dtype=np.int64)
        bound = np.linalg.norm(points - _on_triangle(points, self._corners(first)), axis=1)
        lists = self._tree.query_ball_point(points, bound + self._reach + 1e-12)
        owner = np.repeat(np.arange(len(points)), [len(found) for found in lists])
        face = np.concatenate([np.asarray(found, dtype=np.int64) for found in lists])
        candidate = _on_triangle(points[owner], self._corners(face))
        apart = points[owner] - candidate
        distance = np.linalg.norm(apart, axis=1)
        shortest = np.full(len(points), np.inf)
        np.minimum.at(shortest, owner, distance)
        near = distance <= shortest[owner] + 1e-9
        # Of the triangles that share the nearest edge the one facing the point knows its side.
        facing = np.abs((apart * self.normals[face]).sum(axis=1))
        order = np.lexsort((-facing, ~near, owner))
        start = np.searchsorted(owner[order], np.arange(len(points)))
        chosen = order[start]
        return candidate[chosen], face[chosen]

    def _corners(self, face: IntArray) -> Array:
        return np.asarray(self.vertices[self.faces[face]])


def _on_triangle(points: Array, corners: Array) -> Array:
    """Returns the nearest point (n, 3) of each triangle (n, 3, 3) to its point (n, 3)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    normal = normal / np.linalg.norm(normal, axis=1)[:, None]
    height = ((points - a) * normal).sum(axis=1)[:, None]
    inside = np.ones(len(points), dtype=bool)
    best, shortest = points.copy(), np.full(len(points), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        edge = end - start
        inside &= (np.cross(edge, points - start) * normal).sum(axis=1) >= 0.0
        share = ((points - start) * edge).sum(axis=1) / (edge**2).sum(axis=1)
        foot = start + np.clip(share, 0.0, 1.0)[:, None] * edge
        distance = np.linalg.norm(points - foot, axis=1)
        nearer = distance < shortest
        best[nearer], shortest[nearer] = foot[nearer], distance[nearer]
    return np.where(inside[:, None], points - height * normal, best)


def read_scan(path: str | Path) -> Array:
    """Returns the points (n, 3) m of a scan, each once; open surfaces are welcome.

    Args:
        path: Its triangles (STL, PLY, OBJ, ...), in millimetres.

    Raises:
        MissingExtraError: trimesh is not installed.
        FormatError: The file is missing, or not a mesh trimesh can read.
    """
    _, vertices, faces = _load_triangles(path, MM)
    return np.asarray(np.unique(vertices[np.unique(faces)], axis=0))


def _load_triangles(path: str | Path, unit: float) -> tuple[Trimesh, Array, IntArray]:
    """Returns the mesh of a file, its vertices (n, 3) m and faces (m, 3)."""
    try:
        import trimesh
    except ImportError as error:
        raise MissingExtraError(
            "reading a mesh needs trimesh, which is not installed.",
            source=path,
            hint="pip install 'robotrue[mesh]'",
        ) from error
    try:
        loaded = trimesh.load_mesh(str(path))
        vertices = np.asarray(loaded.vertices, dtype=np.float64) * unit
        faces = np.asarray(loaded.faces, dtype=np.int64)
    except Exception as error:  # trimesh's readers raise whatever their parsers raise
        raise FormatError(
            f"no mesh could be read: {type(error).__name__}: {error}",
            source=path,
            hint="export the part as binary STL.",
        ) from error
    if not len(faces):
        raise FormatError(
            "the file holds no triangles: points alone have no normals.",
            source=path,
            hint="export the part as STL, with its faces.",
        )
    return loaded, vertices, faces


def read_mesh(path: str | Path, *, unit: float = MM) -> TriangleMesh:
    """Returns the mesh in a file (STL, PLY, OBJ, ...).

    Args:
        path: The file.
        unit: m per unit of the file; STL does not state it, millimetres are usual.

    Raises:
        MissingExtraError: trimesh is not installed.
        FormatError: The file is missing, or not a mesh trimesh can read.
        ImplausibleDataError: Holes or faces turned inside out: the outside is undefined.
    """
    loaded, vertices, faces = _load_triangles(path, unit)
    if not (loaded.is_watertight and loaded.is_winding_consistent):
        raise ImplausibleDataError(
            f"the mesh of {len(faces)} triangles has {_fault(vertices, faces)}.",
            source=path,
            hint="repair it in CAD; the outside of the mesh must be defined.",
        )
    if loaded.volume < 0.0:
        faces = faces[:, ::-1]
    keep = np.linalg.norm(
        np.cross(
            vertices[faces[:, 1]] - vertices[faces[:, 0]],
            vertices[faces[:, 2]] - vertices[faces[:, 0]],
        ),
        axis=1,
    )
    return TriangleMesh(vertices=vertices, faces=faces[keep > 0.0])


def _fault(vertices: Array, faces: IntArray) -> str:
    """Returns why a mesh has no outside, and the first place; empty if it has one."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    pairs, counts = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    wrong, what = pairs[counts == 1], "open edges, a hole"
    if not len(wrong):
        wrong, what = pairs[counts > 2], "edges that more than two triangles share"
    if not len(wrong):
        ways, times = np.unique(edges, axis=0, return_counts=True)
        wrong, what = ways[times > 1], "edges between faces with opposite normals"
    if not len(wrong):
        return "faces with reversed normals"
    x, y, z = vertices[wrong[0]].mean(axis=0) / MM
    return f"{len(wrong)} {what}; the first is at ({x:.1f}, {y:.1f}, {z:.1f}) mm"
