"""Registration by the estimator: frames, tool point and arm in one posterior, from touches.

    T_part_base(f) tip(q; w) = p_part + noise         w ~ belief in the arm,   f ~ nothing known

The belief is that of a calibrated model, or the priors of a nominal arm (probing without a
tracker). Frames and arm stay correlated in the result: both are used together, and what probing and
machining have in common cancels.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from robotrue.calibration.belief import (
    Belief,
    belief_of,
    conditioned,
    model_of,
    widened,
    with_nuisances,
)
from robotrue.calibration.drift_scales import stacked
from robotrue.calibration.estimate import free_groups
from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.new_rows import NUISANCE_SD, NewRows, whitened
from robotrue.calibration.parameters import Layout, State
from robotrue.calibration.prior_belief import prior_belief
from robotrue.calibration.priors import build_prior
from robotrue.calibration.probing_outliers import agreeing_touches
from robotrue.calibration.probing_scales import learned_scales, noise_factor
from robotrue.calibration.probing_start import start_frames, tips
from robotrue.calibration.probing_summary import probing_summary
from robotrue.calibration.residual import LearnedModel
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.touches import frame_displacement, touch_rows
from robotrue.calibration.update import centred, updated
from robotrue.core.arrays import Array, BoolArray, frozen
from robotrue.core.poses import inverse
from robotrue.core.units import MM
from robotrue.errors import (
    ConfigurationError,
    ConvergenceError,
    ImplausibleDataError,
    ModelMismatchError,
    ObservabilityError,
)
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.statics import NO_LOAD, Load

STEPS: Final = 30
ROUNDS: Final = 4
"""Times the touches are judged anew where the estimate has moved."""
STILL: Final = 1e-7
"""m and rad: frames that move by less are at rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbingSettings:
    """What the estimate is told besides the arm and the touches.

    Attributes:
        touch_sigma: m per axis of one touch: probe, surface, hand; without the arm.
        tool_sigma: m per axis, how far the tool point may be from where the model has it. 0: the
            tool that was measured is still in its holder; for a nominal arm that of ``priors``.
        T_flange_tool: (4, 4) nominal tool of the touches, if another than the model's; what the
            model knew of its own tool then does not apply, and ``tool_sigma`` must say how well
            this one is known.
        robust: Name and leave out touches that disagree.
        learn: Let the touches scale the priors of a nominal arm, and noise beyond ``touch_sigma``.
        payload: On the flange while touching.
        priors: Of a nominal arm: scales, stiffness, repeatability.
        start: ``T_base_part`` of parts whose touches do not say roughly where they stand.
    """

    touch_sigma: float = 5e-5
    tool_sigma: float = 0.0
    T_flange_tool: Array | None = None
    robust: bool = True
    learn: bool = True
    payload: Load = NO_LOAD
    priors: FitSettings = field(default_factory=FitSettings)
    start: Mapping[int, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuses values that cannot be.

        Raises:
            ConfigurationError: They are.
        """
        for name, value in (("touch_sigma", self.touch_sigma), ("tool_sigma", self.tool_sigma)):
            if not 0.0 <= value < 0.1:
                raise ConfigurationError(
                    f"{name} {value / MM:g} mm, allowed 0 to 100 mm.",
                    hint=f"0.1 mm is written {name}=1e-4.",
                )
        if self.T_flange_tool is not None:
            tool = frozen(self.T_flange_tool, (4, 4), "T_flange_tool")
            object.__setattr__(self, "T_flange_tool", tool)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbingEstimate:
    """Arm and frames, known together.

    Attributes:
        belief: Joint posterior; its last columns are the frames, part by part in rising order: a
            shift and a left rotation vector of ``T_part_base`` each (a socket: the shift alone).
        T_base_part: (4, 4) of every part; a socket's axes are the base's.
        layout: Of robot errors and frames, as :class:`robotrue.calibration.new_rows.NewRows`.
        touches: As given.
        residuals: (n, 3) m in base, touched minus where the estimate has it; along the normal
            alone where a touch fixes only that.
        outliers: Labels of the touches that were not believed.
        sigma: m per axis, noise of one touch: stated, repeatability and learned white noise.
        misfit: Residuals over ``sigma``, about 1 where it explains them: root mean square over the
            degrees of freedom that the estimate leaves.
        parents: The model it began with; none for a nominal arm.
        summary: JSON values for the refined model.
    """

    belief: Belief
    T_base_part: Mapping[int, Array]
    layout: Layout
    touches: ProbingSet
    residuals: Array
    outliers: tuple[str, ...]
    sigma: float
    misfit: float
    parents: tuple[ErrorModel, ...]
    summary: Mapping[str, Any]

    @property
    def distances(self) -> Array:
        """Length of each residual, (n,) m."""
        return np.asarray(np.linalg.norm(self.residuals, axis=1))

    @property
    def believed(self) -> BoolArray:
        """(n,) True where the touch was believed."""
        return np.array([label not in self.outliers for label in self.touches.labels])

    @property
    def rms(self) -> float:
        """Root mean square length of the believed residuals, m."""
        return float(np.sqrt(np.mean(self.distances[self.believed] ** 2)))

    def columns(self, part: int) -> slice:
        """Returns where the frame of a part stands in the belief.

        Raises:
            ModelMismatchError: No such part.
        """
        if part not in self.T_base_part:
            raise ModelMismatchError(
                f"part {part} was not touched; the estimate has {sorted(self.T_base_part)}."
            )
        place = self.layout.blocks[f"station/{part}"]
        shift = self.belief.starts[3] - self.layout.robot_size
        return slice(place.start + shift, place.stop + shift)

    def covariance(self, part: int = 0) -> Array:
        """Returns the covariance (6, 6) of a frame; (3, 3) of a socket.

        Displacement of the part's origin (m), then left rotation vector (rad), both in base axes.

        Raises:
            ModelMismatchError: No such part.
        """
        place = self.columns(part)
        turn = frame_displacement(self.T_base_part[part], place.stop - place.start)
        half = self.belief.root[:, place] @ turn.T
        out: Array = half.T @ half
        return out

    def joint_covariance(self) -> Array:
        """Returns the covariance (p, p) of all columns of the belief, SI."""
        out: Array = self.belief.root.T @ self.belief.root
        return out


def estimate_probing(
    model: ErrorModel | RobotModel,
    touches: ProbingSet,
    settings: ProbingSettings | None = None,
    *,
    measurements: MeasurementSet | None = None,
) -> ProbingEstimate:
    """Returns frames and arm from touches.

    Args:
        model: A calibrated model: its belief is what is known before the touches. A robot: only
            its type is known, from ``settings.priors`` (30 to 90 touches then calibrate it).
        touches: With the robot's joints.
        settings: Noise, tool, robustness.
        measurements: Points of a tracker to be added to the same estimate, of the tool that
            touches.

    Raises:
        ObservabilityError: Touches without joints, too few, on one line, or with a motion left
            free.
        ImplausibleDataError: Half the touches of a part or more disagree; other units; a mirrored
            part.
        ModelMismatchError: Another number of joints.
        ConfigurationError: Another tool without ``tool_sigma``, or a model without covariance.
        ConvergenceError: No rest.

    Fails when: points are named in the wrong order in a pattern that fits so too; see the
    correspondence checks of :mod:`robotrue.cell.registration.correspondence`.
    """
    settings = ProbingSettings() if settings is None else settings
    dof = model.dof if isinstance(model, RobotModel) else model.robot.dof
    _check_joints(touches, dof)
    if measurements is not None and len(measurements):
        if isinstance(model, RobotModel):
            lean = replace(settings.priors, lean_on_prior=True)
            model = fit(model, measurements, method="ripple", settings=lean)
        else:
            model = updated(model, measurements, settings=settings.priors)
    before = centred(before_touching(model, settings), touches.joints)
    in_base = tips(before, touches.joints, settings.payload)
    frames = start_frames(touches, in_base, settings.start, robust=settings.robust)
    rows = touch_rows(
        before, touches, frames, touch_sigma=settings.touch_sigma, payload=settings.payload
    )
    prior = with_nuisances(before, np.full(rows.nuisances, NUISANCE_SD))
    after, rows, keep = _agreed(prior, rows, touches, settings)
    if settings.learn:
        prior = _scaled(model, prior, after, rows, keep, settings)
        after, rows, keep = _agreed(prior, rows, touches, settings)
    return _result(prior, after, rows, touches, keep, settings, model)


def model_of_estimate(estimate: ProbingEstimate) -> LearnedModel:
    """Returns the arm as the estimate knows it, the frames left out, with its lineage."""
    end = estimate.belief.starts[3]
    arm = replace(
        estimate.belief,
        mean=estimate.belief.mean[:end],
        root=estimate.belief.root[:, :end],
        nuisances=0,
    )
    return model_of(arm, estimate.summary)


def _check_joints(touches: ProbingSet, dof: int) -> None:
    if not len(touches) or not touches.has_joints:
        raise ObservabilityError(
            f"{len(touches)} touches without the robot's joints: nothing to learn of the arm.",
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


def before_touching(model: ErrorModel | RobotModel, settings: ProbingSettings) -> Belief:
    """Returns the belief in the arm before the touches, with the tool that touches.

    Raises:
        ConfigurationError: Another tool without ``tool_sigma``, or a model without covariance.
    """
    if isinstance(model, RobotModel):
        scales = settings.priors.scales
        if settings.tool_sigma > 0.0:
            scales = replace(scales, tool=settings.tool_sigma)
        robot = model
        if settings.T_flange_tool is not None:
            robot = model.with_tool(settings.T_flange_tool)
        return prior_belief(robot, replace(settings.priors, scales=scales))
    belief = _unscaled(belief_of(model))
    tool = parameter_slice(belief.robot.dof, "tool")
    if settings.T_flange_tool is not None:
        if settings.tool_sigma <= 0.0:
            raise ConfigurationError(
                "the touches have a tool of their own, and nothing says how well it is known.",
                hint="give tool_sigma; 1 mm is written tool_sigma=1e-3.",
            )
        mean, root = belief.mean.copy(), belief.root.copy()
        mean[tool] = 0.0
        root[:, tool] = 0.0
        belief = replace(
            belief,
            robot=belief.robot.with_tool(settings.T_flange_tool),
            mean=mean,
            root=root,
            # The smooth residual was learned at another point.
            white=float(np.hypot(belief.white, belief.amplitude)),
        )
    variance = np.zeros(len(belief.mean))
    variance[tool][:3] = settings.tool_sigma**2
    return widened(belief, variance)


def _unscaled(belief: Belief) -> Belief:
    """The same predictions with the factor on their covariance worked into its parts."""
    root = float(np.sqrt(belief.inflation))
    visit = belief.repeatability**2
    white = belief.inflation * (belief.white**2 + visit) - visit
    return replace(
        belief,
        root=root * belief.root,
        amplitude=root * belief.amplitude,
        white=float(np.sqrt(max(white, 0.0))),
        inflation=1.0,
    )


def _noise(belief: Belief) -> Array:
    return np.array([belief.white**2, 0.0])


def _settled(prior: Belief, rows: NewRows, keep: BoolArray) -> tuple[Belief, NewRows]:
    """The posterior of the believed rows, linearised where it stands, and the rows moved there.

    Raises:
        ConvergenceError: The frames still move after many steps.
    """
    at, size = prior, np.inf
    for _ in range(STEPS):
        columns, values = whitened(rows.pieces(at), _noise(prior), keep.astype(np.float64))
        at = conditioned(prior, columns, values)
        step = at.mean[at.starts[3] :]
        rows = rows.moved(step)
        size = float(np.abs(step).max())
        if size < STILL:
            return at, rows
    raise ConvergenceError(
        f"the frames still move by {size / MM:.3g} mm (or mrad) after {STEPS} linearisations.",
        hint="give start frames nearer to the parts, or touch more points.",
    )


def _agreed(
    prior: Belief, rows: NewRows, touches: ProbingSet, settings: ProbingSettings
) -> tuple[Belief, NewRows, BoolArray]:
    """The posterior of the touches that agree, the rows moved there, and which they are."""
    keep = np.ones(rows.count, dtype=bool)
    at = prior
    if not settings.robust or not touches.full.all():
        # A surface must be seen from near before a touch on it can be called wrong.
        at, rows = _settled(prior, rows, keep)
    for _ in range(ROUNDS if settings.robust else 0):
        found = _believed(prior, at, rows, touches)
        at, rows = _settled(prior, rows, found)
        if (found == keep).all():
            break
        keep = found
    return at, rows, keep


def _believed(prior: Belief, at: Belief, rows: NewRows, touches: ProbingSet) -> BoolArray:
    """Which rows agree.

    Raises:
        ImplausibleDataError: Half of a part's touches or more do not.
    """
    n = len(touches)
    found = agreeing_touches(stacked(rows.pieces(at)), prior, _noise(prior), n)
    labels = touches.labels
    for k in touches.parts:
        mine = np.flatnonzero(touches.part == k)
        wrong = [labels[i] for i in mine if not found[i]]
        if 2 * len(wrong) >= len(mine):
            raise ImplausibleDataError(
                f"{len(wrong)} of {len(mine)} touches of part {k} disagree with the rest: "
                f"{', '.join(wrong[:8])}{', ...' if len(wrong) > 8 else ''}.",
                source=touches.source or None,
                hint="check names, units and joint signs of the touches, and touch_sigma.",
            )
    keep = np.ones(rows.count, dtype=bool)
    keep[:n] = found
    return keep


def _scaled(
    model: ErrorModel | RobotModel,
    prior: Belief,
    at: Belief,
    rows: NewRows,
    keep: BoolArray,
    settings: ProbingSettings,
) -> Belief:
    """The prior with scales and noise as the touches ask."""
    stack = stacked(rows.pieces(at, keep))
    if isinstance(model, RobotModel):
        physical = build_prior(
            Layout(dof=model.dof),
            State(robot=model),
            settings.priors.scales,
            free_groups=free_groups("elastic"),
            stiffness=settings.priors.stiffness,
        )
        prior, factor = learned_scales(prior, stack, _noise(prior), physical)
    else:
        factor = noise_factor(prior, stack, _noise(prior))
    stated = settings.touch_sigma**2 + prior.repeatability**2 + prior.white**2
    return replace(prior, white=float(np.sqrt(prior.white**2 + (factor - 1.0) * stated)))


def _result(
    prior: Belief,
    after: Belief,
    rows: NewRows,
    touches: ProbingSet,
    keep: BoolArray,
    settings: ProbingSettings,
    model: ErrorModel | RobotModel,
) -> ProbingEstimate:
    n = len(touches)
    frames = {k: inverse(T) for k, T in rows.T_tracker_base.items()}
    residuals = np.zeros((n, 3))
    square, freedom = 0.0, 0.0
    shift = after.starts[3] - rows.layout.robot_size
    sigma = float(np.sqrt(settings.touch_sigma**2 + after.repeatability**2 + after.white**2))
    for piece in rows.pieces(after):
        off = piece.values - piece.columns @ after.mean
        half = piece.columns @ after.root.T
        for i, row in enumerate(piece.rows.tolist()):
            if row >= n:
                continue
            k = int(touches.part[row])
            start = rows.layout.blocks[f"station/{k}"].start + shift
            along = piece.columns[i][:, start : start + 3]
            residuals[row] = -frames[k][:3, :3] @ (along.T @ off[i])
            if keep[row]:
                square += float(off[i] @ off[i])
                freedom += len(off[i]) - float((half[i] ** 2).sum()) / sigma**2
    parents = () if isinstance(model, RobotModel) else (model,)
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
    )
    return ProbingEstimate(
        belief=after,
        T_base_part={k: frozen(T, (4, 4), "T_base_part") for k, T in sorted(frames.items())},
        layout=rows.layout,
        touches=touches,
        residuals=frozen(residuals, (n, 3), "residuals"),
        outliers=outliers,
        sigma=sigma,
        misfit=float(np.sqrt(square / freedom) / sigma) if freedom > 0.5 else float("nan"),
        parents=parents,
        summary=summary,
    )
