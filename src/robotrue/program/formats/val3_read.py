"""Builds the programs of a VAL3 application: points of its ``.dtx``, moved to by its ``.pgx``."""

from __future__ import annotations

import re
from array import array
from collections.abc import Sequence
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.program.formats.shared_fate import share_fate
from robotrue.program.formats.target_notes import TargetNotes, absent_routine
from robotrue.program.formats.target_tokens import POSE, TargetTokens, values_of
from robotrue.program.formats.val3_calls import Reference, Val3Move
from robotrue.program.formats.val3_code import CodeUse, read_code
from robotrue.program.formats.val3_files import FrameValue, Val3File, read_val3_file
from robotrue.program.formats.val3_numbers import POSE_NAMES, find_point_numbers
from robotrue.program.program import FrameTable, Motion, Program, Reason

_NUMBER: Final = re.compile(r"[-+]?(?:\d++\.?+\d*+|\.\d++)(?:[eE][-+]?\d+)?+", re.ASCII)
_LARGEST: Final = 1e9
"""mm or deg of a frame that can be one."""
_UNUSED: Final = int(Motion.UNUSED)
_ROOTS: Final = {"base": "world", "tool": "flange"}


def read_val3(files: Sequence[tuple[str, bytes]], frames: FrameTable) -> tuple[Program, ...]:
    """Returns one program per file of an application; the targets are those of the ``.dtx``.

    Raises:
        FormatError: A file is none of VAL3 s7 or later in millimetres, or is damaged.
    """
    held = [read_val3_file(data, name, file) for file, (name, data) in enumerate(files)]
    application = _Application(files, held, frames)
    return tuple(application.build(file) for file in range(len(files)))


