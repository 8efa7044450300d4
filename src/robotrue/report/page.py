"""The report as one HTML file that needs nothing else: opens offline, prints, light and dark."""

from __future__ import annotations

from html import escape

from robotrue.core.provenance import simulation_mark
from robotrue.report.blocks import draw_block
from robotrue.report.content import (
    Block,
    Cell,
    Fact,
    ReportContent,
    Section,
    Table,
    TableColumn,
    Tile,
    Verdict,
)
from robotrue.report.json import content_sha256
from robotrue.report.theme import STYLE
from robotrue.report.words import HTML_LANG, Words

WIDE = 7
"""Tables with more columns are set smaller."""
_WORDS = ' class="words"'


def report_html(content: ReportContent) -> str:
    """Returns the page; equal content gives equal text.

    Write it with ``write_atomic(path, report_html(content).encode())``.
    """
    words = Words(lang=content.lang)
    mark = simulation_mark(content.simulated, words("page.simulated"))
    footer = words("page.footer")
    footer += simulation_mark(content.simulated, f" {words('page.footer_simulated')}")
    body = [
        f'<div class="simulated" role="note">{mark}</div>' if mark else "",
        "<main>",
        f"<h1>{escape(content.title)}</h1>",
        f'<p class="subtitle">{escape(content.subtitle)}</p>' if content.subtitle else "",
        _verdict(content.verdict),
        _tiles(content.tiles, words),
        *(_section(section, f"s{i}", words) for i, section in enumerate(content.sections)),
        _sentences(words("page.unseen"), content.unseen),
        _sentences(words("page.doubts"), content.doubts),
        _facts(words("page.provenance"), content.provenance),
        f"<footer>{footer}<br>{words('page.hash', hash=content_sha256(content))}</footer>",
        "</main>",
    ]
    return (
        f'<!doctype html>\n<html lang="{HTML_LANG[content.lang]}">\n'
        '<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(content.title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(part for part in body if part)
        + "\n</body>\n</html>\n"
    )


def _verdict(verdict: Verdict) -> str:
    detail = f"<span>{escape(verdict.detail)}</span>" if verdict.detail else ""
    return (
        f'<div class="verdict {verdict.tone}"><strong>{escape(verdict.text)}</strong>{detail}</div>'
    )


def _tiles(tiles: tuple[Tile, ...], words: Words) -> str:
    if not tiles:
        return ""
    return '<div class="tiles">' + "".join(_tile(tile, words) for tile in tiles) + "</div>"


def _tile(tile: Tile, words: Words) -> str:
    unit = f'<span class="unit">{escape(tile.unit)}</span>' if tile.unit else ""
    was = ""
    if tile.before is not None:
        value = f"{tile.before:.{tile.digits}f} {tile.unit}".strip()
        was = f'<div class="was">{escape(words("page.before", value=value))}</div>'
    note = f'<div class="note">{escape(tile.note)}</div>' if tile.note else ""
    return (
        f'<div class="tile {tile.tone}"><div class="label">{escape(tile.label)}</div>'
        f'<div class="value">{tile.value:.{tile.digits}f}{unit}</div>{was}{note}</div>'
    )


def _section(section: Section, key: str, words: Words) -> str:
    text = f"<p>{escape(section.text)}</p>" if section.text else ""
    blocks = "".join(_block(block, f"{key}b{i}", words) for i, block in enumerate(section.blocks))
    return f"<section><h2>{escape(section.title)}</h2>{text}{blocks}</section>"


def _block(block: Block, key: str, words: Words) -> str:
    inner = _table(block) if isinstance(block, Table) else draw_block(block, key, words)
    caption = f'<p class="caption">{escape(block.caption)}</p>' if block.caption else ""
    return f'<div class="card"><h3>{escape(block.title)}</h3>{inner}{caption}</div>'


def _table(table: Table) -> str:
    wordy = [is_words(table, index) for index in range(len(table.columns))]
    head = "".join(_heading(c, w) for c, w in zip(table.columns, wordy, strict=True))
    rows = []
    for index, row in enumerate(table.rows):
        cells = "".join(
            f"<td{_WORDS if w else ''}>{escape(cell_text(value, column))}</td>"
            for value, column, w in zip(row, table.columns, wordy, strict=True)
        )
        chosen = ' class="chosen"' if index == table.highlight else ""
        rows.append(f"<tr{chosen}>{cells}</tr>")
    wide = ' class="wide"' if len(table.columns) > WIDE else ""
    return f"<table{wide}><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def is_words(table: Table, index: int) -> bool:
    """Returns whether a column holds words, which stand on the left."""
    return any(isinstance(row[index], str) for row in table.rows)


def _heading(column: TableColumn, words: bool) -> str:
    unit = f' <span class="unit">{escape(column.unit)}</span>' if column.unit else ""
    return f"<th{_WORDS if words else ''}>{escape(column.title)}{unit}</th>"


def cell_text(value: Cell, column: TableColumn) -> str:
    """Returns a cell as it is printed, not escaped."""
    if value is None:
        return "–"
    if isinstance(value, float):
        # Adding zero after rounding prints a rounded-off -0.0001 as 0.000.
        return f"{round(value, column.digits) + 0.0:.{column.digits}f}"
    return str(value)


def _sentences(title: str, sentences: tuple[str, ...]) -> str:
    if not sentences:
        return ""
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences)
    return f'<section><h2>{title}</h2><div class="card"><ul>{items}</ul></div></section>'


def _facts(title: str, facts: tuple[Fact, ...]) -> str:
    if not facts:
        return ""
    items = "".join(f"<dt>{escape(f.name)}</dt><dd>{escape(f.value)}</dd>" for f in facts)
    return f'<section><h2>{title}</h2><div class="card"><dl>{items}</dl></div></section>'
