"""Long KRL files in blocks: one pass over a ``.src`` or ``.dat``, and its pieces."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from robotrue.core.arrays import BoolArray
from robotrue.program.formats import dialect
from robotrue.program.formats.krl_build import Builder
from robotrue.program.formats.krl_frames import Frames
from robotrue.program.formats.krl_motion_survey import MotionSurvey, with_clauses
from robotrue.program.formats.krl_point_survey import PointSurvey, as_motions
from robotrue.program.formats.krl_scan import scan
from robotrue.program.formats.krl_walk import Walk
from robotrue.program.formats.long_survey import WINDOW
from robotrue.program.program import FrameTable, Program, Reason, Replacement
from robotrue.program.stream import Judged, Piece, Surveyed, Whole


def survey(path: Path, frames: FrameTable, targets: int) -> Surveyed | Whole:
    """Returns what one pass over a file finds, or why it must be read whole.

    Raises:
        FormatError: The file is not KRL, cut off, or has a number that cannot be read.
    """
    if frames.external:
        return Whole(why="external axes in the kinematic chain need every target at once")
    if frames.fixed_tool:
        return Whole(why="a part on the robot is read whole")
    points = path.suffix.lower() == ".dat"
    found: PointSurvey | MotionSurvey
    found = PointSurvey(path.name, targets) if points else MotionSurvey(path.name, targets)
    refused = found.run(path, WINDOW) or found.external_at_rest(frames.external_axes_at_rest)
    return found if refused is None else refused


def read_piece(data: bytes, piece: Piece, judged: Judged) -> Program:
    """Returns the targets of a piece, as they stand in the program of the whole file.

    Statements are not read again: the outline says what they bring about.
    """
    given = FrameTable(external_axes_at_rest=judged.external_axes_at_rest)
    lines = scan(data, name=judged.name)
    lines = as_motions(lines) if judged.name.lower().endswith(".dat") else with_clauses(lines)
    walk = Walk([lines], [judged.name], Frames(given, judged.name))
    found = Builder(walk, 0, given).program(0)
    line = found.line + piece.line
    axis: BoolArray = np.asarray(found.spans.is_axis)
    at = np.searchsorted(piece.judged_from, line - 1, side="right") - 1
    state = judged.table[piece.judgement[at]]
    own = (found.reason != Reason.NONE) & (found.reason != Reason.JOINT_TARGET)
    return replace(
        found,
        line=line,
        reason=np.where(own, found.reason, np.where(axis, state[:, 3], state[:, 2])),
        motion=np.where(state[:, 4] < 0, found.motion, state[:, 4]),
        frame=state[:, 0],
        tool=state[:, 1],
        T_base_frame=judged.T_base_frame,
        T_flange_tool=judged.T_flange_tool,
        notes=(),
    )


def write_piece(program: Program, replacement: Replacement) -> bytes:
    """Returns the bytes of a piece with the changed numbers replaced."""
    return dialect("krl").write(program, replacement)