class _Application:
    """What the files of a job hold, and what their code does with it."""

    def __init__(
        self, files: Sequence[tuple[str, bytes]], held: Sequence[Val3File], given: FrameTable
    ) -> None:
        self.files, self.given = files, given
        self.points = [content.points for content in held]
        self.rows: dict[str, dict[str, tuple[int, int]]] = {}
        for file in range(len(files)):
            self._add_points(file)
        routines = [routine for content in held for routine in content.routines]
        databases = sum(bool(content.points.line or content.frames) for content in held)
        self.use: CodeUse = read_code(routines, shared=databases > 1)
        known = {routine.name for routine in routines} | {*given.harmless_routines}
        self.absent = {name: place for name, place in self.use.calls.items() if name not in known}
        self.frames = {
            side: _Frames(side, held, given, self.use.changed) for side in ("base", "tool")
        }
        self.tool = [[0] * len(points.line) for points in self.points]
        self.motion = [[_UNUSED] * len(points.line) for points in self.points]
        self.clash = [[False] * len(points.line) for points in self.points]
        self.parted = [[False] * len(points.line) for points in self.points]
        self.path = [array("q") for _ in files]
        self.arcs: list[list[list[int]]] = [[] for _ in files]
        self._arcs: set[tuple[Reference | None, Reference | None]] = set()
        self._whole: dict[tuple[str, str], None] = {}
        self._tools: dict[Reference | None, int] = {}
        for place, move in enumerate(self.use.moves):
            self._follow(place, move)

    def _add_points(self, file: int) -> None:
        points = self.points[file]
        for row, (name, key) in enumerate(zip(points.name, points.key, strict=True)):
            known = self.rows.setdefault(name, {})
            if key in known:
                raise FormatError(
                    f"{name}[{key}] occurs twice.",
                    source=self.files[file][0],
                    line=points.line[row],
                    hint="delete one of the two; give the files of one application.",
                )
            known[key] = file, row

    def _follow(self, place: int, move: Val3Move) -> None:
        """Records a motion to its points."""
        ends = [(move.target, move.motion)]
        if move.motion == Motion.ARC_END:
            ends.insert(0, (move.via, Motion.ARC_VIA))
            self._join_arc(move)
        for target, motion in ends:
            rows = self._find_rows(target, move.tool)
            for file, row in rows:
                self._use(file, row, motion, move)
            if len(rows) == 1 and target is not None and target.key is not None:
                self.path[rows[0][0]].extend((place, rows[0][1], motion))
            else:
                self.path[move.file].extend((place, -move.line, motion))

    def _join_arc(self, move: Val3Move) -> None:
        """Lets the points of an arc be compensated together; alone they are not."""
        pair = move.via, move.target
        if pair in self._arcs:
            return
        self._arcs.add(pair)
        sides = [self._list_rows(each) for each in pair]
        found = [place for side in sides for place in side]
        files = {file for file, _ in found}
        if all(sides) and len(files) == 1:
            self.arcs[files.pop()].append([row for _, row in found])
            return
        for file, row in found:
            self.parted[file][row] = True

    def _list_rows(self, target: Reference | None) -> list[tuple[int, int]]:
        """The points a target may mean; with a computed subscript all of the array."""
        array = self.rows.get(target.name, {}) if target is not None else {}
        if target is None or target.key is None:
            return list(array.values())
        return [array[target.key]] if target.key in array else []

    def _find_rows(self, target: Reference | None, tool: Reference | None) -> list[tuple[int, int]]:
        """The points a motion may go to; with a computed subscript all, once with each tool."""
        if target is not None and target.key is None:
            asked = (target.name, str(tool))
            if asked in self._whole or sum(name == target.name for name, _ in self._whole) > 1:
                return []
            self._whole[asked] = None
        return self._list_rows(target)

    def _use(self, file: int, row: int, motion: Motion, move: Val3Move) -> None:
        tool = self._tools.get(move.tool, -1)
        if tool < 0:
            tool = self._tools[move.tool] = self.frames["tool"].index(move.tool)
        before = self.motion[file][row]
        if before != _UNUSED and self.tool[file][row] != tool:
            self.clash[file][row] = True
        self.tool[file][row] = tool
        if before in (_UNUSED, int(Motion.PTP)):
            self.motion[file][row] = int(motion)

    def build(self, file: int) -> Program:
        """Returns the program of one file."""
        (name, data), points = self.files[file], self.points[file]
        tokens = find_point_numbers(data, points, name)
        position, rotation, axes = values_of(tokens)
        line = np.array(points.line, np.int64)
        base = self.frames["base"]
        parents = {father: base.parent(father) for father in dict.fromkeys(points.father)}
        frame = np.array([parents[father] for father in points.father], np.int64)
        notes = TargetNotes(name, line)
        reason = self._find_reasons(file, tokens, frame, notes)
        path = np.array(self.path[file], np.int64).reshape(-1, 3)
        if (tokens.kind == POSE).any():
            notes.say(
                f"{name}: shoulder, elbow and wrist of its points are not changed and do not "
                "determine the arm configuration."
            )
        return Program(
            name=name,
            dialect="val3",
            data=data,
            position=position,
            rotation=rotation,
            axes=axes,
            motion=np.array(self.motion[file], np.int64),
            reason=reason,
            words=np.empty((len(line), 0), np.int64),
            words_of="",
            line=line,
            frame=frame,
            tool=np.array(self.tool[file], np.int64),
            T_base_frame=np.array(base.matrices),
            T_flange_tool=np.array(self.frames["tool"].matrices),
            notes=notes.notes(),
            spans=tokens,
            path=path[np.argsort(path[:, 0], kind="stable")],
        )

    def _find_reasons(
        self, file: int, tokens: TargetTokens, frame: IntArray, notes: TargetNotes
    ) -> IntArray:
        """Why points cannot be compensated (n,), in the order of what weighs most."""
        points = self.points[file]
        axis = tokens.kind != POSE
        reason = np.where(axis, int(Reason.JOINT_TARGET), int(Reason.NONE))
        lost_frame = ~axis & self.frames["base"].list_lost()[frame]
        lost_tool = self.frames["tool"].list_lost()[np.array(self.tool[file], np.int64)]
        unused = np.array(self.motion[file], np.int64) == Motion.UNUSED
        named = self.use.touched | self.use.computed
        touched = np.array([variable in named for variable in points.name], np.bool_)
        followed = np.array([variable in self.use.followed for variable in points.name], np.bool_)
        short = np.isnan(tokens.value).any(axis=1)
        said = (
            (
                np.array(self.clash[file], np.bool_),
                Reason.UNKNOWN_FRAME,
                "points are used with several tools",
            ),
            (lost_tool & ~unused, Reason.UNKNOWN_FRAME, self.frames["tool"].explain()),
            (lost_frame, Reason.UNKNOWN_FRAME, self.frames["base"].explain()),
            (
                np.array(self.parted[file], np.bool_),
                Reason.INCOMPLETE,
                "the other point of an arc is computed or in another file",
            ),
            (short, Reason.INCOMPLETE, "numbers of points are left out; write all six"),
            (touched, Reason.EXPRESSION, "points are named by other statements than motions"),
            (unused, Reason.UNUSED, ""),
        )
        for rows, why, sentence in said:
            reason[rows] = why
            if sentence:
                notes.rows(rows & ~unused, f"{sentence}; not compensated")
        based = unused & followed & ~touched
        reason[based] = Reason.RELATIVE
        notes.rows(based, "only copies, appro or compose use these points; not compensated")
        if self.absent and len(axis):
            reason[~unused] = Reason.EXPRESSION
            where, line = next(iter(self.absent.values()))
            what = "points, frames and tools, so that no point is compensated"
            place = f"{self.files[where][0]}:{line}"
            notes.say(absent_routine(place, list(self.absent), what))
        share_fate(reason, self.arcs[file])
        notes.rows(
            followed & np.isin(reason, (Reason.NONE, Reason.JOINT_TARGET)),
            "this point is also copied, or in appro or compose: targets computed from it move with "
            "its correction",
        )
        return reason


