"""Transfer a calibration to a new region, date or arm with a few poses."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Final

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.outputs import check_output
from robotrue.app.presentation import Block, Facts, Note, Table, count
from robotrue.app.transfer_request import AUTO, TransferRequest, refuse_method_options
from robotrue.core.provenance import Provenance
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ModelMismatchError, ObservabilityError
from robotrue.validation.validation_defaults import FEWEST_DRIFT_POSES

if TYPE_CHECKING:
    from robotrue.app.transfer_sources import KnownSource
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.calibration.model import ErrorModel
    from robotrue.cell.cell import Cell
    from robotrue.measurement.measurement_set import MeasurementSet
    from robotrue.store.workspace import Transaction
    from robotrue.validation.contest import Selection
    from robotrue.validation.guard import GuardVerdict
    from robotrue.validation.guarded_transfer import Contestants
    from robotrue.validation.learning_curve import LearningCurve

REPEATS: Final = 5
"""Subsets of the target poses for each point of the curve."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Transferred:
    """A model chosen among candidates.

    Attributes:
        model: The error model.
        output: Its file.
        verdict: The chosen candidate, and whether target poses decided it.
        selection: Error of each candidate on held-out target poses; None without any.
        curve: Accuracy against the number of target poses, if requested.
        page: Report page that was written, if requested.
        provenance: Of the model.
    """

    model: ErrorModel
    output: Path
    verdict: GuardVerdict
    selection: Selection | None
    curve: LearningCurve | None
    page: Path | None
    provenance: Provenance

    def document(self) -> Mapping[str, object]:
        """Returns the training summary, and the curve, as JSON values."""
        drawn = {} if self.curve is None else {"curve": self.curve.to_json()}
        return {"model": str(self.output), **self.model.training_summary(), **drawn}

    def blocks(self) -> Iterable[Block]:
        """Returns the contest, the curve, and what the model learned."""
        from robotrue.app.transfer_method import sub_space_blocks
        from robotrue.report.model_view import remarks, result_facts

        summary, verdict = self.model.training_summary(), self.verdict
        if self.selection is not None:
            yield Table(
                title=f"candidates on {verdict.target_rows} target poses, each held out in turn",
                columns=("", "mean mm", "max mm", "in 95 % region", "gain mm", "noise mm", ""),
                rows=tuple(_contest_rows(self.selection, verdict.winner)),
            )
            yield Note(self.selection.reason)
        if self.curve is not None:
            yield _curve_table(self.curve)
            for failure in self.curve.failures:
                yield Note(f"note: {failure}")
        yield from sub_space_blocks(summary)
        yield Facts(
            title=f"transfer to {self.model.robot.name}",
            rows=(("used", verdict.winner), *result_facts(summary)),
        )
        for line in remarks(self.model):
            yield Note(line)


def _contest_rows(selection: Selection, winner: str) -> Iterable[tuple[str, ...]]:
    for score in selection.table:
        if score.failure:
            yield (score.name, *["-"] * 5, "not fitted")
            continue
        contest = isfinite(score.gain)
        yield (
            score.name,
            f"{score.mean / MM:.4f}",
            f"{score.max / MM:.4f}",
            f"{100 * score.coverage:.0f} %",
            f"{score.gain / MM:+.4f}" if contest else "-",
            f"{score.noise / MM:.4f}" if contest else "-",
            "used" if score.name == winner else "",
        )


def _curve_table(curve: LearningCurve) -> Table:
    median = curve.quartiles()[1] / MM
    return Table(
        title=f"mean error in mm against target poses, median of {curve.repeats} subsets, tested "
        f"on {count(curve.held, 'row')} used by no candidate",
        columns=("", *(str(n) for n in curve.counts)),
        rows=tuple(
            (name, *(f"{v:.4f}" if isfinite(v) else "-" for v in median[c]))
            for c, name in enumerate(curve.names)
        ),
    )


