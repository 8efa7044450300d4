"""Evaluates an expression of constants of a program, in any language.

An expression is evaluated only if every name in it has one value. A language derives its reader
with the tokens, values and functions it has; the caller provides the values of names.
"""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import ClassVar, Final, Generic, TypeVar, cast

Value = TypeVar("Value")
"""What expressions of a language evaluate to; numbers are among it."""

UNSIGNED: Final = r"(?P<number>(?:\d++(?:\.\d*+)?+|\.\d++)(?:[eE][+-]?\d++)?+)"
PLAIN_FUNCTIONS: Final[Mapping[str, Callable[[float], float]]] = {
    "abs": abs,
    "sqrt": math.sqrt,
    "sin": lambda angle: math.sin(math.radians(angle)),
    "cos": lambda angle: math.cos(math.radians(angle)),
    "tan": lambda angle: math.tan(math.radians(angle)),
}
"""Functions of one number that all languages have; angles in deg."""
_DEEPEST: Final = 40


class NotConstantError(Exception):
    """An expression has no single value; with the cause.

    Attributes:
        cure: What the user can do about it.
    """

    def __init__(self, why: str, cure: str = "") -> None:
        super().__init__(why)
        self.cure = cure


class ExpressionReader(ABC, Generic[Value]):
    """Recursive descent over one expression.

    Attributes:
        tokens: The groups ``number``, ``sign`` (one character mostly) and those of the language.
        kind: Group of the token that is read next; empty at the end.
        piece: Its text.
    """

    tokens: ClassVar[re.Pattern[str]]

    def __init__(self, text: str) -> None:
        self._text, self._at = text, 0
        self.kind = self.piece = ""
        self.next()

    def whole(self) -> Value:
        """Returns the value of the whole text.

        Raises:
            NotConstantError: It has none, or not one alone.
        """
        value = self.sum(0)
        if self.kind:
            raise NotConstantError(f"{self.shown} is not evaluated behind {self.piece!r}")
        return value

    @abstractmethod
    def number(self, value: Value) -> int | float:
        """Returns a value that is a number.

        Raises:
            NotConstantError: It is none, or is not finite.
        """

    @abstractmethod
    def atom(self, depth: int) -> Value:
        """Reads what begins with neither a sign nor a bracket: a number, a name, a structure."""

    def factor(self, depth: int) -> Value:
        """Reads what products are made of."""
        return self.primary(depth)

    def add(self, left: Value, right: Value, *, plus: bool) -> Value:
        """Returns a sum, or a difference."""
        a, b = self.number(left), self.number(right)
        return cast("Value", a + b if plus else a - b)

    def multiply(self, left: Value, right: Value, *, times: bool) -> Value:
        """Returns a product, or a quotient."""
        a, b = self.number(left), self.number(right)
        return cast("Value", a * b if times else _divide(a, b))

    def sum(self, depth: int) -> Value:
        """Reads a sum."""
        if depth > _DEEPEST:
            raise NotConstantError("the expression is nested too deep")
        value = self._product(depth)
        while self.is_sign("+-"):
            plus = self.next() == "+"
            value = self.add(value, self._product(depth), plus=plus)
        return value

    def _product(self, depth: int) -> Value:
        value = self.factor(depth)
        while self.is_sign("*/"):
            times = self.next() == "*"
            value = self.multiply(value, self.factor(depth), times=times)
        return value

    def primary(self, depth: int) -> Value:
        """Reads a signed or bracketed expression, or an :meth:`atom`."""
        if self.is_sign("+-"):
            minus = self.next() == "-"
            number = self.number(self.primary(depth + 1))
            return cast("Value", -number if minus else number)
        if self.is_sign("("):
            self.next()
            value = self.sum(depth + 1)
            self.take(")")
            return value
        return self.atom(depth)

    def read_list(self, close: str, depth: int) -> list[Value]:
        """Reads an opening bracket, values apart by commas, and the closing bracket."""
        out: list[Value] = []
        while not out or self.piece == ",":
            self.next()
            out.append(self.sum(depth + 1))
        self.take(close)
        return out

    def call_plain(self, name: str, value: Value) -> Value:
        """Returns the value of one of :data:`PLAIN_FUNCTIONS`."""
        try:
            return cast("Value", PLAIN_FUNCTIONS[name](self.number(value)))
        except ValueError:
            raise NotConstantError(f"{name.upper()} has no value here") from None

    def is_sign(self, signs: str) -> bool:
        """Returns whether one of some characters is read next."""
        return self.kind == "sign" and self.piece in signs

    def next(self) -> str:
        """Goes to the next token; returns the one before."""
        before = self.piece
        match = self.tokens.match(self._text, self._at)
        if match is None:
            rest = self._text[self._at :].strip()
            self.kind, self.piece = ("?", rest[:20]) if rest else ("", "")
            return before
        self.kind, self.piece = str(match.lastgroup), str(match[str(match.lastgroup)])
        self._at = match.end()
        return before

    def take(self, sign: str) -> None:
        """Continues after a sign.

        Raises:
            NotConstantError: Another token is there.
        """
        if self.piece != sign:
            raise self.refuse(f": no {sign!r}")
        self.next()

    @property
    def shown(self) -> str:
        """The text as messages name it."""
        return repr(self._text.strip()[:40])

    def refuse(self, why: str = "") -> NotConstantError:
        """Returns the error that the text is not evaluated."""
        return NotConstantError(f"{self.shown} is not evaluated{why}")


def _divide(left: int | float, right: int | float) -> int | float:
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
