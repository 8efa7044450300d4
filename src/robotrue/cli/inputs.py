"""What commands read: cells, measurements in any layout, loads."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from robotrue.cell.cell import Cell, tracker_covariance
from robotrue.cli.console import say
from robotrue.core.arrays import Array
from robotrue.core.files import read_bytes
from robotrue.errors import ConfigurationError, FormatError, ModelMismatchError
from robotrue.measurement.formats.mapping import ColumnMapping
from robotrue.measurement.formats.registry import read_measurements
from robotrue.measurement.measurement_set import MeasurementFrame, MeasurementSet, concatenate
from robotrue.measurement.plausibility import check_plausible
from robotrue.robot.forward import forward


def measured(
    cell: Cell, paths: Sequence[Path], mapping: Path | None, *, minimum: int = 6
) -> MeasurementSet:
    """Returns all files as one set, in the cell's frame, checked for plausibility.

    Raises:
        FormatError: A file that cannot be read.
        ImplausibleDataError: Numbers that cannot be this robot's.
    """
    layout = None if mapping is None else read_mapping(mapping)
    frame: MeasurementFrame | None = "tracker" if cell.frame == "tracker" else None
    sets = [
        read_measurements(
            path,
            mapping=layout,
            frame=frame,
            instrument=lambda position: tracker_covariance(cell, position),
        )
        for path in paths
    ]
    joined = concatenate(sets)
    robot = cell.measured_robot

    def tool_point(joints: Array) -> Array:
        return forward(robot, joints)[:, :3, 3]

    if joined.dof != robot.dof:
        raise ModelMismatchError(
            f"{joined.dof} joints in the measurements, {robot.dof} in {robot.name}.",
            source=paths[0],
            hint="check the robot in the cell file.",
        )
    remarks = check_plausible(
        joined, tool_point(joined.joints), robot.reach, forward=tool_point, minimum=minimum
    )
    for remark in remarks:
        say(f"note: {remark}")
    say(f"{len(joined)} poses from {len(paths)} file{'s' if len(paths) > 1 else ''}")
    return joined


def read_mapping(path: Path) -> ColumnMapping:
    """Returns a column mapping written as TOML: the fields of ``ColumnMapping``, nothing else.

    Raises:
        ConfigurationError: An unknown field or a value it cannot take.
        FormatError: Not TOML.
    """
    try:
        stated = tomllib.loads(read_bytes(path).decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as cause:
        raise FormatError(f"not a TOML file: {cause}.", source=path) from cause
    known = {f.name for f in fields(ColumnMapping)}
    unknown = sorted(set(stated) - known)
    if unknown:
        raise ConfigurationError(
            f"unknown key {unknown[0]!r} in a column mapping; "
            f"known are {', '.join(sorted(known))}.",
            source=path,
        )
    stated.setdefault("name", path.stem)
    values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in stated.items()}
    try:
        return ColumnMapping(**values)
    except TypeError as cause:
        raise ConfigurationError(f"column mapping: {cause}.", source=path) from cause


def parse_wrench(text: str) -> Array:
    """Returns (6,) N, N m from ``FX,FY,FZ[,MX,MY,MZ]``.

    Raises:
        ConfigurationError: Not three or six numbers.
    """
    try:
        numbers = np.array([float(part) for part in text.split(",")])
    except ValueError:
        numbers = np.empty(0)
    if numbers.size not in (3, 6) or not np.isfinite(numbers).all():
        raise ConfigurationError(
            f"wrench {text!r}, expected 3 or 6 numbers in N and N m.", hint="--wrench 120,-40,-60"
        )
    return np.concatenate([numbers, np.zeros(6 - numbers.size)])
