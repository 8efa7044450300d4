"""Fits the learned model: physics, ripple, backlash and smooth residual, jointly.

1. The rigid-flexible estimate gives the posture of linearisation, the priors and a robust start.
2. Ripple goes up a ladder of highest harmonics as long as the evidence grows.
3. Linearisation, robust weights and noise are renewed with the ripple in place.
4. The smooth residual is learned on what is left, and kept only where the joint evidence grows
   *and* held-out blocks of the training rows are predicted better with it. With many rows it is not
   fitted where parts left out at fixed scales gain nothing by it.
5. The covariance gets its factor from the same held-out blocks.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from typing import Final, TypeAlias

import numpy as np

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.design import Design, WhitenedRows
from robotrue.calibration.estimate import Estimate, estimate
from robotrue.calibration.evidence import Sums, posterior
from robotrue.calibration.held_out_blocks import (
    HeldOutRows,
    LearnedScales,
    predict_held_out,
)
from robotrue.calibration.learned_assembly import (
    LinearFit,
    WholeFit,
    day_shift,
    widen_covariance,
    within_campaign,
)
from robotrue.calibration.relinearisation import ROUNDS, renew_linearisation, settle_linearisation
from robotrue.calibration.scale_learning import learn
from robotrue.calibration.settings import FitSettings, free_groups
from robotrue.calibration.smooth_screen import add_smooth_columns, compare_left_out
from robotrue.calibration.terms.backlash import Backlash
from robotrue.calibration.terms.ripple import (
    LADDER,
    REST,
    START,
    Ripple,
    harmonics,
    highest_harmonic,
)
from robotrue.calibration.terms.smooth import (
    SmoothResidual,
    choose_centres,
    learn_smooth,
    no_basis,
)
from robotrue.calibration.terms.term_registry import further_terms
from robotrue.core.arrays import Array, BoolArray
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel

SAMPLE: Final = 500
"""Rows on which the lengths of the smooth residual are learned."""
MOST_CENTRES: Final = 200
ENOUGH: Final = 0.05
"""Share of the prior variance that may stay uncarried at a training pose."""
WORTH: Final = 3.0
"""Log evidence a richer model must gain: 20 to 1."""
LEAST_WEIGHT: Final = 0.01
"""Weight at the start of a row the physical fit has screened: its misfit may be ripple."""
UNSEEN: Final = 1e-5
"""Information on a coefficient, over that of its starting scale, below which it is left out."""
MANY_ROWS: Final = 200
"""Rows from which the ladder starts at its second rung, and each band has its own scale."""
FEWEST_SMOOTH: Final = 60
"""Rows below which a smooth residual cannot be separated from other errors; it is not tried."""
LADDER_STEPS: Final = 8
SEED: Final = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedParts:
    """Learned parts to try.

    Attributes:
        ripple: Joint ripple and backlash.
        smooth: The smooth residual.
        highest: Largest harmonic tried.
    """

    ripple: bool = True
    smooth: bool = True
    highest: int = LADDER[-1]


_Waves: TypeAlias = tuple[Estimate, LinearFit, HeldOutRows]
_Inputs: TypeAlias = tuple[RobotModel, MeasurementSet, FitSettings]


@dataclass(slots=True)
class _LastFit:
    """What fits of the same rows have in common: the elastic estimate and the fits with ripple."""

    inputs: _Inputs | None = None
    physical: Estimate | None = None
    waves: dict[tuple[bool, int], _Waves] = field(default_factory=dict)


_LAST_FIT: ContextVar[_LastFit | None] = ContextVar("last_fit", default=None)
"""Of the rows fitted last, within :func:`share_waves`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedMethod:
    """A calibration method with learned parts.

    Attributes:
        name: That the summary carries.
        parts: What is tried.
    """

    name: str
    parts: LearnedParts

    def __call__(
        self, robot: RobotModel, measurements: MeasurementSet, settings: FitSettings
    ) -> CalibratedModel:
        """Returns the learned model of the measurements.

        Args:
            robot: Nominal arm with the nominal reflector.
            measurements: Points or poses, in base or in tracker frames.
            settings: Loads, priors, robust rule.

        Raises:
            ObservabilityError: Too few measurements for the physical model.
            ImplausibleDataError: The measurements cannot belong to this robot.
            ConvergenceError: The physical estimate did not settle.
        """
        return self.fit_whole(robot, measurements, settings).model()

    def fit_whole(
        self,
        robot: RobotModel,
        measurements: MeasurementSet,
        settings: FitSettings,
        parts: Sequence[BoolArray] = (),
    ) -> WholeFit:
        """Returns the learned fit, ready to be refitted without some rows; as :meth:`__call__`.

        Args:
            robot: As in :meth:`__call__`.
            measurements: As in :meth:`__call__`.
            settings: As in :meth:`__call__`.
            parts: Masks over the rows, left out in turn to check whether a smooth
                residual predicts them better; five contiguous blocks if there are none.
        """
        physical, at, found = _fit_waves(robot, measurements, settings, self.parts)
        base = WholeFit(
            physical=physical,
            at=at,
            held_out=found,
            settings=settings,
            notes={"method": self.name, "smooth": "not tried"},
        )
        if not self.parts.smooth or len(measurements) < FEWEST_SMOOTH:
            return base
        richer, better, notes = _with_smooth(at, found, measurements, settings, parts)
        notes = {"method": self.name, **notes}
        if richer is at:
            return replace(base, notes=notes)
        return replace(base, at=richer, held_out=better, notes=notes, base=base)


