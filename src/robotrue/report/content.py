"""What a report says, before anyone decides how it looks.

A page and a JSON file are two views of the same :class:`ReportContent`. Whoever has results builds
one (:func:`robotrue.report.calibration_report.calibration_content` does it for a validation) and
hands it to :func:`robotrue.report.page.report_html` and :func:`robotrue.report.json.report_json`::

    content = ReportContent(
        title="Flange hole, 210 mm",
        verdict=Verdict(tone="good", text="Lands within 0.21 mm (mean) of where CAM said."),
        simulated=True,
        tiles=(Tile(label="mean error", value=0.205, unit="mm", before=1.459),),
        sections=(Section(title="Dry run", blocks=(table, PointErrors(...), HoleContour(...))),),
        provenance=(Fact(name="seed", value="7"),),
    )

Arrays are SI like everywhere; tiles and tables hold numbers in the unit they name beside them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.errors import ShapeError
from robotrue.report.budget_plot import BudgetPlot
from robotrue.report.part_map import PartMap
from robotrue.report.tilt_plot import TiltPlot
from robotrue.report.uncertainty_map import UncertaintyMap
from robotrue.report.words import Lang

Tone: TypeAlias = Literal["good", "caution", "bad", "plain"]
"""How a statement is coloured: as asked, look closer, not as asked, no judgement."""
Cell: TypeAlias = str | int | float | None
"""One table cell; floats are printed with the digits of their column, None as a dash."""
Plane: TypeAlias = Literal["xy", "xz", "yz"]

PLANES: Final = ("xy", "xz", "yz")


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """The one line a reader takes home.

    Attributes:
        text: One sentence with the number in it.
        tone: Its colour.
        detail: A second, smaller sentence: on what data, by which rule.
    """

    text: str
    tone: Tone = "plain"
    detail: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tile:
    """One key number.

    Attributes:
        label: What it is, two to four words.
        value: The number, in ``unit``.
        unit: ``"mm"``, ``"%"``, ``"deg"``, or empty.
        digits: Decimals printed.
        before: The same number before compensation, printed small beside it; None to leave out.
        note: A few words below, e.g. ``"220 held-out poses"``.
        tone: Colour of the number.
        key: Name in JSON, English in every language; the label if empty.
    """

    label: str
    value: float
    unit: str = ""
    digits: int = 3
    before: float | None = None
    note: str = ""
    tone: Tone = "plain"
    key: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class TableColumn:
    """One table column.

    Attributes:
        title: Heading.
        unit: Unit of its numbers, printed after the heading; empty for words and counts.
        digits: Decimals of its floats.
        key: Name in JSON, English in every language; the title if empty.
    """

    title: str
    unit: str = ""
    digits: int = 3
    key: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table with a heading.

    Attributes:
        title: Heading.
        columns: One per cell of each row.
        rows: Cells, floats in the unit of their column.
        caption: What to read in it, one sentence.
        highlight: Row index to set off (the chosen method), None for none.
    """

    title: str
    columns: tuple[TableColumn, ...]
    rows: tuple[tuple[Cell, ...], ...]
    caption: str = ""
    highlight: int | None = None

    def __post_init__(self) -> None:
        """Checks that every row has one cell per column."""
        for index, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise ShapeError(
                    f"table {self.title!r}: row {index} has {len(row)} cells, "
                    f"expected {len(self.columns)}."
                )


