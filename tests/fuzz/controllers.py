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


class Move(NamedTuple):
    """A motion: base and tool (4, 4); target (4, 4), or (6,) axes in rad; auxiliary point.

    The target is None if components are left out. ``follows``: the motion itself computes it, from
    another, with a function that shifts targets. ``step``: what it adds to where the robot is,
    which no correction may change.
    """

    base: np.ndarray
    tool: np.ndarray
    target: np.ndarray | None
    via: bool
    follows: bool = False
    step: np.ndarray = np.zeros(0)


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
