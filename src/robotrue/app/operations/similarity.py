"""Compare the measured errors of regions: similarity and error curves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Note, PlainResult, Table
from robotrue.app.request import Item, Option, Output, Reference, Request
from robotrue.app.request_fields import OUTPUT, CellFile, ForeignColumns, Page
from robotrue.calibration.deng2022.readings import SIMILARITY_READING, SimilarityReading
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.validation.validation_defaults import APART_MM, FEWEST_PAIRS, SIMILARITY_REGIONS

if TYPE_CHECKING:
    from robotrue.core.arrays import Array
    from robotrue.measurement.measurement_set import MeasurementSet
    from robotrue.validation.region_similarity import NamedRegion, RegionSimilarity


class SimilarityRequest(Request):
    """Measurements, and the regions to compare."""

    cell: CellFile
    measurements: Annotated[tuple[Reference, ...], Item(noun="measurement", argument="MEAS...")]
    """Measured poses, in base."""
    output: Annotated[Path, Output(names=OUTPUT, what="a CSV table", suffixes=(".csv",))]
    """CSV of the similarities to write."""
    region: Annotated[
        tuple[str, ...],
        Option(example="A=angle_deg=-40..-30,radius_mm=800..1400,height_mm=700..1200"),
    ] = ()
    """NAME=angle_deg=A..B,radius_mm=..,height_mm=.. or x_mm,y_mm,z_mm; repeated."""
    by_set: bool = False
    """Regions are the sets of the measurements (column set), by their bounds."""
    divide: Annotated[int, Option(least=2)] = SIMILARITY_REGIONS
    """Without --region and --by-set: number of sectors and boxes."""
    reading: SimilarityReading = SIMILARITY_READING
    """Reading of eq. 9-10 where one number is shown; the table has all."""
    apart_mm: float = APART_MM
    """Largest distance of corresponding points, each in its own region."""
    mapping: ForeignColumns = None
    curves: Annotated[Path | None, Output(what="a CSV table", suffixes=(".csv",))] = None
    """Also write the error curves to this CSV."""
    report: Page = None


@operation()
def run(request: SimilarityRequest, context: Context) -> PlainResult:
    """Compares the regions; writes the table and, if requested, the curves and the page.

    Raises:
        ConfigurationError: Regions that overlap, or that cannot be.
        ModelMismatchError: Positions in the frame of a tracker.
        ObservabilityError: A region without points, or too few of them correspond.
    """
    from robotrue.report.page import report_html
    from robotrue.report.similarity_report import curves_csv, similarities_csv, similarity_content
    from robotrue.robot.forward import forward
    from robotrue.validation.region_similarity import compare_regions, count_cylinder_wins

    if request.apart_mm <= 0.0:
        raise ConfigurationError(f"--apart-mm {request.apart_mm:g}, expected more than 0.")
    cell = context.cell(request.cell)
    rows = context.measurements(cell, request.measurements, request.mapping, minimum=FEWEST_PAIRS)
    _require_base(rows)
    points = forward(cell.measured_robot.nominal(), rows.joints)[:, :3, 3]
    errors = rows.position - points
    regions = _regions(request, rows, points)
    found = compare_regions(points, errors, regions, apart=request.apart_mm * MM)
    output = context.write(request.output, similarities_csv(found, rows.provenance), "similarities")
    if request.curves is not None:
        table = curves_csv(found, rows, points, errors)
        context.write(request.curves, table, "error curves")
    wins = count_cylinder_wins(found, request.reading)
    if request.report is not None:
        content = similarity_content(
            found,
            errors,
            regions,
            reading=request.reading,
            wins=wins,
            poses=len(rows),
            simulated=rows.provenance.simulated,
        )
        context.write(request.report, report_html(content), "report")
    return PlainResult(
        values={"similarities_csv": str(output), **_document(found, request.reading, wins)},
        shown=tuple(_blocks(found, request.reading, len(rows), wins)),
        provenance=rows.provenance,
    )


def _document(
    found: Sequence[RegionSimilarity], reading: str, wins: tuple[int, int] | None
) -> dict[str, object]:
    """Similarities in mm, and in how many regions the cylinder is more similar than the cube."""
    from robotrue.core.json_values import json_values

    return {
        "reading": reading,
        "cylinder_above_cube": None if wins is None else wins[0],
        "compared": None if wins is None else wins[1],
        "regions": [
            {
                "kind": each.kind,
                "reference": each.reference,
                "region": each.name,
                "points": len(each.rows),
                "furthest_pair_mm": float(each.apart.max()) / MM,
                "similarity": json_values(dict(each.values)),
            }
            for each in found
        ],
    }


def _blocks(
    found: Sequence[RegionSimilarity], reading: str, poses: int, wins: tuple[int, int] | None
) -> Iterable[Block]:
    """The similarities under every reading."""
    yield Table(
        title=f"similarity of errors to the reference region, {poses} poses, 1 is equal",
        columns=("region", "reference", "points", "furthest pair mm", *found[0].values),
        rows=tuple(
            (
                each.name,
                each.reference,
                str(len(each.rows)),
                f"{each.apart.max() / MM:.2f}",
                *(f"{v:.4f}" if isfinite(v) else "-" for v in each.values.values()),
            )
            for each in found
        ),
    )
    if wins is not None:
        yield Note(
            f"the cylinder is more similar than the cube in {wins[0]} of {wins[1]} "
            f"regions, reading {reading}"
        )


def _require_base(rows: MeasurementSet) -> None:

    if rows.frame != "base":
        raise ModelMismatchError(
            "the measurements are in a tracker frame; errors of regions are compared in base.",
            hint="register the tracker to the base first.",
        )


def _regions(
    request: SimilarityRequest, rows: MeasurementSet, points: Array
) -> Sequence[NamedRegion]:
    """The regions as stated, of the sets, or the measured points divided."""
    from robotrue.validation.region_similarity import divide_points, regions_of_sets

    if request.region and request.by_set:
        raise ConfigurationError(
            "--region and --by-set both set the regions.", hint="leave one of them out."
        )
    if request.by_set:
        return regions_of_sets(points, rows)
    if not request.region:
        return divide_points(points, request.divide)
    return [_stated_region(text) for text in request.region]


def _stated_region(text: str) -> NamedRegion:
    from robotrue.planning.work_area import EXAMPLE, parse_region
    from robotrue.validation.region_similarity import NamedRegion

    name, equals, limits = text.partition("=")
    if not (name and equals and "=" in limits):
        raise ConfigurationError(
            f"--region {text!r}, expected NAME=LIMITS.", hint=f"--region A={EXAMPLE}"
        )
    return NamedRegion(name=name, region=parse_region(f"--region {name}=", limits))
