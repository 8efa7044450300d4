"""The chapter of an uncertainty budget: its lines, their sum, and what it is the uncertainty of."""

from __future__ import annotations

import numpy as np

from robotrue.core.units import MM, UM
from robotrue.report.content import Cell, ReportTable, Section
from robotrue.report.curve_plots import BudgetPlot
from robotrue.report.labels import column, columns
from robotrue.report.words import ReportTexts
from robotrue.validation.budget import COVERAGE_FACTOR, Budget, Contribution


def budget_section(budget: Budget, t: ReportTexts) -> Section:
    """Returns the chapter: table, sum, expanded uncertainty, and the lines side by side."""
    lines = budget.contributions
    counted = [c for c in lines if c.in_target]
    rows: list[tuple[Cell, ...]] = [_row(c, t) for c in lines]
    for key, value in (
        ("budget.combined", budget.combined),
        ("budget.expanded", budget.expanded),
        ("budget.combined_check", budget.combined_check),
    ):
        rows.append((t(key, k=COVERAGE_FACTOR), None, None, None, None, None, value / UM, None))
    return Section(
        title=t("budget.title"),
        text=t("budget.text", n=budget.poses, U=budget.expanded / MM),
        blocks=(
            ReportTable(
                title=t("budget.table"),
                columns=(
                    column(t, "budget.source"),
                    column(t, "budget.value", digits=1),
                    column(t, "budget.distribution"),
                    column(t, "budget.divisor", digits=3),
                    *columns(t, "budget.sensitivity", "budget.evaluation"),
                    column(t, "budget.u", "µm", 1),
                    column(t, "budget.counts"),
                ),
                rows=tuple(rows),
                caption=t("budget.caption"),
                highlight=len(lines) + 1,
            ),
            BudgetPlot(
                names=tuple(t(f"source.{c.name}") for c in counted),
                value=np.array([c.standard_uncertainty for c in counted]),
                combined=budget.combined,
                combined_name=t("budget.sum"),
                title=t("budget.plot"),
                caption=t("budget.plot_text"),
            ),
        ),
    )


def _row(c: Contribution, t: ReportTexts) -> tuple[Cell, ...]:
    length = c.unit == "m"
    return (
        t(f"source.{c.name}"),
        f"{c.value / UM:.1f} µm" if length else f"{c.value:.1f} {c.unit}",
        t(f"distribution.{c.distribution}"),
        c.divisor,
        f"{c.sensitivity:.3f}" if length else f"{c.sensitivity / UM:.3f} µm/{c.unit}",
        c.evaluation,
        c.standard_uncertainty / UM,
        t("budget.target" if c.in_target else "budget.check"),
    )