@operation()
def run(request: TransferRequest, context: Context) -> Transferred:
    """Lets what is known and what was measured compete; writes the model that wins.

    Raises:
        ConfigurationError: No source on a command line.
        ObservabilityError: Nothing can be used.
    """
    from robotrue.app.data_doctor import find_warnings
    from robotrue.app.measured_rows import require_mapped
    from robotrue.app.transfer_method import paper_contestants
    from robotrue.app.transfer_sources import known_sources, read_source, read_target
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.calibration.model import provenance_of
    from robotrue.planning.information import settings_of
    from robotrue.store.model_file import write_model
    from robotrue.validation.doctor import with_findings
    from robotrue.validation.guard import verdict_from_summary
    from robotrue.validation.guarded_transfer import contestants, select_transfer

    known = known_sources(request, context)
    for written in (request.output, request.report) if request.source or request.fleet else ():
        if written is not None:
            check_output(written, [each.path for each in known if each.path is not None])
    require_mapped(request.mapping, [*(each.reference for each in known), *request.measurements])
    context.step("reading", 0, 1)
    cell = _read_cell(request, context)
    if not known and not isinstance(context, WorkspaceContext):
        raise ConfigurationError(
            "no source is stated.",
            hint="--source NAME=FILE, or --fleet FOLDER with models of other arms of the type.",
        )
    sources = [read_source(cell, each, request.mapping, context) for each in known]
    target = (
        read_target(cell, request.measurements, request.mapping, context)
        if request.model is None
        else context.measurements(
            cell, request.measurements, request.mapping, minimum=FEWEST_DRIFT_POSES
        )
    )
    robot, settings = cell.measured_robot, settings_of(cell)
    if request.method == AUTO:
        refuse_method_options(request)
        found = contestants(robot, target, sources, settings)
    else:
        found = paper_contestants(request, robot, target, sources, settings, context)
    if target is None and not found.transfers:
        raise ObservabilityError(
            "no source can be used and no target pose was measured: " + " ".join(found.doubts),
            hint="measure target poses, or give a source of this robot.",
        )
    requested = "" if request.method == AUTO else request.method
    model = select_transfer(
        found, robot, target, settings, progress=context.step, requested=requested
    )
    if target is not None:
        model = with_findings(model, find_warnings(cell, target))
    curve = _curve(found, target, cell, context) if request.curve else None
    output = context.output(request.output)
    write_model(output, model, cell)
    context.wrote("model", output)
    verdict = verdict_from_summary(model.training_summary())
    if verdict is None:
        raise ModelMismatchError("the model cannot carry the evidence of its contest.")
    page = None if request.report is None else context.output(request.report)
    result = Transferred(
        model=model,
        output=output,
        verdict=verdict[0],
        selection=verdict[1],
        curve=curve,
        page=page,
        provenance=provenance_of(model),
    )
    if page is not None:
        _write_page(page, request, known, result, context)
    return result


def _read_cell(request: TransferRequest, context: Context) -> Cell:
    """The cell of the target: the one that is stated, or that of the model to update."""
    if request.cell is not None:
        return context.cell(request.cell)
    if request.model is None:
        raise ConfigurationError(
            "neither a cell nor a model is stated.",
            hint="a cell with what is known of it, or a model to bring up to date.",
        )
    return context.model(request.model).cell


def _curve(
    found: Contestants, target: MeasurementSet | None, cell: Cell, context: Context
) -> LearningCurve | None:
    from robotrue.validation.learning_curve import learning_curve

    if target is None:
        context.note("no curve without target poses")
        return None
    return learning_curve(
        found.all, target, repeats=REPEATS, payload=cell.payload, progress=context.step
    )


def _write_page(
    path: Path,
    request: TransferRequest,
    known: Sequence[KnownSource],
    result: Transferred,
    context: Context,
) -> None:
    from robotrue.report.content import Fact
    from robotrue.report.page import report_html
    from robotrue.report.report_files import file_fact
    from robotrue.report.transfer_report import transfer_content

    inputs = [
        *((f"source {each.name}, {each.relation}", each.reference) for each in known),
        *(("target", each) for each in request.measurements),
    ]
    facts = [
        Fact(name=what, value=file_fact(each) if isinstance(each, Path) else context.name(each))
        for what, each in inputs
    ]
    sources = ", ".join(f"{each.name} ({each.relation})" for each in known)
    content = transfer_content(
        result.verdict,
        result.selection,
        result.curve,
        title=f"Transfer to {result.model.robot.name}",
        subtitle=f"{sources}; {count(result.verdict.target_rows, 'target pose')}",
        simulated=result.provenance.simulated,
        doubts=list(result.model.training_summary().warnings),
        provenance=facts,
    )
    context.write(path, report_html(content), "report")


@run.saves
def save(
    request: TransferRequest, result: Transferred, into: Transaction, context: WorkspaceContext
) -> Mapping[str, object]:
    """Leaves a model with its page, child of the models it started from, linked to the poses."""
    from robotrue.app.transfer_sources import keep_sources, known_sources
    from robotrue.app.workspace_context import ref_document
    from robotrue.store import models
    from robotrue.store.nouns import CELL, MODEL
    from robotrue.store.records import provenance_of_record

    known, cell = known_sources(request, context), context.ref(CELL, request.cell)
    if request.model is not None:
        record = context.record(MODEL, request.model)
        cell, name = next(iter(record.refs("cell")), cell), f"{record.name}, updated"
    else:
        name = f"transfer to {result.model.robot.name}"
    measured, parents = keep_sources(into, known, cell, request.mapping, context)
    targets = context.keep_measured(into, request.measurements, cell, request.mapping)
    relations = list(dict.fromkeys(each.relation for each in known))
    made = models.add(
        into,
        result.output,
        name=context.naming.name or name,
        note=context.naming.note,
        data=list(dict.fromkeys([*targets, *measured])),
        cell=cell,
        parents=parents,
        settings={"relation": ", ".join(relations), "method": request.method},
        reports=[] if result.page is None else [result.page],
        job=context.work.job.id,
    )
    simulated = provenance_of_record(made).simulated
    return {"model": ref_document(made.ref), "method": made.method, "simulated": simulated}
