"""``robotrue map``: the predicted error over a cylinder or a cube of the workspace."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.app.outputs import check_output
from robotrue.calibration.lineage import provenance_of
from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell
from robotrue.cell.config import read_cell
from robotrue.cli.console import count, emit_json, emit_table, say, say_mark
from robotrue.core.arrays import Array
from robotrue.core.csv_text import csv_text
from robotrue.core.files import read_bytes, sha256, write_atomic
from robotrue.core.provenance import Provenance, mark_line, marked
from robotrue.core.regions import CubeRegion, CylinderRegion, Region
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.planning.information import settings_of
from robotrue.report.content import Fact
from robotrue.report.map import ATTITUDES, coordinate_units, map_content, map_slices, sector_names
from robotrue.store.model_file import ZIP, read_model
from robotrue.validation.error_map import (
    Attitude,
    SectorSimilarity,
    WorkspaceMap,
    build_prior_model,
    error_map,
    sector_similarities,
)

SUFFIXES: Final = (".png", ".csv", ".html", ".htm")
DEFAULTS: Final = {"cylinder": ("angle", "radius", "height"), "cube": ("x", "y", "z")}
"""Names of the three ranges of each kind of region."""


def run(
    path: Path,
    output: Path,
    *,
    region: str,
    ranges: dict[str, str | None],
    grid: str,
    sectors: int,
    attitude: str,
    tool_abc_deg: str,
    posture_deg: str | None,
    at: str,
    as_json: bool,
) -> None:
    """Maps the error and writes a picture, a table or a page."""
    if output.suffix.lower() not in SUFFIXES:
        raise ConfigurationError(
            f"cannot tell what to write from {output.name!r}.",
            source=output,
            hint=f"-o with one of the endings {', '.join(SUFFIXES[:3])}.",
        )
    check_output(output, [path])
    where = _region(region, ranges)
    if attitude not in ATTITUDES:
        raise ConfigurationError(
            f"attitude {attitude!r}, expected {' or '.join(ATTITUDES)}.", hint="--attitude turning"
        )
    if at not in ("target", "tool"):
        raise ConfigurationError(f"--at {at!r}, expected target or tool.", hint="--at target")
    at_tool = at == "tool"
    how: Attitude = "turning" if attitude == "turning" else "fixed"
    model, cell = _model(path)
    found = error_map(
        model,
        where,
        _counts(grid),
        tool_abc=_numbers("--tool-abc-deg", tool_abc_deg, 3) * DEG,
        attitude=how,
        sectors=sectors,
        near=None if posture_deg is None else _posture(model, posture_deg),
        load=cell.payload,
        T_flange_tool=cell.robot.T_flange_tool if at_tool else None,
    )
    alike = sector_similarities(found)
    summary = model.training_summary()
    title = f"Predicted error of {model.robot.name} at {_point_word(at_tool)}"
    origin = provenance_of(model)
    say_mark(origin)
    if output.suffix.lower() == ".png":
        from robotrue.report.map_figure import slices_png

        write_atomic(output, slices_png(map_slices(found, title=marked(title, origin))))
    elif output.suffix.lower() == ".csv":
        write_atomic(output, (mark_line(origin) + _table(found)).encode())
    else:
        _write_page(output, path, model, found, alike, title)
    say(f"map written to {output}")
    for doubt in summary.warnings:
        say(f"doubt: {doubt}")
    document = _document(found, alike, model, at_tool)
    if as_json:
        emit_json({"map": str(output), **document}, origin)
    else:
        _show(found, alike, title, origin)


def _point_word(at_tool: bool) -> str:
    return "the programs' tool point" if at_tool else "the measured point"


def _model(path: Path) -> tuple[ErrorModel, Cell]:
    """The model in a file, or what is believed of a cell's arm before any measurement."""
    if read_bytes(path).startswith(ZIP):
        stored = read_model(path)
        return stored.model, stored.cell
    cell = read_cell(path)
    say("note: a cell and no model: stated stiffness and prior scales, nothing measured")
    return build_prior_model(cell.measured_robot, settings_of(cell)), cell


def _region(kind: str, ranges: dict[str, str | None]) -> Region:
    if kind not in DEFAULTS:
        raise ConfigurationError(
            f"region {kind!r}, expected {' or '.join(DEFAULTS)}.", hint="--region cylinder"
        )
    names = DEFAULTS[kind]
    found = {}
    for name, text in ranges.items():
        if name not in names and text is not None:
            raise ConfigurationError(
                f"--{_option(name)} does not belong to a {kind}.",
                hint=f"a {kind} has {', '.join('--' + _option(n) for n in names)}.",
            )
    for name in names:
        text = ranges[name]
        option = f"--{_option(name)}"
        if text is None:
            raise ConfigurationError(
                f"a {kind} needs {option} LOW,HIGH.", hint=f"{option} {_EXAMPLES[name]}"
            )
        low, high = _numbers(option, text, 2)
        size = DEG if name == "angle" else MM
        found[name] = (low * size, high * size)
    return CylinderRegion(**found) if kind == "cylinder" else CubeRegion(**found)


_EXAMPLES: Final = {
    "angle": "-40,40",
    "radius": "800,1400",
    "height": "700,1200",
    "x": "800,1400",
    "y": "-400,400",
    "z": "700,1200",
}


def _option(name: str) -> str:
    return f"{name}-deg" if name == "angle" else f"{name}-mm"


