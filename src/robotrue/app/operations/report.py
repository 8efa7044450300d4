"""Write the report of a program, a registration or a model of a workspace."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Field

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.operations.report_files import (
    ReportCalibrationRequest,
    ReportProgramRequest,
    ReportRegistrationRequest,
    draft_certificate,
    draft_program,
    draft_registration,
)
from robotrue.app.presentation import Block, Note
from robotrue.app.reported import Language, ReportDraft
from robotrue.app.request import Item, ItemVersion, Option, Reference, Request
from robotrue.app.request_fields import CertificateDetails
from robotrue.core.files import DEFAULT_LANG
from robotrue.core.provenance import Provenance
from robotrue.errors import ConfigurationError, MissingExtraError

if TYPE_CHECKING:
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.report.content import ReportContent
    from robotrue.report.words import Lang
    from robotrue.store.nouns import ModelRecord, ProgramRecord
    from robotrue.store.records import ItemRecord, Link, Ref
    from robotrue.store.workspace import Transaction

SUBJECTS: Final = ("program", "registration", "model")
FORMS: Final = ("html", "pdf", "json")
STEPS: Final = 4
KEPT: Final[Mapping[str, Mapping[str, str]]] = {
    "program": {"verdict": "verdict", "tolerance_mm": "tolerance_mm"},
    "registration": {"verdict": "verdict"},
    "model": {"uncertainty_mm": "expanded_uncertainty_mm"},
}
"""Numbers of a report that the list of reports shows, by their names there."""


class ReportRequest(Request):
    """Subject of the report: the first stated of program, registration and model."""

    program: Annotated[Reference | None, Item(noun="program")] = None
    """Compensated program to check."""
    registration: Annotated[Reference | None, Item(noun="registration")] = None
    """Registration to report."""
    model: Annotated[Reference | None, Item(noun="model")] = None
    """Model to certify."""
    measurements: Annotated[tuple[Reference, ...], Item(noun="measurement")] = ()
    """Held-out poses."""
    tolerance_mm: Annotated[float | None, Field(gt=0.0), Option(offered=(0.001, 1000.0))] = None
    """Tolerance on the position error of a target or pose."""
    lang: Language = DEFAULT_LANG
    strict: bool = False
    """Joint targets count as unproven."""
    forms: tuple[Literal["html", "pdf", "json", "xml"], ...] = ()
    """html, pdf, json, xml (DCC); default: the first three, if possible."""
    detail: CertificateDetails = ()

    @property
    def subject(self) -> str:
        """Subject of the report.

        Raises:
            ConfigurationError: None.
        """
        for name in SUBJECTS:
            if getattr(self, name) is not None:
                return name
        raise ConfigurationError(
            "nothing to report on, expected a program, a registration or a model.",
            hint='{"model": ..., "lang": "en"}',
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ItemReport:
    """The report of an item.

    Attributes:
        content: Its content.
        subject: One of :data:`SUBJECTS`.
        about: Subject of the report.
        links: What else it rests on.
        numbers: For the list of reports, JSON values.
        files: That were written.
        provenance: Of the item.
    """

    content: ReportContent
    subject: str
    about: ItemRecord
    links: tuple[Link, ...]
    numbers: Mapping[str, object]
    files: tuple[Path, ...]
    provenance: Provenance

    def document(self) -> Mapping[str, object]:
        """Returns JSON values."""
        return {
            "subject": self.subject,
            "lang": self.content.lang,
            "title": self.content.title,
            "simulated": self.content.simulated,
            "tone": self.content.verdict.tone,
            "text": self.content.verdict.text,
            **self.numbers,
        }

    def blocks(self) -> Iterable[Block]:
        """Returns the warnings of the report."""
        for warning in self.content.doubts:
            yield Note(warning)


@operation()
def run(request: ReportRequest, context: Context) -> ItemReport:
    """Writes the report in the requested formats.

    Raises:
        ConfigurationError: Nothing to report, no such language, or no workspace.
    """
    from robotrue.app.workspace_context import require_workspace
    from robotrue.report.words import language
    from robotrue.store.nouns import noun_of

    drafts = {"program": _program, "registration": _registration, "model": _certificate}
    subject, lang, place = request.subject, language(request.lang), require_workspace(context)
    about: Reference = getattr(request, subject)
    context.step("reading", 0, STEPS)
    draft, links = drafts[subject](request, about, place, lang)
    return ItemReport(
        content=draft.content,
        subject=subject,
        about=place.record(noun_of(subject), about),
        links=tuple(links),
        numbers={kept: draft.numbers[name] for kept, name in KEPT[subject].items()},
        files=tuple(_write(draft, request.forms or FORMS, subject, context)),
        provenance=draft.provenance,
    )


def _write(draft: ReportDraft, forms: Sequence[str], subject: str, context: Context) -> list[Path]:
    """Writes the requested files; a PDF that cannot be made here is skipped with a message."""
    from robotrue.report.report_files import write_reports

    context.step("laying out pages", 2, STEPS)
    content = draft.content
    name = f"{'certificate' if subject == 'model' else subject}_{content.lang}"
    written = write_reports([context.output(Path(f"{name}.html"))], content)
    if "pdf" in forms:
        context.step("laying out pages", 3, STEPS)
        try:
            written += write_reports([context.output(Path(f"{name}.pdf"))], content)
        except (MissingExtraError, ConfigurationError) as cause:
            if tuple(forms) != FORMS:  # requested by name
                raise
            context.inform(f"no PDF: {cause}")
    if "xml" in forms:
        if draft.xml is None:
            raise ConfigurationError(
                f"a report of a {subject} has no form 'xml', expected html, pdf or json.",
                hint="a Digital Calibration Certificate is made of a model.",
            )
        written += write_reports([context.output(Path(f"{name}.xml"))], content, draft.xml)
    made = {path.suffix.removeprefix("."): path for path in written}
    return [made[form] for form in (*FORMS, "xml") if form in forms and form in made]


def _certificate(
    request: ReportRequest, model: Reference, place: WorkspaceContext, lang: Lang
) -> tuple[ReportDraft, list[Link]]:
    from robotrue.store.nouns import MEASUREMENT, MODEL
    from robotrue.store.records import Link

    asked = ReportCalibrationRequest(
        model=model,
        test=request.measurements,
        output=(),
        tolerance_mm=request.tolerance_mm,
        detail=request.detail,
        simulated=_is_simulated(place, [place.record(MODEL, model)]),
    )
    draft = draft_certificate(asked, place, lang)
    data = place.records(MEASUREMENT, request.measurements)
    return draft, [Link(role="data", to=each.ref) for each in data]


def _program(
    request: ReportRequest, program: Reference, place: WorkspaceContext, lang: Lang
) -> tuple[ReportDraft, list[Link]]:
    from robotrue.app.stated_force import force_parameters
    from robotrue.store.nouns import MODEL, PROGRAM
    from robotrue.store.records import Link

    record = place.record(PROGRAM, program)
    used, first = record.refs("model"), record.refs("before")
    if not used or not first:
        raise ConfigurationError(
            f"program {record.name!r} was not compensated with a model.",
            hint="compensate it first; the report compares both.",
        )
    if request.tolerance_mm is None:
        raise ConfigurationError(
            "tolerance_mm is not stated, expected above 0 mm.",
            hint='{"program": ..., "tolerance_mm": 0.2}',
        )
    model = _pin(used[0])
    force = force_parameters(place.work.workspace, record)
    asked = ReportProgramRequest(
        before=_pin(first[0]),
        after=program,
        model=model,
        tolerance_mm=request.tolerance_mm,
        output=(),
        strict=request.strict,
        simulated=_is_simulated(place, [place.record(MODEL, model)]),
        wrench=force.wrench,
        cutter=force.cutter,
        start=force.start,
    )
    draft = draft_program(asked, place, lang, _find_registered(place, record))
    return draft, [Link(role="model", to=used[0]), Link(role="before", to=first[0])]


def _registration(
    request: ReportRequest, registration: Reference, place: WorkspaceContext, lang: Lang
) -> tuple[ReportDraft, list[Link]]:
    from robotrue.store.nouns import MODEL, REGISTRATION

    linked = place.record(REGISTRATION, registration).refs("model")
    used = [place.record(MODEL, _pin(each)) for each in linked]
    asked = ReportRegistrationRequest(
        cell=registration, output=(), simulated=_is_simulated(place, used)
    )
    return draft_registration(asked, place, lang), []


def _pin(to: Ref) -> ItemVersion:
    return ItemVersion(id=to.id, version=to.version)


def _find_registered(place: WorkspaceContext, record: ProgramRecord) -> Path | None:
    """The cell whose frames a compensated program uses, where that is not the model's."""
    for to in record.refs("registration"):
        return place.registration_file(_pin(to))
    for to in record.refs("cell"):
        return place.cell_file(_pin(to))
    return None


def _is_simulated(place: WorkspaceContext, models: Iterable[ModelRecord]) -> bool:
    """True if any model was fitted to simulated data; new models state it themselves."""
    from robotrue.store.nouns import MEASUREMENT
    from robotrue.store.records import provenance_of_record

    data = [_pin(each) for model in models for each in model.refs("data")]
    return any(provenance_of_record(each).simulated for each in place.records(MEASUREMENT, data))


@run.saves
def save(
    request: ReportRequest, result: ItemReport, into: Transaction, context: WorkspaceContext
) -> Mapping[str, object]:
    """Leaves a document ``report`` with its files, linked to what it is about and rests on."""
    from robotrue.store.records import Link

    links = [Link(role="about", to=result.about.ref), *result.links]
    return context.leave_document(
        into, "report", result.about.name, result.files, links, result.document()
    )
