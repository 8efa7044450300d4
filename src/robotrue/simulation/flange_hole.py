"""The job of Deng et al. 2022, section 3: a 210 mm flange hole in a 30 mm plate, cuts and KRL.

One slot and one side pass for each millimetre of depth, counter-clockwise (climb milling). Slots
are short lines, as a CAM system makes them; side passes are eight arcs. Size, depth, tool and cuts
are the paper's (Table 10); place of the plate, allowance and number of points are **assumed**.

Forces follow the linear mechanistic model, averaged over a spindle turn
(:mod:`robotrue.dynamics.milling_force`), edge terms left out. The pressures are **assumed**, of the
size printed for wrought aluminium; the paper prints cutting data but no force.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import inverse, pose
from robotrue.core.rotations import abc_from_matrix, matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.dynamics import cutter as cutters
from robotrue.dynamics import milling_force as milling
from robotrue.errors import ConfigurationError
from robotrue.program.program import Motion, Program
from robotrue.robot.configuration import controller_axes
from robotrue.robot.inverse import inverse as inverse_joints
from robotrue.robot.model import RobotModel
from robotrue.simulation.plans import POSTURE

ALUMINIUM: Final = cutters.CuttingCoefficients(tangential=800e6, radial=240e6, axial=80e6)
"""Pa, assumed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EndMillPass:
    """One kind of pass with an end mill that turns clockwise, seen from the spindle.

    Attributes:
        spindle: rev/s.
        teeth: Number of teeth.
        feed_per_tooth: m.
        depth: m, along the tool.
        width: m, radial.
        diameter: m, of the tool.
    """

    spindle: float
    teeth: int
    feed_per_tooth: float
    depth: float
    width: float
    diameter: float

    def __post_init__(self) -> None:
        """Checks the width of cut."""
        if not 0.0 < self.width <= self.diameter:
            raise ConfigurationError(
                f"width of cut {self.width / MM:g} mm, expected more than 0 and at most the "
                f"tool diameter {self.diameter / MM:g} mm."
            )

    @property
    def feed(self) -> float:
        """Feed rate, m/s."""
        return self.spindle * self.teeth * self.feed_per_tooth


SLOT: Final = EndMillPass(
    spindle=3000 / 60,
    teeth=3,
    feed_per_tooth=0.1 * MM,
    depth=1 * MM,
    width=10 * MM,
    diameter=10 * MM,
)
"""Slotting of Deng et al. 2022, Table 10."""
SIDE: Final = EndMillPass(
    spindle=6000 / 60,
    teeth=3,
    feed_per_tooth=0.05 * MM,
    depth=1 * MM,
    width=1 * MM,
    diameter=10 * MM,
)
"""Side milling of Deng et al. 2022, Table 10."""


def mean_force(cut: EndMillPass) -> Array:
    """Returns the mean force on the tool (3,) N: along the feed, to its left, along the tool up.

    Material is to the right of the feed (climb milling) where the cut is narrower than the tool.
    """
    tool = cutters.EndMill(kind="flat", diameter=cut.diameter, teeth=cut.teeth)
    climb = cutters.CutterEngagement(
        mode="down",
        depth=cut.depth,
        width=cut.width,
        feed_per_tooth=cut.feed_per_tooth,
        spindle=cut.spindle,
    )
    return milling.mean_force(tool, climb, ALUMINIUM)


def cutting_wrench(cut: EndMillPass, feed_direction: Array, tool_axis: Array) -> Array:
    """Returns the wrench on the tool (n, 6) N, N m at its tip, in the axes of the arguments.

    Args:
        cut: The pass.
        feed_direction: (n, 3) unit vectors.
        tool_axis: (n, 3) unit vectors from the tip into the spindle.
    """
    left = np.cross(tool_axis, feed_direction)
    force = mean_force(cut)
    wrench = np.zeros((len(feed_direction), 6))
    wrench[:, :3] = force[0] * feed_direction + force[1] * left + force[2] * tool_axis
    return wrench


CHECKS: Final = 39
"""Check targets on one slot, as in Table 9."""
_LINES: Final = 4 * CHECKS  # of one slot: 4 mm each, 20 um from the circle
_ARCS: Final = 8
_CLEARANCE: Final = 20.0 * MM


