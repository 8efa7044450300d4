"""The report page of a plan: accuracy against number of poses, and what was rejected."""

from __future__ import annotations

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG, MM
from robotrue.planning.pose_plan import PosePlan
from robotrue.report.content import (
    Conclusion,
    Fact,
    KeyFigure,
    ReportContent,
    ReportTable,
    Section,
    TableColumn,
)
from robotrue.report.curve_plots import PoseCurves, PoseSeries
from robotrue.report.page import report_html

FIRST = 4
"""Poses from which the curve is drawn: fewer do not fix base and tool."""


def plan_page(cell: Cell, plan: PosePlan, origin: Provenance) -> str:
    """Returns the page (HTML); ``origin`` is that of the model the plan starts from."""
    n, expected = len(plan), plan.expected
    return report_html(
        ReportContent(
            title=f"Poses to measure: {cell.robot.name}",
            verdict=Conclusion(
                text=f"{n} poses, expected mean error {expected.mean[n] / MM:.3f} mm where the "
                "arm will work.",
                detail=f"Criterion {plan.criterion}; as many random poses "
                f"{expected.random_mean[n] / MM:.3f} mm.",
            ),
            simulated=origin.simulated,
            subtitle="a plan, before any measurement",
            tiles=(
                KeyFigure(label="planned", value=float(expected.mean[n] / MM), unit="mm"),
                KeyFigure(label="random", value=float(expected.random_mean[n] / MM), unit="mm"),
                KeyFigure(label="floor", value=expected.floor_mean / MM, unit="mm"),
            ),
            sections=(
                Section(title="Accuracy", blocks=(draw_accuracy_curve(plan),)),
                Section(title="Candidates", blocks=(_list_rejected(plan),)),
                Section(title="Poses", blocks=(_list_poses(plan),)),
            ),
            doubts=plan.notes,
            provenance=(
                Fact(name="cell", value=f"{cell.source} sha256:{cell.digest}"),
                Fact(name="seed", value=str(plan.seed)),
            ),
        )
    )


def draw_accuracy_curve(plan: PosePlan) -> PoseCurves:
    """The expected error against the number of poses, planned and at random."""
    n, expected = len(plan), plan.expected
    counts = np.arange(min(FIRST, n), n + 1)
    poses_axis = counts.astype(np.float64)
    return PoseCurves(
        series=(
            PoseSeries(
                label="planned", count=poses_axis, median=expected.mean[counts], role="ours"
            ),
            PoseSeries(
                label="random, from the same candidates",
                count=poses_axis,
                median=expected.random_mean[counts],
                low=expected.random_low[counts],
                high=expected.random_high[counts],
            ),
        ),
        floor=expected.floor_mean,
        title="Expected mean error against the number of poses",
        caption="From the arm's type and the instrument alone; nothing was measured.",
    )


def _list_rejected(plan: PosePlan) -> ReportTable:
    return ReportTable(
        title="Why postures were left out",
        columns=(TableColumn(title="reason"), TableColumn(title="postures", digits=0)),
        rows=(*plan.rejected, ("kept as candidates", plan.candidates), ("drawn", plan.drawn)),
    )


def _list_poses(plan: PosePlan) -> ReportTable:
    return ReportTable(
        title="The poses, in the order of measuring",
        columns=(
            TableColumn(title="pose"),
            *(
                TableColumn(title=f"j{i + 1}", unit="deg", digits=2)
                for i in range(plan.joints.shape[1])
            ),
            *(TableColumn(title=axis, unit="mm", digits=1) for axis in "xyz"),
            TableColumn(title="load"),
            TableColumn(title="worth, place"),
        ),
        rows=tuple(
            (
                k + 1,
                *(float(v) for v in plan.joints[k] / DEG),
                *(float(v) for v in plan.position[k] / MM),
                int(plan.load[k]),
                int(plan.rank[k]) + 1,
            )
            for k in range(len(plan))
        ),
        caption="Joints in the sense of the robot model; x, y, z as the controller computes them.",
    )
