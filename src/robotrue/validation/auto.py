"""Method ``auto``: choose on held-out poses, then fit the winner on all of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from robotrue.calibration.model import ErrorModel
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.statics import Load
from robotrue.validation.contest import Selection
from robotrue.validation.selection import FitFunction, Progress, select, with_evidence
from robotrue.validation.splits import Split

Attach: TypeAlias = Callable[[ErrorModel, Mapping[str, Any]], ErrorModel]
"""Returns the model with ``Selection.summary()`` in its training summary."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AutoFit:
    """A fitted model and why it is this one.

    Attributes:
        model: The winner, fitted on all rows.
        selection: The evidence.
    """

    model: ErrorModel
    selection: Selection


def fit_auto(
    candidates: Mapping[str, FitFunction],
    measurements: MeasurementSet,
    *,
    splits: Sequence[Split] | None = None,
    payload: Load | None = None,
    attach: Attach | None = None,
    progress: Progress | None = None,
) -> AutoFit:
    """Returns the winner of :func:`robotrue.validation.selection.select`, fitted on all rows.

    Args:
        candidates: Fit functions, simplest first, e.g. ``partial(fit, robot, method=name)``.
        measurements: All rows.
        splits: What to hold out; chosen by the number of rows if None.
        payload: Used where a row does not state its own.
        attach: Puts the evidence into the model's training summary;
            :func:`robotrue.validation.selection.with_evidence` if None.
        progress: Told before every fit.

    Raises:
        ObservabilityError: No candidate could be fitted.
    """
    selection = select(candidates, measurements, splits=splits, payload=payload, progress=progress)
    model = candidates[selection.winner](measurements)
    if attach is None:
        return AutoFit(model=with_evidence(model, selection), selection=selection)
    return AutoFit(model=attach(model, selection.summary()), selection=selection)