@dataclass(frozen=True, slots=True, kw_only=True)
class FlangeHole(Columns):
    """Position and cutting parameters of the hole.

    Attributes:
        T_base_part: (4, 4) the program's ``$BASE``; part x, y span the top face, z points up.
        centre: (2,) m on the top face.
        diameter: m.
        depth: m, a whole number of cuts.
        allowance: m, radial stock the slots leave for the side passes.
        slot: Data of the slots.
        side: Data of the side passes.
    """

    T_base_part: Annotated[Array, Column("4 4")] = field(
        default_factory=lambda: pose(
            matrix_from_abc(np.array([8.0, 0.0, 0.0]) * DEG), np.array([0.92, -0.12, 0.70])
        )
    )
    centre: Annotated[Array, Column("2", unit="m")] = field(
        default_factory=lambda: np.array([0.15, 0.15])
    )
    diameter: float = 210.0 * MM
    depth: float = 30.0 * MM
    allowance: float = 1.0 * MM
    slot: EndMillPass = SLOT
    side: EndMillPass = SIDE

    def _check_rules(self) -> None:
        """The tool has to fit the hole."""
        if self.side.diameter + 2.0 * self.allowance >= self.diameter:
            raise ConfigurationError(
                f"a {self.side.diameter / MM:g} mm tool with {self.allowance / MM:g} mm allowance "
                f"does not fit a hole of {self.diameter / MM:g} mm."
            )

    @property
    def levels(self) -> int:
        """Number of depths."""
        return max(round(self.depth / self.slot.depth), 1)

    @property
    def side_radius(self) -> float:
        """Radius of the tool centre on side passes, m."""
        return 0.5 * (self.diameter - self.side.diameter)

    @property
    def slot_radius(self) -> float:
        """Radius of the tool centre in slots, m."""
        return self.side_radius - self.allowance


def hole_program(hole: FlangeHole, robot: RobotModel) -> bytes:
    """Returns the KRL program (.src) of the hole.

    Args:
        hole: The job.
        robot: The nominal arm with the end mill as its tool.

    Raises:
        ReachError: The arm cannot reach the hole.
    """
    axes = controller_axes(robot, _approach(hole, robot)) / DEG
    lines = [
        "&ACCESS RVP",
        "&REL 1",
        "DEF FLANGE_HOLE ( )",
        f"; flange hole {hole.diameter / MM:.1f} mm, end mill {hole.side.diameter / MM:.1f} mm",
        "BAS (#INITMOV,0 )",
        f"$BASE = {{FRAME: {_frame(hole.T_base_part)}}}",
        f"$TOOL = {{FRAME: {_frame(robot.T_flange_tool)}}}",
        "$APO.CDIS = 0.5",
        "PTP {AXIS: " + ",".join(f"A{i + 1} {a:.5f}" for i, a in enumerate(axes)) + "}",
    ]
    attitude = ",".join(
        f"{letter} {angle:.4f}" for letter, angle in zip("ABC", _tool_abc(hole) / DEG, strict=True)
    )
    for level in range(1, hole.levels + 1):
        z = -level * hole.slot.depth
        lines += _slot_lines(hole, z, attitude, level)
        lines += _side_lines(hole, z, attitude, level)
    lines += [_lin(hole, 0.0, hole.slot_radius, _CLEARANCE, attitude, ""), "END", ""]
    return "\r\n".join(lines).encode("ascii")


def slot_rows(program: Program, hole: FlangeHole, level: int) -> BoolArray:
    """Returns (n,) True for the slot targets of a level (1 .. levels), found by their place."""
    rows: BoolArray = _rows(program, hole, hole.slot_radius, level)
    out: BoolArray = np.logical_and(rows, program.motion == Motion.LIN)
    return out


def side_rows(program: Program, hole: FlangeHole, level: int) -> BoolArray:
    """Returns (n,) True for the arc targets of a level's side pass, via points included."""
    arc = (program.motion == Motion.ARC_VIA) | (program.motion == Motion.ARC_END)
    rows: BoolArray = _rows(program, hole, hole.side_radius, level)
    out: BoolArray = np.logical_and(rows, arc)
    return out


