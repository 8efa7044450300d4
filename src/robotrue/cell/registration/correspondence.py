"""Which touched point is which part point: swapped names, patterns that fit more than one way."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from robotrue.cell.registration.fit import check_pattern, check_points
from robotrue.core.arrays import Array, IntArray
from robotrue.core.poses import apply, fit_rigid
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError, ShapeError

MOST: Final = 60
"""Points a search over triples is made for."""


def check_names(
    in_part: Array,
    in_base: Array,
    *,
    tolerance: float,
    names: tuple[str, ...] | None = None,
) -> tuple[str, ...]:
    """Returns doubts about the names, one sentence each; swapped names raise.

    Args:
        in_part: (n, 3) m in part.
        in_base: (n, 3) m in base, in the order the names say.
        tolerance: m, how far a good touch may lie from its place: about four sigma of touch and
            robot together.
        names: One per point.

    Raises:
        ImplausibleDataError: The touches fit under other names and not under these.
        ObservabilityError: Coincident or collinear points.
        ShapeError: More points than a search is made for.

    Fails when: a touch is grossly wrong; no complete match then exists and nothing is said. A
    robust fit names it.
    """
    part, base, labels = check_points(in_part, in_base, names)
    given = apply(fit_rigid(part, base), part) - base
    found = matches(part, base, tolerance=tolerance)
    identity = np.arange(len(part))
    if np.linalg.norm(given, axis=1).max() > tolerance and found:
        order = found[0]
        moved = [f"{labels[i]} is {labels[order[i]]}" for i in np.flatnonzero(order != identity)]
        raise ImplausibleDataError(
            f"the touches fit within {tolerance / MM:.2f} mm if names are exchanged "
            f"({', '.join(moved[:6])}{', ...' if len(moved) > 6 else ''}) and are "
            f"{np.linalg.norm(given, axis=1).max() / MM:.2f} mm off as named.",
            hint="correct the names of the touches.",
        )
    others = [order for order in found if (order != identity).any()]
    if not others:
        return ()
    example = ", ".join(f"{labels[i]} for {labels[others[0][i]]}" for i in range(len(labels)))
    return (
        f"The pattern fits {len(others) + 1} ways within {tolerance / MM:.2f} mm (for example "
        f"{example}); only the names say which. Touch one point that breaks the symmetry.",
    )


def matches(points: Array, others: Array, *, tolerance: float) -> tuple[IntArray, ...]:
    """Returns every order in which the others are a rigid image of the points, best first.

    An order o says that ``others[o[i]]`` is the image of ``points[i]``.

    Args:
        points: (n, 3) m.
        others: (n, 3) m, in any frame.
        tolerance: m, of every single point.

    Raises:
        ObservabilityError: Coincident or collinear points.
        ShapeError: Different numbers, or more points than a search is made for.
    """
    n = len(points)
    if len(others) != n or n > MOST:
        raise ShapeError(f"{n} and {len(others)} points, expected equal numbers up to {MOST}.")
    check_pattern(points, tuple(str(i + 1) for i in range(n)))
    triple = _wide_triple(points)
    sides = [float(np.linalg.norm(points[triple[i]] - points[triple[i - 1]])) for i in range(3)]
    apart = np.linalg.norm(others[:, None] - others[None, :], axis=2)
    fits = [np.abs(apart - side) <= 2.0 * tolerance for side in sides]
    # sides[1] joins the first two, sides[2] the last two, sides[0] the first and the last.
    i, j, k = np.nonzero(fits[1][:, :, None] & fits[2][None, :, :] & fits[0][:, None, :])
    found: dict[tuple[int, ...], float] = {}
    for image in zip(i.tolist(), j.tolist(), k.tolist(), strict=True):
        if len(set(image)) < 3:
            continue
        order = _complete_order(points, others, triple, image, tolerance)
        if order is not None and tuple(order) not in found:
            left = apply(fit_rigid(points, others[order]), points) - others[order]
            if np.linalg.norm(left, axis=1).max() <= tolerance:
                found[tuple(int(o) for o in order)] = float((left**2).sum())
    ranked = sorted(found, key=lambda order: found[order])
    return tuple(np.array(order, dtype=np.int64) for order in ranked)


def _wide_triple(points: Array) -> list[int]:
    middle = points.mean(axis=0)
    first = int(np.argmax(np.linalg.norm(points - middle, axis=1)))
    second = int(np.argmax(np.linalg.norm(points - points[first], axis=1)))
    across = np.cross(points - points[first], points[second] - points[first])
    return [first, second, int(np.argmax(np.linalg.norm(across, axis=1)))]


def _complete_order(
    points: Array, others: Array, triple: list[int], image: Sequence[int], tolerance: float
) -> IntArray | None:
    """Returns the whole order a triple's image implies, or None if it is not one to one."""
    T = fit_rigid(points[triple], others[list(image)])
    apart = np.linalg.norm(apply(T, points)[:, None] - others[None, :], axis=2)
    order = np.argmin(apart, axis=1)
    # Three points carry their errors to the far end of the pattern, hence the wider gate here.
    if len(set(order.tolist())) < len(order) or apart.min(axis=1).max() > 4.0 * tolerance:
        return None
    return np.asarray(order, dtype=np.int64)
