"""Evaluate a dry run: the measured error of a program's points, before and after compensation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.presentation import Block, Note, Table
from robotrue.app.request import InputFile, Request
from robotrue.core.provenance import Provenance, merge
from robotrue.core.units import MM

if TYPE_CHECKING:
    from robotrue.core.arrays import Array, IntArray
    from robotrue.measurement.formats.sheet import Sheet
    from robotrue.validation.dry_run_points import AxisErrors

NAMES: Final = ("x", "y", "z", "length")


class DryRunRequest(Request):
    """Which points were planned, and what was measured there."""

    sheet: Annotated[
        Path, InputFile(argument="SHEET", help="Points (CSV) that `dry-run-plan` wrote.")
    ]
    before: Annotated[
        Path,
        InputFile(
            argument="BEFORE",
            help="Measured with the program as CAM made it: point, x_mm, y_mm, z_mm in base.",
        ),
    ]
    after: Annotated[
        Path | None,
        InputFile(argument="[AFTER]", help="The same with the compensated program."),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class DryRunResult:
    """Errors of a dry run.

    Attributes:
        runs: Statistics by name, before and perhaps after.
        missing: Planned points that were not measured, by run.
        planned: Points of the sheet.
        provenance: Of sheet and measurements.
    """

    runs: Mapping[str, AxisErrors]
    missing: Mapping[str, tuple[str, ...]]
    planned: int
    provenance: Provenance

    def document(self) -> Mapping[str, object]:
        """Returns JSON values in mm."""
        import math

        return {
            name: {
                "points": errors.count,
                "not_measured": list(self.missing[name]),
                **{
                    f"{axis}_mm": {
                        "mean": float(errors.mean[k] / MM),
                        "max": float(errors.largest[k] / MM),
                        "sd": float(errors.deviation[k] / MM),
                    }
                    for k, axis in enumerate(NAMES)
                },
                "bias_mm": (errors.bias / MM).tolist(),
                "in_band_95": None if math.isnan(errors.inside) else errors.inside,
            }
            for name, errors in self.runs.items()
        }

    def blocks(self) -> Iterable[Block]:
        """Returns the layout of Table 9, and each axis."""
        yield Table(
            title=f"Dry run, {self.planned} points: length of the error, mm",
            columns=("", "points", "mean", "max", "sd"),
            rows=tuple(
                (
                    name,
                    str(e.count),
                    *(f"{v[3] / MM:.3f}" for v in (e.mean, e.largest, e.deviation)),
                )
                for name, e in self.runs.items()
            ),
        )
        yield Table(
            title="Each axis of base, mm: size of the error, and its mean with sign",
            columns=("", "axis", "mean", "max", "sd", "mean with sign"),
            rows=tuple(
                (
                    name,
                    NAMES[k],
                    *(f"{v[k] / MM:.3f}" for v in e.sizes),
                    f"{e.bias[k] / MM:+.3f}",
                )
                for name, e in self.runs.items()
                for k in range(3)
            ),
        )
        for name, e in self.runs.items():
            if e.inside == e.inside:
                yield Note(
                    f"{name}: {100.0 * e.inside:.0f} % of the points lie in the model's 95 % band "
                    "in x, y and z (86 % are expected of three independent axes)"
                )
            if self.missing[name]:
                yield Note(f"{name}: not measured: {', '.join(self.missing[name])}")


def run(request: DryRunRequest, context: Context) -> DryRunResult:
    """Evaluates what was measured at the points of a dry run.

    Raises:
        FormatError: A column that is missing or no number; with file and line.
        ConfigurationError: A point that was not planned or measured twice.
        ImplausibleDataError: A point far from its target.
    """
    from robotrue.measurement.formats.sheet_file import read_sheet
    from robotrue.validation.dry_run_points import match_points, summarise_errors

    sheet = read_sheet(request.sheet)
    names = sheet.words("point")
    wanted = sheet.numbers(("x_mm", "y_mm", "z_mm")) * MM
    runs, missing, origins = {}, {}, [sheet.provenance]
    for name, path in (("before", request.before), ("after", request.after)):
        if path is None:
            continue
        measured = read_sheet(path)
        place = measured.numbers(("x_mm", "y_mm", "z_mm")) * MM
        found = measured.words("point")
        rows, error = match_points(names, wanted, found, place, measured.lines, measured.source)
        predicted, sigma = _band(sheet, name, rows)
        runs[name] = summarise_errors(error, predicted, sigma)
        missing[name] = tuple(each for each in names if each not in set(found))
        origins.append(measured.provenance)
    return DryRunResult(runs=runs, missing=missing, planned=len(names), provenance=merge(origins))


def _band(sheet: Sheet, run_name: str, rows: IntArray) -> tuple[Array, Array]:
    """Predicted errors of some points and their deviation, (m, 3) m; NaN where not predicted."""
    import numpy as np

    predicted = tuple(f"predicted_{run_name}_{n}_mm" for n in "xyz")
    sigma = tuple(f"sigma_{n}_mm" for n in "xyz")
    if not all(sheet.has(name) for name in (*predicted, *sigma)):
        return np.empty((0, 3)), np.empty((0, 3))
    error, deviation = (
        np.column_stack([sheet.parse(name) for name in names])[rows] * MM
        for names in (predicted, sigma)
    )
    return error, deviation


OPERATION: Final = Operation(request=DryRunRequest, run=run)
