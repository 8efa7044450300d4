"""The frames a cell holds for the programs of its controller."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.program.external_axes import ExternalAxis
from robotrue.program.program import FrameTable


def frame_table(cell: Cell) -> FrameTable:
    """Returns the frames a program falls back on, and those it names."""
    named = () if cell.part is None else cell.part.frames
    return replace(
        cell.controller,
        external=tuple(_carrying(axis, cell) for axis in cell.controller.external),
        T_base_frame=cell.T_base_frame,
        T_flange_tool=cell.robot.T_flange_tool,
        bases={**cell.controller.bases, **{frame.name: frame.T_base_part for frame in named}},
    )


def _carrying(axis: ExternalAxis, cell: Cell) -> ExternalAxis:
    """The axis, with the default work frame on it where that is a part frame it carries."""
    carried = {name.lower() for name in axis.frames}
    parts = () if cell.part is None else cell.part.frames
    mine = [part.T_base_part for part in parts if part.name.lower() in carried]
    if any(np.array_equal(T, cell.T_base_frame) for T in mine):
        return replace(axis, frames=(*axis.frames, "base"))
    return axis
