"""A table of corrections over a region, just fine enough for a tolerance.

Along lines through the region one coordinate at a time shows how fine a grid, and of which degree a
polynomial has to be; poses anywhere in the region then show what the whole table leaves. The
smallest one that leaves little enough is taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Annotated, Final, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from robotrue.compensation.region_corrections import RegionArm, random_shares
from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, StepError
from robotrue.program.correction_table import (
    CorrectionTable,
    choose_powers,
    pose_terms,
    round_values,
)

LEVER: Final = 0.1
"""m from the tool point at which an error of attitude counts as much as one of position."""
CHECKED: Final = 4000
"""Poses that show what a table leaves."""
MOST_CELLS: Final = 24
MOST_DEGREE: Final = 12
MOST_TERMS: Final = 400
_LINES, _ALONG = 24, 49
_SHARES: Final = (0.6, 0.42, 0.3, 0.2, 0.14, 0.1)
"""Of the tolerance, along one coordinate."""
_MIXED: Final = (1.0, 1.5, 2.0, 2.5, 3.0)
"""Number of products of turns in a polynomial, see :func:`choose_powers`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedTable(Columns):
    """A table, and what it leaves at ``CHECKED`` poses anywhere in the region and its corners.

    Attributes:
        table: As printed.
        before: (n,) m, size of the correction.
        left: (n,) m, distance of the tool point from where the model's own correction takes it.
        turn_left: (n,) rad, the same of the attitude.
        joint_range: (6, 2) rad, nominal joints at those poses, model's sense.
    """

    table: CorrectionTable
    before: Annotated[Array, Column("n", unit="m")]
    left: Annotated[Array, Column("n", unit="m")]
    turn_left: Annotated[Array, Column("n", unit="rad")]
    joint_range: Annotated[Array, Column("6 2", unit="rad")]

    @property
    def largest(self) -> float:
        """Largest error in m, of position or of attitude at ``LEVER``."""
        return float(max(self.left.max(), LEVER * self.turn_left.max()))


def fit_table(arm: RegionArm, *, tolerance: float, most_numbers: int) -> FittedTable:
    """Returns the smallest table that keeps a tolerance.

    Args:
        arm: In its configuration.
        tolerance: m, between a pose corrected by the table and one corrected by the model.
        most_numbers: That the controller may hold.

    Raises:
        ConfigurationError: An invalid tolerance or number.
        ReachError: A pose of the region cannot be compensated.
        StepError: No table of that size keeps the tolerance.
    """
    if not tolerance > 0.0 or most_numbers < 1:
        raise ConfigurationError(
            f"tolerance {tolerance / MM:g} mm and {most_numbers} numbers, expected above 0."
        )
    share = np.concatenate([random_shares(CHECKED, seed=0), _corners()])
    exact = arm.solve(share)
    arm.require_fine(share, exact)
    best, needed = None, 0
    for size in _list_sizes(arm, tolerance, most_numbers):
        needed = size.numbers
        if needed > most_numbers:
            break
        table = _fill_table(arm, size)
        tried = _measure(table, share, exact.correction, exact.joints)
        if tried.largest <= tolerance:
            return tried
        best = tried if best is None or tried.largest < best.largest else best
    left = "" if best is None else f"{best.table.numbers} leave {best.largest / MM:.4f} mm, "
    raise StepError(
        f"no table of up to {most_numbers} numbers keeps {tolerance / MM:g} mm over the region: "
        f"{left}the next one has {needed}.",
        hint="a smaller --box-mm, less --turn-deg, more --tolerance-mm or --max-numbers; errors "
        "that change quickly with a joint (gears) fit no grid.",
    )


class _Size(NamedTuple):
    """A table that may do.

    Attributes:
        cells: (3,) of the grid; zeros: none.
        degrees: (6,) of the polynomial.
        powers: (t, 6) of its terms.
    """

    cells: IntArray
    degrees: IntArray
    powers: IntArray

    @property
    def numbers(self) -> int:
        """How many numbers it has."""
        return int((self.cells + 1).prod()) * self.powers.size


def _list_sizes(arm: RegionArm, tolerance: float, most_numbers: int) -> list[_Size]:
    """Returns tables that may do, with and without a grid, those of fewer numbers first."""
    lines = [_probe_line(arm, axis) for axis in range(6)]
    none = np.zeros(3, dtype=np.int64)
    sizes: dict[bytes, _Size] = {}
    for part in _SHARES:
        degrees = np.array([_find_degree(line, part * tolerance) for line in lines])
        cells = np.array([_count_cells(line, part * tolerance) for line in lines[:3]])
        turned = np.concatenate([none, degrees[3:]])
        for grid, degree, mixed in product((none, cells), (degrees, turned), _MIXED):
            if grid.any() != (degree is turned):
                continue
            powers = choose_powers(degree, mixed, MOST_TERMS)
            if powers is not None:
                size = _Size(grid, degree, powers)
                sizes[grid.tobytes() + powers.tobytes()] = size
    return sorted(sizes.values(), key=lambda size: size.numbers)


