"""Take what an outside reference measured into a model; watch it; freeze it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from robotrue.app.context import Context
from robotrue.app.drill_fields import DrillModel, ModelOutput, ReferenceSigma, ZeroFoot
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Note, count
from robotrue.app.request import InputFile, Option, Request
from robotrue.core.units import DEG
from robotrue.drilling.drill_defaults import LIMIT_DEG, REFERENCE_SIGMA_DEG
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.drilling.campaign_csv import ProductionRecord
    from robotrue.drilling.foot_model import NormalModel


class DrillRefineRequest(Request):
    """Which model to refine by which records, and whether to freeze it."""

    model: DrillModel
    output: ModelOutput
    records: Annotated[
        Path | None,
        InputFile(
            argument="[RECORDS]",
            help="Holes that MODEL moved, with left_a_deg, left_b_deg as a reference measured "
            "them; with --freeze it may be left out.",
        ),
    ] = None
    truth: Annotated[
        str, Option(help="What measured what was left: a mandrel plane, a hole gauge, ...")
    ] = ""
    sigma_deg: Annotated[ReferenceSigma, Field(gt=0.0)] = REFERENCE_SIGMA_DEG
    freeze: Annotated[
        Path | None,
        InputFile(help="Then freeze the model, if it does well on these clamps."),
    ] = None
    allowed_deg: Annotated[
        float,
        Field(gt=0.0),
        Option(help="With --freeze: 95 % of the tilts left must be within."),
    ] = LIMIT_DEG
    foot: ZeroFoot = None


def run(request: DrillRefineRequest, context: Context) -> PlainResult:
    """Takes what a reference measured after holes into a model, and freezes it on request.

    Raises:
        ConfigurationError: Neither records nor a test to freeze it by, or a test it fails.
    """
    from robotrue.drilling.campaign_csv import read_campaign, read_production, setup_of
    from robotrue.drilling.drill_defaults import MODEL
    from robotrue.drilling.model_archive import read_model, write_model
    from robotrue.drilling.production import freeze_model

    (path,) = context.document_files(request.model, MODEL)
    before = model = read_model(path)
    setup = setup_of(model, path, request.foot)
    alarms: list[dict[str, object]] = []
    holes = 0
    if request.records is not None:
        production = read_production(request.records, setup)
        holes = len(production.hole)
        model, alarms = _refine(model, production, request, context)
    elif request.freeze is None:
        raise ConfigurationError(
            "no RECORDS to refine the model by, and no --freeze.", hint="RECORDS, or --freeze TEST."
        )
    if request.freeze is not None:
        test, digest = read_campaign(request.freeze, setup, model.head.order)
        allowed = request.allowed_deg * DEG
        model = freeze_model(model, test, digest, allowed=allowed, before=before)
    output = context.output(request.output)
    write_model(output, model)
    taken = f"{count(holes, 'record')} of {request.truth}, {count(len(alarms), 'alarm')}"
    return PlainResult(
        values={
            "output": str(output),
            "records": holes,
            "alarms": alarms,
            "version_before": before.version,
            **_document(model),
        },
        shown=(
            *([] if request.records is None else [Note(taken)]),
            Note(f"{_state(model)}, written to {output}"),
        ),
        provenance=model.provenance,
    )


def _refine(
    before: NormalModel, holes: ProductionRecord, request: DrillRefineRequest, context: Context
) -> tuple[NormalModel, list[dict[str, object]]]:
    """The model after holes that it moved all of, and the alarms of its watch."""
    from robotrue.drilling.correction import correct_readings
    from robotrue.drilling.foot_model import with_refinement
    from robotrue.drilling.production import record_of, update_model

    model = before
    alarms: list[dict[str, object]] = []
    plain = correct_readings(before.foot, before.head.order, before.correction, holes.clamps)
    moved = with_refinement(before, plain).tilt
    for i, name in enumerate(holes.hole):
        found = with_refinement(model, plain.take(slice(i, i + 1)))
        record = record_of(
            name, found, holes.left[i], request.truth, holes.provenance, moved=moved[i]
        )
        step = update_model(model, found, record, reference=request.sigma_deg * DEG)
        model = step.model
        if step.alarm:
            alarms.append({"hole": name, "shift_deg": (step.shift / DEG).tolist()})
            context.inform(f"ALARM: {step.said}")
    return model, alarms


def _document(model: NormalModel) -> dict[str, object]:
    """Version, refinement and what it was frozen by, as JSON values."""
    from robotrue.drilling.evaluate import residuals_document

    kept, learned = model.frozen, model.refinement
    return {
        "version": model.version,
        "refinement": {
            "records": learned.records,
            "truths": list(learned.truths),
            "constant_deg": (learned.coefficients[0] / DEG).tolist(),
        },
        "frozen": None
        if kept is None
        else {
            "version": kept.version,
            "tested_on_sha256": kept.tested_on,
            "clamps": kept.clamps,
            **residuals_document(kept),
        },
    }


def _state(model: NormalModel) -> str:
    if model.frozen is None:
        return f"version {model.version}, refined by {count(model.refinement.records, 'record')}"
    kept = model.frozen
    return (
        f"frozen as {kept.version}: {kept.clamps} clamps within {kept.p95 / DEG:.4f} deg (95 %), "
        f"{kept.largest / DEG:.4f} deg at most"
    )


OPERATION: Final = Operation(request=DrillRefineRequest, run=run)
