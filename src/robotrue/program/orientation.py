"""Meaning of orientation words where a language leaves it to the machine.

G-code prints angles whose meaning is data of the control, or a tool axis alone; APT and CSV paths
print a tool axis or nothing. Neither is a pose of a robot's tool. The cell states what is missing
(``[controller]`` in cell.toml); what it does not state is not guessed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from robotrue.core.arrays import Array, IntArray, frozen
from robotrue.errors import ConfigurationError, ShapeError
from robotrue.program.carried import about_z, carried_frames, to_z

Angles: TypeAlias = Literal["", "rpy", "kuka"]
"""``rpy``: A, B, C turn about X, Y, Z, R = Rz(C) Ry(B) Rx(A); ``kuka``: R = Rz(A) Ry(B) Rx(C)."""


class CarriedFrame(NamedTuple):
    """The carried frame before a one-based line of a program: its x (3,) and the tool axis (3,)."""

    line: int
    side: Array
    axis: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class OrientationRule:
    """Orientation rule of the cell; by default nothing is stated.

    Attributes:
        angles: What three printed angles are: the orientation of the tool frame in the work frame.
            Empty: not stated, targets with such words are not compensated.
        cutter: (3,) the way from the spindle to the tip in the tool frame; normalised.
        spin: rad of the tool frame about the tool axis, where only the axis is known: from a frame
            carried along the program, whose x is that of the work frame where the tool axis is
            that frame's z, right-handed about the cutter. None: not stated, targets that print
            only an axis are not compensated.
        carried: The carried frame in the middle of a text that is a part of a program.
    """

    angles: Angles = ""
    cutter: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    spin: float | None = None
    carried: CarriedFrame | None = None

    def __post_init__(self) -> None:
        """Checks and normalises.

        Raises:
            ConfigurationError: Angles of another name, or a spin that is not finite.
            ShapeError: A cutter axis of length zero.
        """
        if self.angles not in ("", "rpy", "kuka"):
            raise ConfigurationError(f"angles {self.angles!r}, expected 'rpy' or 'kuka'.")
        if self.spin is not None and not np.isfinite(self.spin):
            raise ConfigurationError(f"the spin is {self.spin} rad, expected a finite number.")
        cutter = np.asarray(self.cutter, dtype=np.float64)
        length = float(np.linalg.norm(cutter))
        if not length > 1e-9:
            raise ShapeError("cutter has length 0, expected a direction in the tool frame.")
        object.__setattr__(self, "cutter", frozen(cutter / length, (3,), "cutter"))

    @property
    def stated(self) -> bool:
        """True if anything but the default is stated."""
        return bool(self.angles) or self.spin is not None or not self.cutter[2] == 1.0

    def rotations(self, axis: Array, line: IntArray | None = None) -> Array:
        """Returns the tool frame (n, 3, 3) of tool axes (n, 3); NaN where the axis is.

        Args:
            axis: Unit vectors from the tip to the spindle, in the order of motion.
            line: (n,) one-based line of each, rising; needed where ``carried`` is stated.
        """
        out = np.full((len(axis), 3, 3), np.nan)
        known = np.asarray(np.isfinite(axis).all(axis=1))
        if self.spin is None or not known.any():
            return out
        x, _, z = np.eye(3)
        turn = about_z(np.array(self.spin)) @ to_z(self.cutter)
        parts = [CarriedFrame(0, x, z), *filter(None, [self.carried])]
        of_line = np.zeros(len(axis), np.int64) if line is None else line
        first = np.searchsorted(of_line, [each.line for each in parts])
        for each, rows in zip(parts, np.split(np.arange(len(axis)), first[1:]), strict=True):
            mine = rows[known[rows]]
            if len(mine):
                out[mine] = carried_frames(axis[mine], each.side, before=each.axis) @ turn
        return out

    def axes_of(self, rotation: Array) -> Array:
        """Returns the tool axes (n, 3), from the tip to the spindle, of tool frames (n, 3, 3)."""
        out: Array = -(rotation @ self.cutter)
        return out
