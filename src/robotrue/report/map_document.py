"""A map of predicted errors as JSON values and as a table."""

from __future__ import annotations

from typing import Any

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.csv_text import csv_text
from robotrue.core.units import DEG, MM
from robotrue.report.map import coordinate_units, sector_names
from robotrue.validation.error_map import SectorSimilarity, WorkspaceMap


def map_table(error_map: WorkspaceMap) -> str:
    """Returns one line per grid point as CSV; cells of points the arm cannot take are empty."""
    units = coordinate_units(error_map)
    sd, joints = error_map.sd, error_map.joints / DEG
    columns: list[tuple[str, Array]] = [
        *((f"{n}_{u}", error_map.coordinates[:, k] / s) for k, (n, u, s) in enumerate(units)),
        *((f"{'xyz'[k]}_base_mm", error_map.point[:, k] / MM) for k in range(3)),
        ("sector", error_map.sector.astype(np.float64) + 1.0),
        *((f"j{i + 1}_deg", joints[:, i]) for i in range(joints.shape[1])),
        *((f"error_{'xyz'[k]}_mm", error_map.error[:, k] / MM) for k in range(3)),
        ("error_mm", error_map.norm / MM),
        *((f"sd_{'xyz'[k]}_mm", sd[:, k] / MM) for k in range(3)),
        ("stays_95_mm", error_map.bound / MM),
    ]
    rows = np.stack([values for _, values in columns], axis=1)
    cells = [[f"{value:.6g}" if np.isfinite(value) else "" for value in row] for row in rows]
    return csv_text([[name for name, _ in columns], *cells])


def map_document(error_map: WorkspaceMap, alike: tuple[SectorSimilarity, ...]) -> dict[str, Any]:
    """Returns region, grid and the numbers of each sector as JSON values; mm, deg."""
    able = error_map.reachable
    names = sector_names(error_map)
    units = coordinate_units(error_map)
    limits = zip(units, error_map.region.limits, strict=True)
    return {
        "region": {f"{n}_{u}": [low / s, high / s] for (n, u, s), (low, high) in limits},
        "attitude": error_map.attitude,
        "grid": list(error_map.counts),
        "poses": len(able),
        "in_reach": int(able.sum()),
        "error_mm": _statistics(error_map.norm[able] / MM),
        "stays_95_mm": _statistics(error_map.bound[able] / MM),
        "sectors": [
            {"name": name, **_sector(error_map, (error_map.sector == k) & able)}
            for k, name in enumerate(names)
        ],
        "similarity": [
            {
                "sectors": [s.first + 1, s.second + 1],
                "points": s.points,
                "vectors": s.vector,
                "axis": s.axis.tolist(),
                "length": s.norm,
            }
            for s in alike
        ],
    }


def _sector(error_map: WorkspaceMap, rows: Array) -> dict[str, Any]:
    if not rows.any():
        return {"in_reach": 0}
    return {
        "in_reach": int(rows.sum()),
        "error_mm": _statistics(error_map.norm[rows] / MM),
        "axis_mean_mm": (error_map.error[rows].mean(axis=0) / MM).tolist(),
        "axis_max_mm": (np.abs(error_map.error[rows]).max(axis=0) / MM).tolist(),
        "stays_95_mm": _statistics(error_map.bound[rows] / MM),
    }


def _statistics(values: Array) -> dict[str, float]:
    return {"mean": float(values.mean()), "max": float(values.max())}
