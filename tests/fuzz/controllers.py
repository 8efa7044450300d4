"""What the small controllers of all languages share: motions, their end, text and expressions."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np

MOST_STEPS = 600
BINARY: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Mod: operator.mod,
    ast.Div: operator.truediv,
}  # fmt: skip
COMPARE: Mapping[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.LtE: operator.le, ast.GtE: operator.ge,
    ast.Lt: operator.lt, ast.Gt: operator.gt,
}  # fmt: skip


class Ended(Exception):
    """The run ends early: a variable without a value, or too many steps."""


ON_ARC = 2e-5
"""m: what the printed digits of a centre and two ends leave."""


class Arc(NamedTuple):
    """An arc in a plane: its axes, centre (2,) and radius in m, angle of its middle, half sweep."""

    flat: tuple[int, int]
    centre: np.ndarray
    radius: float
    middle: float
    half: float

    def miss(self, goal: np.ndarray) -> float:
        """How far (m) a point is from the arc in its plane; the reach of its ends is none."""
        away = goal[list(self.flat)] - self.centre
        turn = np.arctan2(away[1], away[0]) - self.middle
        if abs(np.arctan2(np.sin(turn), np.cos(turn))) > abs(self.half) + 1e-9:
            return np.inf
        return max(abs(float(np.hypot(*away)) - self.radius) - ON_ARC, 0.0)


class Move(NamedTuple):
    """A motion: base and tool (4, 4); target (4, 4), or (6,) axes in rad; auxiliary point.

    The target is None if components are left out. ``follows``: the motion itself computes it, from
    another, with a function that shifts targets. ``step``: what it adds to where the robot is,
    which no correction may change. ``told``: columns of its matrix that the program states.
    ``arc``: that of whose middle it is. ``within``: coordinates that the motion can state.
    """

    base: np.ndarray
    tool: np.ndarray
    target: np.ndarray | None
    via: bool
    follows: bool = False
    step: np.ndarray = np.zeros(0)
    told: tuple[int, ...] = (0, 1, 2)
    arc: Arc | None = None
    within: tuple[int, ...] = (0, 1, 2)

    def miss(self, goal: np.ndarray) -> tuple[float, float]:
        """How far the motion ends from a goal: m, and elements of a matrix or rad of an axis."""
        assert self.target is not None
        apart = np.abs(self.target - goal)
        if goal.ndim == 1:
            return 0.0, float(apart.max())
        place = self.arc.miss(goal[:3, 3]) if self.arc else float(apart[list(self.within), 3].max())
        turn = 0.0 if self.via else float(apart[:3, list(self.told)].max(initial=0.0))
        return place, turn


class Controller(Protocol):
    """Runs a job again and again; what it moves to is kept in order."""

    moves: list[Move]

    def run(self) -> bool:
        """Runs the job from its start; returns whether it came to its end."""
        ...


def split(text: str, mark: str) -> list[str]:
    """The parts between marks outside of brackets."""
    parts, depth, begin = [], 0, 0
    for at, sign in enumerate(text):
        depth += (sign in "{[(") - (sign in "}])")
        if sign == mark and depth == 0:
            parts.append(text[begin:at])
            begin = at + 1
    return [*parts, text[begin:]]
