"""Codes of arrays with their meaning in one clause."""

from __future__ import annotations

from enum import IntEnum
from typing import Self


class Explained(IntEnum):
    """An integer code with a clause for reports: ``NAME = code, "clause"``.

    Attributes:
        explanation: The clause.
    """

    explanation: str

    def __new__(cls, code: int, explanation: str = "") -> Self:
        """Returns the member."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.explanation = explanation
        return member