@contextmanager
def share_waves() -> Iterator[None]:
    """Lets fits of the same rows share the elastic estimate, and all but the smooth residual.

    Of one set of rows at a time: that of the last fit.
    """
    token = _LAST_FIT.set(_LastFit())
    try:
        yield
    finally:
        _LAST_FIT.reset(token)


def estimate_elastic(
    robot: RobotModel, measurements: MeasurementSet, settings: FitSettings
) -> Estimate:
    """Returns the elastic estimate; within :func:`share_waves` made once for the same rows."""
    last = _find_last_fit((robot, measurements, settings))
    if last.physical is None:
        last.physical = estimate(robot, measurements, settings, free_groups("elastic"))
    return last.physical


def _find_last_fit(inputs: _Inputs) -> _LastFit:
    """State of the last fit, emptied where that had other inputs."""
    last = _LAST_FIT.get() or _LastFit()
    if last.inputs is None or not all(a is b for a, b in zip(last.inputs, inputs, strict=True)):
        last.inputs, last.physical, last.waves = inputs, None, {}
    return last


def _fit_waves(
    robot: RobotModel, measurements: MeasurementSet, settings: FitSettings, parts: LearnedParts
) -> _Waves:
    """The physical estimate, the fit with ripple, and its held-out blocks."""
    known = _find_last_fit((robot, measurements, settings)).waves
    chosen = (parts.ripple, parts.highest)
    if chosen not in known:
        physical = estimate_elastic(robot, measurements, settings)
        at = climb_ladder(first_design(physical, measurements, settings, parts), parts)
        for steps in ROUNDS:
            at = renew_linearisation(at, steps=steps)
        at = settle_linearisation(at)
        begin = None if at.design.few else ()
        known[chosen] = physical, at, _predict_blocks(at, settings, begin=begin)
    return known[chosen]


def first_design(
    physical: Estimate,
    measurements: MeasurementSet,
    settings: FitSettings,
    parts: LearnedParts,
) -> Design:
    """Returns the design at the physical estimate, with every harmonic the rows can carry."""
    found = physical.posterior
    nominal = found.state.robot.nominal()
    weights = np.zeros(len(measurements))
    for observation, u in zip(physical.observations, found.weights, strict=True):
        weights[observation.rows] = np.maximum(u, LEAST_WEIGHT)
    rows = len(measurements)
    few = rows < MANY_ROWS
    count = highest_harmonic(rows, few=few, most=parts.highest) if parts.ripple else 0
    further = [term.begin(nominal, measurements, few) for term in further_terms()]
    terms = (
        Ripple(dof=nominal.dof, cycles=harmonics(count)),
        Backlash(dof=nominal.dof),
        SmoothResidual(basis=no_basis(nominal.dof)),
        *(term for term in further if term is not None and parts.ripple),
    )
    design = Design(
        observations=physical.observations,
        layout=found.layout,
        prior=found.prior,
        state=found.state,
        noise=found.noise,
        weights=weights,
        loss=settings.solver.loss,
        terms=terms,
        values=np.zeros(sum(term.size for term in terms)),
        active=np.ones(0, dtype=bool),
        few=few,
    )
    active = np.ones(len(design.free) + len(design.values), dtype=bool)
    active[design.place("backlash")] = parts.ripple and bool((measurements.approach != 0.0).any())
    return replace(design, active=active)


