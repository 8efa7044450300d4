"""Similarity of the measured errors of regions, cylinder sectors or boxes: eq. 9-10 of Deng 2022.

The equations compare a reference region with others point by point. A point of another region
corresponds to the reference point at the same place in its own region: the same angle, radius and
height (or x, y, z) from the lower limits. The nearest one is taken, up to a stated distance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from robotrue.calibration.deng2022.readings import SIMILARITY_READINGS, SimilarityReading
from robotrue.calibration.deng2022.similarity import similarity
from robotrue.core.arrays import Array, IntArray
from robotrue.core.regions import (
    CylinderRegion,
    Region,
    bound_cube,
    bound_cylinder,
    contains,
    coordinate_units,
    coordinates_of,
    describe_region,
    divide_region,
)
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ObservabilityError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.validation.validation_defaults import FEWEST_PAIRS

SLACK: Final = 1e-3
"""m or rad by which a point may lie outside a region, and two regions may overlap."""
UNKNOWN: Final = float("nan")


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedRegion:
    """A region that is compared.

    Attributes:
        name: For tables and messages.
        region: A cylinder sector or a box.
    """

    name: str
    region: Region

    @property
    def kind(self) -> str:
        """``cylinder`` or ``cube``, the words of the paper."""
        return "cylinder" if isinstance(self.region, CylinderRegion) else "cube"


@dataclass(frozen=True, slots=True, kw_only=True)
class RegionSimilarity:
    """One region against the reference of its kind.

    Attributes:
        reference: Name of the reference region.
        name: Of the region.
        kind: ``cylinder`` or ``cube``.
        reference_rows: (n,) rows of the reference that have a counterpart.
        rows: (n,) their counterparts.
        apart: (n,) m between the places of each pair in its own region.
        values: Similarity by reading, -1 to 1; NaN where the reading cannot be computed.
    """

    reference: str
    name: str
    kind: str
    reference_rows: IntArray
    rows: IntArray
    apart: Array
    values: Mapping[SimilarityReading, float] = field(default_factory=dict)


def compare_regions(
    points: Array, errors: Array, regions: Sequence[NamedRegion], *, apart: float
) -> tuple[RegionSimilarity, ...]:
    """Returns the similarity of each region to the first one of its kind, under every reading.

    Args:
        points: (n, 3) m in base, commanded.
        errors: (n, 3) m in base, measured minus commanded.
        regions: The reference of each kind before the others.
        apart: m within which two points correspond.

    Raises:
        ConfigurationError: Regions of one kind that overlap, or one alone.
        ObservabilityError: A region without points, or too few points correspond.
    """
    found: list[RegionSimilarity] = []
    for kind in dict.fromkeys(each.kind for each in regions):
        alike = [each for each in regions if each.kind == kind]
        if len(alike) < 2:
            raise ConfigurationError(
                f"one {kind} region, {alike[0].name}; a reference and another one are compared.",
                hint="state a second region of this kind.",
            )
        refuse_overlap(alike)
        rows = [_rows_in(each, points) for each in alike]
        for other, there in zip(alike[1:], rows[1:], strict=True):
            pairs = _pair_rows(alike[0], rows[0], other, there, points, apart)
            found.append(_compare_pairs(alike[0], other, pairs, points, errors))
    return tuple(found)


def divide_points(points: Array, count: int) -> tuple[NamedRegion, ...]:
    """Returns the bounds of points (n, 3) m divided into sectors of a cylinder and into boxes.

    Sectors divide the angle about joint 1, boxes divide y (section 1.2 of the paper).
    """
    sectors: tuple[Region, ...] = divide_region(bound_cylinder(points), count, axis=0)
    boxes: tuple[Region, ...] = divide_region(bound_cube(points), count, axis=1)
    return tuple(
        NamedRegion(name=f"{kind} {k}", region=region)
        for kind, parts in (("sector", sectors), ("box", boxes))
        for k, region in enumerate(parts)
    )


def regions_of_sets(points: Array, rows: MeasurementSet) -> tuple[NamedRegion, ...]:
    """Returns the bounds of each set of measurements as a cylinder slab, the reference first.

    Args:
        points: (n, 3) m of the rows, commanded.
        rows: Their sets are the regions.

    Raises:
        ConfigurationError: One set alone.
    """
    groups = np.unique(rows.group).tolist()
    if len(groups) < 2:
        raise ConfigurationError(
            f"all {len(points)} poses belong to one set, {rows.group_names[groups[0]]!r}.",
            hint="a column `set` with the name of each region, or --region.",
        )
    return tuple(
        NamedRegion(name=rows.group_names[k], region=bound_cylinder(points[rows.group == k]))
        for k in groups
    )


def refuse_overlap(regions: Sequence[NamedRegion]) -> None:
    """Refuses regions of one kind that share more than a boundary.

    Raises:
        ConfigurationError: Two of them do.
    """
    for k, first in enumerate(regions):
        for second in regions[k + 1 :]:
            a, b = first.region.limits, second.region.limits
            shared = np.minimum(a[:, 1], b[:, 1]) - np.maximum(a[:, 0], b[:, 0])
            if (shared > SLACK).all():
                along = int(np.argmin(shared))
                _, unit, size = coordinate_units(first.region)[along]
                raise ConfigurationError(
                    f"regions {first.name} and {second.name} overlap by "
                    f"{shared[along] / size:.4g} {unit}.",
                    hint="regions side by side; they may share a boundary.",
                )


def _rows_in(named: NamedRegion, points: Array) -> IntArray:
    rows = np.flatnonzero(contains(named.region, points, slack=SLACK))
    if not len(rows):
        raise ObservabilityError(
            f"region {named.name} ({describe_region(named.region)}) holds none of {len(points)} "
            f"measured points; these cover {describe_region(_bound_like(named.region, points))}.",
            hint="check its limits and units, or measure there.",
        )
    return rows


def _bound_like(region: Region, points: Array) -> Region:
    return bound_cylinder(points) if isinstance(region, CylinderRegion) else bound_cube(points)


def _pair_rows(
    reference: NamedRegion,
    here: IntArray,
    other: NamedRegion,
    there: IntArray,
    points: Array,
    apart: float,
) -> tuple[IntArray, IntArray, Array]:
    """Rows of the reference, the nearest rows of the other region, and their distances, m."""
    lever = 1.0
    if isinstance(reference.region, CylinderRegion):
        lever = float(np.mean(reference.region.radius))
    scale = np.array([lever, 1.0, 1.0])
    places = [
        (coordinates_of(each.region, points[rows]) - each.region.limits[:, 0]) * scale
        for each, rows in ((reference, here), (other, there))
    ]
    found = cKDTree(places[1]).query(places[0])
    distance, nearest = np.asarray(found[0], dtype=np.float64), np.asarray(found[1], dtype=np.int64)
    near = np.flatnonzero(distance <= apart)
    if len(near) < FEWEST_PAIRS:
        raise ObservabilityError(
            f"{len(near)} of {len(here)} points of {reference.name} have a counterpart within "
            f"{apart / MM:.4g} mm among {len(there)} points of {other.name}, expected "
            f"{FEWEST_PAIRS} or more.",
            hint="measure the regions on the same grid, or state a larger --apart-mm.",
        )
    return here[near], there[nearest[near]], distance[near]


def _compare_pairs(
    reference: NamedRegion,
    other: NamedRegion,
    pairs: tuple[IntArray, IntArray, Array],
    points: Array,
    errors: Array,
) -> RegionSimilarity:
    here, there, distance = pairs
    values: dict[SimilarityReading, float] = {}
    for reading in SIMILARITY_READINGS:
        of = points if reading == "coordinates" else errors
        try:
            values[reading] = similarity(of[here], of[there], reading=reading)
        except ObservabilityError:
            values[reading] = UNKNOWN
    return RegionSimilarity(
        reference=reference.name,
        name=other.name,
        kind=other.kind,
        reference_rows=here,
        rows=there,
        apart=distance,
        values=values,
    )


def count_cylinder_wins(
    found: Sequence[RegionSimilarity], reading: SimilarityReading
) -> tuple[int, int] | None:
    """Returns the number of regions where the cylinder is more similar, and the total.

    The k-th region of one kind is compared with the k-th of the other; None without both.
    """
    cylinder, cube = (
        [each.values[reading] for each in found if each.kind == kind]
        for kind in ("cylinder", "cube")
    )
    count = min(len(cylinder), len(cube))
    if not count:
        return None
    return sum(a > b for a, b in zip(cylinder[:count], cube[:count], strict=True)), count
