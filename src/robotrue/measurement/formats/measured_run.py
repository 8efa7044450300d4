"""A sheet as rows of a run: monuments and repeated shots, as its mapping states them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

import numpy as np

from robotrue.measurement.formats.mapped_sheet import MappedSheet
from robotrue.measurement.formats.mapping import GROUPS, ColumnMapping
from robotrue.measurement.formats.sheet import Sheet, column_key
from robotrue.measurement.formats.table import AxisRelation, point_columns, read_table
from robotrue.measurement.frame_walk import MonumentShots, describe_walks, remove_walk
from robotrue.measurement.measurement_set import MeasurementFrame, MeasurementSet
from robotrue.measurement.repeated_poses import average_repeats, describe_repeats
from robotrue.measurement.tracker import Instrument, default_instrument


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredRun:
    """Rows of one file, and how they came about.

    Attributes:
        rows: In the frame of the first shot of a monument, where there are monuments.
        remarks: One sentence each: joins, monuments, repeated shots.
    """

    rows: MeasurementSet
    remarks: tuple[str, ...]


def split_monuments(sheet: Sheet, mapping: ColumnMapping) -> Sheet:
    """Returns the sheet without its rows of monuments, which it carries apart."""
    if not mapping.monuments or not sheet.has(mapping.point_name[0]):
        return sheet
    patterns = [column_key(pattern) for pattern in mapping.monuments]
    names = map(column_key, sheet.column(mapping.point_name[0]))
    shot = [any(fnmatchcase(name, pattern) for pattern in patterns) for name in names]
    if not any(shot):
        return sheet
    poses = sheet.take(row for row, is_shot in enumerate(shot) if not is_shot)
    return replace(poses, monuments=sheet.take(np.flatnonzero(shot).tolist()))


def read_run(
    sheet: Sheet,
    mapping: ColumnMapping,
    *,
    frame: MeasurementFrame | None = None,
    instrument: Instrument | None = None,
    relation: AxisRelation | None = None,
) -> MeasuredRun:
    """Returns the rows of a sheet; arguments as those of ``read_table``.

    The order of the lines is the time of the run. The motion of the frame that monuments show is
    taken off, then shots of one pose are averaged if the mapping says so.

    Raises:
        FormatError: A column is missing or unknown, or a cell is not what it should be.
        ShapeError: Monuments of which none was shot twice.
    """
    instrument = instrument or default_instrument
    rows = read_table(sheet, mapping, frame=frame, instrument=instrument, relation=relation)
    remarks = sheet.remarks
    if sheet.monuments is not None:
        shots = _read_shots(sheet.monuments, mapping, instrument)
        rows, walks = remove_walk(rows, shots, np.array(sheet.lines, dtype=np.float64))
        remarks += describe_walks(walks)
    if mapping.repeats == "mean":
        poses = average_repeats(rows)
        rows, remarks = poses.mean, remarks + describe_repeats(poses)
    return MeasuredRun(rows=rows, remarks=remarks)


def _read_shots(sheet: Sheet, mapping: ColumnMapping, instrument: Instrument) -> MonumentShots:
    others = tuple(group for group in GROUPS if group not in ("position", "point_name"))
    columns = MappedSheet(sheet, replace(mapping, optional=others))
    position, covariance = point_columns(columns, instrument)
    return MonumentShots(
        nest=sheet.words(mapping.point_name[0]),
        position=position,
        covariance=covariance,
        moment=np.array(sheet.lines, dtype=np.float64),
        station=columns.whole("station"),
    )
