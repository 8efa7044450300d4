"""What Yaskawa jobs do to each other: calls, shifts in force, frames, P points of the controller.

P points, user frames, tools and a shift belong to the controller, and cells run a job again and
again: what one job sets holds in the others, before the instruction as after it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.program.formats.jbi_flow import JobLines, find_shifts, list_calls, read_job_lines
from robotrue.program.formats.jbi_scan import P_POINTS, JbiScan
from robotrue.program.formats.numbered_frames import list_changed_frames
from robotrue.program.formats.shared_fate import share_fate
from robotrue.program.program import Motion, Program, Reason

_FRAME: Final = re.compile(
    rb"\b(?:MFRAME|SETUFRAME)\b(?:(?!\b(?:MFRAME|SETUFRAME)\b).)*?UF#\(([^)\s]{1,20}+)\)",
    re.IGNORECASE,
)
_TOOL: Final = re.compile(
    rb"\bSETTOOL\b(?:(?!\bSETTOOL\b).)*?TL#\(([^)\s]{1,20}+)\)", re.IGNORECASE
)
_NUMBERS: Final = 64
"""User frames and tools that a controller has at most."""
_OTHER_FRAME: Final = re.compile(rb"\bJOB:([^\s()]++)(?:(?!\bJOB:).)*?\bUF#\(([^)\s]{1,20}+)\)")


@dataclass(frozen=True, slots=True)
class JobLinks:
    """What holds in the jobs of a set because of the others.

    Attributes:
        absent: Place of the first call of the jobs that are called and in no file.
        shifts: Whether a shift may be in force after lines of a job that are no plain moves, and
            before all (0), by the name of its file; empty if no job has a shift.
        frames: Numbers of the user frames that a job is called with, by its name in lower case.
    """

    absent: Mapping[str, str]
    shifts: Mapping[str, Mapping[int, bool]]
    frames: Mapping[str, Collection[str]]


def link_jobs(files: Sequence[tuple[str, JbiScan]], harmless: Collection[str]) -> JobLinks:
    """Returns what holds in jobs because of the others.

    Args:
        files: Name and content of each.
        harmless: Jobs in no file that change no point, in lower case.
    """
    jobs = [read_job_lines(file, found) for file, found in files]
    given = {job.name for job in jobs}
    absent: dict[str, str] = {}
    for job in jobs:
        for line, text in job.lines:
            for name in list_calls(text):
                if name.lower() not in given and name.lower() not in harmless:
                    absent.setdefault(name, f"{job.file}:{line}")
    return JobLinks(absent, find_shifts(jobs), _find_frames(jobs))


def _find_frames(jobs: Sequence[JobLines]) -> dict[str, set[str]]:
    """Returns the user frames that jobs are called with."""
    out: dict[str, set[str]] = {}
    for job in jobs:
        for _, text in job.lines:
            for name, number in _OTHER_FRAME.findall(text):
                out.setdefault(name.decode("latin-1").lower(), set()).add(number.decode("latin-1"))
    return out


def jbi_frame_changes(files: Sequence[tuple[str, bytes]]) -> Mapping[tuple[str, str], str]:
    """Returns what changes numbered frames of the controller in the jobs given."""
    words = (b"MFRAME", b"SETUFRAME", b"SETTOOL")
    return list_changed_frames(files, words, lambda line: list_set_frames(line.partition(b"'")[0]))


def list_set_frames(text: bytes) -> list[tuple[str, str]]:
    """Returns side and number of the frames that an instruction sets; all for a variable."""
    out: list[tuple[str, str]] = []
    for side, kind in (("base", _FRAME), ("tool", _TOOL)):
        for number in kind.findall(text):
            own = [number.decode()] if number.isdigit() else map(str, range(_NUMBERS))
            out += [(side, each) for each in own]
    return out


def share_points(
    programs: Sequence[Program], runs: Sequence[Sequence[Sequence[int]]]
) -> list[IntArray]:
    """Returns the reasons of all rows; a P point in several files has one, as has an arc.

    Args:
        programs: The jobs.
        runs: Rows of the arcs of each.
    """
    edge = np.cumsum([0, *map(len, programs)])
    reason = np.concatenate([program.reason for program in programs])
    groups = [
        [int(first) + row for row in run]
        for first, own in zip(edge, runs, strict=False)
        for run in own
    ]
    of: dict[int, list[int]] = {}
    for first, program in zip(edge.tolist(), programs, strict=False):
        names = program.spans.scan.names
        used = program.reason != Reason.UNUSED
        for row in np.flatnonzero((names >= P_POINTS) & used).tolist():
            of.setdefault(int(names[row]), []).append(first + row)
    share_fate(reason, [*groups, *(rows for rows in of.values() if len(rows) > 1)])
    return np.split(reason, edge[1:-1])


def spread_motion(scans: Sequence[JbiScan], motions: Sequence[dict[int, Motion]]) -> None:
    """Gives P points that only another job moves to its motion: the file loaded last sets them."""
    of: dict[int, Motion] = {}
    for found, motion in zip(scans, motions, strict=True):
        of |= {int(found.names[row]): how for row, how in motion.items()}
    for found, motion in zip(scans, motions, strict=True):
        for row in np.flatnonzero(found.names >= P_POINTS).tolist():
            if int(found.names[row]) in of:
                motion.setdefault(row, of[int(found.names[row])])
