"""How long a refinement remembers, and whether it is one: each reference predicted from the others.

With the residual tilts y_j of references j, their causes x_j and the refinement's prior, the
reference i is predicted by the posterior from all others, weighted by their distance in the record:

    w_j = forgetting^|i - j|,  w_i = 0.

The longest memory that no shorter one beats by more than the standard error of their difference is
used, if it surely beats no refinement.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG
from robotrue.drilling.reference_causes import ReferenceCause
from robotrue.drilling.refinement import Refinement, terms_of_cause
from robotrue.errors import ImplausibleDataError

FORGETTINGS: Final = (1.0, 0.99, 0.98, 0.95)
"""Tried; the effective memory is 1 / (1 - forgetting) references."""
FEWEST: Final = 8
"""References below which none of this can be told."""
SURE: Final = 2.0
"""Standard errors by which a refinement has to beat none, with many references; more with few."""
LARGE: Final = 10.0
"""Times the expected deviation above which references are reported as doubtful."""
IMPOSSIBLE: Final = 50.0
"""Times above which they are refused: 1 deg is 60 arc minutes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MemoryTrial:
    """How a refinement predicts references it has not seen.

    Attributes:
        forgetting: Weight of the past at each reference.
        rms: rad, of one tilt of the held-out references.
        gain: Reduction of the squared error against no refinement over its standard error.
    """

    forgetting: float
    rms: float
    gain: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MemoryChoice:
    """Which refinement the references support.

    Attributes:
        start: The state to refine from; None where no refinement is surely better.
        before: rad, rms of one tilt of the references without refinement.
        trials: What was tried, in the order of :data:`FORGETTINGS`; empty with too few references.
    """

    start: Refinement | None
    before: float
    trials: tuple[MemoryTrial, ...]


def choose_memory(
    state: Refinement, causes: Array, residual_tilt: Array, *, reference: float
) -> MemoryChoice:
    """Returns the memory that predicts held-out references best.

    Args:
        state: Before the references.
        causes: (n, 3) a and b in deg as the foot saw them, clamp force in kN.
        residual_tilt: (n, 2) rad, true tilt less that of the model with this state.
        reference: rad, deviation of the reference in each of a and b.
    """
    before = float(np.sqrt(np.mean(residual_tilt**2)))
    if len(causes) < FEWEST:
        return MemoryChoice(start=state, before=before, trials=())
    held: tuple[Refinement, MemoryTrial, Array] | None = None
    trials = []
    for forgetting in FORGETTINGS:
        start = replace(state, forgetting=forgetting)
        off = residual_tilt - _predict_each(start, causes, residual_tilt, reference)
        square = np.sum(off**2, axis=1)
        trial = MemoryTrial(
            forgetting=forgetting,
            rms=float(np.sqrt(np.mean(off**2))),
            gain=_gain_in_errors(np.sum(residual_tilt**2, axis=1), square),
        )
        trials.append(trial)
        if held is None or _gain_in_errors(held[2], square) > 1.0:
            held = start, trial, square
    needed = SURE * (1.0 + FEWEST / len(causes))
    chosen = held[0] if held is not None and held[1].gain > needed else None
    return MemoryChoice(start=chosen, before=before, trials=tuple(trials))


def _gain_in_errors(before: Array, after: Array) -> float:
    """Mean reduction of squared errors (n,) over its standard error."""
    gains = before - after
    error = float(np.std(gains, ddof=1) / np.sqrt(len(gains)))
    return float(np.mean(gains)) / max(error, 1e-30)


def _predict_each(state: Refinement, causes: Array, tilt: Array, reference: float) -> Array:
    """(n, 2) rad, each reference predicted from all others."""
    x = terms_of_cause(causes)
    noise = state.sigma**2 + reference**2
    prior = np.linalg.inv(state.covariance * state.sigma**2)
    row = np.arange(len(x))
    weight = state.forgetting ** np.abs(row[:, None] - row)
    np.fill_diagonal(weight, 0.0)
    information = prior + np.einsum("ij,jp,jq->ipq", weight, x, x) / noise
    seen = np.einsum("ij,jp,jk->ipk", weight, x, tilt) / noise
    return np.asarray(np.einsum("ip,ipk->ik", x, np.linalg.solve(information, seen)))


def check_references(
    residual_tilt: Array, deviation: Array, source: str, cause: ReferenceCause | None = None
) -> str:
    """Returns a warning of references far larger than the model expects, or "".

    Args:
        residual_tilt: (n, 2) rad.
        deviation: (n, 2) rad, expected of model and reference.
        source: File of the references.
        cause: What would explain them, if anything does.

    Raises:
        ImplausibleDataError: So large that they are no residuals of this model in degrees.
    """
    stated, expected = (float(np.sqrt(np.mean(v**2))) for v in (residual_tilt, deviation))
    said = (
        f"the references are {stated / DEG:.4f} deg rms, {expected / DEG:.4f} deg are expected of "
        "model and reference"
    )
    hint = (
        "left_a_deg and left_b_deg in degrees (not mrad or arc minutes), true normal less spindle "
        "axis, of holes that MODEL moved; after a collision `drill zero`."
    )
    if cause is not None:
        said += f"; {cause.rms / DEG:.4f} deg if {cause.said}"
        hint = cause.hint
    if stated > IMPOSSIBLE * expected:
        raise ImplausibleDataError(f"{said}.", source=source, hint=hint)
    return f"{said}. Try: {hint}" if stated > LARGE * expected else ""
