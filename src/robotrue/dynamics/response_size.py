"""Whether a curve has the size of a receptance: no sign of any axis is needed for that.

Below its modes a tool gives way like a spring, above them it moves like a mass. A curve that would
be the spring of a feather or the mass of a breath is in another unit, or is an acceleration.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.dynamics.frf import ComplexArray, FrequencyResponse
from robotrue.errors import ImplausibleDataError

_SOFTEST: Final = 5e-4
"""m/N at the low end of the band; more than that, 2 N/mm, is no robot."""
_LIGHTEST: Final = 1e-3
"""kg; 1/(w^2 G) of a tool is its moving mass, at resonance some hundredths of that."""
_MASS_FROM: Final = 20.0
"""Hz; below it a soft arm may look as light as that."""
_NEAR_REST: Final = 6.0
"""Hz below which an arm stands nearly as it does at rest: its lowest mode is above 7 Hz."""
_LIKE_REST: Final = 10.0


def check_size(pair: str, frequency: Array, values: ComplexArray, source: str) -> None:
    """Returns nothing; raises where a curve of the band is too large for a receptance.

    Args:
        pair: Response and excitation axis.
        frequency: (m,) Hz.
        values: (m,) m/N.
        source: Of messages.

    Raises:
        ImplausibleDataError: Softer than 2 N/mm, or lighter than a gram.

    Fails when: a mobility or another unit leaves the curve within that.
    """
    size = np.abs(values)
    softest = float(np.median(size[: max(3, len(size) // 50)]))
    if softest > _SOFTEST:
        raise ImplausibleDataError(
            f"G{pair} is {softest:.3g} m/N at {frequency[0]:g} Hz, {softest * 1e3:.3g} mm "
            f"for every newton; expected at most {_SOFTEST:g} m/N.",
            source=source,
            hint="another unit: um_per_N or mm_per_N, or an accelerance, m_per_s2_per_N.",
        )
    upper = (frequency >= max(_MASS_FROM, np.sqrt(frequency[0] * frequency[-1]))) & (size > 0.0)
    if not upper.any():
        return
    mass = float(np.median(1.0 / ((2.0 * np.pi * frequency[upper]) ** 2 * size[upper])))
    if mass < _LIGHTEST:
        raise ImplausibleDataError(
            f"G{pair} from {frequency[upper][0]:.4g} Hz on is that of a mass of {mass * 1e3:.2g} "
            f"g, expected {_LIGHTEST * 1e3:g} g or more: an accelerance (m/s2/N), or another unit.",
            source=source,
            hint="name the form in the column's unit: m_per_s2_per_N, um_per_N.",
        )


def check_static(frf: FrequencyResponse, pair: str) -> None:
    """Returns nothing; raises where the line at 0 Hz of a direct pair is no static deflection.

    Compared are the lines below 6 Hz, where an arm is hardly turned by its modes yet.

    Raises:
        ImplausibleDataError: Ten times more or less than those lines.
    """
    static = frf.static
    near = (frf.frequency > 0.0) & (frf.frequency <= _NEAR_REST)
    if static is None or pair[0] != pair[1] or not near.any():
        return
    lines = np.abs(frf.pair(pair[0], pair[1])[near])
    low = float(np.median(lines))
    at_rest = float(static[frf.response_axes.index(pair[0]), frf.excitation_axes.index(pair[1])])
    if np.isfinite(at_rest) and not low / _LIKE_REST < at_rest < low * _LIKE_REST:
        raise ImplausibleDataError(
            f"G{pair} is {at_rest:.3g} m/N at 0 Hz and {low:.3g} m/N at the lines up to "
            f"{_NEAR_REST:g} Hz: the line at 0 Hz is no static deflection.",
            source=frf.source,
            hint="leave the line at 0 Hz out, or put the result of a static load test there.",
        )
