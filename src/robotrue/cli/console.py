"""Output of commands: results on stdout, progress and remarks on stderr."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

from rich import box
from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from robotrue.core.json_values import json_values
from robotrue.core.provenance import Provenance, mark_sentence, mark_title, marked_document

stderr = Console(stderr=True, highlight=False)
PIPED_WIDTH = 160
"""Columns of a table that does not go to a terminal."""


def say(text: str) -> None:
    """Writes one remark to stderr, on one line: the terminal wraps, a log does not."""
    stderr.print(text, markup=False, soft_wrap=True)


def say_mark(provenance: Provenance | None) -> None:
    """Writes to stderr that a result rests on simulated data, if it does."""
    text = mark_sentence(provenance)
    if text:
        say(text)


def emit_json(document: Mapping[str, object], provenance: Provenance | None = None) -> None:
    """Writes one JSON document to stdout; numbers that are not finite become null.

    Args:
        document: The values.
        provenance: Of what they rest on, written in front of them; None if they rest on no data.
    """
    document = marked_document(document, provenance)
    sys.stdout.write(json.dumps(json_values(document), indent=1, allow_nan=False) + "\n")


def emit_table(
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    words: bool = False,
    provenance: Provenance | None = None,
) -> None:
    """Writes a table to stdout, first column left-aligned, the others right-aligned.

    Args:
        title: Above the table.
        columns: Headings; all empty leaves the heading out.
        rows: One string per column.
        words: The other columns hold words and not numbers: left as well.
        provenance: Of the numbers: the title of simulated ones is marked.
    """
    title = mark_title(title, provenance)
    # As texts: names of files and columns may hold brackets, which Rich would read as markup.
    table = Table(title=Text(title), title_justify="left", show_header=any(columns), box=box.SIMPLE)
    for k, column in enumerate(columns):
        left = k == 0 or words
        table.add_column(
            Text(column), justify="left" if left else "right", overflow="fold", no_wrap=not words
        )
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = PIPED_WIDTH
    console.print(table)


def emit_facts(
    title: str, facts: Sequence[tuple[str, str]], provenance: Provenance | None = None
) -> None:
    """Writes names and values in two columns to stdout; ``provenance`` marks the title."""
    emit_table(title, ("", ""), facts, words=True, provenance=provenance)


@contextmanager
def progress() -> Iterator[Callable[[str, int, int], None]]:
    """Yields ``step(what, done, of)``, a bar on stderr; quiet when stderr is not a terminal."""
    with Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=stderr,
        transient=True,
        disable=not stderr.is_terminal,
    ) as bar:
        task = bar.add_task("", total=None)

        def step(what: str, done: int, of: int) -> None:
            bar.update(task, description=what, completed=done, total=of)

        yield step
