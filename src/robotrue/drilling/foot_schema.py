"""The keys of a foot file, their types and defaults, in the file's own units.

Only :mod:`robotrue.drilling.foot_file` imports this file; pydantic is slow to load.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from robotrue.cell.schema import Above0, Number, Three, Two

Numbers = Annotated[list[Number], Field(min_length=3)]
Sense = Annotated[list[Literal[-1, 1]], Field(min_length=2, max_length=2)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class FootTable(_Table):
    """``[foot]``: places of the sensors and what they can do."""

    radius_mm: Above0 | Annotated[list[Above0], Field(min_length=3)]
    angles_deg: Numbers
    reading_sigma_um: Above0 = 2.0
    range_mm: Two | None = None
    max_tilt_deg: Above0 = 8.0
    count_um: Above0 | None = None
    zero_mm: Numbers | None = None
    zero_counts: Numbers | None = None


class SkinTable(_Table):
    """``[skin]``: what sensors without a foot plate look at."""

    shape: Literal["plane", "sphere", "cylinder"]
    radius_mm: Number | Literal["fitted"]
    axis_deg: Number = 0.0


class HeadTable(_Table):
    """``[head]``: the rotary axes."""

    order: Literal["AB", "BA"] = "AB"
    pivot_to_tip_mm: Three
    sense: Sense = [1, 1]


class FootFile(_Table):
    """A whole foot file."""

    foot: FootTable
    skin: SkinTable | None = None
    head: HeadTable | None = None
