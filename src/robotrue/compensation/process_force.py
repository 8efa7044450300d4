"""The process force of every target from a description: rules and tables, in one of three frames.

A part of a description gives a wrench in base axes, in tool axes, or in path axes (x the feed
across the tool axis, y to its left, z the tool axis from tip to spindle): milling forces turn with
the feed. All are forces **on the tool at the tool point**. Two parts that name the same target are
refused; a rule that names no lines holds where no other part does. Joint moves and rapids carry no
force. In a plunge (feed along the tool axis) the part of a path-axes force across the axis is left
out: it turns with the cutter and has no mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal, TypeAlias

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, FormatError
from robotrue.program.cut_path import CutPath, ProcessForce, cut_path
from robotrue.program.formats.stated_feeds import stated_feeds
from robotrue.program.program import Motion, Program

Axes: TypeAlias = Literal["base", "tool", "path"]
Key: TypeAlias = Literal["line", "target", "path_mm"]
FEEDING: tuple[Motion, ...] = (Motion.LIN, Motion.ARC_VIA, Motion.ARC_END, Motion.SPLINE)
_LONGER = 1.0 * MM  # of a table beyond the end of the path that is rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceRule(Columns):
    """One wrench for many targets, or a model of the process.

    Attributes:
        name: For messages.
        axes: What the wrench is written in.
        wrench: (6,) N, N m.
        model: What answers in its place, such as a model of milling; in base axes, by contract.
        lines: (k, 2) first and last line of ranges; empty: all that no other part names.
        motions: Kinds of move that cut.
        feeds: Lowest and highest feed m/s of the moves that cut; any if not given.
        program: File meant; empty for any.
    """

    name: str
    axes: Axes
    wrench: Annotated[Array, Column("6", unit="N, N m", fill=0.0)] = EMPTY
    model: ProcessForce | None = None
    lines: Annotated[IntArray, Column("_ 2")] = EMPTY
    motions: tuple[Motion, ...] = FEEDING
    feeds: tuple[float, float] | None = None
    program: str = ""

    @property
    def general(self) -> bool:
        """It names no lines."""
        return not len(self.lines)

    def claims(self, path: CutPath) -> BoolArray:
        """Returns (n,) the targets in the ranges that are reached by the kinds of move.

        Raises:
            ConfigurationError: A range without any cutting target, or a feed that is not known.
        """
        cutting = np.asarray(path.cutting & np.isin(path.motion, self.motions))
        if self.general:
            return self._of_feed(path, cutting)
        out = np.zeros(len(path), dtype=np.bool_)
        for first, last in self.lines.tolist():
            inside = cutting & (path.line >= first) & (path.line <= last)
            if not inside.any():
                raise ConfigurationError(
                    f"force {self.name!r}: no cutting target in lines {first} to {last} of "
                    f"{path.name}.",
                    hint="lines are those of the targets; see robotrue diff.",
                )
            out |= inside
        return self._of_feed(path, out)

    def _of_feed(self, path: CutPath, claimed: BoolArray) -> BoolArray:
        """Returns a mask of the claimed targets within the range of feeds."""
        if self.feeds is None:
            return claimed
        lost = np.flatnonzero(claimed & np.isnan(path.feed))
        if len(lost):
            raise ConfigurationError(
                f"force {self.name!r} is for a range of feeds, but that of line "
                f"{int(path.line[lost[0]])} of {path.name} is not stated where it could be read.",
                hint="name lines instead.",
            )
        low, high = self.feeds
        return np.asarray(claimed & (path.feed >= low) & (path.feed <= high))

    def values(self, path: CutPath, rows: IntArray) -> Array:
        """Returns (k, 6) N, N m: constant, or from the model."""
        if self.model is not None:
            return np.asarray(self.model.wrench(path)[rows])
        return np.tile(self.wrench, (len(rows), 1))


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceTable(Columns):
    """Wrenches by line, by target or by length of path.

    Attributes:
        name: For messages.
        axes: What the wrenches are written in.
        key: ``line`` and ``target`` (from 1, in file order) name targets; between ``path_mm`` the
            wrench is interpolated, before the first and after the last there is none.
        at: (k,) lines, target numbers or m of feeding path; growing for the last.
        wrench: (k, 6) N, N m.
        source: File it came from.
        rows: (k,) lines in that file.
        program: File of the targets; empty for any.
    """

    name: str
    axes: Axes
    key: Key
    at: Annotated[Array, Column("n")]
    wrench: Annotated[Array, Column("n 6", unit="N, N m")]
    source: str
    rows: Annotated[IntArray, Column("n")]
    program: str = ""

    def _check_rules(self) -> None:
        """Rejects a place that occurs twice, and a path that runs backwards."""
        if self.key == "path_mm":
            late = np.flatnonzero(np.diff(self.at) <= 0.0)
        else:
            order = np.argsort(self.at, kind="stable")
            late = order[1:][np.diff(self.at[order]) == 0.0] - 1
        if len(late):
            k = int(late[0]) + 1
            value = self.at[k] / (MM if self.key == "path_mm" else 1.0)
            raise FormatError(
                f"{self.key} {value:g} occurs again or decreases here.",
                source=self.source,
                line=int(self.rows[k]),
                hint="one row for each, path_mm growing.",
            )

    @property
    def general(self) -> bool:
        """Never: it names its targets."""
        return False

    def claims(self, path: CutPath) -> BoolArray:
        """Returns (n,) the targets that rows of the table name.

        Raises:
            FormatError: A row that names no target, a joint move with a force, or a path that is
                shorter than the table.
        """
        if self.key != "path_mm":
            out = np.zeros(len(path), dtype=np.bool_)
            out[self._find_rows(path)[0]] = True
            return out
        longest = float(np.nanmax(path.along, initial=0.0))
        if self.at[-1] > longest + _LONGER:
            raise FormatError(
                f"path_mm goes to {self.at[-1] / MM:.3f}, but the feeding moves of {path.name} are "
                f"{longest / MM:.3f} mm long.",
                source=self.source,
                line=int(self.rows[-1]),
                hint="path_mm counts straight moves, arcs and splines from the first target on.",
            )
        inside = (path.along >= self.at[0]) & (path.along <= self.at[-1] + _LONGER)
        return np.asarray(path.cutting & inside)

    def values(self, path: CutPath, rows: IntArray) -> Array:
        """Returns (k, 6) N, N m."""
        if self.key == "path_mm":
            along = path.along[rows]
            return np.stack([np.interp(along, self.at, f) for f in self.wrench.T], axis=1)
        out = np.zeros((len(path), 6))
        target, row = self._find_rows(path)
        out[target] = self.wrench[row]
        return out[rows]

    def _find_rows(self, path: CutPath) -> tuple[IntArray, IntArray]:
        """Targets that are named and feed, and the row of the table that names each."""
        place = path.line if self.key == "line" else np.arange(1, len(path) + 1)
        order = np.argsort(self.at, kind="stable")
        found = np.searchsorted(self.at[order], place)
        row = order[np.minimum(found, len(order) - 1)]
        named = np.asarray(self.at[row] == place)
        unknown = np.setdiff1d(np.arange(len(self.at)), row[named])
        if len(unknown):
            k = int(unknown[0])
            raise self._fault(path, k, "there is no such target")
        pushed = named & ~path.cutting & self.wrench[row].any(axis=1)
        if pushed.any():
            k = int(row[np.argmax(pushed)])
            raise self._fault(path, k, "it is reached by a joint move or a rapid, without cutting")
        target = np.flatnonzero(named & path.cutting)
        return target, row[target]

    def _fault(self, path: CutPath, row: int, why: str) -> FormatError:
        return FormatError(
            f"{self.key} {self.at[row]:g} of {path.name}: {why}.",
            source=self.source,
            line=int(self.rows[row]),
            hint="name targets of this program, or leave the row out.",
        )


Part: TypeAlias = ForceRule | ForceTable
"""One part of a description."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Use:
    """Range of lines to which a part of the description applies.

    Attributes:
        name: Of the part.
        targets: How many.
        first_line: Of the program.
        last_line: Likewise.
        force: (2,) N, smallest and largest.
    """

    name: str
    targets: int
    first_line: int
    last_line: int
    force: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class DescribedForce:
    """A whole description; a :class:`~robotrue.program.cut_path.ProcessForce`.

    Attributes:
        parts: Rules, tables, models.
        cutter: (3,) from spindle to tip in the tool frame.
    """

    parts: tuple[Part, ...]
    cutter: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))

    def wrench(self, path: CutPath) -> Array:
        """Returns (n, 6) N, N m on the tool, at the tool point, in base axes.

        Raises:
            ConfigurationError: Two parts that name the same target.
            FormatError: A table that does not fit the program.
        """
        return self.apply(path)[0]

    def apply(self, path: CutPath) -> tuple[Array, tuple[Use, ...]]:
        """Returns :meth:`wrench` and where each part was used.

        Raises:
            ConfigurationError: As :meth:`wrench`.
            FormatError: As :meth:`wrench`.
        """
        out, uses = np.zeros((len(path), 6)), []
        owner = self._owners(path)
        for k, part in enumerate(self.parts):
            rows = np.flatnonzero(owner == k)
            if not len(rows):
                continue
            out[rows] = in_base(part.values(path, rows), part.axes, path, rows)
            size = np.linalg.norm(out[rows, :3], axis=1)
            lines = path.line[rows]
            uses.append(
                Use(
                    name=part.name,
                    targets=len(rows),
                    first_line=int(lines.min()),
                    last_line=int(lines.max()),
                    force=(float(size.min()), float(size.max())),
                )
            )
        return out, tuple(uses)

    def _owners(self, path: CutPath) -> IntArray:
        """Number (n,) of the part that holds at each target, -1 for none."""
        owner = np.full(len(path), -1)
        order = sorted(range(len(self.parts)), key=lambda k: self.parts[k].general)
        for k in order:
            part = self.parts[k]
            if part.program and part.program != path.name:
                continue
            mine = part.claims(path)
            taken = owner >= 0
            if part.general:  # what others name is theirs; two general parts collide
                taken &= np.isin(owner, [j for j in order if self.parts[j].general])
                mine &= (owner < 0) | taken
            both = np.flatnonzero(mine & taken)
            if len(both):
                other = self.parts[int(owner[both[0]])].name
                raise ConfigurationError(
                    f"forces {other!r} and {part.name!r} both name line "
                    f"{int(path.line[both[0]])} of {path.name}.",
                    hint="give lines that do not overlap.",
                )
            owner[mine] = k
        return owner


