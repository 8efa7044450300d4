"""Registration by the estimator: frames, tool point and arm in one posterior, from touches.

    T_part_base(f) tip(q; w) = p_part + noise         w ~ belief in the arm,   f ~ nothing known

The belief is that of a calibrated model, or the priors of a nominal arm (probing without a
tracker). Frames and arm stay correlated in the result: both are used together, and what probing and
machining have in common cancels.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.calibration.belief import (
    Belief,
    widen_tool,
    with_amplitude,
    with_tool,
)
from robotrue.calibration.drift_scales import Stack, stack_rows
from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel, require_belief
from robotrue.calibration.new_rows import NewRows, condition_on_rows
from robotrue.calibration.parameters import ParameterLayout, State
from robotrue.calibration.probing_estimate import (
    ProbingEstimate,
    ProbingSettings,
    model_of_estimate,
    probing_summary,
)
from robotrue.calibration.probing_start import check_held, start_frames, tips
from robotrue.calibration.settings import build_prior, free_groups, prior_belief
from robotrue.calibration.touches import (
    find_agreeing_touches,
    learn_scales,
    noise_factor,
    surprise,
    touch_rows,
)
from robotrue.calibration.update import carry_residual, update_model
from robotrue.core.arrays import Array, BoolArray, frozen
from robotrue.core.poses import inverse
from robotrue.errors import (
    ConfigurationError,
    ImplausibleDataError,
    ModelMismatchError,
    ObservabilityError,
)
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.probing_set import ProbingSet

__all__ = [
    "ProbingEstimate",
    "ProbingSettings",
    "before_touching",
    "estimate_probing",
    "model_of_estimate",
]

STEPS: Final = 30
IMPLAUSIBLE: Final = 10.0
"""Touches this many times further off than expected are not touches of this part by this arm."""
FEWEST_LEARNING: Final = 24
"""Numbers beyond those of the frames from which they determine scales."""
CROWD: Final = 0.15
FEW: Final = 0.05
NOISIER: Final = (2.0, 4.0)
"""Touches left out beyond the share ``CROWD`` are no outliers if noise that many times larger takes
all but ``FEW`` of them in: ``touch_sigma`` is then too small, and the noise is learned."""
ROUNDS: Final = 4
"""Times the touches are checked again where the estimate has moved."""
STILL: Final = 1e-7
"""m and rad: frames that move by less are at rest."""


def estimate_probing(
    model: ErrorModel,
    touches: ProbingSet,
    settings: ProbingSettings | None = None,
    *,
    measurements: MeasurementSet | None = None,
) -> ProbingEstimate:
    """Returns frames and arm from touches.

    Args:
        model: A calibrated model: its belief is what is known before the touches. A nominal one:
            only its type is known, from ``settings.priors`` (30 to 90 touches then calibrate it).
        touches: With the robot's joints.
        settings: Noise, tool, robustness.
        measurements: Points of a tracker on the model's own tool, added to the same estimate.

    Raises:
        ObservabilityError: Touches without joints, too few, on one line, or with a motion left
            free.
        ImplausibleDataError: Half the touches of a part or more disagree, or all lie far from
            what the arm can err; other units; a mirrored part.
        ModelMismatchError: Another number of joints.
        ConfigurationError: Another tool without ``tool_sigma``, or a model without covariance.
        ConvergenceError: No rest.

    Fails when: points are named in the wrong order in a pattern that fits so too; see the
    correspondence checks of :mod:`robotrue.cell.registration.ambiguity`.
    """
    settings = ProbingSettings() if settings is None else settings
    _check_joints(touches, model.robot.dof)
    if measurements is not None and len(measurements):
        if model.calibrated:
            model = update_model(model, measurements, settings=settings.priors)
        else:
            lean = replace(settings.priors, lean_on_prior=True)
            model = fit(model.robot, measurements, method="ripple", settings=lean)
    before = carry_residual(before_touching(model, settings), touches.joints)
    in_base = tips(before, touches.joints, settings.payload)
    frames = start_frames(touches, in_base, settings.start, robust=settings.robust)
    rows = touch_rows(
        before, touches, frames, touch_sigma=settings.touch_sigma, payload=settings.payload
    )
    prior = rows.prior(before)
    stated = _sigma(prior, settings)
    after, rows, keep = _condition_on_agreeing(prior, rows, touches, settings)
    stack = stack_rows(rows.pieces(after, keep))
    _check_plausible(surprise(stack, prior, prior.noise), touches)
    if settings.learn and len(stack.values) - rows.nuisances >= FEWEST_LEARNING:
        prior = _scale_prior(model, prior, stack, settings)
        after, rows, keep = _condition_on_agreeing(prior, rows, touches, settings)
    _check_still_held(touches, keep, in_base, rows)
    return _result(prior, after, rows, touches, keep, settings, model, stated)


def _check_still_held(touches: ProbingSet, keep: BoolArray, in_base: Array, rows: NewRows) -> None:
    """Checks that the accepted touches still determine every frame."""
    believed = keep[: len(touches)]
    for k, T in rows.T_tracker_base.items():
        if k not in touches.sockets:
            mine = np.flatnonzero((touches.part == k) & believed)
            check_held(touches, in_base, mine, inverse(T))


def _check_joints(touches: ProbingSet, dof: int) -> None:
    if not len(touches) or not touches.has_joints:
        raise ObservabilityError(
            f"{len(touches)} touches without the robot's joints: they hold no information about "
            "the arm.",
            source=touches.source or None,
            hint="give the joints of every touch, or fit the points alone.",
        )
    if touches.joints.shape[1] != dof:
        raise ModelMismatchError(
            f"touches have {touches.joints.shape[1]} joints, the robot has {dof}.",
            source=touches.source or None,
        )
    if min(touches.parts) < 0:
        raise ConfigurationError(f"part number {min(touches.parts)}, expected 0 or more.")


def before_touching(model: ErrorModel, settings: ProbingSettings) -> Belief:
    """Returns the belief in the arm before the touches, with the tool that touches.

    Raises:
        ConfigurationError: Another tool without ``tool_sigma``, or a model without covariance.
    """
    if not model.calibrated:
        scales = settings.priors.scales
        if settings.tool_sigma > 0.0:
            scales = replace(scales, tool=settings.tool_sigma)
        robot = model.robot
        if settings.T_flange_tool is not None:
            robot = robot.with_tool(settings.T_flange_tool)
        return prior_belief(robot, replace(settings.priors, scales=scales))
    belief = _work_in_inflation(require_belief(model))
    if settings.T_flange_tool is not None:
        if settings.tool_sigma <= 0.0:
            raise ConfigurationError(
                "the touches have a separate tool without a stated uncertainty.",
                hint="give tool_sigma; 1 mm is written tool_sigma=1e-3.",
            )
        # The smooth residual was learned at another point.
        white = float(np.hypot(belief.white, belief.smooth.amplitude))
        belief = replace(with_tool(belief, settings.T_flange_tool), white=white)
    return widen_tool(belief, settings.tool_sigma)


def _work_in_inflation(belief: Belief) -> Belief:
    """The same predictions with the factor on their covariance worked into its parts."""
    root = float(np.sqrt(belief.inflation))
    white = belief.inflation * belief.visit - belief.repeatability**2
    return replace(
        with_amplitude(belief, root * belief.smooth.amplitude),
        root=root * belief.root,
        white=float(np.sqrt(max(white, 0.0))),
        inflation=1.0,
    )


def _sigma(belief: Belief, settings: ProbingSettings) -> float:
    """Noise of one touch, m per axis."""
    return float(np.sqrt(settings.touch_sigma**2 + belief.visit))


def _condition(prior: Belief, rows: NewRows, keep: BoolArray) -> tuple[Belief, NewRows]:
    """Returns the posterior of the accepted rows, linearised at its mean, and the rows there."""
    trusted = keep.astype(np.float64)
    return condition_on_rows(prior, rows, prior.noise, trusted, steps=STEPS, still=STILL)


def _condition_on_agreeing(
    prior: Belief, rows: NewRows, touches: ProbingSet, settings: ProbingSettings
) -> tuple[Belief, NewRows, BoolArray]:
    """The posterior of the touches that agree, the rows moved there, and which they are."""
    keep = np.ones(rows.count, dtype=bool)
    at = prior
    if not settings.robust or not touches.full.all():
        # A surface must be seen from near before a touch on it can be called wrong.
        at, rows = _condition(prior, rows, keep)
    for _ in range(ROUNDS if settings.robust else 0):
        found = _check_majority(prior, at, rows, touches, settings)
        at, rows = _condition(prior, rows, found)
        if (found == keep).all():
            break
        keep = found
    return at, rows, keep


def _find_agreeing(
    prior: Belief, at: Belief, rows: NewRows, touches: ProbingSet, settings: ProbingSettings
) -> BoolArray:
    """Returns a mask of consistent touches; the noise may grow if the majority requires it."""
    n = len(touches)
    stack, noise = stack_rows(rows.pieces(at)), prior.noise
    found = find_agreeing_touches(stack, prior, noise, n)
    if not settings.learn or (~found).sum() <= CROWD * n or 3 * n < FEWEST_LEARNING:
        return found
    stated = settings.touch_sigma**2 + prior.repeatability**2
    for factor in NOISIER:
        wider = find_agreeing_touches(stack, prior, noise + (factor**2 - 1.0) * stated, n)
        if (~wider).sum() <= FEW * n:
            return wider
    return found


def _check_majority(
    prior: Belief, at: Belief, rows: NewRows, touches: ProbingSet, settings: ProbingSettings
) -> BoolArray:
    """Returns a mask of consistent rows.

    Raises:
        ImplausibleDataError: Half of a part's touches or more do not.
    """
    n = len(touches)
    found = _find_agreeing(prior, at, rows, touches, settings)
    labels = touches.labels
    for k in touches.parts:
        mine = np.flatnonzero(touches.part == k)
        wrong = [labels[i] for i in mine if not found[i]]
        if 2 * len(wrong) >= len(mine):
            raise ImplausibleDataError(
                f"{len(wrong)} of {len(mine)} touches of part {k} disagree with the others: "
                f"{', '.join(wrong[:8])}{', ...' if len(wrong) > 8 else ''}.",
                source=touches.source or None,
                hint="check names, units, joint signs, tool of the touches, and touch_sigma.",
            )
    keep = np.ones(rows.count, dtype=bool)
    keep[:n] = found
    return keep


def _check_plausible(found: float, touches: ProbingSet) -> None:
    """Passes touches that are roughly as far off as belief and noise let expect.

    Raises:
        ImplausibleDataError: They are not.
    """
    if found > IMPLAUSIBLE:
        raise ImplausibleDataError(
            f"the touches lie {found:.3g} times further from the prior of arm and part than "
            f"expected, at most {IMPLAUSIBLE:g} times is plausible.",
            source=touches.source or None,
            hint="check names, units, joint signs, the tool, and touch_sigma.",
        )


def _scale_prior(
    model: ErrorModel, prior: Belief, stack: Stack, settings: ProbingSettings
) -> Belief:
    """Returns the prior with scales and noise from the touches."""
    if not model.calibrated:
        physical = build_prior(
            ParameterLayout(dof=model.robot.dof),
            State(robot=model.robot),
            settings.priors.scales,
            free_groups=free_groups("elastic"),
            stiffness=settings.priors.stiffness,
        )
        prior, factor = learn_scales(prior, stack, prior.noise, physical)
    else:
        factor = noise_factor(prior, stack, prior.noise)
    more = (factor - 1.0) * _sigma(prior, settings) ** 2
    return replace(prior, white=float(np.sqrt(prior.white**2 + more)))


def _result(
    prior: Belief,
    after: Belief,
    rows: NewRows,
    touches: ProbingSet,
    keep: BoolArray,
    settings: ProbingSettings,
    model: ErrorModel,
    stated: float,
) -> ProbingEstimate:
    n, sigma = len(touches), _sigma(after, settings)
    frames = {k: inverse(T) for k, T in rows.T_tracker_base.items()}
    residuals, misfit = _residuals(after, rows, touches, keep, sigma)
    parents = (model,) if model.calibrated else ()
    outliers = tuple(label for label, good in zip(touches.labels, keep, strict=False) if not good)
    summary = probing_summary(
        prior,
        after,
        touches,
        outliers,
        parents,
        {
            "touch_sigma": settings.touch_sigma,
            "tool_sigma": settings.tool_sigma,
            "robust": settings.robust,
            "learn": settings.learn,
        },
        float(np.sqrt((residuals[keep[:n]] ** 2).sum(axis=1).mean())),
        sigma / stated,
    )
    return ProbingEstimate(
        belief=after,
        T_base_part={k: frozen(T, (4, 4), "T_base_part") for k, T in sorted(frames.items())},
        layout=rows.layout,
        touches=touches,
        residuals=frozen(residuals, (n, 3), "residuals"),
        outliers=outliers,
        sigma=sigma,
        misfit=misfit,
        parents=parents,
        summary=summary,
    )


def _residuals(
    after: Belief, rows: NewRows, touches: ProbingSet, keep: BoolArray, sigma: float
) -> tuple[Array, float]:
    """Residuals (n, 3) m of the touches in base, and their misfit over ``sigma``."""
    n, shift = len(touches), after.end - rows.layout.robot_size
    residuals = np.zeros((n, 3))
    square, freedom = 0.0, 0.0
    for piece in rows.pieces(after):
        off = piece.values - piece.columns @ after.mean
        half = piece.columns @ after.root.T
        for i, row in enumerate(piece.rows.tolist()):
            if row >= n:
                continue
            k = int(touches.part[row])
            start = rows.layout.blocks[f"station/{k}"].start + shift
            along = piece.columns[i][:, start : start + 3]
            residuals[row] = -rows.T_tracker_base[k][:3, :3].T @ (along.T @ off[i])
            if keep[row]:
                square += float(off[i] @ off[i])
                freedom += len(off[i]) - float((half[i] ** 2).sum()) / sigma**2
    return residuals, float(np.sqrt(square / freedom) / sigma) if freedom > 0.5 else float("nan")
