"""The result of compensating a program, and its sums over whole programs or parts of them.

Counts, largest values and lines of summed parts are those of the whole program; a mean is that of
the whole to rounding, since a sum of sums is.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Final, Self, TypedDict

import numpy as np

from robotrue.compensation.stance import Stance
from robotrue.compensation.status import RowNote, Status, merge_notes
from robotrue.compensation.steps import NO_STEPS, Steps, join_steps, steps_of
from robotrue.core.arm_words import NO_WORD
from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns, Rows
from robotrue.core.units import DEG, UM
from robotrue.program.formats import list_unfollowed
from robotrue.program.language import Unfollowed
from robotrue.program.program import Program, Replacement

SIZES: Final = (
    "predicted_error_before_um",
    "predicted_error_after_um",
    "correction_um",
    "correction_deg",
    "predicted_sigma_um",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """Sums over some targets.

    Attributes:
        status: (number of statuses,) targets of each :class:`Status`.
        total: (5,) sums over the compensated targets, in the order and units of ``SIZES``.
        largest: (5,) largest values.
        sigma: Whether the last entry is known.
        notes: Notes on targets, by their lines.
        remarks: Further notes, one sentence each.
        stance: Stance of the arm at the first target of the program, if it is among these.
        steps: Between targets left alone and compensated ones.
        losses: What the written targets cannot hold of the new ones.
    """

    status: IntArray
    total: Array
    largest: Array
    sigma: bool
    notes: tuple[RowNote, ...]
    steps: Steps
    remarks: tuple[str, ...] = ()
    stance: Stance | None = None
    losses: tuple[Unfollowed, ...] = ()

    def counts(self) -> dict[str, int]:
        """Returns the number of targets of each status, by lower-case name, zeros left out."""
        return {s.name.lower(): int(self.status[s]) for s in Status if self.status[s]}

    def summary(self) -> Mapping[str, object]:
        """Returns JSON values: counts, predicted error before and after, size of the correction."""
        done = int(self.status[Status.COMPENSATED])
        count = int(self.status.sum())
        out: dict[str, object] = {
            "targets": count,
            "compensated": done,
            "unchanged": count - done,
            "status": self.counts(),
        }
        for name, total, largest in zip(
            SIZES, self.total.tolist(), self.largest.tolist(), strict=True
        ):
            if name != SIZES[-1] or self.sigma:
                out[name] = {"mean": total / done, "max": largest} if done else None
        if self.stance is not None:
            out["configuration"] = self.stance.document()
        return {**out, "notes": [*map(str, self.notes), *self.remarks, *map(str, self.losses)]}


def sum_tallies(parts: Iterable[Tally]) -> Tally:
    """Returns the sums over all parts of a program, given in file order."""
    status = np.zeros(len(Status), np.int64)
    total, largest, sigma = np.zeros(len(SIZES)), np.zeros(len(SIZES)), False
    notes: tuple[RowNote, ...] = ()
    remarks: dict[str, None] = {}
    stance, steps = None, NO_STEPS
    losses: dict[str, Unfollowed] = {}
    for part in parts:
        status += part.status
        total += part.total
        largest = np.maximum(largest, part.largest)
        sigma |= part.sigma
        notes = merge_notes([*notes, *part.notes])
        remarks |= dict.fromkeys(part.remarks)
        stance = stance or part.stance
        steps = join_steps([steps, part.steps])
        for loss in part.losses:
            before = losses.get(loss.text, replace(loss, count=0))
            worse = loss if loss.worst > before.worst else before
            losses[loss.text] = replace(worse, count=before.count + loss.count)
    return Tally(
        status=status,
        total=total,
        largest=largest,
        sigma=sigma,
        notes=notes,
        steps=steps,
        remarks=tuple(remarks),
        stance=stance,
        losses=tuple(losses.values()),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Compensation(Columns):
    """New targets, the status of each, and the errors predicted by the model.

    Attributes:
        replacement: For the dialect's writer.
        status: (n,) :class:`Status`.
        predicted_error_before: (n, 3) m, base, actual minus commanded if the program ran as it
            is; NaN where the target could not be evaluated.
        predicted_error_after: (n, 3) m, base, the same with the replacement; the residual of the
            inversion where compensated, the error before where not.
        shift: (n, 3) m, base, of the command; zero where unchanged.
        turn: (n,) rad, size of the rotation of the command; zero where unchanged.
        joints: (n, dof) rad the robot will be commanded to, model's sense; NaN where unknown.
        covariance: (n, 3, 3) m^2 of the position at the commanded joints; empty unless requested.
        singular_value: (n,) see ``CompensationSettings.min_singular_value``; NaN where unknown.
        row_notes: Notes on targets, by their lines.
        remarks: Further notes, one sentence each.
        stance: Stance of the arm at the first target that it reaches; None if it reaches none.
    """

    replacement: Annotated[Replacement, Column("n")]
    status: Annotated[IntArray, Column("n")]
    predicted_error_before: Annotated[Array, Column("n 3", unit="m", nan=True)]
    predicted_error_after: Annotated[Array, Column("n 3", unit="m", nan=True)]
    shift: Annotated[Array, Column("n 3", unit="m")]
    turn: Annotated[Array, Column("n", unit="rad")]
    joints: Annotated[Array, Column("n dof", unit="rad", nan=True)]
    covariance: Annotated[Array, Column("c 3 3", unit="m^2", nan=True)]
    singular_value: Annotated[Array, Column("n", nan=True)]
    row_notes: tuple[RowNote, ...] = ()
    remarks: tuple[str, ...] = ()
    stance: Stance | None = None

    def take(self, rows: Rows) -> Self:
        """Returns the compensation of some targets, in their order."""
        known = self.covariance[rows] if len(self.covariance) else self.covariance
        return replace(Columns.take(self, rows), covariance=known)

    @property
    def notes(self) -> tuple[str, ...]:
        """One sentence each, with line numbers."""
        return (*(str(note) for note in self.row_notes), *self.remarks)

    def tally(self, program: Program | None = None) -> Tally:
        """Returns the sums over the targets.

        Args:
            program: Of them; without it steps in its path and what cannot be written are not known.
        """
        done = self.status == Status.COMPENSATED
        sizes = [
            np.linalg.norm(self.predicted_error_before[done], axis=1) / UM,
            np.linalg.norm(self.predicted_error_after[done], axis=1) / UM,
            np.linalg.norm(self.shift[done], axis=1) / UM,
            self.turn[done] / DEG,
            np.zeros(0),
        ]
        if len(self.covariance):
            sizes[-1] = np.sqrt(np.trace(self.covariance[done], axis1=1, axis2=2)) / UM
        steps, losses = NO_STEPS, tuple[Unfollowed, ...]()
        if program is not None:
            steps = steps_of([(program, self.status, self.shift)])
            losses = list_unfollowed(program, self.replacement)
        return Tally(
            status=np.bincount(self.status, minlength=len(Status)).astype(np.int64),
            total=np.array([size.sum() for size in sizes]),
            largest=np.array([size.max(initial=0.0) for size in sizes]),
            sigma=len(self.covariance) > 0,
            notes=self.row_notes,
            steps=steps,
            remarks=self.remarks,
            stance=self.stance,
            losses=losses,
        )

    def counts(self) -> dict[str, int]:
        """Returns the number of targets of each status, by lower-case name, zeros left out."""
        return self.tally().counts()

    def summary(self) -> Mapping[str, object]:
        """Returns JSON values: counts, predicted error before and after, size of the correction."""
        return self.tally().summary()


def zero_correction(program: Program) -> Replacement:
    """Returns the replacement that rewrites nothing: the zero correction."""
    return Replacement(
        changed=np.zeros(len(program), dtype=np.bool_),
        position=program.position,
        rotation=program.rotation,
        axes=program.axes,
        words=np.full_like(program.words, NO_WORD),
    )


class MeanAndMax(TypedDict):
    """Size of some values, in the unit of its key."""

    mean: float
    max: float


def mean_and_max(values: Array) -> MeanAndMax | None:
    """Returns mean and largest of what is finite; None (null) without any."""
    known = values[np.isfinite(values)]
    return {"mean": float(known.mean()), "max": float(known.max())} if len(known) else None
