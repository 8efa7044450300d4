"""The cell as a value: which robot, what it carries, what measures it.

Beside a model, what a cell states holds; what it leaves out is as when the model was calibrated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Final

import numpy as np

from robotrue.cell.obstacles import Obstacle
from robotrue.cell.part import PartTable
from robotrue.core.arrays import Array
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError, ModelMismatchError, ShapeError
from robotrue.measurement.measurement_set import MeasurementFrame
from robotrue.measurement.tracker import (
    DEFAULT_SPECIFICATION,
    TrackerSpecification,
    point_covariance,
)
from robotrue.program.external_axes import ExternalAxis
from robotrue.program.program import FrameTable
from robotrue.robot.model import RobotModel, nominal_identity
from robotrue.robot.statics import NO_LOAD, Load

DEFAULT_TARGET_SIGMA: Final = 1e-2
"""m, per axis: a reflector set down by eye."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell(Columns):
    """A robot and its surroundings, SI. Everything but the robot has a default.

    Attributes:
        robot: The nominal arm; its ``T_flange_tool`` is the tool programs use. Default tool: the
            flange itself.
        T_flange_target: (4, 4) the measured reflector. Default: the tool point.
        target_sigma: m, one standard deviation per axis of its position. What the reflector's place
            may explain is not charged to the arm and does not carry over to another tool. Default:
            10 mm.
        frame: Frame of measured positions: ``base``, or ``tracker`` where its place is not known.
            Default: ``base``.
        tracker_position: (3,) m, the instrument in that frame; None is "not known". Default: the
            origin for ``tracker``, not known for ``base``.
        tracker_place: (3,) m, rough position of the instrument, in the robot base; used by planning
            only. Default: ``tracker_position`` where that is in base, else not known.
        tracker: Bounds of the instrument. Default: 15 um + 5 um/m, read as two sigma.
        target_axis: (3,) unit vector in the flange frame, the way the reflector looks; used by
            planning only. Default: not known.
        acceptance: rad, largest angle between it and the line to the instrument. Default: any.
        link_radius: (dof,) m, radius of the tube around each link; used by planning only. Default:
            not known, planning takes a share of the reach.
        obstacles: What the arm must not touch and the instrument cannot see through; used by
            planning only. Default: nothing.
        repeatability: m, ISO 9283 RP of the arm as its data sheet prints it (mean plus three
            standard deviations of the distance from the middle; 3.6158 times the standard
            deviation per axis). Default: 0.06 mm.
        payload: Payload on the flange, one row, no wrench. Default: nothing.
        T_base_frame: (4, 4) work frame of programs that set none. Default: the robot base; in a
            registered cell with one part frame, that frame.
        part: Where touching found the part, and the model it was touched with. Default: not
            registered.
        compliance_prior: (dof,) rad/(N m), one over the stated joint stiffness; NaN where nothing
            is stated. Default: NaN.
        controller: Frames, tools, external axes and pulses that programs name and the controller
            holds; its defaults do not apply here. Default: none.
        tables: Names of the tables its file states; empty if made in code.
        source: File it was read from; empty if made in code.
        digest: SHA-256 of that file.
        text: Content of that file.
        files: Content of the files it names (URDF, frames), by the names it gives them.
    """

    robot: RobotModel
    T_flange_target: Annotated[Array, Column("4 4", unit="m")] = EMPTY
    target_sigma: float = DEFAULT_TARGET_SIGMA
    frame: MeasurementFrame = "base"
    tracker_position: Annotated[Array | None, Column("3", unit="m")] = None
    tracker_place: Annotated[Array | None, Column("3", unit="m")] = None
    tracker: TrackerSpecification = DEFAULT_SPECIFICATION
    target_axis: Annotated[Array | None, Column("3")] = None
    acceptance: float = np.pi
    link_radius: Annotated[Array | None, Column("dof", unit="m")] = None
    obstacles: tuple[Obstacle, ...] = ()
    repeatability: float = 6e-5
    payload: Load = NO_LOAD
    T_base_frame: Annotated[Array, Column("4 4", unit="m", fill=np.eye)] = EMPTY
    compliance_prior: Annotated[Array, Column("dof", unit="rad/(N m)", nan=True, fill=np.nan)] = (
        EMPTY
    )
    part: PartTable | None = None
    controller: FrameTable = field(default_factory=FrameTable)
    tables: frozenset[str] = frozenset()
    source: str = ""
    digest: str = ""
    text: str = ""
    files: Mapping[str, bytes] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Fills the defaults that depend on other fields, then checks shapes and values.

        Raises:
            ShapeError: A column of another shape, a direction of length zero, or a repeatability
                below zero.
        """
        if np.size(self.T_flange_target) == 0:
            object.__setattr__(self, "T_flange_target", self.robot.T_flange_tool)
        if self.tracker_position is None and self.frame == "tracker":
            object.__setattr__(self, "tracker_position", np.zeros(3))
        if self.tracker_place is None and self.frame == "base":
            object.__setattr__(self, "tracker_place", self.tracker_position)
        self._check_columns(dof=self.robot.dof)
        if self.target_axis is not None:
            length = float(np.linalg.norm(self.target_axis))
            if not length > 0.0:
                raise ShapeError("target_axis is zero, expected a direction in the flange frame.")
            self._set_column("target_axis", self.target_axis / length)
        if not 0.0 <= self.repeatability < np.inf:
            raise ShapeError(f"repeatability is {self.repeatability} m, expected 0 or more.")

    @property
    def says_of_controller(self) -> bool:
        """True if any frame or tool number that programs use is defined."""
        told = self.controller
        return bool(
            told.bases or told.tools or told.external or told.external_axes_at_rest
            or told.fixed_tool or told.pulses_per_degree is not None or told.orientation.stated
            or len(told.start)
            or told.harmless_routines or told.units_without_point
        )  # fmt: skip

    @property
    def measured_robot(self) -> RobotModel:
        """The nominal arm with the reflector as its tool: the point measurements are about."""
        return self.robot.with_tool(self.T_flange_target)


def tracker_covariance(cell: Cell, position: Array) -> Array:
    """Returns the instrument's covariance (n, 3, 3) m^2 at positions (n, 3) m in ``cell.frame``."""
    return point_covariance(cell.tracker, position, cell.tracker_position)


