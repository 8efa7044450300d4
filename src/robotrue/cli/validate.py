"""``robotrue validate``: how well a model predicts poses it has not seen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robotrue.app.outputs import check_output
from robotrue.calibration.lineage import provenance_of
from robotrue.cli.console import count, emit_json, emit_table, say, say_mark
from robotrue.cli.inputs import measured
from robotrue.core.provenance import merge
from robotrue.core.units import MM
from robotrue.report.model_view import harmless_remark
from robotrue.store.model_file import read_model
from robotrue.validation.metrics import ErrorStatistics
from robotrue.validation.validate import validate


def run(
    model_path: Path,
    paths: Sequence[Path],
    *,
    mapping: Path | None,
    report: Path | None,
    as_json: bool,
) -> None:
    """Prints the held-out statistics before and after."""
    if report is not None:
        check_output(report, [model_path, *paths])
    stored = read_model(model_path)
    measurements = measured(stored.cell, paths, mapping)
    result = validate(stored.model, measurements, payload=stored.cell.payload)
    origin = merge([provenance_of(stored.model), measurements.provenance])
    say_mark(origin)
    for doubt in result.doubts:
        say(f"note: {doubt}")
    for line in harmless_remark(stored.model.training_summary()):
        say(line)
    if report is not None:
        from robotrue.app.calibration_page import write_page

        write_page(
            report,
            stored.model,
            result,
            title="Held-out validation",
            measured=measurements.provenance,
        )
        say(f"report written to {report}")
    if as_json:
        emit_json(result.to_json(), origin)
        return
    aligned = result.before_aligned
    emit_table(
        f"{count(len(measurements), 'pose')}, {stored.model.robot.name}",
        ("", "mean mm", "p95 mm", "max mm", "std mm"),
        [
            _row("before", result.before),
            *([_row("base and tool corrected", aligned)] if aligned is not None else []),
            _row("after", result.after),
        ],
        provenance=origin,
    )
    say(
        f"{100 * result.coverage.share:.1f} % of the points lie in their stated 95 % region"
        f" (95 % interval {100 * result.coverage.low:.1f} to {100 * result.coverage.high:.1f} %)"
    )


def _row(name: str, statistics: ErrorStatistics) -> tuple[str, ...]:
    values = (statistics.mean, statistics.p95, statistics.max, statistics.std)
    return (name, *(f"{value / MM:.3f}" for value in values))
