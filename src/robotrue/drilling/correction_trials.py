"""Choice of a correction: each is tried on held-out forces, tilts and positions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, get_args

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.progress import Progress, unheard
from robotrue.drilling.campaign import Campaign, conditions
from robotrue.drilling.correction import correct_readings, fit_correction, residual_tilt
from robotrue.drilling.drill_defaults import CORRECTS, Corrects, Inputs, Kind, Position
from robotrue.drilling.foot import Foot
from robotrue.errors import ObservabilityError

KINDS: Final[tuple[Kind, ...]] = get_args(Kind)
"""From the simplest to the richest."""
LEVELS: Final = 5
"""Blocks of force where the campaign does not keep to fewer levels."""
SECTORS: Final = 4
"""Blocks of tilt, by its direction."""
THIRDS: Final = 3
"""Blocks of each machine position."""
UNEXPLAINED: Final = 0.2
"""Share of a position's deviation that tilt, force, height and the other positions must leave."""
FARTHEST: Final = 16.0
"""Squared distance one held-out clamp may count: outliers alone do not widen all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """Held-out result of a correction.

    Attributes:
        kind: Which correction.
        residual: (m,) rad, tilt left at every held-out clamp, forces first, then tilts; empty
            where it could not be learned.
        distance: (j,) squared Mahalanobis distance of the truth where tilts were held out.
        reason: Why not, or "".
        inputs: Machine positions among its causes.
    """

    kind: Kind
    residual: Array
    distance: Array
    reason: str = ""
    inputs: tuple[Position, ...] = ()

    @property
    def mean(self) -> float:
        """Mean tilt left, rad; infinite where it could not be learned."""
        return float(np.mean(self.residual)) if len(self.residual) else float("inf")

    @property
    def stretch(self) -> float:
        """Factor on the covariance that makes the mean distance that of a normal one: 1 to 4."""
        if not len(self.distance):
            return 1.0
        return float(np.clip(np.mean(np.minimum(self.distance, FARTHEST)) / 2.0, 1.0, 4.0))


def held_out_blocks(foot: Foot, campaign: Campaign) -> tuple[list[BoolArray], list[BoolArray]]:
    """Returns the rows (n,) of each block to hold out: every force, and every sector of tilt.

    With the sectors come thirds of each machine position that varies by itself.
    """
    force = campaign.clamps.force
    levels = np.unique(np.round(force, 0))
    if len(levels) > LEVELS:
        edges = np.quantile(force, np.linspace(0.0, 1.0, LEVELS + 1)[1:-1])
        level = np.searchsorted(edges, force)
    else:
        level = np.searchsorted(levels, np.round(force, 0))
    seen = conditions(foot, campaign.order, campaign.clamps)
    turn = np.arctan2(seen.b - np.median(seen.b), seen.a - np.median(seen.a))
    sector = np.floor((turn + np.pi) / (2.0 * np.pi) * SECTORS).astype(int) % SECTORS
    forces = [level == k for k in np.unique(level)] if len(np.unique(level)) > 1 else []
    sectors = [sector == k for k in np.unique(sector)]
    for name in usable_positions(foot, campaign)[0]:
        values = seen.positions((name,))[:, 0]
        third = np.searchsorted(np.quantile(values, [1.0 / THIRDS, 2.0 / THIRDS]), values)
        sectors += [third == k for k in np.unique(third)]
    return forces, sectors


def usable_positions(foot: Foot, campaign: Campaign) -> tuple[tuple[Position, ...], dict[str, str]]:
    """Returns the machine positions that a campaign separates from other causes, and why not.

    The second value has a reason for each that is recorded but does not vary by itself.
    """
    c = conditions(foot, campaign.order, campaign.clamps)
    usable: list[Position] = []
    reasons: dict[str, str] = {}
    for name in get_args(Position):
        values = {"X": c.x, "Y": c.y, "A": c.axis_a, "B": c.axis_b}[name]
        if not np.isfinite(values).all():
            continue
        others = np.column_stack([np.ones(len(c)), c.table, c.positions(tuple(usable))])
        left = values - others @ np.linalg.lstsq(others, values, rcond=None)[0]
        own, spread = float(np.std(left)), float(np.std(values))
        if spread < 1e-6:
            reasons[name] = f"{name} is the same at every clamp"
        elif own < UNEXPLAINED * spread:
            reasons[name] = (
                f"{100.0 * (1.0 - own / spread):.0f} % of the deviation of {name} follows from "
                "tilt, force, height and the other positions"
            )
        else:
            usable.append(name)
    return tuple(usable), reasons


def cross_validate(
    kind: Kind,
    foot: Foot,
    campaign: Campaign,
    *,
    inputs: tuple[Position, ...] = (),
    corrects: Corrects = CORRECTS,
) -> Trial:
    """Returns how a correction does on every block when it is learned from the others."""
    forces, sectors = held_out_blocks(foot, campaign)
    left, distance = [], []
    for k, block in enumerate([*forces, *sectors]):
        try:
            learned = fit_correction(
                kind, foot, campaign.take(~block), inputs=inputs, corrects=corrects
            )
        except ObservabilityError as cause:
            nothing, reason = np.empty(0), cause.message
            return Trial(
                kind=kind, residual=nothing, distance=nothing, reason=reason, inputs=inputs
            )
        held = campaign.take(block)
        left.append(residual_tilt(foot, learned, held))
        if k >= len(forces):
            found = correct_readings(foot, campaign.order, learned, held.clamps)
            distance.append(squared_distance(found.tilt - held.tilt, found.covariance))
    return Trial(
        kind=kind,
        residual=np.concatenate(left),
        distance=np.concatenate(distance),
        inputs=inputs,
    )


def squared_distance(off: Array, covariance: Array) -> Array:
    """Returns the squared Mahalanobis distance (n,) of tilts off (n, 2) by (n, 2, 2)."""
    solved = np.linalg.solve(covariance, off[..., None])[..., 0]
    out: Array = np.einsum("ni,ni->n", off, solved)
    return out


def choose_trial(trials: tuple[Trial, ...]) -> Trial:
    """Returns the trial of the simplest correction that no richer one beats by more than chance.

    From the simplest on, a richer one takes the place of the one held when its mean is lower by
    more than the standard error of their difference, clamp by clamp.

    Raises:
        ObservabilityError: None could be learned.
    """
    able = [trial for trial in trials if len(trial.residual)]
    if not able:
        raise ObservabilityError(
            f"no correction can be learned: {trials[0].reason}",
            hint="clamp at least 15 times, with different tilts, forces and heights.",
        )
    held = able[0]
    for trial in able[1:]:
        gain = held.residual - trial.residual
        if np.mean(gain) > np.std(gain) / np.sqrt(len(gain)):
            held = trial
    return held


def choose_inputs(
    foot: Foot, campaign: Campaign, *, corrects: Corrects = CORRECTS
) -> tuple[Trial, ...]:
    """Returns the trials of machine positions as causes, none first; empty if none is determined.

    The regression with interactions tries them, the patent's where the clamps are too few for it:
    a position that counts shows in every correction. :func:`choose_trial` picks from them.

    Args:
        foot: The sensors.
        campaign: Clamps with known tilts.
        corrects: Readings, or the targets of A and B.
    """
    usable, _ = usable_positions(foot, campaign)
    sets: list[tuple[Position, ...]] = [(), *(select_inputs(s, usable) for s in ("AB", "XY"))]
    sets.append(usable)
    sets = list(dict.fromkeys(sets))
    if len(sets) == 1:
        return ()
    for kind in ("interactions", "patent"):
        trials = tuple(
            cross_validate(kind, foot, campaign, inputs=each, corrects=corrects) for each in sets
        )
        if len(trials[0].residual):
            break
    return trials


def select_inputs(names: str, usable: tuple[Position, ...]) -> tuple[Position, ...]:
    """Returns the usable positions that are named, such as A and B of ``"AB"``."""
    return tuple(name for name in usable if name in names)


def resolve_inputs(
    inputs: Inputs, foot: Foot, campaign: Campaign, *, corrects: Corrects = CORRECTS
) -> tuple[tuple[Position, ...], tuple[Trial, ...]]:
    """Returns the positions a fit uses, and the trials they were chosen by; empty if they were not.

    Args:
        inputs: As requested; with ``"auto"`` those that win on held-out blocks.
        foot: The sensors.
        campaign: Clamps with known tilts.
        corrects: Readings, or the targets of A and B.

    Raises:
        ObservabilityError: As :func:`require_inputs`.
    """
    if inputs == "none":
        return (), ()
    if inputs != "auto":
        return require_inputs(inputs, foot, campaign), ()
    trials = choose_inputs(foot, campaign, corrects=corrects)
    able = any(len(trial.residual) for trial in trials)
    return (choose_trial(trials).inputs if able else ()), trials


def require_inputs(names: str, foot: Foot, campaign: Campaign) -> tuple[Position, ...]:
    """Returns the positions that a user requires, as far as the campaign determines them.

    Raises:
        ObservabilityError: None of them is recorded, or varies by itself.
    """
    usable, reasons = usable_positions(foot, campaign)
    chosen = select_inputs(names, usable)
    if not chosen:
        said = "; ".join(reasons[name] for name in names if name in reasons)
        raise ObservabilityError(
            f"--inputs {names}: {said or 'the campaign does not record them'}.",
            source=campaign.source or None,
            hint="columns X_mm, Y_mm, axis_A_deg, axis_B_deg, and clamps on calibration planes "
            "with different directions or in different places.",
        )
    return chosen


def try_all(
    foot: Foot,
    campaign: Campaign,
    *,
    inputs: tuple[Position, ...] = (),
    corrects: Corrects = CORRECTS,
    step: Progress = unheard,
) -> tuple[Trial, ...]:
    """Returns the trial of every kind, the simplest first.

    Args:
        foot: The sensors.
        campaign: Clamps with known tilts.
        inputs: Machine positions among the causes.
        corrects: Readings, or the targets of A and B.
        step: Called with the kind on trial, the number done and the total.
    """
    trials = []
    for k, kind in enumerate(KINDS):
        step(kind, k, len(KINDS))
        trials.append(cross_validate(kind, foot, campaign, inputs=inputs, corrects=corrects))
    return tuple(trials)
