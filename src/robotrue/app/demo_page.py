"""Page of the virtual demo: the paper's Tables 8, 9 and 11 next to ours."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.compensation.result import Compensation
from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.report.calibration_report import calibration_content
from robotrue.report.content import (
    Conclusion,
    Fact,
    KeyFigure,
    ReportContent,
    ReportTable,
    Section,
    TableColumn,
)
from robotrue.report.demo_result import Chosen, HoleRuns, lengths_mm, statistics_mm
from robotrue.report.plots import HoleContour, PointErrors
from robotrue.simulation.flange_hole import FlangeHole
from robotrue.validation.hole_contour import HoleResult
from robotrue.validation.report import ValidationReport

_STATS: Final = tuple(TableColumn(title=t, unit="mm") for t in ("mean", "max", "std. dev."))
PAPER: Final = "Deng et al. 2022, measured"
OURS: Final = "robotrue, SIMULATED"


def demo_tables(
    report: ValidationReport, runs: HoleRuns
) -> tuple[ReportTable, ReportTable, ReportTable]:
    """Returns the three tables; the paper's rows were measured on another, real robot."""
    return (
        ReportTable(
            title="As Table 8: held-out poses",
            columns=(TableColumn(title=""), TableColumn(title="source"), *_STATS),
            rows=(
                ("before", PAPER, 1.499, 2.626, 0.542),
                ("after, Tr-GPR with 206 poses, re-measured", PAPER, 0.182, 0.454, 0.086),
                ("before", OURS, *_three(report.errors_before)),
                ("after calibration, predicted", OURS, *_three(report.errors_after)),
            ),
            caption="Poses not used in the fit. The two robots differ: compare sizes, not digits.",
            highlight=3,
        ),
        ReportTable(
            title="As Table 9: dry run, 39 targets on the hole's path",
            columns=(TableColumn(title=""), TableColumn(title="source"), *_STATS),
            rows=(
                ("before", PAPER, 1.459, 1.892, 0.277),
                ("after", PAPER, 0.205, 0.393, 0.106),
                ("before", OURS, *_three(runs.dry_before)),
                ("after, program compensated", OURS, *_three(runs.dry_after)),
            ),
            caption="Re-measured: the compensated program ran on the virtual robot.",
            highlight=3,
        ),
        ReportTable(
            title="As Table 11: milled hole, position of its axis and contour",
            columns=(
                TableColumn(title=""),
                TableColumn(title="source"),
                *(
                    TableColumn(title=t, unit="mm")
                    for t in ("x", "y", "position", "contour", "max", "sd")
                ),
            ),
            rows=(
                ("after", PAPER, 0.144, 0.298, 0.331, 0.269, 0.461, 0.071),
                ("before", OURS, *_hole(runs.hole_before)),
                ("after, program compensated", OURS, *_hole(runs.hole_after)),
            ),
            caption=(
                "Contour: size of the distance from the fitted axis minus the nominal radius; the "
                "paper does not define it. Cutting force is a mean force with assumed pressures."
            ),
            highlight=2,
        ),
    )


def demo_results(
    seed: int,
    chosen: Chosen,
    report: ValidationReport,
    runs: HoleRuns,
    compensation: Compensation,
) -> dict[str, object]:
    """Returns the results as JSON values, units in the names."""
    return {
        "simulated": True,
        "seed": seed,
        "robot": "virtual KUKA KR160 R1570 with spindle",
        "method": chosen.selection.winner,
        "reason": chosen.selection.reason,
        "held_out": {
            "before": statistics_mm(report.before),
            "after": statistics_mm(report.after),
            "coverage_95": report.coverage.share,
        },
        "dry_run": {"before": lengths_mm(runs.dry_before), "after": lengths_mm(runs.dry_after)},
        "hole": {
            "before": _hole_values(runs.hole_before),
            "after": _hole_values(runs.hole_after),
        },
        "program": dict(compensation.summary()),
        "paper": {
            "held_out_mean_mm": {"before": 1.499, "after": 0.182},
            "dry_run_mean_mm": {"before": 1.459, "after": 0.205},
            "hole": {"position_mm": 0.331, "contour_mean_mm": 0.269},
        },
    }


