"""A simulated drilling machine corrected by the patent and by ours: one move, a shifted zero."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, UM
from robotrue.drilling.campaign import Campaign
from robotrue.drilling.correction import fit_correction, residual_tilt
from robotrue.drilling.evaluate import evaluate_test
from robotrue.drilling.foot_model import NormalModel, estimate_tilt, fit_model
from robotrue.drilling.head import Head
from robotrue.drilling.production import record_of, update_model
from robotrue.errors import ObservabilityError
from robotrue.simulation.drilling_machine import (
    drilling_machine,
    random_campaign,
)

CLAMPS: Final = 120
FEW: Final = 15
TESTED: Final = 400
HEAD: Final = Head(p_pivot_tip=np.array([0.0, 0.0, -0.35]))
CASES: Final = (
    ("additive errors", False, False, CLAMPS),
    ("with nonlinearity", True, False, CLAMPS),
    ("with friction, one way of approach", True, True, CLAMPS),
    ("friction, 15 clamps", True, True, FEW),
)
SHIFT: Final = np.array([50.0, -50.0, 25.0]) * UM
SHIFTED_AT: Final = 400
HOLES: Final = 800
GAUGE: Final = 0.005 * DEG
"""rad, deviation of the gauge that measures every hole."""
SEED: Final = 1000
"""The machine of seed s is met by a random stream of this plus s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OneMove:
    """Tilt left by every method on one machine, rad, in the order of the test's clamps."""

    left: dict[str, Array]
    kind: str
    covered: float


def one_move(
    seed: int, *, nonlinear: bool, friction: bool, clamps: int, approach: str = ""
) -> OneMove:
    """Returns what each method leaves on the machine of a seed (simulated).

    ``ours`` is the correction that wins on held-out forces and tilts of the campaign.
    """
    machine = drilling_machine(seed, nonlinear=nonlinear, friction=friction)
    random = np.random.default_rng(SEED + seed)
    campaign = random_campaign(machine, clamps, random, approach=approach)
    test = random_campaign(machine, TESTED, random, held_out=True, approach=approach)
    left = {"none": residual_tilt(machine.foot, None, test)}
    for kind in ("patent", "interactions", "gp"):
        try:
            correction = fit_correction(kind, machine.foot, campaign)
        except ObservabilityError:
            continue
        left[kind] = residual_tilt(machine.foot, correction, test)
    model, _ = fit_model(machine.foot, HEAD, campaign)
    result = evaluate_test(model, test)
    left["ours"] = np.hypot(*result.left.T)
    return OneMove(left=left, kind=model.kind, covered=result.covered)


@dataclass(frozen=True, slots=True, kw_only=True)
class ShiftedProduction:
    """A production of 800 holes with a zero shift at hole 400.

    Attributes:
        left: (800,) rad of the refined model.
        stale: (800,) rad of the model as it was learned.
        delay: Holes from the shift to the alarm; infinite without one.
        false: Alarms before the shift.
    """

    left: Array
    stale: Array
    delay: float
    false: int


def production(seed: int) -> ShiftedProduction:
    """Returns the results of a model of 15 clamps with a gauge after every hole (simulated)."""
    machine = drilling_machine(seed, nonlinear=True, friction=True)
    shifted = replace(machine, offset=machine.offset + SHIFT)
    random = np.random.default_rng(SEED + seed)
    model, _ = fit_model(machine.foot, HEAD, random_campaign(machine, FEW, random))
    holes = [
        random_campaign(each, SHIFTED_AT, random, held_out=True) for each in (machine, shifted)
    ]
    stale = np.concatenate(
        [np.hypot(*(h.tilt - estimate_tilt(model, h.clamps).tilt).T) for h in holes]
    )
    left, alarms = [], []
    for k, each in enumerate(holes):
        model, part, found = _drill_holes(model, each, random)
        left.append(part)
        alarms += [k * SHIFTED_AT + i for i in found]
    late = [i - SHIFTED_AT + 1 for i in alarms if i >= SHIFTED_AT]
    return ShiftedProduction(
        left=np.concatenate(left),
        stale=stale,
        delay=float(late[0]) if late else np.inf,
        false=sum(i < SHIFTED_AT for i in alarms),
    )


def _drill_holes(
    model: NormalModel, holes: Campaign, random: np.random.Generator
) -> tuple[NormalModel, Array, list[int]]:
    left, alarms = np.empty(len(holes)), []
    for i in range(len(holes)):
        found = estimate_tilt(model, holes.clamps.take(np.array([i])))
        off = holes.tilt[i] - found.tilt[0]
        left[i] = np.hypot(*off)
        measured = off + random.normal(0.0, GAUGE, 2)
        record = record_of(str(i + 1), found, measured, "hole gauge")
        step = update_model(model, found, record, reference=GAUGE)
        model = step.model
        if step.alarm:
            alarms.append(i)
    return model, left, alarms
