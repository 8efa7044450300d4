"""Report commands: their common options, and their written files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

from robotrue.app.context import Context
from robotrue.app.outputs import check_output
from robotrue.app.presentation import PlainResult
from robotrue.app.request import Option, Output, Request, input_paths
from robotrue.app.request_fields import OUTPUT
from robotrue.core.provenance import Provenance
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.report.content import ReportContent
    from robotrue.report.words import Lang

Outputs: TypeAlias = Annotated[
    tuple[Path, ...],
    Output(
        names=OUTPUT,
        help=".html, .pdf or .json; may be repeated. JSON is always written, too.",
    ),
]
Language: TypeAlias = Annotated[str, Option(names=("--lang",), help="en or zh.")]
Simulated: TypeAlias = Annotated[bool, Option(help="Mark the report as simulated.")]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportDraft:
    """A report before it is written.

    Attributes:
        content: Its content.
        numbers: Of it, for ``--json``.
        provenance: Of what it rests on.
        xml: Makes its Digital Calibration Certificate; None for what has none.
    """

    content: ReportContent
    numbers: Mapping[str, object]
    provenance: Provenance
    xml: Callable[[], bytes] | None = None


def check_reports(
    outputs: Sequence[Path], sources: Sequence[Path], *, certificate: bool = False
) -> None:
    """Refuses, before any work is done, invalid outputs.

    Raises:
        ConfigurationError: Another ending than ``.html``, ``.pdf``, ``.json``, or a file or folder
            :func:`check_output` refuses.
    """
    from robotrue.report.report_files import SUFFIXES, XML, json_twin

    allowed = (*SUFFIXES, XML) if certificate else SUFFIXES
    for output in outputs:
        if output.suffix.lower() not in allowed:
            raise ConfigurationError(
                f"a report is {', '.join(allowed)}, not {output.suffix or 'without an ending'!r}.",
                source=output,
                hint=f"-o {output.with_suffix('.html').name}",
            )
        check_output(output, sources)
        check_output(json_twin(output), sources)


def check_report_request(
    request: Request, outputs: Sequence[Path], lang: str, *, certificate: bool = False
) -> Lang:
    """Refuses, before any work is done, what cannot be; returns the language of the report.

    Raises:
        ConfigurationError: As :func:`check_reports`, or no such language.
    """
    from robotrue.report.words import language

    check_reports(outputs, input_paths(request), certificate=certificate)
    return language(lang)


def write_draft(draft: ReportDraft, outputs: Sequence[Path], context: Context) -> PlainResult:
    """Writes a report and reports its path."""
    from robotrue.report.report_files import write_reports

    files = [context.output(path) for path in outputs]
    written = write_reports(files, draft.content, draft.xml)
    context.inform(f"report written to {', '.join(str(path) for path in written)}")
    values = {"written": [str(path) for path in written], **draft.numbers}
    return PlainResult(values=values, provenance=draft.provenance)


def draft_verdict(content: ReportContent, **numbers: object) -> ReportDraft:
    """Returns the draft of a report whose verdict is GO or NO-GO."""
    word = "GO" if content.verdict.tone == "good" else "NO-GO"
    return ReportDraft(
        content=content,
        numbers={"verdict": word, "text": content.verdict.text, **numbers},
        provenance=Provenance(simulated=content.simulated),
    )
