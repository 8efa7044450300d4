"""Predict the force of milling, or find its coefficients in slotting tests."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, NotRequired, TypedDict

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.outputs import require_suffix
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Block, Facts, Table
from robotrue.app.request import InputFile, Option, Output, Request
from robotrue.core.provenance import mark_line
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.core.arrays import Array
    from robotrue.dynamics.coefficients import IdentifiedCoefficients
    from robotrue.dynamics.cutter import CutterEngagement, CuttingCoefficients, EndMill
    from robotrue.dynamics.force import ForceRecord

EXAMPLE: Final = "docs/howto/predict-the-dynamic-error.md"
SHOWN: Final = 8
"""Spindle lines that are told."""


class DynamicsForceRequest(Request):
    """Which cut, and what is wanted of it."""

    cut: Annotated[Path, InputFile(argument="CUT", help="Cutter, cut and material (TOML).")]
    output: Annotated[
        Path | None,
        Output(
            names=("--output", "-o"),
            what="a force table",
            suffixes=(".csv", ".toml"),
            help="Force record (CSV); with --along a table for `compensate --force`; with "
            "--slots the cutting data (TOML).",
        ),
    ] = None
    slots: Annotated[
        Path | None,
        InputFile(help="Mean forces of slots at several feeds: gives the coefficients."),
    ] = None
    along: Annotated[
        Path | None,
        InputFile(help="Depth and width along a path: path_mm,depth_mm,width_mm."),
    ] = None
    measured: Annotated[
        Path | None,
        InputFile(help="A recorded force of the same cut, set beside the model."),
    ] = None
    rate_hz: Annotated[float, Option(help="Samples per second of the record.")] = 20000.0
    duration_s: Annotated[float, Option(help="Length of the record.")] = 1.0


def run(request: DynamicsForceRequest, context: Context) -> PlainResult:
    """Predicts or identifies; writes what was asked for.

    Raises:
        ConfigurationError: Several jobs at once, or a cut that cannot be.
    """
    from robotrue.core.files import read_toml
    from robotrue.core.provenance import read_provenance
    from robotrue.dynamics.cutting_data import cutting_data
    from robotrue.dynamics.milling_force import CALCULATED

    slots = request.slots
    if sum(path is not None for path in (slots, request.along, request.measured)) > 1:
        raise ConfigurationError(
            "--slots, --along and --measured are different jobs; one at a time."
        )
    output = None if request.output is None else context.output(request.output)
    if output is not None and slots is not None:
        require_suffix(output, "cutting data", (".toml",))
    elif output is not None:
        require_suffix(output, "a CSV table", (".csv",))
    stated, _ = read_toml(request.cut, example=EXAMPLE)
    data = cutting_data(stated, where=str(request.cut), slots=slots is not None)
    if slots is not None:
        found = _identify(slots, data[0], data[1], stated, output, context)
        origin = read_provenance(slots)
        return PlainResult(values={**found}, shown=(_coefficients(found),), provenance=origin)
    if request.along is not None:
        along = _along(request.along, *data, output, context)
        rows = (("rows", str(along["rows"])), ("largest", f"{along['largest_N']:.1f} N"))
        shown: Iterable[Block] = (Facts(title="mean force along the path", rows=rows),)
        values: dict[str, object] = {**along}
    else:
        force = _predict(request, *data, output, context)
        shown, values = _forces(force), {**force}
    return PlainResult(values=values, shown=tuple(shown), provenance=CALCULATED)


class ExtremesDocument(TypedDict):
    """Force in path axes, N."""

    mean_N: Array
    min_N: Array
    max_N: Array


class LineDocument(TypedDict):
    """A spindle line of a spectrum."""

    Hz: float
    tooth: bool
    amplitude_N: Array


class SpectrumDocument(ExtremesDocument):
    """Force over time: extremes, shares of the mean square, and the lowest spindle lines."""

    tooth_share: float
    runout_share: float
    lines: list[LineDocument]


class ForceDocument(SpectrumDocument):
    """The force of the milling model, and the measured one beside it."""

    tooth_passing_Hz: float
    measured: NotRequired[SpectrumDocument]


class CoefficientsDocument(TypedDict):
    """Cutting coefficients of slot tests by their keys in cutting data."""

    tests: int
    coefficients: dict[str, float]
    deviations: dict[str, float]
    noise_N: float
    residual_N: Array


class AlongDocument(TypedDict):
    """Mean force along a path, N."""

    rows: int
    path_mm: Array
    force_N: Array
    largest_N: float
    mean_N: Array


def _predict(
    request: DynamicsForceRequest,
    cutter: EndMill,
    cut: CutterEngagement,
    coefficients: CuttingCoefficients,
    output: Path | None,
    context: Context,
) -> ForceDocument:
    from robotrue.dynamics.coefficients import check_axes_agree
    from robotrue.dynamics.formats.signal_table import read_force, write_force_csv
    from robotrue.dynamics.milling_force import force_over_time, mean_force

    record = force_over_time(
        cutter, cut, coefficients, rate=request.rate_hz, duration=request.duration_s
    )
    mean = mean_force(cutter, cut, coefficients)
    spectrum = _spectrum(record, mean, cut, cutter)
    found: ForceDocument = {
        "mean_N": spectrum["mean_N"],
        "min_N": spectrum["min_N"],
        "max_N": spectrum["max_N"],
        "tooth_passing_Hz": cut.spindle * cutter.teeth,
        "tooth_share": spectrum["tooth_share"],
        "runout_share": spectrum["runout_share"],
        "lines": spectrum["lines"],
    }
    if request.measured is not None:
        real, odd = read_force(request.measured)
        real_mean = real.force.mean(axis=0)
        check_axes_agree(real_mean, mean, str(request.measured))
        for remark in odd:
            context.note(remark)
        found["measured"] = _spectrum(real, real_mean, cut, cutter)
    if output is not None:
        write_force_csv(output, record)
        context.inform(f"{len(record)} samples written to {output}")
    return found


def _spectrum(
    record: ForceRecord, mean: Array, cut: CutterEngagement, cutter: EndMill
) -> SpectrumDocument:
    import numpy as np

    from robotrue.dynamics.force import spindle_lines

    lines = spindle_lines(record, spindle=cut.spindle, teeth=cutter.teeth)
    return {
        "mean_N": mean,
        "min_N": record.force.min(axis=0),
        "max_N": record.force.max(axis=0),
        "tooth_share": lines.tooth_share,
        "runout_share": lines.runout_share,
        "lines": [
            {"Hz": float(f), "tooth": bool(t), "amplitude_N": np.abs(a)}
            for f, t, a in zip(
                lines.frequency[:SHOWN], lines.is_tooth, lines.amplitude, strict=False
            )
        ],
    }


def _identify(
    slots: Path,
    cutter: EndMill,
    cut: CutterEngagement,
    stated: Mapping[str, object],
    output: Path | None,
    context: Context,
) -> CoefficientsDocument:
    from robotrue.core.files import write_atomic
    from robotrue.dynamics.coefficients import identify_coefficients
    from robotrue.dynamics.cutting_data import coefficient_keys, cutting_text, read_slots

    tests = read_slots(slots, cut)
    found = identify_coefficients(cutter, tests)
    keys = coefficient_keys(found.coefficients)
    if output is not None:
        words = {key: v for key, v in stated.items() if isinstance(v, str | int | float)}
        feed = {"feed_per_tooth_mm": tests[-1].cut.feed_per_tooth / MM}
        rounded = {key: round(value, 6) for key, value in keys.items()}
        write_atomic(output, cutting_text({**feed, **words, **rounded}).encode())
        context.wrote("cutting data", output)
    return {
        "tests": len(tests),
        "coefficients": keys,
        "deviations": _deviations(found),
        "noise_N": found.noise,
        "residual_N": found.residual,
    }


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
) -> AlongDocument:
    import numpy as np

    from robotrue.core.files import write_atomic
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
        text = table_bytes(["path_mm", "fx_N", "fy_N", "fz_N"], rows)
        write_atomic(output, mark_line(CALCULATED).encode() + text)
        context.inform(
            f'{len(rows)} rows written to {output}: axes = "path" in `compensate --force`'
        )
    return {
        "rows": len(force),
        "path_mm": lengths,
        "force_N": force,
        "largest_N": float(np.linalg.norm(force, axis=1).max()),
        "mean_N": force.mean(axis=0),
    }


def _coefficients(d: CoefficientsDocument) -> Block:
    deviations = d["deviations"]
    return Table(
        title=f"cutting coefficients of {d['tests']} tests, mean forces {d['noise_N']:.2g} N off",
        columns=("", "value", "+- (1 sigma)"),
        rows=tuple((k, f"{v:.4g}", f"{deviations[k]:.2g}") for k, v in d["coefficients"].items()),
    )


def _forces(d: ForceDocument) -> Iterable[Block]:
    both: tuple[tuple[str, SpectrumDocument | None], ...] = (
        ("milling model", d),
        ("measured", d.get("measured")),
    )
    for name, one in both:
        if one is None:
            continue
        lines = [
            (f"{each['Hz']:g} Hz{' (teeth)' if each['tooth'] else ''}", _three(each["amplitude_N"]))
            for each in one["lines"]
        ]
        yield Facts(
            title=f"force on the tool, {name}: along the feed, to its left, along the tool (N)",
            rows=(
                ("mean", _three(one["mean_N"])),
                ("least", _three(one["min_N"])),
                ("largest", _three(one["max_N"])),
                ("mean square on tooth lines", f"{100.0 * one['tooth_share']:.1f} %"),
                ("on other spindle lines", f"{100.0 * one['runout_share']:.1f} %"),
                *lines,
            ),
            measured=name == "measured",
        )


def _three(values: Array) -> str:
    return "  ".join(f"{v:8.2f}" for v in values)


OPERATION: Final = Operation(request=DynamicsForceRequest, run=run)
