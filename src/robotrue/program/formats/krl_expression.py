"""Evaluates a KRL expression of constants: numbers, points and frames, ``:``, calls of functions.

An expression is evaluated only if every name in it has one value; the caller provides the values of
names. ``P:Q`` is the pose Q in the frame P; as on the controller its data type, status, turn and
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
from robotrue.program.formats.expression import (
    PLAIN_FUNCTIONS,
    UNSIGNED,
    ExpressionReader,
    NotConstantError,
)

KrlRecord: TypeAlias = dict[str, float]
"""A structure: its components, in lower case, as printed (mm, deg)."""
KrlValue: TypeAlias = int | float | str | KrlRecord
"""A number, an enumeration value (``#base``) or a structure."""
Lookup: TypeAlias = Callable[[str, str], KrlValue]
"""From a name in lower case and its constant subscript (empty: none) to its value."""

POSE_PARTS: Final = ("x", "y", "z", "a", "b", "c")
AXIS_PARTS: Final = ("a1", "a2", "a3", "a4", "a5", "a6")
_DIGITS: Final = 10
_LONGEST: Final = 36
_TOKEN: Final = re.compile(
    rf"\s*+(?:{UNSIGNED}"
    r"|(?P<based>'[BbHh][0-9A-Fa-f]++')|(?P<name>\$?[A-Za-z_]\w*+)|(?P<enum>\#\w++)"
    r"|(?P<sign>[-+*/:(){}\[\],.]))"
)
_TYPES: Final = frozenset(("e6pos", "pos", "frame", "e6axis", "axis"))


def evaluate(text: str, lookup: Lookup) -> KrlValue:
    """Returns the value of an expression.

    Raises:
        NotConstantError: It has none, or not one alone.
    """
    return _KrlReader(text, lookup).whole()


def matrix_of(value: KrlValue) -> Array:
    """Returns the pose (4, 4), m, of a structure with all of X, Y, Z, A, B, C.

    Raises:
        NotConstantError: It is none.
    """
    if not isinstance(value, dict) or not all(part in value for part in POSE_PARTS):
        missing = "a number" if not isinstance(value, dict) else "a structure without all six"
        raise NotConstantError(f"{missing} in place of a frame", "write all of X, Y, Z, A, B, C")
    printed = np.array([value[part] for part in POSE_PARTS])
    out: Array = pose_from_xyz_abc(printed[:3] * MM, printed[3:] * DEG)
    return out


def record_of(matrix: Array, beside: Mapping[str, float] | None = None) -> KrlRecord:
    """Returns a pose (4, 4), m, as printed, with the status and external axes of another one."""
    printed = [*(matrix[:3, 3] / MM).tolist(), *(abc_from_matrix(matrix[:3, :3]) / DEG).tolist()]
    others = {key: one for key, one in (beside or {}).items() if key not in POSE_PARTS}
    return dict(zip(POSE_PARTS, printed, strict=True)) | others


class _KrlReader(ExpressionReader[KrlValue]):
    tokens = _TOKEN

    def __init__(self, text: str, lookup: Lookup) -> None:
        super().__init__(text)
        self._lookup = lookup

    def number(self, value: KrlValue) -> int | float:
        if isinstance(value, dict | str):
            raise NotConstantError("a structure in place of a number")
        if not math.isfinite(value):
            raise NotConstantError("a number is beyond all bounds")
        return value

    def factor(self, depth: int) -> KrlValue:
        """Reads frames joined by ``:``."""
        value = self.primary(depth)
        while self.is_sign(":"):
            self.next()
            other = self.primary(depth)
            matrix = matrix_of(value) @ matrix_of(other)
            value = record_of(matrix, other if isinstance(other, dict) else None)
        return value

    def atom(self, depth: int) -> KrlValue:
        if self.kind == "number":
            text = self.next()
            return int(text) if text.isdecimal() and len(text) < _DIGITS else float(text)
        if self.kind == "based":
            text = self.next()
            if len(text) > _LONGEST:
                raise NotConstantError("a number is beyond all bounds")
            return int(text[2:-1], 2 if text[1] in "Bb" else 16)
        if self.kind == "enum":
            return self.next().lower()
        if self.piece == "{":
            return self._record(depth)
        if self.kind == "name":
            return self._name(depth)
        raise self.refuse()

    def _record(self, depth: int) -> KrlRecord:
        """Returns ``{TYPE: NAME value,..}``."""
        self.take("{")
        out: KrlRecord = {}
        name = self.next().lower()
        if self.piece == ":":
            if name not in _TYPES:
                raise NotConstantError(f"a structure {name.upper()} is not evaluated")
            self.next()
            name = self.next().lower()
        while True:
            if not name.isidentifier() or name in out:
                raise self.refuse()
            out[name] = self.number(self.sum(depth + 1))
            if self.piece != ",":
                break
            self.next()
            name = self.next().lower()
        self.take("}")
        return out

    def _name(self, depth: int) -> KrlValue:
        name, subscript = self.next().lower(), ""
        if self.piece == "(":
            return self._function(name, self.read_list(")", depth))
        if self.piece == "[":
            index = self.read_list("]", depth)
            if not all(isinstance(each, int) for each in index):
                raise NotConstantError(f"the subscript of {name.upper()} is no whole number")
            subscript = ",".join(str(each) for each in index)
        value = self._lookup(name, subscript)
        while self.piece == ".":
            self.next()
            part = self.next().lower()
            if not isinstance(value, dict) or part not in value:
                raise NotConstantError(f"{name.upper()} has no component {part.upper()} here")
            value = value[part]
        return value

    def _function(self, name: str, given: list[KrlValue]) -> KrlValue:
        if name == "inv_pos" and len(given) == 1:
            beside = given[0] if isinstance(given[0], dict) else None
            if beside is not None and any(part not in POSE_PARTS for part in beside):
                raise NotConstantError("INV_POS of a point with status or external axes")
            return record_of(inverse(matrix_of(given[0])))
        if name in PLAIN_FUNCTIONS and len(given) == 1:
            return self.call_plain(name, given[0])
        if name == "toframe" and len(given) == 1 and isinstance(given[0], dict):
            return {part: given[0][part] for part in POSE_PARTS if part in given[0]}
        raise NotConstantError(f"{name.upper()}(..) is not evaluated", "write its result out")
