"""What the causes of a reading's error may amount to: the prior of the default correction.

The error of each sensor is a sum of groups, each a few columns with independent normal coefficients
of one deviation per group, a smooth rest, and noise:

    1; a, b; F; z; F a, F b; F^2; a^2, a b, b^2; (1, t_a, t_b) exp(-F / F_0); rest; noise.

t is the direction of the tilt from where the foot hangs at rest, (a_0, b_0). The foot is free when
it meets the skin and turns towards it until the joint's friction stops it: it stays behind by an
angle that the growing clamp force takes away, along the way it turned. That is the group with
exp(-F / F_0); no polynomial has its edge at rest.

The deviations are learned by the evidence, from starts and with spreads that say what such feet
do: offsets of tenths of a millimetre, a fifth of that per degree, nothing much from the height.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import MM, UM
from robotrue.drilling.terms import Conditions

GROUPS: Final = (
    "offset",
    "tilt",
    "force",
    "height",
    "force x tilt",
    "force^2",
    "tilt^2",
    "friction",
)
WIDTHS: Final = np.log(np.array([1.0, 0.1, 0.5, 0.02, 0.05, 0.2, 0.0025, 0.1]) * MM)
"""Log deviation of each group's coefficients, m per unit of the column, where the search begins."""
REST_AMPLITUDE: Final = 10.0 * UM
WIDE: Final = 0.2 * MM
REST: Final = np.log(np.array([REST_AMPLITUDE, 4.0, 4.0, 1.0, 7.0]))
"""Log amplitude (m) and lengths (deg, deg, kN, 100 mm) of the smooth rest."""
FADING: Final = float(np.log(0.6))
"""Log of F_0 in kN."""
SPREAD: Final = np.array([1.0] * len(WIDTHS) + [1.0, 0.7, 0.7, 0.7, 1.0, 0.5, 0.3, 0.3, 0.7])
"""Deviation of the prior of each of theta: log widths, rest, F_0; a_0 and b_0 in deg; log noise."""
STILL: Final = 0.02  # deg: a tilt seen smaller than this has no sure direction


def groups(c: Conditions, fading: float, rest: Array) -> list[Array]:
    """Returns the columns (n, .) of each group of :data:`GROUPS`.

    Args:
        c: Causes of n clamps.
        fading: kN, clamp force that takes the friction's share down to 1/e.
        rest: (2,) deg, tilt the readings show where the foot hangs at rest.
    """
    a, b, force, one = c.a, c.b, c.force, np.ones_like(c.a)
    parts = (
        [one],
        [a, b],
        [force],
        [c.height],
        [force * a, force * b],
        [force**2],
        [a * a, a * b, b * b],
    )
    return [*(np.stack(part, axis=-1) for part in parts), _friction(c, fading, rest)[0]]


def friction_by_rest(c: Conditions, fading: float, rest: Array) -> Array:
    """Returns the change (2, n, 3) of the friction's columns per degree of the rest position."""
    columns, x, y, size = _friction(c, fading, rest)
    fades = columns[:, 0]
    by_a = np.stack([-(y**2 + STILL**2), x * y], axis=-1)
    by_b = np.stack([x * y, -(x**2 + STILL**2)], axis=-1)
    out = np.zeros((2, len(x), 3))
    out[:, :, 1:] = (fades / size**3)[:, None] * np.stack([by_a, by_b])
    return out


def _friction(c: Conditions, fading: float, rest: Array) -> tuple[Array, Array, Array, Array]:
    """Columns (n, 3) of the friction, the way (n,) in a and b from the rest, and its length."""
    x, y = c.a - rest[0], c.b - rest[1]
    size = np.sqrt(x**2 + y**2 + STILL**2)
    fades = np.exp(-c.force / fading)
    return np.stack([fades, fades * x / size, fades * y / size], axis=-1), x, y, size


def start(reading_sigma: float, *, rest_alone: bool) -> Array:
    """Returns theta (17,) where the search begins: its prior mean.

    With ``rest_alone`` the smooth rest has to carry what the groups would: the groups but the
    offset are none, the rest begins as wide as the error.
    """
    rest = REST + np.array([np.log(WIDE / REST_AMPLITUDE), 0.0, 0.0, 0.0, 0.0]) * rest_alone
    return np.concatenate([WIDTHS, rest, [FADING, 0.0, 0.0, np.log(reading_sigma)]])


def fix_values(*, rest_alone: bool) -> Array:
    """Returns theta (17,): the values that are not learned, NaN where they are."""
    out = np.full(len(SPREAD), np.nan)
    if rest_alone:
        out[1 : len(WIDTHS)] = -np.inf
        out[len(WIDTHS) + 5 : -1] = FADING, 0.0, 0.0
    return out


def bounds(mean: Array) -> Array:
    """Returns the limits (17, 2) of theta: four deviations of the prior on either side."""
    return np.stack([mean - 4.0 * SPREAD, mean + 4.0 * SPREAD], axis=-1)
