"""Files that were sent: how they would be read, and items of the workspace that they become."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from robotrue.app.measured_rows import join_rows, read_rows
from robotrue.app.reporting import Notes
from robotrue.app.workbench.arm_body import answer
from robotrue.cell.cell import Cell
from robotrue.cell.config import read_cell
from robotrue.core.files import read_bytes
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, FormatError, RobotrueError
from robotrue.measurement.formats.joined_sheet import JointList, read_joint_list
from robotrue.measurement.formats.joint_literals import read_joint_literals
from robotrue.measurement.formats.mapping import (
    ColumnMapping,
    build_mapping,
    guess_columns,
    guess_units,
)
from robotrue.measurement.formats.measured_files import open_sheet
from robotrue.measurement.formats.sheet_file import read_sheet
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.plausibility import FEWEST_POSES
from robotrue.store import cells, items, measurements, models, programs
from robotrue.store.nouns import CELL, MODEL, CellRecord, MeasurementRecord, ProgramRecord
from robotrue.store.workspace import Workspace
from robotrue.validation.validation_defaults import FEWEST_DRIFT_POSES


def import_cell(workspace: Workspace, paths: Sequence[Path], name: str) -> CellRecord:
    """Imports a cell.toml with the files it names next to it; returns its record."""
    main = [path for path in paths if path.suffix.lower() == ".toml"]
    if len(main) != 1:
        raise ConfigurationError(
            f"{len(main)} TOML files, expected one cell.toml and the files it names.",
            hint="drop them together.",
        )
    with TemporaryDirectory() as together:
        for path in paths:
            (Path(together) / path.name).write_bytes(path.read_bytes())
        cell = Path(together) / main[0].name
        cells.require_beside(
            read_bytes(cell).decode("utf-8-sig", "replace"), {p.name for p in paths}
        )
        return cells.add(workspace, cell, name=name or None)


def import_program(workspace: Workspace, paths: Sequence[Path], name: str) -> ProgramRecord:
    """Imports the files of a program as they are; returns its record."""
    return programs.add(workspace, list(paths), name=name or None)


def import_measurements(
    workspace: Workspace,
    paths: Sequence[Path],
    name: str,
    cell_id: str,
    mapping: Mapping[str, object] | None,
) -> MeasurementRecord:
    """Imports measured poses after plausibility checks; returns their record.

    Args:
        workspace: Where they go.
        paths: Files.
        name: In the workspace; empty: that of the first file.
        cell_id: They were measured in.
        mapping: Fields of a column mapping; None: the layout is found.
    """
    record = items.get(workspace, CELL, cell_id)
    points, layout = _column_mapping(paths, mapping)
    rows, remarks = read_sets(cell_of(workspace, record), points, layout)
    return measurements.add(
        workspace,
        rows,
        name=name or paths[0].stem,
        raw=list(paths),
        cell=record.ref,
        detail={"remarks": remarks, "mapping": None if mapping is None else dict(mapping)},
    )


def import_check_poses(
    workspace: Workspace, paths: Sequence[Path], name: str, model_id: str
) -> MeasurementRecord:
    """Returns the record of check poses; fewer are enough than for a calibration.

    Args:
        workspace: Where they go.
        paths: Files.
        name: In the workspace; empty: that of the first file.
        model_id: Whose cell they were measured in.
    """
    record = items.get(workspace, MODEL, model_id)
    cell = models.model_of(workspace, record).cell
    rows, remarks = read_sets(cell, paths, None, minimum=FEWEST_DRIFT_POSES)
    cells = record.refs("cell")
    return measurements.add(
        workspace,
        rows,
        name=name or paths[0].stem,
        raw=list(paths),
        cell=cells[0] if cells else None,
        detail={"remarks": remarks, "mapping": None},
    )


def _column_mapping(
    paths: Sequence[Path], fields: Mapping[str, object] | None
) -> tuple[list[Path], ColumnMapping | None]:
    """Returns the files of points, and a column mapping from its fields, or None.

    With ``joint_list`` among the fields one of two files is the joint list, detected by its
    content.

    Raises:
        ConfigurationError: An unknown field or a value it cannot take, a joint list and no points.
    """
    if fields is None:
        return list(paths), None
    joined = fields.get("joint_list")
    if not isinstance(joined, Mapping):
        return list(paths), build_mapping({"name": "as chosen", **fields})
    if len(paths) != 2:
        raise ConfigurationError(
            f"{len(paths)} files, expected a list of points and a joint list.",
            hint="drop the two together.",
        )
    points, joints = sorted(paths, key=_is_joint_list)
    stated = {**fields, "joint_list": {**joined, "file": str(joints)}}
    return [points], build_mapping({"name": "as chosen", **stated})


def _is_joint_list(path: Path) -> bool:
    """Returns whether a file holds joints and no points."""
    try:
        if read_joint_literals(path) is not None:
            return True
        header = read_sheet(path).header
    except FormatError:
        return False
    joints, axes = guess_columns(header)
    return len(joints) > 1 and len(axes) < 3


def cell_of(workspace: Workspace, record: CellRecord) -> Cell:
    """Returns a cell of the workspace, read with the files it names."""
    with TemporaryDirectory() as folder:
        return read_cell(cells.copy_cell(workspace, record, Path(folder)))


def read_sets(
    cell: Cell, paths: Sequence[Path], layout: ColumnMapping | None, *, minimum: int = FEWEST_POSES
) -> tuple[MeasurementSet, list[str]]:
    """Returns all files as one set, and what is odd about it but harmless.

    Raises:
        FormatError: A file that cannot be read.
        ImplausibleDataError: Numbers that are impossible for this robot.
        ModelMismatchError: Another number of joints, or files in different frames.
    """
    notes = Notes()
    sets = [read_rows(cell, path, layout, reporter=notes) for path in paths]
    names = [path.name for path in paths]
    return join_rows(cell, sets, names, reporter=notes, minimum=minimum), notes.texts


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
    points, layout = _column_mapping(paths if lists else paths[:1], mapping)
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
        document |= _read_preview(cell, points[0], layout)
    if document["fault"]:  # what was found by itself does not fit: let the user say
        document["layout"] = ""
    return answer(document)


def _join_two(
    paths: Sequence[Path], mapping: Mapping[str, object] | None
) -> tuple[Mapping[str, object] | None, tuple[str, ...]]:
    """The mapping, by default of a joint list in its order, and the columns of the joint list."""
    if len(paths) != 2 or not any(map(_is_joint_list, paths)):
        return mapping, ()
    points, joints = sorted(paths, key=_is_joint_list)
    sheet, _ = read_joint_list(JointList(file=joints))
    if mapping is None:
        _, axes = guess_columns(read_sheet(points).header)
        names, _ = guess_columns(sheet.header)
        position = [axes[k] for k in "xyz"] if len(axes) == 3 else []
        guessed = {"joints": [names[k] for k in sorted(names)], **guess_units(sheet.header)}
        by = {"by": "order"}
        mapping = {"position": position, "joint_list": by, **guessed} if position else None
    return mapping, sheet.header


def _read_preview(cell: Cell, path: Path, layout: ColumnMapping | None) -> dict[str, object]:
    """Returns a summary of the rows as read, or why they cannot be read so."""
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
    """Returns the columns recognised by their names; others are empty."""
    joints, axes = guess_columns(header)
    return {
        "joints": [joints.get(k, "") for k in range(1, max(joints, default=6) + 1)],
        "position": [axes.get(k, "") for k in "xyz"],
        **guess_units(header),
    }


def _describe_error(error: RobotrueError) -> dict[str, object]:
    kind = type(error).__name__
    return {"kind": kind, "message": error.message, "hint": error.hint, "line": error.line}
