"""Evaluates a RAPID expression of constants: numbers, positions, poses and targets.

An expression is evaluated only if every name in it has one value; the caller provides the values of
names. Structures are tuples as RAPID writes them in brackets; mm and deg as printed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from itertools import chain
from typing import Final, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import inverse, pose
from robotrue.core.rotations import matrix_from_quat_wxyz, quat_wxyz_from_matrix
from robotrue.core.units import MM
from robotrue.program.formats.expression import (
    PLAIN_FUNCTIONS,
    UNSIGNED,
    ExpressionReader,
    NotConstantError,
)

RapidValue: TypeAlias = "float | bool | str | tuple[RapidValue, ...]"
"""A number, truth, string, or a structure or array of them."""
Lookup: TypeAlias = Callable[[str], RapidValue]
"""From a name in lower case to its value."""

MEMBERS: Final = {
    name: place
    for names in (
        "trans rot robconf extax", "x y z", "q1 q2 q3 q4", "cf1 cf4 cf6 cfx",
        "eax_a eax_b eax_c eax_d eax_e eax_f", "robax", "rax_1 rax_2 rax_3 rax_4 rax_5 rax_6",
    )
    for place, name in enumerate(names.split())
}  # fmt: skip
"""Place of every component in its structure."""
_TOKEN: Final = re.compile(
    rf"\s*+(?:{UNSIGNED}"
    r"|(?P<name>[A-Za-z_\x80-\xff][\w\x80-\xff]*+)|(?P<sign>:=|[-+*/()\[\]{},.\\]))"
)


def evaluate_rapid(text: str, lookup: Lookup) -> RapidValue:
    """Returns the value of an expression.

    Raises:
        NotConstantError: It has none, or not one alone.
    """
    return _RapidReader(text, lookup).whole()


def pose_of(value: RapidValue) -> Array:
    """Returns the pose (4, 4), m, of a pose or robtarget.

    Raises:
        NotConstantError: It is none.
    """
    if not isinstance(value, tuple) or len(value) not in (2, 4):
        raise NotConstantError("a value in place of a pose")
    trans, rot = _vector(value[0], 3), _vector(value[1], 4)
    length = math.hypot(*rot.tolist())  # no overflow, however large a number is
    if not 0.5 < length < 2.0:
        raise NotConstantError("a quaternion is far from length 1")
    out: Array = pose(matrix_from_quat_wxyz(rot), trans * MM)
    return out


def flat_numbers(value: RapidValue, kind: int) -> tuple[float, ...]:
    """Returns the 17 columns of a robtarget (kind 0) or jointtarget (kind 1), NaN where none is.

    Raises:
        NotConstantError: It is none.
    """
    shape = ((3, 4, 4, 6), (6, 6))[kind]
    if not isinstance(value, tuple) or len(value) != len(shape):
        raise NotConstantError("it is no target")
    rows = [_vector(part, count).tolist() for part, count in zip(value, shape, strict=True)]
    if kind == 0:
        return tuple(chain.from_iterable(rows))
    return (*rows[0], *[math.nan] * 5, *rows[1])


def printed_pose(matrix: Array, near: RapidValue) -> tuple[RapidValue, RapidValue]:
    """Returns position and quaternion of a pose (4, 4), m, on the side of another quaternion."""
    rot = quat_wxyz_from_matrix(matrix[:3, :3])
    if float(rot @ _vector(near, 4)) < 0.0:
        rot = -rot
    return tuple((matrix[:3, 3] / MM).tolist()), tuple(rot.tolist())


def _vector(value: RapidValue, count: int) -> Array:
    if not isinstance(value, tuple) or len(value) != count:
        raise NotConstantError(f"a value in place of {count} numbers")
    return np.array([_number(each) for each in value])


def _number(value: RapidValue) -> float:
    if isinstance(value, bool | str | tuple) or not math.isfinite(value):
        raise NotConstantError("a value in place of a number")
    return float(value)


class _RapidReader(ExpressionReader[RapidValue]):
    tokens = _TOKEN

    def __init__(self, text: str, lookup: Lookup) -> None:
        super().__init__(text)
        self._lookup = lookup

    def number(self, value: RapidValue) -> float:
        return _number(value)

    def add(self, left: RapidValue, right: RapidValue, *, plus: bool) -> RapidValue:
        """Returns a sum of numbers or positions."""
        if not isinstance(left, tuple):
            return super().add(left, right, plus=plus)
        sign = 1.0 if plus else -1.0
        return tuple((_vector(left, 3) + sign * _vector(right, 3)).tolist())

    def multiply(self, left: RapidValue, right: RapidValue, *, times: bool) -> RapidValue:
        """Returns a product of numbers, or of a position and a number."""
        if isinstance(left, tuple) and times and not isinstance(right, tuple):
            return tuple((_vector(left, 3) * _number(right)).tolist())
        return super().multiply(left, right, times=times)

    def atom(self, depth: int) -> RapidValue:
        if self.kind == "number":
            return float(self.next())
        if self.piece == "[":
            return tuple(self.read_list("]", depth))
        if self.kind == "name":
            return self._name(depth)
        raise self.refuse()

    def _name(self, depth: int) -> RapidValue:
        name = self.next().lower()
        if name in ("true", "false"):
            return name == "true"
        if self.piece == "(":
            value = self._function(name, depth)
        else:
            value = self._lookup(name)
        if self.piece == "{":
            for index in self.read_list("}", depth):
                value = _element(value, _number(index))
        while self.piece == ".":
            self.next()
            member = MEMBERS.get(self.next().lower(), -1)
            if not isinstance(value, tuple) or not 0 <= member < len(value):
                raise NotConstantError(f"a component of {name!r} is not evaluated")
            value = value[member]
        return value

    def _function(self, name: str, depth: int) -> RapidValue:
        given: list[RapidValue] = []
        options: dict[str, RapidValue] = {}
        self.take("(")
        while self.piece != ")":
            if self.piece == "\\":
                self.next()
                option = self.next().lower()
                self.take(":=")
                options[option] = self.sum(depth + 1)
            elif self.piece == ",":
                self.next()
            else:
                given.append(self.sum(depth + 1))
        self.take(")")
        if name in PLAIN_FUNCTIONS and len(given) == 1 and not options:
            return self.call_plain(name, given[0])
        function = _FUNCTIONS.get(name)
        if function is None or len(given) != function[0]:
            raise NotConstantError(f"{name}(..) is not evaluated", "write its result out")
        if options and name not in ("reltool",):
            raise NotConstantError(f"{name}(..) with options is not evaluated")
        return function[1](given, options)


def _element(value: RapidValue, index: float) -> RapidValue:
    if not isinstance(value, tuple) or index != int(index) or not 1 <= index <= len(value):
        raise NotConstantError("an element that is not there")
    return value[int(index) - 1]


def _target(value: RapidValue) -> tuple[RapidValue, ...]:
    if not isinstance(value, tuple) or len(value) != 4:
        raise NotConstantError("a value in place of a robtarget")
    return value


def _offs(given: list[RapidValue], _: dict[str, RapidValue]) -> RapidValue:
    """Evaluates Offs, in the axes of the work object."""
    target = _target(given[0])
    moved = _vector(target[0], 3) + [_number(each) for each in given[1:]]
    return (tuple(moved.tolist()), *target[1:])


def _reltool(given: list[RapidValue], options: dict[str, RapidValue]) -> RapidValue:
    """Evaluates RelTool, in tool axes: the shift, then turns about x, the new y and the new z."""
    target = _target(given[0])
    if set(options) - {"rx", "ry", "rz"}:
        raise NotConstantError("RelTool(..) with this option is not evaluated")
    T = pose_of(target)
    by = np.eye(4)
    by[:3, 3] = np.array([_number(each) for each in given[1:]]) * MM
    for axis, name in enumerate(("rx", "ry", "rz")):
        if name in options:
            by[:3, :3] = by[:3, :3] @ _turn(axis, math.radians(_number(options[name])))
    return (*printed_pose(T @ by, target[1]), *target[2:])


def _turn(axis: int, angle: float) -> Array:
    half = np.zeros(4)
    half[0], half[1 + axis] = math.cos(angle / 2), math.sin(angle / 2)
    out: Array = matrix_from_quat_wxyz(half)
    return out


_UNTURNED: Final = (1.0, 0.0, 0.0, 0.0)


def _orient_zyx(given: list[RapidValue], _: dict[str, RapidValue]) -> RapidValue:
    turns = [
        _turn(axis, math.radians(_number(one))) for axis, one in zip((2, 1, 0), given, strict=True)
    ]
    return tuple(quat_wxyz_from_matrix(turns[0] @ turns[1] @ turns[2]).tolist())


def _pose_mult(given: list[RapidValue], _: dict[str, RapidValue]) -> RapidValue:
    return printed_pose(pose_of(given[0]) @ pose_of(given[1]), _UNTURNED)


def _pose_inv(given: list[RapidValue], _: dict[str, RapidValue]) -> RapidValue:
    return printed_pose(inverse(pose_of(given[0])), _UNTURNED)


def _pose_vect(given: list[RapidValue], _: dict[str, RapidValue]) -> RapidValue:
    T = pose_of(given[0])
    return tuple(((T[:3, :3] @ _vector(given[1], 3)) + T[:3, 3] / MM).tolist())


_FUNCTIONS: Final[dict[str, tuple[int, Callable[..., RapidValue]]]] = {
    "offs": (4, _offs),
    "reltool": (4, _reltool),
    "orientzyx": (3, _orient_zyx),
    "posemult": (2, _pose_mult),
    "poseinv": (1, _pose_inv),
    "posevect": (2, _pose_vect),
}
PURE: Final = frozenset(_FUNCTIONS) | PLAIN_FUNCTIONS.keys()
"""Functions that change nothing handed over."""
