"""A workspace map as a page, as a table and as JSON: figure, sectors, how alike they are."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.csv_text import axis_names, csv_text
from robotrue.core.regions import coordinate_units
from robotrue.core.units import DEG, MM
from robotrue.report.content import (
    Cell,
    Conclusion,
    Fact,
    KeyFigure,
    ReportContent,
    ReportTable,
    Section,
    finite_or_none,
)
from robotrue.report.labels import plain_columns
from robotrue.report.map_plots import MapSlices
from robotrue.robot.model import Configuration
from robotrue.validation.error_map import SectorSimilarity, WorkspaceMap

MOST_SLICES: Final = 5
ATTITUDES: Final = {
    "turning": "the tool's attitude turns with the angle about joint 1",
    "fixed": "the tool's attitude is fixed in base",
}


def map_slices(found: WorkspaceMap, *, title: str) -> MapSlices:
    """Returns the figure: error length, its parts and what stays, in up to five slices.

    Slices cut the coordinate the sectors divide; the other two are the axes, the last one up.
    """
    units = coordinate_units(found.region)
    others = [k for k in range(3) if k != found.along]
    axes = [np.unique(found.coordinates[:, k]) for k in range(3)]
    cut = np.unique(
        np.linspace(0, len(axes[found.along]) - 1, MOST_SLICES).round().astype(np.int64)
    )
    quantities = [found.norm, *found.error.T, found.bound]
    values = np.stack([_cut(found, q, cut) for q in quantities])
    (a_name, a_unit, a_size), (u_name, u_unit, u_size) = units[others[0]], units[others[1]]
    s_name, s_unit, s_size = units[found.along]
    lost = int((~found.reachable).sum())
    gaps = f" Crosses: {lost} poses out of reach." if lost else ""
    return MapSlices(
        quantities=("length", "along x", "along y", "along z", "residual, 95 %"),
        slices=tuple(f"{s_name} {float(axes[found.along][k]) / s_size:.4g} {s_unit}" for k in cut),
        values=values,
        signed=(False, True, True, True, False),
        across=axes[others[0]] / a_size,
        up=axes[others[1]] / u_size,
        across_label=f"{a_name}, {a_unit}",
        up_label=f"{u_name}, {u_unit}",
        title=title,
        caption=(
            "Predicted error, actual minus commanded, base axes; last row: the radius that "
            "contains the residual error after compensation with 95 % probability. "
            f"{ATTITUDES[found.attitude].capitalize()}." + gaps
        ),
    )


def _cut(found: WorkspaceMap, values: Array, cut: IntArray) -> Array:
    """Values (n,) as (slices, up, across)."""
    grid = np.moveaxis(found.grid(values), found.along, 0)[cut]
    return np.swapaxes(grid, 1, 2)


def map_content(
    found: WorkspaceMap,
    alike: tuple[SectorSimilarity, ...],
    *,
    title: str,
    subtitle: str,
    simulated: bool,
    doubts: tuple[str, ...] = (),
    provenance: tuple[Fact, ...] = (),
) -> ReportContent:
    """Returns the content of a page about one map."""
    able = found.reachable
    norm, bound = found.norm[able] / MM, found.bound[able] / MM
    return ReportContent(
        title=title,
        subtitle=subtitle,
        simulated=simulated,
        verdict=Conclusion(
            text=(
                f"Predicted error {norm.mean():.3f} mm on average, {norm.max():.3f} mm at worst; "
                f"after compensation 95 % within {bound.max():.3f} mm at the point of largest "
                "uncertainty."
            ),
            tone="plain",
            detail=f"{int(able.sum())} of {len(able)} grid poses are in reach; "
            f"{ATTITUDES[found.attitude]}.",
        ),
        tiles=(
            KeyFigure(label="mean predicted error", value=float(norm.mean()), unit="mm"),
            KeyFigure(label="largest", value=float(norm.max()), unit="mm"),
            KeyFigure(label="after compensation, 95 %, mean", value=float(bound.mean()), unit="mm"),
            KeyFigure(
                label="grid poses in reach",
                value=100.0 * float(able.mean()),
                unit="%",
                digits=1,
            ),
        ),
        sections=(
            Section(title="Map", blocks=(map_slices(found, title="Predicted error"),)),
            _sectors(found, alike),
        ),
        doubts=doubts,
        provenance=provenance,
    )


def sector_names(found: WorkspaceMap) -> tuple[str, ...]:
    """Returns the range of each sector in words, e.g. ``angle -40 to -23 deg``."""
    name, unit, size = coordinate_units(found.region)[found.along]
    values = found.coordinates[:, found.along] / size
    return tuple(
        f"{name} {values[found.sector == k].min():.4g} to "
        f"{values[found.sector == k].max():.4g} {unit}"
        for k in range(found.sectors)
    )


def _sectors(found: WorkspaceMap, alike: tuple[SectorSimilarity, ...]) -> Section:
    names = sector_names(found)
    rows: list[tuple[Cell, ...]] = []
    for k, name in enumerate(names):
        here = (found.sector == k) & found.reachable
        if not here.any():
            rows.append((name, 0, None, None, None, None, None, None))
            continue
        error, stays = _statistics(found.norm[here] / MM), _statistics(found.bound[here] / MM)
        mean = (found.error[here].mean(axis=0) / MM).tolist()
        rows.append((name, int(here.sum()), error["mean"], error["max"], *mean, stays["mean"]))
    blocks = [
        ReportTable(
            title="Sectors",
            columns=(
                *plain_columns("sector", "poses"),
                *plain_columns("mean", "max", "mean x", "mean y", "mean z", unit="mm"),
                *plain_columns("residual, 95 %", unit="mm"),
            ),
            rows=tuple(rows),
        )
    ]
    if alike:
        blocks.append(_similarities(names, alike))
    return Section(title="Sectors and their similarity", blocks=tuple(blocks))


def _similarities(names: tuple[str, ...], alike: tuple[SectorSimilarity, ...]) -> ReportTable:
    return ReportTable(
        title="Similarity of the errors at corresponding points",
        columns=(
            *plain_columns("sector", "and sector", "points"),
            *plain_columns("vectors", "x", "y", "z", "length", digits=4),
        ),
        rows=tuple(
            (
                names[s.first],
                names[s.second],
                s.points,
                *(finite_or_none(float(v)) for v in (s.vector, *s.axis, s.norm)),
            )
            for s in alike
        ),
        caption=(
            "1 is equal. Vectors: cosine of the error vectors, each component scaled to 0..1 in "
            "its sector (Deng et al. 2022, eq. 9-10); x, y, z, length: cosine over the points."
        ),
    )


def map_table(error_map: WorkspaceMap, controller: Configuration) -> str:
    """Returns one line per grid point as CSV; cells of points the arm cannot take are empty.

    Joints are printed as the controller displays them.
    """
    units = coordinate_units(error_map.region)
    sd, axes = error_map.sd, controller.to_controller(error_map.joints) / DEG
    columns: list[tuple[str, Array]] = [
        *((f"{n}_{u}", error_map.coordinates[:, k] / s) for k, (n, u, s) in enumerate(units)),
        *((f"{'xyz'[k]}_base_mm", error_map.point[:, k] / MM) for k in range(3)),
        ("sector", error_map.sector.astype(np.float64) + 1.0),
        *((name, axes[:, i]) for i, name in enumerate(axis_names(axes.shape[1]))),
        *((f"error_{'xyz'[k]}_mm", error_map.error[:, k] / MM) for k in range(3)),
        ("error_mm", error_map.norm / MM),
        *((f"sd_{'xyz'[k]}_mm", sd[:, k] / MM) for k in range(3)),
        ("stays_95_mm", error_map.bound / MM),
    ]
    rows = np.stack([values for _, values in columns], axis=1)
    cells = [[f"{value:.6g}" if np.isfinite(value) else "" for value in row] for row in rows]
    return csv_text([[name for name, _ in columns], *cells])


def map_document(error_map: WorkspaceMap, alike: tuple[SectorSimilarity, ...]) -> dict[str, object]:
    """Returns region, grid and the numbers of each sector as JSON values; mm, deg."""
    able = error_map.reachable
    names = sector_names(error_map)
    units = coordinate_units(error_map.region)
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


def _sector(error_map: WorkspaceMap, rows: Array) -> dict[str, object]:
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
