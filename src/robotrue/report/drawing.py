"""The drawing of each kind of block, chosen in one place for page and print."""

from __future__ import annotations

from robotrue.report.budget_plot import BudgetPlot, budget_svg
from robotrue.report.content import (
    Block,
    CoveragePlot,
    ErrorDistribution,
    ErrorMap,
    HoleContour,
    MapSlices,
    PointErrors,
    PoseCurves,
    Table,
)
from robotrue.report.map_figure import slices_svg
from robotrue.report.part_map import PartMap, part_map_svg
from robotrue.report.plots import (
    coverage_svg,
    distribution_svg,
    hole_svg,
    map_svg,
    point_errors_svg,
)
from robotrue.report.tilt_plot import TiltPlot, tilt_svg
from robotrue.report.transfer_curve import pose_curves_svg
from robotrue.report.uncertainty_map import UncertaintyMap, uncertainty_svg
from robotrue.report.words import Words


def block_svg(block: Block, key: str, words: Words) -> str:
    """Returns the drawing of a block as an SVG element; empty for a table.

    Args:
        block: Of a section.
        key: Prefix of its ids.
        words: For what the drawing says itself.
    """
    match block:
        case Table():
            return ""
        case PointErrors():
            return point_errors_svg(block, key, words)
        case ErrorDistribution():
            return distribution_svg(block, key, words)
        case ErrorMap():
            return map_svg(block, key, words)
        case CoveragePlot():
            return coverage_svg(block, key, words)
        case HoleContour():
            return hole_svg(block, key, words)
        case PoseCurves():
            return pose_curves_svg(block, key)
        case MapSlices():
            return slices_svg(block, key)
        case PartMap():
            return part_map_svg(block, key)
        case TiltPlot():
            return tilt_svg(block, key, words)
        case BudgetPlot():
            return budget_svg(block, key, words)
        case UncertaintyMap():
            return uncertainty_svg(block, key, words)
