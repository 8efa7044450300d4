"""A calibration from lengths alone, or from lengths and measured points: one estimate.

A length goes from the reflector to an anchor, or between two poses of the arm. With v from the
other end to the reflector it is |v|, and its derivative v/|v| dv. An anchor is a place of the
layout, a station without axes: its columns shift it. Nothing turns with the whole, so the turn of
the base is not seen, and its place only together with the anchors'.
"""

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
from robotrue.calibration.observations import (
    IN_BASE,
    ArmVisits,
    Entries,
    Linearisation,
    Observation,
    observations_of,
    seen_points,
)
from robotrue.calibration.parameters import ParameterLayout, State, start_state
from robotrue.calibration.settings import FitSettings, free_groups
from robotrue.core.arrays import Array, IntArray
from robotrue.core.files import sha256
from robotrue.core.poses import pose
from robotrue.core.provenance import Provenance, merge
from robotrue.errors import ImplausibleDataError, ModelMismatchError, ObservabilityError
from robotrue.measurement.length_set import LengthSet
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load, drive_torque

SHORTEST = 1e-3
"""m; a shorter length has no direction."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LengthObservation:
    """Lengths whose ends are of one kind.

    Attributes:
        visits: Postures and loads; the station is the anchor, or ``IN_BASE`` with a second pose.
        second: Postures at the other end; None where that is an anchor.
        length: (n,) m.
        variance: (n,) m^2, instrument and repeatability of the visits.
        rows: (n,) rows of the length set.
    """

    visits: ArmVisits
    second: ArmVisits | None
    length: Array
    variance: Array
    rows: IntArray

    def linearise(
        self, layout: ParameterLayout, state: State, part: Entries = slice(None)
    ) -> Linearisation:
        """Returns the linearised rows; residual (n, 1) m.

        Raises:
            ImplausibleDataError: Ends that meet: a length between them has no direction.
        """
        along, _, jacobian = seen_points(layout, state, self.visits, part, rotations=False)
        if self.second is not None:
            other, _, columns = seen_points(layout, state, self.second, part, rotations=False)
            along, jacobian = along - other, jacobian - columns
        predicted = np.linalg.norm(along, axis=1)
        short = np.flatnonzero(predicted < SHORTEST)
        if short.size:
            row = int(self.rows[part][short[0]])
            raise ImplausibleDataError(
                f"length {row + 1} of the set: its ends are {predicted[short[0]] * 1e3:.3g} mm "
                f"apart, measured {self.length[part][short[0]] * 1e3:.6g} mm.",
                hint="check the joints of both ends and the place of the anchor.",
            )
        direction = along / predicted[:, None]
        visits = 1.0 if self.second is None else 2.0
        return Linearisation(
            residual=(self.length[part] - predicted)[:, None],
            jacobian=direction[:, None, :] @ jacobian,
            covariance=self.variance[part][:, None, None],
            white=np.array([[visits], [0.0]]),
        )


def length_observations(
    robot: RobotModel, lengths: LengthSet, payload: Load, *, repeatability: float, first: int
) -> tuple[LengthObservation, ...]:
    """Returns the lengths as observations, those to anchors and those between poses apart.

    Args:
        robot: Nominal arm; only its posture and masses are used, for the torques.
        lengths: The set.
        payload: On the flange.
        repeatability: m, sd per axis of one visit.
        first: Station number of anchor 0.
    """
    observations = []
    for between in (False, True):
        rows = np.flatnonzero(lengths.between_poses == between)
        if not len(rows):
            continue
        station = np.full(len(rows), IN_BASE) if between else lengths.anchor[rows] + first
        again = _visits(robot, lengths.second[rows], payload, station) if between else None
        observations.append(
            LengthObservation(
                visits=_visits(robot, lengths.joints[rows], payload, station),
                second=again,
                length=lengths.length[rows],
                variance=lengths.sigma[rows] ** 2 + (2.0 if between else 1.0) * repeatability**2,
                rows=rows,
            )
        )
    return tuple(observations)


def _visits(robot: RobotModel, joints: Array, payload: Load, station: IntArray) -> ArmVisits:
    return ArmVisits(
        joints=joints,
        torque=drive_torque(robot, joints, payload),
        target=np.zeros(len(joints), dtype=np.int64),
        station=station,
    )


METHODS: Final = ("nominal", "geometric", "elastic")
"""Parameter sets that lengths can be fitted with."""
UNSEEN_BASE: Final = (
    "not seen by lengths: position and rotation of the robot base in the cell; predictions are in "
    "the robot base."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class LengthEstimate(FitResult):
    """Result of a calibration from lengths.

    Attributes:
        anchors: (k, 3) m in base, where the anchors are.
        lengths: The set.
        origins: Of the lengths, and of the measured points.
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
        measurements: Measured points in addition; without any the base is held at zero.

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
