"""Reads a KRL job: programs that call each other, points in any ``.dat``, CAMRob files.

Several ``.src`` are read as one text in the order they are given, so that frames are followed from
call to call; the text is taken apart again afterwards. Names that more than one ``.dat`` gives a
value to belong to the ``.src`` of the same file name, as on the controller.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.errors import FormatError
from robotrue.program.formats.camrob import camrob_program, scan_targets
from robotrue.program.formats.krl_build import Builder
from robotrue.program.formats.krl_frames import Frames
from robotrue.program.formats.krl_operands import Called
from robotrue.program.formats.krl_resolve import resolve
from robotrue.program.formats.krl_scan import STATEMENT, Scan, scan
from robotrue.program.formats.krl_walk import KrlWalk
from robotrue.program.formats.krl_write import KrlSpans
from robotrue.program.formats.number_table import Numbers
from robotrue.program.formats.text_lines import line_starts, require_text
from robotrue.program.lang import languages
from robotrue.program.program import FrameTable, Program, Reason

File: TypeAlias = tuple[str, bytes]
_JOINED: Final = "<job>"
_NAMED_LINE: Final = re.compile(re.escape(_JOINED) + r":(\d+)")
_BOM: Final = b"\xef\xbb\xbf"


def read_krl(files: Sequence[File], frames: FrameTable) -> tuple[Program, ...]:
    """Returns one program per file, in the order given; ``.dat`` files are read for the others.

    Raises:
        FormatError: A file is not KRL, is cut off, or has a number that cannot be read; a program
            without DEF beside another.
    """
    paths = [file for file in files if file[0].lower().endswith(".csv")]
    stores = [file for file in files if file[0].lower().endswith(".dat")]
    mains = [file for file in files if file not in paths and file not in stores]
    text = _Text.of(mains) if len(mains) > 1 else None
    beside = [name for name, _ in paths]
    if text is None:
        builder = _build([*mains, *stores], frames, (), beside, ())
        found = {name: builder.program(k) for k, (name, _) in enumerate([*mains, *stores])}
    else:
        try:
            builder = _build([(_JOINED, text.data), *stores], frames, text.owners(), beside, mains)
        except FormatError as cause:
            raise text.place_error(cause) from cause
        found = dict(zip(text.names, text.parts(builder.program(0)), strict=True))
        for k, (name, _) in enumerate(stores, start=1):
            program = builder.program(k)
            found[name] = replace(program, notes=text.tell_places(program.notes))
    for name, data in paths:
        program = _camrob(name, data, builder)
        found[name] = (
            program if text is None else replace(program, notes=text.tell_places(program.notes))
        )
    return tuple(found[name] for name, _ in files)


def _build(
    files: Sequence[tuple[str, bytes]],
    frames: FrameTable,
    owners: Sequence[tuple[int, str]] = (),
    beside: Collection[str] = (),
    parts: Sequence[tuple[str, bytes]] = (),
) -> Builder:
    """Returns the builder of the programs of one main file and its data files.

    Args:
        files: The main file and data files.
        frames: What they name but do not hold.
        owners: From which line of the main file on names are those of which file.
        beside: Names of the CAMRob files there are.
        parts: The files the main file is made of, if it is several.
    """
    names = [name for name, _ in files]
    for name, data in files:
        require_text(data, name)
    scans = [scan(data, name=name) for name, data in files]
    stores = [i for i, name in enumerate(names) if name.lower().endswith(".dat")]
    mains = [i for i in range(len(files)) if i not in stores]
    walk = KrlWalk(scans, names, Frames(frames, names[mains[0]] if mains else names[0]))
    walk.scope.owners = owners
    walk.beside = {name.lower() for name in beside}
    if len(stores) > 1:
        walk.scope.share(files[i][1] for i in stores)
    for file in stores:
        walk.data_file(file)
    for name, data in frames.declarations:
        walk.outside_file(name, data)
    walk.scope.share_routines((name, data) for name, data in parts or [files[i] for i in mains])
    for file in mains:
        walk.main_file(file)
    resolve(walk)
    main = mains[0] if mains else -1
    if not walk.story.has_def:
        _require_content(walk, main)
    return Builder(walk, main, frames)


def _require_content(walk: KrlWalk, main: int) -> None:
    """Refuses files without a DEF that hold no motion (main file) or no point (data files)."""
    found, told = walk.scans[main], walk.story.uses or walk.story.definitions
    if main >= 0 and not told and not (found.line_kind > STATEMENT).any():
        _refuse(found, walk.names[main])
    for store, name in zip(walk.scans, walk.names, strict=True):
        if main < 0 and not len(store.agg_line):
            _refuse(store, name)


def _refuse(found: Scan, name: str) -> None:
    text = found.data
    signs = [(language.sign, language.called) for language in languages().values()]
    guess = next((called for sign, called in signs if sign and sign.search(text)), "")
    why = f"it looks like {guess}" if guess else "no DEF, DEFDAT, point or motion was found"
    line = next((i for i, kind in enumerate(found.line_kind.tolist()) if kind), 0)
    shown = found.code(line).strip()[:60] if len(found.line_kind) else ""
    raise FormatError(
        f"not a KRL program: {why}. The first statement is {shown!r}.",
        source=name,
        line=line + 1,
        hint="give the .src (and .dat) that the controller runs.",
    )


def _camrob(name: str, data: bytes, builder: Builder) -> Program:
    """Returns the targets of a CAMRob file in the frames in which the program calls it."""
    tokens, external, line = scan_targets(data, name)
    calls = [call for call in builder.story.called_files if call.name.lower() == name.lower()]
    lines = np.full(len(line), -1, np.int64)
    conflict = np.zeros(len(line), np.bool_)
    for call in calls:
        rows = _rows(call, len(line))
        lines[rows], differ = builder.join_calls(lines[rows], call.line)
        conflict[rows] |= differ
    used = lines >= 0
    settled = builder.settle_call(name, np.where(used, lines, 0), external)
    reason = np.where(used, settled.reason, int(Reason.UNUSED))
    reason[conflict] = Reason.UNKNOWN_FRAME
    notes = list(settled.notes) if used.any() else [f"{name}: no program of the job calls it."]
    if conflict.any():
        notes.append(f"{name}: it is called in more than one base or tool; not compensated.")
    start = builder.axes_before(calls[0].line) if calls else np.empty(0)
    if used.any() and not len(start):
        notes.append(
            f"{name}: no axis target before its call, so the arm configuration at its first "
            "target is unknown."
        )
    program = camrob_program(
        name, data, tokens, line, reason=reason, frame=settled.frame, tool=settled.tool,
        T_base_frame=settled.T_base_frame, T_flange_tool=settled.T_flange_tool, start=start,
        notes=notes,
    )  # fmt: skip
    return replace(program, external=settled.external)


def _rows(call: Called, count: int) -> slice:
    """Returns the rows a call goes through: from its first line to its last, -1 is the end."""
    return slice(max(call.first - 1, 0), count if call.last < 0 else min(call.last, count))


@dataclass(frozen=True, slots=True)
class _Text:
    """Several programs as one text.

    Attributes:
        files: Name and bytes of each.
        data: All of them, each ending with a line end, marks of UTF-8 blanked out.
        place: (k + 1,) first byte of each.
        line: (k + 1,) zero-based first line of each.
    """

    files: tuple[File, ...]
    data: bytes
    place: IntArray
    line: IntArray

    @classmethod
    def of(cls, files: Sequence[File]) -> _Text:
        """Returns the text of files in order.

        Raises:
            FormatError: A file without a DEF: it cannot be separated from the end of the one
                before.
        """
        parts, place, line = [], [0], [0]
        for name, data in files:
            if not re.search(
                rb"^[^\S\n]*+(?:GLOBAL\s+)?DEF(?:FCT)?\s", data.lstrip(_BOM), re.I | re.M
            ):
                raise FormatError(
                    "no DEF: a job of several programs needs one in each.",
                    source=name,
                    line=1,
                    hint="give this file as a separate job.",
                )
            text = b"   " + data[3:] if data.startswith(_BOM) else data
            if not text.endswith((b"\n", b"\r")):
                text += b"\n"
            parts.append(text)
            place.append(place[-1] + len(text))
            line.append(line[-1] + len(line_starts(text)) - 1)
        return cls(tuple(files), b"".join(parts), np.array(place), np.array(line))

    @property
    def names(self) -> list[str]:
        """Names of the files."""
        return [name for name, _ in self.files]

    def owners(self) -> list[tuple[int, str]]:
        """Returns first line and name without suffix of each file."""
        stems = [name.rpartition(".")[0] or name for name in self.names]
        return list(zip(self.line[:-1].tolist(), stems, strict=True))

    def _file(self, line: int) -> int:
        """Returns the file of a zero-based line."""
        return int(np.clip(np.searchsorted(self.line, line, "right") - 1, 0, len(self.files) - 1))

    def tell_places(self, notes: Sequence[str]) -> tuple[str, ...]:
        """Returns sentences with the files' own names and lines."""

        def own(match: re.Match[str]) -> str:
            line = int(match[1]) - 1
            k = self._file(line)
            return f"{self.names[k]}:{line + 1 - int(self.line[k])}"

        return tuple(_NAMED_LINE.sub(own, note).replace(_JOINED, self.names[0]) for note in notes)

    def place_error(self, cause: FormatError) -> FormatError:
        """Returns an error about the text as one about its file."""
        if cause.source != _JOINED:
            return cause
        line = (cause.line or 1) - 1
        k = self._file(line)
        return FormatError(
            cause.message,
            source=self.names[k],
            line=line + 1 - int(self.line[k]),
            hint=cause.hint,
        )

    def parts(self, whole: Program) -> list[Program]:
        """Returns the programs of the files from that of the text."""
        file = np.clip(
            np.searchsorted(self.line, whole.line - 1, "right") - 1, 0, len(self.files) - 1
        )
        said = self.tell_places(whole.notes)
        owner = [next((k for k, n in enumerate(self.names) if note.startswith(f"{n}:")), 0)
                 for note in said]  # fmt: skip
        out = []
        for k, (name, data) in enumerate(self.files):
            rows = np.flatnonzero(file == k)
            first, last = (int(rows[0]), int(rows[-1]) + 1) if len(rows) else (0, 0)
            mine = slice(first, last)
            out.append(
                replace(
                    whole,
                    name=name,
                    data=data,
                    **{
                        column: getattr(whole, column)[mine]
                        for column in (
                            "position", "rotation", "axes", "motion", "reason", "words", "frame",
                            "tool",
                        )
                    },
                    line=whole.line[mine] - int(self.line[k]),
                    held=whole.held[mine],
                    notes=tuple(note for note, at in zip(said, owner, strict=True) if at == k),
                    spans=_part_of(whole.spans, mine, int(self.place[k])),
                    path=self._path(whole.path, k, mine),
                )
            )  # fmt: skip
        return out

    def _path(self, path: IntArray, file: int, rows: slice) -> IntArray:
        """Returns the moves to rows of one file, and those in it to a target that is no row."""
        first, end = int(self.line[file]), int(self.line[file + 1])
        lost = (path[:, 1] < 0) & (-path[:, 1] > first) & (-path[:, 1] <= end)
        out = np.array(path[lost | (path[:, 1] >= rows.start) & (path[:, 1] < rows.stop)])
        out[:, 1] += np.where(out[:, 1] < 0, first, -rows.start)
        return out


def _part_of(spans: KrlSpans, rows: slice, place: int) -> KrlSpans:
    """Returns the numbers of some rows, counted from the first byte of their file."""
    numbers = spans.numbers
    start = numbers.start[rows]
    inside = (spans.partial >= rows.start) & (spans.partial < rows.stop)
    donor = spans.donor[inside]
    return KrlSpans(
        numbers=Numbers(
            start=np.where(start < 0, start, start - place),
            length=numbers.length[rows],
            value=numbers.value[rows],
        ),
        is_axis=spans.is_axis[rows],
        written=spans.written.part(rows, place),
        partial=spans.partial[inside] - rows.start,
        donor=np.where(donor >= 0, donor - rows.start, donor),
        owed=spans.owed[inside],
    )
