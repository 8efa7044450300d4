"""Reads a RAPID job: the frames of the other modules, then the module itself."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Final

from robotrue.errors import FormatError
from robotrue.program.formats.rapid_beside import CallsBeside, list_routines
from robotrue.program.formats.rapid_build import build
from robotrue.program.formats.rapid_data import RapidSource, SharedData, read_shared_data
from robotrue.program.formats.rapid_flow import RapidFlow
from robotrue.program.formats.rapid_frames import RapidFrames
from robotrue.program.formats.rapid_values import RapidTask
from robotrue.program.formats.rapid_walk import RapidWalk
from robotrue.program.formats.text_lines import require_text
from robotrue.program.program import FrameTable, Program

_MOVES: Final = re.compile(rb"\bMove(?:L|J|C|AbsJ)\b", re.IGNORECASE)
_TELLS: Final = re.compile(
    rb"\b(?:tooldata|wobjdata|robtarget|jointtarget|PROC|FUNC|TRAP)\b", re.IGNORECASE
)
"""What others have to know of a module."""
_WIDE_WORD: Final = re.compile(rb"\w*+[\x80-\xff][\w\x80-\xff]*+")


def read_rapid(files: Sequence[tuple[str, bytes]], frames: FrameTable) -> tuple[Program, ...]:
    """Returns one program per file; each with motions is read with the data of all.

    Raises:
        FormatError: A file is not RAPID, or is cut off, with the line.
    """
    for name, data in files:
        require_text(data, name)
    wide = any(_is_wide(data) for _, data in files)
    given = _by_bytes(frames) if wide else frames
    modules = [_Module(name, data) for name, data in files]
    task = RapidTask.of(files) if len(files) > 1 else RapidTask()
    out = []
    for number in range(len(files)):
        program = _read_module(modules, number, given, task)
        out.append(_in_words(program) if wide else program)
    return tuple(out)


class _Module:
    """A module as others see it: whether it may hold data they use, and whether it moves."""

    def __init__(self, name: str, data: bytes) -> None:
        self.name, self.data = name, data
        self.tells, self.moves = bool(_TELLS.search(data)), bool(_MOVES.search(data))

    @cached_property
    def shared(self) -> SharedData:
        """What others have to know; read once, however many there are."""
        return read_shared_data(self.data, self.name)


def _read_module(
    files: Sequence[_Module], number: int, frames: FrameTable, task: RapidTask
) -> Program:
    """Returns the program of one file, read with the frames and routines of the others."""
    own = files[number]
    course = RapidFlow(task, own.name)
    table = RapidFrames(frames, own.name, course)
    course.own = table.own
    if number and not own.moves:  # it gives data only
        source = RapidSource(own.data, own.name, table, course, task, CallsBeside())
        return build(RapidWalk(source), frames)
    beside = [other for other in files if other.tells and other is not own]
    for other in beside:
        table.declare_beside(other.shared.frames)
    for other in reversed(beside):  # the first to declare a target is named
        table.elsewhere.update(dict.fromkeys(other.shared.targets, other.name))
    routines = {each.name: each.shared.routines for each in beside}
    routines[own.name] = list_routines(own.data)
    calls = CallsBeside(own.name, routines, frames.harmless_routines)
    walk = RapidWalk(RapidSource(own.data, own.name, table, course, task, calls))
    walk.all()
    if not walk.story.begun:
        raise FormatError(
            "not a RAPID module: no MODULE and no motion was found.",
            source=own.name,
            line=1,
            hint="give the .mod, .modx or .prg that the controller runs.",
        )
    return build(walk, frames)


def _is_wide(data: bytes) -> bool:
    """True if a module is UTF-8 with letters of more than one byte."""
    if data.isascii():
        return False
    try:
        data.decode()
    except UnicodeDecodeError:
        return False
    return True


def _by_bytes(frames: FrameTable) -> FrameTable:
    """Returns the table with its names as they are read, one letter per byte."""
    bases, tools = (
        {name.encode().decode("latin-1"): matrix for name, matrix in each.items()}
        for each in (frames.bases, frames.tools)
    )
    return replace(frames, bases=bases, tools=tools)


def _in_words(program: Program) -> Program:
    """Returns the program with the names in its notes as they are written."""
    if not program.notes:
        return program
    names = {word: word.decode(errors="replace") for word in _WIDE_WORD.findall(program.data)}
    notes = program.notes
    for word in sorted(names, key=len, reverse=True):
        read = word.decode("latin-1")
        for form in (read, read.lower(), repr(read)[1:-1], repr(read.lower())[1:-1]):
            notes = tuple(note.replace(form, names[word]) for note in notes)
    return replace(program, notes=notes)
