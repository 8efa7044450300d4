"""Reads a RAPID job: the frames of the modules beside, then the module itself."""

from __future__ import annotations

from collections.abc import Sequence

from robotrue.errors import FormatError
from robotrue.program.formats.course import Course
from robotrue.program.formats.rapid_build import build
from robotrue.program.formats.rapid_frames import RapidFrames
from robotrue.program.formats.rapid_walk import Walk
from robotrue.program.formats.text_lines import require_text
from robotrue.program.program import FrameTable, Program


def read_rapid(files: Sequence[tuple[str, bytes]], frames: FrameTable) -> tuple[Program, ...]:
    """Returns one program per file; all but the first give frames only and hold no targets.

    Raises:
        FormatError: A file is not RAPID, or is cut off, with the line.
    """
    for name, data in files:
        require_text(data, name)
    course = Course()
    table = RapidFrames(frames, files[0][0], course)
    for name, data in files[1:]:
        Walk(data, name, table, course).declarations()
    name, data = files[0]
    walk = Walk(data, name, table, course)
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
        programs.append(build(Walk(data, name, table, Course()), frames))
    return tuple(programs)
