"""Reads a RAPID job: the frames of the modules beside, then the module itself."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from robotrue.errors import FormatError
from robotrue.program.formats.course import Course
from robotrue.program.formats.rapid_build import build
from robotrue.program.formats.rapid_frames import RapidFrames
from robotrue.program.formats.rapid_walk import RapidWalk
from robotrue.program.formats.text_lines import require_text
from robotrue.program.program import FrameTable, Program

_WIDE_WORD: Final = re.compile(rb"\w*+[\x80-\xff][\w\x80-\xff]*+")


def read_rapid(files: Sequence[tuple[str, bytes]], frames: FrameTable) -> tuple[Program, ...]:
    """Returns one program per file; all but the first give frames only and hold no targets.

    Raises:
        FormatError: A file is not RAPID, or is cut off, with the line.
    """
    for name, data in files:
        require_text(data, name)
    course = Course()
    wide = any(_is_wide(data) for _, data in files)
    table = RapidFrames(_by_bytes(frames) if wide else frames, files[0][0], course)
    for name, data in files[1:]:
        RapidWalk(data, name, table, course).declarations()
    name, data = files[0]
    walk = RapidWalk(data, name, table, course)
    walk.all()
    if not walk.story.begun:
        raise FormatError(
            "not a RAPID module: no MODULE and no motion was found.",
            source=name,
            line=1,
            hint="give the .mod, .modx or .prg that the controller runs.",
        )
    programs = [build(walk, frames)]
    for name, data in files[1:]:
        programs.append(build(RapidWalk(data, name, table, Course()), frames))
    return tuple(_in_words(each) for each in programs) if wide else tuple(programs)


def _is_wide(data: bytes) -> bool:
    """Whether a module is written in UTF-8 with letters that take more than one byte."""
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
