"""What a compensation is summed up to, also when it is made in parts.

Counts, largest values and lines are those of the whole program; a mean is that of the whole to
rounding, since a sum of sums is.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from robotrue.compensation.chunks import Outcome
from robotrue.compensation.row_notes import RowNote, merged
from robotrue.compensation.stance import Stance
from robotrue.compensation.status import Status
from robotrue.compensation.steps import Steps, joined, steps_of
from robotrue.core.arrays import Array, IntArray
from robotrue.core.units import DEG, UM
from robotrue.program.program import Program

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
        sigma: Whether the last of them is known.
        notes: What is to be said of targets.
        stance: How the arm stands at the first target of the program, where it is among them.
        steps: Between targets left alone and compensated ones.
    """

    status: IntArray
    total: Array
    largest: Array
    sigma: bool
    notes: tuple[RowNote, ...]
    steps: Steps
    stance: Stance | None = None

    def summary(self) -> Mapping[str, Any]:
        """Returns JSON values, as :meth:`robotrue.compensation.result.Compensation.summary`."""
        done = int(self.status[Status.COMPENSATED])
        count = int(self.status.sum())
        out: dict[str, Any] = {
            "targets": count,
            "compensated": done,
            "unchanged": count - done,
            "status": {s.name.lower(): int(self.status[s]) for s in Status if self.status[s]},
        }
        for name, total, largest in zip(
            SIZES, self.total.tolist(), self.largest.tolist(), strict=True
        ):
            if name != SIZES[-1] or self.sigma:
                out[name] = {"mean": total / done, "max": largest} if done else None
        if self.stance is not None:
            out["configuration"] = self.stance.document()
        return {**out, "notes": [str(note) for note in self.notes]}


def tally(
    program: Program,
    outcome: Outcome,
    notes: tuple[RowNote, ...],
    stance: Stance | None = None,
) -> Tally:
    """Returns the sums over the targets of a program from their outcome."""
    done = outcome.status == Status.COMPENSATED
    sizes = [
        np.linalg.norm(outcome.before[done], axis=1) / UM,
        np.linalg.norm(outcome.after[done], axis=1) / UM,
        np.linalg.norm(outcome.shift[done], axis=1) / UM,
        outcome.turn[done] / DEG,
        np.zeros(0),
    ]
    known = len(outcome.covariance) > 0
    if known:
        sizes[-1] = np.sqrt(np.trace(outcome.covariance[done], axis1=1, axis2=2)) / UM
    return Tally(
        status=np.bincount(outcome.status, minlength=len(Status)).astype(np.int64),
        total=np.array([size.sum() for size in sizes]),
        largest=np.array([size.max(initial=0.0) for size in sizes]),
        sigma=known,
        notes=notes,
        stance=stance,
        steps=steps_of([(program, outcome.status, outcome.shift)]),
    )


def summed(parts: Iterable[Tally]) -> Tally:
    """Returns the sums over all parts of a program, given in file order."""
    status = np.zeros(len(Status), np.int64)
    total, largest, sigma = np.zeros(len(SIZES)), np.zeros(len(SIZES)), False
    notes: tuple[RowNote, ...] = ()
    stance = None
    steps = Steps()
    for part in parts:
        status += part.status
        total += part.total
        largest = np.maximum(largest, part.largest)
        sigma |= part.sigma
        notes = merged([*notes, *part.notes])
        stance = stance or part.stance
        steps = joined([steps, part.steps])
    return Tally(
        status=status,
        total=total,
        largest=largest,
        sigma=sigma,
        notes=notes,
        steps=steps,
        stance=stance,
    )
