"""What every dialect owes every program: zero is the identity, undone is as before, no crash."""

from __future__ import annotations

import signal
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from types import FrameType

import numpy as np
from languages import LANGUAGES
from written import Job, Pen

from robotrue.core.arm_words import NO_WORD
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, RobotrueError, ShapeError
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Motion, Program, Reason, Replacement

Files = tuple[tuple[str, bytes], ...]
DEEP = 5
"""Of so many damaged programs that are read one is corrected and read again."""

COARSE_PLACE = 20e-6
"""m: more than half the third decimal of an inch; corrections are about a millimetre."""
COARSE_TURN = 1e-4
"""rad: more than half the third decimal of a degree in three angles."""

WARM = 20
"""Programs that together call every kernel of their language."""


class Broken(Exception):
    """A law that does not hold, with what happened."""


class TooSlow(BaseException):
    """The time is up; no ``except Exception`` on the way may take this."""


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raises TooSlow after so many seconds of processor time; without limit where there are no
    timers.
    """
    if not hasattr(signal, "setitimer"):
        yield
        return

    def up(number: int, frame: FrameType | None) -> None:
        raise TooSlow(f"more than {seconds:g} s of processor time")

    before = signal.signal(signal.SIGVTALRM, up)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def read(name: str, files: Files, frames: FrameTable) -> tuple[Program, ...]:
    """The programs of a job; warnings are faults."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return find_language(name).read_job(files, frames=frames)