def frame_table(cell: Cell) -> FrameTable:
    """Returns the frames a program falls back on, and those it names."""
    named = () if cell.part is None else cell.part.frames
    return replace(
        cell.controller,
        external=tuple(_carrying(axis, cell) for axis in cell.controller.external),
        T_base_frame=cell.T_base_frame,
        T_flange_tool=cell.robot.T_flange_tool,
        bases={**cell.controller.bases, **{frame.name: frame.T_base_part for frame in named}},
    )


def _carrying(axis: ExternalAxis, cell: Cell) -> ExternalAxis:
    """The axis, with the default work frame on it where that is a part frame it carries."""
    carried = {name.lower() for name in axis.frames}
    parts = () if cell.part is None else cell.part.frames
    mine = [part.T_base_part for part in parts if part.name.lower() in carried]
    if any(np.array_equal(T, cell.T_base_frame) for T in mine):
        return replace(axis, frames=(*axis.frames, "base"))
    return axis


CUTTERS: Final = {
    f"{sign}{axis}": value * np.eye(3)[k]
    for sign, value in (("", 1.0), ("+", 1.0), ("-", -1.0))
    for k, axis in enumerate("xyz")
}
ASIDE: Final = 60.0 * DEG
"""A cutter axis further than this off the way from flange to tip must be stated."""


