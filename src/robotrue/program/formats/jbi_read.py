"""Builds a program from a scanned JBI job: columns, reasons, notes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.core.arm_words import NO_WORD, WORDS
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.units import DEG
from robotrue.errors import ShapeError
from robotrue.program.external_axes import COUNT, Carried
from robotrue.program.formats.jbi_flow import name_job
from robotrue.program.formats.jbi_jobs import (
    JobLinks,
    jbi_frame_changes,
    link_jobs,
    share_points,
    spread_motion,
)
from robotrue.program.formats.jbi_moves import JbiMoves, flag_p_points, moves
from robotrue.program.formats.jbi_scan import UNITS, Header, JbiScan, scan
from robotrue.program.formats.jbi_write import JbiSpans
from robotrue.program.formats.numbered_frames import NumberedFrames
from robotrue.program.formats.shared_fate import flag_lost_frames, share_fate
from robotrue.program.formats.target_tokens import TargetTokens, values_of
from robotrue.program.program import FrameTable, Motion, Program, Reason

_COUNTED: Final = ("C", "BC", "EC", "P", "BP", "EX")
"""Order of ``///NPOS``."""
_HOLDER: Final = {"base": "UFRAME.CND", "tool": "TOOL.CND"}
_PULSES_HINT: Final = (
    "state the pulses per degree of axes S, L, U, R, B, T in the cell (pulses_per_degree in "
    "[controller])"
)
_GROUP: Final = re.compile(rb"^///RC1G[^\r\n]*\r?\n((?:(?!//)[^\n]*\n?)*)", re.MULTILINE)
_LONG: Final = 200
"""Lines from which the group is that of a controller with the longer list."""
_PLACES: Final = ((97, 2, 98), (109, 0, 110))
"""Line of the denominators, how many entries it begins late, and line of the numerators."""
_TURN: Final = 4096.0
"""Pulses of a turn of a motor."""


def read_jbi(files: Sequence[tuple[str, bytes]], frames: FrameTable) -> tuple[Program, ...]:
    """Returns the programs of jobs that may call each other.

    Raises:
        FormatError: Not a job, cut off, or a line that cannot be read.
        ShapeError: ``frames.pulses_per_degree`` are not six numbers other than zero.
    """
    frames = replace(frames, changed_frames=jbi_frame_changes(files))
    scans = [scan(data, name=name) for name, data in files]
    names = [name for name, _ in files]
    links = link_jobs(list(zip(names, scans, strict=True)), frames.harmless_routines)
    walks = [moves(found, name, links) for name, found in zip(names, scans, strict=True)]
    if len(files) > 1:
        spread_motion(scans, [walk.motion for walk in walks])
    named = set[int]().union(*(walk.named for walk in walks))
    programs = []
    for name, found, walk in zip(names, scans, walks, strict=True):
        flag_p_points(walk, found, name, named)
        programs.append(_Builder(found, walk, name, frames, links).program())
    if len(files) == 1:
        return tuple(programs)
    reasons = share_points(programs, [walk.runs for walk in walks])
    return tuple(replace(p, reason=r) for p, r in zip(programs, reasons, strict=True))