@dataclass(frozen=True, slots=True, kw_only=True)
class PointErrors(Columns):
    """Plot of the error length at each point, before and after, in row order.

    Attributes:
        before: (n,) m.
        after: (n,) m.
        title: Heading.
        caption: One sentence.
        axis_label: What is counted along the axis.
        limit: A tolerance in m to draw as a line, None for none.
    """

    before: Annotated[Array, Column("n", unit="m")]
    after: Annotated[Array, Column("n", unit="m")]
    title: str = "Error at every point"
    caption: str = ""
    axis_label: str = "point"
    limit: float | None = None

    def _check_rules(self) -> None:
        """Checks that there is a point."""
        _require_points(self, len(self.before))


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorDistribution(Columns):
    """Plot of the histogram and the cumulative share of error lengths, before and after.

    Attributes:
        before: (n,) m.
        after: (n,) m.
        title: Heading.
        caption: One sentence.
    """

    before: Annotated[Array, Column("n", unit="m")]
    after: Annotated[Array, Column("n", unit="m")]
    title: str = "How the errors are distributed"
    caption: str = ""

    def _check_rules(self) -> None:
        """Checks that there is a point."""
        _require_points(self, len(self.before))


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorMap(Columns):
    """Plot of error arrows at their places, before and after side by side.

    Attributes:
        position: (n, 3) m, where, in ``frame``.
        before: (n, 3) m, actual minus commanded.
        after: (n, 3) m.
        plane: Which two axes are drawn.
        magnification: Arrow length over error length; stated in the plot.
        frame: Whose axes, for the labels.
        title: Heading.
        caption: One sentence.
    """

    position: Annotated[Array, Column("n 3", unit="m")]
    before: Annotated[Array, Column("n 3", unit="m")]
    after: Annotated[Array, Column("n 3", unit="m")]
    plane: Plane = "xy"
    magnification: float = 100.0
    frame: str = "base"
    title: str = "Where the errors point"
    caption: str = ""

    def _check_rules(self) -> None:
        """Checks the plane, and that there is a point."""
        _require_points(self, len(self.position))
        if self.plane not in PLANES:
            raise ShapeError(f"plane {self.plane!r}, expected one of {PLANES}.")


@dataclass(frozen=True, slots=True, kw_only=True)
class CoveragePlot(Columns):
    """Plot of stated against observed probability: is the uncertainty honest?

    Attributes:
        stated: (k,) stated probability of the regions, 0 to 1.
        observed: (k,) share of points inside them.
        low: (k,) lower end of the interval of ``observed``.
        high: (k,) upper end.
        title: Heading.
        caption: One sentence.
    """

    stated: Annotated[Array, Column("k")]
    observed: Annotated[Array, Column("k")]
    low: Annotated[Array, Column("k")]
    high: Annotated[Array, Column("k")]
    title: str = "Is the stated uncertainty honest?"
    caption: str = ""

    def _check_rules(self) -> None:
        """Checks that there is a point."""
        _require_points(self, len(self.stated))


@dataclass(frozen=True, slots=True, kw_only=True)
class HoleContour(Columns):
    """Plot of a circular contour, deviations magnified, before and after.

    Attributes:
        radius: m, of the commanded circle.
        angle: (n,) rad, of each point on it.
        before: (n, 2) m, in-plane deviation of each point, actual minus commanded.
        after: (n, 2) m.
        magnification: Drawn over true deviation; stated in the plot.
        limit: Tolerance in m, drawn (magnified too) as a band, None for none.
        title: Heading.
        caption: One sentence.
    """

    radius: float
    angle: Annotated[Array, Column("n", unit="rad")]
    before: Annotated[Array, Column("n 2", unit="m")]
    after: Annotated[Array, Column("n 2", unit="m")]
    magnification: float = 20.0
    limit: float | None = None
    title: str = "Contour of the hole"
    caption: str = ""

    def _check_rules(self) -> None:
        """Checks the radius, and that there is a point."""
        _require_points(self, len(self.angle))
        if not (np.isfinite(self.radius) and self.radius > 0.0):
            raise ShapeError(f"radius {self.radius} m, expected a positive length.")


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseSeries(Columns):
    """One curve against the number of poses.

    Attributes:
        label: Name in the legend.
        count: (k,) numbers of poses, rising.
        median: (k,) m; NaN where there is none.
        low: (k,) m, lower quartile; empty without a band.
        high: (k,) m, upper quartile; empty without a band.
        coverage: (k,) share in the stated 95 % regions; empty if it was not measured.
        role: ``ours`` is set off, ``peer`` is compared with, ``published`` are printed numbers of
            others, drawn as marks.
    """

    label: str
    count: Annotated[Array, Column("k")]
    median: Annotated[Array, Column("k", unit="m", nan=True)]
    low: Annotated[Array, Column("_", unit="m", nan=True)] = EMPTY
    high: Annotated[Array, Column("_", unit="m", nan=True)] = EMPTY
    coverage: Annotated[Array, Column("_", nan=True)] = EMPTY
    role: Literal["ours", "peer", "published"] = "peer"

    def _check_rules(self) -> None:
        """Checks that bands and coverage are empty or have a value for each count."""
        k = len(self.count)
        sizes = [len(self.low), len(self.high), len(self.coverage)]
        if not k or sizes[0] != sizes[1] or not set(sizes) <= {0, k}:
            raise ShapeError(f"series {self.label!r}: no points, or half a band.")


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseCurves:
    """Plot of accuracy, and of coverage where measured, against the number of poses.

    Attributes:
        series: One curve each; bands are quartiles over repeats.
        floor: m, what nothing can beat (noise of the check itself); None if it is not known.
        axis_label: What is counted.
        title: Heading.
        caption: One sentence.
    """

    series: tuple[PoseSeries, ...]
    floor: float | None = None
    axis_label: str = "poses"
    title: str = "Accuracy against the number of poses"
    caption: str = ""

    def __post_init__(self) -> None:
        """Checks that there is something to draw."""
        if not any(np.isfinite(s.median).any() for s in self.series):
            raise ShapeError("pose curves: no finite value in any series.")


