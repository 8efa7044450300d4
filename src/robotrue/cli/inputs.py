"""What commands read: cells, measurements in any layout, loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robotrue.cell.cell import Cell, tracker_covariance
from robotrue.cli.console import count, say
from robotrue.core.arrays import Array
from robotrue.core.toml_text import read_toml
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.measurement.formats.mapping import ColumnMapping
from robotrue.measurement.formats.registry import read_measurements
from robotrue.measurement.measurement_set import MeasurementSet, concatenate
from robotrue.measurement.plausibility import check_plausible
from robotrue.measurement.tracker import point_covariance
from robotrue.robot.forward import forward


def measured(
    cell: Cell, paths: Sequence[Path], mapping: Path | None, *, minimum: int = 6
) -> MeasurementSet:
    """Returns all files as one set, checked for plausibility.

    Positions are in the cell's frame; those of a layout that is in the tracker's own frame stay in
    it. Rows of all files that name no station belong to one set-up of the tracker.

    Raises:
        FormatError: A file that cannot be read.
        ImplausibleDataError: Numbers that cannot be this robot's.
        ModelMismatchError: Another number of joints, or files in different frames.
    """
    sets = [read_rows(cell, path, mapping) for path in paths]
    return joined(cell, sets, [str(path) for path in paths], minimum=minimum)


def joined(
    cell: Cell, sets: Sequence[MeasurementSet], names: Sequence[str], *, minimum: int = 6
) -> MeasurementSet:
    """Returns sets as one, checked for plausibility; ``names`` are what messages call them.

    Raises:
        ImplausibleDataError: Numbers that cannot be this robot's.
        ModelMismatchError: Another number of joints, or sets in different frames.
    """
    robot = cell.measured_robot
    for path, found in zip(names, sets, strict=True):
        if found.dof != robot.dof:
            raise ModelMismatchError(
                f"{found.dof} joints in the measurements, {robot.dof} in {robot.name}.",
                source=path,
                hint="check the robot in the cell file.",
            )
        if found.frame != sets[0].frame:
            raise ModelMismatchError(
                f"positions in the {found.frame} frame, those of {names[0]} in the "
                f"{sets[0].frame} frame.",
                source=path,
                hint="calibrate from files of one frame.",
            )
    whole = concatenate(sets)

    def measured_point(joints: Array) -> Array:
        return forward(robot, joints)[:, :3, 3]

    remarks = check_plausible(
        whole,
        measured_point(whole.joints),
        robot.reach,
        forward=measured_point,
        minimum=minimum,
    )
    for remark in remarks:
        say(f"note: {remark}")
    say(f"{count(len(whole), 'pose')} from {count(len(names), 'file')}")
    return whole


def read_rows(cell: Cell, path: Path, mapping: Path | None) -> MeasurementSet:
    """Returns the rows of one file as it stands, in the cell's frame, not yet checked.

    Raises:
        FormatError: A file that cannot be read.
    """
    return _read(cell, path, None if mapping is None else read_mapping(mapping))


def _read(cell: Cell, path: Path, layout: ColumnMapping | None) -> MeasurementSet:
    """One file; a layout that is in the tracker's own frame stays in it, whatever the cell says."""
    found = read_measurements(
        path,
        mapping=layout,
        frame="tracker" if cell.frame == "tracker" else None,
        instrument=partial(tracker_covariance, cell),
    )
    if found.frame == cell.frame:
        return found
    say(f"note: positions of {path.name} are in the frame of its tracker, not in the base")
    # The cell's tracker position is one in the base and says nothing here: the origin is.
    return read_measurements(
        path,
        mapping=layout,
        instrument=partial(point_covariance, cell.tracker, tracker=np.zeros(3)),
    )


def check_output(output: Path, sources: Sequence[Path], *, folder: bool = False) -> None:
    """Refuses, before any work is done, an output that cannot be or that is one of the sources.

    Args:
        output: File to be written.
        sources: What is read.
        folder: A folder that exists will do, too.

    Raises:
        ConfigurationError: No such folder, a folder itself, or a file that is read.
    """
    if output.is_dir() and folder:
        return
    if output.is_dir():
        raise ConfigurationError(
            "the output is a folder.", source=output, hint="a file name after -o."
        )
    if not output.parent.is_dir():
        raise ConfigurationError(
            f"cannot write: the folder {output.parent} does not exist.",
            source=output,
            hint=f"mkdir -p {output.parent}",
        )
    for source in sources:
        if output.exists() and source.exists() and output.samefile(source):
            raise ConfigurationError(
                f"the output is {source.name}, which is read here; it is left as it is.",
                source=output,
                hint="another name after -o.",
            )


def read_mapping(path: Path) -> ColumnMapping:
    """Returns a column mapping written as TOML: the fields of ``ColumnMapping``, nothing else.

    Raises:
        ConfigurationError: Not TOML, an unknown field or a value it cannot take.
        FormatError: The file cannot be read.
    """
    stated, _ = read_toml(path, example="the guide on importing a tracker file")
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
