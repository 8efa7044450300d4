"""A report as a kind of job: certificate of a model, report of a program or of a registration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from robotrue.cli.job_items import asked_of, heard, leave_document, rows_of
from robotrue.cli.job_parameters import Parameters
from robotrue.cli.report_calibration import certificate_facts
from robotrue.cli.report_output import put_reports
from robotrue.cli.report_program import program_report, verdict_word
from robotrue.cli.report_registration import registration_report
from robotrue.core.provenance import Provenance, merge
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, MissingExtraError
from robotrue.report.certificate import certificate_content
from robotrue.report.content import ReportContent
from robotrue.report.words import Lang, language
from robotrue.store import cells, items, jobs, models, programs
from robotrue.store.jobs_work import Publish, Work
from robotrue.store.layout import laid_out
from robotrue.store.nouns import CELL, MEASUREMENT, MODEL, PROGRAM, REGISTRATION
from robotrue.store.provenance import provenance_of_record
from robotrue.store.records import (
    Link,
    ModelRecord,
    ProgramRecord,
    Record,
    RegistrationRecord,
)
from robotrue.store.registrations import CELL_FILE

SUBJECTS: Final = ("program", "registration", "model")
FORMS: Final = ("html", "pdf", "json")


@dataclass(frozen=True, slots=True, kw_only=True)
class Made:
    """A report before it is written.

    Attributes:
        content: What it says.
        about: What it is a report of.
        links: What else it rests on.
        facts: For the list of reports, JSON values.
    """

    content: ReportContent
    about: Record
    links: tuple[Link, ...]
    facts: dict[str, Any]


def report(work: Work) -> Publish:
    """Writes the report of a program, a registration or a model; leaves a document with its files.

    Which one is stated by the parameter ``program``, ``registration`` or ``model``, in this order.
    """
    asked = asked_of(
        work, *SUBJECTS, "measurements", "tolerance_mm", "lang", "strict", "forms",
    )  # fmt: skip
    subject = next((name for name in SUBJECTS if work.parameters.get(name) is not None), None)
    if subject is None:
        raise ConfigurationError(
            "a report of nothing, expected a program, a registration or a model.",
            hint='{"model": ..., "lang": "en"}',
        )
    speech, forms = language(asked.text("lang", "en")), _forms(asked)
    work.step("reading", 0, 4)
    with heard(work):
        made = MAKERS[subject](work, asked, speech)
        files = _written(work, made.content, forms, subject)
    for doubt in made.content.doubts:
        work.remark(doubt)
    detail = {
        "subject": subject,
        "lang": speech,
        "title": made.content.title,
        "simulated": made.content.simulated,
        "tone": made.content.verdict.tone,
        "text": made.content.verdict.text,
        **made.facts,
    }
    links = [Link(role="about", to=made.about.ref), *made.links]
    return leave_document(work, asked, "report", made.about.name, files, links, detail)


def _forms(asked: Parameters) -> tuple[str, ...]:
    stated = asked.texts("forms") or list(FORMS)
    odd = [form for form in stated if form not in FORMS]
    if odd:
        raise ConfigurationError(f"form {odd[0]!r} of a report, expected {', '.join(FORMS)}.")
    return tuple(stated)


def _written(
    work: Work, content: ReportContent, forms: tuple[str, ...], subject: str
) -> list[Path]:
    """The files asked for; a PDF that cannot be set on this machine is left out and said so."""
    work.step("setting pages", 2, 4)
    stem = work.folder / f"{'certificate' if subject == 'model' else subject}_{content.lang}"
    written = put_reports([stem.with_suffix(".html")], content)
    if "pdf" in forms:
        work.step("setting pages", 3, 4)
        try:
            written += put_reports([stem.with_suffix(".pdf")], content)
        except (MissingExtraError, ConfigurationError) as cause:
            if forms != FORMS:  # asked for by name
                raise
            work.remark(f"no PDF: {cause}")
    made = {path.suffix.removeprefix("."): path for path in written}
    return [made[form] for form in FORMS if form in forms and form in made]


def _certificate(work: Work, asked: Parameters, speech: Lang) -> Made:
    record = asked.item(MODEL, "model")
    sets = asked.items(MEASUREMENT, "measurements") if asked.stated("measurements") else []
    tolerance = _tolerance(asked, needed=False)
    held = models.model_of(work.workspace, record)
    rows = rows_of(work, held.cell, sets) if sets else None
    path = models.laid(work.workspace, record, work.folder)
    work.step("judging", 1, 4)
    facts = certificate_facts(
        held.model,
        held.cell,
        rows,
        simulated=_origin(work, record).simulated,
        files=[("fact.model", path)],
        lang=speech,
    )
    links = tuple(Link(role="data", to=each.ref) for each in sets)
    content = certificate_content(facts, tolerance=tolerance, lang=speech)
    told = {"uncertainty_mm": facts.budget.expanded / MM}
    return Made(content=content, about=record, links=links, facts=told)


def _program(work: Work, asked: Parameters, speech: Lang) -> Made:
    record = asked.item(PROGRAM, "program")
    used, first = record.linked("model"), record.linked("before")
    if not used or not first:
        raise ConfigurationError(
            f"program {record.name!r} was not compensated with a model.",
            hint="compensate it first; the report compares both.",
        )
    model = items.get(work.workspace, MODEL, used[0].id, version=used[0].version)
    before = items.get(work.workspace, PROGRAM, first[0].id, version=first[0].version)
    tolerance = _tolerance(asked, needed=True)
    paths = [_laid(work, each, name) for each, name in ((before, "before"), (record, "after"))]
    work.step("judging", 1, 4)
    content = program_report(
        paths[0],
        paths[1],
        models.laid(work.workspace, model, work.folder),
        tolerance=tolerance or 0.0,
        lang=speech,
        registered=_registered(work, record),
        simulated=_origin(work, model).simulated,
        strict=asked.flag("strict", False),
        **_force(work, record),
    )
    facts = {"verdict": verdict_word(content), "tolerance_mm": asked.number("tolerance_mm", 0.0)}
    links = (Link(role="model", to=model.ref), Link(role="before", to=before.ref))
    return Made(content=content, about=record, links=links, facts=facts)


def _registration(work: Work, asked: Parameters, speech: Lang) -> Made:
    record: RegistrationRecord = asked.item(REGISTRATION, "registration")
    (path,) = laid_out(work.workspace, record, work.folder, CELL_FILE)[:1]
    used = [
        items.get(work.workspace, MODEL, each.id, version=each.version)
        for each in record.linked("model")
    ]
    work.step("judging", 1, 4)
    simulated = any(_origin(work, each).simulated for each in used)
    content = registration_report(path, lang=speech, simulated=simulated, name=record.name)
    facts = {"verdict": verdict_word(content)}
    return Made(content=content, about=record, links=(), facts=facts)


MAKERS: Final[dict[str, Callable[[Work, Parameters, Lang], Made]]] = {
    "program": _program,
    "registration": _registration,
    "model": _certificate,
}


def _tolerance(asked: Parameters, *, needed: bool) -> float | None:
    stated = asked.number_or_none("tolerance_mm")
    if stated is None and not needed:
        return None
    if stated is None or not 0.0 < stated < float("inf"):
        raise ConfigurationError(
            f"tolerance_mm is {'not stated' if stated is None else f'{stated:g}'}, expected above "
            "0 mm.",
            hint='{"program": ..., "tolerance_mm": 0.2}',
        )
    return stated * MM


def _laid(work: Work, record: ProgramRecord, name: str) -> Path:
    """The program where a command would find it: its file, or the folder of a job of several."""
    folder = work.folder / name
    folder.mkdir()
    files = programs.laid(work.workspace, record, folder)
    return files[0]


def _registered(work: Work, record: ProgramRecord) -> Path | None:
    """The cell whose frames a compensated program uses, where that is not the model's."""
    place = record.linked("registration")
    if place:
        found = items.get(work.workspace, REGISTRATION, place[0].id, version=place[0].version)
        return laid_out(work.workspace, found, work.folder, CELL_FILE)[0]
    cell = record.linked("cell")
    if not cell:
        return None
    folder = work.folder / "cell"
    folder.mkdir()
    stored = items.get(work.workspace, CELL, cell[0].id, version=cell[0].version)
    return cells.laid(work.workspace, stored, folder)


def _force(work: Work, record: ProgramRecord) -> dict[str, Any]:
    """The process force the program was compensated for, as it was stated."""
    job = str(record.detail.get("job", ""))
    stated = jobs.status(work.workspace, job).parameters if job else {}
    return {name: stated[name] for name in ("wrench", "cutter", "start") if stated.get(name)}


def _origin(work: Work, model: ModelRecord) -> Provenance:
    """Of the measurements a model was fitted to; models of today say it themselves, too."""
    return merge(
        provenance_of_record(items.get(work.workspace, MEASUREMENT, each.id, version=each.version))
        for each in model.linked("data")
    )
