"""Corrections of poses as a table over a region: its numbers, and how a controller reads them.

A correction is a polynomial in the six coordinates of a pose, or on a grid: trilinear in the
position, and a polynomial in the three turns of the attitude. Its six numbers are a shift of the
tool point and a rotation vector, both in the axes of the tool at the middle attitude. The rotation
is about the tool point.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, product
from typing import Annotated, Final, NamedTuple

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import inverse, pose
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError

SMALLEST_MM: Final = 1.0
"""Side of a region."""
WIDEST_DEG: Final = (180.0, 80.0, 180.0)
"""Turns about z, y and x of the tool; at 90 deg about y only the sum of the others exists."""
DIGITS: Final = (5, 6)
"""Decimals of the mm and the deg that are printed."""
SLACK: Final = 1e-4
"""Share of a side, and of a turn, by which rounding may move a pose outside."""
TOOL_MM: Final = 0.01
"""By which the tool in force may differ from that of the table; as many deg."""
LONGEST_NAME: Final = 16
"""So that the longest variable of a module keeps to KRL's 24 characters."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseRegion(Columns):
    """A box of tool points in a work frame, and turns about a middle attitude.

    Attributes:
        T_base_frame: Work frame in the robot base.
        low: Lowest corner of the box, in the work frame.
        high: Highest corner.
        R_frame_tool: Middle attitude of the tool in the work frame.
        turn: Largest deviation of A, B and C from it, in both directions: Rz(A) Ry(B) Rx(C), axes
            of the tool.
    """

    T_base_frame: Annotated[Array, Column("4 4", unit="m")]
    low: Annotated[Array, Column("3", unit="m")]
    high: Annotated[Array, Column("3", unit="m")]
    R_frame_tool: Annotated[Array, Column("3 3")]
    turn: Annotated[Array, Column("3", unit="rad")]

    def _check_rules(self) -> None:
        sides = (self.high - self.low) / MM
        if not (sides >= SMALLEST_MM).all():
            raise ConfigurationError(
                f"the box has sides of {_join(sides)} mm, expected {SMALLEST_MM:g} or more each.",
                hint="--box-mm X0,X1,Y0,Y1,Z0,Z1",
            )
        turn = self.turn / DEG
        if not ((turn > 0.0) & (turn <= WIDEST_DEG)).all():
            raise ConfigurationError(
                f"the attitude may turn by {_join(turn)} deg about z, y and x of the tool, "
                f"expected more than 0 and up to {_join(np.array(WIDEST_DEG))}.",
                hint="--turn-deg 10,5,5",
            )

    @property
    def T_base_corner(self) -> Array:
        """(4, 4) the work frame, moved into the lowest corner of the box."""
        return np.asarray(self.T_base_frame @ pose(np.eye(3), self.low))

    def place_poses(self, share: Array) -> tuple[Array, Array]:
        """Returns positions (n, 3) m and rotations (n, 3, 3) in the work frame.

        Args:
            share: (n, 6) of the sides from 0 to 1, and of the turns A, B, C from -1 to 1.
        """
        position = self.low + (self.high - self.low) * share[:, :3]
        return position, self.R_frame_tool @ matrix_from_abc(self.turn * share[:, 3:])


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectionTable(Columns):
    """Corrections over a region.

    Attributes:
        region: Of its poses.
        cells: Of the grid, along x, y and z; zeros: no grid.
        powers: Of the shares of x, y, z, A, B and C in each term, from -1 to 1; with a grid those
            of the position are 0.
        values: Of each node (x slowest) and term: shift m, rotation vector rad; as printed.
    """

    region: PoseRegion
    cells: Annotated[IntArray, Column("3")]
    powers: Annotated[IntArray, Column("t 6")]
    values: Annotated[Array, Column("m t 6")]

    @property
    def numbers(self) -> int:
        """Count of the numbers in a controller."""
        return self.values.size

    def interpolate(self, share: Array) -> Array:
        """Returns corrections (n, 6): shift m, rotation vector rad, axes of the middle attitude."""
        terms = pose_terms(self.powers, share)
        if not self.cells.any():
            return np.asarray(terms @ self.values[0])
        x = share[:, :3] * self.cells
        cell = np.clip(np.floor(x), 0, self.cells - 1).astype(np.int64)
        x, nodes = x - cell, self.cells + 1
        correction = np.zeros((len(share), 6))
        for corner in product((0, 1), repeat=3):
            weight = np.where(corner, x, 1.0 - x).prod(axis=1)
            a, b, c = (cell + corner).T
            node = self.values[(a * nodes[1] + b) * nodes[2] + c]
            correction += weight[:, None] * np.einsum("nt,ntk->nk", terms, node)
        return correction


