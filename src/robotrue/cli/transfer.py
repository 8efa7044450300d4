"""``robotrue transfer``: knowledge from elsewhere and a few poses in, model of the target out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from robotrue.app.measured_rows import read_rows
from robotrue.app.outputs import check_output
from robotrue.calibration.drift import RELATIONS
from robotrue.calibration.lineage import provenance_of
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.sources import Source
from robotrue.cell.cell import Cell
from robotrue.cell.config import read_cell
from robotrue.cli.console import (
    TERMINAL,
    count,
    emit_facts,
    emit_json,
    emit_table,
    progress,
    say,
    say_mark,
)
from robotrue.core.files import read_bytes, sha256, write_atomic
from robotrue.core.provenance import Provenance
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ModelMismatchError, ObservabilityError
from robotrue.measurement.measurement_set import MeasurementSet, concatenate
from robotrue.planning.information import settings_of
from robotrue.report.content import Fact
from robotrue.report.model_view import remarks, result_facts
from robotrue.store.model_file import ZIP, read_model, write_model
from robotrue.validation.contest import Selection
from robotrue.validation.guard import GuardVerdict, verdict_from_summary
from robotrue.validation.guarded_transfer import Contestants, contestants, select_transfer
from robotrue.validation.learning_curve import LearningCurve, learning_curve

REPEATS = 5


def run(
    cell_path: Path,
    targets: Sequence[Path],
    stated: Sequence[str],
    output: Path,
    *,
    mapping: Path | None,
    report: Path | None,
    curve: bool,
    as_json: bool,
) -> None:
    """Transfers and writes the model file; prints who won the contest and why."""
    named = [parse_source(text) for text in stated]
    files = [cell_path, *targets, *(path for _, path, _ in named), *([mapping] if mapping else [])]
    for written in [output, *([report] if report else [])]:
        check_output(written, files)
    cell = read_cell(cell_path)
    for doubt in cell.doubts:
        say(f"note: {doubt}")
    sources = [_source(cell, *one, mapping) for one in named]
    target = _target(cell, targets, mapping)
    settings = settings_of(cell)
    robot = cell.measured_robot
    found = contestants(robot, target, sources, settings)
    if target is None and not found.transfers:
        raise ObservabilityError(
            "no source can be used and no target pose was measured: " + " ".join(found.doubts),
            hint="measure target poses, or give a source of this robot.",
        )
    with progress() as step:
        model = select_transfer(found, robot, target, settings, progress=step)
    drawn = _curve(found, target, cell) if curve else None
    write_model(output, model, cell)
    say(f"model written to {output}")
    told = verdict_from_summary(model.training_summary())
    if told is None:
        raise ModelMismatchError("the model cannot carry the evidence of its contest.")
    if report is not None:
        _write_report(report, model, told, drawn, named, targets)
    _print(output, model, told, drawn, as_json)


def parse_source(text: str) -> tuple[str, Path, str]:
    """Returns name, file and relation from ``NAME=FILE[,relation]``; the relation is ``campaign``.

    Raises:
        ConfigurationError: Another form, or an unknown relation.
    """
    name, equals, rest = text.partition("=")
    file, comma, relation = rest.rpartition(",")
    if not comma or relation not in RELATIONS:
        if comma and relation.isalpha():
            raise ConfigurationError(
                f"relation {relation!r} of source {name!r}, expected {', '.join(RELATIONS)}.",
                hint=f"--source {name}={file},campaign",
            )
        file, relation = rest, "campaign"
    if not (name and equals and file):
        raise ConfigurationError(
            f"source {text!r}, expected NAME=FILE or NAME=FILE,relation.",
            hint="--source march=march.csv,campaign",
        )
    return name, Path(file), relation


def _source(cell: Cell, name: str, path: Path, relation: str, mapping: Path | None) -> Source:
    where = next(r for r in RELATIONS if r == relation)
    workbook = path.suffix.lower().startswith(".xls")
    if read_bytes(path).startswith(ZIP) and not workbook:
        return Source(model=read_model(path).model, relation=where, name=name)
    rows = read_rows(cell, path, mapping, reporter=TERMINAL)
    say(f"source {name}: {count(len(rows), 'pose')} from {path.name}, relation {relation}")
    return Source(measurements=rows, relation=where, name=name)


def _target(cell: Cell, paths: Sequence[Path], mapping: Path | None) -> MeasurementSet | None:
    if not paths:
        return None
    sets = [read_rows(cell, path, mapping, reporter=TERMINAL) for path in paths]
    for path, rows in zip(paths, sets, strict=True):
        if (rows.frame, rows.dof) != (sets[0].frame, sets[0].dof):
            raise ModelMismatchError(
                f"{rows.dof} joints and positions in the {rows.frame} frame, those of {paths[0]} "
                f"{sets[0].dof} and in the {sets[0].frame} frame.",
                source=path,
                hint="target files of one robot and one frame.",
            )
    joined = concatenate(sets)
    say(f"target: {count(len(joined), 'pose')} from {count(len(paths), 'file')}")
    return joined


def _curve(found: Contestants, target: MeasurementSet | None, cell: Cell) -> LearningCurve | None:
    if target is None:
        say("note: no curve without target poses")
        return None
    with progress() as step:
        return learning_curve(
            found.all, target, repeats=REPEATS, payload=cell.payload, progress=step
        )


def _print(
    output: Path,
    model: ErrorModel,
    told: tuple[GuardVerdict, Selection | None],
    curve: LearningCurve | None,
    as_json: bool,
) -> None:
    verdict, selection = told
    summary, origin = model.training_summary(), provenance_of(model)
    say_mark(origin)
    if as_json:
        drawn = {} if curve is None else {"curve": curve.to_json()}
        emit_json({"model": str(output), **summary, **drawn}, origin)
        return
    if selection is not None:
        emit_table(
            f"candidates on {verdict.target_rows} target poses, each held out in turn",
            ("", "mean mm", "max mm", "in 95 % region", "gain mm", "noise mm", ""),
            [_row(selection, k, verdict.winner) for k in range(len(selection.table))],
            provenance=origin,
        )
        say(selection.reason)
    if curve is not None:
        _print_curve(curve, origin)
    emit_facts(
        f"transfer to {model.robot.name}",
        [("used", verdict.winner), *result_facts(summary)],
        origin,
    )
    for line in remarks(summary):
        say(line)


def _row(selection: Selection, index: int, winner: str) -> tuple[str, ...]:
    score = selection.table[index]
    if score.failure:
        return (score.name, *["-"] * 5, "not fitted")
    contest = np.isfinite(score.gain)
    return (
        score.name,
        f"{score.mean / MM:.4f}",
        f"{score.max / MM:.4f}",
        f"{100 * score.coverage:.0f} %",
        f"{score.gain / MM:+.4f}" if contest else "-",
        f"{score.noise / MM:.4f}" if contest else "-",
        "used" if score.name == winner else "",
    )


def _print_curve(curve: LearningCurve, origin: Provenance) -> None:
    median = curve.quartiles()[1] / MM
    emit_table(
        f"mean error in mm against target poses, median of {curve.repeats} subsets, tested on "
        f"{count(curve.held, 'row')} no candidate saw",
        ("", *(str(n) for n in curve.counts)),
        [
            (name, *(f"{v:.4f}" if np.isfinite(v) else "-" for v in median[c]))
            for c, name in enumerate(curve.names)
        ],
        provenance=origin,
    )
    for failure in curve.failures:
        say(f"note: {failure}")


def _write_report(
    path: Path,
    model: ErrorModel,
    told: tuple[GuardVerdict, Selection | None],
    curve: LearningCurve | None,
    named: Sequence[tuple[str, Path, str]],
    targets: Sequence[Path],
) -> None:
    from robotrue.report.page import report_html
    from robotrue.report.transfer_report import transfer_content

    summary = model.training_summary()
    verdict, selection = told
    files = [*((f"source {name}, {relation}", file) for name, file, relation in named),
             *(("target", file) for file in targets)]  # fmt: skip
    content = transfer_content(
        verdict,
        selection,
        curve,
        title=f"Transfer to {model.robot.name}",
        subtitle=", ".join(f"{name} ({relation})" for name, _, relation in named)
        + f"; {count(verdict.target_rows, 'target pose')}",
        simulated=provenance_of(model).simulated,
        doubts=list(summary.warnings),
        provenance=[
            Fact(name=what, value=f"{file.name} sha256:{sha256(read_bytes(file))}")
            for what, file in files
        ],
    )
    write_atomic(path, report_html(content).encode())
    say(f"report written to {path}")
