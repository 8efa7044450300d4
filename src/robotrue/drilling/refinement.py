"""Refinement in production (step 8): recursive least squares on tilts of an outside reference.

The foot cannot see its own zero: readings taken again after a move agree with the correction that
made it, and learning from them drifts. Every record therefore names the instrument that measured
the residual tilt, which must not be the foot's own sensors.

    d_i = x_i' beta_i + noise,  x = (1, a, b, F),  for both tilts,
    P <- P / lambda after each record: older records count less.

The variance of the noise is that of the reference plus that of the corrected tilt.

A watch on the residuals separates a shifted zero from noise: two one-sided cumulative sums per
channel (Page, Biometrika 41 (1954)), in standard deviations::

    up <- max(0, up + z - k),  down <- max(0, down - z - k),  alarm where one exceeds h.

With k = 0.5 and h = 8 a channel of plain noise alarms once in some 10^4 records; a shift of two
deviations is seen after about six records. A correction learned from few clamps leaves larger
residuals than it predicts; a slow mean square of the scores then widens the deviation, and never
narrows it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.columns import EMPTY, Column, Columns
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
    "foot", "self", "own", "sensors", "reading", "readings", "pressure foot", "re-reading",
)  # fmt: skip
MEMORY: Final = 0.98
"""Weight of the past in the mean square of the scores."""
LARGEST: Final = 4.0
"""Deviations one record may count: an outlier alone raises no alarm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Remaining(Columns):
    """Residual tilt after one move, measured by an external reference.

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
                "measure its zero, and refining from its readings drifts.",
                hint="measure with a mandrel plane, a hole gauge or a tracker, and name it.",
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Refinement(Columns):
    """Refinement of a correction learned in production; by default, of no records.

    Attributes:
        coefficients: (4, 2) rad per unit of (1, a, b, F): tilt to be added to the corrected one.
        covariance: (4, 4) of a column over the square of ``sigma``.
        sigma: rad, deviation of what the correction leaves, without that of the reference.
        forgetting: Weight of the past at each record, above 0 and up to 1.
        records: Number used.
        truths: What measured them, each once.
    """

    coefficients: Annotated[Array, Column(f"{TERMS} 2", fill=0.0)] = EMPTY
    covariance: Annotated[Array, Column(f"{TERMS} {TERMS}")] = field(
        default_factory=lambda: np.diag(START**2)
    )
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
        x = terms_of_cause(cause)
        share = np.einsum("ij,jk,ik->i", x, self.covariance, x) * (self.records > 0)
        return x @ self.coefficients, self.sigma**2 * share


def update_refinement(state: Refinement, record: Remaining, *, reference: float) -> Refinement:
    """Returns the state after one more record, the Bayesian update of its coefficients.

    Args:
        state: Before it. The record's tilt is what remains *with* this state's own addition.
        record: What remained.
        reference: rad, deviation of the reference in each of a and b.
    """
    x = terms_of_cause(record.cause[None])[0]
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


def forget_constants(state: Refinement, *, shift: float = SHIFT) -> Refinement:
    """Returns the state with its constants less known: after an alarm, or with another zero.

    Args:
        state: Before it.
        shift: rad, standard deviation of what the constants may have changed by.
    """
    covariance = np.array(state.covariance)
    covariance[0, 0] += (shift / state.sigma) ** 2
    return replace(state, covariance=covariance)


def _forgotten(state: Refinement) -> Array:
    """(4, 4) covariance before a record; forgetting stops where it would exceed the start."""
    grown: Array = state.covariance / state.forgetting
    limit = WIDEST * START**2
    over = np.sqrt(np.minimum(1.0, np.maximum(limit, np.diag(state.covariance)) / np.diag(grown)))
    return np.asarray(grown * np.outer(over, over))


def terms_of_cause(cause: Array) -> Array:
    """Returns the terms (n, 4) 1, a, b, F of causes (n, 3)."""
    cause = np.atleast_2d(cause)
    if cause.shape[1] != TERMS - 1:
        raise ShapeError(f"causes have shape {cause.shape}, expected (n, 3).")
    return np.concatenate([np.ones((len(cause), 1)), cause], axis=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch(Columns):
    """Cumulative sums of the tilts a and b; without values, the initial state.

    Attributes:
        sums: (2, 2) upward and downward, in standard deviations.
        since: (2, 2) records since each was last zero: where the shift began.
        spread: (2,) slow mean square of the scores, not below 1.
        records: Number of records.
        allowance: k.
        limit: h.
    """

    sums: Annotated[Array, Column("2 2", fill=0.0)] = EMPTY
    since: Annotated[Array, Column("2 2", fill=0.0)] = EMPTY
    spread: Annotated[Array, Column("2", fill=1.0)] = EMPTY
    records: int = 0
    allowance: float = 0.5
    limit: float = 8.0

    def _check_rules(self) -> None:
        """Checks the values."""
        if not self.limit > 0.0 or not self.allowance >= 0.0:
            raise ConfigurationError("limit of a watch is above 0, its allowance not below 0.")

    @property
    def alarm(self) -> bool:
        """True if a cumulative sum exceeds its limit."""
        return bool((self.sums > self.limit).any())

    @property
    def shift(self) -> Array:
        """(2,) estimated shift in standard deviations, 0 where no sum is beyond its limit."""
        rate = self.sums / np.maximum(self.since, 1.0) + self.allowance
        out: Array = np.where(self.sums > self.limit, rate, 0.0)
        return np.asarray(out[0] - out[1])


def update_watch(state: Watch, score: Array) -> Watch:
    """Returns the watch after one more record.

    Args:
        state: The watch before it.
        score: (2,) residual over its predicted standard deviation.

    Raises:
        ShapeError: Not two numbers, or a residual that is not finite.
    """
    z = frozen(score, (2,), "score") / np.sqrt(state.spread)
    z = np.clip(z, -LARGEST, LARGEST)
    spread = np.maximum(state.spread * (MEMORY + (1.0 - MEMORY) * z**2), 1.0)
    sums = np.maximum(state.sums + np.stack([z, -z]) - state.allowance, 0.0)
    since = np.where(sums > 0.0, state.since + 1.0, 0.0)
    return replace(state, sums=sums, since=since, spread=spread, records=state.records + 1)
