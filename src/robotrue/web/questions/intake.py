"""Files that came in become items of the workspace."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from robotrue.cell.cell import Cell, tracker_covariance
from robotrue.cell.config import read_cell
from robotrue.core.files import read_bytes
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.measurement.formats.mapping import ColumnMapping, build_mapping
from robotrue.measurement.formats.measured_files import read_measurements
from robotrue.measurement.measurement_set import MeasurementSet, concatenate
from robotrue.measurement.plausibility import FEWEST_POSES, check_plausible
from robotrue.measurement.tracker import point_covariance
from robotrue.robot.forward import forward
from robotrue.store import cells, items, measurements, programs
from robotrue.store.nouns import CELL, CellRecord
from robotrue.store.workspace import Workspace
from robotrue.web.api.documents import record_document
from robotrue.web.questions.packing import answer


def add_cell(folder: str, paths: str, name: str) -> bytes:
    """Returns the record of a cell.toml taken in with the files it names beside it."""
    found = [Path(each) for each in json.loads(paths)]
    main = [path for path in found if path.suffix.lower() == ".toml"]
    if len(main) != 1:
        raise ConfigurationError(
            f"{len(main)} TOML files, expected one cell.toml and the files it names.",
            hint="drop them together.",
        )
    with TemporaryDirectory() as together, Workspace.open(folder) as workspace:
        for path in found:
            (Path(together) / path.name).write_bytes(path.read_bytes())
        cell = Path(together) / main[0].name
        cells.require_beside(
            read_bytes(cell).decode("utf-8-sig", "replace"), {p.name for p in found}
        )
        record = cells.add(workspace, cell, name=name or None)
        return answer(record_document(record, "cell"))


def add_program(folder: str, paths: str, name: str) -> bytes:
    """Returns the record of a program's files taken in as they stand."""
    with Workspace.open(folder) as workspace:
        found = [Path(each) for each in json.loads(paths)]
        record = programs.add(workspace, found, name=name or None)
        return answer(record_document(record, "program"))


def add_measurements(folder: str, paths: str, name: str, cell_id: str, mapping: str) -> bytes:
    """Returns the record of measured poses, read, checked for plausibility and taken in.

    Args:
        folder: Of the workspace.
        paths: JSON list of files.
        name: In the workspace; empty: that of the first file.
        cell_id: They were measured in.
        mapping: JSON of the fields of a column mapping; empty: the layout is found.
    """
    found = [Path(each) for each in json.loads(paths)]
    with Workspace.open(folder) as workspace:
        record = items.get(workspace, CELL, cell_id)
        rows, remarks = read_sets(cell_of(workspace, record), found, column_mapping(mapping))
        stored = measurements.add(
            workspace,
            rows,
            name=name or found[0].stem,
            raw=found,
            cell=record.ref,
            detail={"remarks": remarks, "mapping": json.loads(mapping) if mapping else None},
        )
        return answer(record_document(stored, "measurement"))


def column_mapping(text: str) -> ColumnMapping | None:
    """Returns a column mapping from JSON of its fields, or None.

    Raises:
        ConfigurationError: An unknown field or a value it cannot take.
    """
    if not text:
        return None
    return build_mapping({"name": "as chosen"} | json.loads(text))


def cell_of(workspace: Workspace, record: CellRecord) -> Cell:
    """Returns a cell of the workspace, read with the files it names."""
    with TemporaryDirectory() as folder:
        return read_cell(cells.copy_cell(workspace, record, Path(folder)))


def read_sets(
    cell: Cell, paths: list[Path], layout: ColumnMapping | None, *, minimum: int = FEWEST_POSES
) -> tuple[MeasurementSet, list[str]]:
    """Returns all files as one set, and what is odd about it but harmless.

    Raises:
        FormatError: A file that cannot be read.
        ImplausibleDataError: Numbers that cannot be this robot's.
        ModelMismatchError: Another number of joints, or files in different frames.
    """
    robot = cell.measured_robot
    sets = [_in_cell(cell, path, layout) for path in paths]
    for path, found in zip(paths, sets, strict=True):
        if found.dof != robot.dof or found.frame != sets[0].frame:
            raise ModelMismatchError(
                f"{found.dof} joints, positions in the {found.frame} frame; expected {robot.dof} "
                f"joints and the {sets[0].frame} frame.",
                source=path.name,
                hint="check the robot of the cell; add files of another frame on their own.",
            )
    joined = concatenate(sets)

    def measured_point(joints: Any) -> Any:
        return forward(robot, joints)[:, :3, 3]

    remarks = check_plausible(
        joined,
        measured_point(joined.joints),
        robot.reach,
        forward=measured_point,
        minimum=minimum,
    )
    return joined, list(remarks)


def _in_cell(cell: Cell, path: Path, layout: ColumnMapping | None) -> MeasurementSet:
    """A layout that is in the tracker's own frame stays in it, whatever the cell says."""
    found = read_measurements(
        path,
        mapping=layout,
        frame="tracker" if cell.frame == "tracker" else None,
        instrument=partial(tracker_covariance, cell),
    )
    if found.frame == cell.frame:
        return found
    own = partial(point_covariance, cell.tracker, tracker=np.zeros(3))
    return read_measurements(path, mapping=layout, instrument=own)
