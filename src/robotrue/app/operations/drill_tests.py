"""A model of a foot on clamps that its fit did not use."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Note, PlainResult, Table
from robotrue.app.reported import Language, check_reports
from robotrue.app.request import (
    NOT_IN_FORMS,
    InputFile,
    Item,
    ItemVersion,
    Option,
    Output,
    Reference,
    Request,
    input_paths,
)
from robotrue.app.request_fields import OUTPUT, DrillModel, ZeroFoot
from robotrue.core.files import DEFAULT_LANG
from robotrue.core.provenance import Provenance, merge
from robotrue.core.units import DEG
from robotrue.drilling.drill_defaults import CAMPAIGN, LIMIT_DEG, MODEL, TEST, campaign_parts
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.drilling.evaluate import TiltEvaluation
    from robotrue.store.workspace import Transaction


class DrillEvaluateRequest(Request):
    """Model to evaluate, and clamps with known tilt."""

    model: DrillModel
    test: Annotated[Path, InputFile(argument="TEST")]
    """Clamps that the fit did not use."""
    foot: ZeroFoot = None


@operation("drill_evaluate")
def evaluate_model(request: DrillEvaluateRequest, context: Context) -> PlainResult:
    """Compare the tilt after one move: uncorrected, patent's regression, model."""
    from robotrue.drilling.campaign_csv import read_test
    from robotrue.drilling.evaluate import evaluate_test, evaluation_document
    from robotrue.drilling.model_archive import read_model

    (path,) = context.document_files(request.model, MODEL)
    model, data, _ = read_test(read_model(path), path, request.test, request.foot)
    result = evaluate_test(model, data)
    left = (
        ("uncorrected", result.uncorrected),
        ("patent's regression", result.patent),
        (f"ours ({model.kind})", result.ours),
    )
    table = Table(
        title=f"Residual tilt after one move, {result.clamps} clamps",
        columns=("", "mean deg", "p95 deg", "max deg"),
        rows=tuple(
            (name, *(f"{v / DEG:.4f}" for v in (r.mean, r.p95, r.largest)))
            for name, r in left
            if r is not None
        ),
    )
    covered = f"{100.0 * result.covered:.0f} % of the true tilts lie in the model's 95 % regions"
    return PlainResult(
        values=evaluation_document(result),
        shown=(table, Note(covered)),
        provenance=merge([model.provenance, data.provenance]),
    )


class DrillReportRequest(Request):
    """Model to evaluate, clamps with known tilt, and the limit."""

    model: DrillModel
    campaign: Annotated[Reference, Item(noun="document", argument="TEST", sent=True)]
    """Clamps that the fit did not use."""
    output: Annotated[Path, Output(names=OUTPUT, saved_as="report.html")]
    """Report to write: .html, .pdf or .json."""
    limit_deg: Annotated[float, Field(gt=0.0)] = LIMIT_DEG
    """Limit for 95 % of the holes."""
    simulated: Annotated[bool, Option(shells=NOT_IN_FORMS)] = False
    """Mark the test as simulated."""
    foot: ZeroFoot = None
    lang: Language = DEFAULT_LANG


@dataclass(frozen=True, slots=True, kw_only=True)
class DrillJudged:
    """Residual tilt after one move, on clamps that the fit did not use.

    Attributes:
        result: The tilts.
        verdict: One sentence.
        written: The report, and its JSON twin last.
        provenance: Of model and test.
    """

    result: TiltEvaluation
    verdict: str
    written: tuple[Path, ...]
    provenance: Provenance

    def document(self) -> Mapping[str, object]:
        """Returns JSON values in deg."""
        from robotrue.drilling.evaluate import evaluation_document

        files = {"output": str(self.written[0]), "json": str(self.written[-1])}
        return {**files, **evaluation_document(self.result)}

    def blocks(self) -> Iterable[Block]:
        """Returns the verdict."""
        yield Note(self.verdict)


@operation("drill_report")
def report_model(request: DrillReportRequest, context: Context) -> DrillJudged:
    """Write the report of a model: tilt after one move, and the test data.

    Raises:
        ConfigurationError: A job that tests a model on the campaign it was learned from.
    """
    from robotrue.drilling.campaign_csv import read_test
    from robotrue.drilling.evaluate import evaluate_test
    from robotrue.drilling.model_archive import read_model
    from robotrue.report.drilling_report import drilling_content
    from robotrue.report.report_files import write_reports
    from robotrue.report.words import language

    speech, output = language(request.lang), context.output(request.output)
    check_reports([output], input_paths(request))
    (path,) = context.document_files(request.model, MODEL)
    rows, beside = campaign_parts(context.document_files(request.campaign, CAMPAIGN))
    context.step("checking", 0, 1)
    model, data, digest = read_test(read_model(path), path, rows, request.foot or beside)
    if digest == model.campaign and isinstance(request.campaign, ItemVersion):
        raise ConfigurationError(
            "the test is the campaign of the model.",
            hint="another campaign, with tilts and forces in between.",
        )
    result = evaluate_test(model, data)
    content = drilling_content(
        model, data, result, digest=digest, limit=request.limit_deg * DEG,
        simulated=request.simulated, lang=speech,
    )  # fmt: skip
    written = write_reports([output], content)
    context.inform(f"report written to {', '.join(map(str, written))}")
    origin = merge([model.provenance, data.provenance])
    return DrillJudged(
        result=result,
        verdict=content.verdict.text,
        written=tuple(written),
        provenance=replace(origin, simulated=content.simulated),
    )


@report_model.saves
def save_report(
    request: DrillReportRequest, result: DrillJudged, into: Transaction, context: WorkspaceContext
) -> Mapping[str, object]:
    """Leaves a document ``drilling test`` with its report, linked to model and campaign."""
    import numpy as np

    from robotrue.core.json_values import json_values
    from robotrue.drilling.evaluate import evaluation_document
    from robotrue.store.records import Link

    held = context.document(request.model, MODEL)
    record = context.keep_document(into, request.campaign, CAMPAIGN, request.foot)
    tilts = result.result
    detail = {
        **evaluation_document(tilts),
        "limit_deg": request.limit_deg,
        "before_deg": np.round(tilts.before / DEG, 5).tolist(),
        "left_deg": np.round(tilts.left / DEG, 5).tolist(),
        "simulated": result.provenance.simulated,
    }
    links = [Link(role="model", to=held.ref), Link(role="data", to=record.ref)]
    files = list(result.written)
    return context.leave_document(into, TEST, held.name, files, links, json_values(detail))
