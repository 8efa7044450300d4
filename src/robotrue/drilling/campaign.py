"""A campaign: clamps at known tilts, forces and heights, with the readings of the sensors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.core.units import DEG
from robotrue.drilling.drill_defaults import Position
from robotrue.drilling.foot import Foot, plane_under, readings
from robotrue.drilling.head import AXIS_ORDER, AxisOrder, normal_from_tilt, tilt_from_normal
from robotrue.errors import ImplausibleDataError

FORCE: Final = 1000.0
"""N, one unit of force of :class:`Conditions`."""
HEIGHT: Final = 0.1
"""m, one unit of height likewise."""
TURN: Final = 10.0 * DEG
"""rad, one unit of a machine's A and B likewise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Clamps(Columns):
    """Readings and conditions of n clamps, before the head is turned.

    Attributes:
        readings: (n, k) m, less their zero.
        force: (n,) N, clamp force.
        height: (n,) m, position of the Z axis.
        approach: n labels of how the foot was brought down; blank is the one way a cell always
            does it, out of the foot's own rest position.
        place: (n, 2) m, X and Y of the machine; NaN where they are not recorded.
        axes: (n, 2) rad, A and B as the machine counts them, at the clamp; NaN likewise.
    """

    readings: Annotated[Array, Column("n k")]
    force: Annotated[Array, Column("n", unit="N")]
    height: Annotated[Array, Column("n", unit="m")]
    approach: Annotated[tuple[str, ...], Column("n", fill="")] = ()
    place: Annotated[Array, Column("n 2", unit="m", nan=True, fill=np.nan)] = EMPTY
    axes: Annotated[Array, Column("n 2", unit="rad", nan=True, fill=np.nan)] = EMPTY

    def __len__(self) -> int:
        return len(self.readings)


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign(Columns):
    """n clamps whose true tilt is known from outside the foot.

    Attributes:
        clamps: Readings and conditions.
        tilt: (n, 2) rad, the true normal of the surface in the spindle's frame as (a, b).
        order: Axis order the tilts are written in.
        source: File the campaign came from, or "".
        provenance: Simulated or measured, and the file.
    """

    clamps: Annotated[Clamps, Column("n")]
    tilt: Annotated[Array, Column("n 2", unit="rad")]
    order: AxisOrder = AXIS_ORDER
    source: str = ""
    provenance: Provenance = MEASURED

    def __len__(self) -> int:
        return len(self.clamps)

    @property
    def normal(self) -> Array:
        """(n, 3) true normals in the spindle's frame."""
        return normal_from_tilt(self.order, self.tilt)


def reading_errors(foot: Foot, campaign: Campaign) -> Array:
    """Returns measured less theoretical readings (n, k) m (step 4).

    The height of a clamp's plane along the spindle is not a tilt: the common part of the readings,
    which theory does not determine, stays in the errors and is harmless there.
    """
    return campaign.clamps.readings - readings(foot, campaign.normal, np.zeros(len(campaign)))


def tilt_seen(foot: Foot, order: AxisOrder, reading: Array) -> Array:
    """Returns the tilt (n, 2) rad that uncorrected readings (n, k) m show."""
    return tilt_from_normal(order, plane_under(foot, reading).normal)


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions(Columns):
    """The causes of n clamps, all that the machine knows when it has to turn.

    In units in which a coefficient is what the error changes by over a usual step of its cause.

    Attributes:
        a: (n,) deg, tilt about x as the uncorrected readings show it.
        b: (n,) deg, about y.
        force: (n,) kN.
        height: (n,) in 100 mm.
        x: (n,) m, of the machine; NaN where it is not recorded.
        y: (n,) m, likewise.
        axis_a: (n,) 10 deg, A as the machine counts it; NaN likewise.
        axis_b: (n,) 10 deg, B likewise.
    """

    a: Annotated[Array, Column("n", unit="deg")]
    b: Annotated[Array, Column("n", unit="deg")]
    force: Annotated[Array, Column("n", unit="kN")]
    height: Annotated[Array, Column("n", unit="100 mm")]
    x: Annotated[Array, Column("n", unit="m", nan=True, fill=np.nan)] = EMPTY
    y: Annotated[Array, Column("n", unit="m", nan=True, fill=np.nan)] = EMPTY
    axis_a: Annotated[Array, Column("n", unit="10 deg", nan=True, fill=np.nan)] = EMPTY
    axis_b: Annotated[Array, Column("n", unit="10 deg", nan=True, fill=np.nan)] = EMPTY

    def __len__(self) -> int:
        return len(self.a)

    @property
    def table(self) -> Array:
        """(n, 4) a, b, force, height."""
        return np.stack([self.a, self.b, self.force, self.height], axis=-1)

    def positions(self, inputs: tuple[Position, ...]) -> Array:
        """Returns the columns (n, i) of machine positions that a correction uses.

        Raises:
            ImplausibleDataError: One of them is not recorded at every clamp.
        """
        named = {"X": self.x, "Y": self.y, "A": self.axis_a, "B": self.axis_b}
        out = np.stack([named[name] for name in inputs], axis=-1) if inputs else self.table[:, :0]
        missing = [name for name in inputs if not np.isfinite(named[name]).all()]
        if missing:
            raise ImplausibleDataError(
                f"the correction uses the machine's {', '.join(missing)}; "
                f"{'they are' if len(missing) > 1 else 'it is'} not recorded at every clamp.",
                hint="columns X_mm, Y_mm, axis_A_deg, axis_B_deg of a file, X_mm, Y_mm of a "
                "stream, --at and --xy of `drill adjust`; or fit with --inputs none.",
            )
        return out


def conditions(foot: Foot, order: AxisOrder, clamps: Clamps) -> Conditions:
    """Returns the causes that are known of each clamp.

    Raises:
        ShapeError: Not one reading per sensor.
    """
    tilt = tilt_seen(foot, order, clamps.readings) / DEG
    return Conditions(
        a=tilt[:, 0],
        b=tilt[:, 1],
        force=clamps.force / FORCE,
        height=clamps.height / HEIGHT,
        x=clamps.place[:, 0],
        y=clamps.place[:, 1],
        axis_a=clamps.axes[:, 0] / TURN,
        axis_b=clamps.axes[:, 1] / TURN,
    )
