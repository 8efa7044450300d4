"""The report as one HTML file that needs nothing else: opens offline, prints, light and dark."""

from __future__ import annotations

from html import escape

from robotrue.report.content import (
    Block,
    Cell,
    Column,
    CoveragePlot,
    ErrorDistribution,
    ErrorMap,
    Fact,
    HoleContour,
    MapSlices,
    PointErrors,
    PoseCurves,
    ReportContent,
    Section,
    Table,
    Tile,
    Verdict,
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
from robotrue.report.theme import STYLE
from robotrue.report.tilt_plot import TiltPlot, tilt_svg
from robotrue.report.transfer_curve import pose_curves_svg

SIMULATED = "SIMULATED DATA: no real robot was measured for this page"
WIDE = 7
"""Tables with more columns are set smaller."""
_WORDS = ' class="words"'


def report_html(content: ReportContent) -> str:
    """Returns the page; equal content gives equal text.

    Write it with ``write_atomic(path, report_html(content).encode())``.
    """
    body = [
        f'<div class="simulated" role="note">{SIMULATED}</div>' if content.simulated else "",
        "<main>",
        f"<h1>{escape(content.title)}</h1>",
        f'<p class="subtitle">{escape(content.subtitle)}</p>' if content.subtitle else "",
        _verdict(content.verdict),
        _tiles(content.tiles),
        *(_section(section, f"s{i}") for i, section in enumerate(content.sections)),
        _sentences("What the data cannot see", content.unseen),
        _sentences("When not to trust it", content.doubts),
        _facts(content.provenance),
        "<footer>Errors are actual minus commanded, in the robot base. Lengths in mm."
        + (" All data on this page are simulated." if content.simulated else "")
        + "</footer>",
        "</main>",
    ]
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
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


def _tiles(tiles: tuple[Tile, ...]) -> str:
    if not tiles:
        return ""
    return '<div class="tiles">' + "".join(_tile(tile) for tile in tiles) + "</div>"


def _tile(tile: Tile) -> str:
    unit = f'<span class="unit">{escape(tile.unit)}</span>' if tile.unit else ""
    was = (
        f'<div class="was">before: {tile.before:.{tile.digits}f} {escape(tile.unit)}</div>'
        if tile.before is not None
        else ""
    )
    note = f'<div class="note">{escape(tile.note)}</div>' if tile.note else ""
    return (
        f'<div class="tile {tile.tone}"><div class="label">{escape(tile.label)}</div>'
        f'<div class="value">{tile.value:.{tile.digits}f}{unit}</div>{was}{note}</div>'
    )


def _section(section: Section, key: str) -> str:
    text = f"<p>{escape(section.text)}</p>" if section.text else ""
    blocks = "".join(_block(block, f"{key}b{i}") for i, block in enumerate(section.blocks))
    return f"<section><h2>{escape(section.title)}</h2>{text}{blocks}</section>"


def _block(block: Block, key: str) -> str:
    match block:
        case Table():
            inner = _table(block)
        case PointErrors():
            inner = point_errors_svg(block, key)
        case ErrorDistribution():
            inner = distribution_svg(block, key)
        case ErrorMap():
            inner = map_svg(block, key)
        case CoveragePlot():
            inner = coverage_svg(block, key)
        case HoleContour():
            inner = hole_svg(block, key)
        case PoseCurves():
            inner = pose_curves_svg(block, key)
        case MapSlices():
            inner = slices_svg(block, key)
        case PartMap():
            inner = part_map_svg(block, key)
        case TiltPlot():
            inner = tilt_svg(block, key)
    caption = f'<p class="caption">{escape(block.caption)}</p>' if block.caption else ""
    return f'<div class="card"><h3>{escape(block.title)}</h3>{inner}{caption}</div>'


def _table(table: Table) -> str:
    words = [_is_words(table, index) for index in range(len(table.columns))]
    head = "".join(_heading(c, w) for c, w in zip(table.columns, words, strict=True))
    rows = []
    for index, row in enumerate(table.rows):
        cells = "".join(
            f"<td{_WORDS if w else ''}>{_cell(value, column)}</td>"
            for value, column, w in zip(row, table.columns, words, strict=True)
        )
        chosen = ' class="chosen"' if index == table.highlight else ""
        rows.append(f"<tr{chosen}>{cells}</tr>")
    wide = ' class="wide"' if len(table.columns) > WIDE else ""
    return f"<table{wide}><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _is_words(table: Table, index: int) -> bool:
    return any(isinstance(row[index], str) for row in table.rows)


def _heading(column: Column, words: bool) -> str:
    unit = f' <span class="unit">{escape(column.unit)}</span>' if column.unit else ""
    return f"<th{_WORDS if words else ''}>{escape(column.title)}{unit}</th>"


def _cell(value: Cell, column: Column) -> str:
    if value is None:
        return "–"
    if isinstance(value, float):
        # Adding zero after rounding prints a rounded-off -0.0001 as 0.000.
        return f"{round(value, column.digits) + 0.0:.{column.digits}f}"
    return escape(str(value))


def _sentences(title: str, sentences: tuple[str, ...]) -> str:
    if not sentences:
        return ""
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences)
    return f'<section><h2>{title}</h2><div class="card"><ul>{items}</ul></div></section>'


def _facts(facts: tuple[Fact, ...]) -> str:
    if not facts:
        return ""
    items = "".join(f"<dt>{escape(f.name)}</dt><dd>{escape(f.value)}</dd>" for f in facts)
    return f'<section><h2>Provenance</h2><div class="card"><dl>{items}</dl></div></section>'