class _Builder:
    def __init__(
        self, found: JbiScan, walk: JbiMoves, name: str, given: FrameTable, links: JobLinks
    ) -> None:
        self.scan, self.walk, self.name, self.given = found, walk, name, given
        self.notes: list[str] = []
        self.frames = NumberedFrames(given, name, holder=_HOLDER, zero_is_root=False)
        for side, number, line in walk.frames:
            self.frames.change(side, number, line, "the job")
        self._relative = next((v for _, k, v in found.attributes if k == "FRAME"), "").split()
        self._called_in = links.frames.get(name_job(found.data), ())
        groups = [value for _, key, value in found.attributes if key.startswith("GROUP")]
        self._rail = any("BS" in value for value in groups)

    def program(self) -> Program:
        """Returns the program."""
        found, n = self.scan, len(self.scan.names)
        unit = _units(self.given)
        kinds = np.array([header.unit for header in found.headers], np.int64)
        kind = kinds[found.header]
        tokens = TargetTokens(
            start=found.numbers.start,
            length=found.numbers.length,
            value=found.numbers.value,
            kind=kind,
            unit=unit,
            whole=np.array([False, False, True]),
        )
        position, rotation, axes = values_of(tokens)
        base, tool, doubtful = self._header_frames()
        reason = self._reasons(kind, base[found.header], tool[found.header], doubtful)
        motion = np.full(n, int(Motion.UNUSED), np.int64)
        motion[list(self.walk.motion)] = list(self.walk.motion.values())
        moved = self._external(reason, base[found.header], kind != UNITS["RECTAN"])
        reason[motion == Motion.UNUSED] = Reason.UNUSED
        reason[found.count != 6] = Reason.INCOMPLETE
        reason[list(self.walk.flags)] = list(self.walk.flags.values())
        share_fate(reason, self.walk.runs)
        self._hint_at_axes(reason, motion)
        self.notes += count_note(self.name, found.counts, found.found)
        rconf = np.where(kind == UNITS["RECTAN"], found.configuration, -1)
        return Program(
            name=self.name,
            dialect="jbi",
            data=found.data,
            position=position,
            rotation=rotation,
            axes=axes,
            motion=motion,
            reason=reason,
            words=_words(found, rconf),
            words_of="yaskawa",
            line=found.line,
            frame=moved.frame,
            tool=tool[found.header],
            T_base_frame=moved.T_base_frame,
            external=moved.external,
            T_flange_tool=self.frames.stack_matrices("tool"),
            notes=tuple(dict.fromkeys(self.notes + self.walk.notes)),
            path=np.array(self.walk.path, np.int64).reshape(-1, 3),
            spans=JbiSpans(tokens=tokens, rconf=rconf, scan=found),
        )

    def _header_frames(self) -> tuple[IntArray, IntArray, dict[int, Reason]]:
        """Returns work frame and tool of every header state, and states that cannot be used."""
        base, tool, doubtful = [], [], {}
        used, first, counts = np.unique(self.scan.header, return_index=True, return_counts=True)
        of = dict(
            zip(used.tolist(), zip(first.tolist(), counts.tolist(), strict=True), strict=True)
        )
        for index, header in enumerate(self.scan.headers):
            if index not in of:  # a state that no point has names nothing
                base.append(0)
                tool.append(0)
                continue
            row, count = of[index]
            line = int(self.scan.line[row])
            base.append(self._base(header, line, count))
            number = header.tool
            tool.append(self.frames.number("tool", number, line) if number else 0)
            if header.unit == UNITS["RECTAN"] and header.postype == "TOOL":
                doubtful[index] = Reason.RELATIVE
                self.notes.append(
                    f"{self.name}:{line}: {count} points in tool coordinates; they are not "
                    "compensated. Convert them to BASE or USER."
                )
        return np.array(base, np.int64), np.array(tool, np.int64), doubtful

    def _base(self, header: Header, line: int, count: int) -> int:
        frames, postype = self.frames, header.postype
        others = [number for number in self._called_in if [number] != self._relative[1:2]]
        if self._relative and others and header.unit == UNITS["RECTAN"]:
            what = f"of a relative job that is called with UF#({others[0]})"
            return frames.unknown("base", what, line, "compensate a copy for each frame")
        if header.unit != UNITS["RECTAN"] or postype in ("ROBOT", "TOOL"):
            return frames.robot_root()
        if postype == "BASE":
            railed = any(axis.carries_robot for axis in self.given.external)
            if not self._rail or railed or "BASE" in map(str.upper, self.given.bases):
                named = "BASE" in map(str.upper, self.given.bases)
                return frames.number("base", "BASE", line) if named else frames.root("base")
            what, cure = (
                "BASE is that of the base axis",
                "describe the rail in the cell, or add base BASE to it",
            )
            return frames.unknown("base", what, line, cure)
        if postype == "USER":
            return self._user(header.user, line, count)
        what = f"{postype or 'of points without ///POSTYPE'} is not supported by robotrue"
        return frames.unknown("base", what, line, "convert the points to BASE or USER")

    def _user(self, number: str, line: int, count: int) -> int:
        said = self._relative[1] if self._relative[:1] == ["USER"] and self._relative[1:] else ""
        number = number or said
        if said:
            self.notes.append(
                f"{self.name}: a relative job; its {count} points count from user frame "
                f"{number}, where they were taught: run elsewhere, their correction does not fit."
            )
        if not number:
            what = "is a user frame without a number"
            return self.frames.unknown("base", what, line, "add ///USER")
        return self.frames.number("base", number, line)

    def _reasons(
        self, kind: IntArray, base: IntArray, tool: IntArray, doubtful: dict[int, Reason]
    ) -> IntArray:
        """Returns the first reason of every row, from its kind and frames."""
        is_axis = kind != UNITS["RECTAN"]
        reason = np.where(is_axis, int(Reason.JOINT_TARGET), int(Reason.NONE))
        for why in set(doubtful.values()):
            told = [index for index, each in doubtful.items() if each == why]
            reason[np.isin(self.scan.header, told)] = why
        sides = {"base": base, "tool": tool}
        self.notes += flag_lost_frames(reason, sides, is_axis, self.frames.lost)
        pulses = kind == UNITS["PULSE"]
        if pulses.any() and self.given.pulses_per_degree is None:
            reason[pulses] = Reason.INCOMPLETE
            hint, proposal = _PULSES_HINT, propose_ratios(self.given)
            if proposal is not None:
                hint += (
                    f"; the gear ratios in {proposal[0]} at 4096 pulses a turn give {proposal[1]}, "
                    "without the sign of an axis with the opposite direction: compare one position "
                    "with the pendant first"
                )
            self._tell(pulses, "points in pulses whose axis values are unknown", hint)
        odd = self.scan.count != 6
        if odd.any():
            self._tell(odd, "points that have not six values", "six-axis arms are supported")
        return reason

    def _hint_at_axes(self, reason: IntArray, motion: IntArray) -> None:
        """Notes how points in pulses or degrees on a path can be compensated, too."""
        path = (reason == Reason.JOINT_TARGET) & ~np.isin(motion, (Motion.PTP, Motion.UNUSED))
        if path.any():
            line = self.scan.line[np.flatnonzero(path)[0]]
            self.notes.append(
                f"{self.name}:{line}: {int(path.sum())} points of MOVL, MOVC and MOVS are axis "
                "values (the first is in this line); they are compensated with --axis-targets."
            )

    def _tell(self, rows: BoolArray, what: str, cure: str) -> None:
        line = self.scan.line[np.flatnonzero(rows)[0]]
        self.notes.append(
            f"{self.name}:{line}: {int(rows.sum())} {what} (the first is in this line); they are "
            f"not compensated: {cure}."
        )

    def _external(self, reason: IntArray, base: IntArray, is_axis: BoolArray) -> Carried:
        """Returns the work frames as external axes move them; flags points where none is known.

        External axes count as a move names them: those of its BC point, then those of its EC point.
        """
        values = np.full((len(base), COUNT), np.nan)
        ratio = {axis.number: axis.per_pulse for axis in self.given.external}
        for row, number, key, value in self._partners():
            if number <= COUNT:
                printed = 1.0 if key not in self.scan.pulses else ratio.get(number, np.nan)
                values[row, number - 1] = value * printed
        moved = self.frames.carry_frames(base, values)
        lost = moved.unknown & ~is_axis & np.isin(np.arange(len(base)), list(self.walk.motion))
        if lost.any():
            reason[lost] = Reason.EXTERNAL_AXIS
            what = "points without the value of an axis that carries the robot or their frame"
            self._tell(lost, what, "name its point in the move; for pulses state its ratio")
        self._flag_undescribed(reason)
        return moved

    def _partners(self) -> Iterator[tuple[int, int, tuple[str, int], float]]:
        """Yields (row, number of the axis, point, value as printed) for all external values."""
        for row, keys in self.walk.partners.items():
            number = 0
            for key in sorted(set(keys)):
                for value in self.scan.external.get(key, (np.nan,)):
                    number += 1
                    yield row, number, key, value

    def _flag_undescribed(self, reason: IntArray) -> None:
        """Flags the points whose move also positions an axis that is not described, off zero."""
        told = {axis.number for axis in self.given.external}
        used = [each for each in self._partners() if each[1] not in told]
        away = sorted({row for row, _, _, value in used if value != 0.0})
        found = {(key[0], number, value) for _, number, key, value in used}
        still = len(found) == len({(kind, number) for kind, number, _ in found})
        known = all(key in self.scan.external for _, _, key, _ in used)
        if not away or (self.given.external_axes_at_rest and still and known):
            return
        reason[away] = Reason.EXTERNAL_AXIS
        rows = np.zeros(len(reason), np.bool_)
        rows[away] = True
        cure = (
            "describe the axis in the cell ([[controller.external]]); if it is at rest and the "
            "frames are valid there, state external_axes_at_rest"
        )
        self._tell(rows, "points moved to together with a base or station axis", cure)