def _corners() -> Array:
    return np.array(list(product(*[(0.0, 1.0)] * 3, *[(-1.0, 1.0)] * 3)))


def _measure(table: CorrectionTable, share: Array, exact: Array, joints: Array) -> FittedTable:
    away = table.interpolate(share) - exact
    return FittedTable(
        table=table,
        before=np.linalg.norm(exact[:, :3], axis=1),
        left=np.linalg.norm(away[:, :3], axis=1),
        turn_left=np.linalg.norm(away[:, 3:], axis=1),
        joint_range=np.stack([joints.min(axis=0), joints.max(axis=0)], axis=1),
    )


def _probe_line(arm: RegionArm, axis: int) -> Array:
    """Returns corrections (lines, along, 6) in m along one coordinate, the others anywhere."""
    share = np.repeat(random_shares(_LINES, seed=2 + axis)[:, None], _ALONG, axis=1)
    share[:, :, axis] = np.linspace(0.0 if axis < 3 else -1.0, 1.0, _ALONG)
    share = share.reshape(-1, 6)
    solved = arm.solve(share)
    arm.require_fine(share, solved)
    return solved.correction.reshape(_LINES, _ALONG, 6) * [1.0, 1.0, 1.0, LEVER, LEVER, LEVER]


def _largest(away: Array) -> float:
    sizes = np.linalg.norm(away.reshape(*away.shape[:-1], 2, 3), axis=-1)
    return float(sizes.max())


def _count_cells(line: Array, tolerance: float) -> int:
    """Returns the fewest cells between which straight lines keep the tolerance."""
    at = np.linspace(0.0, 1.0, _ALONG)
    for cells in range(1, MOST_CELLS + 1):
        nodes = np.linspace(0.0, 1.0, cells + 1)
        place = np.clip(np.searchsorted(nodes, at, side="right") - 1, 0, cells - 1)
        share = (at - nodes[place]) * cells
        known = _between(line, nodes)
        drawn = known[:, place] * (1 - share)[:, None] + known[:, place + 1] * share[:, None]
        if _largest(drawn - line) <= tolerance:
            return cells
    return MOST_CELLS + 1


def _between(line: Array, nodes: Array) -> Array:
    """Returns the values (lines, k, 6) at nodes, between the two adjacent places of each."""
    x = nodes * (_ALONG - 1)
    low = np.minimum(x.astype(np.int64), _ALONG - 2)
    share = (x - low)[:, None]
    return np.asarray(line[:, low] * (1 - share) + line[:, low + 1] * share)


def _find_degree(line: Array, tolerance: float) -> int:
    """Returns the lowest degree of a polynomial that keeps the tolerance."""
    at = np.linspace(-1.0, 1.0, _ALONG)
    flat = np.moveaxis(line, 1, 0).reshape(_ALONG, -1)
    for degree in range(MOST_DEGREE + 1):
        basis = chebyshev.chebvander(at, degree)
        away = flat - basis @ np.linalg.lstsq(basis, flat, rcond=None)[0]
        if _largest(np.moveaxis(away.reshape(_ALONG, -1, 6), 0, 1)) <= tolerance:
            return degree
    return MOST_DEGREE + 1


def _fill_table(arm: RegionArm, size: _Size) -> CorrectionTable:
    """Returns the table: at each node the polynomial that fits best."""
    if size.cells.any():
        axes = (np.linspace(0.0, 1.0, count + 1) for count in size.cells)
        nodes = np.array(list(product(*axes)))
        turns = np.array(list(product(*(_towards_ends(int(d)) for d in size.degrees[3:]))))
    else:
        nodes = np.empty((1, 0))
        turns = random_shares(200 + 5 * len(size.powers), seed=9)
        turns[:, 3:] = np.sin(0.5 * np.pi * turns[:, 3:])
        turns[:, :3] = 0.5 - 0.5 * np.cos(np.pi * turns[:, :3])
    share = np.concatenate(
        [np.repeat(nodes, len(turns), axis=0), np.tile(turns, (len(nodes), 1))], axis=1
    )
    solved = arm.solve(share)
    arm.require_fine(share, solved)
    known = np.moveaxis(solved.correction.reshape(len(nodes), len(turns), 6), 1, 0)
    basis = pose_terms(size.powers, share[: len(turns)])
    fitted = np.linalg.lstsq(basis, known.reshape(len(turns), -1), rcond=None)[0]
    shaped: Array = np.asarray(fitted).reshape(len(size.powers), len(nodes), 6)
    values = np.moveaxis(shaped, 0, 1)
    return CorrectionTable(
        region=arm.region, cells=size.cells, powers=size.powers, values=round_values(values)
    )


def _towards_ends(degree: int) -> Array:
    """Returns shares of a turn: enough for a degree, and closer towards the ends."""
    count = degree + 2
    return np.asarray(np.cos(np.pi * np.arange(count) / (count - 1)))
