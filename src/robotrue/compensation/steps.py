"""Steps in the path of a mixed program, where an unchanged target is next to a compensated one.

On a path the tool follows (lines, arcs, splines) the contour has a step where one end of a move is
corrected and the other is not: the unchanged target has no correction, so the step is the length of
its neighbour's. A joint move or a rapid one cuts nothing and makes no step, nor does the move from
a home position, an axis target reached by a joint move.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Final, NamedTuple

import numpy as np

from robotrue.compensation.status import Status
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns, concat
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, StepError
from robotrue.program.lang import languages
from robotrue.program.program import Motion, Program, Reason

NAMED: Final = 5
"""Largest number of steps listed one by one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PathTargets(Columns):
    """Targets in the order the program text moves to them.

    Attributes:
        names: Of the files.
        file: (n,) which of them.
        line: (n,) one-based.
        left: (n,) it is left alone.
        size: (n,) m, length of its correction.
        joined: (n,) a line, arc or spline leads to it.
        home: (n,) an axis target left alone, that a joint move leads to.
        place: (n, 3) m, in the robot base; NaN where not known.
    """

    names: tuple[str, ...]
    file: Annotated[IntArray, Column("n")]
    line: Annotated[IntArray, Column("n")]
    left: Annotated[BoolArray, Column("n")]
    size: Annotated[Array, Column("n", unit="m")]
    joined: Annotated[BoolArray, Column("n")]
    home: Annotated[BoolArray, Column("n")]
    place: Annotated[Array, Column("n 3", unit="m", nan=True)]

    def __len__(self) -> int:
        return len(self.line)

    def where(self, row: int) -> str:
        """Returns file and line of a target."""
        return f"{self.names[self.file[row]]}:{self.line[row]}"


