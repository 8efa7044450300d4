"""Named values of a machine as samples of its foot, and as what a reference found.

A foot: ``d1_mm, d2_mm, ...`` (less their zero), or ``raw1_mm, ...`` or ``raw1_counts, ...`` with
the foot's zero; ``force_N``, ``z_mm``, and ``A_deg, B_deg`` as the machine counts its axes;
optionally ``X_mm, Y_mm``.
A reference: ``left_a_deg, left_b_deg``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM
from robotrue.drilling.campaign_csv import (
    FORMS,
    FORMS_HINT,
    LEFT,
    PLACE,
    STEEPEST,
    readings_less_zero,
)
from robotrue.drilling.clamp_watch import FootSample
from robotrue.drilling.foot_file import FootSetup
from robotrue.errors import FormatError, ImplausibleDataError

SIMULATED: Final = "simulated"
"""Name of the value by which a simulated machine says what it is; not 0."""


def is_reference(values: Mapping[str, float]) -> bool:
    """Returns whether values are what a reference found, not what a foot reads."""
    return any(name in values for name in LEFT)


def foot_sample(
    values: Mapping[str, float], setup: FootSetup, time: float, *, head: bool = True
) -> FootSample:
    """Returns the sample of a foot.

    Args:
        values: By name, in the units of their names.
        setup: How many sensors, and their zero where readings are raw.
        time: s, of a clock that does not go back.
        head: Whether a head's axes turn the foot; not where a robot carries it.

    Raises:
        FormatError: A value is missing, or readings come in two forms.
        ConfigurationError: Raw readings without the foot's zero.
    """
    sensors = range(1, len(setup.foot.radius) + 1)
    forms = [form for form in FORMS if form.format(1) in values]
    if len(forms) != 1:
        raise FormatError(
            f"{'several forms of' if forms else 'no'} readings among {', '.join(values)}.",
            hint=FORMS_HINT,
        )
    raw = _select_values(values, tuple(forms[0].format(k) for k in sensors))
    if (beyond := forms[0].format(len(sensors) + 1)) in values:
        raise FormatError(
            f"{beyond} of a machine with more sensors than the {len(sensors)} of the foot.",
            hint="the foot file, and the model, of this machine.",
        )
    force, height = _select_values(values, ("force_N", "z_mm"))
    return FootSample(
        time=time,
        readings=readings_less_zero(raw[None], forms[0], setup)[0],
        force=float(force),
        height=float(height * MM),
        axes=_select_values(values, ("A_deg", "B_deg")) * DEG if head else np.zeros(2),
        place=np.array([values.get(name, np.nan) for name in PLACE]) * MM,
    )


def read_reference_tilt(values: Mapping[str, float]) -> Array:
    """Returns the tilt (2,) rad that a reference found after a move.

    Raises:
        FormatError: One of the two is missing.
        ImplausibleDataError: Tilts that are not left by any move.
    """
    left = _select_values(values, LEFT)
    if np.abs(left).max() > STEEPEST:
        raise ImplausibleDataError(
            f"a reference of {left[0]:g}, {left[1]:g} deg, up to {STEEPEST:g} deg is possible."
        )
    return left * DEG


def _select_values(values: Mapping[str, float], names: tuple[str, ...]) -> Array:
    missing = [name for name in names if name not in values]
    if missing:
        raise FormatError(
            f"{', '.join(missing)} is missing; there are {', '.join(values) or 'no values'}."
        )
    return np.array([values[name] for name in names])
