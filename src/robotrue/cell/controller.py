"""``[controller]`` of cell.toml: the frames programs name, external axes, drive pulses."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from robotrue.cell.controller_text import ROBOT
from robotrue.cell.schema import ControllerTable, ExternalTable, NamedFrameTable
from robotrue.core.arrays import Array
from robotrue.core.files import read_bytes
from robotrue.core.poses import pose, pose_from_xyz_abc
from robotrue.core.rotations import matrix_from_quat_wxyz
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.program.controller_files import ControllerFile, read_controller_file
from robotrue.program.external_axes import ExternalAxis
from robotrue.program.orientation import OrientationRule
from robotrue.program.program import FrameTable

_TURNS = ("abc_deg", "wpr_deg", "quaternion")


def controller_of(table: ControllerTable, folder: Path) -> FrameTable:
    """Returns what programs name, without the defaults of the cell.

    Entries of the cell go before those of the files it names.

    Raises:
        ConfigurationError: A frame without number and name, given twice, or with two
            orientations; an axis that carries nothing it can; a ratio of zero.
        FormatError: A file that cannot be read.
    """
    files = [_file(folder / name) for name in table.files]
    pulses = table.pulses_per_degree
    if pulses is not None and not all(pulses):
        raise ConfigurationError(
            f"controller.pulses_per_degree is {pulses}, expected six numbers other than zero.",
            hint="axes S, L, U, R, B, T; negative where the pulses count against the axis.",
        )
    bases, tools = (_frames(side, getattr(table, side)) for side in ("base", "tool"))
    return FrameTable(
        bases={**_of_files(files, "bases"), **bases},
        tools={**_of_files(files, "tools"), **tools},
        external=tuple(_axis(each, k) for k, each in enumerate(table.external, start=1)),
        external_axes_at_rest=table.external_axes_at_rest,
        fixed_tool=table.fixed_tool or "",
        pulses_per_degree=None if pulses is None else np.array(pulses),
        orientation=_orientation(table),
        start=np.array(table.start_deg or []) * DEG,
        harmless_routines=tuple(name.strip().lower() for name in table.harmless_routines),
    )


def _orientation(table: ControllerTable) -> OrientationRule:
    """What angles and tool axes of G-code, APT and CSV say of the tool frame."""
    sign, axis = ("", *(table.cutter or "z"))[-2:]
    cutter = np.eye(3)["xyz".index(axis)] * (-1.0 if sign == "-" else 1.0)
    spin = None if table.spin_deg is None else table.spin_deg * DEG
    return OrientationRule(angles=table.angles or "", cutter=cutter, spin=spin)


def _file(path: Path) -> ControllerFile:
    found = read_controller_file(path.name, read_bytes(path))
    if found is None:
        raise ConfigurationError(
            f"controller.files: {path.name} is no file of frames that robotrue reads.",
            hint="KUKA $config.dat, Yaskawa TOOL.CND and UFRAME.CND, Fanuc SYSFRAME.VA.",
        )
    return found


def _of_files(files: Sequence[ControllerFile], side: str) -> dict[str, Array]:
    out: dict[str, Array] = {}
    for found in files:
        for key, matrix in getattr(found, side).items():
            if key in out and not np.allclose(out[key], matrix, rtol=0.0, atol=1e-9):
                raise ConfigurationError(
                    f"controller.files: {side[:-1]} {key} stands in two files, with two values.",
                    hint="name the files of one controller.",
                )
            out[key] = matrix
    return out


def _frames(side: str, tables: Sequence[NamedFrameTable]) -> dict[str, Array]:
    out: dict[str, Array] = {}
    for k, table in enumerate(tables, start=1):
        where = f"controller.{side}[{k}]"
        keys = [] if table.number is None else [str(table.number)]
        keys += [] if table.name is None else [table.name]
        if not keys or not all(keys):
            raise ConfigurationError(
                f"{where} has neither number nor name.",
                hint="number = 1, or name = what the program calls it.",
            )
        for key in keys:
            if key.lower() in {known.lower() for known in out}:
                raise ConfigurationError(
                    f"{where}: {side} {key} is given twice.", hint="remove one of the two."
                )
            out[key] = _matrix(table, where)
    return out


def _matrix(table: NamedFrameTable, where: str) -> Array:
    given = [name for name in _TURNS if getattr(table, name) is not None]
    if len(given) > 1:
        raise ConfigurationError(
            f"{where} gives {' and '.join(given)}, expected one orientation at most.",
            hint="the one the pendant shows.",
        )
    xyz = np.array(table.xyz_mm) * MM
    if table.quaternion is not None:
        length = float(np.linalg.norm(table.quaternion))
        if not 0.99 <= length <= 1.01:
            raise ConfigurationError(
                f"{where}.quaternion has length {length:g}, expected 1.",
                hint="[q1, q2, q3, q4] as the controller prints them, the real part first.",
            )
        return pose(matrix_from_quat_wxyz(np.array(table.quaternion)), xyz)
    abc = table.abc_deg or [0.0, 0.0, 0.0]
    if table.wpr_deg is not None:
        abc = table.wpr_deg[::-1]
    return pose_from_xyz_abc(xyz, np.array(abc) * DEG)


def _axis(table: ExternalTable, number: int) -> ExternalAxis:
    where = f"controller.external[{number}]"
    if (table.along is None) == (table.about is None):
        raise ConfigurationError(
            f"{where} needs either along or about.",
            hint="along = [1, 0, 0] of a rail; about = [0, 0, 1] and through_mm of a turntable.",
        )
    turns = table.about is not None
    if (table.through_mm is not None) != turns:
        raise ConfigurationError(
            f"{where}: through_mm, a point on the axis, goes with about and with nothing else.",
            hint="through_mm = [1500, 0, 400].",
        )
    other = ("at_mm", "pulses_per_mm") if turns else ("at_deg", "pulses_per_degree")
    wrong = [name for name in other if getattr(table, name) is not None]
    if wrong:
        kind = "turns" if turns else "is linear"
        raise ConfigurationError(f"{where}.{wrong[0]} is given, but the axis {kind}.")
    direction = np.array(table.about if turns else table.along)
    robot = any(name.lower() == ROBOT for name in table.carries)
    if not direction.any():
        raise ConfigurationError(f"{where} has the direction zero.", hint="[1, 0, 0].")
    if robot and (turns or len(table.carries) > 1):
        raise ConfigurationError(
            f"{where} carries the robot: it must be linear, and carries nothing else.",
            hint='along = [1, 0, 0] and carries = ["robot"]; frames on the floor need no mention.',
        )
    pulses = table.pulses_per_degree if turns else table.pulses_per_mm
    if pulses == 0.0:
        raise ConfigurationError(f"{where} has a pulse ratio of 0.", hint="leave it out.")
    at = (table.at_deg or 0.0) * DEG if turns else (table.at_mm or 0.0) * MM
    return ExternalAxis(
        number=table.axis,
        name=table.name,
        direction=direction,
        point=None if table.through_mm is None else np.array(table.through_mm) * MM,
        at=at,
        carries_robot=robot,
        frames=() if robot else tuple(table.carries),
        per_pulse=np.nan if pulses is None else 1.0 / pulses,
    )
