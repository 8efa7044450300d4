"""Carry a calibration to a new region, date or arm with a few poses, under guard."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal, TypeAlias

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.outputs import check_output
from robotrue.app.presentation import Block, Facts, Note, Table
from robotrue.app.request import (
    IN_JOBS,
    ON_COMMAND_LINE,
    Item,
    Option,
    Reference,
    Request,
)
from robotrue.app.request_fields import ForeignColumns, ModelOutput, Page
from robotrue.calibration.deng2022.readings import (
    BOOSTING,
    AttitudeReading,
    Boosting,
    DengReadings,
)
from robotrue.core.provenance import Provenance
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ModelMismatchError, ObservabilityError
from robotrue.validation.drift_defaults import FEWEST

if TYPE_CHECKING:
    from robotrue.app.transfer_sources import StatedSource
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.calibration.model import ErrorModel
    from robotrue.calibration.sources import TransferSource
    from robotrue.cell.cell import Cell
    from robotrue.measurement.measurement_set import MeasurementSet
    from robotrue.store.workspace import Transaction
    from robotrue.validation.contest import Selection
    from robotrue.validation.guard import GuardVerdict
    from robotrue.validation.guarded_transfer import Contestants
    from robotrue.validation.learning_curve import LearningCurve

REPEATS: Final = 5
"""Subsets of the target poses for each point of the curve."""
UPDATE: Final = "campaign"
"""How a model stands to poses that bring it up to date: the same arm, another time."""
TransferMethod: TypeAlias = Literal["auto", "deng2022"]
AUTO: Final[TransferMethod] = "auto"
METHOD_OPTIONS: Final = (
    "sub_spaces", "source_region", "target_region", "attitude", "rounds", "boosting", "reading",
)  # fmt: skip
"""Fields of the paper's method alone."""
USUAL: Final = DengReadings()
"""How the paper's equations are read unless stated otherwise."""


class TransferRequest(Request):
    """What is known, and of what: stated sources of a command, the model that a job updates."""

    cell: Annotated[
        Reference | None,
        Item(noun="cell", argument="CELL", needed_in=ON_COMMAND_LINE, help="cell.toml"),
    ] = None
    source: Annotated[
        tuple[str, ...],
        Option(
            names=("--source",),
            shells=ON_COMMAND_LINE,
            needed_in=ON_COMMAND_LINE,
            help="NAME=FILE[,region|campaign|unit]: measurements or a model; may be repeated.",
        ),
    ] = ()
    output: ModelOutput
    measurements: Annotated[
        tuple[Reference, ...],
        Item(
            noun="measurement",
            argument="[TARGET...]",
            needed_in=IN_JOBS,
            help="Target measurements.",
        ),
    ] = ()
    model: Annotated[
        Reference | None,
        Item(noun="model", shells=IN_JOBS, needed_in=IN_JOBS, help="Model to bring up to date."),
    ] = None
    mapping: ForeignColumns = None
    report: Page = None
    curve: Annotated[
        bool,
        Option(shells=ON_COMMAND_LINE, help="Also accuracy against the number of target poses."),
    ] = False
    method: Annotated[
        TransferMethod,
        Option(
            shells=ON_COMMAND_LINE,
            help="auto (the candidate that holds) or deng2022 (the paper's Tr-GPR, checked too).",
        ),
    ] = AUTO
    sub_spaces: Annotated[
        int | None,
        Option(
            shells=ON_COMMAND_LINE,
            least=1,
            help="deng2022: parts of the target as wide as the source; default: all that fit.",
        ),
    ] = None
    source_region: Annotated[
        str | None,
        Option(
            shells=ON_COMMAND_LINE,
            help="deng2022: angle_deg=A..B,radius_mm=..,height_mm=..; default: as measured.",
        ),
    ] = None
    target_region: Annotated[
        str | None,
        Option(shells=ON_COMMAND_LINE, help="deng2022: where it shall hold, like --source-region."),
    ] = None
    attitude: Annotated[
        AttitudeReading,
        Option(
            shells=ON_COMMAND_LINE,
            help="deng2022: turning (with the angle about joint 1) or fixed (in base).",
        ),
    ] = USUAL.attitude
    rounds: Annotated[
        int,
        Option(shells=ON_COMMAND_LINE, least=1, help="deng2022: boosting rounds, at most."),
    ] = USUAL.rounds
    boosting: Annotated[
        Boosting,
        Option(
            shells=ON_COMMAND_LINE,
            help="deng2022: corrected, or literal (eq. 19, 22 and 24 as printed).",
        ),
    ] = BOOSTING
    reading: Annotated[
        tuple[str, ...],
        Option(
            shells=ON_COMMAND_LINE,
            help="deng2022: NAME=VALUE, how an equation is read; may be repeated.",
        ),
    ] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Transferred:
    """A model that came out of a contest of candidates.

    Attributes:
        model: The error model.
        output: Its file.
        verdict: Who won, and whether target poses said so.
        selection: What each candidate reached on held-out target poses; None without any.
        curve: Accuracy against the number of target poses, if asked for.
        provenance: Of the model.
    """

    model: ErrorModel
    output: Path
    verdict: GuardVerdict
    selection: Selection | None
    curve: LearningCurve | None
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
    from robotrue.app.transfer_sources import count

    median = curve.quartiles()[1] / MM
    return Table(
        title=f"mean error in mm against target poses, median of {curve.repeats} subsets, tested "
        f"on {count(curve.held, 'row')} no candidate saw",
        columns=("", *(str(n) for n in curve.counts)),
        rows=tuple(
            (name, *(f"{v:.4f}" if isfinite(v) else "-" for v in median[c]))
            for c, name in enumerate(curve.names)
        ),
    )


