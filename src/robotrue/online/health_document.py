"""The counters of a source or sink as a JSON object, units in the names."""

from __future__ import annotations

import math

from robotrue.online.link import Health

HealthDocument = dict[str, str | bool | int | float | None]


def health_document(health: Health) -> HealthDocument:
    """Returns the counters; a turnaround that is not measured is None."""
    return {
        "name": health.name,
        "connected": health.connected,
        "received": health.received,
        "lost": health.lost,
        "late": health.late,
        "refused": health.refused,
        "dropped": health.dropped,
        "reconnects": health.reconnects,
        "turnaround_p50_ms": _ms(health.turnaround_p50),
        "turnaround_p99_ms": _ms(health.turnaround_p99),
        "last_fault": health.last_fault,
    }


def _ms(seconds: float) -> float | None:
    return round(seconds * 1e3, 3) if math.isfinite(seconds) else None
