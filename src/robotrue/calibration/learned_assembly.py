"""From the joint posterior of the linear model to the error model that is kept.

Parameters return to the robot, ripple and smooth weights to their tables, and the root of the
covariance to the columns of :class:`CalibratedModel`. The base gets the shift between two days,
which no row of one campaign can show.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robotrue.calibration.calibrated_model import CalibratedModel, reflector_of
from robotrue.calibration.design import Design
from robotrue.calibration.estimate import Estimate
from robotrue.calibration.evidence import Sums, Weights
from robotrue.calibration.held_out import HeldOut
from robotrue.calibration.lineage import describe_rows
from robotrue.calibration.parameters import retract, station_as_base, target_as_tool
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.terms.ripple import Ripple, harmonics
from robotrue.calibration.terms.smooth import SmoothResidual
from robotrue.calibration.terms.term import Term
from robotrue.core.arrays import Array, IntArray
from robotrue.robot.model import parameter_names, parameter_slice


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearFit:
    """A design, its sums and the weights they give."""

    design: Design
    sums: list[Sums]
    weights: Weights


def day_shift(settings: FitSettings) -> float:
    """Returns the sd per axis in m between two days, each off the mean by ``campaign_shift``."""
    return float(np.sqrt(2.0)) * settings.campaign_shift


def assemble_model(
    physical: Estimate,
    at: LinearFit,
    found: HeldOut,
    settings: FitSettings,
    notes: dict[str, Any],
) -> CalibratedModel:
    """Returns the error model of a joint posterior.

    Args:
        physical: The estimate it began with.
        at: Design, sums and posterior weights.
        found: Held-out blocks and the factor on the covariance.
        settings: Repeatability and the shift between days.
        notes: What the summary says besides.
    """
    design, fit = at.design, at.weights
    layout, dof, free = design.layout, design.layout.dof, len(design.free)
    full, covered = np.zeros(len(design.active)), np.flatnonzero(design.active)
    full[covered] = fit.mean
    step = np.zeros(layout.size)
    step[design.free] = full[:free] - design.offset
    state = retract(layout, design.state, step)
    terms, kept = _model_terms(at, covered)
    columns, picked = _model_columns(design, covered, kept)
    root = fit.root[:, picked]
    gauge = station_as_base(layout, state)
    if gauge is not None:
        parameter = design.free[covered[covered < free]]
        at_station = np.flatnonzero((parameter >= gauge[0].start) & (parameter < gauge[0].stop))
        root = np.hstack([root, fit.root[:, at_station] @ gauge[1].T])
        base = parameter_slice(dof, "base")
        columns = np.concatenate([columns, np.arange(base.start, base.stop)])
    targets = {
        k: fit.root[:, covered < free]
        @ target_as_tool(layout, k, T)[:3, design.free][:, covered[covered < free]].T
        for k, T in state.T_flange_target.items()
    }
    root, columns = _on_another_day(root, columns, dof, day_shift(settings), found.inflation)
    of_arm = columns < layout.robot_size
    arm = np.zeros((len(root), layout.robot_size))
    arm[:, columns[of_arm]] = root[:, of_arm]
    covariance = arm.T @ arm
    roots = {k: np.pad(r, ((0, len(root) - len(r)), (0, 0))) for k, r in targets.items()}
    white = float(np.sqrt(max(_white(design, fit), 0.0)))
    return CalibratedModel(
        robot=state.robot.nominal(),
        errors=state.robot.errors,
        covariance=covariance,
        repeatability=settings.repeatability_sd,
        white=white,
        T_tracker_base=state.T_tracker_base,
        reflectors={k: reflector_of(T, arm, roots[k]) for k, T in state.T_flange_target.items()},
        terms=terms,
        values=full[free:][kept],
        columns=columns.astype(np.float64),
        root=root,
        inflation=found.inflation,
        summary={
            **_summary(physical, at, found, white, notes),
            "parameters": {
                name: {
                    "value": float(state.robot.errors[k]),
                    "sd": float(np.sqrt(covariance[k, k])),
                    "class": physical.identifiability.classes.get(name, "fixed"),
                }
                for k, name in enumerate(parameter_names(dof))
            },
        },
    )


def _on_another_day(
    root: Array, columns: IntArray, dof: int, shift: float, inflation: float
) -> tuple[Array, IntArray]:
    """Adds the base's shift between days to the root; the factor of the blocks does not apply."""
    base = parameter_slice(dof, "base").start + np.arange(3)
    absent = np.setdiff1d(base, columns)
    columns = np.concatenate([columns, absent])
    root = np.hstack([root, np.zeros((len(root), len(absent)))])
    # A column may be named twice (a station that stands for the base): the last one speaks.
    place = [int(np.flatnonzero(columns == k)[-1]) for k in base]
    extra = np.zeros((3, root.shape[1]))
    extra[np.arange(3), place] = shift / np.sqrt(inflation)
    return np.vstack([root, extra]), columns


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


def _model_columns(design: Design, covered: IntArray, kept: IntArray) -> tuple[IntArray, IntArray]:
    """Where each active column stands in the model's own order, and which the model has."""
    size = design.layout.robot_size
    order = np.full(len(design.values), -1)
    order[kept] = size + np.arange(len(kept))
    parameter = np.where(design.free < size, design.free, -1)
    place = np.concatenate([parameter, order])[covered]
    picked = np.flatnonzero(place >= 0)
    return place[picked], picked


def _white(design: Design, fit: Weights) -> float:
    known = [item.instrument[:, :3, :3] for item in design.rows()]
    mean = float(np.trace(np.concatenate(known), axis1=1, axis2=2).mean()) / 3.0
    return float(fit.noise[0]) * (mean + float(design.noise[0])) - mean


def _summary(
    physical: Estimate,
    at: LinearFit,
    found: HeldOut,
    white: float,
    notes: dict[str, Any],
) -> dict[str, Any]:
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
            f"joints {idle} show no ripple here: there is none, or the reflector is on the axis."
        )
    if not any(np.any(o.visits.approach) for o in at.design.observations):
        doubts.append("the approach direction of no row is known: backlash was not learned.")
    if at.design.smooth.size:
        doubts.append("the smooth residual is that of the measured point; other tools inherit it.")
    if found.inflation > 4.0:
        doubts.append(
            f"held-out blocks are off by more than the model expects (variance times "
            f"{found.inflation:.1f}): something drifts or is not modelled."
        )
    return {
        **notes,
        **describe_rows(physical.measurements),
        "screened_rows": [int(i) for i in screened],
        "verdict": physical.verdict.status,
        "doubts": doubts,
        "unseen": physical.identifiability.document(),
        "scales": {g.name: g.sd for g in fit.groups},
        "determined": dict(zip([g.name for g in fit.groups], fit.determined.tolist(), strict=True)),
        "white_sd_m": white,
        "evidence": fit.evidence,
        "held_out_blocks_mean_m": found.mean,
        "held_out_blocks_coverage_before": replace(found, inflation=1.0).coverage,
        "covariance_factor": found.inflation,
    }
