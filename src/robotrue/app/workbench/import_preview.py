"""What a file of measured poses looks like before it is taken in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.app.workbench.arm_body import answer
from robotrue.app.workbench.file_imports import cell_of, column_mapping, is_joint_list, read_sets
from robotrue.cell.cell import Cell
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, FormatError, RobotrueError
from robotrue.measurement.formats.joined_sheet import JointList, read_joint_list
from robotrue.measurement.formats.mapping import ColumnMapping, guess_columns, guess_units
from robotrue.measurement.formats.measured_files import open_sheet
from robotrue.measurement.formats.sheet_file import read_sheet
from robotrue.store import items
from robotrue.store.nouns import CELL
from robotrue.store.workspace import Workspace

SHOWN: Final = 8
"""Rows of the preview."""


def preview_file(
    workspace: Workspace, paths: Sequence[Path], cell_id: str, mapping: Mapping[str, object] | None
) -> bytes:
    """Returns the columns of a file, how they would be read, and what is wrong with that.

    Args:
        workspace: Of the cell.
        paths: The file; or a list of points and a joint list.
        cell_id: It was measured in.
        mapping: Fields of a column mapping; None: the layout is found, or guessed.
    """
    mapping, lists = _join_two(paths, mapping)
    points, layout = column_mapping(paths if lists else paths[:1], mapping)
    fault, layout_name = None, ""
    try:
        sheet, found = open_sheet(points[0], layout)
        layout_name = "" if layout is not None else found.name
    except FormatError as error:
        if layout is not None:
            fault = _describe_error(error)
        sheet = read_sheet(points[0])
    header = sheet.header if fault is None else tuple(dict.fromkeys((*sheet.header, *lists)))
    document: dict[str, object] = {
        "columns": list(header),
        "rows": [list(row) for row in sheet.cells[:SHOWN]],
        "shown_columns": list(sheet.header),
        "count": len(sheet.cells),
        "layout": layout_name,
        "guess": _guess(header),
        "fault": fault,
        "joint_list": None if mapping is None else mapping.get("joint_list"),
    }
    if (layout is not None and layout.position) or layout_name:
        cell = cell_of(workspace, items.get(workspace, CELL, cell_id))
        document |= _read(cell, points[0], layout)
    if document["fault"]:  # what was found by itself does not fit: let the user say
        document["layout"] = ""
    return answer(document)


def _join_two(
    paths: Sequence[Path], mapping: Mapping[str, object] | None
) -> tuple[Mapping[str, object] | None, tuple[str, ...]]:
    """The mapping, by default of a joint list in its order, and the columns of the joint list."""
    if len(paths) != 2 or not any(map(is_joint_list, paths)):
        return mapping, ()
    points, joints = sorted(paths, key=is_joint_list)
    sheet, _ = read_joint_list(JointList(file=joints))
    if mapping is None:
        _, axes = guess_columns(read_sheet(points).header)
        names, _ = guess_columns(sheet.header)
        position = [axes[k] for k in "xyz"] if len(axes) == 3 else []
        guessed = {"joints": [names[k] for k in sorted(names)], **guess_units(sheet.header)}
        by = {"by": "order"}
        mapping = {"position": position, "joint_list": by, **guessed} if position else None
    return mapping, sheet.header


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


def _guess(header: Sequence[str]) -> dict[str, object]:
    """Columns whose names say what they hold; what they do not say is left open."""
    joints, axes = guess_columns(header)
    return {
        "joints": [joints.get(k, "") for k in range(1, max(joints, default=6) + 1)],
        "position": [axes.get(k, "") for k in "xyz"],
        **guess_units(header),
    }


def _describe_error(error: RobotrueError) -> dict[str, object]:
    kind = type(error).__name__
    return {"kind": kind, "message": error.message, "hint": error.hint, "line": error.line}
