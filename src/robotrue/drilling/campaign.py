"""A campaign: clamps at known tilts, forces and heights, and what the sensors said."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.drilling.foot import Foot, plane_under, readings
from robotrue.drilling.head import AxisOrder, normal_from_tilt, tilt_from_normal


@dataclass(frozen=True, slots=True, kw_only=True)
class Clamps(Columns):
    """What is known of n clamps when the head has to be turned: readings and conditions.

    Attributes:
        readings: (n, k) m, less their zero.
        force: (n,) N, clamp force.
        height: (n,) m, position of the Z axis.
        approach: n labels of how the foot was brought down; blank is the one way a cell always
            does it, out of the foot's own rest position.
    """

    readings: Annotated[Array, Column("n k")]
    force: Annotated[Array, Column("n", unit="N")]
    height: Annotated[Array, Column("n", unit="m")]
    approach: Annotated[tuple[str, ...], Column("n", fill="")] = ()

    def __len__(self) -> int:
        return len(self.readings)

    def rows(self, chosen: IntArray) -> Clamps:
        """Returns the clamps chosen."""
        return Clamps(
            readings=self.readings[chosen],
            force=self.force[chosen],
            height=self.height[chosen],
            approach=tuple(self.approach[i] for i in chosen.tolist()),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign(Columns):
    """n clamps whose true tilt is known from outside the foot.

    Attributes:
        clamps: Readings and conditions.
        tilt: (n, 2) rad, the true normal of the surface in the spindle's frame as (a, b).
        order: Axis order the tilts are written in.
        source: File the campaign came from, or "".
        lines: (n,) its lines, or empty.
        provenance: Simulated or measured, and the file.
    """

    clamps: Annotated[Clamps, Column("n")]
    tilt: Annotated[Array, Column("n 2", unit="rad")]
    order: AxisOrder = "AB"
    source: str = ""
    lines: tuple[int, ...] = ()
    provenance: Provenance = MEASURED

    def __len__(self) -> int:
        return len(self.clamps)

    @property
    def normal(self) -> Array:
        """(n, 3) true normals in the spindle's frame."""
        return normal_from_tilt(self.order, self.tilt)

    def rows(self, chosen: IntArray) -> Campaign:
        """Returns the clamps chosen."""
        lines = tuple(self.lines[i] for i in chosen.tolist()) if self.lines else ()
        return Campaign(
            clamps=self.clamps.rows(chosen),
            tilt=self.tilt[chosen],
            order=self.order,
            source=self.source,
            lines=lines,
            provenance=self.provenance,
        )


def reading_errors(foot: Foot, campaign: Campaign) -> Array:
    """Returns measured less theoretical readings (n, k) m (step 4).

    The height of a clamp's plane along the spindle is not a tilt: the common part of the readings
    that theory cannot know is not taken out, it stands in the errors and is harmless there.
    """
    return campaign.clamps.readings - readings(foot, campaign.normal, np.zeros(len(campaign)))


def tilt_seen(foot: Foot, order: AxisOrder, reading: Array) -> Array:
    """Returns the tilt (n, 2) rad that uncorrected readings (n, k) m show."""
    return tilt_from_normal(order, plane_under(foot, reading).normal)
