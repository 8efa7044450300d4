"""A model at the temperature, time and rail position that a request states."""

from __future__ import annotations

import numpy as np

from robotrue.app.context import Context
from robotrue.calibration.model import ErrorModel
from robotrue.core.conditions import EXTERNAL_AXES, ArmConditions
from robotrue.core.units import MM, ZERO_CELSIUS
from robotrue.errors import ConfigurationError


def model_under(
    model: ErrorModel | None,
    temperature_degC: float | None,
    time_s: float | None,
    e1_mm: float | None,
    context: Context,
) -> ErrorModel | None:
    """Returns the model under the stated conditions, and notes what it assumes of the others.

    Raises:
        ConfigurationError: Conditions are stated and the model does not depend on them.
    """
    options = (temperature_degC, time_s, e1_mm)
    celsius, time, place = (np.nan if value is None else value for value in options)
    external = np.full((1, EXTERNAL_AXES), np.nan)
    external[0, 0] = place * MM
    conditions = ArmConditions(
        temperature=np.array([[celsius + ZERO_CELSIUS]]), time=np.array([time]), external=external
    )
    stated = any(value is not None for value in options)
    if model is not None:
        for remark in model.remarks_on(conditions):
            context.note(remark)
        return model.under(conditions) if stated else model
    if not stated:
        return None
    raise ConfigurationError(
        "--temperature, --time or --e1-mm with a cell that has no calibrated model.",
        hint="state the model of a calibration with temperatures or a rail.",
    )