def climb_ladder(design: Design, parts: LearnedParts) -> LinearFit:
    """Returns the fit with as many harmonics as the evidence asks for, idle bands put aside."""
    sums = design.sums()
    sighted = design.active.copy()
    sighted[design.active] = _find_sighted(design, sums)
    rungs = [h for h in LADDER if h <= len(design.ripple.cycles)] if parts.ripple else [0]
    if len(design.weights) >= MANY_ROWS:
        rungs = rungs[1:] or rungs
    best = _rung(design, sums, sighted, rungs[0], {})
    for rung in rungs[1:]:
        trial = _rung(design, sums, sighted, rung, best.weights.scales())
        if trial.weights.evidence < best.weights.evidence + WORTH:
            break
        best = trial
    return _without_idle(best)


def _rung(
    design: Design,
    sums: Sequence[Sums],
    sighted: BoolArray,
    rung: int,
    scales: dict[str, float],
) -> LinearFit:
    active = sighted & _up_to(design, rung)
    part = _part(sums, active[design.active])
    trial = replace(design, active=active)
    weights = learn(part, trial.groups(scales), np.ones(len(sums)), steps=LADDER_STEPS)
    return LinearFit(design=trial, sums=part, weights=weights)


def _find_sighted(design: Design, sums: Sequence[Sums]) -> BoolArray:
    """Returns a mask of active columns with information: no ripple of a joint without lever."""
    waves = design.place("ripple")
    covered = np.flatnonzero(design.active)
    seen = sum(s.power_by_column() for s in sums) * START**2
    wave = (covered >= waves.start) & (covered < waves.stop)
    return np.asarray(~wave | (np.asarray(seen) > UNSEEN))


def _up_to(design: Design, rung: int) -> BoolArray:
    keep = np.ones(len(design.active), dtype=bool)
    keep[design.place("ripple")] = design.ripple.order <= rung
    return keep


def _part(sums: Sequence[Sums], kept: BoolArray) -> list[Sums]:
    return list(sums) if kept.all() else [s.part(kept) for s in sums]


def _without_idle(at: LinearFit) -> LinearFit:
    """Removes the groups of terms that have fallen back to rest."""
    kept = np.ones(len(at.weights.mean), dtype=bool)
    physical = len(at.design.free)
    for group in at.weights.groups:
        rest = REST if group.hold else group.rest
        if group.columns[0] >= physical and group.sd <= 2.0 * rest:
            kept[group.columns] = False
    active = at.design.active.copy()
    active[np.flatnonzero(active)[~kept]] = False
    design = replace(at.design, active=active)
    sums = _part(at.sums, kept)
    weights = learn(sums, design.groups(at.weights.scales()), at.weights.noise, steps=3)
    return LinearFit(design=design, sums=sums, weights=weights)


def _predict_blocks(
    at: LinearFit,
    settings: FitSettings,
    kept: Sequence[WhitenedRows] | None = None,
    begin: Sequence[LearnedScales] | None = None,
) -> HeldOutRows:
    design = at.design
    uncarried = np.zeros(len(design.weights))
    if design.smooth.size:
        smooth = replace(design.smooth, amplitude=at.weights.scale("smooth"))
        for o in design.observations:
            effect = smooth.effect(design.state.robot, o.visits, np.zeros(smooth.size))
            uncarried[o.rows] = 0.0 if effect.uncarried is None else effect.uncarried
    return predict_held_out(
        design,
        at.sums,
        at.weights,
        uncarried,
        settings.repeatability_sd,
        kept=design.keep_rows() if kept is None else kept,
        shift=day_shift(settings) * float(np.sqrt(within_campaign(len(design.weights)))),
        begin=begin,
    )


