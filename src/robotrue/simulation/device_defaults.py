"""Defaults of simulated devices, without the libraries that simulate them."""

from __future__ import annotations

from typing import Final

LOCAL_HOST: Final = "127.0.0.1"
"""Where they listen or send to: this computer alone."""
MOST_MM: Final = 5.0
"""Correction that a controller takes at most."""
RATE_HZ: Final = 1000.0
"""Records of a force sensor per second."""
HOLES: Final = 20
"""That a drilling machine clamps."""
SHIFT_UM: Final = 50.0
"""By which a sensor's zero is shifted."""
