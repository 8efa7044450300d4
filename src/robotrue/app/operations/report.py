"""Write the report of a program, a registration or a model of a workspace."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import Field

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.presentation import Block, Note
from robotrue.app.request import Item, Option, Reference, Request
from robotrue.core.provenance import Provenance, merge
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.report.content import ReportContent
    from robotrue.report.words import Lang
    from robotrue.store.records import Link, ModelRecord, ProgramRecord, Record, Ref
    from robotrue.store.workspace import Transaction

SUBJECTS: Final = ("program", "registration", "model")
FORMS: Final = ("html", "pdf", "json")
STEPS: Final = 4


class ReportRequest(Request):
    """What to report: the first that is stated of program, registration and model."""

    program: Annotated[
        Reference | None, Item(noun="program", help="Compensated program to judge.")
    ] = None
    registration: Annotated[
        Reference | None, Item(noun="registration", help="Registration to report.")
    ] = None
    model: Annotated[Reference | None, Item(noun="model", help="Model to certify.")] = None
    measurements: Annotated[
        tuple[Reference, ...],
        Item(noun="measurement", help="Poses the calibration has not seen."),
    ] = ()
    tolerance_mm: Annotated[
        float | None,
        Field(gt=0.0),
        Option(help="Largest distance of a target or pose from where it should be."),
    ] = None
    lang: Annotated[str, Option(help="en or zh.")] = "en"
    strict: Annotated[bool, Option(help="Axis targets count as targets that are not proven.")] = (
        False
    )
    forms: Annotated[
        tuple[Literal["html", "pdf", "json"], ...],
        Option(help="html, pdf, json; default: all that this machine can write."),
    ] = ()

    @property
    def subject(self) -> str:
        """Which of the subjects it is about.

        Raises:
            ConfigurationError: None.
        """
        for name in SUBJECTS:
            if getattr(self, name) is not None:
                return name
        raise ConfigurationError(
            "a report of nothing, expected a program, a registration or a model.",
            hint='{"model": ..., "lang": "en"}',
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """A report before it is written.

    Attributes:
        content: What it says.
        about: What it is a report of.
        links: What else it rests on.
        numbers: For the list of reports, JSON values.
    """

    content: ReportContent
    about: Record
    links: tuple[Link, ...]
    numbers: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class ItemReport:
    """The report of an item.

    Attributes:
        draft: What it says, and of what.
        subject: One of :data:`SUBJECTS`.
        files: That were written.
        provenance: Of the item.
    """

    draft: Draft
    subject: str
    files: tuple[Path, ...]
    provenance: Provenance

    def document(self) -> Mapping[str, Any]:
        """Returns JSON values."""
        content = self.draft.content
        return {
            "subject": self.subject,
            "lang": content.lang,
            "title": content.title,
            "simulated": content.simulated,
            "tone": content.verdict.tone,
            "text": content.verdict.text,
            **self.draft.numbers,
        }

    def blocks(self) -> Iterable[Block]:
        """Returns the warnings of the report."""
        for warning in self.draft.content.doubts:
            yield Note(warning)


def run(request: ReportRequest, context: Context) -> ItemReport:
    """Writes the report in the forms asked for.

    Raises:
        ConfigurationError: Nothing to report, no such language, or no workspace.
    """
    from robotrue.app.workspace_context import require_workspace
    from robotrue.report.words import language

    make = {"program": _program, "registration": _registration, "model": _certificate}
    subject, lang, place = request.subject, language(request.lang), require_workspace(context)
    context.step("reading", 0, STEPS)
    draft = make[subject](request, place, lang)
    return ItemReport(
        draft=draft,
        subject=subject,
        files=tuple(_write(draft.content, request.forms or FORMS, subject, context)),
        provenance=Provenance(simulated=draft.content.simulated),
    )


def _write(
    content: ReportContent, forms: Sequence[str], subject: str, context: Context
) -> list[Path]:
    """The files asked for; a PDF that cannot be set on this machine is left out and said so."""
    from robotrue.errors import MissingExtraError
    from robotrue.report.report_files import write_reports

    context.step("setting pages", 2, STEPS)
    name = f"{'certificate' if subject == 'model' else subject}_{content.lang}"
    written = write_reports([context.output(Path(f"{name}.html"))], content)
    if "pdf" in forms:
        context.step("setting pages", 3, STEPS)
        try:
            written += write_reports([context.output(Path(f"{name}.pdf"))], content)
        except (MissingExtraError, ConfigurationError) as cause:
            if tuple(forms) != FORMS:  # asked for by name
                raise
            context.inform(f"no PDF: {cause}")
    made = {path.suffix.removeprefix("."): path for path in written}
    return [made[form] for form in FORMS if form in forms and form in made]


def _certificate(request: ReportRequest, place: WorkspaceContext, lang: Lang) -> Draft:
    from robotrue.report.certificate import certificate_content
    from robotrue.report.certificate_facts import certificate_facts
    from robotrue.store.nouns import MEASUREMENT, MODEL
    from robotrue.store.records import Link

    model = _stated(request.model)
    record, held = place.record(MODEL, model), place.model(model)
    rows = place.measurements(held.cell, request.measurements) if request.measurements else None
    path = place.model_file(model)
    place.step("judging", 1, STEPS)
    facts = certificate_facts(
        held.model,
        held.cell,
        rows,
        simulated=_origin(place, record).simulated,
        files=[("fact.model", path)],
        lang=lang,
    )
    tolerance = None if request.tolerance_mm is None else request.tolerance_mm * MM
    return Draft(
        content=certificate_content(facts, tolerance=tolerance, lang=lang),
        about=record,
        links=tuple(
            Link(role="data", to=each.ref)
            for each in place.records(MEASUREMENT, request.measurements)
        ),
        numbers={"uncertainty_mm": facts.budget.expanded / MM},
    )


def _program(request: ReportRequest, place: WorkspaceContext, lang: Lang) -> Draft:
    from robotrue.app.report_contents import program_report, verdict_word
    from robotrue.store import items, models
    from robotrue.store.nouns import MODEL, PROGRAM
    from robotrue.store.records import Link

    workspace, record = place.work.workspace, place.record(PROGRAM, _stated(request.program))
    used, first = record.linked("model"), record.linked("before")
    if not used or not first:
        raise ConfigurationError(
            f"program {record.name!r} was not compensated with a model.",
            hint="compensate it first; the report compares both.",
        )
    model = items.get(workspace, MODEL, used[0].id, version=used[0].version)
    before = items.get(workspace, PROGRAM, first[0].id, version=first[0].version)
    if request.tolerance_mm is None:
        raise ConfigurationError(
            "tolerance_mm is not stated, expected above 0 mm.",
            hint='{"program": ..., "tolerance_mm": 0.2}',
        )
    paths = [_laid(place, each, name) for each, name in ((before, "before"), (record, "after"))]
    place.step("judging", 1, STEPS)
    content = program_report(
        paths[0],
        paths[1],
        models.laid(workspace, model, place.work.folder),
        tolerance=request.tolerance_mm * MM,
        lang=lang,
        registered=_registered(place, record),
        simulated=_origin(place, model).simulated,
        strict=request.strict,
        **_force(place, record),
    )
    return Draft(
        content=content,
        about=record,
        links=(Link(role="model", to=model.ref), Link(role="before", to=before.ref)),
        numbers={"verdict": verdict_word(content), "tolerance_mm": request.tolerance_mm},
    )


def _registration(request: ReportRequest, place: WorkspaceContext, lang: Lang) -> Draft:
    from robotrue.app.report_contents import registration_report, verdict_word
    from robotrue.store import items
    from robotrue.store.nouns import MODEL, REGISTRATION

    registration = _stated(request.registration)
    record, path = place.record(REGISTRATION, registration), place.registration_file(registration)
    used = [
        items.get(place.work.workspace, MODEL, each.id, version=each.version)
        for each in record.linked("model")
    ]
    place.step("judging", 1, STEPS)
    simulated = any(_origin(place, each).simulated for each in used)
    content = registration_report(path, lang=lang, simulated=simulated, name=record.name)
    numbers = {"verdict": verdict_word(content)}
    return Draft(content=content, about=record, links=(), numbers=numbers)


def _stated(reference: Reference | None) -> Reference:
    """The subject of a report, which is there when its report is made."""
    if reference is None:
        raise ConfigurationError("a report of nothing.")
    return reference


def _laid(place: WorkspaceContext, record: ProgramRecord, name: str) -> Path:
    """The program where a command would find it: its file, or the first of a job of several."""
    from robotrue.store import programs

    return programs.laid(place.work.workspace, record, place.folder(name))[0]


def _registered(place: WorkspaceContext, record: ProgramRecord) -> Path | None:
    """The cell whose frames a compensated program uses, where that is not the model's."""
    from robotrue.store import cells, items
    from robotrue.store.layout import laid_out
    from robotrue.store.nouns import CELL, REGISTRATION
    from robotrue.store.registrations import CELL_FILE

    workspace = place.work.workspace
    for to in record.linked("registration"):
        found = items.get(workspace, REGISTRATION, to.id, version=to.version)
        return laid_out(workspace, found, place.work.folder, CELL_FILE)[0]
    for to in record.linked("cell"):
        stored = items.get(workspace, CELL, to.id, version=to.version)
        return cells.laid(workspace, stored, place.folder("cell"))
    return None


