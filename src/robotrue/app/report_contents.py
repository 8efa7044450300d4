"""What reports of programs and registrations say, made from their files."""

from __future__ import annotations

from pathlib import Path

from robotrue.app.force_options import read_force_options
from robotrue.app.program_differences import differences
from robotrue.app.registered import opened, provenance_used
from robotrue.cell.config import read_cell
from robotrue.compensation.stance import start_joints
from robotrue.errors import ConfigurationError
from robotrue.report.calibration_report import fact
from robotrue.report.content import ReportContent
from robotrue.report.program_report import program_content
from robotrue.report.registration_report import registration_content
from robotrue.report.report_files import file_fact
from robotrue.report.words import Lang, Words


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
    pushed = read_force_options(cell, wrench, force, cutter)
    found = differences(before, after, cell, model, pushed, home)
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


def registration_report(
    cell_path: Path, *, lang: Lang, simulated: bool, name: str | None = None
) -> ReportContent:
    """Returns the content of the report of a registered cell.

    Args:
        cell_path: What ``robotrue register`` wrote.
        lang: Language of the report.
        simulated: Whether the data are; also taken from the provenance of the part frame.
        name: Of the registration in the report; None: that of the file.

    Raises:
        ConfigurationError: A cell without a part frame.
    """
    cell = read_cell(cell_path)
    if cell.part is None:
        raise ConfigurationError(
            "the cell is not registered: it has no part frame.",
            source=cell_path,
            hint="robotrue register CELL|MODEL POINTS -o CELL_OUT.",
        )
    return registration_content(
        cell.part,
        name=name or cell_path.name,
        robot=cell.robot.name,
        simulated=simulated or cell.part.provenance.simulated,
        provenance=[fact(Words(lang=lang), "fact.cell", file_fact(cell_path))],
        lang=lang,
    )
