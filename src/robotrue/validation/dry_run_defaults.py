"""Defaults of a dry run; imports no numeric library."""

from typing import Final

POINTS: Final = 39
"""Along a program, as in Table 9 of Deng et al. 2022."""
