"""A small cell and random information for the tests of planning."""

from __future__ import annotations

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load

PAYLOAD = Load(mass=np.array([50.0]), com=np.array([[0.0, 0.0, 0.084]]))
STIFFNESS = np.array([1.75, 1.72, 1.95, 3.73, 2.11, 1.74]) * 1e6


def shop(**changes: object) -> Cell:
    """A KR160 with a reflector on its side and a tracker 4 m away."""
    facts: dict[str, object] = {
        "robot": preset("kr160"),
        "T_flange_target": pose(np.eye(3), np.array([-0.15, 0.0, 0.05])),
        "tracker_position": np.array([3.5, -2.0, 1.2]),
        "payload": PAYLOAD,
        "compliance_prior": 1.0 / STIFFNESS,
        "link_radius": np.array([0.18, 0.12, 0.12, 0.09, 0.08, 0.07]),
    }
    return Cell(**(facts | changes))  # type: ignore[arg-type]


def information(count: int = 40, size: int = 12, seed: int = 3) -> tuple[Array, Array]:
    """Whitened rows (count, 3, size) of mixed sizes, and a weight (size, size)."""
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((count, 3, size)) * rng.uniform(0.05, 3.0, size)
    columns = rng.standard_normal((30, 3, size)) * rng.uniform(0.1, 2.0, size)
    return rows, np.einsum("nik,nil->kl", columns, columns) / 30


def covariance(rows: Array) -> Array:
    """P after all rows, the plain way."""
    flat = rows.reshape(-1, rows.shape[2])
    return np.asarray(np.linalg.inv(np.eye(rows.shape[2]) + flat.T @ flat))


def postures(n: int, seed: int) -> Array:
    """Postures (n, 6) rad in front of the KR160."""
    rng = np.random.default_rng(seed)
    centre = np.deg2rad([0.0, 0.0, 0.0, 0.0, -60.0, 0.0])
    return np.asarray(centre + np.deg2rad(40.0) * rng.uniform(-1.0, 1.0, (n, 6)))
