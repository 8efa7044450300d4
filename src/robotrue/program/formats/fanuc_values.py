"""What the registers of a Fanuc LS program hold: values, and the arithmetic of its statements.

A position register is known as a whole or not at all: six numbers in the Cartesian form with the
text of its CONFIG. Sums and differences go component by component, as the controller forms them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple, TypeAlias

from robotrue.program.controller_files import NUMBER, all_finite

_NUMBER: Final = re.compile(NUMBER.encode())
_REGISTER: Final = re.compile(rb"R\[[ \t]*(\d{1,6})[ \t]*(?::[^\]]*)?\]")
_ELEMENT: Final = re.compile(
    rb"PR\[[ \t]*(\d{1,6})[ \t]*(?::[^\],]*)?,[ \t]*([1-6])[ \t]*(?::[^\]]*)?\]"
)
_WHOLE: Final = re.compile(rb"(PR|P)\[[ \t]*(\d{1,6})[ \t]*(?::[^\]]*)?\]|(LPOS)\b")
_DEEPEST: Final = 20
"""Brackets in brackets."""
_LARGEST: Final = 1e7


class RegisterPose(NamedTuple):
    """A position register in its Cartesian form.

    Attributes:
        values: X Y Z in mm, W P R in deg.
        config: What stands in the quotes of CONFIG; empty where it is not known.
    """

    values: tuple[float, ...]
    config: bytes = b""

    def with_element(self, number: int, value: float) -> RegisterPose:
        """Returns it with one element set, counted from 1."""
        values = list(self.values)
        values[number - 1] = value
        return self._replace(values=tuple(values))


class OffsetCondition(NamedTuple):
    """``OFFSET CONDITION PR[1],UFRAME[2]``.

    Attributes:
        register: Its number.
        pose: What it held there.
        frame: Number of the user frame or tool it is stated in, -1 where none is.
    """

    register: int
    pose: RegisterPose
    frame: int


Value: TypeAlias = RegisterPose | OffsetCondition | float
State: TypeAlias = dict[str, Value]
"""What is known, by name: ``R5``, ``PR3``, ``UF`` and ``UT`` (numbers in force), ``OFFSET`` and
``TOOL_OFFSET`` (their conditions)."""
NOTHING: Final = RegisterPose((0.0,) * 6)


def pose_of(
    text: bytes, state: Mapping[str, Value], points: Mapping[int, RegisterPose]
) -> RegisterPose | None:
    """Returns the value of ``PR[1]``, ``P[2]+PR[3]``, ``LPOS-LPOS``; None if it is not known.

    Args:
        text: The right side of an assignment.
        state: What is known there.
        points: Positions that no statement changes, by number.
    """
    terms: list[RegisterPose | None] = []
    signs, at, rest = [1.0], 0, text.strip()
    names: list[bytes] = []
    while True:
        match = _WHOLE.match(rest, at)
        if match is None:
            return None
        names.append(match[0])
        if match[3]:
            terms.append(None)
        elif match[1] == b"PR":
            held = state.get(f"PR{int(match[2])}")
            terms.append(held if isinstance(held, RegisterPose) else None)
        else:
            terms.append(points.get(int(match[2])))
        tail = rest[match.end() :].lstrip()
        if not tail:
            break
        if tail[:1] not in (b"+", b"-"):
            return None
        signs.append(1.0 if tail[:1] == b"+" else -1.0)
        at = len(rest) - len(tail[1:].lstrip())
    if names == [b"LPOS", b"LPOS"] and signs == [1.0, -1.0]:
        return NOTHING  # the place, whatever it is, less itself: the usual way to clear a register
    return _sum_poses(terms, signs)


def _sum_poses(terms: Iterable[RegisterPose | None], signs: list[float]) -> RegisterPose | None:
    total, config = [0.0] * 6, b""
    for number, (term, sign) in enumerate(zip(terms, signs, strict=True)):
        if term is None:
            return None
        config = term.config if number == 0 else config
        total = [sum_ + sign * value for sum_, value in zip(total, term.values, strict=True)]
    return RegisterPose(tuple(total), config) if max(map(abs, total)) < _LARGEST else None


def number_of(text: bytes, state: Mapping[str, Value]) -> float | None:
    """Returns the value of ``100``, ``R[1]*2``, ``(PR[1,3]+50)``; None if it is not known."""
    if text.count(b"(") > _DEEPEST:
        return None
    reader = _Arithmetic(text.strip(), state)
    value = reader.sum()
    if value is None or reader.rest() or not abs(value) < _LARGEST:
        return None
    return value


class _Arithmetic:
    """A number of a statement, read from left to right."""

    def __init__(self, text: bytes, state: Mapping[str, Value]) -> None:
        self._text, self._state, self._at = text, state, 0

    def rest(self) -> bytes:
        """Returns what has not been read."""
        return self._text[self._at :].strip()

    def sum(self) -> float | None:
        """Reads terms joined by + and -."""
        total = self._product()
        while total is not None and (sign := self._sign(b"+-")):
            other = self._product()
            if other is None:
                return None
            total = total + other if sign == b"+" else total - other
        return total

    def _product(self) -> float | None:
        total = self._factor()
        while total is not None and (sign := self._sign(b"*/")):
            other = self._factor()
            if other is None or (sign == b"/" and other == 0.0):
                return None
            total = total * other if sign == b"*" else total / other
        return total

    def _factor(self) -> float | None:
        if self._sign(b"("):
            value = self.sum()
            return value if self._sign(b")") else None
        if self._sign(b"-"):
            value = self._factor()
            return None if value is None else -value
        for pattern in (_NUMBER, _REGISTER, _ELEMENT):
            match = pattern.match(self._text, self._at)
            if match is not None:
                self._at = match.end()
                return self._value(match)
        return None

    def _value(self, match: re.Match[bytes]) -> float | None:
        if match.re is _NUMBER:
            number = match[0].decode()
            return float(number) if all_finite([number]) else None
        if match.re is _REGISTER:
            held = self._state.get(f"R{int(match[1])}")
            return held if isinstance(held, float) else None
        pose = self._state.get(f"PR{int(match[1])}")
        return pose.values[int(match[2]) - 1] if isinstance(pose, RegisterPose) else None

    def _sign(self, signs: bytes) -> bytes:
        while self._text[self._at : self._at + 1] in (b" ", b"\t"):
            self._at += 1
        found = self._text[self._at : self._at + 1]
        if found and found in signs:
            self._at += 1
            return found
        return b""