def in_base(wrench: Array, axes: Axes, path: CutPath, rows: IntArray) -> Array:
    """Returns wrenches (k, 6) N, N m turned into base axes; zero where the pose is not known.

    Args:
        wrench: (k, 6) in ``axes``.
        axes: What it is written in.
        path: The targets.
        rows: (k,) which targets.
    """
    if axes == "base":
        return np.asarray(wrench)
    if axes == "tool":
        turn = path.T_base_tool[rows, :3, :3]
    else:
        turn = path.path_frames()[rows]
        axial = np.zeros_like(turn)
        axial[:, :, 2] = path.tool_axis[rows]
        turn = np.where(np.isnan(turn), axial, turn)
    out = np.concatenate(
        [(turn @ wrench[:, :3, None])[..., 0], (turn @ wrench[:, 3:, None])[..., 0]], axis=1
    )
    return np.asarray(np.where(np.isfinite(out).all(axis=1, keepdims=True), out, 0.0))


def require_one_file(force: DescribedForce, paths: Sequence[CutPath]) -> None:
    """Checks that parts which name lines or targets state the file, where a job has several.

    Raises:
        ConfigurationError: One does not, or names a file that is not in the job.
    """
    cutting = [path.name for path in paths if path.feeding.any()]
    for part in force.parts:
        if part.program and part.program not in [path.name for path in paths]:
            raise ConfigurationError(
                f"force {part.name!r} is for {part.program}, the job has "
                f"{', '.join(path.name for path in paths)}.",
                hint='program = "the file\'s name", or leave it out.',
            )
        if not part.general and not part.program and len(cutting) > 1:
            raise ConfigurationError(
                f"force {part.name!r} names places in a program, but {', '.join(cutting)} have "
                "targets.",
                hint=f'program = "{cutting[0]}".',
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedForce:
    """Process force on one program of a job.

    Attributes:
        wrench: (1, 6) or (n, 6) N, N m on the tool in base axes; empty if none was stated.
        uses: Which part of a description holds where.
    """

    wrench: Array = field(default_factory=lambda: np.empty(0))
    uses: tuple[Use, ...] = ()

    def document(self) -> list[dict[str, object]]:
        """Returns JSON values: every part, its targets, lines and sizes."""
        return [
            {
                "name": use.name,
                "targets": use.targets,
                "lines": [use.first_line, use.last_line],
                "force_N": {"min": use.force[0], "max": use.force[1]},
            }
            for use in self.uses
        ]

    def sentences(self) -> list[str]:
        """Returns one sentence for every part."""
        return [
            f"force {use.name!r}: {use.targets} targets in lines {use.first_line} to "
            f"{use.last_line}, {_newtons(use.force)} N"
            for use in self.uses
        ]


def note_rigid_model(force: StatedForce, model: ErrorModel | None) -> list[str]:
    """Returns a note if a force was stated and the model does not bend under any."""
    if not force.wrench.any() or (model is not None and not _rigid(model)):
        return []
    return [
        "the model has no compliance: the process force has no effect. Calibrate with "
        "--method elastic, ripple or gp."
    ]


def _rigid(model: ErrorModel) -> bool:
    tables = model.mean_tables()
    return tables is not None and not tables.robot.error("compliance").any()


def _newtons(size: tuple[float, float]) -> str:
    low, high = (f"{value:.4g}" for value in size)
    return high if low == high else f"{low} to {high}"


def state_forces(force: Array | DescribedForce, job: Sequence[Program]) -> list[StatedForce]:
    """Returns the force on every program of a job.

    Raises:
        ConfigurationError: A description that does not fit the job.
        FormatError: A table that does not fit its program.
    """
    if not isinstance(force, DescribedForce):
        return [StatedForce(wrench=force) for _ in job]
    carrying = [program.name for program in job if program.held.any()]
    if carrying:
        raise ConfigurationError(
            "the robot carries the part to the tool: a force along the path is not known there.",
            source=carrying[0],
            hint="--wrench, what the tool does to the part, in base axes.",
        )
    paths: list[CutPath] = [
        cut_path(program, cutter=force.cutter, feed=stated_feeds(program)) for program in job
    ]
    require_one_file(force, paths)
    found = [force.apply(path) for path in paths]
    if not any(uses for _, uses in found):
        raise ConfigurationError(
            "the force holds nowhere: no straight move, arc or spline to a known target.",
            hint="joint moves and rapids carry no force.",
        )
    return [StatedForce(wrench=wrench, uses=uses) for wrench, uses in found]
