"""Assembly of the error model from the joint posterior of the linear model.

Parameters return to the robot, ripple and smooth weights to their tables, and the root of the
covariance to the columns of :class:`CalibratedModel`. The base gets the shift between two days,
which no row of one campaign can show.

A refit without some rows costs no more than solving the linear model again: the rows left out leave
the sums; scales, noise and weights are learned again from their initial values, not from those of
all rows: otherwise a scale retains a region that is left out (measured on a UR10: 0.18 mm instead
of 0.46 mm). As between held-out blocks, linearisation, robust weights, the bands of ripple in use
and the basis of the smooth residual are those of all rows. The width of a refit comes from the
held-out rows it still has.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.belief import Belief
from robotrue.calibration.calibrated_model import CalibratedModel, model_of
from robotrue.calibration.design import Design
from robotrue.calibration.estimate import Estimate
from robotrue.calibration.evidence import Sums, Weights
from robotrue.calibration.held_out_blocks import (
    HeldOutRows,
    count_freedom,
    label_blocks,
    learn_without,
    list_scales,
    sums_without,
    widen,
)
from robotrue.calibration.model import describe_rows
from robotrue.calibration.parameters import retract, station_as_base, target_as_tool
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.terms.ripple import Ripple, harmonics
from robotrue.calibration.terms.smooth import SmoothResidual
from robotrue.calibration.terms.term import Term
from robotrue.calibration.training_summary import describe_parameters
from robotrue.core.arrays import BoolArray, IntArray
from robotrue.robot.model import parameter_names, parameter_slice

LARGE_FACTOR: Final = 4.0
"""Factor on the covariance from which a model warns of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearFit:
    """A design, its sums and the weights they give."""

    design: Design
    sums: list[Sums]
    weights: Weights


LONG_CAMPAIGN: Final = 1000
"""Rows of a campaign so long that half of a day's shift is seen within it."""


def within_campaign(rows: int) -> float:
    """Returns the share of the variance between days that blocks of one campaign show already."""
    return rows / (rows + LONG_CAMPAIGN)


def day_shift(settings: FitSettings) -> float:
    """Returns the sd per axis in m between two days, each off the mean by ``campaign_shift``."""
    return float(np.sqrt(2.0)) * settings.campaign_shift


def assemble_model(
    physical: Estimate,
    at: LinearFit,
    held_out: HeldOutRows,
    settings: FitSettings,
    notes: dict[str, object],
) -> CalibratedModel:
    """Returns the error model of a joint posterior.

    Args:
        physical: The estimate it began with.
        at: Design, sums and posterior weights.
        held_out: Held-out blocks and the factor on the covariance.
        settings: Repeatability and the shift between days.
        notes: Further keys of the summary.
    """
    belief = _belief_of_fit(at, settings, held_out.inflation)
    classes = physical.identifiability.classes
    sd = np.sqrt(belief.variance[: len(belief.errors)])
    names = parameter_names(belief.robot.dof)
    kinds = [classes.get(name, "fixed") for name in names]
    parameters = describe_parameters(names, belief.errors, sd, kinds)
    summary = _summary(physical, at, held_out, belief.white, notes)
    return replace(model_of(belief, {**summary, "parameters": parameters}), held_out=held_out)


def _belief_of_fit(at: LinearFit, settings: FitSettings, inflation: float) -> Belief:
    """The posterior over the arm's columns; frames of stations and reflectors leave it."""
    design, fit = at.design, at.weights
    layout, covered = design.layout, np.flatnonzero(design.active)
    size = layout.size
    place = np.concatenate([design.free, size + np.arange(len(design.values))])[covered]
    mean = np.zeros(size + len(design.values))
    root = np.zeros((len(fit.root), len(mean)))
    mean[place], root[:, place] = fit.mean, fit.root
    step = np.zeros(size)
    step[design.free] = mean[design.free] - design.offset
    state = retract(layout, design.state, step)
    terms, kept = _model_terms(at, covered)
    errors = root[:, : layout.robot_size].copy()
    gauge, base = station_as_base(layout, state), parameter_slice(layout.dof, "base")
    if gauge is not None:
        errors[:, base] = root[:, gauge[0]] @ gauge[1].T
    arm = np.hstack([errors, root[:, size:][:, kept]])
    # The factor of the blocks does not apply to the base's shift between days.
    day = np.zeros((3, arm.shape[1]))
    day[np.arange(3), base.start + np.arange(3)] = day_shift(settings) / np.sqrt(inflation)
    reflectors = {
        k: (T, np.vstack([root[:, :size] @ target_as_tool(layout, k, T)[:3].T, np.zeros((3, 3))]))
        for k, T in state.T_flange_target.items()
    }
    return Belief(
        robot=state.robot.nominal(),
        terms=terms,
        mean=np.concatenate([state.robot.errors, mean[size:][kept]]),
        root=np.vstack([arm, day]),
        white=float(np.sqrt(max(design.white_noise(fit.noise)[0], 0.0))),
        repeatability=settings.repeatability_sd,
        inflation=inflation,
        T_tracker_base=state.T_tracker_base,
        reflectors=reflectors,
    )


