"""A machining program as columns of targets, tied to the bytes it came from.

A program of a million targets is a handful of arrays, not a million objects. The source bytes stay
as they are; a dialect stores the place of each number and rewrites only changed ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Annotated, Any, Final, Literal, TypeAlias

import numpy as np

from robotrue.core.arm_words import WORDS, Maker
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.core.explained import Explained
from robotrue.program.external_axes import ExternalAxis
from robotrue.program.line_note import LineNote
from robotrue.program.orientation import OrientationRule

WholeNumbers: TypeAlias = Literal["", "mm", "increment"]
FixedTool: TypeAlias = Literal["", "tool_in_part", "part_in_tool"]
_FARTHEST: Final = 1000.0
"""m; a coordinate beyond is left alone: corrected, it might pass what a language can print."""


class Motion(IntEnum):
    """Motion type of the controller to a target."""

    PTP = 0
    LIN = 1
    ARC_VIA = 2
    ARC_END = 3
    SPLINE = 4
    UNUSED = 5  # a stored point that no motion in the program names


class Reason(Explained):
    """Why a target cannot be compensated, found while reading; 0 means it can."""

    NONE = 0, "its pose cannot be read from the program"
    EXPRESSION = 1, "its target is computed, or used by statements that are not interpreted"
    RELATIVE = 2, "it is relative, or shifted by the program"
    UNKNOWN_FRAME = 3, "its base or tool is not known"
    EXTERNAL_AXIS = 4, "an external axis may carry it"
    JOINT_TARGET = 5, "its axis values are not those of this arm"
    INCOMPLETE = 6, "what it leaves out, or what is in force there, is not known"
    TOOL_ON_FLOOR = 7, "the robot carries the part, or may do so"  # workpiece on the robot
    UNUSED = 8, "no move of the job goes to it"
    OUT_OF_REACH = 9, "it is more than 1 km from the origin of its frame"


def find_open(reason: IntArray) -> BoolArray:
    """Returns the targets (n,) that may be compensated: poses, and axis targets on request."""
    return np.asarray((reason == Reason.NONE) | (reason == Reason.JOINT_TARGET))


@dataclass(frozen=True, slots=True, kw_only=True)
class Program(Columns):
    """n targets in file order and the file that contains them.

    Attributes:
        name: File name.
        dialect: Registered name of the dialect that read it.
        data: The source bytes, untouched.
        position: (n, 3) m, target in its base frame; NaN for axis targets.
        rotation: (n, 3, 3) orientation of the tool in its base frame; NaN for axis targets.
        axes: (n, dof) rad, the controller's axis values of axis targets; NaN otherwise.
        motion: (n,) :class:`Motion`.
        reason: (n,) :class:`Reason`.
        words: (n, w) configuration words as written, columns of :mod:`robotrue.core.arm_words`;
            ``NO_WORD`` where one is absent.
        words_of: Maker of the controller whose words they are.
        line: (n,) one-based line of the target.
        frame: (n,) index into ``T_base_frame``: the work frame the target is written in.
        tool: (n,) index into ``T_flange_tool``.
        T_base_frame: (f, 4, 4) work frames in the robot base.
        T_flange_tool: (t, 4, 4) tools.
        external: (n, 6) m or rad, external axes that the cell describes, where they carry the robot
            or the frame of the target; NaN elsewhere. None: none is described.
        held: (n,) the robot carries the part and the tool is fixed in the cell; nowhere if not
            stated. Such a target states the pose of the *part*: ``frame`` is the tool in the cell,
            ``tool`` the part frame on the flange, and position and rotation are the part frame in
            that tool, which is the inverse of what is printed.
        start: (dof,) rad, the controller's axis values before the first target, where another file
            of the job states them; empty if not known.
        notes: Notes of the reader for the user, one sentence each, with line numbers.
        noted: Those of them on lines of targets, in a language that is read with a splice.
        spans: Dialect's own table of byte positions; opaque to everyone else.
        path: (k, 3) the moves in the order of the text: a place that grows from move to move (in
            the files of one KRL job the same), the row moved to, or the line of a target that is
            no row, negative, and the :class:`Motion`. Empty: the rows are moved to in file order.
    """

    name: str
    dialect: str
    data: bytes
    position: Annotated[Array, Column("n 3", unit="m", nan=True)]
    rotation: Annotated[Array, Column("n 3 3", nan=True)]
    axes: Annotated[Array, Column("n dof", unit="rad", nan=True)]
    motion: Annotated[IntArray, Column("n")]
    reason: Annotated[IntArray, Column("n")]
    words: Annotated[IntArray, Column("n w")]
    words_of: Maker
    line: Annotated[IntArray, Column("n")]
    frame: Annotated[IntArray, Column("n")]
    tool: Annotated[IntArray, Column("n")]
    T_base_frame: Annotated[Array, Column("f 4 4", unit="m", nan=True)]
    T_flange_tool: Annotated[Array, Column("t 4 4", unit="m", nan=True)]
    external: Annotated[Array | None, Column("n 6", unit="m, rad", nan=True)] = None
    held: Annotated[BoolArray, Column("n", fill=False)] = EMPTY
    start: Annotated[Array, Column("_", unit="rad")] = EMPTY
    notes: tuple[str, ...] = ()
    noted: tuple[LineNote, ...] = ()
    spans: Any = None
    path: Annotated[IntArray, Column("_ 3")] = EMPTY

    def __post_init__(self) -> None:
        """Checks shapes and values."""
        self._check_columns(w=WORDS[self.words_of])

    def __len__(self) -> int:
        return len(self.position)


def leave_far(program: Program) -> Program:
    """Returns the program with poses, and arcs, beyond the reach of every arm left alone."""
    far = np.asarray((np.abs(program.position) > _FARTHEST).any(axis=1))
    if not far.any():
        return program
    via = np.flatnonzero(program.motion[:-1] == Motion.ARC_VIA)
    far[via] |= far[via + 1]
    far[via + 1] |= far[via]
    reason = np.where(far & (program.reason == Reason.NONE), Reason.OUT_OF_REACH, program.reason)
    return replace(program, reason=reason)


@dataclass(frozen=True, slots=True, kw_only=True)
class Replacement(Columns):
    """New values for the targets of a program; rows that are not ``changed`` keep their bytes.

    Attributes:
        changed: (n,) rows to rewrite.
        position: (n, 3) m, in the target's own base frame.
        rotation: (n, 3, 3).
        axes: (n, dof) rad, controller's axes, for axis targets.
        words: (n, w) new configuration words; ``NO_WORD`` keeps what is written.
    """

    changed: Annotated[BoolArray, Column("n")]
    position: Annotated[Array, Column("n 3", unit="m", nan=True, inf=True)]
    rotation: Annotated[Array, Column("n 3 3", nan=True, inf=True)]
    axes: Annotated[Array, Column("n dof", unit="rad", nan=True, inf=True)]
    words: Annotated[IntArray, Column("n w")]

    def __len__(self) -> int:
        return len(self.changed)


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameTable:
    """Frames a program names but does not hold ($config.dat, wobj tables), and the defaults.

    Attributes:
        T_base_frame: Default work frame (4, 4) when the program sets none.
        T_flange_tool: Default tool (4, 4) when the program sets none.
        T_base_world: World frame of the controller (4, 4) in the robot base: KUKA's bases are
            written in it ($ROBROOT is the robot's pose).
        declarations: Name and bytes of data files of the controller that are read for names alone
            (KUKA's ``$config.dat``).
        bases: Work frames by the controller's number or name.
        tools: Tools by the controller's number or name.
        external: Axes that carry the robot or work frames, in the order from the floor up.
        external_axes_at_rest: The external axes that are not described, or without a value in the
            program, are at rest in the whole program, and every frame here is stated for their
            position; only then are targets with such an axis away from zero compensated.
        fixed_tool: Meaning of a KUKA target while the robot carries the part (``#TCP``): the tool
            ``tool_in_part`` or the ``part_in_tool``. Empty: not stated, and such targets are not
            compensated.
        pulses_per_degree: (6,) drive pulses per degree of axes 1 to 6 (Yaskawa ALL.PRM), signed;
            without them axis targets written in pulses are not compensated.
        orientation: Convention of angles and tool axes of G-code, APT and CSV for the tool frame.
        start: (6,) rad, the controller's axis values where a program starts, which determine the
            arm's configuration at a first target that does not state it; empty if not stated.
        harmless_routines: Routines in no given file that change neither frames nor points, in lower
            case; after calls of others, targets are left alone.
        changed_frames: What changes numbered frames in any program of a job, by side (``base``,
            ``tool``) and number, ``?`` for a computed one: the controller has them once for all.
        units_without_point: Meaning of ``X10`` without a point in a Fanuc control: ``mm``, the unit
            in force, or an ``increment``. Only where it is the unit in force such points are
            compensated; empty: not stated.
    """

    T_base_frame: Array = field(default_factory=lambda: np.eye(4))
    T_flange_tool: Array = field(default_factory=lambda: np.eye(4))
    T_base_world: Array = field(default_factory=lambda: np.eye(4))
    declarations: tuple[tuple[str, bytes], ...] = ()
    bases: Mapping[str, Array] = field(default_factory=dict)
    tools: Mapping[str, Array] = field(default_factory=dict)
    external: tuple[ExternalAxis, ...] = ()
    external_axes_at_rest: bool = False
    fixed_tool: FixedTool = ""
    pulses_per_degree: Array | None = None
    orientation: OrientationRule = field(default_factory=OrientationRule)
    start: Array = field(default_factory=lambda: np.empty(0))
    harmless_routines: tuple[str, ...] = ()
    changed_frames: Mapping[tuple[str, str], str] = field(default_factory=dict)
    units_without_point: WholeNumbers = ""