def count_note(name: str, stated: tuple[int, ...], found: Mapping[str, int]) -> list[str]:
    """Returns the note on counts of points in ``///NPOS`` that are not those found by kind."""
    have = tuple(found.get(kind, 0) for kind in _COUNTED)
    if not stated or stated == have:
        return []
    return [
        f"{name}: ///NPOS states {','.join(map(str, stated))}, but {','.join(map(str, have))} "
        f"points ({', '.join(_COUNTED)}) are there; the controller may refuse the job."
    ]


def _units(given: FrameTable) -> Array:
    """Returns rad per printed unit of axis values, by ``UNITS``."""
    unit = np.full((3, 6), DEG)
    unit[UNITS["PULSE"]] = np.nan
    if given.pulses_per_degree is not None:
        ratio = np.asarray(given.pulses_per_degree, dtype=np.float64)
        if ratio.shape != (6,) or not (np.abs(ratio) > 0.0).all() or np.isinf(ratio).any():
            raise ShapeError(
                f"pulses_per_degree is {ratio.tolist()}, expected six numbers other than zero.",
                hint="axes S, L, U, R, B, T as in ALL.PRM.",
            )
        unit[UNITS["PULSE"]] = DEG / ratio
    return unit


def _words(found: JbiScan, rconf: IntArray) -> IntArray:
    """Returns the first six fields of the RCONF of every row (n, 6)."""
    width = WORDS["yaskawa"]
    fields = [values[:width] for values in found.rconf]
    return np.array([*fields, (NO_WORD,) * width], np.int64)[rconf]  # -1 is without words


