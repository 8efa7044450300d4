"""The sensing service while it runs: the error with its band, and the counters of its streams."""

from __future__ import annotations

import numpy as np

from robotrue.app.presentation import LiveView, Table
from robotrue.core.units import UM
from robotrue.online.clocks import ClockFix
from robotrue.online.estimates import doubt_words
from robotrue.online.link import Health
from robotrue.online.service import Snapshot

HEADINGS = (
    "", "there", "taken", "lost", "late", "refused", "dropped", "answer ms", "ppm", "last fault"
)  # fmt: skip
"""Answer: median and 99th percentile. Ppm: by which the sender's clock runs slow."""
_BAND = 1.96
"""Standard deviations of a band that holds 95 of 100."""


def live_view(shot: Snapshot, note: str) -> LiveView:
    """Returns what is shown while the service runs."""
    table = Table(title="", columns=HEADINGS, rows=health_rows(shot))
    return LiveView(line=summary(shot, note), table=table, at=shot.running)


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


def health_rows(shot: Snapshot) -> tuple[tuple[str, ...], ...]:
    """Returns the counters of everything that has some, a row each, as :data:`HEADINGS`."""
    outputs = (*shot.sinks, *((shot.record,) if shot.record else ()))
    return (
        *(
            _row(health, shot.clocks[stream], shot.faults.get(stream, ""))
            for stream, health in shot.sources.items()
        ),
        *(_row(health, None, "") for health in outputs),
    )


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
