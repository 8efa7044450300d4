"""Compute a frequency response from hammer hits, or check one; fit its modes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Facts, PlainResult, Table, count
from robotrue.app.request import InputFile, Output, Request
from robotrue.app.request_fields import OUTPUT, StaticTest
from robotrue.core.units import UM
from robotrue.errors import ConfigurationError, ObservabilityError

if TYPE_CHECKING:
    from robotrue.dynamics.frf import FrequencyResponse
    from robotrue.dynamics.hammer import HammerResult
    from robotrue.dynamics.modal import ModalModel


class DynamicsFrfRequest(Request):
    """Hammer records or a measured response, and the outputs."""

    files: Annotated[tuple[Path, ...], InputFile(argument="FILE...")]
    """Hammer records (CSV), one per axis hit, or one response."""
    output: Annotated[Path | None, Output(names=OUTPUT)] = None
    """Receptance to write: .csv or .uff."""
    modes: Annotated[Path | None, Output(what="a robotrue file", suffixes=(".robotrue",))] = None
    """Also write the fitted modes."""
    duration_s: float | None = None
    """Length of a segment; default: up to the next hit."""
    window: float | None = None
    """Where the exponential window ends, 0..1; default: none if it decays."""
    static_um_per_n: StaticTest = None
    report: Annotated[Path | None, Output()] = None
    """Also write a plot of magnitude, phase, coherence (PNG, SVG or PDF)."""


@operation()
def run(request: DynamicsFrfRequest, context: Context) -> PlainResult:
    """Evaluates the records, checks the response, fits modes, and writes the requested files.

    Raises:
        ConfigurationError: An output that is neither .csv nor .uff.
        ObservabilityError: Modes are to be written and there are none.
    """
    from robotrue.app.dynamics_inputs import parse_static
    from robotrue.dynamics.frf import with_static
    from robotrue.dynamics.frf_checks import response_remarks
    from robotrue.dynamics.interpolation import rebuild_error

    output = request.output
    if output is not None and output.suffix.lower() not in (".csv", ".uff"):
        raise ConfigurationError(
            f"output of suffix {output.suffix!r}, expected .csv or .uff.", source=output
        )
    frf, tests = _read(request)
    frf = with_static(frf, parse_static(request.static_um_per_n))
    frf, fitted, remarks = _with_modes(frf, max((t.added_damping for t in tests), default=0.0))
    _write(request, frf, fitted, remarks, context)
    remarks = (*(_tell_left_out(t) for t in tests if t.left_out), *response_remarks(frf), *remarks)
    for remark in remarks:
        context.note(remark)
    error = None if fitted is None else rebuild_error(frf, fitted)
    values = {**_document(frf, fitted, tests, error), "notes": list(remarks)}
    shown = tuple(_blocks(frf, fitted, tests, error))
    return PlainResult(values=values, shown=shown, provenance=frf.provenance)


def _read(request: DynamicsFrfRequest) -> tuple[FrequencyResponse, Sequence[HammerResult]]:
    """The response in a file, or that of hammer records with their evaluations."""
    from robotrue.dynamics.formats.dynamics_csv import read_hammer_csv
    from robotrue.dynamics.formats.frf_table import read_frf
    from robotrue.dynamics.hammer import combine_axes, evaluate_together

    if len(request.files) == 1 and not _is_hammer(request.files[0]):
        return read_frf(request.files[0]), []
    records = [read_hammer_csv(path) for path in request.files]
    tests = evaluate_together(records, duration=request.duration_s, window=request.window)
    return combine_axes(tests), tests


def _is_hammer(path: Path) -> bool:
    """A table of times is a record, one of frequencies a response."""
    from robotrue.dynamics.formats.column_table import read_column_table

    if path.suffix.lower() not in (".csv", ".txt"):
        return False
    return "t_s" in read_column_table(path).names


def _with_modes(
    frf: FrequencyResponse, added_damping: float
) -> tuple[FrequencyResponse, ModalModel | None, tuple[str, ...]]:
    """The response and its modes; under an exponential window the response is that of the modes."""
    from robotrue.dynamics.hammer import without_window
    from robotrue.dynamics.modal_fit import fit_modes

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
        "that of the modes with this subtracted"
    )
    return replace(frf, response=rebuilt), fitted, (remark,)


def _tell_left_out(test: HammerResult) -> str:
    said = ", ".join(f"{why} at {at / test.record.rate:.3f} s" for at, why in test.left_out)
    return f"{test.record.source}: left out: {said}"


def _write(
    request: DynamicsFrfRequest,
    frf: FrequencyResponse,
    fitted: ModalModel | None,
    remarks: Sequence[str],
    context: Context,
) -> None:
    """Writes the requested ones of figure, modes and receptance."""
    from robotrue.core.archive import write_archive
    from robotrue.dynamics.formats.frf_table import write_frf_csv
    from robotrue.dynamics.frf import trusted_lines
    from robotrue.dynamics.interpolation import response_curve

    if request.report is not None:
        from robotrue.report.dynamics_figure import response_figure

        drawn = response_figure(frf, request.report.suffix, response_curve(frf, fitted))
        context.write(request.report, drawn)
    if request.modes is not None:
        if fitted is None:
            raise ObservabilityError("no modes to write.", source=request.modes, hint=remarks[-1])
        write_archive(context.output(request.modes), fitted.to_archive())
    if request.output is None:
        return
    output = context.output(request.output)
    if output.suffix.lower() == ".uff":
        from robotrue.dynamics.formats.uff import write_uff

        write_uff(output, trusted_lines(frf))
    else:
        write_frf_csv(output, trusted_lines(frf))
    context.wrote("receptance", output)


def _document(
    frf: FrequencyResponse,
    fitted: ModalModel | None,
    tests: Sequence[HammerResult],
    error: float | None,
) -> dict[str, object]:
    from robotrue.dynamics.frf_checks import reciprocity

    return {
        "pairs": list(frf.pairs),
        "lines": len(frf.frequency),
        "spacing_Hz": _line_spacing(frf),
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
            "rebuild_error": error,
            "static_um_per_N": None if fitted.lower.any() else fitted.modal_static / UM,
        },
    }


def _line_spacing(frf: FrequencyResponse) -> float:
    """Smallest distance of two lines, Hz."""
    import numpy as np

    return float(np.diff(frf.frequency).min())


def _blocks(
    frf: FrequencyResponse,
    fitted: ModalModel | None,
    tests: Sequence[HammerResult],
    error: float | None,
) -> Iterable[Block]:
    from robotrue.dynamics.frf_checks import reciprocity
    from robotrue.dynamics.interpolation import describe_rebuild_error

    low, high = frf.valid
    yield Facts(
        title="frequency response of the tool",
        rows=(
            ("pairs", ", ".join(frf.pairs)),
            ("lines", f"{len(frf.frequency)}, {_line_spacing(frf):.4g} Hz apart"),
            ("to be trusted", f"{low:g} to {high:g} Hz"),
            ("measured as", frf.measured_as),
            *(
                (
                    f"{t.record.excitation_axis} axis",
                    f"{count(len(t.hits), 'hit')} used, {len(t.left_out)} not",
                )
                for t in tests
            ),
            *(
                (f"{pair} against {pair[::-1]}", f"{100.0 * value:.2g} %")
                for pair, value in reciprocity(frf).items()
            ),
        ),
    )
    if fitted is None or error is None:
        return
    modes = enumerate(zip(fitted.frequency, fitted.damping, strict=True))
    yield Table(
        title=f"modes, {describe_rebuild_error(error)}",
        columns=("Hz", "damping %", *(f"{a}{a} um/N" for a in frf.response_axes)),
        rows=tuple(
            (f"{f:.5g}", f"{100.0 * z:.3g}", *(f"{abs(v):.3g}" for v in _weights(fitted, k)))
            for k, (f, z) in modes
        ),
    )


def _weights(fitted: ModalModel, k: int) -> list[complex]:
    """Static share of a mode in each direct pair, um/N."""
    out: list[complex] = []
    for axis in fitted.response_axes:
        if axis not in fitted.excitation_axes:
            out.append(complex(nan))
            continue
        i, j = fitted.response_axes.index(axis), fitted.excitation_axes.index(axis)
        share = -2.0 * (fitted.residues[k, i, j] / fitted.poles[k]).real
        out.append(complex(share / UM))
    return out
