"""Content of a report, independent of its layout.

A page and a JSON file are two views of the same :class:`ReportContent`. A caller with results
builds one (:func:`robotrue.report.calibration_report.calibration_content` does it for a validation)
and passes it to :func:`robotrue.report.page.report_html` and
:func:`robotrue.report.json.report_json`::

    content = ReportContent(
        title="Flange hole, 210 mm",
        verdict=Conclusion(tone="good", text="Within 0.21 mm (mean) of the CAM target."),
        simulated=True,
        tiles=(KeyFigure(label="mean error", value=0.205, unit="mm", before=1.459),),
        sections=(Section(title="Dry run", blocks=(table, PointErrors(...), HoleContour(...))),),
        provenance=(Fact(name="seed", value="7"),),
    )

Arrays are SI as everywhere; tiles and tables hold numbers in the unit they state.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from html import escape
from typing import ClassVar, Final, Literal, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Columns
from robotrue.core.files import DEFAULT_LANG
from robotrue.core.units import DEG, MM
from robotrue.errors import ShapeError
from robotrue.report.figure import Drawing, inline_svg, png
from robotrue.report.words import ENGLISH, Lang, ReportTexts

Tone: TypeAlias = Literal["good", "caution", "bad", "plain"]
"""How a statement is coloured: passed, caution, failed, no verdict."""
Cell: TypeAlias = str | int | float | None
"""One table cell; floats are printed with the digits of their column, None as a dash."""
DIGITS: Final = 3
"""Default number of printed decimals (micrometres of a length in mm)."""
NEUTRAL: Final[Tone] = "plain"
_UNITS: Final = {"mm": (MM, 7), "deg": (DEG, 6)}
"""Unit and decimals of arrays by the end of their key: a tenth of a nanometre is below any
instrument, and the file stays readable."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conclusion:
    """The one line a reader takes home.

    Attributes:
        text: One sentence with the number in it.
        tone: Its colour.
        detail: A second, smaller sentence: on what data, by which rule.
    """

    text: str
    tone: Tone = NEUTRAL
    detail: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyFigure:
    """One key number.

    Attributes:
        label: What it is, two to four words.
        value: The number, in ``unit``.
        unit: ``"mm"``, ``"%"``, ``"deg"``, or empty.
        digits: Decimals printed.
        before: The same number before compensation, printed small next to it; None to leave out.
        note: A few words below, e.g. ``"220 held-out poses"``.
        tone: Colour of the number.
        key: Name in JSON, English in every language; the label if empty.
    """

    label: str
    value: float
    unit: str = ""
    digits: int = DIGITS
    before: float | None = None
    note: str = ""
    tone: Tone = NEUTRAL
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
    digits: int = DIGITS
    key: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportTable:
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

    def json_block(self) -> dict[str, object]:
        """Returns the rows as JSON values, by the name and unit of each column."""
        names = [f"{c.key or c.title} {c.unit}".strip().replace(" ", "_") for c in self.columns]
        return {
            "title": self.title,
            "caption": self.caption,
            "kind": "table",
            "rows": [
                {
                    name: finite_or_none(cell) if isinstance(cell, float) else cell
                    for name, cell in zip(names, row, strict=True)
                }
                for row in self.rows
            ],
            "highlight": self.highlight,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot(Columns, ABC):
    """A drawing of a report and its numbers; a new kind of plot is one class.

    Attributes:
        title: Heading.
        caption: What to read in it, one sentence.
        kind: In JSON.
        json_keys: Attribute by key of the JSON; the end of a key is the unit it is written in.
    """

    title: str
    caption: str = ""
    kind: ClassVar[str]
    json_keys: ClassVar[Mapping[str, str]] = {}

    def _check_rules(self) -> None:
        """Checks that there is a point: that the first array has a row."""
        arrays = (getattr(self, f.name) for f in fields(self))
        if not all(len(values) for values in arrays if isinstance(values, np.ndarray)):
            raise ShapeError(f"{type(self).__name__}: no points.")

    @abstractmethod
    def make_drawing(self, words: ReportTexts) -> Drawing:
        """Returns the picture; ``words`` are for its own texts."""

    def svg(self, key: str, words: ReportTexts) -> str:
        """Returns the picture as an SVG element whose ids begin with ``key``."""
        return inline_svg(self.make_drawing(words), key=key, label=escape(self.title, quote=True))

    def png(self, words: ReportTexts = ENGLISH) -> bytes:
        """Returns the picture as PNG, its title above it."""
        return png(self.make_drawing(words), title=self.title)

    def json_block(self) -> dict[str, object]:
        """Returns the numbers as JSON values; lengths in mm, angles in deg."""
        values = {key: _shop_value(getattr(self, f), key) for key, f in self.json_keys.items()}
        head = {"title": self.title, "caption": self.caption, "kind": self.kind}
        return {**head, **values, **self._json_more()}

    def _json_more(self) -> dict[str, object]:
        """Returns JSON values beyond :attr:`json_keys`; none by default."""
        return {}


Block: TypeAlias = ReportTable | Plot
"""Blocks of a section, in reading order."""


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
    """Full content of a report.

    Attributes:
        title: Heading of the page.
        verdict: One-line conclusion.
        simulated: True when any number comes from a simulated robot; the page then states it at the
            top and in the print header.
        subtitle: Robot, cell, date of the data.
        tiles: Key numbers, three to six.
        sections: The body.
        unseen: What the data cannot determine, one sentence each.
        doubts: When not to trust the numbers, one sentence each.
        provenance: Hashes, versions, settings, conditions.
        head: Names, dates and place, at the top of the first page.
        signers: Role and name of the signers, on the first page.
        logo: ``data:`` address of a picture for the first page; empty for none.
        lang: Language of its texts; page and figures use the same.
    """

    title: str
    verdict: Conclusion
    simulated: bool
    subtitle: str = ""
    tiles: tuple[KeyFigure, ...] = ()
    sections: tuple[Section, ...] = ()
    unseen: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    provenance: tuple[Fact, ...] = field(default=())
    head: tuple[Fact, ...] = ()
    signers: tuple[Fact, ...] = ()
    logo: str = ""
    lang: Lang = DEFAULT_LANG


def finite_or_none(value: float | None) -> float | None:
    """Returns the value, or None (null in JSON) where there is none or it is not finite."""
    return None if value is None or not math.isfinite(value) else value


def nullable(values: Array) -> object:
    """Returns nested lists, rounded, with None where a value does not exist."""
    if values.ndim > 1:
        return [nullable(part) for part in values]
    return [finite_or_none(round(float(value), 7)) for value in values]


def _shop_value(value: object, key: str) -> object:
    """Returns a value in the unit that ends its key, as JSON."""
    unit, digits = _UNITS.get(key.rpartition("_")[2], (1.0, None))
    if isinstance(value, np.ndarray):
        return (value if digits is None else np.round(value / unit, digits)).tolist()
    if isinstance(value, tuple):
        return list(value)
    return value / unit if isinstance(value, float) else value
