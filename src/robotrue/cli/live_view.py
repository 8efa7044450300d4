"""A service that runs, on the terminal: a table that is renewed, or a line a minute in a log."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from rich import box
from rich.console import Group
from rich.live import Live
from rich.table import Table as RichTable
from rich.text import Text

from robotrue.app.presentation import LiveView, Table
from robotrue.cli.console import say, stderr

QUIET: Final = 60.0
"""s between two lines where there is no terminal."""


@contextmanager
def show_live() -> Iterator[Callable[[LiveView], None]]:
    """Yields what shows a view: a table on a terminal, else a line a minute, both on stderr."""
    if not stderr.is_terminal:
        shown = -QUIET

        def line(view: LiveView) -> None:
            nonlocal shown
            if view.at - shown >= QUIET:
                shown = view.at
                say(view.line)

        yield line
        return
    with Live(console=stderr, auto_refresh=False, transient=True) as live:
        yield lambda view: live.update(Group(Text(view.line), _table(view.table)), refresh=True)


def _table(table: Table) -> RichTable:
    """Name on the left, counters on the right, the last fault folded."""
    name, *counters, fault = table.columns
    shown = RichTable(box=box.SIMPLE)
    shown.add_column(name, overflow="fold", min_width=16)
    for heading in counters:
        shown.add_column(heading, justify="right", no_wrap=True)
    shown.add_column(fault, overflow="fold")
    for row in table.rows:
        shown.add_row(*(Text(cell) for cell in row))
    return shown