def run(request: TransferRequest, context: Context) -> Transferred:
    """Lets what is known and what was measured compete; writes the model that wins.

    Raises:
        ObservabilityError: Nothing can be used.
    """
    from robotrue.app.transfer_method import paper_contestants
    from robotrue.app.transfer_sources import parse_source, read_target
    from robotrue.calibration.lineage import provenance_of
    from robotrue.planning.information import settings_of
    from robotrue.store.model_file import write_model
    from robotrue.validation.guard import verdict_from_summary
    from robotrue.validation.guarded_transfer import contestants, select_transfer

    stated = [parse_source(text) for text in request.source]
    for written in (request.output, request.report) if stated else ():
        if written is not None:
            check_output(written, [each.path for each in stated])
    context.step("reading", 0, 1)
    cell, sources = _read_known(request, stated, context)
    target = (
        read_target(cell, request.measurements, request.mapping, context)
        if request.model is None
        else context.measurements(cell, request.measurements, minimum=FEWEST)
    )
    robot, settings = cell.measured_robot, settings_of(cell)
    if request.method == AUTO:
        _refuse_method_options(request)
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
    curve = _curve(found, target, cell, context) if request.curve else None
    output = context.output(request.output)
    write_model(output, model, cell)
    context.wrote("model", output)
    told = verdict_from_summary(model.training_summary())
    if told is None:
        raise ModelMismatchError("the model cannot carry the evidence of its contest.")
    result = Transferred(
        model=model,
        output=output,
        verdict=told[0],
        selection=told[1],
        curve=curve,
        provenance=provenance_of(model),
    )
    if request.report is not None:
        _write_page(context.output(request.report), request, stated, result, context)
    return result


def _refuse_method_options(request: TransferRequest) -> None:
    """Refuses options of the paper's method where it is not the one that was stated."""
    for name in METHOD_OPTIONS:
        if getattr(request, name) != TransferRequest.model_fields[name].get_default():
            option = f"--{name.replace('_', '-')}"
            raise ConfigurationError(
                f"{option} is an option of --method deng2022; the method is {request.method}.",
                hint=f"--method deng2022, or leave {option} out.",
            )


def _read_known(
    request: TransferRequest, stated: Sequence[StatedSource], context: Context
) -> tuple[Cell, list[TransferSource]]:
    """The cell of the target, and what is known: stated sources, or the model to update."""
    from robotrue.app.transfer_sources import read_source
    from robotrue.calibration.sources import TransferSource

    if request.model is None:
        if request.cell is None:
            raise ConfigurationError("neither a cell nor a model is stated.")
        cell = context.cell(request.cell)
        return cell, [read_source(cell, each, request.mapping, context) for each in stated]
    held = context.model(request.model)
    cell = held.cell if request.cell is None else context.cell(request.cell)
    name = context.name(request.model)
    return cell, [TransferSource(model=held.model, relation=UPDATE, name=name)]


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
    stated: Sequence[StatedSource],
    result: Transferred,
    context: Context,
) -> None:
    from robotrue.app.transfer_sources import count
    from robotrue.core.files import write_atomic
    from robotrue.report.content import Fact
    from robotrue.report.page import report_html
    from robotrue.report.report_files import file_fact
    from robotrue.report.transfer_report import transfer_content

    files = [
        *((f"source {each.name}, {each.relation}", each.path) for each in stated),
        *(("target", each) for each in request.measurements if isinstance(each, Path)),
    ]
    sources = ", ".join(f"{each.name} ({each.relation})" for each in stated)
    content = transfer_content(
        result.verdict,
        result.selection,
        result.curve,
        title=f"Transfer to {result.model.robot.name}",
        subtitle=f"{sources}; {count(result.verdict.target_rows, 'target pose')}",
        simulated=result.provenance.simulated,
        doubts=list(result.model.training_summary().warnings),
        provenance=[Fact(name=what, value=file_fact(file)) for what, file in files],
    )
    write_atomic(path, report_html(content).encode())
    context.wrote("report", path)


def save(
    request: TransferRequest, result: Transferred, into: Transaction, context: WorkspaceContext
) -> Mapping[str, object]:
    """Leaves a new model, child of the one it brings up to date, linked to the poses."""
    from robotrue.app.workspace_context import ref_document
    from robotrue.store import models
    from robotrue.store.nouns import MEASUREMENT, MODEL
    from robotrue.store.records import provenance_of_record

    if request.model is None:
        raise ConfigurationError("a job of transfer brings a model up to date: none is stated.")
    record = context.record(MODEL, request.model)
    cells = record.refs("cell")
    made = models.add(
        into,
        result.output,
        name=context.naming.name or f"{record.name}, updated",
        note=context.naming.note,
        data=[each.ref for each in context.records(MEASUREMENT, request.measurements)],
        cell=cells[0] if cells else None,
        parents=[record.ref],
        settings={"relation": UPDATE},
        job=context.work.job.id,
    )
    simulated = provenance_of_record(made).simulated
    return {"model": ref_document(made.ref), "method": made.method, "simulated": simulated}


OPERATION: Final = Operation(request=TransferRequest, run=run, save=save)
