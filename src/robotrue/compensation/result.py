"""The result of compensating a program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from robotrue.compensation.stance import Stance
from robotrue.compensation.status import Status
from robotrue.core.arrays import Array, IntArray
from robotrue.core.units import DEG, UM
from robotrue.core.words import NO_WORD
from robotrue.program.program import Program, Replacement


@dataclass(frozen=True, slots=True, kw_only=True)
class Compensation:
    """New targets, what became of each, and what the model expects.

    Attributes:
        replacement: For the dialect's writer.
        status: (n,) :class:`Status`.
        predicted_error_before: (n, 3) m, base, actual minus commanded if the program ran as it
            is; NaN where the target could not be evaluated.
        predicted_error_after: (n, 3) m, base, the same with the replacement; what the inversion
            left where compensated, the error before where not.
        shift: (n, 3) m, base, of the command; zero where unchanged.
        turn: (n,) rad, size of the rotation of the command; zero where unchanged.
        joints: (n, dof) rad the robot will be commanded to, model's sense; NaN where unknown.
        covariance: (n, 3, 3) m^2 of the position at the commanded joints; empty if not asked for.
        singular_value: (n,) see ``CompensationSettings.min_singular_value``; NaN where unknown.
        notes: One sentence each, with line numbers.
        stance: How the arm stands at the first target that it reaches; None if it reaches none.
    """

    replacement: Replacement
    status: IntArray
    predicted_error_before: Array
    predicted_error_after: Array
    shift: Array
    turn: Array
    joints: Array
    covariance: Array
    singular_value: Array
    notes: tuple[str, ...]
    stance: Stance | None = None

    def __post_init__(self) -> None:
        """Freezes the arrays; they were made for this object."""
        for name in (
            "status",
            "predicted_error_before",
            "predicted_error_after",
            "shift",
            "turn",
            "joints",
            "covariance",
            "singular_value",
        ):
            getattr(self, name).flags.writeable = False

    def counts(self) -> dict[str, int]:
        """Returns how many targets there are of each status, by lower-case name, zeros left out."""
        number = np.bincount(self.status, minlength=len(Status))
        return {s.name.lower(): int(number[s]) for s in Status if number[s]}

    def summary(self) -> Mapping[str, Any]:
        """Returns JSON values: counts, predicted error before and after, size of the correction."""
        done = self.status == Status.COMPENSATED
        out: dict[str, Any] = {
            "targets": len(self.status),
            "compensated": int(done.sum()),
            "unchanged": int((~done).sum()),
            "status": self.counts(),
            "predicted_error_before_um": _sizes(self.predicted_error_before[done], UM),
            "predicted_error_after_um": _sizes(self.predicted_error_after[done], UM),
            "correction_um": _sizes(self.shift[done], UM),
            "correction_deg": _sizes(self.turn[done, None], DEG),
            "notes": list(self.notes),
        }
        if self.stance is not None:
            out["configuration"] = self.stance.document()
        if len(self.covariance):
            sigma = np.sqrt(np.trace(self.covariance[done], axis1=1, axis2=2))
            out["predicted_sigma_um"] = _sizes(sigma[:, None], UM)
        return out


def _sizes(vectors: Array, unit: float) -> dict[str, float] | None:
    """Mean and largest length in ``unit``; None (null) without rows."""
    if not len(vectors):
        return None
    length = np.linalg.norm(vectors, axis=1) / unit
    return {"mean": float(length.mean()), "max": float(length.max())}


def unchanged(program: Program) -> Replacement:
    """Returns the replacement that rewrites nothing: the zero correction."""
    return Replacement(
        changed=np.zeros(len(program), dtype=np.bool_),
        position=program.position,
        rotation=program.rotation,
        axes=program.axes,
        words=np.full_like(program.words, NO_WORD),
    )
