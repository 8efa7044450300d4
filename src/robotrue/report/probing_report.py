"""The report page of a plan of touches: uncertainty over the part and against their number."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG, MM
from robotrue.planning.probing import ProbingTask
from robotrue.planning.probing_plan import ProbePlan
from robotrue.report.content import Conclusion, Fact, KeyFigure, ReportContent, ReportTable, Section
from robotrue.report.curve_plots import PoseCurves, PoseSeries
from robotrue.report.labels import axis_columns, plain_columns
from robotrue.report.map_plots import PartMap
from robotrue.robot.configuration import controller_axes
from robotrue.robot.forward import forward
from robotrue.validation.error_map import radius_95

FIRST = 3
"""Touches from which the curve is drawn: fewer fix no frame."""


SAME_SIDE = 45.0 * DEG
"""Between the tool of a touch and that of the machining, up to which both are on one side."""


def part_map(plan: ProbePlan, task: ProbingTask, tip_axis: Array) -> PartMap:
    """Returns the map of what each machined point will be known to."""
    machining = task.machining
    names = tuple(machining.groups)
    robot = task.belief.robot.nominal()
    axis = forward(robot, machining.joints)[:, :3, :3] @ tip_axis
    side = np.stack([axis[machining.groups[name]].mean(axis=0) for name in names])
    alike = (forward(robot, plan.touches.joints)[:, :3, :3] @ tip_axis) @ side.T
    drawn = np.where(alike.max(axis=1) > np.cos(SAME_SIDE), np.argmax(alike, axis=1), -1)
    return PartMap(
        groups=names,
        group=np.array([names.index(name) for name in machining.group], dtype=np.float64),
        point=machining.point,
        radius=radius_95(plan.covariance),
        touch=plan.touches.point,
        touch_group=drawn.astype(np.float64),
        uncovered=tuple(group.name for group in plan.groups if not group.covered),
        caption="Points in the part frame; rings are points probed from the side from which the "
        "tool machines there. Touches from other sides are not drawn.",
    )


def probing_content(
    plan: ProbePlan,
    task: ProbingTask,
    *,
    tip_axis: Array,
    notes: tuple[str, ...],
    source: str,
    robot: str,
    origin: Provenance,
) -> ReportContent:
    """Returns the content of the page."""
    n = len(plan.row)
    radius = radius_95(plan.covariance) / MM
    covered = not plan.warnings
    text = f"{n} touches; 95 % of the errors within {radius.max():.2f} mm at every machined point."
    if not covered:
        named = ", ".join(group.name for group in plan.groups if not group.covered)
        text = f"With {n} touches no touch covers the postures of {named}."
    return ReportContent(
        title=f"Touches of a part: {robot}",
        verdict=Conclusion(
            text=text,
            tone="plain" if covered else "caution",
            detail=f"The same number of touches spread evenly: {plan.spread_mean[n] / MM:.3f} mm "
            f"rms instead of {plan.mean[n] / MM:.3f} mm.",
        ),
        simulated=origin.simulated,
        subtitle="a plan, before any touch",
        tiles=(
            KeyFigure(label="touches", value=float(n), digits=0),
            KeyFigure(label="rms, one sigma", value=float(plan.mean[n] / MM), unit="mm"),
            KeyFigure(label="worst, 95 % within", value=float(radius.max()), unit="mm"),
            KeyFigure(label="spread, rms", value=float(plan.spread_mean[n] / MM), unit="mm"),
        ),
        sections=(
            Section(
                title="Over the part",
                blocks=(part_map(plan, task, tip_axis), _groups(plan, task)),
            ),
            Section(title="Against the number of touches", blocks=(_curve(plan),)),
            Section(title="Touches", blocks=(_touches(plan, task),)),
        ),
        doubts=(*plan.warnings, *notes),
        provenance=(Fact(name="arm", value=source),),
    )


def _curve(plan: ProbePlan) -> PoseCurves:
    n = len(plan.row)
    counts = np.arange(min(FIRST, n), n + 1)
    numbers = counts.astype(np.float64)
    return PoseCurves(
        series=(
            PoseSeries(label="planned", count=numbers, median=plan.mean[counts], role="ours"),
            PoseSeries(
                label="spread evenly over the part", count=numbers, median=plan.spread_mean[counts]
            ),
        ),
        axis_label="touches",
        title="Expected uncertainty of the machined points, rms, one sigma",
        caption="From the arm's priors only; no probing yet.",
    )


def _groups(plan: ProbePlan, task: ProbingTask) -> ReportTable:
    radius = radius_95(plan.covariance) / MM
    return ReportTable(
        title="Machined groups",
        columns=(
            *plain_columns("group", "points"),
            *plain_columns("rms, one sigma", "worst, 95 % within", "limit", unit="mm"),
            *plain_columns("covered"),
        ),
        rows=tuple(
            (
                group.name,
                group.postures,
                group.uncertainty / MM,
                float(radius[task.machining.groups[group.name]].max()),
                group.best / MM,
                "yes" if group.covered else "no",
            )
            for group in plan.groups
        ),
        caption="Limit: all candidates probed.",
    )


def _touches(plan: ProbePlan, task: ProbingTask) -> ReportTable:
    touches = plan.touches
    axes = controller_axes(task.belief.robot, touches.joints) / DEG
    return ReportTable(
        title="The touches, in the order of their information gain",
        columns=(
            *plain_columns("touch", "feature"),
            *plain_columns(*"xyz", unit="mm", digits=1),
            *axis_columns(task.belief.robot.dof),
        ),
        rows=tuple(
            (
                k + 1,
                touches.names[k],
                *(float(v) for v in touches.point[k] / MM),
                *map(float, axes[k]),
            )
            for k in range(len(touches))
        ),
        caption="Points in the part; axes as the controller displays them.",
    )
