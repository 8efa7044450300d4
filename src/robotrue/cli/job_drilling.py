"""Kinds of jobs about drilling: a model learned from a campaign, and judged on another one."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.cli.drill import AUTO, evaluation_document, kind_of, setup_of, terms_of
from robotrue.cli.job_items import asked_of, heard, leave_document
from robotrue.core.json_values import json_values
from robotrue.core.units import DEG
from robotrue.drilling.campaign_checks import check_campaign
from robotrue.drilling.campaign_csv import read_campaign
from robotrue.drilling.evaluate import evaluate_test
from robotrue.drilling.foot_file import read_foot
from robotrue.drilling.foot_model import fit_model
from robotrue.drilling.head import Head
from robotrue.drilling.kept import CAMPAIGN, MODEL, TEST
from robotrue.drilling.model_archive import read_model, write_model
from robotrue.drilling.model_document import model_document
from robotrue.errors import ConfigurationError
from robotrue.report.drilling_report import drilling_content
from robotrue.report.report_files import write_reports
from robotrue.report.words import language
from robotrue.store.jobs_work import Publish, Work
from robotrue.store.layout import laid_out
from robotrue.store.nouns import DOCUMENT
from robotrue.store.records import DocumentRecord, Link

NO_PIVOT: Final = np.full(3, np.nan)


def drill_fit(work: Work) -> Publish:
    """Learns a foot's model from a campaign; leaves it with the trials it was chosen by."""
    asked = asked_of(work, "campaign", "kind")
    record = _of_kind(asked.item(DOCUMENT, "campaign"), CAMPAIGN)
    kind = kind_of(asked.text("kind", AUTO))
    foot, rows = _files(work, record)
    if foot is None:
        raise ConfigurationError(
            f"the campaign {record.name!r} has no foot file.", hint="drop both together."
        )
    with heard(work):
        setup = read_foot(foot)
        head = setup.head or Head(p_pivot_tip=NO_PIVOT)
        if setup.head is None:
            work.remark("no [head] in the foot file: X, Y, Z of a move are not known.")
        data, digest = read_campaign(rows, setup, head.order)
        check_campaign(setup.foot, data)
        model, trials = fit_model(setup.foot, head, data, kind=kind, digest=digest, step=work.step)
        path = work.folder / "drill.robotrue"
        write_model(path, model)
        terms = terms_of(model, data)
    detail: dict[str, Any] = json_values(
        {
            **model_document(model, trials),
            "terms": terms,
            "clamps": len(data),
        }
    )
    links = [Link(role="data", to=record.ref)]
    return leave_document(work, asked, MODEL, record.name, [path], links, detail)


def drill_report(work: Work) -> Publish:
    """Judges a foot's model on another campaign than its own; leaves a test with its report."""
    asked = asked_of(work, "model", "campaign", "limit_deg", "lang")
    held = _of_kind(asked.item(DOCUMENT, "model"), MODEL)
    record = _of_kind(asked.item(DOCUMENT, "campaign"), CAMPAIGN)
    limit, speech = asked.number("limit_deg", 0.1), language(asked.text("lang", "en"))
    if not limit > 0.0:
        raise ConfigurationError(f"a limit of {limit:g} deg, expected above 0.", hint="0.1")
    (path,) = laid_out(work.workspace, held, _folder(work, "model"))
    model = read_model(path)
    foot, rows = _files(work, record)
    work.step("judging", 0, 1)
    with heard(work):
        data, digest = read_campaign(rows, setup_of(model, path, foot), model.head.order)
        if digest == model.campaign:
            raise ConfigurationError(
                "the test is the campaign the model was learned from.",
                hint="another campaign, with tilts and forces in between.",
            )
        check_campaign(model.foot, data)
        result = evaluate_test(model, data)
        content = drilling_content(
            model, data, result, digest=digest, limit=limit * DEG, lang=speech
        )
        made = write_reports([work.folder / "report.html"], content)
        work.remark(f"report written to {', '.join(path.name for path in made)}")
    detail = {
        **evaluation_document(result),
        "limit_deg": limit,
        "before_deg": np.round(result.before / DEG, 5).tolist(),
        "left_deg": np.round(result.left / DEG, 5).tolist(),
        "simulated": content.simulated,
    }
    links = [Link(role="model", to=held.ref), Link(role="data", to=record.ref)]
    return leave_document(work, asked, TEST, held.name, made, links, json_values(detail))


def _of_kind(record: DocumentRecord, kind: str) -> DocumentRecord:
    if record.kind != kind:
        raise ConfigurationError(f"{record.name!r} is a {record.kind}, expected a {kind}.")
    return record


def _files(work: Work, record: DocumentRecord) -> tuple[Path | None, Path]:
    """The foot file of a campaign, if it has one, and its rows."""
    paths = laid_out(work.workspace, record, _folder(work, "campaign"))
    feet = [path for path in paths if path.suffix.lower() == ".toml"]
    (rows,) = (path for path in paths if path not in feet)
    return (feet[0] if feet else None), rows


def _folder(work: Work, name: str) -> Path:
    folder = work.folder / name
    folder.mkdir()
    return folder
