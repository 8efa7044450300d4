"""Measured poses of one or several files, in one frame and checked for plausibility."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from robotrue.app.reporting import Message, Reporter, note
from robotrue.app.request import Reference
from robotrue.cell.cell import Cell, tracker_covariance
from robotrue.core.arrays import Array
from robotrue.core.conditions import EXTERNAL_AXES, Rail
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.measurement.formats.mapping import ColumnMapping, read_mapping
from robotrue.measurement.formats.measured_files import open_sheet
from robotrue.measurement.formats.table import read_run
from robotrue.measurement.measurement_set import MeasurementSet, concatenate
from robotrue.measurement.plausibility import FEWEST_POSES, check_plausible
from robotrue.measurement.tracker import point_covariance
from robotrue.robot.configuration import axis_relation
from robotrue.robot.forward import forward


def read_together(
    cell: Cell,
    paths: Sequence[Path],
    mapping: Path | None,
    *,
    reporter: Reporter,
) -> MeasurementSet:
    """Returns all files as one set, checked for plausibility.

    Positions are in the cell's frame; those of a layout that is in the tracker's own frame stay in
    it. Rows of all files that name no station belong to one set-up of the tracker.

    Raises:
        FormatError: A file that cannot be read.
        ImplausibleDataError: Numbers that are impossible for this robot.
        ModelMismatchError: Another number of joints, or files in different frames.
    """
    sets = [read_rows(cell, path, mapping, reporter=reporter) for path in paths]
    return join_rows(cell, sets, [str(path) for path in paths], reporter=reporter)


def join_rows(
    cell: Cell,
    sets: Sequence[MeasurementSet],
    names: Sequence[str],
    *,
    reporter: Reporter,
    minimum: int = FEWEST_POSES,
) -> MeasurementSet:
    """Returns sets as one, checked for plausibility; ``names`` are what messages call them.

    Raises:
        ImplausibleDataError: Numbers that are impossible for this robot.
        ModelMismatchError: Another number of joints, or sets in different frames.
    """
    robot = cell.measured_robot
    for name, rows in zip(names, sets, strict=True):
        if rows.dof != robot.dof:
            raise ModelMismatchError(
                f"{rows.dof} joints in the measurements, {robot.dof} in {robot.name}.",
                source=name,
                hint="check the robot in the cell file.",
            )
        if rows.frame != sets[0].frame:
            raise ModelMismatchError(
                f"positions in the {rows.frame} frame, those of {names[0]} in the "
                f"{sets[0].frame} frame.",
                source=name,
                hint="calibrate from files of one frame.",
            )
        if (rows.rail is None) != (sets[0].rail is None):
            without = name if rows.rail is None else names[0]
            raise ModelMismatchError(
                "no position of the arm on its rail, which another file states.",
                source=without,
                hint="add its column e1_mm.",
            )
    whole = concatenate(sets)

    def measured_point(joints: Array) -> Array:
        return forward(robot, joints)[:, :3, 3]

    remarks = check_plausible(
        whole,
        measured_point(whole.joints) + whole.carried,
        robot.reach,
        forward=measured_point,
        minimum=minimum,
    )
    for remark in remarks:
        reporter.report(note(remark))
    poses, files = len(whole), len(names)
    reporter.report(
        Message(
            f"{poses} pose{'' if poses == 1 else 's'} from {files} file{'' if files == 1 else 's'}"
        )
    )
    return whole


def require_mapped(mapping: Path | None, references: Sequence[Reference]) -> None:
    """Refuses a column mapping without a file that it could be of.

    Raises:
        ConfigurationError: All measurements are sets of a workspace, mapped when imported.
    """
    if mapping is not None and not any(isinstance(each, Path) for each in references):
        raise ConfigurationError(
            f"the column mapping {mapping.name} is unused: no measured file was sent, and "
            "measurements of a workspace were mapped at their import.",
            hint="send the measured files, or leave the mapping out.",
        )


def read_rows(
    cell: Cell, path: Path, mapping: Path | ColumnMapping | None, *, reporter: Reporter
) -> MeasurementSet:
    """Returns the rows of one file in the cell's frame, before any check.

    A layout that is in the tracker's own frame stays in it, regardless of the cell.

    Raises:
        FormatError: A file that cannot be read.
    """
    layout = read_mapping(mapping) if isinstance(mapping, Path) else mapping
    sheet, layout = open_sheet(path, layout)
    own_frame = cell.frame == "base" and layout.frame == "tracker"
    instrument = partial(tracker_covariance, cell)
    if own_frame:
        reporter.report(
            note(f"positions of {path.name} are in the frame of its tracker, not in the base")
        )
        # The cell's tracker position is in the base and does not apply here: the origin does.
        instrument = partial(point_covariance, cell.tracker, tracker=np.zeros(3))
    run = read_run(
        sheet,
        layout,
        frame="tracker" if cell.frame == "tracker" else None,
        instrument=instrument,
        relation=axis_relation(cell.measured_robot),
    )
    for remark in run.remarks:
        reporter.report(note(remark))
    return ride_rail(run.rows, cell)


def ride_rail(rows: MeasurementSet, cell: Cell) -> MeasurementSet:
    """Returns rows with the rail that the cell describes; positions in base in the base it carries.

    Raises:
        ConfigurationError: An external axis that moved and that the cell does not describe.
    """
    moved = np.ptp(rows.external, axis=0) > 0.0 if len(rows) else np.zeros(EXTERNAL_AXES, bool)
    described = {axis.number: axis for axis in cell.controller.external}
    for number in (np.flatnonzero(moved) + 1).tolist():
        if number not in described:
            low, high = rows.external[:, number - 1].min(), rows.external[:, number - 1].max()
            raise ConfigurationError(
                f"external axis E{number} moves from {low:g} to {high:g} (m or rad), and the cell "
                "does not describe it.",
                hint="[[controller.external]]: axis, along or about, carries.",
            )
    rails = [a for a in described.values() if a.carries_robot and rows.external.size]
    rails = [a for a in rails if np.isfinite(rows.external[:, a.number - 1]).all()]
    if not rails:
        return rows
    rail = Rail(number=rails[0].number, direction=rails[0].direction, at=rails[0].at)
    floor = rail.carry(rows.external) if rows.frame == "base" else 0.0
    return replace(rows, rail=rail, position=rows.position - floor)
