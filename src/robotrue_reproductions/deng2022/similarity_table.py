"""Table 4 of Deng et al. 2022: similarity of regions in a cylinder and in a cube workspace.

The arm is that of Tables 2 and 3 as printed, without anything un-modelled: equation 8 alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np

from robotrue.calibration.deng2022.readings import SIMILARITY_READINGS, SimilarityReading
from robotrue.calibration.deng2022.similarity import similarities
from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.core.regions import CubeRegion, CylinderRegion, Region, grid_points
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG
from robotrue.robot.inverse import inverse_batch
from robotrue.simulation.plans import ATTITUDE, POSTURE, Attitude
from robotrue.simulation.presets import VirtualCell, deng2022, raw_error
from robotrue_reproductions.reproduction import Figure, figure

Workspace: TypeAlias = Literal["cylinder", "cube"]
TABLE_4: Final[dict[Workspace, tuple[float, float, float]]] = {
    "cylinder": (0.9785, 0.9468, 0.9414),
    "cube": (0.9490, 0.8751, 0.8583),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SectorLayout:
    """A reference region and three others next to it, all alike.

    Attributes:
        regions: The reference first.
        counts: Grid points along each coordinate of a region.
        attitude: Whether the tool turns with the angle about joint 1.
    """

    regions: tuple[Region, Region, Region, Region]
    counts: tuple[int, int, int]
    attitude: Attitude


def cylinder_layout(
    start: float,
    width: float,
    gap: float,
    radius: tuple[float, float],
    height: tuple[float, float],
    counts: tuple[int, int, int],
    attitude: Attitude,
) -> SectorLayout:
    """Returns four slabs side by side about joint 1; start, width and gap in rad."""
    low = start + (width + gap) * np.arange(4)
    a, b, c, d = (
        CylinderRegion(angle=(float(v), float(v + width)), radius=radius, height=height)
        for v in low
    )
    return SectorLayout(regions=(a, b, c, d), counts=counts, attitude=attitude)


def cube_layout(
    start: float,
    width: float,
    gap: float,
    x: tuple[float, float],
    z: tuple[float, float],
    counts: tuple[int, int, int],
) -> SectorLayout:
    """Returns four boxes side by side along y; start, width and gap in m, counts of x, y, z."""
    low = start + (width + gap) * np.arange(4)
    a, b, c, d = (CubeRegion(x=x, y=(float(v), float(v + width)), z=z) for v in low)
    return SectorLayout(regions=(a, b, c, d), counts=counts, attitude="fixed")


FOUND: Final[dict[Workspace, SectorLayout]] = {
    "cylinder": cylinder_layout(
        -13.64 * DEG, 15.0 * DEG, 0.0, (1.0, 1.2), (0.6, 1.0), (5, 5, 5), "turning"
    ),
    "cube": cube_layout(-0.577, 0.30, 0.05, (0.6, 1.0), (0.5, 1.0), (5, 4, 5)),
}
"""Nearest to Table 4 under the recommended reading, of 1500 layouts drawn as here."""


def layout_errors(cell: VirtualCell, layout: SectorLayout) -> tuple[Array, Array] | None:
    """Returns points and errors (4, n, 3) m of the regions; None where a pose is out of reach."""
    points = np.concatenate([grid_points(region, layout.counts) for region in layout.regions])
    heading = np.zeros((len(points), 3))
    if layout.attitude == "turning":
        heading[:, 0] = np.arctan2(points[:, 1], points[:, 0])
    poses = pose(matrix_from_abc(heading) @ ATTITUDE, points)
    joints = inverse_batch(cell.known.measured_robot, poses, near=POSTURE)
    if not np.isfinite(joints).all():
        return None
    errors = raw_error(cell.robot, joints)
    return points.reshape(4, -1, 3), errors.reshape(4, -1, 3)


def layout_similarity(
    cell: VirtualCell, layout: SectorLayout
) -> dict[SimilarityReading, Array] | None:
    """Returns the similarities (3,) under every reading; None where a pose is out of reach."""
    found = layout_errors(cell, layout)
    if found is None:
        return None
    points, errors = found
    out: dict[SimilarityReading, Array] = {}
    for reading in SIMILARITY_READINGS:
        values = points if reading == "coordinates" else errors
        out[reading] = similarities(values[0], list(values[1:]), reading=reading)
    return out


def table_4_cell() -> VirtualCell:
    """Returns the arm of Tables 2 and 3 as printed, with nothing un-modelled."""
    return deng2022(1, level=0.0, exact=True)


def random_layouts(
    workspace: Workspace, count: int, rng: np.random.Generator
) -> Iterator[SectorLayout]:
    """Yields random layouts of one kind: start, width, gap, extents and number of points."""
    for _ in range(count):
        a, b, c = (int(v) for v in rng.integers(3, 6, 3))
        low = 0.1 * rng.integers(5, 11)
        height = (float(low), float(low + 0.1 * rng.integers(2, 6)))
        if workspace == "cylinder":
            near = 0.1 * rng.integers(8, 12)
            width, gap = 5 * DEG * rng.integers(2, 5), 5 * DEG * rng.integers(0, 2)
            room = max(120 * DEG - 4 * width - 3 * gap, 0.0)
            yield cylinder_layout(
                float(-60 * DEG + rng.uniform(0.0, room)),
                float(width),
                float(gap),
                (float(near), float(near + 0.1 * rng.integers(2, 6))),
                height,
                (a, b, c),
                "turning" if rng.random() < 0.5 else "fixed",
            )
        else:
            near = 0.1 * rng.integers(6, 11)
            width, gap = 0.05 * rng.integers(2, 7), 0.05 * rng.integers(0, 2)
            room = max(1.6 - 4 * width - 3 * gap, 0.0)
            yield cube_layout(
                float(-0.8 + rng.uniform(0.0, room)),
                float(width),
                float(gap),
                (float(near), float(near + 0.1 * rng.integers(2, 6))),
                height,
                (a, b, c),
            )


def similarity_figures(layouts: int) -> list[Figure]:
    """Returns Table 4: the layouts found, the nearest random ones, and cylinder against cube.

    Args:
        layouts: Random layouts of each kind.
    """
    cell = table_4_cell()
    out: list[Figure] = []
    for kind, printed in TABLE_4.items():
        found = layout_similarity(cell, FOUND[kind])
        if found is not None:
            out.extend(
                figure("4", f"{kind}, layout found", f"region {k + 1}", "", printed[k], value)
                for k, value in enumerate(found["per-point"])
            )
    rng = np.random.default_rng(5)
    drawn: dict[Workspace, list[dict[SimilarityReading, Array]]] = {}
    for kind in TABLE_4:
        seen = (layout_similarity(cell, layout) for layout in random_layouts(kind, layouts, rng))
        drawn[kind] = [values for values in seen if values is not None]
    for reading in SIMILARITY_READINGS:
        out.extend(_reading_figures(reading, drawn))
    return out


def _reading_figures(
    reading: SimilarityReading, drawn: dict[Workspace, list[dict[SimilarityReading, Array]]]
) -> Iterator[Figure]:
    for kind, printed in TABLE_4.items():
        away = [float(np.abs(v[reading] - printed).max()) for v in drawn[kind]]
        if away:
            yield _summary(reading, f"nearest {kind}, max deviation", min(away))
    pairs = list(zip(drawn["cylinder"], drawn["cube"], strict=False))
    if pairs:
        wins = np.mean([bool((a[reading] > b[reading]).all()) for a, b in pairs])
        yield _summary(reading, "share cylinder > cube", float(wins))


def _summary(reading: SimilarityReading, quantity: str, value: float) -> Figure:
    paper = 1.0 if quantity.startswith("share") else 0.0
    return figure("4 readings", reading, quantity, "", paper, value)
