"""Kinds of jobs: the commands' own work on items of a workspace, by name.

Each takes a :class:`~robotrue.store.jobs_work.Work` and returns what is to be written; parameters
are those of the command, with items of the workspace in place of files. Their names and defaults
are in the reference of the workspace.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from robotrue.cli.compensate import Request, compensated
from robotrue.cli.job_items import (
    asked_of,
    cell_file,
    heard,
    ref_document,
)
from robotrue.cli.split import SplitOptions
from robotrue.cli.steps import MAX_STEP_MM, StepRule
from robotrue.errors import ConfigurationError
from robotrue.program.identity import SUFFIX
from robotrue.store import models, programs
from robotrue.store.jobs_work import Publish, Work
from robotrue.store.layout import laid_out
from robotrue.store.nouns import CELL, MODEL, PROGRAM, REGISTRATION
from robotrue.store.registrations import CELL_FILE
from robotrue.store.workspace import Transaction

PAGE: Final = "report.html"


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
