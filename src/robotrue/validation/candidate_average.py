"""One model from the candidates of a contest that held-out poses do not exclude."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

import numpy as np

from robotrue.calibration.averaging import average_models, refuse_strangers
from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.model import (
    RANGES,
    ErrorModel,
    merged_document,
    with_summary,
    with_warnings,
)
from robotrue.errors import RobotrueError
from robotrue.validation.contest import Selection, Trials, weigh

FitWhole: TypeAlias = Callable[[], ErrorModel]
"""Fits a candidate on all rows."""


def average_candidates(
    model: CalibratedModel,
    others: Mapping[str, FitWhole],
    trials: Trials,
    selection: Selection,
) -> tuple[ErrorModel, Selection]:
    """Returns the average of the winner and other candidates, and the selection with its weights.

    Weights are those of the held-out density; the summary is the winner's, with the origins and
    the region of all. A candidate that is no arm with terms has no share; one that cannot be
    averaged with the winner is named.

    Args:
        model: The winner, fitted on all rows.
        others: The other candidates with a vote.
        trials: Held-out results of all.
        selection: The contest.
    """
    models = {selection.winner: model}
    doubts: list[str] = []
    for name, fit in others.items():
        try:
            other = fit()
            if isinstance(other, CalibratedModel):
                refuse_strangers([*models.values(), other])
                models[name] = other
        except RobotrueError as cause:
            doubts.append(f"{name} is left out of the average: {cause.message}")
    if len(models) < 2:
        return with_warnings(model, doubts), selection
    weighed = weigh(trials, selection, [name for name in trials.scored if name in models])
    weights = np.array([weighed.weights[name] for name in models])
    average = with_summary(
        average_models(list(models.values()), weights), _merge_origins(list(models.values()))
    )
    return with_warnings(average, doubts), weighed


def _merge_origins(models: Sequence[CalibratedModel]) -> dict[str, object]:
    """JSON values of where the data of all models come from, and of the region they cover."""
    merged: dict[str, object] = {"provenance": merged_document(models)}
    summaries = [model.training_summary() for model in models]
    for name in RANGES:
        stated = [np.asarray(summary.get(name, ()), dtype=np.float64) for summary in summaries]
        known = [values for values in stated if values.ndim == 2 and len(values) == 2]
        if known and len(stated[0]) == 2:
            both = np.vstack(known)
            merged[name] = [both.min(axis=0).tolist(), both.max(axis=0).tolist()]
    return merged
