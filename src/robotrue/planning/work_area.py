"""Work areas as postures: regions as users write them, and files of machined points.

Machined files are tables of joints, tool paths and robot programs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.cell.cell import Cell, frame_table
from robotrue.core.arrays import Array, IntArray, parse_number_list
from robotrue.core.files import read_bytes
from robotrue.core.poses import apply, inverse, pose, pose_from_xyz_abc
from robotrue.core.regions import CubeRegion, CylinderRegion, Region
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ModelMismatchError, ReachError
from robotrue.measurement.formats.part_points import read_points
from robotrue.planning.information import Postures
from robotrue.planning.probing import Machining
from robotrue.planning.probing_candidates import attitude_groups
from robotrue.planning.tool_axis import resolve_spin
from robotrue.program.formats import read_job
from robotrue.program.formats.apt import looks_like_apt
from robotrue.program.formats.toolpath_csv import looks_like_csv
from robotrue.program.formats.toolpaths import read_toolpath
from robotrue.program.program import Program, Reason
from robotrue.robot.configuration import axis_relation
from robotrue.robot.forward import forward
from robotrue.robot.inverse import inverse_batch
from robotrue.robot.spin import SpinSettings

CYLINDER: Final = ("angle_deg", "height_mm", "radius_mm")
CUBE: Final = ("x_mm", "y_mm", "z_mm")
EXAMPLE: Final = "angle_deg=-20..20,radius_mm=800..1400,height_mm=700..1200"


def parse_region(option: str, text: str) -> Region:
    """Returns the region of e.g. ``angle_deg=-20..20,radius_mm=800..1400,height_mm=700..1200``.

    Raises:
        ConfigurationError: Other names, or limits that are no numbers.
    """
    limits: dict[str, tuple[float, float]] = {}
    try:
        for part in text.split(","):
            name, _, values = part.strip().partition("=")
            low, high = (float(v) for v in values.split(".."))
            limits[name] = (low, high)
    except ValueError:
        limits = {}
    kind = tuple(sorted(limits))
    if kind not in (CYLINDER, CUBE) or any(not low < high for low, high in limits.values()):
        raise ConfigurationError(
            f"{option} {text!r}, expected three ranges LOW..HIGH of angle_deg, radius_mm, "
            "height_mm or of x_mm, y_mm, z_mm.",
            hint=f"{option} {EXAMPLE}",
        )
    sized = {
        name.rpartition("_")[0]: (low * _size(name), high * _size(name))
        for name, (low, high) in limits.items()
    }
    return CylinderRegion(**sized) if kind == CYLINDER else CubeRegion(**sized)


def _size(name: str) -> float:
    return DEG if name.endswith("deg") else MM


MOST_TARGETS: Final = 2000
"""Targets of a program that are used, evenly over the file."""


def program_postures(cell: Cell, path: Path) -> Postures:
    """Returns the postures a program works in: its own targets, with its frames and tools.

    Raises:
        ReachError: The arm reaches none of them.
    """
    programs = read_job(path, frame_table(cell))
    joints = np.concatenate([_program_joints(cell, program, MOST_TARGETS) for program in programs])
    if not len(joints):
        raise ReachError(
            "no target of this program gives a posture of the arm.",
            source=path,
            hint="check its work frame and tool.",
        )
    return Postures(joints=joints, load=cell.payload)


def _program_joints(cell: Cell, program: Program, most: int | None = None) -> Array:
    """Joints (k, dof) rad of the targets of a program, with its tools; of ``most`` of them."""
    usable = np.flatnonzero((program.reason == Reason.NONE) & np.isfinite(program.position[:, 0]))
    if most is not None:
        usable = usable[_choose_evenly(len(usable), most)]
    reached = [np.empty((0, cell.robot.dof))]
    for tool in np.unique(program.tool[usable]):
        with_tool = usable[program.tool[usable] == tool]
        targets = program.T_base_frame[program.frame[with_tool]] @ pose(
            program.rotation[with_tool], program.position[with_tool]
        )
        joints = inverse_batch(cell.robot.with_tool(program.T_flange_tool[tool]), targets)
        reached.append(joints[np.isfinite(joints).all(axis=1)])
    return np.concatenate(reached)


MOST_POSTURES: Final = 300
"""Postures of one machined file that are looked at, evenly over it."""
AXES: Final[Mapping[str, Array]] = {
    sign + name: (1.0 if sign == "+" else -1.0) * np.eye(3)[k]
    for k, name in enumerate("xyz")
    for sign in "+-"
}
_HEAD: Final = 1 << 16


@dataclass(frozen=True, slots=True, kw_only=True)
class MachinedFile:
    """A machined file as postures, evenly over it.

    Attributes:
        postures: Number of its postures.
        group: (m) names.
        point: (m, 3) m in part.
        joints: (m, dof) rad.
        part: (m) names of the part, empty where the file names none.
    """

    postures: int
    group: tuple[str, ...]
    point: Array
    joints: Array
    part: tuple[str, ...]


def rough_frames(cell: Cell, stated: str | None, parts: Sequence[str]) -> dict[int, Array]:
    """Returns the rough frame of each part, ``T_base_part`` by part number.

    Args:
        cell: A registered one names its parts; else its work frame is used.
        stated: ``X,Y,Z,A,B,C`` in mm and deg, of all parts; overrides the cell.
        parts: Names.

    Raises:
        ConfigurationError: Not six numbers, or the part's position is not stated.
    """
    if stated is not None:
        T = parse_frame(stated)
        return dict.fromkeys(range(len(parts)), T)
    if cell.part is not None:
        known = {frame.name: frame.T_base_part for frame in cell.part.frames}
        alone = next(iter(known.values())) if len(known) == 1 else None
        found = {k: known.get(name, alone) for k, name in enumerate(parts)}
        lost = [parts[k] for k, T in found.items() if T is None]
        if lost:
            raise ConfigurationError(
                f"no part {lost[0]!r} in the cell; it has {', '.join(known)}.",
                source=cell.source or None,
                hint="--frame X,Y,Z,A,B,C: the approximate part frame, mm and deg.",
            )
        return {k: T for k, T in found.items() if T is not None}
    if np.array_equal(cell.T_base_frame, np.eye(4)):
        raise ConfigurationError(
            "the rough place of the part in the base is not known.",
            source=cell.source or None,
            hint="--frame X,Y,Z,A,B,C in mm and deg (KUKA A, B, C), or the cell's work frame.",
        )
    return dict.fromkeys(range(len(parts)), cell.T_base_frame)


def parse_frame(text: str) -> Array:
    """Returns the pose of ``X,Y,Z,A,B,C`` in mm and deg.

    Raises:
        ConfigurationError: Not six finite numbers.
    """
    numbers = parse_number_list(text)
    if numbers.size != 6:
        raise ConfigurationError(
            f"frame {text!r}, expected X,Y,Z,A,B,C in mm and deg.",
            hint="--frame 800,-100,400,0,0,0",
        )
    return pose_from_xyz_abc(numbers[:3] * MM, numbers[3:] * DEG)


def parse_axis(text: str) -> Array:
    """Returns the unit vector of ``+x`` .. ``-z``.

    Raises:
        ConfigurationError: Another word.
    """
    word = text if text[:1] in "+-" else f"+{text}"
    if word not in AXES:
        raise ConfigurationError(
            f"axis {text!r}, expected one of {', '.join(AXES)}.", hint="--tip-axis +x"
        )
    return AXES[word]


def read_machining(
    cell: Cell,
    paths: Sequence[Path],
    T_base_part: Mapping[int, Array],
    parts: Sequence[str],
    *,
    tip_axis: Array,
) -> tuple[Machining, tuple[str, ...]]:
    """Returns the postures of all machined files, and notes on them.

    A file is a table of postures (``name, px_mm, py_mm, pz_mm, j1_deg ..``; the name is that of the
    group), a tool path (APT or CL data, or CSV with ``x_mm, y_mm, z_mm, i, j, k``), or a robot
    program. Paths and programs are groups by their name, one group for each attitude of the tool.

    Raises:
        FormatError: A file that cannot be read.
        ReachError: A path the arm cannot follow, or a program without a posture.
        ModelMismatchError: Another number of joints, or a part that has no features.
    """
    found = [_read(cell, path, T_base_part[0], tip_axis) for path in paths]
    part: list[IntArray] = []
    for path, item in zip(paths, found, strict=True):
        unknown = sorted({name for name in item.part if name and name not in parts})
        if unknown:
            raise ModelMismatchError(
                f"part {unknown[0]!r} has no features; those are of {', '.join(parts)}.",
                source=path,
                hint="the same names in the column part of both files.",
            )
        numbers = [parts.index(name) if name else 0 for name in item.part]
        part.append(np.array(numbers, dtype=np.int64))
    notes = tuple(
        f"{MOST_POSTURES} of {item.postures} postures of {path.name} are checked, evenly over the "
        "file"
        for path, item in zip(paths, found, strict=True)
        if item.postures > MOST_POSTURES
    )
    machining = Machining(
        group=tuple(name for item in found for name in item.group),
        point=np.concatenate([item.point for item in found]),
        joints=np.concatenate([item.joints for item in found]),
        part=np.concatenate(part),
        load=cell.payload,
    )
    return machining, notes


def _read(cell: Cell, path: Path, T_base_part: Array, tip_axis: Array) -> MachinedFile:
    head = read_bytes(path)[:_HEAD].decode("latin-1").removeprefix("\xef\xbb\xbf")
    if (
        "j1_deg" in head.casefold()
        or "a1_deg" in head.casefold()
        or path.suffix.casefold() in (".xlsx", ".ods")
    ):
        return _table(cell, path)
    if looks_like_csv(head) or looks_like_apt(head):
        return _toolpath(cell, path, T_base_part, tip_axis)
    return _program(cell, path, T_base_part, tip_axis)


def _table(cell: Cell, path: Path) -> MachinedFile:
    file = read_points(path, axis_relation(cell.robot))
    touches = file.touches
    if not touches.has_joints or touches.joints.shape[1] != cell.robot.dof:
        raise ModelMismatchError(
            f"{touches.joints.shape[1]} joint columns, {cell.robot.name} has {cell.robot.dof}.",
            source=path,
            hint="one column j1_deg, j2_deg, ... for each joint.",
        )
    kept = _choose_evenly(len(touches))
    named = len(file.parts) > 1 or file.parts[0] != "part"
    return MachinedFile(
        postures=len(touches),
        group=tuple(touches.names[k] for k in kept),
        point=touches.point[kept],
        joints=touches.joints[kept],
        part=tuple(file.parts[int(touches.part[k])] if named else "" for k in kept),
    )


def _toolpath(cell: Cell, path: Path, T_base_part: Array, tip_axis: Array) -> MachinedFile:
    toolpath = read_toolpath(path)
    posed = resolve_spin(cell.robot, T_base_part, toolpath, SpinSettings(cutter=tip_axis))
    cutting = np.flatnonzero(toolpath.cutting)
    kept = cutting[_choose_evenly(len(cutting))]
    joints = posed.joints[kept]
    return MachinedFile(
        postures=len(cutting),
        group=_name_groups(cell, toolpath.name, joints, tip_axis),
        point=toolpath.position[kept],
        joints=joints,
        part=("",) * len(kept),
    )


def _program(cell: Cell, path: Path, T_base_part: Array, tip_axis: Array) -> MachinedFile:
    frames = replace(frame_table(cell), T_base_frame=T_base_part)
    joints = np.concatenate([_program_joints(cell, program) for program in read_job(path, frames)])
    if not len(joints):
        raise ReachError(
            "no target of this program gives a posture of the arm.",
            source=path,
            hint="check its work frame and tool, and --frame.",
        )
    postures = len(joints)
    joints = joints[_choose_evenly(postures)]
    tip = forward(cell.robot.nominal(), joints)[:, :3, 3]
    return MachinedFile(
        postures=postures,
        group=_name_groups(cell, path.stem, joints, tip_axis),
        point=apply(inverse(T_base_part), tip),
        joints=joints,
        part=("",) * len(joints),
    )


def _name_groups(cell: Cell, name: str, joints: Array, tip_axis: Array) -> tuple[str, ...]:
    """The name alone where the tool keeps its attitude; else one group for each attitude."""
    group, first = attitude_groups(cell.robot, joints, tip_axis=tip_axis)
    if len(first) == 1:
        return (name,) * len(joints)
    return tuple(f"{name}, attitude {int(k) + 1}" for k in group)


def _choose_evenly(n: int, most: int = MOST_POSTURES) -> IntArray:
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(np.int64))