def _counts(text: str) -> tuple[int, int, int]:
    values = _numbers("--grid", text, 3)
    if (values != values.round()).any() or (values < 1).any() or values.prod() > 200_000:
        raise ConfigurationError(
            f"--grid {text!r}, expected three whole numbers of 1 or more, 200,000 points in all.",
            hint="--grid 8,7,6",
        )
    first, second, third = (int(v) for v in values)
    return first, second, third


def _posture(model: ErrorModel, text: str) -> Array:
    return _numbers("--posture-deg", text, model.robot.dof) * DEG


def _numbers(option: str, text: str, wanted: int) -> Array:
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError:
        values = np.empty(0)
    if values.size != wanted or not np.isfinite(values).all():
        raise ConfigurationError(
            f"{option} {text!r}, expected {wanted} numbers with commas between.",
            hint=f"{option} " + ",".join(["0"] * wanted),
        )
    return values


def _write_page(
    output: Path,
    path: Path,
    model: ErrorModel,
    found: WorkspaceMap,
    alike: tuple[SectorSimilarity, ...],
    title: str,
) -> None:
    from robotrue.report.page import report_html

    summary = model.training_summary()
    content = map_content(
        found,
        alike,
        title=title,
        subtitle=f"{path.name}, method {summary.method or 'unknown'}",
        simulated=provenance_of(model).simulated,
        doubts=summary.warnings,
        provenance=(Fact(name=path.name, value=f"sha256:{sha256(read_bytes(path))}"),),
    )
    write_atomic(output, report_html(content).encode())


def _table(found: WorkspaceMap) -> str:
    """One line per grid point; cells of points the arm cannot take are empty."""
    units = coordinate_units(found)
    sd = found.sd
    columns: list[tuple[str, Array]] = [
        *((f"{n}_{u}", found.coordinates[:, k] / s) for k, (n, u, s) in enumerate(units)),
        *((f"{'xyz'[k]}_base_mm", found.point[:, k] / MM) for k in range(3)),
        ("sector", found.sector.astype(np.float64) + 1.0),
        *((f"j{i + 1}_deg", found.joints[:, i] / DEG) for i in range(found.joints.shape[1])),
        *((f"error_{'xyz'[k]}_mm", found.error[:, k] / MM) for k in range(3)),
        ("error_mm", found.norm / MM),
        *((f"sd_{'xyz'[k]}_mm", sd[:, k] / MM) for k in range(3)),
        ("stays_95_mm", found.bound / MM),
    ]
    rows = np.stack([values for _, values in columns], axis=1)
    cells = [[f"{value:.6g}" if np.isfinite(value) else "" for value in row] for row in rows]
    return csv_text([[name for name, _ in columns], *cells])


def _document(
    found: WorkspaceMap,
    alike: tuple[SectorSimilarity, ...],
    model: ErrorModel,
    at_tool: bool,
) -> dict[str, Any]:
    able = found.reachable
    names = sector_names(found)
    units = coordinate_units(found)
    limits = zip(units, found.region.limits, strict=True)
    return {
        "robot": model.robot.name,
        "point": "tool" if at_tool else "target",
        "region": {f"{n}_{u}": [low / s, high / s] for (n, u, s), (low, high) in limits},
        "attitude": found.attitude,
        "grid": list(found.counts),
        "poses": len(able),
        "in_reach": int(able.sum()),
        "error_mm": _statistics(found.norm[able] / MM),
        "stays_95_mm": _statistics(found.bound[able] / MM),
        "sectors": [
            {"name": name, **_sector(found, (found.sector == k) & able)}
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


def _sector(found: WorkspaceMap, rows: Array) -> dict[str, Any]:
    if not rows.any():
        return {"in_reach": 0}
    return {
        "in_reach": int(rows.sum()),
        "error_mm": _statistics(found.norm[rows] / MM),
        "axis_mean_mm": (found.error[rows].mean(axis=0) / MM).tolist(),
        "axis_max_mm": (np.abs(found.error[rows]).max(axis=0) / MM).tolist(),
        "stays_95_mm": _statistics(found.bound[rows] / MM),
    }


def _statistics(values: Array) -> dict[str, float]:
    return {"mean": float(values.mean()), "max": float(values.max())}


def _show(
    found: WorkspaceMap, alike: tuple[SectorSimilarity, ...], title: str, origin: Provenance
) -> None:
    rows = []
    names = sector_names(found)
    for k, name in enumerate(names):
        here = (found.sector == k) & found.reachable
        if not here.any():
            rows.append((name, "0", *["-"] * 6))
            continue
        mean = found.error[here].mean(axis=0) / MM
        numbers = (found.norm[here].mean() / MM, found.norm[here].max() / MM, *mean,
                   found.bound[here].mean() / MM)  # fmt: skip
        rows.append((name, str(int(here.sum())), *(f"{v:.3f}" for v in numbers)))
    emit_table(
        f"{title}; {ATTITUDES[found.attitude]}",
        ("sector", "poses", "mean mm", "max mm", "x mm", "y mm", "z mm", "stays 95 % mm"),
        rows,
        provenance=origin,
    )
    if alike:
        emit_table(
            "similarity of the errors at corresponding points, 1 is alike",
            ("sectors", "points", "vectors", "x", "y", "z", "length"),
            [
                (
                    f"{s.first + 1} and {s.second + 1}",
                    str(s.points),
                    *(f"{v:.4f}" if np.isfinite(v) else "-" for v in (s.vector, *s.axis, s.norm)),
                )
                for s in alike
            ],
            provenance=origin,
        )
    lost = int((~found.reachable).sum())
    if lost:
        say(f"{count(lost, 'grid pose')} cannot be taken and {'is' if lost == 1 else 'are'} empty")
