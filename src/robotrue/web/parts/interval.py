"""A value with its standard deviation as a small picture: where it lies beside zero, how surely."""

from __future__ import annotations

from typing import Final

WIDTH: Final = 170
MIDDLE: Final = 9


def interval(value: float | None, sd: float | None, span: float) -> str:
    """Returns an SVG of ``value`` and two standard deviations about it, zero in the middle.

    Args:
        value: In some unit; None draws nothing.
        sd: In the same unit; None draws the value alone.
        span: What the ends of the picture stand for.
    """
    if value is None or not span > 0.0:
        return ""

    def place(v: float) -> float:
        return WIDTH / 2 + (WIDTH / 2 - 6) * max(-1.0, min(1.0, v / span))

    band = ""
    if sd is not None:
        band = (
            f'<line class="sd" x1="{place(value - 2 * sd):.1f}" x2="{place(value + 2 * sd):.1f}" '
            f'y1="{MIDDLE}" y2="{MIDDLE}"/>'
        )
    return (
        f'<svg class="interval" viewBox="0 0 {WIDTH} {2 * MIDDLE}" aria-hidden="true">'
        f'<line x1="{WIDTH / 2}" x2="{WIDTH / 2}" y1="1" y2="{2 * MIDDLE - 1}"/>'
        f'{band}<circle cx="{place(value):.1f}" cy="{MIDDLE}" r="3"/></svg>'
    )
