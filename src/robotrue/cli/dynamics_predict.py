"""``robotrue dynamics predict``: frequency response and force record in, dynamic error out."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.app.outputs import check_output
from robotrue.cli.console import emit_facts, emit_json, say, say_mark
from robotrue.core.arrays import Array
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance, mark_line, merge
from robotrue.core.units import UM
from robotrue.dynamics.formats.column_table import table_bytes
from robotrue.dynamics.formats.registry import read_force, read_frf
from robotrue.dynamics.frf import AXES, FrequencyResponse, with_static
from robotrue.dynamics.interpolation import ResponseCurve, response_curve
from robotrue.dynamics.modal_fit import fit_modes
from robotrue.dynamics.predict import (
    DeflectionPrediction,
    out_of_band,
    predict_error,
    prediction_columns,
)
from robotrue.errors import ConfigurationError, RobotrueError

BETWEEN: Final = ("auto", "lines", "modes")


def run(
    frf_path: Path,
    force_path: Path,
    output: Path,
    *,
    static: str | None,
    between: str,
    padding: float | None,
    report: Path | None,
    as_json: bool,
) -> None:
    """Predicts, writes the error as CSV, and says how far to trust it."""
    if between not in BETWEEN:
        raise ConfigurationError(f"--between {between!r}, expected one of {', '.join(BETWEEN)}.")
    for path in (output, report):
        if path is not None:
            check_output(path, [frf_path, force_path])
    frf = with_static(read_frf(frf_path), parse_static(static))
    record, odd = read_force(force_path)
    curve = curve_of(frf, between)
    found = predict_error(curve, record, padding=padding)
    if report is not None:
        from robotrue.report.dynamics_figure import prediction_figure

        write_atomic(report, prediction_figure(curve, found, report.suffix))
    origin = merge([frf.provenance, record.provenance])
    say_mark(origin)
    table = table_bytes(*prediction_columns(found))
    write_atomic(output, mark_line(origin).encode() + table)
    remarks = (*odd, *found.remarks)
    for remark in remarks:
        say(f"note: {remark}")
    for reason in found.invalid:
        say(f"NOT VALID: {reason}")
    document = _document(curve, found, output) | {"notes": list(remarks)}
    if as_json:
        emit_json(document, origin)
    else:
        _show(document, origin)


def curve_of(frf: FrequencyResponse, between: str) -> ResponseCurve:
    """Returns the response at any frequency, by modes or by lines.

    Raises:
        RobotrueError: Modes were asked for and cannot be fitted.
    """
    if between == "lines":
        return response_curve(frf)
    try:
        modes = fit_modes(frf)
    except RobotrueError:
        if between == "modes":
            raise
        return response_curve(frf)
    curve = response_curve(frf, modes)
    if between == "modes" and curve.modes is None:
        return ResponseCurve(frf=frf, modes=modes, left_out=curve.left_out, rebuilt=curve.rebuilt)
    return curve


def parse_static(text: str | None) -> dict[str, float]:
    """Returns pair of axes to m/N from ``xx=1.1,yx=0.1`` in um/N.

    Raises:
        ConfigurationError: Not of that form.
    """
    found: dict[str, float] = {}
    for item in [] if text is None else text.split(","):
        pair, _, number = item.strip().partition("=")
        try:
            value = float(number)
        except ValueError:
            value = np.nan
        if len(pair) != 2 or not set(pair) <= set(AXES) or not np.isfinite(value) or pair in found:
            raise ConfigurationError(
                f"static deflection {item.strip()!r}, expected pair=um/N.",
                hint="--static-um-per-n xx=1.1,yy=0.9",
            )
        found[pair] = value * UM
    return found


def _document(curve: ResponseCurve, found: DeflectionPrediction, output: Path) -> dict[str, Any]:
    frf, record = curve.frf, found.record
    moving = found.error - found.static
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
        "static_known": frf.static is not None and bool(np.isfinite(frf.static[frf.present]).all()),
        "between_lines": "lines" if curve.modes is None else "modes",
        "left_out_error": curve.left_out,
        "rebuild_error": curve.rebuilt,
        "modes_Hz": None if curve.modes is None else curve.modes.frequency,
        "modes_damping": None if curve.modes is None else curve.modes.damping,
        "padding_s": found.padding,
        "rings_s": found.rings,
        "force_above_band": out_of_band(curve, record),
        "mean_force_N": record.force.mean(axis=0),
        "peak_force_N": np.abs(record.force).max(axis=0),
        "static_um": found.static / UM,
        "rms_um": _over(found.error, "rms") / UM,
        "peak_um": _over(found.error, "peak") / UM,
        "dynamic_rms_um": _over(moving, "rms") / UM,
        "dynamic_peak_um": _over(moving, "peak") / UM,
        "circular_rms_um": rms / UM,
        "circular_max_um": largest / UM,
    }


def _over(values: Array, how: str) -> Array:
    """Per axis (3,); NaN stays where an axis has no response."""
    if how == "rms":
        return np.asarray(np.sqrt((values**2).mean(axis=0)))
    return np.asarray(np.abs(values).max(axis=0))


def _show(d: dict[str, Any], origin: Provenance) -> None:
    def axes(values: Array) -> str:
        cells = zip(AXES, values, strict=True)
        return ", ".join(f"{a} {v:.3g}" if np.isfinite(v) else f"{a} -" for a, v in cells)

    between = d["between_lines"]
    if between == "modes":
        between = f"{len(d['modes_Hz'])} modes, {100.0 * d['rebuild_error']:.2g} % off the lines"
    else:
        between = f"lines, {100.0 * d['left_out_error']:.2g} % at lines left out"
    low, high = d["valid_Hz"]
    emit_facts(
        "dynamic error of the tool" + ("" if d["valid"] else ": NOT VALID"),
        [
            ("record", f"{d['samples']} samples, {d['rate_Hz']:g} Hz, {d['duration_s']:.3g} s"),
            ("response", f"{', '.join(d['pairs'])}, {low:g} to {high:g} Hz, {between}"),
            ("mean force N", axes(d["mean_force_N"])),
            ("static part um", axes(d["static_um"]) + ("" if d["static_known"] else " (a guess)")),
            ("dynamic part um, rms", axes(d["dynamic_rms_um"])),
            ("whole um, peak", axes(d["peak_um"])),
            (
                "without padding",
                f"{d['circular_rms_um']:.3g} um rms, {d['circular_max_um']:.3g} um at most off",
            ),
            ("written", d["output_csv"]),
        ],
        origin,
    )
