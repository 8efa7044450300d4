"""The kind of job that brings a model up to date with a few poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from robotrue.calibration.sources import Source
from robotrue.cli.job_items import (
    asked_of,
    cell_of,
    heard,
    ref_document,
    rows_of,
)
from robotrue.planning.information import settings_of
from robotrue.report.model_view import remarks
from robotrue.store import models
from robotrue.store.jobs_work import Publish, Work
from robotrue.store.model_file import write_model
from robotrue.store.nouns import CELL, MEASUREMENT, MODEL
from robotrue.store.provenance import provenance_of_record
from robotrue.store.records import MeasurementRecord, ModelRecord
from robotrue.store.workspace import Transaction
from robotrue.validation.drift_defaults import FEWEST
from robotrue.validation.guarded_transfer import contestants, select_transfer


def transfer(work: Work) -> Publish:
    """Brings a model up to date with a few poses, guarded as the command; leaves a new model."""
    asked = asked_of(work, "model", "measurements", "cell")
    record, sets = asked.item(MODEL, "model"), asked.items(MEASUREMENT, "measurements")
    place = asked.item_or_none(CELL, "cell")
    work.step("reading", 0, 1)
    held = models.model_of(work.workspace, record)
    with heard(work):
        cell = held.cell if place is None else cell_of(work, place)
        rows = rows_of(work, cell, sets, minimum=FEWEST)
        robot, settings = cell.measured_robot, settings_of(cell)
        old = Source(model=held.model, relation="campaign", name=record.name)
        found = contestants(robot, rows, [old], settings)
        model = select_transfer(found, robot, rows, settings, progress=work.step)
    path = work.folder / "model.rtm"
    write_model(path, model, cell)
    for line in remarks(model.training_summary()):
        work.remark(line)
    return _new_version(work, asked.text("name", f"{record.name}, updated"), record, sets, path)


def _new_version(
    work: Work, name: str, record: ModelRecord, sets: Sequence[MeasurementRecord], path: Path
) -> Publish:
    def publish(into: Transaction) -> Mapping[str, Any]:
        cells = record.linked("cell")
        made = models.add(
            into,
            path,
            name=name,
            data=[each.ref for each in sets],
            cell=cells[0] if cells else None,
            parents=[record.ref],
            settings={"relation": "campaign"},
            job=work.job.id,
        )
        simulated = provenance_of_record(made).simulated
        return {"model": ref_document(made.ref), "method": made.method, "simulated": simulated}

    return publish
