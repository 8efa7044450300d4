"""What has to stand beside every number."""

from __future__ import annotations

from collections.abc import Iterable

from robotrue.calibration.lineage import provenance_of
from robotrue.calibration.model import ErrorModel
from robotrue.core.provenance import merge
from robotrue.measurement.measurement_set import MeasurementSet


def from_simulation(model: ErrorModel | None, rows: Iterable[MeasurementSet] = ()) -> bool:
    """Returns whether anything this rests on was simulated, as the data themselves say."""
    origins = [] if model is None else [provenance_of(model)]
    return merge([*origins, *(each.provenance for each in rows)]).simulated
