"""Measured rows with the typical errors of their arm: the input of the data doctor.

The rows are linearised once at a robust fit. Everything a calibration may explain has a covariance:
geometry and compliance by their priors, ripple and a smooth residual over the postures. A suspicion
has to explain the residual beyond them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from robotrue.calibration.observations import observations_of
from robotrue.calibration.parameters import ParameterLayout, State, difference, retract
from robotrue.calibration.settings import FitSettings, build_prior, free_groups, typical_ripple
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import fit_rigid
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import ChainState, drive_jacobian, sensitivity_of, walk
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
SMOOTH: Final = 1e-4
"""m, usual size of the smooth residual."""
JOINT_SD: Final = 4e-5
"""rad, scatter of a drive that a healthy arm may have."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """Some rows, linearised.

    Attributes:
        robot: Nominal arm with the measured reflector.
        settings: Of the fit.
        rows: The whole set.
        count: Its number of rows.
        chosen: (n,) rows of it that are examined, rising.
        state: Where they are linearised.
        values: (n, 3) m, measured minus what the nominal arm at its start predicts (linear part).
        columns: (n, 3, p) of robot, frames and reflectors, each over its prior sd.
        geometric: (p,) True where the prior scale may be learned.
        drive: (n, 3, dof) m/rad, by a shift of each drive.
        ripple: (n, 3, k) by sine and cosine of each joint, over their usual sd.
        covariance: (n, 3, 3) m^2, instrument and repeatability.
    """

    robot: RobotModel
    settings: FitSettings
    rows: MeasurementSet
    count: int
    chosen: IntArray
    state: State
    values: Array
    columns: Array
    geometric: BoolArray
    drive: Array
    ripple: Array
    covariance: Array

    @cached_property
    def chain(self) -> ChainState:
        """The fitted arm at all rows of the set."""
        return walk(self.state.robot, self.rows.joints)

    @cached_property
    def drives(self) -> Array:
        """How each drive moves the points of the whole set (N, 3, dof) m/rad, in their frame."""
        return self._turn_to_frame(drive_jacobian(self.state.robot, self.chain)[:, :3])

    @cached_property
    def flange_turn(self) -> Array:
        """Rotation (N, 3, 3) of the flange in the frame of the measurement."""
        return self._turn_to_frame(self.chain.flange_rotation)

    @cached_property
    def covariances(self) -> dict[str, Array]:
        """The covariances (3 n, 3 n) that scales multiply, and the one they do not."""
        m = self.values.size
        columns, ripple = self.columns.reshape(m, -1), self.ripple.reshape(m, -1)
        geometry, loose = columns[:, self.geometric], columns[:, ~self.geometric]
        drive = self.drive @ np.swapaxes(self.drive, 1, 2)
        kernel = _posture_kernel(self.rows.joints[self.chosen])
        return {
            "loose": loose @ loose.T + spread_blocks(self.covariance),
            "geometry": geometry @ geometry.T,
            "ripple": ripple @ ripple.T,
            "smooth": np.asarray(SMOOTH**2 * np.kron(kernel, np.eye(3))),
            "joints": JOINT_SD**2 * spread_blocks(drive),
        }

    def _turn_to_frame(self, columns: Array) -> Array:
        """Columns (N, 3, k) in base, taken to the frame of each row."""
        turned = columns.copy()
        for k, T in self.state.T_tracker_base.items():
            mine = self.rows.station == k
            turned[mine] = T[:3, :3] @ columns[mine]
        return turned


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
    count = len(rows)
    if chosen is None:
        chosen = np.unique(np.linspace(0, count - 1, min(count, MOST_ROWS)).astype(np.int64))
    part = rows.subset(chosen)
    if part.has_rotation.any():
        part = replace(part, rotation=np.full((len(chosen), 3, 3), np.nan))
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
    drive = sensitivity_of(state.robot, item.jacobian).drive
    return Case(
        robot=robot,
        settings=settings,
        rows=rows,
        count=count,
        chosen=chosen,
        state=state,
        values=item.residual + item.jacobian[:, :, free] @ about,
        columns=item.jacobian[:, :, free] * sd[free],
        geometric=free < of_joints,
        drive=drive,
        ripple=_ripple_columns(robot, part.joints, drive),
        covariance=item.covariance,
    )


def _ripple_columns(robot: RobotModel, joints: Array, drive: Array) -> Array:
    """How sine and cosine of each joint move the points (n, 3, k), over their usual sd."""
    size = typical_ripple(robot, HARMONICS)
    waves = [
        drive * (wave(joints * (k + 1)) * size[k])[:, None, :]
        for k in range(HARMONICS)
        for wave in (np.sin, np.cos)
    ]
    return np.concatenate(waves, axis=2)


def spread_blocks(blocks: Array) -> Array:
    """Returns the block diagonal (3 n, 3 n) of (n, 3, 3)."""
    n = len(blocks)
    spread = np.zeros((n, 3, n, 3))
    spread[np.arange(n), :, np.arange(n), :] = blocks
    return spread.reshape(3 * n, 3 * n)


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
    """Returns T_tracker_base (..., 4, 4) that half of the rows agree on, fitted to those.

    Args:
        points: (..., n, 3) m in base.
        seen: (n, 3) m, the same points as the instrument saw them.
        draws: Groups of five rows that are tried besides all rows.
    """
    n = len(seen)
    gap = _distances(fit_rigid(points, seen), points, seen)
    if n > 6:
        groups = np.random.default_rng(0).integers(0, n, (draws, 5))
        trials = fit_rigid(points[..., groups, :], seen[groups])
        gaps = _distances(trials, points[..., None, :, :], seen)
        sizes = np.median(gaps, axis=-1)
        best = np.take_along_axis(gaps, sizes.argmin(axis=-1)[..., None, None], axis=-2)[..., 0, :]
        # Unless a group does much better all rows agree, and know better than five.
        clear = sizes.min(axis=-1) < 0.7 * np.median(gap, axis=-1)
        gap = np.where(clear[..., None], best, gap)
    near = gap <= np.maximum(3.0 * np.median(gap, axis=-1, keepdims=True), 1e-6)
    return fit_rigid(points, seen, near)


def _distances(T: Array, points: Array, seen: Array) -> Array:
    """Distances (..., n) m of points (..., n, 3), moved by T (..., 4, 4), from those seen."""
    placed = points @ np.swapaxes(T[..., :3, :3], -1, -2) + T[..., None, :3, 3]
    return np.asarray(np.linalg.norm(placed - seen, axis=-1))


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
