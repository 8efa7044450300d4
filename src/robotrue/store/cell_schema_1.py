"""Cells in model files written before these held the bytes of cell.toml: JSON values, SI."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.measurement.tracker import TrackerSpecification
from robotrue.program.external_axes import ExternalAxis
from robotrue.program.orientation import OrientationRule
from robotrue.program.program import FrameTable
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load


def cell_from_schema_1(stated: Mapping[str, Any], robot: RobotModel) -> Cell:
    """Returns the cell of a document of schema 1 and of the nominal robot of its model.

    Raises:
        LookupError: An entry is missing; other entries raise what NumPy and :class:`Cell` do.
    """
    position = stated["tracker_position"]
    compliance = [np.nan if c is None else c for c in stated["compliance_prior"]]
    return Cell(
        robot=robot.nominal().with_tool(np.array(stated["T_flange_tool"])),
        T_flange_target=np.array(stated["T_flange_target"]),
        target_sigma=float(stated["target_sigma"]),
        T_base_frame=np.array(stated["T_base_frame"]),
        frame=stated["frame"],
        tracker_position=None if position is None else np.array(position),
        tracker=TrackerSpecification(**stated["tracker"]),
        repeatability=stated["repeatability"],
        payload=Load(
            mass=np.array([float(stated["payload_mass"])]),
            com=np.array(stated["payload_com"])[None],
        ),
        compliance_prior=np.array(compliance),
        controller=_read_controller(stated.get("controller", {})),
        source=stated["source"],
        digest=stated["digest"],
    )


def _read_controller(stated: Mapping[str, Any]) -> FrameTable:
    if not stated:
        return FrameTable()
    pulses = stated["pulses_per_degree"]
    return FrameTable(
        bases={key: np.array(matrix) for key, matrix in stated["bases"].items()},
        tools={key: np.array(matrix) for key, matrix in stated["tools"].items()},
        external=tuple(_read_axis(axis) for axis in stated["external"]),
        external_axes_at_rest=bool(stated["external_axes_at_rest"]),
        fixed_tool=stated["fixed_tool"],
        harmless_routines=tuple(stated.get("harmless_routines", ())),
        orientation=OrientationRule(
            angles=stated["orientation"]["angles"],
            cutter=np.array(stated["orientation"]["cutter"]),
            spin=stated["orientation"]["spin"],
        ),
        pulses_per_degree=None if pulses is None else np.array(pulses),
        start=np.array(stated.get("start", [])),
    )


def _read_axis(stated: Mapping[str, Any]) -> ExternalAxis:
    point, per_pulse = stated["point"], stated["per_pulse"]
    return ExternalAxis(
        number=int(stated["number"]),
        name=stated["name"],
        direction=np.array(stated["direction"]),
        point=None if point is None else np.array(point),
        at=float(stated["at"]),
        carries_robot=bool(stated["carries_robot"]),
        frames=tuple(stated["frames"]),
        per_pulse=np.nan if per_pulse is None else float(per_pulse),
    )
