"""The report as one HTML file that needs nothing else: opens offline, prints, light and dark."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from robotrue.core.provenance import simulation_mark
from robotrue.report.content import Block, Cell, KeyFigure, ReportContent, ReportTable, TableColumn
from robotrue.report.json import content_sha256
from robotrue.report.theme import STYLE
from robotrue.report.words import HTML_LANG, ReportTexts

WIDE: Final = 7
"""Tables with more columns are set smaller."""
TEMPLATE: Final = "page.html.jinja"
_TEMPLATES: Final = Environment(
    loader=FileSystemLoader(Path(__file__).parent),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)


def report_html(content: ReportContent) -> str:
    """Returns the page; equal content gives equal text.

    Write it with ``write_atomic(path, report_html(content).encode())``.
    """
    return _TEMPLATES.get_template(TEMPLATE).render(
        page_document(content),
        lang=HTML_LANG[content.lang],
        style=Markup(STYLE),  # noqa: S704
    )


def page_document(content: ReportContent, redraw: Callable[[str], str] = str) -> dict[str, object]:
    """Returns the content for page and print, every number as text, drawings as inline SVG.

    Args:
        content: Of the page.
        redraw: Transforms the SVG of a drawing.
    """
    words = ReportTexts(lang=content.lang)
    mark = simulation_mark(content.simulated, f" {words('page.footer_simulated')}")
    lists = ((words("page.unseen"), content.unseen), (words("page.doubts"), content.doubts))
    verdict = content.verdict
    return {
        "title": content.title,
        "subtitle": content.subtitle,
        "simulated": simulation_mark(content.simulated, words("page.simulated")),
        "verdict": {"text": verdict.text, "detail": verdict.detail, "tone": verdict.tone},
        "tiles": [_tile(tile, words) for tile in content.tiles],
        "sections": [
            {
                "title": section.title,
                "text": section.text,
                "blocks": [
                    _block(block, f"s{i}b{k}", words, redraw)
                    for k, block in enumerate(section.blocks)
                ],
            }
            for i, section in enumerate(content.sections)
        ],
        "head": [[fact.name, fact.value] for fact in content.head],
        "signers": [[fact.name, fact.value] for fact in content.signers],
        "signature": words("page.signature"),
        "logo": content.logo,
        "lists": [{"title": title, "items": list(items)} for title, items in lists if items],
        "provenance": {
            "title": words("page.provenance"),
            "facts": [[fact.name, fact.value] for fact in content.provenance],
        },
        "footer": words("page.footer") + mark,
        "hash": words("page.hash", hash=content_sha256(content)),
    }


def _tile(tile: KeyFigure, words: ReportTexts) -> dict[str, str]:
    before = ""
    if tile.before is not None:
        value = f"{tile.before:.{tile.digits}f} {tile.unit}".strip()
        before = words("page.before", value=value)
    return {
        "label": tile.label,
        "value": f"{tile.value:.{tile.digits}f}",
        "unit": tile.unit,
        "before": before,
        "note": tile.note,
        "tone": tile.tone,
    }


def _block(
    block: Block, key: str, words: ReportTexts, redraw: Callable[[str], str]
) -> dict[str, object]:
    head: dict[str, object] = {
        "title": block.title,
        "caption": block.caption,
        "svg": "",
        "table": [],
    }
    if not isinstance(block, ReportTable):
        return head | {"svg": redraw(block.svg(key, words))}
    wordy = [any(isinstance(row[k], str) for row in block.rows) for k in range(len(block.columns))]
    return head | {
        "columns": [
            {"title": column.title, "unit": column.unit, "words": left}
            for column, left in zip(block.columns, wordy, strict=True)
        ],
        "table": [
            [cell_text(cell, column) for cell, column in zip(row, block.columns, strict=True)]
            for row in block.rows
        ],
        "highlight": -1 if block.highlight is None else block.highlight,
        "wide": len(block.columns) > WIDE,
    }


def cell_text(value: Cell, column: TableColumn) -> str:
    """Returns a cell as it is printed, not escaped."""
    if value is None:
        return "–"
    if isinstance(value, float):
        # Adding zero after rounding prints a rounded-off -0.0001 as 0.000.
        return f"{round(value, column.digits) + 0.0:.{column.digits}f}"
    return str(value)