def hold_out_physical(
    physical: Estimate, measurements: MeasurementSet, settings: FitSettings
) -> HeldOutRows:
    """Returns the rows predicted by the physical model from the other blocks, and its width."""
    parts = LearnedParts(ripple=False, smooth=False)
    design = first_design(physical, measurements, settings, parts)
    weights = np.zeros(len(measurements))
    for observation, u in zip(design.observations, physical.posterior.weights, strict=True):
        weights[observation.rows] = u
    design = replace(design, weights=weights)
    kept = design.keep_rows()
    sums = design.sums(kept=kept)
    fit = posterior(sums, design.groups({}), np.ones(len(sums))).with_root()
    at = LinearFit(design=design, sums=sums, weights=fit)
    return widen_covariance(at, _predict_blocks(at, replace(settings, campaign_shift=0.0), kept))


def _with_smooth(
    at: LinearFit,
    found: HeldOutRows,
    measurements: MeasurementSet,
    settings: FitSettings,
    parts: Sequence[BoolArray],
) -> tuple[LinearFit, HeldOutRows, dict[str, object]]:
    """Adds the smooth residual where it earns its place."""
    residual = _in_base(at, found.error, measurements)
    counted = np.flatnonzero(at.design.weights > 0.0)
    rng = np.random.default_rng(SEED)
    sample = np.sort(rng.choice(counted, min(SAMPLE, len(counted)), replace=False))
    scales = learn_smooth(measurements.joints[sample], residual[sample])
    notes: dict[str, object] = {
        "smooth_sample_rows": len(sample),
        "smooth_sample_gain": scales.gain,
        "smooth_sample_amplitude_m": scales.amplitude,
        "smooth_lengths": scales.length.tolist(),
    }
    if scales.gain < WORTH:
        return at, found, {**notes, "smooth": "no evidence for it"}
    basis = choose_centres(
        measurements.joints[counted], scales.length, most=MOST_CENTRES, enough=ENOUGH
    )
    design = at.design.with_centres(basis)
    kept = design.keep_rows()
    sums = add_smooth_columns(design, at.sums, kept)
    if not design.few and (
        screened := compare_left_out(design, sums, at.weights, scales.amplitude, parts, kept)
    ):
        notes["smooth_screen_without_m"], notes["smooth_screen_with_m"] = screened
        if screened[1] >= screened[0]:
            said = "not fitted: at given scales parts left out are no better with it"
            return at, found, {**notes, "smooth": said}
    del kept
    start = at.weights.scales() | {"smooth": scales.amplitude}
    weights = learn(sums, design.groups(start), at.weights.noise, steps=8)
    notes["smooth_evidence_gain"] = weights.evidence - at.weights.evidence
    if weights.evidence < at.weights.evidence + WORTH:
        return at, found, {**notes, "smooth": "no evidence for it beside the other terms"}
    richer = settle_linearisation(
        renew_linearisation(LinearFit(design=design, sums=sums, weights=weights), steps=ROUNDS[-1])
    )
    better = _predict_blocks(richer, settings, begin=found.fits or None)
    notes["held_out_mean_without_smooth_m"] = found.mean
    notes["held_out_mean_with_smooth_m"] = better.mean
    if better.mean >= found.mean:
        return at, found, {**notes, "smooth": "held-out blocks are no better with it"}
    return (
        richer,
        better,
        {**notes, "smooth": "kept", "smooth_centres": len(basis.centres)},
    )


def _in_base(at: LinearFit, error: Array, measurements: MeasurementSet) -> Array:
    """Held-out errors (n, 3) m in base: unlike fitted ones they keep what only a block has."""
    if measurements.frame == "base":
        return error
    poses = at.design.state.T_tracker_base
    turn = np.stack([poses[int(k)][:3, :3] for k in measurements.station])
    return np.asarray(np.einsum("nji,nj->ni", turn, error))
