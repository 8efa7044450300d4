"""Predict the deflection of the tool along a force record."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Facts, PlainResult
from robotrue.app.request import InputFile, Output, Request
from robotrue.app.request_fields import BETWEEN, WAYS_BETWEEN, Between, StaticTest, table_output
from robotrue.core.provenance import mark_line, merge
from robotrue.core.units import UM
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.app.learned_along import LearnedAlong
    from robotrue.core.arrays import Array
    from robotrue.dynamics.force import ForceRecord
    from robotrue.dynamics.interpolation import ResponseCurve
    from robotrue.dynamics.predict import DeflectionPrediction


class DynamicsPredictRequest(Request):
    """Response and force, and the interpolation between lines."""

    frf: Annotated[Path, InputFile()]
    """Frequency response of the tool: CSV, UFF58 (.uff, .unv) or MAT."""
    force: Annotated[Path, InputFile()]
    """Recorded force on the tool: CSV, TDMS, MAT, UFF."""
    output: Annotated[Path, table_output()]
    """CSV of the error to write."""
    static_um_per_n: StaticTest = None
    between: Between = BETWEEN
    padding_s: float | None = None
    """Zero padding after the record; default: twice the ringing time."""
    deviation: Annotated[Path | None, InputFile()] = None
    """Model of `dynamics fit`: add the learned deviation, window by window."""
    joints: Annotated[Path | None, InputFile()] = None
    """For --deviation, the joints: t_s and j1_deg.. (model) or a1_deg.. (displayed)."""
    spindle_rpm: float | None = None
    """Spindle speed, for --deviation."""
    report: Annotated[Path | None, Output()] = None
    """Also write a plot of force, error and response (PNG, SVG or PDF)."""


@operation()
def run(request: DynamicsPredictRequest, context: Context) -> PlainResult:
    """Predicts the error, writes it as CSV, and reports its uncertainty."""
    from robotrue.app.dynamics_inputs import parse_static
    from robotrue.dynamics.formats.column_table import table_bytes
    from robotrue.dynamics.formats.frf_table import read_frf
    from robotrue.dynamics.formats.signal_table import read_force
    from robotrue.dynamics.frf import with_static
    from robotrue.dynamics.interpolation import fit_curve
    from robotrue.dynamics.predict import predict_error, prediction_columns

    between = request.between
    if between not in WAYS_BETWEEN:
        raise ConfigurationError(
            f"--between {between!r}, expected one of {', '.join(WAYS_BETWEEN)}."
        )
    frf = with_static(read_frf(request.frf), parse_static(request.static_um_per_n))
    record, odd = read_force(request.force)
    curve = fit_curve(frf, between)
    found = predict_error(curve, record, padding=request.padding_s)
    if request.report is not None:
        from robotrue.report.dynamics_figure import prediction_figure

        context.write(request.report, prediction_figure(curve, found, request.report.suffix))
    names, columns = prediction_columns(found)
    learned, origins = None, [frf.provenance, record.provenance]
    if request.deviation is not None:
        learned = _learn(request, curve, record)
        names, columns = [*names, "e_um", "sd_um"], learned.beside(columns)
        origins.append(learned.provenance)
    elif request.joints is not None or request.spindle_rpm is not None:
        raise ConfigurationError("--joints and --spindle-rpm go with --deviation.")
    origin = merge(origins)
    table = mark_line(origin).encode() + table_bytes(names, columns)
    output = context.write(request.output, table)
    remarks = (*odd, *found.remarks)
    for remark in remarks:
        context.note(remark)
    for reason in found.invalid:
        context.inform(f"NOT VALID: {reason}")
    by_axis = _axis_figures(found)
    values = {**_document(curve, found, output, by_axis), "notes": list(remarks)}
    shown = [_facts(curve, found, output, by_axis)]
    if learned is not None:
        values |= {"learned": learned.document()}
        shown.append(learned.facts())
    return PlainResult(values=values, shown=tuple(shown), provenance=origin)


def _learn(
    request: DynamicsPredictRequest, curve: ResponseCurve, record: ForceRecord
) -> LearnedAlong:
    """Predicts the learned deviation in the windows of a record."""
    from robotrue.app.learned_along import learned_along
    from robotrue.dynamics.deviation_file import read_learned_deviation

    if request.deviation is None or request.joints is None or request.spindle_rpm is None:
        raise ConfigurationError(
            "--deviation needs the joints of the record and the speed of the spindle.",
            hint="--joints FILE --spindle-rpm N",
        )
    model = read_learned_deviation(request.deviation)
    return learned_along(model, curve, record, request.joints, request.spindle_rpm / 60.0)


def _axis_figures(found: DeflectionPrediction) -> dict[str, Array]:
    """Force and error along x, y and z, (3,) each, by their JSON names."""
    import numpy as np

    force, moving = found.record.force, found.error - found.static
    return {
        "mean_force_N": force.mean(axis=0),
        "peak_force_N": np.abs(force).max(axis=0),
        "static_um": found.static / UM,
        "rms_um": _over(found.error, "rms") / UM,
        "peak_um": _over(found.error, "peak") / UM,
        "dynamic_rms_um": _over(moving, "rms") / UM,
        "dynamic_peak_um": _over(moving, "peak") / UM,
    }


def _static_known(curve: ResponseCurve) -> bool:
    import numpy as np

    frf = curve.frf
    return frf.static is not None and bool(np.isfinite(frf.static[frf.present]).all())


def _document(
    curve: ResponseCurve, found: DeflectionPrediction, output: Path, by_axis: Mapping[str, Array]
) -> dict[str, object]:
    from robotrue.dynamics.predict import out_of_band

    frf, record = curve.frf, found.record
    rms, largest = found.circular_error
    return {
        "output_csv": str(output),
        "valid": not found.invalid,
        "invalid": list(found.invalid),
        "samples": len(record),
        "rate_Hz": record.rate,
        "duration_s": len(record) / record.rate,
        "pairs": list(frf.pairs),
        "valid_Hz": list(frf.valid),
        "measured_as": frf.measured_as,
        "static_known": _static_known(curve),
        "between_lines": "lines" if curve.modes is None else "modes",
        "left_out_error": curve.left_out,
        "rebuild_error": curve.rebuilt,
        "modes_Hz": None if curve.modes is None else curve.modes.frequency,
        "modes_damping": None if curve.modes is None else curve.modes.damping,
        "padding_s": found.padding,
        "rings_s": found.rings,
        "force_above_band": out_of_band(curve, record),
        **by_axis,
        "circular_rms_um": rms / UM,
        "circular_max_um": largest / UM,
    }


def _over(values: Array, how: str) -> Array:
    """Per axis (3,); NaN stays where an axis has no response."""
    import numpy as np

    if how == "rms":
        return np.asarray(np.sqrt((values**2).mean(axis=0)))
    return np.asarray(np.abs(values).max(axis=0))


def _facts(
    curve: ResponseCurve, found: DeflectionPrediction, output: Path, by_axis: Mapping[str, Array]
) -> Facts:
    from robotrue.dynamics.interpolation import describe_rebuild_error

    between = f"lines, {100.0 * curve.left_out:.2g} % at lines left out"
    if curve.modes is not None and curve.rebuilt is not None:
        between = f"{len(curve.modes.frequency)} modes, {describe_rebuild_error(curve.rebuilt)}"
    record, (low, high) = found.record, curve.frf.valid
    rms, largest = (value / UM for value in found.circular_error)
    guess = "" if _static_known(curve) else " (a guess)"
    return Facts(
        title="dynamic error of the tool" + (": NOT VALID" if found.invalid else ""),
        rows=(
            (
                "record",
                f"{len(record)} samples, {record.rate:g} Hz, {len(record) / record.rate:.3g} s",
            ),
            ("response", f"{', '.join(curve.frf.pairs)}, {low:g} to {high:g} Hz, {between}"),
            ("mean force N", _by_axis(by_axis["mean_force_N"])),
            ("static part um", _by_axis(by_axis["static_um"]) + guess),
            ("dynamic part um, rms", _by_axis(by_axis["dynamic_rms_um"])),
            ("whole um, peak", _by_axis(by_axis["peak_um"])),
            ("without padding", f"{rms:.3g} um rms, {largest:.3g} um at most off"),
            ("written", str(output)),
        ),
    )


def _by_axis(values: Array) -> str:
    """Returns the values of x, y and z; a dash where an axis has no response."""
    cells = zip("xyz", values, strict=True)
    return ", ".join(f"{a} {v:.3g}" if isfinite(v) else f"{a} -" for a, v in cells)
