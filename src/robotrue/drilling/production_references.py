"""Joint evaluation of production references: a common cause, and the length of the memory.

References far off the model point to exchanged sensors or to axes of the wrong sense. Others are
each predicted from the others: with the residual tilts y_j of references j, their causes x_j and
the refinement's prior, the reference i is predicted by the posterior from all others, weighted by
their distance in the record:

    w_j = forgetting^|i - j|,  w_i = 0.

The longest memory that no shorter one beats by more than the standard error of their difference is
used, if it surely beats no refinement.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG
from robotrue.drilling.campaign_csv import ProductionRecord
from robotrue.drilling.foot import exchanged_columns, sensor_orders
from robotrue.drilling.foot_model import NormalModel, estimate_tilt
from robotrue.drilling.refinement import Refinement, terms_of_cause
from robotrue.errors import ImplausibleDataError

FEWEST_FOR_CAUSE: Final = 4
"""References below which no cause is named: a few agree by chance."""
CLEAR: Final = 0.2
"""Share of the residual tilts that a cause must leave to be named."""
FORGETTINGS: Final = (1.0, 0.99, 0.98, 0.95)
"""Tried; the effective memory is 1 / (1 - forgetting) references."""
FEWEST: Final = 8
"""References below which none of this is determined."""
SURE: Final = 2.0
"""Standard errors by which a refinement has to beat none, with many references; more with few."""
LARGE: Final = 10.0
"""Times the expected deviation above which references are reported as questionable."""
IMPOSSIBLE: Final = 50.0
"""Times above which they are refused: 1 deg is 60 arc minutes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceCause:
    """Probable cause of references that are far off.

    Attributes:
        said: The cause, as a clause.
        hint: What to do.
        rms: rad, of one residual tilt if it is the cause.
    """

    said: str
    hint: str
    rms: float


def find_cause(model: NormalModel, holes: ProductionRecord) -> ReferenceCause | None:
    """Returns the one cause that explains references far off the model; None if none does.

    Args:
        model: Moved all holes.
        holes: With the residual tilts as the file states them.
    """
    if len(holes.hole) < FEWEST_FOR_CAUSE:
        return None
    stated = float(np.sqrt(np.mean(holes.left**2)))
    causes = [*_axis_causes(model, holes), *_sensor_causes(model, holes)]
    best = min(causes, key=lambda cause: cause.rms)
    return best if best.rms < CLEAR * stated else None


def _rms(tilt: Array) -> float:
    return float(np.sqrt(np.mean(tilt**2)))


def _axis_causes(model: NormalModel, holes: ProductionRecord) -> Iterator[ReferenceCause]:
    """The true tilt is what the head turned by plus what was left, however it turned."""
    tilt = estimate_tilt(model, holes.clamps).tilt
    turns = {
        "A turned the other way": tilt * [-1.0, 1.0],
        "B turned the other way": tilt * [1.0, -1.0],
        "A and B turned the other way": -tilt,
        "A and B were exchanged": tilt[:, ::-1],
    }
    for said, turned in turns.items():
        yield ReferenceCause(
            said=f"{said} than requested by the model",
            hint="[head] sense of the foot file, --foot-abc-deg of a robot, or the axes in the "
            "program; then move and measure again.",
            rms=_rms(holes.left + turned - tilt),
        )
    yield ReferenceCause(
        said="the references were measured before the move, or the head did not move",
        hint="measure after the move.",
        rms=_rms(holes.left - tilt),
    )


def _sensor_causes(model: NormalModel, holes: ProductionRecord) -> Iterator[ReferenceCause]:
    """Other orders of the columns, and one with the other sign."""
    truth = estimate_tilt(model, holes.clamps).tilt + holes.left
    sensors = len(model.foot.radius)
    stated = tuple(range(sensors))
    for k in stated:
        sign = np.where(np.arange(sensors) == k, -1.0, 1.0)
        yield ReferenceCause(
            said=f"sensor {k + 1} reads with the other sign",
            hint="turn the sign of its column, or its wiring.",
            rms=_rms(truth - _tilt_of(model, holes, holes.clamps.readings * sign)),
        )
    for order in sensor_orders(sensors):
        if order == stated:
            continue
        yield ReferenceCause(
            said=f"sensors are exchanged: {exchanged_columns(order)}",
            hint="exchange the columns, or the cables.",
            rms=_rms(truth - _tilt_of(model, holes, holes.clamps.readings[:, list(order)])),
        )


def _tilt_of(model: NormalModel, holes: ProductionRecord, readings: Array) -> Array:
    return estimate_tilt(model, replace(holes.clamps, readings=readings)).tilt


@dataclass(frozen=True, slots=True, kw_only=True)
class MemoryTrial:
    """Prediction error of a refinement on held-out references.

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
    """Refinement that the references support.

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
