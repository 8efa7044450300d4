"""Rows that repeat others to the last digit, whole or in the point alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.screening import duplicate_rows
from robotrue.validation.doctor_case import Case
from robotrue.validation.doctor_evidence import Evidence
from robotrue.validation.doctor_suspicion import Hypothesis

CERTAIN: Final = 30.0
"""Log odds of what needs no statistics."""
MOVED: Final = 1e-3
"""rad: joints that moved by more cannot leave the point where it was, to the last digit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RepeatedRows:
    """Duplicated rows, and points that were not measured anew."""

    def look(self, rows: MeasurementSet, residuals: Evidence, arm: Case) -> Sequence[Hypothesis]:
        """Returns duplicates and stale points, where there are any."""
        out = []
        later = np.array([row for _, row in duplicate_rows(rows)], dtype=np.int64)
        if len(later):
            out.append(
                Hypothesis(
                    cause="duplicates",
                    text="rows repeat earlier ones to the last digit",
                    log_odds=CERTAIN,
                    rows=later,
                    cured=rows.subset(np.setdiff1d(np.arange(len(rows)), later)),
                    advice="export the measurements again",
                )
            )
        stale = _stale_rows(rows)
        if len(stale):
            out.append(
                Hypothesis(
                    cause="stale-points",
                    text="the point is that of another row to the last digit, the joints are not",
                    log_odds=CERTAIN,
                    rows=stale,
                    cured=rows.subset(np.setdiff1d(np.arange(len(rows)), stale)),
                    advice="wait for a new reading of the instrument at each pose",
                )
            )
        return out


def _stale_rows(rows: MeasurementSet) -> np.ndarray:
    _, first, inverse = np.unique(rows.position, axis=0, return_index=True, return_inverse=True)
    origin = first[inverse.reshape(-1)]
    moved = np.abs(rows.joints - rows.joints[origin]).max(axis=1) > MOVED
    return np.flatnonzero(moved & (origin != np.arange(len(rows))))