class _Frames:
    """Work frames, or tools, multiplied with their parent frames.

    Attributes:
        matrices: (4, 4) by index; NaN is not known. The first is the robot's root, or the flange.
    """

    def __init__(
        self,
        side: str,
        held: Sequence[Val3File],
        given: FrameTable,
        changed: set[str],
    ) -> None:
        self._given = given.bases if side == "base" else given.tools
        self._root, self._changed, self._side = _ROOTS[side], changed, side
        kind = "frame" if side == "base" else "tool"
        self._values = {
            (value.name, value.key): value
            for content in held
            for value in content.frames
            if value.kind == kind
        }
        root: Array = np.asarray(self._given.get(self._root, np.eye(4)), np.float64)
        self.matrices: list[Array] = [root]
        self._index: dict[tuple[str, str], int] = {(self._root, "0"): 0}
        self._lost: dict[int, str] = {}

    def parent(self, father: str) -> int:
        """Returns the index of the parent frame of a point."""
        return self._find(_split_father(father))

    def index(self, reference: Reference | None) -> int:
        """Returns the index of a tool that a motion names."""
        if reference is None or reference.key is None:
            return self._lose(("", ""), "is computed")
        return self._find((reference.name, reference.key))

    def list_lost(self) -> BoolArray:
        """Returns which indices (f,) are not known."""
        return np.asarray(np.isnan(np.array(self.matrices)).any(axis=(1, 2)))

    def explain(self) -> str:
        """Returns what is not known and what to do."""
        what = "; ".join(dict.fromkeys(self._lost.values()))
        return f"{what}: name it in [controller] of the cell" if what else ""

    def _find(self, name: tuple[str, str]) -> int:
        """The index of a frame, from the root up; each is multiplied out once."""
        chain: dict[tuple[str, str], None] = {}
        while name not in self._index and name not in chain:
            chain[name] = None
            if name in self._values and not self._is_stated(name):
                name = self._parent_of(self._values[name])
        for own in reversed(chain):
            self._enter(own)
        return self._index[next(iter(chain), name)]

    def _is_stated(self, name: tuple[str, str]) -> bool:
        return _spell(name) in self._given

    def _enter(self, name: tuple[str, str]) -> None:
        value = self._values.get(name)
        if self._is_stated(name):
            self._index[name] = len(self.matrices)
            self.matrices.append(np.asarray(self._given[_spell(name)], np.float64))
        elif name[0] in self._changed:
            self._lose(name, f"{_spell(name)} is changed by the code")
        elif value is None:
            self._lose(name, f"{_spell(name)} is in no file given")
        else:
            base = self._index.get(self._parent_of(value))
            own = _read_pose(value)
            if base is None or base in self._lost or own is None:
                self._lose(name, f"the parent frame of {_spell(name)} is unknown")
            else:
                self._index[name] = len(self.matrices)
                self.matrices.append(self.matrices[base] @ own)

    def _parent_of(self, value: FrameValue) -> tuple[str, str]:
        return _split_father(value.attributes.get("fatherId", f"{self._root}[0]"))

    def _lose(self, name: tuple[str, str], why: str) -> int:
        if name not in self._index:
            self._index[name] = len(self.matrices)
            self._lost[self._index[name]] = why if name[0] else f"a {self._side} {why}"
            self.matrices.append(np.full((4, 4), np.nan))
        return self._index[name]


def _spell(name: tuple[str, str]) -> str:
    """A frame as the cell names it: without the subscript of a single one."""
    return name[0] if name[1] == "0" else f"{name[0]}[{name[1]}]"


def _split_father(father: str) -> tuple[str, str]:
    name, _, key = father.partition("[")
    return name, key.rstrip("]") or "0"


def _read_pose(value: FrameValue) -> Array | None:
    """The pose (4, 4) m of a frame or tool; a number that is left out is zero."""
    words = [value.attributes.get(name, "0").strip() for name in POSE_NAMES]
    if not all(_NUMBER.fullmatch(word) and abs(float(word)) < _LARGEST for word in words):
        return None
    x, y, z, rx, ry, rz = (float(word) for word in words)
    turn = matrix_from_abc(np.array([-rz, -ry, -rx]) * DEG).T
    return pose(turn, np.array([x, y, z]) * MM)