def demo_content(
    *,
    seed: int,
    hole: FlangeHole,
    chosen: Chosen,
    report: ValidationReport,
    runs: HoleRuns,
    tables: tuple[ReportTable, ReportTable, ReportTable],
) -> ReportContent:
    """Returns the page: the job first, then its calibration."""
    summary = chosen.model.training_summary()
    calibration = calibration_content(
        report,
        title="",
        simulated=True,
        selection=chosen.selection,
        unseen=[f"{u.name}: {u.cure}" for u in summary.unseen],
    )
    dry, after = np.linalg.norm(runs.dry_before, axis=1), np.linalg.norm(runs.dry_after, axis=1)
    sections = (
        _describe_job(hole, runs, tables),
        Section(title="Poses not used in the fit", blocks=(tables[0],)),
        *calibration.sections,
    )
    return ReportContent(
        title="Virtual KR160 with spindle: flange hole, 210 mm",
        subtitle=f"simulated cell, seed {seed}",
        simulated=True,
        verdict=Conclusion(
            text=(
                f"SIMULATED: the compensated program lands within {after.mean() / MM:.3f} mm "
                f"(mean) of its targets, {dry.mean() / MM:.3f} mm before."
            ),
            tone="good" if after.mean() < dry.mean() else "bad",
            detail=f"Method {chosen.selection.winner}, chosen on held-out poses.",
        ),
        tiles=(
            _tile("dry run, mean", after.mean(), dry.mean()),
            _tile("dry run, max", after.max(), dry.max()),
            _tile("hole position", runs.hole_after.position, runs.hole_before.position),
            _tile("held-out mean", report.after.mean, report.before.mean),
        ),
        sections=sections,
        unseen=calibration.unseen,
        doubts=(
            "The robot, the tracker and the cutting force are simulated; masses, spindle and "
            "cutting pressures are assumed.",
            *calibration.doubts,
        ),
        provenance=(Fact(name="seed", value=str(seed)), *calibration.provenance),
    )


def _describe_job(
    hole: FlangeHole, runs: HoleRuns, tables: tuple[ReportTable, ReportTable, ReportTable]
) -> Section:
    dry, after = np.linalg.norm(runs.dry_before, axis=1), np.linalg.norm(runs.dry_after, axis=1)
    return Section(
        title="The job",
        text=(
            "A 210 mm flange hole in a 30 mm plate. The program was compensated, then run "
            "again on the virtual robot: dry with the tracker on the tool, and cutting."
        ),
        blocks=(
            tables[1],
            PointErrors(before=dry, after=after, axis_label="check target"),
            tables[2],
            contour_plot(hole, runs),
        ),
    )


def contour_plot(hole: FlangeHole, runs: HoleRuns) -> HoleContour:
    """Returns the plot of the wall at one depth, before and after."""
    count = len(runs.hole_after.angle) // hole.levels
    middle = slice((hole.levels // 2) * count, (hole.levels // 2 + 1) * count)
    return HoleContour(
        radius=0.5 * hole.diameter,
        angle=runs.hole_after.angle[middle],
        before=runs.hole_before.deviation[middle],
        after=runs.hole_after.deviation[middle],
        caption="Radial deviation from the nominal hole in its nominal place, half-way down.",
    )


def _three(errors: Array) -> tuple[float, float, float]:
    values = lengths_mm(errors)
    return float(values["mean_mm"]), float(values["max_mm"]), float(values["std_mm"])


def _hole(result: HoleResult) -> tuple[float, ...]:
    size = np.abs(result.contour)
    x, y = result.position_error
    values = (x, y, result.position, size.mean(), size.max(), size.std())
    return tuple(float(v) / MM for v in values)


def _hole_values(result: HoleResult) -> dict[str, float]:
    names = ("x_mm", "y_mm", "position_mm", "contour_mean_mm", "contour_max_mm", "contour_std_mm")
    values = dict(zip(names, _hole(result), strict=True))
    values["diameter_error_mm"] = 2.0 * float(np.mean(result.contour)) / MM
    values["form_mean_mm"] = float(np.abs(result.form).mean()) / MM
    return values


def _tile(label: str, value: float, before: float) -> KeyFigure:
    return KeyFigure(
        label=label, value=float(value) / MM, unit="mm", before=float(before) / MM,
        note="simulated",
    )  # fmt: skip
