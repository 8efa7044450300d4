"""FOOT.toml: the sensors of a pressure foot, its zero, the skin and the head.

::

    [foot]
    radius_mm = 60.0                  # or one per sensor
    angles_deg = [90.0, 210.0, 330.0] # from x towards y of the spindle's frame
    reading_sigma_um = 2.0
    range_mm = [-5.0, 15.0]           # of a reading less its zero
    count_um = 1.0                    # where readings are counts
    zero_counts = [10231, 9977, 10102] # or zero_mm: on the mandrel, if readings are not less it
    zero_sigma_um = [0.5, 0.4, 0.5]   # of that zero, as `drill zero` writes it
    zero_tilt_sigma_deg = [0.001, 0.001] # what it leaves uncertain of a and b, likewise

    [head]
    order = "AB"                      # the first carries the second
    pivot_to_tip_mm = [0.0, 0.0, -350.0]
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from robotrue.cell.schema import Above0, Number, Three, Two
from robotrue.core.arrays import Array
from robotrue.core.files import read_toml
from robotrue.core.schema_faults import check_tables, line_of_key
from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.foot import FLAT, MAX_TILT_DEG, READING_SIGMA_UM, Foot, Skin, TakenZero
from robotrue.drilling.head import AXIS_ORDER, AxisOrder, Head
from robotrue.errors import ConfigurationError, ShapeError

Numbers = Annotated[list[Number], Field(min_length=3)]
Sense = Annotated[list[Literal[-1, 1]], Field(min_length=2, max_length=2)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class FootTable(_Table):
    """``[foot]``: places of the sensors and what they can do."""

    radius_mm: Above0 | Annotated[list[Above0], Field(min_length=3)]
    angles_deg: Numbers
    reading_sigma_um: Above0 = READING_SIGMA_UM
    range_mm: Two | None = None
    max_tilt_deg: Above0 = MAX_TILT_DEG
    count_um: Above0 | None = None
    zero_mm: Numbers | None = None
    zero_counts: Numbers | None = None
    zero_sigma_um: Annotated[list[Above0], Field(min_length=3)] | None = None
    zero_tilt_sigma_deg: Annotated[list[Above0], Field(min_length=2, max_length=2)] | None = None


class SkinTable(_Table):
    """``[skin]``: what sensors without a foot plate look at."""

    shape: Literal["plane", "sphere", "cylinder"]
    radius_mm: Number | Literal["fitted"]
    axis_deg: Number = 0.0


class HeadTable(_Table):
    """``[head]``: the rotary axes."""

    order: AxisOrder = AXIS_ORDER
    pivot_to_tip_mm: Three
    sense: Sense = [1, 1]


class FootFile(_Table):
    """A whole foot file."""

    foot: FootTable
    skin: SkinTable | None = None
    head: HeadTable | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FootSetup:
    """Content of a foot file.

    Attributes:
        foot: The sensors.
        head: The rotary axes; None where the file has no ``[head]``.
        count: m per count; None where readings are lengths.
        zero: (k,) m, readings on the mandrel; None where readings are given less it.
        zero_in_counts: Whether the file states that zero in counts.
        zero_sigma: (k,) m, standard deviation of the zero; None where it is not stated.
        zero_tilt_sigma: (2,) rad, what the zero leaves uncertain of every tilt a, b; None where
            it is not stated.
        source: The file.
    """

    foot: Foot
    head: Head | None
    count: float | None
    zero: Array | None
    source: str
    zero_in_counts: bool = False
    zero_sigma: Array | None = None
    zero_tilt_sigma: Array | None = None

    @property
    def taken_zero(self) -> TakenZero | None:
        """The zero with what it leaves uncertain of a tilt; None without a zero.

        A file that states the deviation of each sensor alone is read as independent sensors.
        """
        if self.zero is None:
            return None
        sigma = self.zero_tilt_sigma
        if sigma is None:
            each = np.zeros(len(self.zero)) if self.zero_sigma is None else self.zero_sigma
            sigma = np.sqrt(np.linalg.pinv(self.foot.design)[:2] ** 2 @ each**2)[::-1]
        return TakenZero(readings=self.zero, tilt_sigma=sigma)


def read_foot(path: str | Path) -> FootSetup:
    """Returns the content of a foot file.

    Raises:
        ConfigurationError: Not TOML, an unknown key, an invalid value; with file and line.
        FormatError: The file cannot be read.
    """
    tables, text = read_toml(path, example="the guide on drilling")
    file = check_tables(FootFile, tables, path=path, text=text)
    try:
        return _setup(file, path)
    except (ConfigurationError, ShapeError) as cause:
        raise ConfigurationError(
            cause.message, source=path, line=line_of_key(text, ("foot",)), hint=cause.hint
        ) from cause


def _setup(file: FootFile, path: str | Path) -> FootSetup:
    table = file.foot
    k = len(table.angles_deg)
    radius = np.array(table.radius_mm, dtype=np.float64) * MM
    if radius.ndim and len(radius) != k:
        raise ConfigurationError(f"{len(radius)} radii for {k} angles.")
    if table.zero_sigma_um is not None and len(table.zero_sigma_um) != k:
        raise ConfigurationError(
            f"{len(table.zero_sigma_um)} values of zero_sigma_um for {k} sensors."
        )
    head = file.head
    foot = Foot(
        radius=np.broadcast_to(radius, (k,)),
        angle=np.array(table.angles_deg) * DEG,
        skin=_skin(file.skin),
        reading_sigma=table.reading_sigma_um * UM,
        reading_range=np.array(table.range_mm or [-np.inf, np.inf]) * MM,
        max_tilt=table.max_tilt_deg * DEG,
    )
    return FootSetup(
        foot=foot,
        head=None
        if head is None
        else Head(
            order=head.order,
            p_pivot_tip=np.array(head.pivot_to_tip_mm) * MM,
            sense=(float(head.sense[0]), float(head.sense[1])),
        ),
        count=None if table.count_um is None else table.count_um * UM,
        zero=_zero(table, k),
        source=str(path),
        zero_in_counts=table.zero_counts is not None,
        zero_sigma=None if table.zero_sigma_um is None else np.array(table.zero_sigma_um) * UM,
        zero_tilt_sigma=None
        if table.zero_tilt_sigma_deg is None
        else np.array(table.zero_tilt_sigma_deg) * DEG,
    )


def _skin(table: SkinTable | None) -> Skin:
    if table is None:
        return FLAT
    radius = np.nan if table.radius_mm == "fitted" else float(table.radius_mm) * MM
    return Skin(kind=table.shape, radius=radius, axis=table.axis_deg * DEG)


def _zero(table: FootTable, sensors: int) -> Array | None:
    if table.zero_mm is not None and table.zero_counts is not None:
        raise ConfigurationError("the zero is given twice, in mm and in counts.")
    if table.zero_counts is not None and table.count_um is None:
        raise ConfigurationError(
            "zero_counts without count_um, the length of a count.", hint="count_um = 1.0"
        )
    if table.zero_mm is None and table.zero_counts is None:
        return None
    zero = np.array(table.zero_mm if table.zero_counts is None else table.zero_counts)
    if len(zero) != sensors:
        raise ConfigurationError(f"{len(zero)} zero readings for {sensors} sensors.")
    return zero * (MM if table.zero_counts is None else (table.count_um or 1.0) * UM)
