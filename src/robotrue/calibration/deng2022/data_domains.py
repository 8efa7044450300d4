"""Source, target and sub-spaces of measured rows: stated, or the bounds of the rows themselves."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.calibration.deng2022.domains import Domains, divide_target, members
from robotrue.core.arrays import Array
from robotrue.core.regions import (
    CylinderRegion,
    bound_cylinder,
    contains,
    coordinates_of,
    describe_point,
    describe_region,
)
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError, ObservabilityError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel

FEWEST_IN_SUB_SPACE: Final = 3
"""Target poses; fewer do not determine how errors of the source change with the angle."""
BEYOND: Final = 0.25
"""Part of the source's range of radius or height by which a target pose may lie outside of it."""
SLACK: Final = 1e-3
"""m or rad by which a row may lie outside a region, and two regions may overlap."""


def domains_of_rows(
    robot: RobotModel,
    source: MeasurementSet,
    target: MeasurementSet,
    *,
    source_region: CylinderRegion | None = None,
    target_region: CylinderRegion | None = None,
    sub_spaces: int | None = None,
) -> Domains:
    """Returns the domains of measured rows, by their commanded points.

    Args:
        robot: Nominal arm whose tool is the measured point.
        source: Completely sampled region.
        target: A few poses in every sub-space.
        source_region: Where the source was sampled; the bounds of its rows if None.
        target_region: Where the model shall hold; the bounds of the target rows if None.
        sub_spaces: How many; as many as fit without an overlap if None.

    Raises:
        ConfigurationError: Source and target are the same, exchanged, or overlap; rows outside
            their region.
        ObservabilityError: A sub-space with fewer than :data:`FEWEST_IN_SUB_SPACE` target poses.
    """
    _refuse_repeated(source, target)
    known, few = (forward(robot.nominal(), rows.joints)[:, :3, 3] for rows in (source, target))
    for name, region, rows, points in (
        ("source", source_region, source, known),
        ("target", target_region, target, few),
    ):
        if region is not None:
            _refuse_outside(name, region, rows, points)
    of_source = bound_cylinder(known) if source_region is None else source_region
    if target_region is None:
        _refuse_beyond(of_source, target, few)
    of_target = bound_cylinder(few) if target_region is None else target_region
    if source_region is None or target_region is None:
        of_source, of_target = _share_ranges(of_source, of_target)
    _refuse_overlap(of_source, of_target, target, few)
    width = of_source.angle[1] - of_source.angle[0]
    span = of_target.angle[1] - of_target.angle[0]
    count = max(int((span + SLACK) / width), 1) if sub_spaces is None else sub_spaces
    domains = divide_target(of_source, of_target, count)
    inside = members(domains, few).sum(axis=1)
    poor = np.flatnonzero(inside < FEWEST_IN_SUB_SPACE)
    if len(poor):
        low, high = np.array(domains.sub_spaces[poor[0]].angle) / DEG
        raise ObservabilityError(
            f"{inside[poor[0]]} target poses in sub-space {poor[0] + 1} of {count}, angles "
            f"{low:.4g} to {high:.4g} deg, expected {FEWEST_IN_SUB_SPACE} or more.",
            hint="measure more poses there, or state fewer sub-spaces (--sub-spaces).",
        )
    return domains


def _share_ranges(
    source: CylinderRegion, target: CylinderRegion
) -> tuple[CylinderRegion, CylinderRegion]:
    """Both regions with the radii and heights of either: the map between them only turns."""
    radius, height = (
        (min(a[0], b[0]), max(a[1], b[1]))
        for a, b in ((source.radius, target.radius), (source.height, target.height))
    )
    return (
        CylinderRegion(angle=source.angle, radius=radius, height=height),
        CylinderRegion(angle=target.angle, radius=radius, height=height),
    )


def _refuse_repeated(source: MeasurementSet, target: MeasurementSet) -> None:
    if source.dof != target.dof:
        return
    rows = np.concatenate([source.joints, source.position], axis=1)
    seen = {tuple(row) for row in rows.round(9).tolist()}
    both = np.concatenate([target.joints, target.position], axis=1).round(9).tolist()
    again = [k for k, row in enumerate(both) if tuple(row) in seen]
    if again:
        raise ConfigurationError(
            f"{len(again)} of {len(target)} target measurements are source measurements too, the "
            f"first at {place_of_row(target, again[0])}.",
            hint="--source takes the file of the source region, TARGET that of the others.",
        )


def _refuse_outside(name: str, region: CylinderRegion, rows: MeasurementSet, points: Array) -> None:
    lost = np.flatnonzero(~contains(region, points, slack=SLACK))
    if len(lost):
        raise ConfigurationError(
            f"{len(lost)} of {len(rows)} {name} poses lie outside the {name} region "
            f"({describe_region(region)}), the first, {place_of_row(rows, int(lost[0]))}, at "
            f"{describe_point(region, points[lost[0]])}.",
            hint=f"a wider --{name}-region, or leave these rows out.",
        )


def _refuse_beyond(source: CylinderRegion, target: MeasurementSet, points: Array) -> None:
    """Refuses target poses at radii or heights that the source does not come near."""
    low, high = source.limits[1:].T
    room = BEYOND * (high - low) + SLACK
    values = coordinates_of(source, points)[:, 1:]
    away = np.maximum(low - room - values, values - high - room)
    lost = np.flatnonzero((away > 0.0).any(axis=1))
    if len(lost):
        raise ConfigurationError(
            f"{len(lost)} of {len(points)} target poses lie where the source has none near, the "
            f"first, {place_of_row(target, int(lost[0]))}, at "
            f"{describe_point(source, points[lost[0]])}; the source covers "
            f"{describe_region(source)}.",
            hint="source poses at these radii and heights, or leave the target poses out.",
        )


def _refuse_overlap(
    source: CylinderRegion, target: CylinderRegion, rows: MeasurementSet, points: Array
) -> None:
    shared = min(source.angle[1], target.angle[1]) - max(source.angle[0], target.angle[0])
    if shared <= SLACK:
        return
    inside = np.flatnonzero(contains(source, points))
    where = f"; {len(inside)} target poses lie in it" if len(inside) else ""
    if len(inside):
        where += f", the first at {place_of_row(rows, int(inside[0]))}"
    exchanged = target.angle[1] - target.angle[0] < source.angle[1] - source.angle[0]
    raise ConfigurationError(
        f"source ({describe_region(source)}) and target ({describe_region(target)}) share "
        f"{shared / DEG:.4g} deg about joint 1{where}.",
        hint="the source is the narrow region: are source and target exchanged?"
        if exchanged
        else "leave these rows out, or state --source-region and --target-region side by side.",
    )


def place_of_row(rows: MeasurementSet, row: int) -> str:
    """Returns where a row was read, e.g. ``line 12 of target.csv``."""
    file = rows.file_of(row)
    return f"line {int(rows.source_row[row])}{f' of {file}' if file else ''}"
