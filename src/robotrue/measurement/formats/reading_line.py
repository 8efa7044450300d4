"""One reading as a controller shows it or an operator types it: joints, or a position.

Understood: labelled numbers (``{E6AXIS: A1 -27.2, A2 ...}``, ``J1 = -27.2 deg``, ``X 1200.02 Y``),
RAPID's nested brackets (``[[1200.02,-150.04,600.0],[1,0,0,0],...]``), UR's ``p[x, y, z, rx, ...]``
in m, and plain numbers. A decimal comma is understood where semicolons, tabs or blanks separate.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from robotrue.errors import FormatError

Counting: TypeAlias = Literal["controller", "model", "stated"]
"""Convention of joints: the controller's axes, the model's, or as stated for the session."""
LONGEST: Final = 2000
MOST: Final = 1e5
"""mm or deg."""
_NUMBER: Final = r"[-+]?(?:\d++\.?+\d*+|\.\d++)(?:[eE][-+]?\d+)?"
_LABELLED: Final = re.compile(
    rf"(?<![A-Za-z0-9_])([A-Za-z]\d?)(?:_deg|_mm)?\s*+(?:[:=]\s*+)?({_NUMBER})(?![\w.])"
)
_FIRST_GROUP: Final = re.compile(r"\[\s*\[([^\[\]]*)\]")
_UR: Final = re.compile(r"p\s*\[([^\[\]]*)\]")
_PLAIN: Final = re.compile(rf"(?<![\w.]){_NUMBER}(?![\w.])")
_COMMA: Final = re.compile(r"(?<=\d),(?=\d)")


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingLine:
    """Numbers of one reading.

    Attributes:
        values: Joints in deg, or x, y, z in mm.
        counting: Whose joints; ``stated`` where the line does not state it.
    """

    values: tuple[float, ...]
    counting: Counting = "stated"


def joints_line(text: str, dof: int) -> ReadingLine:
    """Returns the joints of a line.

    Raises:
        FormatError: No joints in it, not as many, or a position.
    """
    found = _labels(text)
    for letter, counting in (("A", "controller"), ("J", "controller"), ("Q", "model")):
        names = [f"{letter}{k + 1}" for k in range(dof)]
        if all(name in found for name in names):
            whose: Counting = "model" if counting == "model" else "controller"
            values = tuple(_sensible(found[name], text) for name in names)
            return ReadingLine(values=values, counting=whose)
    if {"X", "Y", "Z"} <= set(found):
        raise FormatError(
            "a position (X, Y, Z) where joints are read.",
            hint=f"paste the axis values, e.g. A1 to A{dof}.",
        )
    group = _FIRST_GROUP.search(text)
    numbers = _numbers(group[1] if group else text)
    if len(numbers) != dof:
        raise FormatError(
            f"{len(numbers)} numbers in {_quote(text)}, expected {dof} joints in deg.",
            hint=", ".join(f"A{k + 1} ..." for k in range(min(dof, 3))) + f", A{dof} ...",
        )
    return ReadingLine(values=numbers, counting="controller" if group else "stated")


def position_line(text: str) -> ReadingLine:
    """Returns the position of a line in mm.

    Raises:
        FormatError: No x, y, z in it, or joints.
    """
    found = _labels(text)
    if {"X", "Y", "Z"} <= set(found):
        return ReadingLine(values=tuple(_sensible(found[axis], text) for axis in "XYZ"))
    if {"A1", "A2", "A3"} <= set(found) or {"J1", "J2", "J3"} <= set(found):
        raise FormatError(
            "joints where a position is read.", hint="paste X, Y, Z of the tip, in the robot base."
        )
    ur, group = _UR.search(text), _FIRST_GROUP.search(text)
    numbers = _numbers(ur[1] if ur else group[1] if group else text)
    if len(numbers) not in (3, 6, 7):
        raise FormatError(
            f"{len(numbers)} numbers in {_quote(text)}, expected x, y, z in mm.",
            hint="X 1200.02, Y -150.04, Z 599.97",
        )
    scale = 1000.0 if ur else 1.0
    return ReadingLine(values=tuple(scale * value for value in numbers[:3]))


def _labels(text: str) -> dict[str, float]:
    return {
        name.upper(): float(value)
        for name, value in _LABELLED.findall(_replace_decimal_commas(text))
    }


def _sensible(value: float, text: str) -> float:
    if not abs(value) <= MOST:
        raise FormatError(
            f"{value:g} in {_quote(text)}, expected mm or deg of up to {MOST:,.0f}.",
            hint="check the line: a point may be missing.",
        )
    return value


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(
        _sensible(float(each), text) for each in _PLAIN.findall(_replace_decimal_commas(text))
    )


def _replace_decimal_commas(text: str) -> str:
    """The text with decimal points: a comma between digits is one where others separate."""
    if len(text) > LONGEST:
        raise FormatError(f"{len(text)} characters, expected one line of up to {LONGEST}.")
    text = text.replace("\u2212", "-")  # as pages print it
    commas = len(_COMMA.findall(text))
    spaced = re.search(r"[;\t]|\d[ ]+[-+]?\d|\d[ ]+[A-Za-z]", text) is not None
    if commas and spaced and "." not in text and not re.search(r"\d,\s", text):
        return _COMMA.sub(".", text)
    return text


def _quote(text: str) -> str:
    return repr(text.strip()[:60])
