"""``robotrue reproduce``: the tables of a source beside those of simulated arms."""

from __future__ import annotations

from pathlib import Path

from robotrue.cli.console import emit_facts, emit_json, emit_table, progress, say
from robotrue_reproductions.papers import find_paper
from robotrue_reproductions.reproduction import Request
from robotrue_reproductions.table_text import text_tables, write_figures


def run(
    paper: str, *, scenario: str, robots: int, quick: bool, out: Path | None, as_json: bool
) -> None:
    """Runs the reproduction; tables, or JSON, on stdout."""
    source = find_paper(paper)
    request = Request(robots=robots, quick=quick, scenario=scenario)
    with progress() as bar:
        result = source.run(request, bar)
    if out is not None:
        write_figures(result, out, paper)
        say(f"figures: {out}")
    if as_json:
        emit_json(result.document())
        return
    emit_facts(
        f"SIMULATED: {result.robots} {source.arms} {result.scenario}, beside {source.authors}",
        [("", remark) for remark in result.remarks],
    )
    for table in text_tables(source, result):
        emit_table(table.title, table.columns, table.rows)
    emit_facts("What cannot be met, and why", result.unmet)
