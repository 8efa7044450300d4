"""Kinds of jobs: the commands' own work on items of a workspace, by name.

Each takes a :class:`~robotrue.store.jobs_work.Work` and returns what is to be written; parameters
are those of the command, with items of the workspace in place of files. Their names and defaults
are in the reference of the workspace.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from robotrue.app.calibration_page import write_page
from robotrue.app.registered import provenance_of_file
from robotrue.calibration.lineage import provenance_of
from robotrue.cli.calibrate import calibrated, require_method, screened_remarks, write_report
from robotrue.cli.compensate import Request, compensated
from robotrue.cli.job_items import (
    asked_of,
    cell_file,
    cell_of,
    heard,
    leave_document,
    ref_document,
    rows_of,
)
from robotrue.cli.plan import document as plan_document
from robotrue.cli.plan import planned, program_text
from robotrue.cli.plan_page import plan_page
from robotrue.cli.split import SplitOptions
from robotrue.cli.steps import MAX_STEP_MM, StepRule
from robotrue.core.files import write_atomic
from robotrue.core.provenance import marked_document, merge
from robotrue.errors import ConfigurationError
from robotrue.planning.sheet import plan_sheet
from robotrue.program.identity import SUFFIX
from robotrue.report.model_view import remarks
from robotrue.store import models, programs
from robotrue.store.jobs_work import Publish, Work
from robotrue.store.layout import laid_out
from robotrue.store.model_file import write_model
from robotrue.store.nouns import CELL, MEASUREMENT, MODEL, PROGRAM, REGISTRATION
from robotrue.store.records import Link
from robotrue.store.registrations import CELL_FILE
from robotrue.store.workspace import Transaction
from robotrue.validation.validate import validate as validated

PAGE: Final = "report.html"


def calibrate(work: Work) -> Publish:
    """Fits a model to measurement sets in a cell; leaves a model with its report page."""
    asked = asked_of(work, "cell", "measurements", "method")
    record, sets = asked.item(CELL, "cell"), asked.items(MEASUREMENT, "measurements")
    method = asked.text("method", "auto")
    require_method(method)
    with heard(work):
        cell = cell_of(work, record)
        rows = rows_of(work, cell, sets)
        model, selection = calibrated(cell, rows, method, told=work.step)
        path, page = work.folder / "model.rtm", work.folder / PAGE
        write_model(path, model, cell)
        write_report(page, model, rows, cell, selection)
    summary = model.training_summary()
    for line in screened_remarks(rows, summary.screened_rows) + remarks(summary):
        work.remark(line)
    name = asked.text("name", f"{record.name}, {len(rows)} poses")

    def publish(into: Transaction) -> Mapping[str, Any]:
        made = models.add(
            into,
            path,
            name=name,
            note=asked.text("note", ""),
            data=[each.ref for each in sets],
            cell=record.ref,
            settings={"method": method},
            reports=[page],
            job=work.job.id,
        )
        return {
            "model": ref_document(made.ref),
            "method": made.method,
            "rows": len(rows),
            "simulated": rows.provenance.simulated,
        }

    return publish


def validate(work: Work) -> Publish:
    """Judges a model on measurement sets it has not seen; leaves a validation with its page."""
    asked = asked_of(work, "model", "measurements")
    record, sets = asked.item(MODEL, "model"), asked.items(MEASUREMENT, "measurements")
    work.step("reading", 0, 3)
    held = models.model_of(work.workspace, record)
    with heard(work):
        rows = rows_of(work, held.cell, sets)
        work.step("predicting", 1, 3)
        result = validated(held.model, rows, payload=held.cell.payload)
        work.step("writing the report", 2, 3)
        page = work.folder / PAGE
        write_page(page, held.model, result, title="Held-out validation", measured=rows.provenance)
    for doubt in result.doubts:
        work.remark(doubt)
    links = [Link(role="model", to=record.ref), *(Link(role="data", to=s.ref) for s in sets)]
    origin = merge([provenance_of(held.model), rows.provenance])
    detail = marked_document(result.to_json(), origin)
    return leave_document(work, asked, "validation", record.name, [page], links, detail)


def compensate(work: Work) -> Publish:
    """Compensates a program with a model, a cell or a registration; leaves the program after."""
    asked = asked_of(
        work, "program", "model", "cell", "registration", "part", "wrench", "cutter", "start",
        "free_spin", "axis_targets", "max_shift_mm", "split_um", "deviation",
        "max_step_mm", "allow_steps",
    )  # fmt: skip
    before = asked.item(PROGRAM, "program")
    model, cell = asked.item_or_none(MODEL, "model"), asked.item_or_none(CELL, "cell")
    place = asked.item_or_none(REGISTRATION, "registration")
    sources, out = work.folder / "before", work.folder / "after"
    for folder in (sources, out):
        folder.mkdir()
    files = programs.laid(work.workspace, before, sources)
    paths = [
        *([models.laid(work.workspace, model, work.folder)] if model is not None else []),
        *([cell_file(work, cell)] if cell is not None else []),
        *(laid_out(work.workspace, place, work.folder, CELL_FILE) if place is not None else ()),
    ]
    _require_ground(paths)
    request = Request(
        model=paths[0],
        programs=files,
        output=out,
        registered=paths[1] if len(paths) > 1 else None,
        part=asked.text_or_none("part"),
        wrench=asked.text_or_none("wrench"),
        cutter=asked.text_or_none("cutter"),
        start=asked.text_or_none("start"),
        free_spin=asked.flag("free_spin", False),
        axis_targets=asked.flag("axis_targets", False),
        max_shift_mm=asked.number("max_shift_mm", 10.0),
        steps=StepRule(
            max_mm=asked.number("max_step_mm", MAX_STEP_MM),
            allow=asked.flag("allow_steps", False),
        ),
        split=SplitOptions(
            tolerance_um=asked.number_or_none("split_um"), deviation=asked.flag("deviation", False)
        ),
    )
    work.step("compensating", 0, 1)
    with heard(work):
        detail = compensated(request, told=work.step)
    made = [out / path.name for path in files if (out / path.name).is_file()]
    identities = sorted(out.glob(f"*{SUFFIX}"))
    name = asked.text("name", f"{before.name}, compensated")

    def publish(into: Transaction) -> Mapping[str, Any]:
        after = programs.add_after(
            into,
            made,
            before=before.ref,
            model=None if model is None else model.ref,
            cell=None if cell is None else cell.ref,
            registration=None if place is None else place.ref,
            identities=identities,
            name=name,
            note=asked.text("note", ""),
            job=work.job.id,
            detail=_portable(detail),
        )
        counts = {key: detail[key] for key in ("targets", "compensated", "unchanged", "simulated")}
        return {"program": ref_document(after.ref), **counts}

    return publish


def plan(work: Work) -> Publish:
    """Chooses poses worth measuring in a cell; leaves a plan: table, page, KRL if asked for."""
    asked = asked_of(
        work, "cell", "model", "program", "poses", "criterion", "region", "within", "payloads",
        "approach", "candidates", "tolerance_um", "seed", "krl", "trigger_output",
    )  # fmt: skip
    record, model = asked.item(CELL, "cell"), asked.item_or_none(MODEL, "model")
    before = asked.item_or_none(PROGRAM, "program")
    cell, targets = cell_of(work, record), None
    if before is not None:
        (work.folder / "before").mkdir()
        targets = programs.laid(work.workspace, before, work.folder / "before")[0]
    start = None if model is None else models.laid(work.workspace, model, work.folder)
    origin = provenance_of_file(start)
    work.step("drawing postures", 0, 1)
    with heard(work):
        found = planned(
            cell,
            asked.whole("poses", 30),
            criterion=asked.text("criterion", "I"),
            region=asked.text_or_none("region"),
            within=asked.text_or_none("within"),
            program_targets=targets,
            model_path=start,
            payloads=asked.texts("payloads"),
            approach=asked.text("approach", "one-side"),
            candidates=asked.whole("candidates", 2000),
            tolerance_um=asked.number("tolerance_um", 0.0),
            seed=asked.whole("seed", 1),
            told=work.step,
        )
    files = [work.folder / "poses.csv", work.folder / PAGE]
    write_atomic(files[0], plan_sheet(found))
    write_atomic(files[1], plan_page(cell, found, origin).encode())
    if asked.flag("krl", False):
        files.append(work.folder / "measure.src")
        output = asked.whole("trigger_output", 17)
        write_atomic(files[2], program_text(cell, found, files[2], output))
    for note in found.notes:
        work.remark(note)
    links = [
        Link(role="cell", to=record.ref),
        *([Link(role="model", to=model.ref)] if model is not None else []),
        *([Link(role="before", to=before.ref)] if before is not None else []),
    ]
    detail = marked_document(plan_document(found), origin)
    return leave_document(work, asked, "plan", record.name, files, links, detail)


def _require_ground(paths: list[Path]) -> None:
    if not 0 < len(paths) < 3:
        raise ConfigurationError(
            f"{len(paths)} of model, cell and registration are stated, expected one, or a model "
            "with one of the others.",
            hint='{"program": ..., "model": ...}',
        )


def _portable(detail: Mapping[str, Any]) -> dict[str, Any]:
    """The document of the command without the paths of a folder that is gone."""
    gone = {"output", "identity"}
    kept = {key: value for key, value in detail.items() if key not in gone}
    if "files" in kept:
        kept["files"] = [_portable(each) for each in kept["files"]]
    return kept
