"""Refinement in production (step 8): recursive least squares on what an outside reference measured.

The foot cannot see its own zero: readings taken again after a move agree with the correction that
made it, and learning from them drifts. Every record therefore names what measured the tilt that was
left, and the foot's own sensors are no such thing.

    d_i = x_i' beta_i + noise,  x = (1, a, b, F),  for both tilts,
    P <- P / lambda after each record: what was learned long ago counts less.

The variance of the noise is that of the reference plus that of what the correction leaves.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError, ShapeError

TERMS: Final = 4
FORGETTING: Final = 0.98
START: Final = np.array([1.0, 0.25, 0.25, 1.0])
"""Deviation of each coefficient before the first record over that of a record: per unit, per deg,
per kN. Production drifts by no more than what the correction leaves, until an alarm."""
SHIFT: Final = 0.1 * DEG
"""rad, deviation of a shifted zero."""
WIDEST: Final = 4.0
"""Variance never grows beyond this many times its start, however long nothing new is seen."""
OWN: Final = (
    "foot",
    "self",
    "own",
    "sensors",
    "reading",
    "readings",
    "pressure foot",
    "re-reading",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Remaining(Columns):
    """What one move left, as an outside reference measured it.

    Attributes:
        hole: Its number or name.
        tilt: (2,) rad, true tilt less the tilt that the model to be refined gives for this clamp,
            as (a, b). Where that model moved the hole, it is what the reference measured.
        cause: (3,) a and b in deg as the foot saw them before the move, clamp force in kN.
        truth: What measured it: a mandrel plane, a hole gauge, a tracker.
        provenance: Of clamp and reference: simulated or measured.
    """

    hole: str
    tilt: Annotated[Array, Column("2", unit="rad")]
    cause: Annotated[Array, Column("3")]
    truth: str
    provenance: Provenance = MEASURED

    def _check_rules(self) -> None:
        """Refuses the foot as its own reference.

        Raises:
            ConfigurationError: No source of truth, or the foot's own sensors.
        """
        name = " ".join(self.truth.split()).casefold()
        if not name or name in OWN:
            raise ConfigurationError(
                f"hole {self.hole}: {self.truth!r} is not an outside reference; the foot cannot "
                "see its own zero, and learning from its own readings drifts.",
                hint="measure with a mandrel plane, a hole gauge or a tracker, and name it.",
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Refinement(Columns):
    """What production has added to a correction.

    Attributes:
        coefficients: (4, 2) rad per unit of (1, a, b, F): tilt to be added to the corrected one.
        covariance: (4, 4) of a column over the square of ``sigma``.
        sigma: rad, deviation of what the correction leaves, without that of the reference.
        forgetting: Weight of the past at each record, above 0 and up to 1.
        records: How many were used.
        truths: What measured them, each once.
    """

    coefficients: Annotated[Array, Column(f"{TERMS} 2")] = field(
        default_factory=lambda: np.zeros((TERMS, 2))
    )
    covariance: Annotated[Array, Column(f"{TERMS} {TERMS}")]
    sigma: float
    forgetting: float = FORGETTING
    records: int = 0
    truths: tuple[str, ...] = ()

    def _check_rules(self) -> None:
        """Checks the values."""
        if not 0.0 < self.forgetting <= 1.0 or not self.sigma > 0.0:
            raise ConfigurationError(
                f"forgetting is {self.forgetting:g}, expected above 0 and up to 1; the deviation "
                f"of a record {self.sigma / DEG:g} deg, expected above 0."
            )

    def tilt(self, cause: Array) -> tuple[Array, Array]:
        """Returns the tilt (n, 2) rad to add and its variance (n,); none before the first record.

        Args:
            cause: (n, 3) a and b in deg as the foot sees them, clamp force in kN.
        """
        x = _row(cause)
        share = np.einsum("ij,jk,ik->i", x, self.covariance, x) * (self.records > 0)
        return x @ self.coefficients, self.sigma**2 * share


def refinement(sigma: float, *, forgetting: float = FORGETTING) -> Refinement:
    """Returns a refinement that has seen nothing.

    Args:
        sigma: rad, deviation of what the correction leaves.
        forgetting: Weight of the past at each record.
    """
    return Refinement(covariance=np.diag(START**2), sigma=sigma, forgetting=forgetting)


def update_refinement(state: Refinement, record: Remaining, *, reference: float) -> Refinement:
    """Returns the state after one more record, the Bayesian update of its coefficients.

    Args:
        state: Before it. The record's tilt is what remains *with* this state's own addition.
        record: What remained.
        reference: rad, deviation of the reference in each of a and b.
    """
    x = _row(record.cause[None])[0]
    prior = _forgotten(state)
    noise = 1.0 + (reference / state.sigma) ** 2
    gain = prior @ x / (noise + x @ prior @ x)
    covariance = prior - np.outer(gain, x @ prior)
    return replace(
        state,
        coefficients=state.coefficients + np.outer(gain, record.tilt),
        covariance=0.5 * (covariance + covariance.T),
        records=state.records + 1,
        truths=tuple(sorted({*state.truths, record.truth})),
    )


def forget_constants(state: Refinement) -> Refinement:
    """Returns the state with its constants unknown again: after an alarm of a shifted zero."""
    covariance = np.array(state.covariance)
    covariance[0, 0] += (SHIFT / state.sigma) ** 2
    return replace(state, covariance=covariance)


def _forgotten(state: Refinement) -> Array:
    """(4, 4) covariance before a record; forgetting stops where it would exceed the start."""
    grown: Array = state.covariance / state.forgetting
    limit = WIDEST * START**2
    over = np.sqrt(np.minimum(1.0, np.maximum(limit, np.diag(state.covariance)) / np.diag(grown)))
    return np.asarray(grown * np.outer(over, over))


def _row(cause: Array) -> Array:
    cause = np.atleast_2d(cause)
    if cause.shape[1] != TERMS - 1:
        raise ShapeError(f"causes have shape {cause.shape}, expected (n, 3).")
    return np.concatenate([np.ones((len(cause), 1)), cause], axis=1)