def write(name: str, programs: Sequence[Program], changes: Sequence[Replacement]) -> Files:
    """The files of a job with other numbers."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return tuple(
            (program.name, find_language(name).write(program, change))
            for program, change in zip(programs, changes, strict=True)
        )


def changed(program: Program, position: np.ndarray, rotation: np.ndarray, axes: np.ndarray):
    """A replacement of everything that may be replaced."""
    return Replacement(
        changed=np.isin(program.reason, (Reason.NONE, Reason.JOINT_TARGET)),
        position=position,
        rotation=rotation,
        axes=axes,
        words=np.full_like(program.words, NO_WORD),
    )


def still(program: Program) -> Replacement:
    """The zero correction, of every target that may be corrected."""
    return changed(program, program.position, program.rotation, program.axes)


def moved(program: Program, rng: np.random.Generator) -> Replacement:
    """A correction as compensation makes them: about a millimetre and a tenth of a degree."""
    n = len(program)
    turn = matrix_from_abc(rng.normal(0.0, 0.1, (n, 3)) * DEG)
    return changed(
        program,
        program.position + rng.normal(0.0, 1.0, (n, 3)) * MM,
        program.rotation @ turn,
        program.axes + rng.normal(0.0, 0.05, program.axes.shape) * DEG,
    )


def require_identity(name: str, files: Files, programs: Sequence[Program]) -> None:
    """Raises Broken unless the zero correction gives every file back."""
    given = dict(files)
    for program, (file, data) in zip(
        programs, write(name, programs, [still(p) for p in programs]), strict=True
    ):
        if data != given[file] or program.data != given[file]:
            raise Broken(f"zero correction changes {file}")


def require_undone(
    name: str, job: Job, programs: Sequence[Program], rng: np.random.Generator
) -> int:
    """Raises Broken unless a correction, read again and undone, is gone to half a digit.

    Args:
        name: Of the dialect.
        job: The files and how finely they are printed.
        programs: As they are read.
        rng: Makes the correction.

    Returns:
        The number of targets that were moved.
    """
    others = {file: data for file, data in job.files}
    first = [moved(program, rng) for program in programs]
    others.update(write(name, programs, first))
    again = read(name, tuple(others.items()), job.frames)
    _same(programs, again)
    back_to = [
        changed(now, was.position, was.rotation, was.axes)
        for now, was in zip(again, programs, strict=True)
    ]
    others.update(write(name, again, back_to))
    back = read(name, tuple(others.items()), job.frames)
    _same(programs, back)
    count = 0
    for program, change, now, undone in zip(programs, first, again, back, strict=True):
        use = change.changed
        posed, axis = (
            use & (program.reason == Reason.NONE),
            use & (program.reason == Reason.JOINT_TARGET),
        )
        count += int(use.sum())
        for what, got, want in (("moved", now, change), ("undone", undone, program)):
            for column, rows, bound in (
                ("position", posed & (job.via | (program.motion != Motion.ARC_VIA)), job.place),
                ("rotation", posed, job.turn),
                ("axes", axis, job.bend),
            ):
                apart = np.abs(getattr(got, column) - getattr(want, column))[rows]
                if apart.size and not apart.max() <= 1.0001 * bound + 1e-12:
                    raise Broken(f"{what}: {column} off by {np.nanmax(apart):.3g}, not {bound:.3g}")
    return count


def _said(program: Program, column: str) -> np.ndarray:
    """A column; frames and tools as matrices: their numbers are those of no file."""
    table = {"frame": program.T_base_frame, "tool": program.T_flange_tool}.get(column)
    rows = getattr(program, column)
    return rows if table is None else table[rows]


def _same(before: Sequence[Program], after: Sequence[Program]) -> None:
    if [p.name for p in before] != [p.name for p in after]:
        raise Broken("corrected, other files hold the targets")
    for one, two in zip(before, after, strict=True):
        for column in ("reason", "motion", "words", "frame", "tool"):
            if not np.array_equal(_said(one, column), _said(two, column), equal_nan=True):
                raise Broken(f"corrected, {column} of {one.name} is read otherwise")


@cache
def warm(name: str) -> None:
    """Has the kernels of a language compiled, which takes longer than the limit of a program.

    Without it, a limit that ends while a kernel is compiled is reported as a slow program.
    """
    rng = np.random.default_rng(0)
    for k in range(WARM):
        job = LANGUAGES[name].writer(Pen.of([6, k]))
        programs = read(name, job.files, job.frames)
        require_identity(name, job.files, programs)
        with suppress(ConfigurationError):
            require_undone(name, job, programs, rng)


def survives(name: str, files: Files, frames: FrameTable, seed: int, limit: float) -> bool:
    """Whether damaged files were read; refused is as good, anything else is Broken.

    What was read gives its bytes back at zero correction; for one seed in five it is corrected,
    too, and read again: its targets are then where the correction sends them.
    """
    warm(name)
    try:
        with limited(limit):
            try:
                for _, data in files:
                    if not 0.0 <= find_language(name).detect(data) <= 1.0:
                        raise Broken("sureness beyond 0..1")
                programs = read(name, files, frames)
            except RobotrueError as refusal:
                _require_reason(refusal, files)
                return False
            require_identity(name, files, programs)
            if seed % DEEP:
                return True
            rng = np.random.default_rng(seed)
            others = dict(files)
            changes = [moved(program, rng) for program in programs]
            try:
                others.update(write(name, programs, changes))
            except (ShapeError, ConfigurationError):
                # numbers no controller takes, such as 1E20, and arcs that are none any more
                return True
            try:
                again = read(name, tuple(others.items()), frames)
            except RobotrueError as refusal:
                raise Broken(f"corrected, it is refused: {refusal}") from refusal
            if [len(p) for p in again] != [len(p) for p in programs]:
                raise Broken("corrected, it has another number of targets")
            for program, change, now in zip(programs, changes, again, strict=True):
                _require_moved(name, program, change, now)
            return True
    except TooSlow as cause:
        raise Broken(str(cause)) from None


def _require_moved(name: str, program: Program, change: Replacement, now: Program) -> None:
    """A corrected target is where it was sent, as finely as the coarsest number is printed.

    The via point of an arc has no attitude of its own. Path languages state arcs by centre and
    radius and attitudes by the axis alone: only their straight moves are checked, and these not for
    rotation.
    """
    language = find_language(name)
    posed = change.changed & (program.reason == Reason.NONE)
    bent = change.changed & (program.reason == Reason.JOINT_TARGET)
    straight = ~np.isin(program.motion, (Motion.ARC_VIA, Motion.ARC_END))
    full = language.prints_attitude
    for column, rows, bound in (
        ("position", posed & (straight | full), COARSE_PLACE),
        ("rotation", posed & (program.motion != Motion.ARC_VIA) & full, COARSE_TURN),
        ("axes", bent, COARSE_TURN),
    ):
        want, got = (getattr(one, column)[rows] for one in (change, now))
        apart = np.abs(got - want)
        if not (apart <= bound + 1e-9 * np.abs(want)).all():
            raise Broken(f"corrected, {column} is off by {np.nanmax(apart):.3g}")


def _require_reason(refusal: RobotrueError, files: Files) -> None:
    """A refusal names a file of the job, and a line of it if it names one."""
    names = dict(files)
    if refusal.source is None or not refusal.message:
        raise Broken(f"refused without a file: {refusal}")
    data = names.get(refusal.source)
    if data is None:
        raise Broken(f"refused for {refusal.source}, which is not in the job")
    lines = data.count(b"\n") + data.count(b"\r") + 1
    if refusal.line is not None and not 1 <= refusal.line <= lines:
        raise Broken(f"refused for line {refusal.line} of {lines}")


def timed(act, *arguments) -> tuple[object, float]:
    """The result and the seconds of processor time it took."""
    start = time.process_time()
    return act(*arguments), time.process_time() - start
