"""Kinds of jobs about drift: a few poses to measure, what they say, a model brought up to date."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from robotrue.calibration.lineage import provenance_of
from robotrue.calibration.sources import Source
from robotrue.cli.drift import document
from robotrue.cli.drift_plan import chosen, sheet
from robotrue.cli.job_items import (
    asked_of,
    cell_of,
    heard,
    leave_document,
    ref_document,
    rows_of,
)
from robotrue.core.files import write_atomic
from robotrue.core.provenance import marked_document, merge
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError
from robotrue.planning.information import settings_of
from robotrue.report.model_view import remarks
from robotrue.store import drift_checks, models
from robotrue.store.jobs_work import Publish, Work
from robotrue.store.model_file import write_model
from robotrue.store.nouns import CELL, MEASUREMENT, MODEL
from robotrue.store.provenance import provenance_of_record
from robotrue.store.records import Link, MeasurementRecord, ModelRecord
from robotrue.store.workspace import Transaction
from robotrue.validation.drift_check import FEWEST, LEVEL, drift_check
from robotrue.validation.guarded_transfer import contestants, judged

POSES: Final = 7


def drift_plan(work: Work) -> Publish:
    """Chooses the few poses that show best what may have happened; leaves a sheet to fill in."""
    asked = asked_of(work, "model", "poses", "seed")
    record, n = asked.item(MODEL, "model"), asked.whole("poses", POSES)
    if n < FEWEST:
        raise ConfigurationError(
            f"{n} poses; a drift check needs {FEWEST} or more.", hint=f"{POSES} poses."
        )
    work.step("reading", 0, 2)
    held = models.model_of(work.workspace, record)
    work.step("choosing poses", 1, 2)
    joints, seen = chosen(held.model, held.cell, n, seed=asked.whole("seed", 0))
    path = work.folder / "check_poses.csv"
    write_atomic(path, sheet(joints))
    found = {"poses": len(joints), "joints_deg": (joints / DEG).tolist(), "sd": seen}
    detail = marked_document(found, provenance_of(held.model))
    links = [Link(role="model", to=record.ref)]
    return leave_document(work, asked, "drift-plan", record.name, [path], links, detail)


def drift(work: Work) -> Publish:
    """Judges a few poses by a model; leaves a drift check with its verdict."""
    asked = asked_of(work, "model", "measurements", "level")
    record, (data, *more) = asked.item(MODEL, "model"), asked.items(MEASUREMENT, "measurements")
    if more:
        raise ConfigurationError(
            f"{1 + len(more)} measurement sets, expected one.", hint="one campaign, one check."
        )
    work.step("reading", 0, 3)
    held = models.model_of(work.workspace, record)
    with heard(work):
        rows = rows_of(work, held.cell, [data], minimum=FEWEST)
        work.step("predicting", 1, 3)
        level = asked.number("level", LEVEL)
        found = drift_check(held.model, rows, payload=held.cell.payload, level=level)
    origin = merge([provenance_of(held.model), rows.provenance])
    detail = {**marked_document(document(found), origin), "job": work.job.id}
    name = asked.text("name", f"{record.name}: {data.name}")

    def publish(into: Transaction) -> Mapping[str, Any]:
        made = drift_checks.add(
            into,
            name=name,
            note=asked.text("note", ""),
            model=record.ref,
            data=data.ref,
            poses=len(rows),
            statistic=found.chi2,
            p_value=found.p,
            verdict=found.verdict,
            detail=detail,
        )
        return {
            "check": ref_document(made.ref),
            "verdict": found.verdict,
            "simulated": origin.simulated,
        }

    return publish


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
        model = judged(found, robot, rows, settings, progress=work.step)
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