def pose_terms(powers: IntArray, share: Array) -> Array:
    """Returns the terms (n, t) of poses (n, 6), see :meth:`PoseRegion.place_poses`."""
    centred = np.concatenate([2.0 * share[:, :3] - 1.0, share[:, 3:]], axis=1)
    terms = np.ones((len(share), len(powers)))
    for axis in range(6):
        if powers[:, axis].any():
            terms *= centred[:, [axis]] ** powers[:, axis]
    return terms


def choose_powers(degrees: IntArray, mixed: float, most: int) -> IntArray | None:
    """Returns the powers (t, 6) of a polynomial, or None where there are more than ``most``.

    Each is one of those before it times one coordinate, so that products build them up.

    Args:
        degrees: (6,) highest power of each coordinate.
        mixed: Most that the powers of a term, as shares of their degrees, add up to.
        most: Terms.
    """
    chosen = list(islice(_list_powers(degrees.tolist(), mixed + 1e-9), most + 1))
    if len(chosen) > most:
        return None
    return np.array(sorted(chosen, key=lambda powers: (sum(powers), powers)), dtype=np.int64)


def _list_powers(degrees: list[int], mixed: float) -> Iterator[tuple[int, ...]]:
    if not degrees:
        yield ()
        return
    for power in range(degrees[0] + 1):
        share = power / max(degrees[0], 1)
        if share <= mixed:
            for others in _list_powers(degrees[1:], mixed - share):
                yield (power, *others)


def round_values(values: Array) -> Array:
    """Returns shifts m and rotation vectors rad as they are printed in mm and deg."""
    shift = np.round(values[..., :3] / MM, DIGITS[0]) * MM
    turn = np.round(values[..., 3:] / DEG, DIGITS[1]) * DEG
    return np.concatenate([shift, turn], axis=-1)


class TableModule(NamedTuple):
    """A table as a module of a controller.

    Attributes:
        table: Its numbers.
        name: Of the module and its function.
        T_world_base: The robot's base in the controller's world.
        T_flange_tool: The tool it holds for.
        remarks: Lines of its comment.
    """

    table: CorrectionTable
    name: str
    T_world_base: Array
    T_flange_tool: Array
    remarks: tuple[str, ...]

    @property
    def T_corner_world(self) -> Array:
        """(4, 4) the controller's world in the lowest corner of the box."""
        return inverse(self.T_world_base @ self.table.region.T_base_corner)

    @property
    def T_attitude_corner(self) -> Array:
        """(4, 4) the axes of the corner in those of the middle attitude."""
        return pose(self.table.region.R_frame_tool.T, np.zeros(3))

    def template_fields(self, name: str, sums: str) -> dict[str, str | list[str]]:
        """Returns what the body of a function needs in any language.

        Args:
            name: Of the function, as the language writes it.
            sums: Template of the statements that add up the terms.
        """
        region, terms = self.table.region, len(self.table.powers)
        return {
            "name": name,
            "terms": str(terms),
            "side": [f"{value:.4f}" for value in (region.high - region.low) / MM],
            "turn": [f"{value:.6f}" for value in region.turn / DEG],
            "sums": sums.format(name=name, terms=terms, cells=self.table.cells.tolist()),
            "tool": f"{TOOL_MM:g}",
            "slack": f"{SLACK:g}",
            "half": f"{0.5 * DEG:.9f}",
        }

    def print_products(self, term: str, share: str, brackets: str) -> list[str]:
        """Returns the right sides that build the terms after the first, ``W[1]*V[2]``."""
        rows = self.table.powers.tolist()
        out = []
        for powers in rows[1:]:
            axis = next(k for k in range(6) if powers[k])
            lower = [value - (k == axis) for k, value in enumerate(powers)]
            opening, closing = brackets[0], brackets[1]
            before = f"{term}{opening}{rows.index(lower) + 1}{closing}"
            out.append(f"{before}*{share}{opening}{axis + 1}{closing}")
        return out


def print_term(term: Array) -> Sequence[str]:
    """Returns shift (mm) and rotation vector (deg) of a term (6,) as text."""
    shift = (f"{value + 0.0:.{DIGITS[0]}f}" for value in term[:3] / MM)
    turn = (f"{value + 0.0:.{DIGITS[1]}f}" for value in term[3:] / DEG)
    return (*shift, *turn)


def require_module_name(name: str) -> None:
    """Refuses a name that a controller does not take.

    Raises:
        ConfigurationError: It is no identifier of letters, digits and underscores, or too long.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) or len(name) > LONGEST_NAME:
        raise ConfigurationError(
            f"{name!r} is the name of the function, expected a letter and up to "
            f"{LONGEST_NAME - 1} letters, digits and underscores.",
            hint="-o rt_fix.src",
        )


def _join(values: Array) -> str:
    return ", ".join(f"{value:g}" for value in values)
