"""Defaults of the spindle axis; imports no numeric library."""

from typing import Final

REFLECTOR_SIGMA_UM: Final = 15.0
"""Of one coordinate of a reflector, as a laser tracker measures it at a few metres."""
