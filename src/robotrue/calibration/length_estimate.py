"""A calibration from lengths alone, or from lengths beside measured points: one estimate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.estimate import (
    FitResult,
    FitVerdict,
    residuals_by_row,
    solve_posterior,
)
from robotrue.calibration.identifiability import Identifiability
from robotrue.calibration.lengths import length_observations
from robotrue.calibration.observations import Observation, observations_of
from robotrue.calibration.parameters import ParameterLayout, State
from robotrue.calibration.priors import free_groups
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.start import start_state
from robotrue.core.arrays import Array, IntArray
from robotrue.core.files import sha256
from robotrue.core.poses import pose
from robotrue.core.provenance import Provenance, merge
from robotrue.errors import ModelMismatchError, ObservabilityError
from robotrue.measurement.length_set import LengthSet
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel

METHODS: Final = ("nominal", "geometric", "elastic")
"""Parameter sets that lengths can be fitted with."""
UNSEEN_BASE: Final = (
    "not seen by lengths: the place and the turn of the robot base in the cell; predictions hold "
    "in the robot's own base."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class LengthEstimate(FitResult):
    """Result of a calibration from lengths.

    Attributes:
        anchors: (k, 3) m in base, where the anchors are.
        lengths: The set.
        origins: Of the lengths, and of the points beside them.
    """

    anchors: Array
    lengths: LengthSet
    origins: tuple[Provenance, ...]


def estimate_lengths(
    robot: RobotModel,
    lengths: LengthSet,
    settings: FitSettings,
    method: str = "elastic",
    measurements: MeasurementSet | None = None,
) -> LengthEstimate:
    """Returns the MAP estimate of an arm and of the places of the anchors.

    Args:
        robot: Nominal arm whose tool is the reflector.
        lengths: With anchors that are roughly known.
        settings: Loads, priors, solver.
        method: One of ``METHODS``.
        measurements: Measured points beside them; without any the base is held at zero.

    Raises:
        ObservabilityError: Fewer numbers than what they should determine.
        ModelMismatchError: Another number of joints.
        ConvergenceError: The estimator did not settle.
    """
    dof = lengths.joints.shape[1]
    if dof != robot.dof:
        raise ModelMismatchError(f"lengths have {dof} joints, robot {robot.name} has {robot.dof}.")
    robot, layout, start, first = _start(robot, lengths, settings, measurements)
    in_base = measurements is not None and measurements.frame == "base"
    groups = tuple(g for g in free_groups(method) if in_base or g != "base")
    posed = measurements is not None and bool(measurements.has_rotation.any())
    sd = settings.repeatability_sd
    seen_lengths = length_observations(
        robot, lengths, settings.payload, repeatability=sd, first=first
    )
    points: tuple[Observation, ...] = ()
    if measurements is not None:
        points = observations_of(
            robot,
            measurements,
            settings.payload,
            repeatability=sd,
            rotation_sd=settings.rotation_sd,
        )
    posterior, seen = solve_posterior(
        (*seen_lengths, *points), layout, start, settings, groups, tool_rotation=posed
    )
    wanted = seen.determinable + layout.size - layout.robot_size
    if posterior.numbers < wanted and not settings.lean_on_prior:
        raise ObservabilityError(
            f"{posterior.numbers} usable numbers; {wanted} parameters are to be determined.",
            source=lengths.source or None,
            hint="measure more lengths, to three anchors or more, or choose a smaller method.",
        )
    screened, residual = residuals_by_row(posterior, seen_lengths, len(lengths), 1)
    places = [posterior.state.T_tracker_base[first + k] for k in range(len(lengths.anchors))]
    return LengthEstimate(
        posterior=posterior,
        identifiability=seen,
        verdict=_judge_fit(seen, screened, lengths, in_base=in_base),
        residual=residual,
        screened=screened,
        anchors=np.array([-T[:3, 3] for T in places]).reshape(-1, 3),
        lengths=lengths,
        origins=(lengths.provenance, *(() if measurements is None else (measurements.provenance,))),
    )


def _start(
    robot: RobotModel,
    lengths: LengthSet,
    settings: FitSettings,
    measurements: MeasurementSet | None,
) -> tuple[RobotModel, ParameterLayout, State, int]:
    """Arm, layout and state to start from, and the station number of anchor 0."""
    layout, state = ParameterLayout(dof=robot.dof), State(robot=robot)
    if measurements is not None:
        robot, layout, state = start_state(
            robot, measurements, tool_sd=settings.scales.tool, line=True
        )
    first = max(layout.stations, default=-1) + 1
    numbers = tuple(range(first, first + len(lengths.anchors)))
    anchors = {k: pose(np.eye(3), -lengths.anchors[k - first]) for k in numbers}
    return (
        robot,
        replace(layout, stations=(*layout.stations, *numbers), places=(*layout.places, *numbers)),
        replace(state, T_tracker_base={**state.T_tracker_base, **anchors}),
        first,
    )


def _judge_fit(
    seen: Identifiability, screened: IntArray, lengths: LengthSet, *, in_base: bool
) -> FitVerdict:
    doubts = [] if in_base else [UNSEEN_BASE]
    doubts += [f"not seen by the data: {direction}." for direction in seen.harmful]
    if len(screened):
        doubts.append(
            f"{len(screened)} of {len(lengths)} lengths carry no weight (line "
            f"{int(lengths.lines[screened[0]])} first): their residual has a chance below one in a "
            "million under the fitted noise."
        )
    return FitVerdict(status="conditional" if doubts else "determined", doubts=tuple(doubts))


def model_of_lengths(result: LengthEstimate, settings: FitSettings, method: str) -> CalibratedModel:
    """Returns the error model of an estimate from lengths, in the robot's own base."""
    posterior, lengths = result.posterior, result.lengths
    state, size = posterior.state, posterior.layout.robot_size
    joints = np.vstack([lengths.joints, lengths.second[lengths.between_poses]])
    rows: dict[str, object] = {
        "rows": len(lengths),
        "data_sha256": sha256(lengths.joints.tobytes() + lengths.length.tobytes()),
        "sources": [lengths.source] if lengths.source else [],
        "provenance": merge(result.origins).to_document(),
        "joint_range_rad": [joints.min(axis=0).tolist(), joints.max(axis=0).tolist()],
    }
    return CalibratedModel(
        robot=state.robot.nominal(),
        errors=state.robot.errors,
        covariance=posterior.covariance[:size, :size],
        repeatability=settings.repeatability_sd,
        white=float(np.sqrt(posterior.noise[0])),
        summary=result.describe(method, rows),
    )
