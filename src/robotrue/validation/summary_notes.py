"""Further values and sentences in the training summary of a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import cast

from robotrue.calibration.model import ErrorModel


def with_summary(model: ErrorModel, more: Mapping[str, object]) -> ErrorModel:
    """Returns the model with further JSON values in its training summary, where it can take them.

    Only a dataclass with a ``summary`` field can; any other model comes back as it is.
    """
    if not is_dataclass(model) or "summary" not in {f.name for f in fields(model)}:
        return model
    summary = {**model.training_summary(), **more}
    return cast(ErrorModel, replace(cast(object, model), summary=summary))


def with_warnings(model: ErrorModel, doubts: Sequence[str]) -> ErrorModel:
    """Returns the model with further sentences at the head of its doubts."""
    if not doubts:
        return model
    return with_summary(model, {"doubts": [*doubts, *model.training_summary().warnings]})
