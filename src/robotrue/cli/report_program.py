"""``robotrue report program``: GO or NO-GO of a compensated program."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robotrue.cli.console import emit_json
from robotrue.cli.diff import differences
from robotrue.cli.process_force import described
from robotrue.cli.registered import opened
from robotrue.cli.report_output import check_reports, file_fact, write_reports
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.report.calibration import fact
from robotrue.report.program import program_content
from robotrue.report.words import Words, language


def run(
    before: Path,
    after: Path,
    model_path: Path,
    outputs: Sequence[Path],
    *,
    tolerance_mm: float,
    lang: str,
    registered: Path | None,
    wrench: str | None,
    force: Path | None,
    cutter: str | None,
    simulated: bool,
    strict: bool,
    as_json: bool,
) -> None:
    """Writes the report; exits like any command whatever the verdict: it is in the report."""
    files = [p for p in (before, after, model_path, registered, force) if p is not None]
    check_reports(outputs, files)
    speech = language(lang)
    cell, model = opened(model_path, registered)
    if model is None:
        raise ConfigurationError(
            "the nominal arm predicts no errors.",
            source=model_path,
            hint="--model MODEL, a file of `robotrue calibrate`.",
        )
    found = differences(before, after, cell, model, described(cell, wrench, force, cutter))
    summary = model.training_summary()
    t = Words(lang=speech)
    content = program_content(
        found,
        robot=model.robot.name,
        before=before.name,
        after=after.name,
        tolerance=tolerance_mm * MM,
        simulated=simulated
        or any("simulated" in str(s).lower() for s in summary.get("sources", ())),
        doubts=[str(d) for d in summary.get("doubts", ())],
        provenance=[
            *(fact(t, "fact.program", file_fact(p)) for p in (before, after)),
            fact(t, "fact.model", file_fact(model_path)),
            *(fact(t, "fact.cell", file_fact(p)) for p in (registered,) if p is not None),
            *(fact(t, "fact.force", file_fact(p)) for p in (force,) if p is not None),
            *(fact(t, "fact.force", w) for w in (wrench,) if w is not None),
        ],
        lang=speech,
        strict=strict,
    )
    written = write_reports(outputs, content)
    if as_json:
        emit_json(
            {
                "written": [str(path) for path in written],
                "verdict": "GO" if content.verdict.tone == "good" else "NO-GO",
                "text": content.verdict.text,
                "tolerance_mm": tolerance_mm,
            }
        )
