"""Map the predicted error and its 95 % bound over a region, and compare its sectors."""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Note, PlainResult, Table, count
from robotrue.app.request import Item, Output, Reference, Request
from robotrue.app.request_fields import AT_TARGET, OUTPUT
from robotrue.core.files import read_bytes, sha256
from robotrue.core.provenance import mark_line, mark_title
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.planning.plan_defaults import TOOL_ABC_DEG
from robotrue.validation.validation_defaults import MAP_ATTITUDE, MAP_SECTORS

if TYPE_CHECKING:
    from robotrue.calibration.model import ErrorModel
    from robotrue.cell.cell import Cell
    from robotrue.validation.error_map import SectorSimilarity, WorkspaceMap

SUFFIXES: Final = (".png", ".csv", ".html", ".htm")


class MapRequest(Request):
    """Model, quantity and region of the map."""

    model: Annotated[Reference, Item(noun="model", also=("cell",), argument="MODEL|CELL")]
    """Model file; a cell.toml maps its priors."""
    output: Annotated[Path, Output(names=OUTPUT)]
    """Picture (.png), table (.csv) or page (.html)."""
    region: Literal["cylinder", "cube"] = "cylinder"
    """cylinder (about joint 1) or cube."""
    angle_deg: str | None = None
    """LOW,HIGH of a cylinder."""
    radius_mm: str | None = None
    """LOW,HIGH of a cylinder."""
    height_mm: str | None = None
    """LOW,HIGH of a cylinder."""
    x_mm: str | None = None
    """LOW,HIGH of a cube."""
    y_mm: str | None = None
    """LOW,HIGH of a cube."""
    z_mm: str | None = None
    """LOW,HIGH of a cube."""
    grid: str = "8,8,8"
    """Grid values along each coordinate."""
    sectors: int = MAP_SECTORS
    """Parts compared, along the angle or along y."""
    attitude: Literal["turning", "fixed"] = MAP_ATTITUDE
    """turning (with the angle about joint 1) or fixed (in base)."""
    tool_abc_deg: str = TOOL_ABC_DEG
    """KUKA A,B,C of the point in base; for turning at angle 0."""
    posture_deg: str | None = None
    """Axes as displayed, of the arm configuration; default: as trained."""
    at: Literal["target", "tool"] = AT_TARGET
    """target (the measured point) or tool."""


def _blocks(
    mapped: WorkspaceMap, alike: tuple[SectorSimilarity, ...], title: str
) -> Iterable[Block]:
    """The sectors, and how alike they are."""
    from robotrue.report.map_report import ATTITUDES

    yield Table(
        title=f"{title}; {ATTITUDES[mapped.attitude]}",
        columns=(
            "sector", "poses", "mean mm", "max mm", "x mm", "y mm", "z mm", "residual 95 % mm",
        ),
        rows=tuple(_sector_rows(mapped)),
    )  # fmt: skip
    if alike:
        yield Table(
            title="similarity of the errors at corresponding points, 1 is equal",
            columns=("sectors", "points", "vectors", "x", "y", "z", "length"),
            rows=tuple(
                (
                    f"{s.first + 1} and {s.second + 1}",
                    str(s.points),
                    *(f"{v:.4f}" if isfinite(v) else "-" for v in (s.vector, *s.axis, s.norm)),
                )
                for s in alike
            ),
        )
    lost = int((~mapped.reachable).sum())
    if lost:
        verb = "is" if lost == 1 else "are"
        yield Note(f"{count(lost, 'grid pose')} {verb} out of reach and left empty")


def _sector_rows(error_map: WorkspaceMap) -> Iterable[tuple[str, ...]]:
    from robotrue.report.map_report import sector_names

    for k, name in enumerate(sector_names(error_map)):
        here = (error_map.sector == k) & error_map.reachable
        if not here.any():
            yield (name, "0", *["-"] * 6)
            continue
        mean = error_map.error[here].mean(axis=0) / MM
        length, bound = error_map.norm[here] / MM, error_map.bound[here] / MM
        numbers = (length.mean(), length.max(), *mean, bound.mean())
        yield (name, str(int(here.sum())), *(f"{value:.3f}" for value in numbers))


