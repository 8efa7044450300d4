"""Cells in model files of the first schema: values, where today there is the text of the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.core.document_decoder import decode
from robotrue.measurement.measurement_set import MeasurementFrame
from robotrue.measurement.tracker import TrackerSpecification
from robotrue.program.external_axes import ExternalAxis
from robotrue.program.orientation import Angles, OrientationRule
from robotrue.program.program import FixedTool, FrameTable
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load

Rows = list[list[float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class _AxisDocument:
    """An :class:`ExternalAxis`."""

    number: int
    name: str
    direction: list[float]
    point: list[float] | None
    at: float
    carries_robot: bool
    frames: tuple[str, ...]
    per_pulse: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class _OrientationDocument:
    """An :class:`OrientationRule`."""

    angles: Angles
    cutter: list[float]
    spin: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class _ControllerDocument:
    """A :class:`FrameTable`."""

    bases: dict[str, Rows]
    tools: dict[str, Rows]
    external: tuple[_AxisDocument, ...]
    external_axes_at_rest: bool
    fixed_tool: FixedTool
    orientation: _OrientationDocument
    pulses_per_degree: list[float] | None
    harmless_routines: tuple[str, ...] = ()
    start: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class _CellDocument:
    """A :class:`Cell`; SI."""

    T_flange_tool: Rows
    T_flange_target: Rows
    target_sigma: float
    T_base_frame: Rows
    frame: MeasurementFrame
    tracker_position: list[float] | None
    tracker: TrackerSpecification
    repeatability: float
    payload_mass: float
    payload_com: list[float]
    compliance_prior: list[float | None]
    source: str
    digest: str
    controller: dict[str, object]


def cell_of_schema_1(stated: Mapping[str, object], robot: RobotModel) -> Cell:
    """Returns the cell of a document of schema 1 and of the nominal robot of its model.

    Raises:
        ArchiveError: An entry is missing or of another type; others raise what NumPy and
            :class:`Cell` do.
    """
    document = decode(_CellDocument, {"controller": {}, **stated}, key="cell")
    position, payload = document.tracker_position, document.payload_com
    return Cell(
        robot=robot.nominal().with_tool(np.array(document.T_flange_tool)),
        T_flange_target=np.array(document.T_flange_target),
        target_sigma=document.target_sigma,
        T_base_frame=np.array(document.T_base_frame),
        frame=document.frame,
        tracker_position=None if position is None else np.array(position),
        tracker=document.tracker,
        repeatability=document.repeatability,
        payload=Load(mass=np.array([document.payload_mass]), com=np.array(payload)[None]),
        compliance_prior=np.array([np.nan if c is None else c for c in document.compliance_prior]),
        controller=_read_controller(document.controller),
        source=document.source,
        digest=document.digest,
    )


def _read_controller(stated: Mapping[str, object]) -> FrameTable:
    if not stated:
        return FrameTable()
    document = decode(_ControllerDocument, stated, key="cell.controller")
    pulses, orientation = document.pulses_per_degree, document.orientation
    return FrameTable(
        bases={key: np.array(matrix) for key, matrix in document.bases.items()},
        tools={key: np.array(matrix) for key, matrix in document.tools.items()},
        external=tuple(map(_read_axis, document.external)),
        external_axes_at_rest=document.external_axes_at_rest,
        fixed_tool=document.fixed_tool,
        harmless_routines=document.harmless_routines,
        orientation=OrientationRule(
            angles=orientation.angles,
            cutter=np.array(orientation.cutter),
            spin=orientation.spin,
        ),
        pulses_per_degree=None if pulses is None else np.array(pulses),
        start=np.array(document.start),
    )


def _read_axis(axis: _AxisDocument) -> ExternalAxis:
    return ExternalAxis(
        number=axis.number,
        name=axis.name,
        direction=np.array(axis.direction),
        point=None if axis.point is None else np.array(axis.point),
        at=axis.at,
        carries_robot=axis.carries_robot,
        frames=axis.frames,
        per_pulse=np.nan if axis.per_pulse is None else axis.per_pulse,
    )