def propose_ratios(frames: FrameTable) -> tuple[str, list[float]] | None:
    """Returns the file next to the job and pulses per degree of six axes; None without any.

    The group ``RC1G`` of ``ALL.PRM`` or ``RC.PRM`` holds the gear ratios of the first robot, ten
    parameters a line. They are only a proposal, to be compared with one position on the pendant:
    the sense of an axis, and the pulses of a turn of its motor, are not in the file.
    """
    for name, data in frames.declarations:
        match = _GROUP.search(data)
        ratios = _read(match[1]) if match else None
        if ratios is not None:
            return name, ratios
    return None


def _read(text: bytes) -> list[float] | None:
    lines = [line.strip() for line in text.split(b"\n") if line.strip()]
    first, late, second = _PLACES[len(lines) >= _LONG]
    if len(lines) <= second:
        return None
    cells = [
        [cell.strip() for cell in lines[row].split(b",")][skip : skip + 6]
        for row, skip in ((first, late), (second, 0))
    ]
    if any(len(row) != 6 or not all(re.fullmatch(rb"-?\d{1,9}", c) for c in row) for row in cells):
        return None
    below, above = ([abs(float(cell)) for cell in row] for row in cells)
    if not (all(below) and all(above)):
        return None
    return [round(_TURN * a / b / 360.0, 4) for a, b in zip(above, below, strict=True)]
