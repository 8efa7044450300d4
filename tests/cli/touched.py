"""Touches of a part for the tests of ``robotrue register``: its true place, files, a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import shop

from robotrue.core.arrays import Array
from robotrue.core.poses import apply, inverse, pose_from_xyz_abc

T_BASE_PART = pose_from_xyz_abc(np.array([1.1, -0.2, 0.5]), np.deg2rad([10.0, -5.0, 3.0]))
POINTS = np.array(
    [
        [0.0, 0.0, 0.0],
        [0.4, 0.0, 0.0],
        [0.4, 0.2, 0.0],
        [0.0, 0.2, 0.05],
        [0.0, 0.0, 0.3],
        [0.4, 0.0, 0.31],
        [0.33, 0.2, 0.3],
        [0.11, 0.2, 0.27],
    ]
)
"""Of a part without symmetry, m."""
NAMES = tuple(f"K{i}" for i in range(1, 9))


def in_base(points: Array, *, noise: float = 1e-4, seed: int = 1) -> Array:
    """Where points of the part are touched, (n, 3) m."""
    scatter = noise * np.random.default_rng(seed).standard_normal(np.shape(points))
    return apply(T_BASE_PART, np.asarray(points, dtype=np.float64)) + scatter


def by_joints(n: int, *, seed: int = 5, noise: float = 5e-5) -> tuple[Array, Array]:
    """Nominal points (n, 3) m in part and joints (n, 6) rad at which the true arm touches them."""
    joints = shop.postures(n, seed)
    rng = np.random.default_rng(seed + 100)
    tips = shop.points(joints) + noise * rng.standard_normal((n, 3))
    return apply(inverse(T_BASE_PART), tips), joints


def on_block(n: int, *, seed: int = 3) -> tuple[Array, Array]:
    """Points (n, 3) m and normals (n, 3) on three faces of the block of :func:`block`."""
    rng = np.random.default_rng(seed)
    face = rng.permutation(np.arange(n) % 3)
    points = rng.uniform(0.02, 0.18, (n, 3))
    points[np.arange(n), face] = 0.0
    normals = np.zeros((n, 3))
    normals[np.arange(n), face] = -1.0
    return points, normals


def write(
    path: Path,
    points: Array,
    *,
    position: Array | None = None,
    joints_deg: Array | None = None,
    normal: Array | None = None,
    names: Sequence[str] = NAMES,
    part: Sequence[str] = (),
) -> Path:
    """A POINTS.csv; ``position`` in m, written in mm."""
    columns: dict[str, Sequence[object] | Array] = {"name": list(names[: len(points)])}
    columns |= dict(zip(("px_mm", "py_mm", "pz_mm"), np.transpose(points) * 1e3, strict=True))
    if joints_deg is not None:
        columns |= dict(zip(shop.COLUMNS[:6], np.transpose(joints_deg), strict=True))
    if position is not None:
        columns |= dict(zip(shop.COLUMNS[6:], np.transpose(position) * 1e3, strict=True))
    if normal is not None:
        columns |= dict(zip(("nx", "ny", "nz"), np.transpose(normal), strict=True))
    if part:
        columns["part"] = list(part)
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(_cell(v) for v in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _cell(value: object) -> str:
    if isinstance(value, str):
        return value
    return "" if np.isnan(value) else f"{value:.9f}"  # type: ignore[call-overload,str-format]


def block(path: Path, *, hole: bool = False) -> Path:
    """An STL in mm of a block of 400 x 200 x 300 mm with a corner at the origin."""
    corners = np.array([[x, y, z] for x in (0, 400) for y in (0, 200) for z in (0, 300)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]
    lines = ["solid block"]
    for face in faces[: -1 if hole else None]:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x:g} {y:g} {z:g}" for x, y, z in corners[list(face)]]
        lines += ["endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid block"]) + "\n")
    return path
