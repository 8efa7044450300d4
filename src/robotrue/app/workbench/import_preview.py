"""What a file of measured poses looks like before it is taken in."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.app.workbench.arm_body import answer
from robotrue.app.workbench.file_imports import cell_of, column_mapping, read_sets
from robotrue.cell.cell import Cell
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, FormatError, RobotrueError
from robotrue.measurement.formats.mapping import ColumnMapping
from robotrue.measurement.formats.measured_files import open_sheet
from robotrue.measurement.formats.sheet import Sheet
from robotrue.measurement.formats.sheet_file import read_sheet
from robotrue.store import items
from robotrue.store.nouns import CELL
from robotrue.store.workspace import Workspace

SHOWN: Final = 8
"""Rows of the preview."""
JOINT: Final = re.compile(
    r"(?:j|a|q|axis|joint|theta)[ _]*([1-9])(?:[ _]*\[?(deg|rad|°)\]?)?", re.IGNORECASE
)
AXIS: Final = re.compile(r"(?:.*[ _])?([xyz])(?:[ _]*\[?(mm|m|um|µm)\]?)?", re.IGNORECASE)


def preview_file(
    workspace: Workspace, path: Path, cell_id: str, mapping: Mapping[str, object] | None
) -> bytes:
    """Returns the columns of a file, how they would be read, and what is wrong with that.

    Args:
        workspace: Of the cell.
        path: The file.
        cell_id: It was measured in.
        mapping: Fields of a column mapping; None: the layout is found, or guessed.
    """
    layout, fault = column_mapping(mapping), None
    try:
        sheet, found = open_sheet(path, layout)
        layout_name = "" if layout is not None else found.name
    except FormatError as error:
        if layout is not None:
            fault = _describe_error(error)
        sheet, layout_name = read_sheet(path), ""
    document: dict[str, object] = {
        "columns": list(sheet.header),
        "rows": [list(row) for row in sheet.cells[:SHOWN]],
        "count": len(sheet.cells),
        "layout": layout_name,
        "guess": _guess(sheet),
        "fault": fault,
    }
    if layout is not None or layout_name:
        cell = cell_of(workspace, items.get(workspace, CELL, cell_id))
        document |= _read(cell, path, layout)
    if document["fault"]:  # what was found by itself does not fit: let the user say
        document["layout"] = ""
    return answer(document)


def _read(cell: Cell, path: Path, layout: ColumnMapping | None) -> dict[str, object]:
    """What the rows come to once they are read, or why they cannot be what they are said to be."""
    try:
        rows, remarks = read_sets(cell, [path], layout)
    except ConfigurationError:
        raise
    except RobotrueError as error:
        return {"fault": _describe_error(error)}
    low, high = rows.position.min(axis=0) / MM, rows.position.max(axis=0) / MM
    return {
        "poses": len(rows),
        "frame": rows.frame,
        "stations": len(np.unique(rows.station)),
        "low_mm": low,
        "high_mm": high,
        "remarks": remarks,
    }


def _guess(sheet: Sheet) -> dict[str, object]:
    """Columns whose names say what they hold; what they do not say is left open."""
    joints: dict[int, str] = {}
    axes: dict[str, str] = {}
    units: dict[str, str] = {}
    for name in sheet.header:
        if joint := JOINT.fullmatch(name.strip()):
            joints.setdefault(int(joint[1]), name)
            if joint[2]:
                units["joints_unit"] = "rad" if joint[2].lower() == "rad" else "deg"
        elif axis := AXIS.fullmatch(name.strip()):
            axes.setdefault(axis[1].lower(), name)
            if axis[2]:
                units["position_unit"] = axis[2].lower().replace("µ", "u")
    if any(name.strip()[:1] in "Aa" for name in joints.values()):  # A1 to A6: as a pendant shows
        units["axes"] = "controller"
    return {
        "joints": [joints.get(k, "") for k in range(1, max(joints, default=6) + 1)],
        "position": [axes.get(k, "") for k in "xyz"],
        **units,
    }


def _describe_error(error: RobotrueError) -> dict[str, object]:
    kind = type(error).__name__
    return {"kind": kind, "message": error.message, "hint": error.hint, "line": error.line}