@dataclass(frozen=True, slots=True, kw_only=True)
class MapSlices(Columns):
    """Plot of quantities over slices of a region: one row a quantity, one column a slice.

    Attributes:
        quantities: Name of each row.
        slices: Name of each column.
        values: (rows, columns, k, l) m; NaN is drawn as a gap.
        signed: Per row, whether its values have a sign (error along an axis).
        across: (l,) grid values along the horizontal axis, in the unit of its label.
        up: (k,) grid values along the vertical axis.
        across_label: Label with unit.
        up_label: Label with unit.
        title: Heading.
        caption: One sentence.
    """

    quantities: Annotated[tuple[str, ...], Column("rows")]
    slices: Annotated[tuple[str, ...], Column("columns")]
    values: Annotated[Array, Column("rows columns k l", unit="m", nan=True)]
    signed: Annotated[tuple[bool, ...], Column("rows")]
    across: Annotated[Array, Column("l")]
    up: Annotated[Array, Column("k")]
    across_label: str
    up_label: str
    title: str = "Predicted error over the region"
    caption: str = ""

    def _check_rules(self) -> None:
        """Checks that there is something to draw."""
        if not np.isfinite(self.values).any():
            raise ShapeError("map slices: no finite value.")


Block: TypeAlias = (
    Table
    | PointErrors
    | ErrorDistribution
    | ErrorMap
    | CoveragePlot
    | HoleContour
    | PoseCurves
    | TiltPlot
    | MapSlices
    | PartMap
    | BudgetPlot
    | UncertaintyMap
)
"""Anything that can stand in a section, in reading order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A chapter of the page.

    Attributes:
        title: Heading.
        blocks: Tables and plots in reading order.
        text: One or two sentences before them.
    """

    title: str
    blocks: tuple[Block, ...] = ()
    text: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fact:
    """One line of provenance or conditions.

    Attributes:
        name: E.g. ``"robotrue"``, ``"data"``, ``"seed"``, ``"payload"``.
        value: E.g. ``"0.1.0"``, ``"grid.csv sha256:ab12"``.
        key: Name in JSON, English in every language; the name if empty.
    """

    name: str
    value: str
    key: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportContent:
    """Everything a report says.

    Attributes:
        title: Heading of the page.
        verdict: The one line.
        simulated: True when any number comes from a simulated robot; the page then says so at the
            top and in the print header.
        subtitle: Robot, cell, date of the data.
        tiles: Key numbers, three to six.
        sections: The body.
        unseen: What the data cannot determine, one sentence each.
        doubts: When not to trust the numbers, one sentence each.
        provenance: Hashes, versions, settings, conditions.
        lang: Language its texts are in; page and figures speak the same.
    """

    title: str
    verdict: Verdict
    simulated: bool
    subtitle: str = ""
    tiles: tuple[Tile, ...] = ()
    sections: tuple[Section, ...] = ()
    unseen: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    provenance: tuple[Fact, ...] = field(default=())
    lang: Lang = "en"


def _require_points(owner: object, count: int) -> None:
    if not count:
        raise ShapeError(f"{type(owner).__name__}: no points.")
