"""Lengths that a draw wire, a ball bar or a gauge bar shows of an arm: one noun for all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import EMPTY, Column, Columns, count_rows
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.errors import ShapeError

NO_ANCHOR = -1
"""Anchor of a length between two poses of the arm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LengthSet(Columns):
    """n lengths, each from the reflector to an anchor, or to the reflector in another pose.

    A draw wire has its eyelet for an anchor, a ball bar its fixed socket. A gauge bar whose two
    sockets the tool is put into has no anchor: it lies between two poses.

    Attributes:
        joints: (n, dof) rad, in the robot model's sense.
        length: (n,) m.
        sigma: (n,) m, one standard deviation of ``length``.
        anchor: (n,) number of the anchor, or ``NO_ANCHOR``.
        second: (n, dof) rad, the other pose of a length without anchor; NaN with one.
        anchors: (k, 3) m in base, roughly where the anchors are: within some centimetres.
        anchor_names: (k) what they are called.
        source: File the lengths came from.
        lines: (n,) one-based line in it.
        provenance: Simulated or measured, instrument and file.
    """

    joints: Annotated[Array, Column("n dof", unit="rad")]
    length: Annotated[Array, Column("n", unit="m")]
    sigma: Annotated[Array, Column("n", unit="m")]
    anchor: Annotated[IntArray, Column("n", fill=0)] = EMPTY
    second: Annotated[Array, Column("n dof", unit="rad", nan=True, fill=np.nan)] = EMPTY
    anchors: Annotated[Array, Column("k 3", unit="m")]
    anchor_names: Annotated[tuple[str, ...], Column("k")]
    source: str = ""
    lines: Annotated[IntArray, Column("n", fill=count_rows)] = EMPTY
    provenance: Provenance = MEASURED

    def _check_rules(self) -> None:
        """Every length ends at an anchor that is there, or at another pose.

        Raises:
            ShapeError: It does not, or a length or its sigma is zero or less.
        """
        if (self.length <= 0.0).any() or (self.sigma <= 0.0).any():
            raise ShapeError("a length or its sigma is zero or less, expected above 0.")
        known = (self.anchor >= NO_ANCHOR) & (self.anchor < len(self.anchors))
        if not known.all():
            raise ShapeError(f"{len(self.anchors)} anchors, numbered from 0; a row has another.")
        if not np.array_equal(self.between_poses, np.isfinite(self.second).all(axis=1)):
            raise ShapeError("a length has an anchor or a second pose, not both, and not neither.")

    def __len__(self) -> int:
        return len(self.length)

    @property
    def between_poses(self) -> BoolArray:
        """(n,) True where a length lies between two poses."""
        return np.asarray(self.anchor == NO_ANCHOR)