def _force(place: WorkspaceContext, record: ProgramRecord) -> dict[str, Any]:
    """The process force the program was compensated for, as it was stated."""
    from robotrue.store import jobs

    job = str(record.detail.get("job", ""))
    stated = jobs.status(place.work.workspace, job).parameters if job else {}
    return {name: stated[name] for name in ("wrench", "cutter", "start") if stated.get(name)}


def _origin(place: WorkspaceContext, model: ModelRecord) -> Provenance:
    """Of the measurements a model was fitted to; models of today say it themselves, too."""
    from robotrue.store import items
    from robotrue.store.nouns import MEASUREMENT
    from robotrue.store.provenance import provenance_of_record

    def data(to: Ref) -> Record:
        return items.get(place.work.workspace, MEASUREMENT, to.id, version=to.version)

    return merge(provenance_of_record(data(each)) for each in model.linked("data"))


def save(
    request: ReportRequest, result: ItemReport, into: Transaction, context: WorkspaceContext
) -> Mapping[str, Any]:
    """Leaves a document ``report`` with its files, linked to what it is about and rests on."""
    from robotrue.store.records import Link

    about = result.draft.about
    links = [Link(role="about", to=about.ref), *result.draft.links]
    return context.leave_document(
        into, "report", about.name, result.files, links, result.document()
    )


OPERATION: Final = Operation(request=ReportRequest, run=run, save=save)
