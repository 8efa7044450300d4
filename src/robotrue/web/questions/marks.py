"""What has to stand beside every number."""

from __future__ import annotations

from collections.abc import Iterable

from robotrue.calibration.model import ErrorModel
from robotrue.measurement.measurement_set import MeasurementSet


def from_simulation(model: ErrorModel | None, rows: Iterable[MeasurementSet] = ()) -> bool:
    """Returns whether anything this rests on was simulated, as the data themselves say."""
    named = [] if model is None else list(model.training_summary().get("sources", ()))
    named += [name for each in rows for name in (*each.sources, *each.group_names)]
    return any("simulated" in str(name).lower() for name in named)
