"""``robotrue report program``: GO or NO-GO of a compensated program."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robotrue.app.force_options import read_force_options
from robotrue.app.registered import opened, provenance_used
from robotrue.cli.console import emit_json, say_mark
from robotrue.cli.report_output import check_reports, file_fact, write_reports
from robotrue.compensation.job_difference import compare_jobs
from robotrue.compensation.stance import start_joints
from robotrue.core.provenance import Provenance
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.report.calibration_report import fact
from robotrue.report.content import ReportContent
from robotrue.report.program_report import program_content
from robotrue.report.words import Lang, Words, language


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
    start: str | None,
    simulated: bool,
    strict: bool,
    as_json: bool,
) -> None:
    """Writes the report; exits like any command whatever the verdict: it is in the report."""
    files = [p for p in (before, after, model_path, registered, force) if p is not None]
    check_reports(outputs, files)
    content = program_report(
        before,
        after,
        model_path,
        tolerance=tolerance_mm * MM,
        lang=language(lang),
        registered=registered,
        wrench=wrench,
        force=force,
        cutter=cutter,
        start=start,
        simulated=simulated,
        strict=strict,
    )
    origin = Provenance(simulated=content.simulated)
    say_mark(origin)
    written = write_reports(outputs, content)
    if as_json:
        emit_json(
            {
                "written": [str(path) for path in written],
                "verdict": verdict_word(content),
                "text": content.verdict.text,
                "tolerance_mm": tolerance_mm,
            },
            origin,
        )


def program_report(
    before: Path,
    after: Path,
    model_path: Path,
    *,
    tolerance: float,
    lang: Lang,
    registered: Path | None = None,
    wrench: str | None = None,
    force: Path | None = None,
    cutter: str | None = None,
    start: str | None = None,
    simulated: bool = False,
    strict: bool = False,
) -> ReportContent:
    """Returns the content of the report about a compensated program.

    Args:
        before: Program as CAM made it, a file or the folder of a job.
        after: The compensated one.
        model_path: Model file, or a registered cell.
        tolerance: m, largest distance of a target from where it should be.
        lang: Language of the report.
        registered: Cell whose frames the program uses.
        wrench: Process force, as for ``robotrue compensate``.
        force: Process force along the path.
        cutter: Axis of the tool from spindle to tip, for ``force``.
        start: Start posture, as for ``robotrue compensate``.
        simulated: Whether the data are; also taken from the provenance of model and part frame.
        strict: Whether axis targets count as targets that are not proven.

    Raises:
        ConfigurationError: The nominal arm, or a tolerance that is not above zero.
        ModelMismatchError: Programs that do not belong together, or no target to judge.
    """
    cell, model = opened(model_path, registered)
    if model is None:
        raise ConfigurationError(
            "the nominal arm predicts no errors.",
            source=model_path,
            hint="--model MODEL, a file of `robotrue calibrate`.",
        )
    home = start_joints(cell.robot, cell.controller.start, start)
    stated = read_force_options(cell, wrench, force, cutter)
    found = compare_jobs([before], [after], cell, model, stated, home)
    summary = model.training_summary()
    t = Words(lang=lang)
    return program_content(
        found,
        robot=model.robot.name,
        before=before.name,
        after=after.name,
        tolerance=tolerance,
        simulated=simulated or provenance_used(cell, model).simulated,
        doubts=list(summary.warnings),
        provenance=[
            *(
                fact(t, "fact.program", file_fact(p))
                for job in (before, after)
                for p in files_of(job)
            ),
            fact(t, "fact.model", file_fact(model_path)),
            *(fact(t, "fact.cell", file_fact(p)) for p in (registered,) if p is not None),
            *(fact(t, "fact.force", file_fact(p)) for p in (force,) if p is not None),
            *(fact(t, "fact.force", w) for w in (wrench,) if w is not None),
        ],
        lang=lang,
        strict=strict,
    )


def verdict_word(content: ReportContent) -> str:
    """Returns GO or NO-GO."""
    return "GO" if content.verdict.tone == "good" else "NO-GO"


def files_of(job: Path) -> list[Path]:
    """Returns the files of a job: those of its folder, or the one it is."""
    return sorted(p for p in job.iterdir() if p.is_file()) if job.is_dir() else [job]
