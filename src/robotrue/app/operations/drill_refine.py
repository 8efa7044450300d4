"""Update a model with reference measurements, monitor it, freeze it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Note, PlainResult, Table, count
from robotrue.app.request import InputFile, Request
from robotrue.app.request_fields import DrillModel, FootModelOutput, ReferenceSigma, ZeroFoot
from robotrue.core.units import DEG
from robotrue.drilling.drill_defaults import LIMIT_DEG, MODEL, REFERENCE_SIGMA_DEG
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.drilling.campaign_csv import ProductionRecord
    from robotrue.drilling.foot_model import NormalModel
    from robotrue.drilling.production_references import MemoryChoice


class DrillRefineRequest(Request):
    """Model to refine, the reference records, and whether to freeze it."""

    model: DrillModel
    output: FootModelOutput
    records: Annotated[Path | None, InputFile(argument="[RECORDS]")] = None
    """Holes that MODEL moved, with the left_a_deg, left_b_deg of a reference; optional with
    --freeze."""
    truth: str = ""
    """Reference that measured the residual tilts: a mandrel plane, a hole gauge, ..."""
    sigma_deg: Annotated[ReferenceSigma, Field(gt=0.0)] = REFERENCE_SIGMA_DEG
    freeze: Annotated[Path | None, InputFile()] = None
    """Then freeze the model if it passes on these clamps."""
    allowed_deg: Annotated[float, Field(gt=0.0)] = LIMIT_DEG
    """With --freeze: limit for 95 % of the residual tilts."""
    foot: ZeroFoot = None


@operation()
def run(request: DrillRefineRequest, context: Context) -> PlainResult:
    """Takes what a reference measured after holes into a model, and freezes it on request.

    Raises:
        ConfigurationError: Neither records nor a test to freeze it by, or a test it fails.
    """
    from robotrue.drilling.campaign_csv import read_campaign, read_production, setup_of
    from robotrue.drilling.foot_model import use_zero
    from robotrue.drilling.model_archive import read_model, write_model
    from robotrue.drilling.production import freeze_model

    (path,) = context.document_files(request.model, MODEL)
    before = read_model(path)
    setup = setup_of(before, path, request.foot)
    before = model = use_zero(before, setup.taken_zero)
    alarms: list[dict[str, object]] = []
    holes, memory = 0, None
    if request.records is not None:
        production = read_production(request.records, setup, version=model.version)
        holes = len(production.hole)
        model, alarms, memory = _refine(model, production, request, context)
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
            "memory": _memory_document(memory),
            **_document(model),
        },
        shown=(
            *([] if request.records is None else [Note(taken)]),
            *_memory_blocks(memory),
            Note(f"{_state(model)}, written to {output}"),
        ),
        provenance=model.provenance,
    )


def _refine(
    before: NormalModel, holes: ProductionRecord, request: DrillRefineRequest, context: Context
) -> tuple[NormalModel, list[dict[str, object]], MemoryChoice | None]:
    """The model after holes that it moved all of, the alarms of its watch, the memory chosen."""
    from robotrue.drilling.production import refine_model
    from robotrue.drilling.production_references import check_references, find_cause

    found = refine_model(before, holes, truth=request.truth, reference=request.sigma_deg * DEG)
    cause = find_cause(before, holes)
    if warning := check_references(holes.left, found.expected, holes.source, cause):
        context.note(warning)
    alarms = []
    for step in found.alarms:
        alarms.append({"hole": step.hole, "shift_deg": (step.shift / DEG).tolist()})
        context.inform(f"ALARM: {step.said}")
    return found.model, alarms, found.memory


def _memory_document(memory: MemoryChoice | None) -> dict[str, object] | None:
    """Returns the held-out result of each memory length, as JSON values."""
    if memory is None or not memory.trials:
        return None
    trials = [
        {
            "forgetting": t.forgetting,
            "held_out_rms_deg": t.rms / DEG,
            "gain_sigmas": t.gain,
        }
        for t in memory.trials
    ]
    return {
        "refined": memory.start is not None,
        "forgetting": None if memory.start is None else memory.start.forgetting,
        "before_rms_deg": memory.before / DEG,
        "trials": trials,
    }


def _memory_blocks(memory: MemoryChoice | None) -> list[Block]:
    """The trials as a table, and what follows from them."""
    if memory is None:
        return []
    if not memory.trials:
        return [Note("too few references to hold any out: refined with the memory of the model")]
    table = Table(
        title=f"Held-out references; without refinement {memory.before / DEG:.5f} deg rms",
        columns=("forgetting", "rms deg", "gain sigmas"),
        rows=tuple(
            (
                f"{t.forgetting:g}",
                f"{t.rms / DEG:.5f}",
                f"{t.gain:+.1f}",
            )
            for t in memory.trials
        ),
    )
    said = (
        "not refined: no memory predicts held-out references significantly better than the "
        "current model"
        if memory.start is None
        else f"refined with forgetting {memory.start.forgetting:g}"
    )
    return [table, Note(said)]


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
