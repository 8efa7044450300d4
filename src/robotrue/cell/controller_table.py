"""``[controller]`` of cell.toml: the frames programs name, external axes, drive pulses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import PurePosixPath
from typing import Final

import numpy as np

from robotrue.cell.schema import ControllerTable, ExternalTable, NamedFrameTable
from robotrue.cell.toml_edit import pose_keys, round_digits
from robotrue.core.arrays import Array
from robotrue.core.poses import pose, pose_from_xyz_abc
from robotrue.core.rotations import matrix_from_quat_wxyz
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.program.controller_files import ControllerFile
from robotrue.program.external_axes import ExternalAxis
from robotrue.program.frames_beside import read_controller_file
from robotrue.program.orientation import OrientationRule
from robotrue.program.program import FrameTable

ROBOT: Final = "robot"
"""What a rail carries."""
_TURNS: Final = ("abc_deg", "wpr_deg", "quaternion")


def read_controller(table: ControllerTable, read_file: Callable[[str], bytes]) -> FrameTable:
    """Returns what programs name, without the defaults of the cell.

    Entries of the cell go before those of the files it names.

    Args:
        table: As checked against the schema.
        read_file: Returns the content of a file by the name that the cell file gives it.

    Raises:
        ConfigurationError: A frame without number and name, given twice, or with two
            orientations; an axis that carries nothing it can; a ratio of zero.
        FormatError: A file that cannot be read.
    """
    files = [_parse_file(name, read_file(name)) for name in table.files]
    pulses = table.pulses_per_degree
    if pulses is not None and not all(pulses):
        raise ConfigurationError(
            f"controller.pulses_per_degree is {pulses}, expected six numbers other than zero.",
            hint="axes S, L, U, R, B, T; negative where the pulses count against the axis.",
        )
    bases, tools = (_read_frames(side, getattr(table, side)) for side in ("base", "tool"))
    return FrameTable(
        bases={**_merge_files(files, "bases"), **bases},
        tools={**_merge_files(files, "tools"), **tools},
        external=tuple(_read_axis(entry, k) for k, entry in enumerate(table.external, start=1)),
        external_axes_at_rest=table.external_axes_at_rest,
        fixed_tool=table.fixed_tool or "",
        pulses_per_degree=None if pulses is None else np.array(pulses),
        orientation=_read_orientation(table),
        start=np.array(table.start_deg or []) * DEG,
        harmless_routines=tuple(name.strip().lower() for name in table.harmless_routines),
        units_without_point=table.units_without_point or "",
    )


def _read_orientation(table: ControllerTable) -> OrientationRule:
    """Reads how angles and tool axes of G-code, APT and CSV define the tool frame."""
    sign, axis = ("", *(table.cutter or "z"))[-2:]
    cutter = np.eye(3)["xyz".index(axis)] * (-1.0 if sign == "-" else 1.0)
    spin = None if table.spin_deg is None else table.spin_deg * DEG
    return OrientationRule(angles=table.angles or "", cutter=cutter, spin=spin)


def _parse_file(stated: str, data: bytes) -> ControllerFile:
    name = PurePosixPath(stated.replace("\\", "/")).name
    parsed = read_controller_file(name, data)
    if parsed is None:
        raise ConfigurationError(
            f"controller.files: {name} is no file of frames that robotrue reads.",
            hint="KUKA $config.dat, Yaskawa TOOL.CND and UFRAME.CND, Fanuc SYSFRAME.VA.",
        )
    return parsed


def _merge_files(files: Sequence[ControllerFile], side: str) -> dict[str, Array]:
    frames: dict[str, Array] = {}
    for file in files:
        for key, matrix in getattr(file, side).items():
            if key in frames and not np.allclose(frames[key], matrix, rtol=0.0, atol=1e-9):
                raise ConfigurationError(
                    f"controller.files: {side[:-1]} {key} is in two files, with two values.",
                    hint="name the files of one controller.",
                )
            frames[key] = matrix
    return frames


def _read_frames(side: str, tables: Sequence[NamedFrameTable]) -> dict[str, Array]:
    frames: dict[str, Array] = {}
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
            if key.lower() in {known.lower() for known in frames}:
                raise ConfigurationError(
                    f"{where}: {side} {key} is given twice.", hint="remove one of the two."
                )
            frames[key] = _read_pose(table, where)
    return frames


def _read_pose(table: NamedFrameTable, where: str) -> Array:
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


def _read_axis(table: ExternalTable, number: int) -> ExternalAxis:
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


def controller_table(stated: FrameTable) -> dict[str, object]:
    """Returns the equivalent table, every frame by one number or name, without files."""
    table: dict[str, object] = {}
    if stated.pulses_per_degree is not None:
        table["pulses_per_degree"] = round_digits(stated.pulses_per_degree)
    if stated.external_axes_at_rest:
        table["external_axes_at_rest"] = True
    if stated.fixed_tool:
        table["fixed_tool"] = stated.fixed_tool
    table |= _orientation_keys(stated.orientation)
    if len(stated.start):
        table["start_deg"] = round_digits(stated.start / DEG)
    if stated.harmless_routines:
        table["harmless_routines"] = list(stated.harmless_routines)
    if stated.units_without_point:
        table["units_without_point"] = stated.units_without_point
    for side, frames in (("base", stated.bases), ("tool", stated.tools)):
        if frames:
            table[side] = [_frame_table(key, T) for key, T in frames.items()]
    if stated.external:
        table["external"] = [_axis_table(axis) for axis in stated.external]
    return table


def _orientation_keys(rule: OrientationRule) -> dict[str, object]:
    keys: dict[str, object] = {"angles": rule.angles} if rule.angles else {}
    axis = int(np.argmax(np.abs(rule.cutter)))
    name = ("-" if rule.cutter[axis] < 0.0 else "") + "xyz"[axis]
    if name != "z":
        keys["cutter"] = name
    if rule.spin is not None:
        keys["spin_deg"] = round_digits(rule.spin / DEG)
    return keys


def _frame_table(key: str, T: Array) -> dict[str, object]:
    named = {"number": int(key)} if key.isascii() and key.isdigit() else {"name": key}
    return {**named, **pose_keys(T)}


def _axis_table(axis: ExternalAxis) -> dict[str, object]:
    turns = axis.point is not None
    table: dict[str, object] = {"axis": axis.number}
    table["about" if turns else "along"] = round_digits(axis.direction)
    if axis.name:
        table["name"] = axis.name
    if axis.point is not None:
        table["through_mm"] = round_digits(axis.point / MM)
    table["at_deg" if turns else "at_mm"] = round_digits(axis.at / axis.unit)
    table["carries"] = [ROBOT] if axis.carries_robot else list(axis.frames)
    if np.isfinite(axis.per_pulse):
        per = "degree" if turns else "mm"
        table[f"pulses_per_{per}"] = round_digits(1.0 / axis.per_pulse)
    return table
