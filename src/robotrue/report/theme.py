"""The look of the page: one palette in two lightings, no foreign host; the style is in page.css.

Plots are drawn in the light palette's exact colours; :mod:`robotrue.report.figure` turns each of
these colours into its CSS variable, so one SVG serves light, dark and print.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

LIGHT: Final = {
    "page": "#f4f6f8",
    "card": "#fefefe",
    "ink": "#1a2430",
    "muted": "#5a6877",
    "rule": "#d8dee5",
    "before": "#c2571a",
    "after": "#0f6cab",
    "good": "#1d7a46",
    "caution": "#9a6a00",
    "bad": "#b3261e",
    "band": "#dce9f4",
}
DARK: Final = {
    "page": "#12171d",
    "card": "#1a2129",
    "ink": "#e4e9ee",
    "muted": "#99a6b3",
    "rule": "#34404c",
    "before": "#f09a5b",
    "after": "#6bb5f0",
    "good": "#62c68c",
    "caution": "#e0b04a",
    "bad": "#f2827a",
    "band": "#22384b",
}


def css_variables(palette: dict[str, str]) -> str:
    """Returns the colours of a palette as CSS custom properties."""
    return "".join(f"--{name}:{value};" for name, value in palette.items())


STYLE: Final = (
    ":root{color-scheme:light dark;"
    + css_variables(LIGHT)
    + "}@media (prefers-color-scheme:dark){:root{"
    + css_variables(DARK)
    + "}}@media print{:root{color-scheme:light;"
    + css_variables(LIGHT | {"page": "#fefefe"})
    + "}}\n"
    + (Path(__file__).parent / "page.css").read_text(encoding="utf-8")
)
