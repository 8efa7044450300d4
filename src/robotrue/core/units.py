"""Unit constants: multiply on the way in, divide on the way out.

Inside robotrue every number is SI. ``x_mm * MM`` is metres, ``x / MM`` is millimetres.
"""

from __future__ import annotations

import math
from typing import Final

MM: Final = 1e-3
"""One millimetre in metres."""
UM: Final = 1e-6
"""One micrometre in metres."""
DEG: Final = math.pi / 180.0
"""One degree in radians."""
STANDARD_GRAVITY: Final = 9.80665
"""m/s^2, exact by definition (CGPM 1901)."""
ZERO_CELSIUS: Final = 273.15
"""K at 0 deg C, exact by definition."""
