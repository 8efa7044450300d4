"""``robotrue dynamics frf``: hammer records or a response in, checked receptance and modes out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from robotrue.app.outputs import check_output
from robotrue.cli.console import count, emit_facts, emit_json, emit_table, say, say_mark
from robotrue.cli.dynamics_predict import parse_static
from robotrue.core.archive import write_archive
from robotrue.core.files import write_atomic
from robotrue.core.units import UM
from robotrue.dynamics.checks import reciprocity, response_remarks
from robotrue.dynamics.formats.column_table import read_column_table
from robotrue.dynamics.formats.frf_csv import write_frf_csv
from robotrue.dynamics.formats.hammer_csv import read_hammer_csv
from robotrue.dynamics.formats.registry import read_frf
from robotrue.dynamics.frf import FrequencyResponse, trusted_lines, with_static
from robotrue.dynamics.hammer import HammerResult, combine_axes, evaluate_together, without_window
from robotrue.dynamics.interpolation import rebuild_error, response_curve
from robotrue.dynamics.modal import ModalModel
from robotrue.dynamics.modal_fit import fit_modes
from robotrue.errors import ConfigurationError, ObservabilityError


def run(
    files: Sequence[Path],
    output: Path | None,
    *,
    modes_path: Path | None,
    duration: float | None,
    window: float | None,
    static: str | None,
    report: Path | None,
    as_json: bool,
) -> None:
    """Evaluates, checks, fits; writes what was asked for."""
    for path in (output, modes_path, report):
        if path is not None:
            check_output(path, files)
    if output is not None and output.suffix.lower() not in (".csv", ".uff"):
        raise ConfigurationError(
            f"output of suffix {output.suffix!r}, expected .csv or .uff.", source=output
        )
    tests: list[HammerResult] = []
    if len(files) == 1 and not _is_hammer(files[0]):
        frf = read_frf(files[0])
    else:
        records = [read_hammer_csv(path) for path in files]
        tests = evaluate_together(records, duration=duration, window=window)
        frf = combine_axes(tests)
    frf = with_static(frf, parse_static(static))
    frf, fitted, remarks = _with_modes(frf, max((t.added_damping for t in tests), default=0.0))
    if report is not None:
        from robotrue.report.dynamics_figure import response_figure

        curve = response_curve(frf, fitted)
        write_atomic(report, response_figure(frf, report.suffix, curve))
    if modes_path is not None:
        if fitted is None:
            raise ObservabilityError("no modes to write.", source=modes_path, hint=remarks[-1])
        write_archive(modes_path, fitted.to_archive())
    if output is not None:
        _write(output, trusted_lines(frf))
    remarks = (*(_left_out(t) for t in tests if t.left_out), *response_remarks(frf), *remarks)
    for remark in remarks:
        say(f"note: {remark}")
    say_mark(frf.provenance)
    document = _document(frf, fitted, tests) | {"notes": list(remarks)}
    if as_json:
        emit_json(document, frf.provenance)
    else:
        _show(frf, fitted, document)


def _is_hammer(path: Path) -> bool:
    """A table of times is a record, one of frequencies a response."""
    if path.suffix.lower() not in (".csv", ".txt"):
        return False
    return "t_s" in read_column_table(path).names


def _with_modes(
    frf: FrequencyResponse, added_damping: float
) -> tuple[FrequencyResponse, ModalModel | None, tuple[str, ...]]:
    """The response and its modes; under an exponential window the response is that of the modes."""
    try:
        fitted = fit_modes(frf)
    except ObservabilityError as cause:
        if added_damping > 0.0:
            raise
        return frf, None, (f"no modes: {cause.message}",)
    if added_damping == 0.0:
        return frf, fitted, ()
    fitted = without_window(fitted, added_damping)
    rebuilt = fitted.response(frf.frequency)
    rebuilt[:, ~frf.present] = 0.0
    remark = (
        f"the exponential window added {added_damping:.3g} 1/s to every decay; the response is "
        "that of the modes with it taken off"
    )
    return replace(frf, response=rebuilt), fitted, (remark,)


def _left_out(test: HammerResult) -> str:
    said = ", ".join(f"{why} at {at / test.record.rate:.3f} s" for at, why in test.left_out)
    return f"{test.record.source}: left out: {said}"


def _write(output: Path, frf: FrequencyResponse) -> None:
    if output.suffix.lower() == ".uff":
        from robotrue.dynamics.formats.uff import write_uff

        write_uff(output, frf)
    else:
        write_frf_csv(output, frf)
    say(f"receptance written to {output}")


def _document(
    frf: FrequencyResponse, fitted: ModalModel | None, tests: Sequence[HammerResult]
) -> dict[str, Any]:
    return {
        "pairs": list(frf.pairs),
        "lines": len(frf.frequency),
        "spacing_Hz": float(np.diff(frf.frequency).min()),
        "valid_Hz": list(frf.valid),
        "measured_as": frf.measured_as,
        "static_um_per_N": None if frf.static is None else frf.static / UM,
        "reciprocity": reciprocity(frf),
        "hits": [
            {
                "file": t.record.source,
                "axis": t.record.excitation_axis,
                "used": len(t.hits),
                "left_out": [why for _, why in t.left_out],
                "added_damping_1_per_s": t.added_damping,
            }
            for t in tests
        ],
        "modes": None
        if fitted is None
        else {
            "frequency_Hz": fitted.frequency,
            "damping": fitted.damping,
            "rebuild_error": rebuild_error(frf, fitted),
            "static_um_per_N": None if fitted.lower.any() else fitted.modal_static / UM,
        },
    }


def _show(frf: FrequencyResponse, fitted: ModalModel | None, d: dict[str, Any]) -> None:
    low, high = d["valid_Hz"]
    facts = [
        ("pairs", ", ".join(d["pairs"])),
        ("lines", f"{d['lines']}, {d['spacing_Hz']:.4g} Hz apart"),
        ("to be trusted", f"{low:g} to {high:g} Hz"),
        ("measured as", d["measured_as"]),
    ]
    facts += [
        (f"{hit['axis']} axis", f"{count(hit['used'], 'hit')} used, {len(hit['left_out'])} not")
        for hit in d["hits"]
    ]
    facts += [
        (f"{pair} against {pair[::-1]}", f"{100.0 * value:.2g} %")
        for pair, value in d["reciprocity"].items()
    ]
    emit_facts("frequency response of the tool", facts, frf.provenance)
    if fitted is None:
        return
    rows = [
        (
            f"{f:.5g}",
            f"{100.0 * z:.3g}",
            *(f"{abs(v):.3g}" for v in _weights(fitted, k)),
        )
        for k, (f, z) in enumerate(zip(fitted.frequency, fitted.damping, strict=True))
    ]
    emit_table(
        f"modes, {100.0 * d['modes']['rebuild_error']:.2g} % off the lines",
        ("Hz", "damping %", *(f"{a}{a} um/N" for a in frf.response_axes)),
        rows,
        provenance=frf.provenance,
    )


def _weights(fitted: ModalModel, k: int) -> list[complex]:
    """Static share of a mode in each direct pair, um/N."""
    out = []
    for axis in fitted.response_axes:
        if axis not in fitted.excitation_axes:
            out.append(complex(np.nan))
            continue
        i, j = fitted.response_axes.index(axis), fitted.excitation_axes.index(axis)
        share = -2.0 * (fitted.residues[k, i, j] / fitted.poles[k]).real
        out.append(complex(share / UM))
    return out
