"""Files of measured or queried poses, by the name of their layout or by their header."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.conditions import ArmConditions, join_conditions
from robotrue.core.csv_text import axis_names
from robotrue.errors import ConfigurationError
from robotrue.measurement.formats.canonical import (
    axes_in,
    canonical_mapping,
    external_names,
    joint_names,
    joints_in,
)
from robotrue.measurement.formats.joined_sheet import join_sheets, read_joint_list
from robotrue.measurement.formats.joint_literals import AXES, read_joint_literals
from robotrue.measurement.formats.mapped_sheet import MappedSheet
from robotrue.measurement.formats.mapping import AngleUnit, ColumnMapping, read_layouts
from robotrue.measurement.formats.sheet import Sheet, column_key
from robotrue.measurement.formats.sheet_file import read_sheet
from robotrue.measurement.formats.table import (
    AxisRelation,
    approach_columns,
    payload_column,
    read_condition_columns,
    read_joint_columns,
    read_run,
    split_monuments,
    wrench_columns,
)
from robotrue.measurement.measurement_set import MeasurementFrame, MeasurementSet
from robotrue.measurement.tracker import Instrument


@dataclass(frozen=True, slots=True, kw_only=True)
class QueryTable(Columns):
    """n poses of a query.

    Attributes:
        joints: (n, dof) rad, commanded.
        wrench: (n, 6) N, N m on the tool, at the tool point, base axes; zero if not given.
        approach: (n, dof) sign of the last motion of each joint; 0 = unknown.
        payload_mass: (n,) kg at the flange; NaN means "the cell's payload".
        conditions: Temperature and time; not stated if the file has none.
        source_row: (n,) one-based line in the file.
    """

    joints: Annotated[Array, Column("n dof", unit="rad")]
    wrench: Annotated[Array, Column("n 6")]
    approach: Annotated[Array, Column("n dof")]
    payload_mass: Annotated[Array, Column("n", unit="kg", nan=True)]
    conditions: Annotated[ArmConditions, Column("n")]
    source_row: Annotated[IntArray, Column("n")]

    def __len__(self) -> int:
        return len(self.joints)


def read_queries(
    path: str | Path,
    *,
    mapping: ColumnMapping | str | None = None,
    relation: AxisRelation | None = None,
) -> QueryTable:
    """Returns the queries in a file: canonical columns, of which only the joints are needed.

    A measurement file of any known layout is accepted as well; its positions are not looked at.
    ``relation`` takes the controller's axes to joints, for a mapping of such axes.

    Raises:
        FormatError: The file does not match its mapping, with line and column.
    """
    sheet, chosen = open_sheet(path, mapping, positions=False)
    columns = MappedSheet(sheet, chosen)
    return QueryTable(
        joints=read_joint_columns(columns, relation),
        wrench=wrench_columns(columns),
        approach=approach_columns(columns),
        payload_mass=payload_column(columns),
        conditions=join_conditions(**read_condition_columns(columns)),
        source_row=np.array(sheet.lines),
    )


def read_measurements(
    path: str | Path,
    *,
    mapping: ColumnMapping | str | None = None,
    frame: MeasurementFrame | None = None,
    instrument: Instrument | None = None,
    ignore: Sequence[str] = (),
    relation: AxisRelation | None = None,
) -> MeasurementSet:
    """Returns the measurements of a CSV, TSV, TXT or workbook file.

    Args:
        path: The file.
        mapping: Content of the columns, or the name of a known layout; None detects it from the
            header (canonical columns, or a known layout).
        frame: Frame of the positions; None takes the mapping's (canonical: base).
        instrument: Covariance of a point where the file has no standard deviations.
        ignore: Columns to ignore in a canonical file.
        relation: Takes the controller's axes to joints, for a mapping of such axes:
            ``robot.controller.to_model``.

    Raises:
        FormatError: The file does not match its mapping, with line and column.
        ConfigurationError: No layout of that name.
    """
    sheet, chosen = open_sheet(path, mapping, ignore=ignore)
    run = read_run(sheet, chosen, frame=frame, instrument=instrument, relation=relation)
    return run.rows


def open_sheet(
    path: str | Path,
    mapping: ColumnMapping | str | None,
    *,
    positions: bool = True,
    ignore: Sequence[str] = (),
) -> tuple[Sheet, ColumnMapping]:
    """Returns the file's columns and the mapping that reads them.

    Raises:
        FormatError: Unreadable file, or no known layout has these columns.
        ConfigurationError: No layout of that name.
    """
    layouts = read_layouts()
    if isinstance(mapping, str) and mapping != "canonical":
        if mapping not in layouts:
            raise ConfigurationError(
                f"no measurement layout {mapping!r}; known are canonical, {', '.join(layouts)}."
            )
        mapping = layouts[mapping]
    if isinstance(mapping, ColumnMapping):
        sheet = read_sheet(
            path,
            delimiter=mapping.delimiter,
            decimal=mapping.decimal,
            encoding=mapping.encoding,
            skip_lines=mapping.skip_lines,
            header=mapping.header,
            header_lines=mapping.header_lines,
            worksheet=mapping.worksheet,
        )
        sheet = split_monuments(sheet, mapping)
        if mapping.joint_list is None:
            return sheet, mapping
        joints, radians = read_joint_list(mapping.joint_list)
        joined = join_sheets(joints, sheet, mapping.joint_list)
        return joined, _name_joints(mapping, joints, joined, radians)
    literals = None if positions else read_joint_literals(path)
    if literals is not None:
        sheet, radians = literals
        unit: AngleUnit = "rad" if radians else "deg"
        program = ColumnMapping(
            name="program", joints=AXES, axes="controller", joints_unit=unit, position=()
        )
        return sheet, program
    sheet = read_sheet(path)
    return _detect_mapping(sheet, mapping, positions, ignore)


def _name_joints(
    mapping: ColumnMapping, joints: Sheet, joined: Sheet, radians: bool
) -> ColumnMapping:
    """The mapping with the joint columns of a joint list, where it names none itself.

    Raises:
        FormatError: The list calls them neither j1_deg ... nor A1 ... A6.
    """
    if mapping.joints:
        return mapping
    dof = joints_in(joints.header)
    if dof:
        return replace(mapping, joints=joint_names(dof))
    if not all(map(joined.has, AXES)):
        raise joints.lacking_columns(AXES, "name its joint columns: joints = [...] in the mapping.")
    unit: AngleUnit = "rad" if radians else mapping.joints_unit
    return replace(mapping, joints=AXES, axes="controller", joints_unit=unit)


def _detect_mapping(
    sheet: Sheet, name: str | None, positions: bool, ignore: Sequence[str]
) -> tuple[Sheet, ColumnMapping]:
    dof, axes = joints_in(sheet.header), axes_in(sheet.header)
    if dof or axes or name == "canonical":
        beside = axis_names(axes) if dof else ()
        dropped = {column_key(column) for column in (*ignore, *beside)}
        kept = [i for i, column in enumerate(sheet.header) if column_key(column) not in dropped]
        thinned = replace(
            sheet,
            header=tuple(sheet.header[i] for i in kept),
            cells=tuple(tuple(row[i] for i in kept) for row in sheet.cells),
        )
        external = external_names(thinned.header)
        mapping = replace(canonical_mapping(dof or axes or 6), external=external)
        if axes and not dof:
            mapping = replace(mapping, joints=axis_names(axes), axes="controller")
        optional = mapping.optional if positions else (*mapping.optional, "position")
        return split_monuments(thinned, mapping), replace(mapping, optional=optional)
    for known in read_layouts().values():
        if all(map(sheet.has, known.columns(required_only=True))):
            return sheet, known
    raise sheet.fault(
        f"columns of no known layout: {', '.join(sheet.header)}.",
        "name them j1_deg..j6_deg, x_mm, y_mm, z_mm, or give a mapping.",
    )
