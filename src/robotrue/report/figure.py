"""Matplotlib figures as inline SVG that follows the page's colours.

The object interface only: no pyplot, no global figure list, so any thread may draw.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Final, TypeVar

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

from robotrue.report.theme import LIGHT

if TYPE_CHECKING:
    from matplotlib.typing import RcKeyType

INK: Final = LIGHT["ink"]
MUTED: Final = LIGHT["muted"]
RULE: Final = LIGHT["rule"]
BEFORE: Final = LIGHT["before"]
AFTER: Final = LIGHT["after"]
BAND: Final = LIGHT["band"]
CAUTION: Final = LIGHT["caution"]
GOOD: Final = LIGHT["good"]
BAD: Final = LIGHT["bad"]
CARD: Final = LIGHT["card"]
PAGE_WIDTH: Final = 10.0
"""Inches a page gives a drawing."""
TITLE_HEIGHT: Final = 0.4
"""Inches a picture's title takes."""
AnyFigure = TypeVar("AnyFigure", bound=Figure)

_SETTINGS: Final[dict[RcKeyType, object]] = {
    "svg.fonttype": "none",  # text stays text: searchable, in the page's font
    "svg.hashsalt": "robotrue",  # equal content gives equal ids, hence equal bytes
    "font.family": ["DejaVu Sans"],
    "font.size": 11.0,
    "axes.edgecolor": RULE,
    "axes.labelcolor": MUTED,
    "axes.titlecolor": INK,
    "axes.titlesize": 12.0,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "grid.color": RULE,
    "grid.linewidth": 0.8,
    "text.color": INK,
    "xtick.color": RULE,
    "ytick.color": RULE,
    "xtick.labelcolor": MUTED,
    "ytick.labelcolor": MUTED,
    "legend.frameon": False,
    "legend.labelcolor": INK,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
}
_CJK = re.compile("[\u2e80-\u9fff\uf900-\ufaff\uff00-\uffef]")
_NUMBER = re.compile(r"\d+\.\d{3,}")
_GEOMETRY = re.compile(r' (?:d|x|y|points|transform)="[^"]*"')


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """A picture before it has a format.

    Attributes:
        draw: Draws on the given axes, left to right, row by row.
        width: Inches of a separate picture; a page gives each the same width.
        height: Inches.
        panels: Number of axes side by side.
        rows: Number of such rows.
    """

    draw: Callable[[list[Axes]], None]
    width: float = PAGE_WIDTH
    height: float = 3.6
    panels: int = 1
    rows: int = 1

    def figure(self, width: float, height: float) -> Figure:
        """Returns the drawn figure of a size in inches."""
        figure = Figure(figsize=(width, height), layout="constrained")
        self.draw(list(figure.subplots(self.rows, self.panels, squeeze=False).ravel()))
        return figure


def inline_svg(drawing: Drawing, *, key: str, label: str) -> str:
    """Returns an ``<svg>`` element, without any address of another host.

    Args:
        drawing: What to draw.
        key: Prefix that keeps the ids of several plots on one page apart.
        label: What the plot shows, for screen readers.
    """
    with mpl.rc_context(_SETTINGS):
        figure = drawing.figure(PAGE_WIDTH, drawing.height)
        wide = _stand_ins(figure)
        stream = io.StringIO()
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    text = stream.getvalue()
    for stand_in, meant in wide.items():
        text = text.replace(stand_in, escape(meant))
    return _embeddable(text, key, label)


def standalone_svg(inline: str, family: str) -> str:
    """Returns an element of :func:`inline_svg` as a separate file, in the light palette.

    Args:
        inline: The element.
        family: Font families of its text, best first.
    """
    for name, colour in LIGHT.items():
        inline = inline.replace(f"var(--{name})", colour)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" font-family="{escape(family)}"'
    return inline.replace("<svg", head, 1)


def _stand_ins(figure: Figure) -> dict[str, str]:
    """Substitutes Latin letters of the same width for texts without glyphs in the drawing font.

    The SVG keeps text as text, in the reader's fonts; only the layout needs its size. So the file
    is the same on every machine, whatever fonts it has.
    """
    meant: dict[str, str] = {}
    for found in figure.findobj(Text):
        if not isinstance(found, Text) or not _CJK.search(found.get_text()):
            continue
        lines = []
        for line in found.get_text().split("\n"):
            name = f"ZQ{len(meant):03d}"
            wide = len(_CJK.findall(line))
            # A full-width sign is one em, an M of the drawing font 0.86, another letter about 0.6.
            letters = round((wide + 0.6 * (len(line) - wide)) / 0.86)
            stand_in = name + "M" * max(letters - 4, 1) + "Q"
            meant[stand_in] = line
            lines.append(stand_in)
        found.set_text("\n".join(lines))
    return meant


def png(drawing: Drawing, *, title: str = "") -> bytes:
    """Returns a PNG picture in the light palette, 150 dots per inch, with a line above all axes."""
    with mpl.rc_context(_SETTINGS | {"savefig.facecolor": CARD}):
        figure = drawing.figure(drawing.width, drawing.height + (TITLE_HEIGHT if title else 0.0))
        if title:
            figure.suptitle(title, x=0.01, ha="left", color=INK, fontsize=13.0)
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=150, metadata={"Software": None})
    return stream.getvalue()


def stack_drawings(kind: type[AnyFigure], drawings: Sequence[Drawing], *, title: str) -> AnyFigure:
    """Returns one figure of several drawings below each other, in the light palette.

    Args:
        kind: Class of the figure.
        drawings: From above to below.
        title: A line above all; empty leaves it out.
    """
    heights = [each.height for each in drawings]
    above = TITLE_HEIGHT if title else 0.0
    with mpl.rc_context(_SETTINGS | {"figure.facecolor": CARD, "savefig.facecolor": "auto"}):
        figure = kind(figsize=(PAGE_WIDTH, sum(heights) + above), layout="constrained")
        parts = figure.subfigures(len(drawings), 1, height_ratios=heights, squeeze=False)
        for part, drawing in zip(parts[:, 0], drawings, strict=True):
            axes = part.subplots(drawing.rows, drawing.panels, squeeze=False)
            drawing.draw(list(axes.ravel()))
        if title:
            figure.suptitle(title, x=0.01, ha="left", color=INK, fontsize=13.0)
    return figure


def _two_decimals(number: re.Match[str]) -> str:
    return f"{float(number.group()):.2f}"


def _embeddable(text: str, key: str, label: str) -> str:
    """Returns the element alone: ids prefixed, colours as variables, no namespace addresses."""
    text = text[text.index("<svg") :].strip()
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    text = re.sub(r'\s+xmlns(:\w+)?="[^"]*"', "", text)
    text = re.sub(r"<!--.*?-->\s*", "", text, flags=re.DOTALL)
    text = re.sub(r'\bid="([^"]+)"', rf'id="{key}-\1"', text)
    text = re.sub(r'href="#([^"]+)"', rf'href="#{key}-\1"', text)
    text = re.sub(r"url\(#([^)]+)\)", rf"url(#{key}-\1)", text)
    text = text.replace("xlink:href", "href")
    for name, colour in LIGHT.items():
        text = re.sub(colour, f"var(--{name})", text, flags=re.IGNORECASE)
    text = re.sub(r"font: ([\d.]+)px [^;\"]+", r"font-size: \1px", text)
    text = _GEOMETRY.sub(lambda m: _NUMBER.sub(_two_decimals, m.group()), text)
    text = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", text, count=1)
    text = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", text, count=1)
    return text.replace("<svg", f'<svg role="img" aria-label="{label}"', 1)
