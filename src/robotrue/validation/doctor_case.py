"""Measured rows beside what an arm of their type can do: the case the data doctor examines.

The rows are linearised once at a robust fit. Everything a calibration may explain has a covariance:
geometry and compliance by their priors, ripple and a smooth residual over the postures. What is
left beyond them is what a suspicion has to explain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.observations import observations_of
from robotrue.calibration.parameters import ParameterLayout, State, difference, retract
from robotrue.calibration.priors import build_prior, free_groups, typical_ripple
from robotrue.calibration.settings import FitSettings
from robotrue.core.arrays import Array, IntArray
from robotrue.core.poses import apply, fit_rigid, pose
from robotrue.core.rotations import skew
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import sensitivity_of, walk
from robotrue.robot.model import RobotModel, parameter_slice

MOST_ROWS: Final = 120
"""Rows examined; of a longer set every k-th, in the order of the file."""
HARMONICS: Final = 3
"""Cycles per revolution of the ripple that a clean arm may have."""
NEAR: Final = 0.6
"""rad, distance of postures over which the smooth residual is alike."""
DRAWS: Final = 80
"""Triples of rows tried for a tracker frame that wrong rows cannot turn."""
ROBUST_STEPS: Final = 4
FAR_OUT: Final = 5.0
"""Residual over the median residual from which a row does not move the linearisation."""
LOOSE: Final = 1.0
"""m, rad: sd of base, tracker frame and reflector; the doctor learns nothing about them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Some rows, linearised.

    Attributes:
        robot: Nominal arm with the measured reflector.
        settings: Of the fit.
        rows: The whole set, positions alone.
        chosen: (n,) rows of it that are examined, rising.
        state: Where they are linearised.
        values: (n, 3) m, measured minus what the nominal arm at its start predicts (linear part).
        columns: (n, 3, p) of robot, frames and reflectors, each over its prior sd.
        geometric: (p,) True where the prior scale may be learned.
        drive: (n, 3, dof) m/rad, by a shift of each drive.
        turn: (n, 3, 3) flange to the frame of the measurement.
        kernel: (n, n) of the smooth residual over postures, unit variance.
        covariance: (n, 3, 3) m^2, instrument and repeatability.
    """

    robot: RobotModel
    settings: FitSettings
    rows: MeasurementSet
    chosen: IntArray
    state: State
    values: Array
    columns: Array
    geometric: Array
    drive: Array
    turn: Array
    kernel: Array
    covariance: Array

    @property
    def chosen_rows(self) -> MeasurementSet:
        """The rows examined."""
        return self.rows.subset(self.chosen)


def open_case(
    robot: RobotModel, rows: MeasurementSet, settings: FitSettings, chosen: IntArray | None = None
) -> Case:
    """Returns the rows linearised at a fit that wrong rows cannot pull far.

    Args:
        robot: Nominal arm with the measured reflector.
        rows: Three or more of each tracker station; orientations are left out.
        settings: Loads, priors, repeatability.
        chosen: Rows to examine; evenly spaced ones if None.
    """
    points = replace(rows, rotation=np.full((len(rows), 3, 3), np.nan))
    if chosen is None:
        count = min(len(rows), MOST_ROWS)
        chosen = np.unique(np.linspace(0, len(rows) - 1, count).astype(np.int64))
    part = points.subset(chosen)
    layout, start = _start(robot, part)
    groups = [g for g in free_groups("elastic") if not (layout.stations and g == "base")]
    prior = build_prior(
        layout,
        start,
        settings.scales,
        free_groups=tuple(groups),
        stiffness=settings.stiffness,
        payload_mass=float(settings.payload.mass[0]),
        tool_rotation=False,
    )
    (observation,) = observations_of(
        robot,
        part,
        settings.payload,
        repeatability=settings.repeatability_sd,
        rotation_sd=settings.rotation_sd,
    )
    free = np.flatnonzero(prior.free)
    sd = prior.sd.copy()
    loose = np.ones(layout.size, dtype=bool)
    of_joints = parameter_slice(robot.dof, "base").start
    loose[:of_joints] = False
    sd[loose & prior.free] = LOOSE
    sd[parameter_slice(robot.dof, "tool")][:3] = max(settings.scales.tool, 1e-4)
    state = prior.centre
    for _ in range(ROBUST_STEPS):
        item = observation.linearise(layout, state)
        step = _robust_step(
            item.residual, item.jacobian[:, :, free], item.covariance,
            sd[free], difference(layout, state, prior.centre)[free],
        )  # fmt: skip
        whole = np.zeros(layout.size)
        whole[free] = step
        state = retract(layout, state, whole)
    item = observation.linearise(layout, state)
    about = difference(layout, state, prior.centre)[free]
    return Case(
        robot=robot,
        settings=settings,
        rows=points,
        chosen=chosen,
        state=state,
        values=item.residual + item.jacobian[:, :, free] @ about,
        columns=item.jacobian[:, :, free] * sd[free],
        geometric=(free < of_joints).astype(np.float64),
        drive=sensitivity_of(state.robot, item.jacobian).drive,
        turn=flange_turn(state, part),
        kernel=_posture_kernel(part.joints),
        covariance=item.covariance,
    )


def flange_turn(state: State, rows: MeasurementSet) -> Array:
    """Returns the rotation (n, 3, 3) of the flange in the frame of the measurement."""
    turn = walk(state.robot, rows.joints).flange_rotation.copy()
    for k, T in state.T_tracker_base.items():
        mine = rows.station == k
        turn[mine] = T[:3, :3] @ turn[mine]
    return turn


def frame_columns(rows: MeasurementSet, about: Array, size: float) -> Array:
    """Returns how a rigid motion of the instrument moves the points (n, 3, 6).

    Args:
        rows: The points.
        about: (3,) m, where the motion does not turn them.
        size: m, lever at which a turn weighs as much as a shift.
    """
    turns = -skew((rows.position - about) / size)
    return np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=2)


def ripple_columns(case: Case) -> Array:
    """Returns how sine and cosine of each joint move the points (n, 3, k), over their usual sd."""
    joints = case.chosen_rows.joints
    size = typical_ripple(case.robot, HARMONICS)
    waves = [
        case.drive * (wave(joints * (k + 1)) * size[k])[:, None, :]
        for k in range(HARMONICS)
        for wave in (np.sin, np.cos)
    ]
    return np.concatenate(waves, axis=2)


def _posture_kernel(joints: Array) -> Array:
    scale = np.ones(joints.shape[1])
    scale[3:] = 0.5  # the wrist moves the point less
    at = joints * scale / NEAR
    gap = ((at[:, None, :] - at[None, :, :]) ** 2).sum(axis=2)
    return np.asarray(np.exp(-0.5 * gap))


def _start(robot: RobotModel, rows: MeasurementSet) -> tuple[ParameterLayout, State]:
    """Frames and reflectors to start from; wrong rows do not turn the frames."""
    chain = walk(robot, rows.joints)
    stations, position = {}, rows.position.copy()
    if rows.frame == "tracker":
        for k in np.unique(rows.station).tolist():
            mine = np.flatnonzero(rows.station == k)
            first = mine[rows.target[mine] == 0]
            used = first if len(first) >= 4 else mine
            stations[k] = robust_frame(chain.position[used], rows.position[used])
            turn = stations[k][:3, :3]
            position[mine] = (position[mine] - stations[k][:3, 3]) @ turn
    targets = {}
    for k in np.unique(rows.target[rows.target > 0]).tolist():
        mine = rows.target == k
        back = np.swapaxes(chain.flange_rotation[mine], 1, 2)
        offset = (back @ (position[mine] - chain.flange_position[mine])[:, :, None])[:, :, 0]
        targets[k] = np.eye(4)
        targets[k][:3, 3] = np.median(offset, axis=0)
    layout = ParameterLayout(
        dof=robot.dof, stations=tuple(stations), targets=tuple((k, 3) for k in targets)
    )
    return layout, State(robot=robot, T_tracker_base=stations, T_flange_target=targets)


def robust_frame(points: Array, seen: Array, draws: int = DRAWS) -> Array:
    """Returns T_tracker_base (4, 4) that half of the rows agree on, fitted to those.

    Args:
        points: (n, 3) m in base.
        seen: (n, 3) m, the same points as the instrument saw them.
        draws: Groups of five rows that are tried besides all rows.
    """
    whole = fit_rigid(points, seen)
    gap = np.linalg.norm(apply(whole, points) - seen, axis=1)
    if len(points) > 6:
        rng = np.random.default_rng(0)
        rows = rng.integers(0, len(points), (draws, 5))
        trials = _fit_groups(points[rows], seen[rows])
        gaps = np.linalg.norm(
            points @ np.swapaxes(trials[:, :3, :3], 1, 2) + trials[:, None, :3, 3] - seen, axis=2
        )
        sizes = np.median(gaps, axis=1)
        k = int(sizes.argmin())
        if sizes[k] < 0.7 * np.median(gap):  # else all rows agree, and know better than five
            gap = gaps[k]
    near = gap <= max(3.0 * float(np.median(gap)), 1e-6)
    return fit_rigid(points[near], seen[near])


def _fit_groups(points: Array, seen: Array) -> Array:
    """Rigid motions (k, 4, 4) of k groups of points (k, m, 3)."""
    middle, centre = points.mean(axis=1), seen.mean(axis=1)
    spread = np.swapaxes(points - middle[:, None], 1, 2) @ (seen - centre[:, None])
    u, _, vt = np.linalg.svd(spread)
    vt[:, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
    turn = np.swapaxes(u @ vt, 1, 2)
    return pose(turn, centre - (turn @ middle[:, :, None])[:, :, 0])


def _robust_step(
    residual: Array, jacobian: Array, covariance: Array, sd: Array, offset: Array
) -> Array:
    """A Gauss-Newton step (p,) from the rows that are not far out, noise as large as they show."""
    size = np.linalg.norm(residual, axis=1)
    near = size <= FAR_OUT * max(float(np.median(size)), 1e-9)
    noise = float(np.median(size[near]) ** 2 / 2.37) + float(covariance[:, 0, 0].mean())
    columns = (jacobian[near] * sd).reshape(-1, len(sd)) / np.sqrt(noise)
    right = columns.T @ residual[near].ravel() / np.sqrt(noise) - offset / sd
    return np.asarray(sd * np.linalg.solve(columns.T @ columns + np.eye(len(sd)), right))
