"""Predict the milling force, or identify its coefficients from slotting tests."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.outputs import require_suffix
from robotrue.app.presentation import Facts, PlainResult, Table
from robotrue.app.request import InputFile, Output, Request
from robotrue.app.request_fields import OUTPUT
from robotrue.core.files import read_toml
from robotrue.core.provenance import mark_line, read_provenance
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.core.arrays import Array
    from robotrue.dynamics.coefficients import IdentifiedCoefficients
    from robotrue.dynamics.cutter import CutterEngagement, CuttingCoefficients, EndMill
    from robotrue.dynamics.force import ForceRecord

EXAMPLE: Final = "docs/howto/predict-the-dynamic-error.md"
SHOWN: Final = 8
"""Largest number of reported spindle lines."""


class DynamicsForceRequest(Request):
    """Cutting conditions, and the outputs."""

    cut: Annotated[Path, InputFile(argument="CUT")]
    """Cutter, cut and material (TOML)."""
    output: Annotated[
        Path | None, Output(names=OUTPUT, what="a force table", suffixes=(".csv", ".toml"))
    ] = None
    """Force record (CSV); with --along a table for `compensate --force`; with --slots the
    cutting data (TOML)."""
    slots: Annotated[Path | None, InputFile()] = None
    """Mean forces of slots at several feeds, to identify the coefficients."""
    along: Annotated[Path | None, InputFile()] = None
    """Depth and width along a path: path_mm,depth_mm,width_mm."""
    measured: Annotated[Path | None, InputFile()] = None
    """A recorded force of the same cut, to compare with the model."""
    rate_hz: float = 20000.0
    """Samples per second of the record."""
    duration_s: float = 1.0
    """Length of the record."""


@operation()
def run(request: DynamicsForceRequest, context: Context) -> PlainResult:
    """Predicts the force or identifies coefficients; writes the requested files.

    Raises:
        ConfigurationError: Several jobs at once, or an invalid cut.
    """
    from robotrue.dynamics.cutting_data import cutting_data
    from robotrue.dynamics.milling_force import CALCULATED

    slots = request.slots
    if sum(path is not None for path in (slots, request.along, request.measured)) > 1:
        raise ConfigurationError(
            "--slots, --along and --measured are different jobs; one at a time."
        )
    output = request.output
    if output is not None and slots is not None:
        require_suffix(output, "cutting data", (".toml",))
    elif output is not None:
        require_suffix(output, "a CSV table", (".csv",))
    stated, _ = read_toml(request.cut, example=EXAMPLE)
    data = cutting_data(stated, where=str(request.cut), slots=slots is not None)
    if slots is not None:
        values, table = _identify(slots, data[0], data[1], stated, output, context)
        return PlainResult(values=values, shown=(table,), provenance=read_provenance(slots))
    if request.along is not None:
        values, facts = _along(request.along, *data, output, context)
        return PlainResult(values=values, shown=(facts,), provenance=CALCULATED)
    values, both = _predict(request, *data, output, context)
    return PlainResult(values=values, shown=both, provenance=CALCULATED)


def _predict(
    request: DynamicsForceRequest,
    cutter: EndMill,
    cut: CutterEngagement,
    coefficients: CuttingCoefficients,
    output: Path | None,
    context: Context,
) -> tuple[dict[str, object], tuple[Facts, ...]]:
    """The force of the milling model, and the measured one next to it."""
    from robotrue.dynamics.coefficients import check_axes_agree
    from robotrue.dynamics.formats.signal_table import read_force, write_force_csv
    from robotrue.dynamics.milling_force import force_over_time, mean_force

    record = force_over_time(
        cutter, cut, coefficients, rate=request.rate_hz, duration=request.duration_s
    )
    mean = mean_force(cutter, cut, coefficients)
    spectrum, modelled = _describe_force("milling model", record, mean, cut, cutter)
    extremes = {name: spectrum[name] for name in ("mean_N", "min_N", "max_N")}
    values = extremes | {"tooth_passing_Hz": cut.spindle * cutter.teeth} | spectrum
    shown: tuple[Facts, ...] = (modelled,)
    if request.measured is not None:
        real, odd = read_force(request.measured)
        real_mean = real.force.mean(axis=0)
        check_axes_agree(real_mean, mean, str(request.measured))
        for remark in odd:
            context.note(remark)
        measured, beside = _describe_force("measured", real, real_mean, cut, cutter)
        values, shown = values | {"measured": measured}, (*shown, beside)
    if output is not None:
        write_force_csv(output, record)
        context.inform(f"{len(record)} samples written to {output}")
    return values, shown


def _describe_force(
    name: str, record: ForceRecord, mean: Array, cut: CutterEngagement, cutter: EndMill
) -> tuple[dict[str, object], Facts]:
    """Extremes, shares of the mean square and the lowest spindle lines of a force, path axes, N."""
    import numpy as np

    from robotrue.dynamics.force import spindle_lines

    lines = spindle_lines(record, spindle=cut.spindle, teeth=cutter.teeth)
    least, largest = record.force.min(axis=0), record.force.max(axis=0)
    lowest = [
        (float(frequency), bool(tooth), np.abs(amplitude))
        for frequency, tooth, amplitude in zip(
            lines.frequency[:SHOWN], lines.is_tooth, lines.amplitude, strict=False
        )
    ]
    facts = Facts(
        title=f"force on the tool, {name}: along the feed, to its left, along the tool (N)",
        rows=(
            ("mean", _three(mean)),
            ("least", _three(least)),
            ("largest", _three(largest)),
            ("mean square on tooth lines", f"{100.0 * lines.tooth_share:.1f} %"),
            ("on other spindle lines", f"{100.0 * lines.runout_share:.1f} %"),
            *((f"{f:g} Hz{' (teeth)' if tooth else ''}", _three(a)) for f, tooth, a in lowest),
        ),
        measured=name == "measured",
    )
    return {
        "mean_N": mean,
        "min_N": least,
        "max_N": largest,
        "tooth_share": lines.tooth_share,
        "runout_share": lines.runout_share,
        "lines": [{"Hz": f, "tooth": tooth, "amplitude_N": a} for f, tooth, a in lowest],
    }, facts


def _identify(
    slots: Path,
    cutter: EndMill,
    cut: CutterEngagement,
    stated: Mapping[str, object],
    output: Path | None,
    context: Context,
) -> tuple[dict[str, object], Table]:
    """Coefficients of slot tests by their keys in cutting data."""
    from robotrue.dynamics.coefficients import identify_coefficients
    from robotrue.dynamics.cutting_data import coefficient_keys, cutting_text, read_slots

    tests = read_slots(slots, cut)
    found = identify_coefficients(cutter, tests)
    keys = coefficient_keys(found.coefficients)
    if output is not None:
        words = {key: v for key, v in stated.items() if isinstance(v, str | int | float)}
        feed = {"feed_per_tooth_mm": tests[-1].cut.feed_per_tooth / MM}
        rounded = {key: round(value, 6) for key, value in keys.items()}
        context.write(output, cutting_text({**feed, **words, **rounded}), "cutting data")
    deviations = _deviations(found)
    table = Table(
        title=f"cutting coefficients of {len(tests)} tests, mean forces {found.noise:.2g} N off",
        columns=("", "value", "+- (1 sigma)"),
        rows=tuple((k, f"{v:.4g}", f"{deviations[k]:.2g}") for k, v in keys.items()),
    )
    return {
        "tests": len(tests),
        "coefficients": keys,
        "deviations": deviations,
        "noise_N": found.noise,
        "residual_N": found.residual,
    }, table


def _deviations(found: IdentifiedCoefficients) -> dict[str, float]:
    from robotrue.dynamics.cutting_data import coefficient_keys, coefficients_of

    first, *others = found.deviation.tolist()
    return coefficient_keys(coefficients_of((max(first, 1e-300), *others)))


def _along(
    along: Path,
    cutter: EndMill,
    cut: CutterEngagement,
    coefficients: CuttingCoefficients,
    output: Path | None,
    context: Context,
) -> tuple[dict[str, object], Facts]:
    """Mean force along a path, N."""
    import numpy as np

    from robotrue.dynamics.cutting_data import read_along
    from robotrue.dynamics.formats.column_table import table_bytes
    from robotrue.dynamics.milling_force import CALCULATED, MillingAlongPath

    lengths, depth, width = read_along(along)
    model = MillingAlongPath(
        cutter=cutter, coefficients=coefficients, cut=cut, along=lengths, depth=depth, width=width
    )
    force = model.at(lengths)
    if output is not None:
        rows = np.column_stack([lengths / MM, force])
        table = table_bytes(["path_mm", "fx_N", "fy_N", "fz_N"], rows)
        data = mark_line(CALCULATED).encode() + table
        remark = ': axes = "path" in `compensate --force`'
        context.write(output, data, f"{len(rows)} rows", remark)
    largest = float(np.linalg.norm(force, axis=1).max())
    return {
        "rows": len(force),
        "path_mm": lengths,
        "force_N": force,
        "largest_N": largest,
        "mean_N": force.mean(axis=0),
    }, Facts(
        title="mean force along the path",
        rows=(("rows", str(len(force))), ("largest", f"{largest:.1f} N")),
    )


def _three(values: Array) -> str:
    return "  ".join(f"{v:8.2f}" for v in values)