@operation()
def run(request: MapRequest, context: Context) -> PlainResult:
    """Maps the error and writes a picture, a table or a page.

    Raises:
        ConfigurationError: Ranges that are missing or no ranges, or another ending of the output.
    """
    from robotrue.app.number_options import (
        parse_grid,
        parse_map_region,
        parse_numbers,
        parse_posture,
    )
    from robotrue.calibration.model import provenance_of
    from robotrue.report.map_report import map_document
    from robotrue.validation.error_map import error_map, sector_similarities

    path = context.model_file(request.model)
    output = request.output
    if output.suffix.lower() not in SUFFIXES:
        raise ConfigurationError(
            f"the suffix of {output.name!r} does not state the format.",
            source=output,
            hint=f"-o with one of the endings {', '.join(SUFFIXES[:3])}.",
        )
    ranges = {
        name.rpartition("_")[0]: getattr(request, name)
        for name in ("angle_deg", "radius_mm", "height_mm", "x_mm", "y_mm", "z_mm")
    }
    where, at_tool = parse_map_region(request.region, ranges), request.at == "tool"
    model, cell = _model(path, context)
    mapped = error_map(
        model,
        where,
        parse_grid(request.grid),
        tool_abc=parse_numbers("--tool-abc-deg", request.tool_abc_deg, 3) * DEG,
        attitude=request.attitude,
        sectors=request.sectors,
        near=parse_posture(request.posture_deg, model.robot),
        load=cell.payload,
        T_flange_tool=cell.robot.T_flange_tool if at_tool else None,
    )
    point = "the programs' tool point" if at_tool else "the measured point"
    title, alike = f"Predicted error of {model.robot.name} at {point}", sector_similarities(mapped)
    picture = _picture(mapped, alike, model, title, output.suffix.lower(), path)
    output = context.write(output, picture, "map")
    for warning in model.training_summary().warnings:
        context.inform(f"warning: {warning}")
    numbers = map_document(mapped, alike)
    return PlainResult(
        values={"map": str(output), "robot": model.robot.name, "point": request.at, **numbers},
        shown=tuple(_blocks(mapped, alike, title)),
        provenance=provenance_of(model),
    )


def _model(path: Path, context: Context) -> tuple[ErrorModel, Cell]:
    """The model in a file, or what is assumed of a cell's arm before any measurement."""
    from robotrue.app.registered import read_model_or_cell
    from robotrue.planning.information import settings_of
    from robotrue.validation.error_map import build_prior_model

    cell, model = read_model_or_cell(path)
    if model is not None:
        return model, cell
    context.note("a cell and no model: stated stiffness and prior scales, no measurements")
    return build_prior_model(cell.measured_robot, settings_of(cell)), cell


def _picture(
    mapped: WorkspaceMap,
    alike: tuple[SectorSimilarity, ...],
    model: ErrorModel,
    title: str,
    suffix: str,
    path: Path,
) -> bytes:
    """The picture, the table or the page; ``path`` is the file of the model."""
    from robotrue.calibration.model import provenance_of
    from robotrue.report.content import Fact
    from robotrue.report.map_report import map_content, map_slices, map_table
    from robotrue.report.page import report_html

    origin = provenance_of(model)
    if suffix == ".png":
        return map_slices(mapped, title=mark_title(title, origin)).png()
    if suffix == ".csv":
        return (mark_line(origin) + map_table(mapped, model.robot.controller)).encode()
    summary = model.training_summary()
    content = map_content(
        mapped,
        alike,
        title=title,
        subtitle=f"{path.name}, method {summary.method or 'unknown'}",
        simulated=origin.simulated,
        doubts=summary.warnings,
        provenance=(Fact(name=path.name, value=f"sha256:{sha256(read_bytes(path))}"),),
    )
    return report_html(content).encode()