def _model_terms(at: LinearFit, covered: IntArray) -> tuple[tuple[Term, ...], IntArray]:
    """The terms with ripple up to the highest cycle in use, and which parameters they keep."""
    design = at.design
    physical, place = len(design.free), design.place("ripple")
    used = covered[(covered >= place.start) & (covered < place.stop)] - place.start
    count = int(design.ripple.order[used].max(initial=0.0))
    shorter = Ripple(dof=design.layout.dof, cycles=harmonics(count))
    kept = np.ones(len(design.values), dtype=bool)
    kept[place.start - physical : place.stop - physical] = design.ripple.order <= count
    terms: list[Term] = []
    for term in design.terms:
        if isinstance(term, Ripple):
            terms.append(shorter)
        elif isinstance(term, SmoothResidual) and term.size:
            terms.append(replace(term, amplitude=at.weights.scale(term.name)))
        else:
            terms.append(term)
    return tuple(terms), np.flatnonzero(kept)


def _summary(
    physical: Estimate,
    at: LinearFit,
    held_out: HeldOutRows,
    white: float,
    notes: dict[str, object],
) -> dict[str, object]:
    fit = at.weights
    screened = np.flatnonzero(at.design.weights == 0.0)
    doubts = list(physical.verdict.doubts)
    idle = [
        j + 1
        for j in range(at.design.layout.dof)
        if at.design.ripple.size
        and not any(g.name.startswith(f"ripple/{j + 1}/") for g in fit.groups)
    ]
    if idle:
        doubts.append(
            f"joints {idle} show no ripple: there is none, or the reflector is on the axis."
        )
    if not any(np.any(o.visits.approach) for o in at.design.observations):
        doubts.append("the approach direction of no row is known: backlash was not estimated.")
    if at.design.smooth.size:
        doubts.append(
            "the smooth residual is that of the measured point; it is used for other tools, too."
        )
    doubts += warn_of_width(held_out)
    return {
        **notes,
        **describe_rows(physical.measurements),
        "screened_rows": [int(i) for i in screened],
        "verdict": physical.verdict.status,
        "doubts": doubts,
        "unseen": physical.identifiability.document(),
        "scales": fit.scales(),
        "determined": dict(zip([g.name for g in fit.groups], fit.determined.tolist(), strict=True)),
        "white_sd_m": white,
        "evidence": fit.evidence,
        **describe_width(held_out),
    }


def warn_of_width(held_out: HeldOutRows) -> list[str]:
    """Returns the warning of a width that held-out blocks needed, if it is large."""
    if held_out.inflation <= LARGE_FACTOR:
        return []
    return [
        f"held-out blocks deviate by more than the model expects (variance times "
        f"{held_out.inflation:.1f}): something drifts or is not modelled."
    ]


def describe_width(held_out: HeldOutRows) -> dict[str, object]:
    """Returns the summary of the rows held out and of the factor on the covariance."""
    return {
        "held_out_blocks_mean_m": held_out.mean,
        "held_out_blocks_coverage_before": replace(held_out, inflation=1.0).coverage,
        "covariance_factor": held_out.inflation,
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class WholeFit:
    """A learned fit of all rows.

    Attributes:
        physical: The estimate it began with.
        at: Design, sums and posterior weights.
        held_out: Every row predicted from the other blocks, with a factor of one.
        settings: Of the fit.
        notes: Further keys of the summary.
        base: The fit it was built on by adding a smooth residual; None if it was not.
    """

    physical: Estimate
    at: LinearFit
    held_out: HeldOutRows
    settings: FitSettings
    notes: Mapping[str, object]
    base: WholeFit | None = None

    def model(self) -> CalibratedModel:
        """Returns the error model."""
        return self._assemble(self.at, widen_covariance(self.at, self.held_out))

    def refit(self, left_out: BoolArray, begin: LinearFit | None = None) -> LinearFit:
        """Returns the linear fit of the rows that are not left out.

        Args:
            left_out: Mask over the rows of the fit.
            begin: The same refit of the base, whose scales learning starts from.
        """
        design = self.at.design
        others = sums_without(design, self.at.sums, left_out)
        known = None
        if begin is not None:
            known = list_scales(begin.sums, begin.weights, begin.design.physical)
        weights = learn_without(design, others, known).with_root()
        return LinearFit(design=design, sums=others, weights=weights)

    def held_out_block(self, left_out: BoolArray) -> HeldOutRows | None:
        """Returns the prediction of rows that are left out, if they are one of the blocks.

        As from :meth:`refit`, in base or tracker frame, with the width that the other blocks give
        and the whole shift between days; None for other rows.

        Args:
            left_out: Mask over the rows of the fit.
        """
        blocks, found = label_blocks(len(left_out)), self.held_out
        block = int(blocks[np.argmax(left_out)])
        if not found.fits or not np.array_equal(blocks == block, left_out):
            return None
        others = replace(found.part(~left_out), freedom=found.fits[block].freedom)
        rows = replace(found.part(left_out), inflation=widen(others).inflation)
        unseen = (1.0 - within_campaign(len(left_out))) * day_shift(self.settings) ** 2
        return replace(rows, instrument=rows.instrument + unseen * np.eye(3))

    def model_of(self, refit: LinearFit, left_out: BoolArray) -> CalibratedModel:
        """Returns the error model of a refit, with the width of its held-out rows."""
        kept = ~left_out
        design = replace(refit.design, weights=refit.design.weights[kept])
        known = widen_covariance(replace(refit, design=design), self.held_out.part(kept))
        return self._assemble(refit, known)

    def _assemble(self, at: LinearFit, held_out: HeldOutRows) -> CalibratedModel:
        return assemble_model(self.physical, at, held_out, self.settings, dict(self.notes))


def widen_covariance(at: LinearFit, found: HeldOutRows) -> HeldOutRows:
    """Returns the held-out rows with the factor that the covariance of the fit gets."""
    freedom = count_freedom(at.sums, at.weights, at.design.physical)
    return widen(replace(found, counted=at.design.weights > 0.0, freedom=freedom))
