"""Region of a correction function, and the arm over it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from robotrue.app.force_options import parse_wrench
from robotrue.app.wrap_request import WrapRequest
from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell
from robotrue.compensation.region_corrections import RegionArm, open_region
from robotrue.compensation.settings import CompensationSettings, is_on_table
from robotrue.compensation.stance import start_joints
from robotrue.core.arrays import Array, BoolArray, parse_number_list
from robotrue.core.conditions import EXTERNAL_AXES
from robotrue.core.poses import inverse, pose_from_xyz_abc
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.program.correction_table import PoseRegion
from robotrue.program.external_axes import riders_of
from robotrue.program.program import FrameTable, Motion, Program, Reason
from robotrue.program.target_poses import target_poses

MARGIN_MM: Final = 50.0
"""Around the known targets of a program, where no box is stated."""
SAME: Final = 1e-6
"""m and rad by which frames of one program may differ."""


def open_arm(
    request: WrapRequest,
    cell: Cell,
    model: ErrorModel,
    table: FrameTable,
    programs: Sequence[Program],
) -> RegionArm:
    """Returns the arm over the region, in its configuration.

    Raises:
        ConfigurationError: An invalid value, or a region that is not stated.
        ReachError: The middle of the region is out of reach.
    """
    known = _known_targets(programs)
    bases = [program.T_base_frame[program.frame[rows]] for program, rows in known]
    tools = [program.T_flange_tool[program.tool[rows]] for program, rows in known]
    _refuse_on_table(model, table, request.base or "base", programs)
    T_base_frame = _choose(table.bases, request.base, bases, table.T_base_frame, "base")
    T_flange_tool = _choose(table.tools, request.tool, tools, table.T_flange_tool, "tool")
    box, attitude = _box_and_attitude(request, known, T_base_frame)
    region = PoseRegion(
        T_base_frame=T_base_frame,
        low=box[:, 0],
        high=box[:, 1],
        R_frame_tool=pose_from_xyz_abc(np.zeros(3), attitude)[:3, :3],
        turn=_read_numbers("--turn-deg", request.turn_deg, 3) * DEG,
    )
    wrench = np.empty(0) if request.wrench is None else parse_wrench(request.wrench)
    settings = CompensationSettings(
        load=cell.payload,
        wrench=wrench,
        home=start_joints(cell.robot, cell.controller.start, request.start),
        approach="unknown",
    )
    return open_region(model, region, T_flange_tool, settings)


def _refuse_on_table(
    model: ErrorModel, table: FrameTable, base: str, programs: Sequence[Program]
) -> None:
    """Refuses a work frame that a calibrated table turns: a function does not know its angle.

    Raises:
        ConfigurationError: It does.
    """
    carried = np.full((1, EXTERNAL_AXES), np.nan)
    for axis, rides in zip(table.external, riders_of(table.external, base), strict=True):
        carried[0, axis.number - 1] = 0.0 if rides else np.nan
    stated = [program.external for program in programs if program.external is not None]
    external = np.concatenate([carried, *stated])
    if is_on_table(model, external):
        raise ConfigurationError(
            "the work frame is on a rotary table whose errors the model has; a function does not "
            "know the angle of the table.",
            hint="--base of a frame beside the table, or a model calibrated without --table.",
        )


def _known_targets(programs: Sequence[Program]) -> list[tuple[Program, BoolArray]]:
    """Returns the programs, and which of their targets (n,) are poses that are moved to."""
    known = []
    for program in programs:
        rows = (program.reason == Reason.NONE) & (program.motion != Motion.UNUSED) & ~program.held
        known.append((program, rows & np.isfinite(program.position).all(axis=1)))
    return known


def _choose(
    named: Mapping[str, Array],
    name: str | None,
    used: Sequence[Array],
    default: Array,
    what: str,
) -> Array:
    """Returns the frame of a name, else that of all known targets, else the default.

    Raises:
        ConfigurationError: No such name, or targets with different ones.
    """
    if name is not None:
        if name not in named:
            raise ConfigurationError(
                f"--{what} {name!r}, the cell has {', '.join(named) or 'none'}.",
                hint=f"[[controller.{what}]] in the cell states it.",
            )
        return named[name]
    every = np.concatenate([np.empty((0, 4, 4)), *used])
    if len(every) and np.ptp(every, axis=0).max() > SAME:
        raise ConfigurationError(
            f"the known targets of the program have more than one {what}.",
            hint=f"--{what} with its number or name in the cell, and --box-mm.",
        )
    return every[0] if len(every) else default


def _read_numbers(option: str, text: str, count: int) -> Array:
    values = parse_number_list(text)
    if values.size != count:
        raise ConfigurationError(f"{option} {text!r}, expected {count} numbers.")
    return values


def _box_and_attitude(
    request: WrapRequest, known: Sequence[tuple[Program, BoolArray]], T_base_frame: Array
) -> tuple[Array, Array]:
    """Returns the box (3, 2) m and A, B, C rad: as stated, else around known targets.

    Raises:
        ConfigurationError: Not stated, and no known target.
    """
    box = attitude = None
    if request.box_mm is not None:
        box = _read_numbers("--box-mm", request.box_mm, 6).reshape(3, 2) * MM
    if request.attitude_deg is not None:
        attitude = _read_numbers("--attitude-deg", request.attitude_deg, 3) * DEG
    if box is not None and attitude is not None:
        return box, attitude
    found = [inverse(T_base_frame) @ target_poses(program)[rows] for program, rows in known]
    poses = np.concatenate([np.empty((0, 4, 4)), *found])
    if not len(poses):
        raise ConfigurationError(
            "the region is not stated, and no program with known targets is given.",
            hint="--box-mm 0,400,0,300,0,200 --attitude-deg 0,90,180",
        )
    if box is None:
        place, margin = poses[:, :3, 3], MARGIN_MM * MM
        box = np.stack([place.min(axis=0) - margin, place.max(axis=0) + margin], axis=1)
    if attitude is None:
        left, _, right = np.linalg.svd(poses[:, :3, :3].sum(axis=0))
        turned = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
        attitude = abc_from_matrix(turned)
    return box, attitude
