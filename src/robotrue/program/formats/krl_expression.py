"""Evaluates a KRL expression of constants: numbers, points and frames, ``:``, calls of functions.

An expression is evaluated only if every name in it has one value; what a name says is asked of the
caller. ``P:Q`` is the pose Q in the frame P; as on the controller its data type, status, turn and
external axes are those of the right operand.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Final, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import inverse, pose_from_xyz_abc
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM

KrlRecord: TypeAlias = dict[str, float]
"""A structure: its components, in lower case, as printed (mm, deg)."""
KrlValue: TypeAlias = int | float | str | KrlRecord
"""A number, an enumeration value (``#base``) or a structure."""
Lookup: TypeAlias = Callable[[str, str], KrlValue]
"""From a name in lower case and its constant subscript (empty: none) to its value."""

POSE_PARTS: Final = ("x", "y", "z", "a", "b", "c")
AXIS_PARTS: Final = ("a1", "a2", "a3", "a4", "a5", "a6")
_DEEPEST: Final = 40
_DIGITS: Final = 10
_LONGEST: Final = 36
_TOKEN: Final = re.compile(
    r"\s*+(?:(?P<number>(?:\d++(?:\.\d*+)?+|\.\d++)(?:[eE][+-]?\d++)?+)"
    r"|(?P<based>'[BbHh][0-9A-Fa-f]++')|(?P<name>\$?[A-Za-z_]\w*+)|(?P<enum>\#\w++)"
    r"|(?P<sign>[-+*/:(){}\[\],.]))"
)
_FUNCTIONS: Final[Mapping[str, Callable[[float], float]]] = {
    "abs": abs,
    "sqrt": math.sqrt,
    "sin": lambda angle: math.sin(math.radians(angle)),
    "cos": lambda angle: math.cos(math.radians(angle)),
    "tan": lambda angle: math.tan(math.radians(angle)),
}
_TYPES: Final = frozenset(("e6pos", "pos", "frame", "e6axis", "axis"))


class NotConstantError(Exception):
    """An expression has no single value; the text says why.

    Attributes:
        cure: What the user can do about it.
    """

    def __init__(self, why: str, cure: str = "") -> None:
        super().__init__(why)
        self.cure = cure


def evaluate(text: str, lookup: Lookup) -> KrlValue:
    """Returns the value of an expression.

    Raises:
        NotConstantError: It has none, or not one alone.
    """
    parser = _Parser(text, lookup)
    value = parser.sum(0)
    if parser.kind:
        raise NotConstantError(f"{text.strip()[:40]!r} is not evaluated behind {parser.piece!r}")
    return value


def matrix_of(value: KrlValue) -> Array:
    """Returns the pose (4, 4), m, of a structure with all of X, Y, Z, A, B, C.

    Raises:
        NotConstantError: It is none.
    """
    if not isinstance(value, dict) or not all(part in value for part in POSE_PARTS):
        missing = "a number" if not isinstance(value, dict) else "a structure without all six"
        raise NotConstantError(
            f"{missing} stands where a frame belongs", "write all of X, Y, Z, A, B, C"
        )
    printed = np.array([value[part] for part in POSE_PARTS])
    out: Array = pose_from_xyz_abc(printed[:3] * MM, printed[3:] * DEG)
    return out


def record_of(matrix: Array, beside: Mapping[str, float] | None = None) -> KrlRecord:
    """Returns a pose (4, 4), m, as printed, with the status and external axes of another one."""
    printed = [*(matrix[:3, 3] / MM).tolist(), *(abc_from_matrix(matrix[:3, :3]) / DEG).tolist()]
    others = {key: one for key, one in (beside or {}).items() if key not in POSE_PARTS}
    return dict(zip(POSE_PARTS, printed, strict=True)) | others


class _Parser:
    """Recursive descent over one expression."""

    def __init__(self, text: str, lookup: Lookup) -> None:
        self._text, self._lookup, self._at = text, lookup, 0
        self.kind = self.piece = ""
        self._next()

    def _next(self) -> str:
        """Goes to the next token; returns the one before."""
        before = self.piece
        match = _TOKEN.match(self._text, self._at)
        if match is None:
            rest = self._text[self._at :].strip()
            self.kind, self.piece = ("?", rest[:20]) if rest else ("", "")
            return before
        self.kind, self.piece = str(match.lastgroup), str(match[str(match.lastgroup)])
        self._at = match.end()
        return before

    def _take(self, sign: str) -> None:
        if self.piece != sign:
            raise NotConstantError(f"{self._text.strip()[:40]!r} is not evaluated: no {sign!r}")
        self._next()

    def sum(self, depth: int) -> KrlValue:
        """Returns the value of a sum."""
        if depth > _DEEPEST:
            raise NotConstantError("the expression is nested too deep")
        value = self._product(depth)
        while self.kind == "sign" and self.piece in "+-":
            plus = self._next() == "+"
            other = self._product(depth)
            left, right = _number(value), _number(other)
            value = left + right if plus else left - right
        return value

    def _product(self, depth: int) -> KrlValue:
        value = self._chain(depth)
        while self.kind == "sign" and self.piece in "*/":
            times = self._next() == "*"
            left, right = _number(value), _number(self._chain(depth))
            value = left * right if times else _quotient(left, right)
        return value

    def _chain(self, depth: int) -> KrlValue:
        """Returns frames joined by ``:``."""
        value = self._primary(depth)
        while self.piece == ":" and self.kind == "sign":
            self._next()
            other = self._primary(depth)
            matrix = matrix_of(value) @ matrix_of(other)
            value = record_of(matrix, other if isinstance(other, dict) else None)
        return value

    def _primary(self, depth: int) -> KrlValue:
        if self.kind == "sign" and self.piece in "+-":
            minus = self._next() == "-"
            number = _number(self._primary(depth + 1))
            return -number if minus else number
        if self.kind == "number":
            text = self._next()
            return int(text) if text.isdecimal() and len(text) < _DIGITS else float(text)
        if self.kind == "based":
            text = self._next()
            if len(text) > _LONGEST:
                raise NotConstantError("a number is beyond all bounds")
            return int(text[2:-1], 2 if text[1] in "Bb" else 16)
        if self.kind == "enum":
            return self._next().lower()
        if self.piece == "(":
            self._next()
            value = self.sum(depth + 1)
            self._take(")")
            return value
        if self.piece == "{":
            return self._record(depth)
        if self.kind == "name":
            return self._name(depth)
        raise NotConstantError(f"{self._text.strip()[:40]!r} is not evaluated")

    def _record(self, depth: int) -> KrlRecord:
        """Returns ``{TYPE: NAME value,..}``."""
        self._take("{")
        out: KrlRecord = {}
        name = self._next().lower()
        if self.piece == ":":
            if name not in _TYPES:
                raise NotConstantError(f"a structure {name.upper()} is not evaluated")
            self._next()
            name = self._next().lower()
        while True:
            if not name.isidentifier() or name in out:
                raise NotConstantError(f"{self._text.strip()[:40]!r} is not evaluated")
            out[name] = _number(self.sum(depth + 1))
            if self.piece != ",":
                break
            self._next()
            name = self._next().lower()
        self._take("}")
        return out

    def _name(self, depth: int) -> KrlValue:
        name, subscript = self._next().lower(), ""
        if self.piece == "(":
            return self._function(name, depth)
        if self.piece == "[":
            self._next()
            index = [self.sum(depth + 1)]
            while self.piece == ",":
                self._next()
                index.append(self.sum(depth + 1))
            self._take("]")
            if not all(isinstance(each, int) for each in index):
                raise NotConstantError(f"the subscript of {name.upper()} is no whole number")
            subscript = ",".join(str(each) for each in index)
        value = self._lookup(name, subscript)
        while self.piece == ".":
            self._next()
            part = self._next().lower()
            if not isinstance(value, dict) or part not in value:
                raise NotConstantError(f"{name.upper()} has no component {part.upper()} here")
            value = value[part]
        return value

    def _function(self, name: str, depth: int) -> KrlValue:
        self._take("(")
        given = [self.sum(depth + 1)]
        while self.piece == ",":
            self._next()
            given.append(self.sum(depth + 1))
        self._take(")")
        if name == "inv_pos" and len(given) == 1:
            beside = given[0] if isinstance(given[0], dict) else None
            if beside is not None and any(part not in POSE_PARTS for part in beside):
                raise NotConstantError("INV_POS of a point with status or external axes")
            return record_of(inverse(matrix_of(given[0])))
        if name in _FUNCTIONS and len(given) == 1:
            try:
                return _FUNCTIONS[name](_number(given[0]))
            except ValueError:
                raise NotConstantError(f"{name.upper()} has no value here") from None
        if name == "toframe" and len(given) == 1 and isinstance(given[0], dict):
            return {part: given[0][part] for part in POSE_PARTS if part in given[0]}
        raise NotConstantError(f"{name.upper()}(..) is not evaluated", "write its result out")


def _number(value: KrlValue) -> int | float:
    if isinstance(value, dict | str):
        raise NotConstantError("a structure stands where a number belongs")
    if not math.isfinite(value):
        raise NotConstantError("a number is beyond all bounds")
    return value


def _quotient(left: float, right: float) -> float:
    """Returns a quotient; of whole numbers only one without rest, which KRL would cut off."""
    if right == 0:
        raise NotConstantError("a division by zero")
    if isinstance(left, int) and isinstance(right, int):
        if left % right:
            raise NotConstantError(
                "a division of whole numbers leaves a rest", "write one as a decimal number"
            )
        return left // right
    return left / right
