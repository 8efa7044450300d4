"""Preferences of one user: language, theme, angles, unit of errors. Saved by the browser.

The choice is in a separate cookie, which does not identify the user; unknown values count as not
chosen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Final
from urllib.parse import parse_qsl

from robotrue.core.units import MM, UM
from robotrue.web.language import LANGUAGES, choose_language

COOKIE: Final = "robotrue_view"
CHOICES: Final[Mapping[str, tuple[str, ...]]] = {
    "language": tuple(LANGUAGES),
    "theme": ("auto", "light", "dark"),
    "angles": ("kuka", "fanuc", "abb", "ur"),
    "unit": ("mm", "um"),
}
ANGLE_NAMES: Final[Mapping[str, tuple[str, ...]]] = {
    "kuka": ("A", "B", "C"),
    "fanuc": ("W", "P", "R"),
    "abb": ("q1", "q2", "q3", "q4"),
    "ur": ("rx", "ry", "rz"),
}
"""What the numbers of an orientation are called by each controller."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Preferences:
    """One person's choices; the values are those of :data:`CHOICES`."""

    language: str = "en"
    theme: str = "auto"
    angles: str = "kuka"
    unit: str = "mm"

    @property
    def letters(self) -> str:
        """Names of the numbers of an orientation."""
        return ", ".join(ANGLE_NAMES[self.angles])

    @property
    def scale(self) -> float:
        """M of one unit of error."""
        return UM if self.unit == "um" else MM

    @property
    def unit_name(self) -> str:
        """The unit of errors as printed."""
        return "µm" if self.unit == "um" else "mm"

    def error(self, length: float) -> str:
        """Returns an error in m as a number in the chosen unit, without it."""
        if not math.isfinite(length):
            return "–"
        return f"{length / self.scale:.0f}" if self.unit == "um" else f"{length / self.scale:.3f}"


def preferences_from(cookies: Mapping[str, str], accept_language: str = "") -> Preferences:
    """Returns the choices in a request's cookies, the browser's language where none was made."""
    chosen = {"language": choose_language(accept_language)}
    stated = dict(parse_qsl(cookies.get(COOKIE, "").replace("%3D", "=").replace("%26", "&")))
    for field in fields(Preferences):
        if stated.get(field.name) in CHOICES[field.name]:
            chosen[field.name] = stated[field.name]
    return Preferences(**chosen)