class PathStep(NamedTuple):
    """The move between two targets, one of them left alone: file and line of both, and m."""

    before: str
    after: str
    left: str
    size: float

    def document(self) -> dict[str, object]:
        """Returns JSON values."""
        return {
            "from": self.before,
            "to": self.after,
            "left_alone": self.left,
            "mm": self.size / MM,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """Step sizes of a program, or of a part of it.

    Attributes:
        count: How many there are.
        first: The first ``NAMED`` of them.
        worst: The largest.
        length: m, of the moves on a path between targets whose place is known, arcs as chords.
        corrected: m, of those whose two ends are compensated.
        by_file: Both lengths, m, of the moves that lead to targets of each file.
        head: First target of the part.
        tail: Last target of the part.
    """

    count: int = 0
    first: tuple[PathStep, ...] = ()
    worst: PathStep | None = None
    length: float = 0.0
    corrected: float = 0.0
    by_file: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    head: PathTargets | None = None
    tail: PathTargets | None = None

    @property
    def largest(self) -> float:
        """m, 0 without any."""
        return 0.0 if self.worst is None else self.worst.size

    def document(self) -> Mapping[str, object]:
        """Returns JSON values."""
        return {
            "count": self.count,
            "max_mm": self.largest / MM,
            "worst": None if self.worst is None else self.worst.document(),
            "first": [step.document() for step in self.first],
            "path_mm": self.length / MM,
            "compensated_path_mm": self.corrected / MM,
        }


NO_STEPS: Final = Steps()


def steps_of(parts: Sequence[tuple[Program, IntArray, Array]]) -> Steps:
    """Returns the steps of programs that one text moves through: a ``.src`` with its ``.dat``.

    Args:
        parts: Each program with the :class:`Status` (n,) and the shift (n, 3) m of its targets.
    """
    names = tuple(program.name for program, _, _ in parts)
    columns, orders = zip(*(_columns(names, k, *part) for k, part in enumerate(parts)), strict=True)
    path = concat(columns).take(np.argsort(np.concatenate(orders), kind="stable"))
    return _measure_path(path) if len(path) else Steps()


def job_steps(parts: Sequence[tuple[Program, IntArray, Array]]) -> Steps:
    """Returns the steps of a job; the files of a KRL job are one text.

    Args:
        parts: As :func:`steps_of`, in the order of the job.
    """
    texts: list[list[tuple[Program, IntArray, Array]]] = []
    whole: dict[str, list[tuple[Program, IntArray, Array]]] = {}
    for part in parts:
        if _is_one_text(part[0]):
            whole.setdefault(part[0].dialect, []).append(part)
        else:
            texts.append([part])
    texts = [*whole.values(), *texts]
    apart = [replace(steps_of(text), head=None, tail=None) for text in texts]
    return join_steps(apart)


def _is_one_text(program: Program) -> bool:
    language = languages().get(program.dialect)
    return language is not None and language.one_text and len(program.path) > 0


def join_steps(parts: Iterable[Steps]) -> Steps:
    """Returns the steps of a whole from those of its parts in order, and those between them."""
    out = Steps()
    for part in parts:
        between = NO_STEPS
        if out.tail is not None and part.head is not None:
            between = _measure_path(concat([out.tail, part.head]))
        both = [*out.first, *between.first, *part.first]
        known = [step for step in (out.worst, between.worst, part.worst) if step is not None]
        out = Steps(
            count=out.count + between.count + part.count,
            first=tuple(both[:NAMED]),
            worst=max(known, key=lambda step: step.size, default=None),
            length=out.length + between.length + part.length,
            corrected=out.corrected + between.corrected + part.corrected,
            by_file=_add_lengths(out.by_file, between.by_file, part.by_file),
            head=out.head or part.head,
            tail=part.tail or out.tail,
        )
    return out


def _add_lengths(
    *parts: Mapping[str, tuple[float, float]],
) -> Mapping[str, tuple[float, float]]:
    out: dict[str, tuple[float, float]] = {}
    for part in parts:
        for name, (length, corrected) in part.items():
            before = out.get(name, (0.0, 0.0))
            out[name] = (before[0] + length, before[1] + corrected)
    return out


def _columns(
    names: tuple[str, ...], file: int, program: Program, status: IntArray, shift: Array
) -> tuple[PathTargets, IntArray]:
    """Returns the path through one program, and the place of each of its targets in the text."""
    place, row, motion = _order(program)
    if not len(program):  # code that moves to computed targets, or to those of other files
        none, lost = np.zeros(len(row), np.bool_), np.full((len(row), 3), np.nan)
        return PathTargets(
            names=names, file=np.full(len(row), file), line=-row, left=~none,
            size=np.zeros(len(row)), joined=motion != Motion.PTP, home=none, place=lost,
        ), place  # fmt: skip
    known = np.maximum(row, 0)
    left = ~np.isin(status, (Status.COMPENSATED, Status.UNCHANGED_NO_ERROR))[known] | (row < 0)
    follows = (program.reason[known] == Reason.RELATIVE) & (row >= 0)
    language = languages().get(program.dialect)
    if language is None or not language.steps_from_command:
        follows[:] = False
    size = np.where(left, 0.0, np.linalg.norm(shift, axis=1)[known])
    reached = motion != Motion.PTP
    axes: BoolArray = np.asarray(np.isfinite(program.axes).any(axis=1))
    home = left & ~reached & axes[known] & (row >= 0)
    where = np.where((row < 0)[:, None], np.nan, _places(program)[known])
    path = PathTargets(
        names=names,
        file=np.full(len(row), file),
        line=np.where(row < 0, -row, program.line[known]),
        left=left,
        size=size,
        joined=reached,
        home=home,
        place=where,
    )
    return path.take(~follows), place[~follows]


def _order(program: Program) -> tuple[IntArray, IntArray, IntArray]:
    """Returns place, row and motion of the targets in the order they are moved to."""
    if len(program.path):
        return program.path[:, 0], program.path[:, 1], program.path[:, 2]
    row = np.flatnonzero(program.motion != Motion.UNUSED)
    return row, row, program.motion[row]


def _places(program: Program) -> Array:
    """Returns the targets (n, 3) m in the robot base, NaN for axis targets."""
    out = np.empty((len(program), 3))
    for frame in np.unique(program.frame).tolist():
        rows = program.frame == frame
        T = program.T_base_frame[frame]
        out[rows] = program.position[rows] @ T[:3, :3].T + T[:3, 3]
    return out


def _measure_path(path: PathTargets) -> Steps:
    joined, left = path.joined[1:], path.left
    far = np.nan_to_num(np.linalg.norm(np.diff(path.place, axis=0), axis=1)) * joined
    uneven = joined & (left[1:] != left[:-1]) & ~path.home[:-1]
    at = np.flatnonzero(uneven)
    size = path.size[at] + path.size[at + 1]
    both = far * ~(left[1:] | left[:-1])
    files = len(path.names)
    by_file = [np.bincount(path.file[1:], each, minlength=files).tolist() for each in (far, both)]

    def step(k: int) -> PathStep:
        row = int(at[k])
        odd = row if left[row] else row + 1
        return PathStep(path.where(row), path.where(row + 1), path.where(odd), float(size[k]))

    return Steps(
        count=len(at),
        first=tuple(step(k) for k in range(min(len(at), NAMED))),
        worst=step(int(np.argmax(size))) if len(at) else None,
        length=float(far.sum()),
        corrected=float(both.sum()),
        by_file=dict(zip(path.names, zip(*by_file, strict=True), strict=True)),
        # By index: a slice would keep the whole chunk alive.
        head=path.take(np.array([0])),
        tail=path.take(np.array([-1])),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class StepRule:
    """Permitted step between an unchanged target and its compensated neighbours.

    Attributes:
        max_mm: Largest step.
        allow: Write the program despite larger steps.
    """

    max_mm: float
    allow: bool = False

    def __post_init__(self) -> None:
        """Refuses an invalid limit.

        Raises:
            ConfigurationError: Below 0, or not finite.
        """
        if not 0.0 <= self.max_mm < math.inf:
            raise ConfigurationError(
                f"--max-step is {self.max_mm:g} mm, expected 0 or more.", hint="--max-step 0.1"
            )

    def require(self, steps: Steps, name: str) -> None:
        """Passes if the program may be written.

        Raises:
            StepError: A step beyond the limit, and steps are not allowed.
        """
        if self.allow or steps.worst is None or steps.largest <= self.max_mm * MM:
            return
        fault = StepError(
            f"{_count_sentence(steps)}, above {self.max_mm:g} mm; {_step_sentence(steps.worst)}. "
            "Nothing was written.",
            source=name,
            hint="--allow-steps; the notes list the reasons of uncompensated targets, with a "
            "remedy.",
        )
        fault.detail = {"steps": self.document(steps)}
        raise fault

    def document(self, steps: Steps) -> dict[str, object]:
        """Returns JSON values: the steps, and what is allowed."""
        return {**steps.document(), "limit_mm": self.max_mm, "allowed": self.allow}


def path_sentence(steps: Steps) -> str:
    """Returns the compensated share of the path; empty if all of it, or if there is none."""
    if not 0.0 <= steps.corrected < steps.length:
        return ""
    share = 100.0 * steps.corrected / steps.length
    return (
        f"{steps.corrected / MM:.1f} of {steps.length / MM:.1f} mm of the path "
        f"({share:.1f} %) lie between compensated targets"
    )


def steps_sentence(steps: Steps) -> str:
    """Returns the number of steps and the largest one; empty without any."""
    return (
        "" if steps.worst is None else f"{_count_sentence(steps)}; {_step_sentence(steps.worst)}."
    )


def _count_sentence(steps: Steps) -> str:
    size = f"{steps.largest / MM:.3f} mm"
    where = "in the path between uncompensated and compensated targets"
    if steps.count == 1:
        return f"1 step of {size} {where}"
    return f"{steps.count} steps {where}, the largest {size}"


def _step_sentence(step: PathStep) -> str:
    return f"from {step.before} to {step.after}, {step.left} is not compensated"
