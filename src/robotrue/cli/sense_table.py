"""What the console shows while the service runs: the error with its band, and who is well."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from rich import box
from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from robotrue.cli.console import say, stderr
from robotrue.core.units import UM
from robotrue.online.clocks import ClockFix
from robotrue.online.estimate_columns import doubt_words
from robotrue.online.link import Health
from robotrue.online.service import Snapshot

HEADINGS = (
    "", "there", "taken", "lost", "late", "refused", "dropped", "answer ms", "ppm", "last fault"
)  # fmt: skip
"""Answer: median and 99th percentile. Ppm: by which the sender's clock runs slow."""
_BAND = 1.96
"""Standard deviations of a band that holds 95 of 100."""
_QUIET = 60.0
"""s between two lines where there is no terminal."""


@contextmanager
def live_table(note: str) -> Iterator[Callable[[Snapshot], None]]:
    """Yields what shows a snapshot: a table on a terminal, else a line a minute, both on stderr."""
    if not stderr.is_terminal:
        shown = -_QUIET

        def line(shot: Snapshot) -> None:
            nonlocal shown
            if shot.running - shown >= _QUIET:
                shown = shot.running
                say(summary(shot, note))

        yield line
        return
    with Live(console=stderr, auto_refresh=False, transient=True) as live:

        def table(shot: Snapshot) -> None:
            live.update(Group(Text(summary(shot, note)), _table(shot)), refresh=True)

        yield table


def summary(shot: Snapshot, note: str) -> str:
    """Returns one line: time, samples, error and band, correction."""
    parts = [f"{shot.running:.0f} s", f"{shot.given} estimates", f"{shot.invalid} invalid"]
    latest = shot.latest
    if latest is not None and latest.valid[-1]:
        numbers = zip("xyz", latest.error[-1] / UM, _BAND * latest.sd[-1] / UM, strict=True)
        parts.append("error um " + " ".join(f"{a} {e:+.1f}±{s:.1f}" for a, e, s in numbers))
    elif latest is not None:
        parts.append("no valid error: " + doubt_words(int(latest.doubt[-1])))
    if shot.correction_um is not None:
        held = " ".join(f"{v:+.1f}" for v in shot.correction_um)
        parts.append(
            f"correction um {held}" + (f" ({shot.correction_why})" * bool(shot.correction_why))
        )
    if note:
        parts.append(note)
    return " · ".join(parts)


def health_rows(shot: Snapshot) -> list[tuple[str, ...]]:
    """Returns the counters of everything that has some, a row each, as :data:`HEADINGS`."""
    rows = [
        _row(health, shot.clocks[stream], shot.faults.get(stream, ""))
        for stream, health in shot.sources.items()
    ]
    rest = (*shot.sinks, *((shot.record,) if shot.record else ()))
    return rows + [_row(health, None, "") for health in rest]


def _table(shot: Snapshot) -> Table:
    table = Table(box=box.SIMPLE)
    table.add_column("", overflow="fold", min_width=16)
    for heading in HEADINGS[1:-1]:
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column(HEADINGS[-1], overflow="fold")
    for row in health_rows(shot):
        table.add_row(*(Text(cell) for cell in row))
    return table


def _row(health: Health, clock: ClockFix | None, fault: str) -> tuple[str, ...]:
    answer = drift = ""
    if np.isfinite(health.turnaround_p50):
        answer = f"{1e3 * health.turnaround_p50:.2f}/{1e3 * health.turnaround_p99:.2f}"
    if clock is not None and clock.seconds:
        drift = f"{1e6 * clock.drift:+.1f}"
    counts = (health.received, health.lost, health.late, health.refused, health.dropped)
    return (
        health.name,
        "yes" if health.connected else "no",
        *(str(c) for c in counts),
        answer,
        drift,
        fault or health.last_fault,
    )
