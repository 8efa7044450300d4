"""A found tool in the words of controllers, and the cell file that has it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.cell.cell_text import cell_text
from robotrue.cell.config import parse_cell
from robotrue.cell.toml_edit import with_table, without_part
from robotrue.core.arrays import Array
from robotrue.core.files import read_bytes, write_atomic
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.program.controller_frames import controller_tool
from robotrue.store.model_file import ZIP


def tool_texts(
    T_flange_tool: Array, formats: Sequence[str], number: int
) -> tuple[tuple[str, str], ...]:
    """Returns the controller's name and its lines for each format that is asked for."""
    found = [controller_tool(T_flange_tool, form, number=number) for form in formats]
    return tuple((each.system, each.text) for each in found)


def require_tool_formats(formats: Sequence[str], number: int) -> None:
    """Rejects a format of tools before any work.

    Raises:
        ConfigurationError: No controller is called so, or its table has no such number.
    """
    tool_texts(np.eye(4), formats, number)


def write_tool(cell: Cell, source: Path, T_flange_tool: Array, output: Path) -> None:
    """Writes the cell with another ``[tool]``, read back before anything is written.

    Part frames go: they were touched with another tip.

    Raises:
        ConfigurationError: The text that would be written is no cell.
    """
    text = cell.text if cell.text and not read_bytes(source).startswith(ZIP) else cell_text(cell)
    table = {
        "xyz_mm": [round(float(v), 6) for v in T_flange_tool[:3, 3] / MM],
        "abc_deg": [round(float(v), 8) for v in abc_from_matrix(T_flange_tool[:3, :3]) / DEG],
    }
    data = with_table(without_part(text), "tool", table).encode()
    parse_cell(data, output)
    write_atomic(output, data)