def check_rows(program: Program, hole: FlangeHole, level: int) -> IntArray:
    """Returns the 39 equally spaced targets of a level's slot: indices (39,) into the program.

    Raises:
        ConfigurationError: The program has not the slot this hole would have.
    """
    found = np.flatnonzero(slot_rows(program, hole, level))
    if len(found) != _LINES + 1:  # the plunge ends on the first of them
        raise ConfigurationError(
            f"level {level} of {program.name} has {len(found)} slot targets, "
            f"expected {_LINES + 1}.",
            hint="use the program hole_program wrote for this hole, before compensation.",
        )
    return np.asarray(found[: CHECKS * 4 : 4], dtype=np.int64)


def _rows(program: Program, hole: FlangeHole, radius: float, level: int) -> BoolArray:
    flat = program.position[:, :2] - hole.centre
    depth = np.abs(program.position[:, 2] + level * hole.slot.depth)
    near = np.abs(np.linalg.norm(flat, axis=1) - radius) < 0.1 * hole.allowance
    rows: BoolArray = near & (depth < 0.1 * hole.slot.depth)
    return rows


def _slot_lines(hole: FlangeHole, z: float, attitude: str, level: int) -> list[str]:
    radius = hole.slot_radius
    head = [
        f"; level {level}: slot",
        f"$VEL.CP = {hole.slot.feed:.5f}",
        _lin(hole, 0.0, radius, z + _CLEARANCE, attitude, "C_DIS"),
        _lin(hole, 0.0, radius, z, attitude, ""),
    ]
    turn = 2.0 * np.pi * np.arange(1, _LINES + 1) / _LINES
    return head + [_lin(hole, t, radius, z, attitude, "C_DIS") for t in turn]


def _side_lines(hole: FlangeHole, z: float, attitude: str, level: int) -> list[str]:
    radius = hole.side_radius
    out = [
        f"; level {level}: side",
        f"$VEL.CP = {hole.side.feed:.5f}",
        _lin(hole, 0.0, radius, z, attitude, "C_DIS"),
    ]
    for k in range(_ARCS):
        via, end = (2.0 * np.pi * (k + part) / _ARCS for part in (0.5, 1.0))
        points = [_target(hole, t, radius, z, attitude) for t in (via, end)]
        out.append(f"CIRC {points[0]},{points[1]} C_DIS")
    return out


def _lin(
    hole: FlangeHole, turn: float, radius: float, z: float, attitude: str, approach: str
) -> str:
    return f"LIN {_target(hole, turn, radius, z, attitude)} {approach}".rstrip()


def _target(hole: FlangeHole, turn: float, radius: float, z: float, attitude: str) -> str:
    x, y = hole.centre + radius * np.array([np.cos(turn), np.sin(turn)])
    return f"{{X {x / MM:.4f},Y {y / MM:.4f},Z {z / MM:.4f},{attitude}}}"


def _frame(transform: Array) -> str:
    x, y, z = transform[:3, 3] / MM
    a, b, c = abc_from_matrix(transform[:3, :3]) / DEG
    return f"X {x:.4f},Y {y:.4f},Z {z:.4f},A {a:.4f},B {b:.4f},C {c:.4f}"


def _tool_abc(hole: FlangeHole) -> Array:
    """Attitude of the tool in the part: straight down, tool x towards the robot."""
    centre = hole.T_base_part @ np.array([*hole.centre, 0.0, 1.0])
    heading = np.arctan2(centre[1], centre[0])
    R_base_tool = matrix_from_abc(np.array([heading, np.pi, 0.0]))
    return abc_from_matrix(hole.T_base_part[:3, :3].T @ R_base_tool)


def _approach(hole: FlangeHole, robot: RobotModel) -> Array:
    """Model joints (6,) rad over the start of the first slot."""
    start = np.array([hole.centre[0] + hole.slot_radius, hole.centre[1], 5.0 * _CLEARANCE])
    T_part_tool = pose(matrix_from_abc(_tool_abc(hole)), start)
    return inverse_joints(robot, hole.T_base_part @ T_part_tool, near=POSTURE)


def to_part(hole: FlangeHole, points: Array) -> Array:
    """Returns points (n, 3) m in part coordinates from points in base."""
    T_part_base = inverse(hole.T_base_part)
    out: Array = points @ T_part_base[:3, :3].T + T_part_base[:3, 3]
    return out
