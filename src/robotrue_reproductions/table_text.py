"""Figures of a reproduction as printed tables, and as files of JSON and CSV."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from robotrue.core.csv_text import csv_text
from robotrue.core.files import write_atomic
from robotrue_reproductions.reproduction import Figure, Paper, Reproduction, TableLayout

LONG_COLUMNS = ("", "", "paper", "median", "quartiles")


@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """One table as text.

    Attributes:
        title: Above it.
        columns: Headings.
        rows: Cells, as many as headings.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


def text_tables(paper: Paper, result: Reproduction) -> Iterator[TextTable]:
    """Yields the tables that have figures, in the order of the source."""
    for table, layout in paper.tables.items():
        figures = [f for f in result.figures if f.table == table]
        if not figures:
            continue
        if layout.beside:
            yield _wide_table(layout, figures)
        else:
            rows = [_long_row(f, layout) for f in figures]
            yield TextTable(title=layout.title, columns=LONG_COLUMNS, rows=rows)


def write_figures(result: Reproduction, folder: Path, name: str) -> None:
    """Writes all figures as ``name.json`` and ``name.csv`` into a folder that it makes."""
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(result.document(), indent=1, allow_nan=False)
    write_atomic(folder / f"{name}.json", text.encode())
    columns = list(result.figures[0].document())
    cells = ([_csv_cell(v) for v in f.document().values()] for f in result.figures)
    write_atomic(folder / f"{name}.csv", csv_text([columns, *cells]).encode())


def _wide_table(layout: TableLayout, figures: Sequence[Figure]) -> TextTable:
    """One row for each name, one column for each quantity."""
    quantities = list(dict.fromkeys(f.quantity for f in figures))
    names = list(dict.fromkeys(f.name for f in figures))
    cells = {(f.name, f.quantity): _wide_cell(f, layout.beside) for f in figures}
    rows = [(name, *(cells.get((name, q), "") for q in quantities)) for name in names]
    return TextTable(title=layout.title, columns=("", *quantities), rows=rows)


def _wide_cell(figure: Figure, beside: str) -> str:
    """Median with 5 and 95 %, and the printed number where there is one."""
    fine = figure.unit == "deg" and abs(figure.median) < 0.1
    digits = 0 if figure.unit == "%" else 2 if abs(figure.median) >= 10.0 else 4 if fine else 3
    text = f"{figure.median + 0.0:.{digits}f}{' %' if figure.unit == '%' else ''}"
    if len(figure.ours) > 1:
        low, high = figure.range90
        text += f"\n[{low:.{digits}f} {high:.{digits}f}]"
    if figure.paper is not None:
        text += f"\n{beside} {figure.paper:g}"
    return text


def _long_row(figure: Figure, layout: TableLayout) -> Sequence[str]:
    digits = layout.decimals
    low, high = figure.quartiles
    spread = "" if len(figure.ours) == 1 else f"{low:.{digits}f} - {high:.{digits}f}"
    printed = figure.paper if layout.compares else None
    return (
        figure.name,
        figure.quantity,
        "" if printed is None else f"{printed:.{digits}f}",
        f"{figure.median:.{digits}f}",
        spread,
    )


def _csv_cell(value: object) -> object:
    return f"{value:.6g}" if isinstance(value, float) else value
