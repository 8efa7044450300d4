"""Values of the registers of a Fanuc LS program, and the arithmetic of its statements.

A position register is known as a whole or not at all: six numbers in the Cartesian form with the
text of its CONFIG. Sums and differences go component by component, as the controller forms them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple, TypeAlias

from robotrue.program.formats.expression import (
    UNSIGNED,
    ExpressionReader,
    NotConstantError,
)

_TOKEN: Final = re.compile(
    rf"[ \t]*+(?:{UNSIGNED}"
    r"|R\[[ \t]*(?P<register>\d{1,6})[ \t]*(?::[^\]]*)?\]"
    r"|PR\[[ \t]*(?P<element>\d{1,6}[ \t]*(?::[^\],]*)?,[ \t]*[1-6])[ \t]*(?::[^\]]*)?\]"
    r"|(?P<sign>[-+*/()]))"
)
_WHOLE: Final = re.compile(rb"(PR|P)\[[ \t]*(\d{1,6})[ \t]*(?::[^\]]*)?\]|(LPOS)\b")
_LARGEST: Final = 1e7


class RegisterPose(NamedTuple):
    """A position register in its Cartesian form.

    Attributes:
        values: X Y Z in mm, W P R in deg.
        config: Text in the quotes of CONFIG; empty where it is not known.
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
    try:
        value = _RegisterReader(text.strip().decode("latin-1"), state).whole()
    except NotConstantError:
        return None
    return value if abs(value) < _LARGEST else None


class _RegisterReader(ExpressionReader[float]):
    tokens = _TOKEN

    def __init__(self, text: str, state: Mapping[str, Value]) -> None:
        super().__init__(text)
        self._state = state

    def number(self, value: float) -> float:
        return value

    def atom(self, depth: int) -> float:
        kind, text = self.kind, self.next()
        if kind == "number" and math.isfinite(float(text)):
            return float(text)
        held = self._state.get(f"R{int(text)}") if kind == "register" else None
        if kind == "element":
            register = re.match(r"\d+", text)
            pose = self._state.get(f"PR{int(register[0])}") if register else None
            held = pose.values[int(text[-1]) - 1] if isinstance(pose, RegisterPose) else None
        if not isinstance(held, float):
            raise self.refuse()
        return held
