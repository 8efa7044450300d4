"""Say what tilt one move leaves: uncorrected, by the patent's regression, by the model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app.context import Context
from robotrue.app.drill_fields import DrillModel, ZeroFoot
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Note, Table
from robotrue.app.request import InputFile, Request
from robotrue.core.provenance import merge
from robotrue.core.units import DEG


class DrillEvaluateRequest(Request):
    """Which model to judge, on which clamps."""

    model: DrillModel
    test: Annotated[Path, InputFile(argument="TEST", help="Clamps the fit has not seen.")]
    foot: ZeroFoot = None


def run(request: DrillEvaluateRequest, context: Context) -> PlainResult:
    """Says what one move leaves on clamps with known tilts."""
    from robotrue.drilling.campaign_csv import read_test
    from robotrue.drilling.drill_defaults import MODEL
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
        title=f"Tilt left after one move, {result.clamps} clamps",
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


OPERATION: Final = Operation(request=DrillEvaluateRequest, run=run)