def cutter_axis(cell: Cell, text: str | None) -> Array:
    """Returns the way from spindle to tip (3,) in the tool frame.

    Args:
        cell: Its tool.
        text: As stated on the command line; None takes +z where that is plausible.

    Raises:
        ConfigurationError: No axis, or none stated where it is not plain which it is.
    """
    if text is not None:
        if text.lower() not in CUTTERS:
            raise ConfigurationError(
                f"--cutter {text!r}, expected x, y, z, -x, -y or -z.", hint="--cutter z"
            )
        return np.asarray(CUTTERS[text.lower()])
    tip = cell.robot.T_flange_tool[:3, 3]
    length = float(np.linalg.norm(tip))
    axis = CUTTERS["z"]
    along = float(cell.robot.T_flange_tool[:3, :3] @ axis @ tip) / max(length, 1e-9)
    if length > 1e-3 and along < np.cos(ASIDE):
        raise ConfigurationError(
            "the z axis of [tool] points "
            f"{np.degrees(np.arccos(np.clip(along, -1.0, 1.0))):.0f} deg away from the way from "
            f"the flange to the tip (at most {ASIDE / DEG:.0f} deg are taken without asking): "
            "which axis of the tool frame is the cutter's is not plain.",
            source=cell.source or None,
            hint="--cutter x (KUKA's own convention), or --cutter z to confirm z.",
        )
    return np.asarray(axis)


_SAME = 1e-6  # rad by which joint limits may differ: they are printed


def overlay_cell(cell: Cell, place: Cell) -> Cell:
    """Returns the cell of a model with what another cell states: frames, tool, payload, controller.

    Args:
        cell: Of the day of calibration.
        place: As it is now. Its ``[base]``, ``[tool]``, ``[payload]``, ``[controller]`` and part
            frames hold where it has them.

    Raises:
        ConfigurationError: It has none of them, or other joint limits than the model.
        ModelMismatchError: Its arm is another one, or counts its axes in another way.
    """
    _require_same_arm(cell.robot, place)
    overlaid = cell
    if place.part is not None:
        overlaid = replace(overlaid, part=place.part, T_base_frame=place.T_base_frame)
    elif "base" in place.tables:
        overlaid = replace(overlaid, T_base_frame=place.T_base_frame)
    if "tool" in place.tables:
        overlaid = replace(overlaid, robot=cell.robot.with_tool(place.robot.T_flange_tool))
    if "payload" in place.tables:
        overlaid = replace(overlaid, payload=place.payload)
    if place.says_of_controller:
        overlaid = replace(overlaid, controller=place.controller)
    if overlaid is cell:
        raise ConfigurationError(
            "the cell states nothing that is used with a model: no [base], [tool], [payload] or "
            "[controller], and no part frame.",
            source=place.source or None,
            hint="write what holds now into it, or leave --cell out.",
        )
    return overlaid


def _require_same_arm(robot: RobotModel, place: Cell) -> None:
    other, source = place.robot, place.source or None
    if not nominal_identity(other).same(nominal_identity(robot)):
        raise ModelMismatchError(
            f"the cell describes {other.name}, whose geometry is not that of the model's "
            f"{robot.name}.",
            source=source,
            hint="the [robot] table of the cell the model was calibrated with.",
        )
    if other.maker != robot.maker or not _counts_alike(robot, other):
        raise ModelMismatchError(
            f"[robot] of the cell is of maker {other.maker!r}, that of the model of maker "
            f"{robot.maker!r}, or they count their axes in different ways; the model's would hold.",
            source=source,
            hint="calibrate again with this cell, or take maker and axes_... out of it.",
        )
    if np.abs(other.limits - robot.limits).max() > _SAME:
        raise ConfigurationError(
            "[robot] limits_deg of the cell are not those of the model, which would hold.",
            source=source,
            hint="calibrate again with this cell, or write the model's limits.",
        )


def _counts_alike(one: RobotModel, other: RobotModel) -> bool:
    names = ("sign", "offset", "coupling")
    pairs = [(getattr(one.controller, n), getattr(other.controller, n)) for n in names]
    return all(a.shape == b.shape and np.allclose(a, b, atol=_SAME) for a, b in pairs)
