"""Estimated parameters: one named vector of blocks, the state that it updates, initial values.

Blocks: ``robot`` (the error vector of :class:`RobotModel`, 9 dof + 12), ``station/k`` (6: pose of a
tracker frame that is not known, or of a part that is touched; 3: a place that has no axes of its
own, such as a socket), ``target/k`` (3 or 6: a further reflector on the flange; reflector 0 is the
robot's own tool). A step is a vector in this layout; poses move on their manifold.

A fit starts from closed-form values of tracker frames, further reflectors and target orientation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import apply, fit_rigid, inverse, pose
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix, skew
from robotrue.errors import ImplausibleDataError, ObservabilityError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import ChainState, walk
from robotrue.robot.model import PER_JOINT, POSE_TERMS, RobotModel, parameter_names


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterLayout:
    """Position of each block in the parameter vector.

    Attributes:
        dof: Number of joints.
        stations: Indices of the tracker frames to be estimated.
        targets: (index, size) of the further reflectors; size 3 (point) or 6 (pose).
        places: Which of the stations are places only: they shift (3), their axes are the base's.
    """

    dof: int
    stations: tuple[int, ...] = ()
    targets: tuple[tuple[int, int], ...] = ()
    places: tuple[int, ...] = ()

    @property
    def robot_size(self) -> int:
        """Length of the ``robot`` block."""
        return len(PER_JOINT) * self.dof + 12

    @property
    def size(self) -> int:
        """Length of the whole vector."""
        return self.robot_size + sum(size for _, size in (*self._stations, *self.targets))

    @property
    def _stations(self) -> tuple[tuple[int, int], ...]:
        return tuple((k, 3 if k in self.places else 6) for k in self.stations)

    @property
    def blocks(self) -> dict[str, slice]:
        """Name of each block and its slice."""
        out = {"robot": slice(0, self.robot_size)}
        start = self.robot_size
        for kind, entries in (
            ("station", self._stations),
            ("target", self.targets),
        ):
            for index, size in entries:
                out[f"{kind}/{index}"] = slice(start, start + size)
                start += size
        return out

    @property
    def names(self) -> tuple[str, ...]:
        """Name of every parameter: ``theta1 .. tool_rz, station/0_x .. target/1_z``."""
        out = list(parameter_names(self.dof))
        for block, place in list(self.blocks.items())[1:]:
            out.extend(f"{block}_{term}" for term in POSE_TERMS[: place.stop - place.start])
        return tuple(out)


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """A point in parameter space.

    Attributes:
        robot: The arm with its current errors.
        T_tracker_base: Per station (4, 4).
        T_flange_target: Per further reflector (4, 4).
    """

    robot: RobotModel
    T_tracker_base: Mapping[int, Array] = field(default_factory=dict)
    T_flange_target: Mapping[int, Array] = field(default_factory=dict)


def retract(layout: ParameterLayout, state: State, step: Array) -> State:
    """Returns the state moved by ``step`` (size,), SI.

    A station or target pose moves by a shift and a left rotation about its own origin:
    t + v, exp([phi]x) R.
    """
    blocks = layout.blocks
    return State(
        robot=state.robot.with_errors(state.robot.errors + step[blocks["robot"]]),
        T_tracker_base={
            k: _move_pose(T, step[blocks[f"station/{k}"]]) for k, T in state.T_tracker_base.items()
        },
        T_flange_target={
            k: _move_pose(T, step[blocks[f"target/{k}"]]) for k, T in state.T_flange_target.items()
        },
    )


def difference(layout: ParameterLayout, state: State, origin: State) -> Array:
    """Returns the step (size,) that takes ``origin`` to ``state``: the inverse of retract."""
    blocks = layout.blocks
    out = np.zeros(layout.size)
    out[blocks["robot"]] = state.robot.errors - origin.robot.errors
    for kind, new, old in (
        ("station", state.T_tracker_base, origin.T_tracker_base),
        ("target", state.T_flange_target, origin.T_flange_target),
    ):
        for k, T in new.items():
            place = blocks[f"{kind}/{k}"]
            step = np.concatenate(
                [
                    T[:3, 3] - old[k][:3, 3],
                    rotation_vector_from_matrix(T[:3, :3] @ old[k][:3, :3].T),
                ]
            )
            out[place] = step[: place.stop - place.start]
    return out


def station_as_base(layout: ParameterLayout, state: State) -> tuple[slice, Array] | None:
    """Returns a station's block and the (6, 6) map of its step to one of the base errors.

    With an unknown tracker frame the station *defines* the base: the joint offsets and the station
    are determined only together, and only together do they predict a measured point. The first
    station that has axes represents the base; a place has none. None where no station is estimated,
    or only places.
    """
    frames = [k for k in layout.stations if k not in layout.places]
    if not frames:
        return None
    first = frames[0]
    back = state.T_tracker_base[first][:3, :3].T
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = back
    return layout.blocks[f"station/{first}"], out


def target_as_tool(layout: ParameterLayout, target: int, T_flange_target: Array) -> Array:
    """Returns the (6, size) map of a step to the tool errors of an arm that carries the target.

    A target shifts along the flange's axes, a tool along its own; turns are left out, no point
    depends on them.
    """
    out = np.zeros((6, layout.size))
    start = layout.blocks[f"target/{target}"].start
    out[:3, start : start + 3] = T_flange_target[:3, :3].T
    return out


def _move_pose(transform: Array, step: Array) -> Array:
    out = transform.copy()
    out[:3, 3] += step[:3]
    if len(step) == 6:
        out[:3, :3] = matrix_from_rotation_vector(step[3:]) @ transform[:3, :3]
    return out


IMPLAUSIBLE: Final = 0.03
"""Median distance from the nominal robot, over its reach, that no real arm has."""
TURNED: Final = 0.02
"""rad; a target turned by more against the tool frame defines the tool's orientation."""
OFF: Final = 4.0
"""Standard deviations by which the reflector may lie off the stated place."""
NUISANCE: Final = 0.1
"""m and rad, of a frame about its rigid fit."""
SLIM: Final = 0.2
"""Width over length of points below which their rigid fit may be turned about them."""
TURNS: Final = 24
"""Turns about a line that are tried."""
LOOSE: Final = 1e-4
"""m, what a nominal arm is off by, when the turn about a line is chosen."""
APART: Final = 0.01
"""m, root sum of squares about their mean: points nearer than that give a frame no direction."""


def start_state(
    robot: RobotModel, measurements: MeasurementSet, *, tool_sd: float = 0.0, line: bool = False
) -> tuple[RobotModel, ParameterLayout, State]:
    """Returns the robot, the layout of the parameter vector and the state to start from.

    Tracker frames start at the best rigid fit to the nominal arm; of poses on or near one line the
    turn about it is the one that an offset of the reflector explains best. Further reflectors start
    at the mean of their measured positions on the flange. A station whose every point is its own
    origin (0, 0, 0) is a place, such as a socket that the tool touched several times: it only
    shifts. A 6-D target whose axes are turned against the tool frame gives its orientation to the
    returned robot's tool; the tool point stays.

    Args:
        robot: Nominal arm.
        measurements: In base or in tracker frames.
        tool_sd: m, standard deviation of the position of reflector 0; an offset within :data:`OFF`
            of it is no fault of the robot.
        line: Accept stations whose points lie on one line.

    Raises:
        ObservabilityError: A station without enough points of reflector 0.
        ImplausibleDataError: Points that are impossible for this robot.
    """
    if not len(measurements):
        raise ObservabilityError("no measurements.", hint="check the file and the screening.")
    chain = walk(robot, measurements.joints)
    stations = _stations(chain, measurements, line, tool_sd)
    position = measurements.position.copy()
    rotation = measurements.rotation.copy()
    for k, T in stations.items():
        mine = measurements.station == k
        position[mine] = apply(inverse(T), position[mine]) - measurements.carried[mine]
        rotation[mine] = T[:3, :3].T @ rotation[mine]
    _check_plausible(robot, chain, position, measurements, tool_sd)
    robot = _turned_tool(robot, chain, rotation, measurements)
    targets, sizes = {}, []
    for k in np.unique(measurements.target[measurements.target > 0]).tolist():
        mine = measurements.target == k
        targets[k], posed = _target(chain, position, rotation, mine)
        sizes.append((k, 6 if posed else 3))
    layout = ParameterLayout(
        dof=robot.dof,
        stations=tuple(stations),
        targets=tuple(sizes),
        places=_places(measurements),
    )
    return robot, layout, State(robot=robot, T_tracker_base=stations, T_flange_target=targets)


def _places(measurements: MeasurementSet) -> tuple[int, ...]:
    """Stations that are places: every point at the origin, as no instrument ever reads it."""
    if measurements.frame == "base":
        return ()
    away = measurements.station[(measurements.position != 0.0).any(axis=1)]
    return tuple(np.setdiff1d(measurements.station, away).tolist())


def _stations(
    chain: ChainState, measurements: MeasurementSet, line: bool, tool_sd: float
) -> dict[int, Array]:
    if measurements.frame == "base":
        return {}
    out = {}
    places = _places(measurements)
    for k in np.unique(measurements.station).tolist():
        mine = (measurements.station == k) & (measurements.target == 0)
        points = chain.position[mine] + measurements.carried[mine]
        if k in places and len(points):
            out[k] = pose(np.eye(3), -points.mean(axis=0))
            continue
        if len(points) < 3 or _spread(points)[0 if line else 1] < APART:
            raise ObservabilityError(
                f"tracker station {k} has {len(points)} points of reflector 0; its frame needs 3 "
                f"that are {'not in one place' if line else 'not on one line'}.",
                hint="measure more poses from that station.",
            )
        out[k] = fit_rigid(points, measurements.position[mine])
        if line and _spread(points)[1] < SLIM * _spread(points)[0]:
            turn = chain.flange_rotation[mine]
            out[k] = _turn_frame(out[k], points, measurements.position[mine], turn, tool_sd)
    return out


def _turn_frame(T: Array, points: Array, seen: Array, flange: Array, tool_sd: float) -> Array:
    """The frame turned about a line of points, so that an offset of the reflector explains best.

    Args:
        T: (4, 4) rigid fit T_tracker_base.
        points: (n, 3) m in base, nearly on one line.
        seen: (n, 3) m in the tracker frame.
        flange: (n, 3, 3) rotation of the flange.
        tool_sd: m, of the reflector's place.
    """
    middle = points.mean(axis=0)
    axis = np.linalg.svd(points - middle, full_matrices=False)[2][0]
    eye = np.broadcast_to(np.eye(3), flange.shape)
    sd = np.repeat([max(tool_sd, LOOSE), NUISANCE, NUISANCE], 3)
    columns = np.concatenate([flange, eye, -skew(points - middle)], axis=2).reshape(-1, 9) * sd
    precision = columns.T @ columns / LOOSE**2 + np.eye(9)
    best, least = T, np.inf
    for angle in np.arange(TURNS) * 2.0 * np.pi / TURNS:
        turn = matrix_from_rotation_vector(angle * axis)
        trial = T @ pose(turn, middle - turn @ middle)
        gap = (apply(inverse(trial), seen) - points).ravel() / LOOSE
        pull = columns.T @ gap / LOOSE
        cost = float(gap @ gap - pull @ np.linalg.solve(precision, pull))
        if cost < least:
            best, least = trial, cost
    return best


def _spread(points: Array) -> Array:
    """Root sums of squares of points (n, 3) m along their principal axes, the largest first."""
    if not len(points):
        return np.zeros(3)
    values = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return np.concatenate([values, np.zeros(3 - len(values))])


def _check_plausible(
    robot: RobotModel,
    chain: ChainState,
    position: Array,
    measurements: MeasurementSet,
    tool_sd: float,
) -> None:
    mine = measurements.target == 0
    if not mine.any():
        raise ObservabilityError(
            "no row of reflector 0, the robot's own tool.", hint="number the reflectors from 0."
        )
    gap = position[mine] - chain.position[mine]
    turn = chain.flange_rotation[mine]
    offset = np.einsum("nji,nj->ni", turn, gap).mean(axis=0)
    offset *= min(1.0, OFF * tool_sd / max(float(np.linalg.norm(offset)), 1e-12))
    distance = float(np.median(np.linalg.norm(gap - turn @ offset, axis=1)))
    allowed = IMPLAUSIBLE * robot.reach
    if distance > allowed:
        raise ImplausibleDataError(
            f"measured points lie {distance * 1e3:.1f} mm from {robot.name} as the controller "
            f"computes it (median), at most {allowed * 1e3:.1f} mm is plausible.",
            hint="check units, joint signs and offsets, axis order, the reflector offset and the "
            "frame of the measurements (base or tracker).",
        )


def _turned_tool(
    robot: RobotModel, chain: ChainState, rotation: Array, measurements: MeasurementSet
) -> RobotModel:
    mine = measurements.has_rotation & (measurements.target == 0)
    if not mine.any():
        return robot
    turn = _mean_rotation(np.swapaxes(chain.rotation[mine], 1, 2) @ rotation[mine])
    if np.trace(turn) > 1.0 + 2.0 * np.cos(TURNED):
        return robot
    tool = robot.T_flange_tool.copy()
    tool[:3, :3] = tool[:3, :3] @ turn
    return replace(robot, T_flange_tool=tool)


def _target(chain: ChainState, position: Array, rotation: Array, mine: Array) -> tuple[Array, bool]:
    """Pose of a reflector on the flange, and whether its orientation was seen."""
    back = np.swapaxes(chain.flange_rotation[mine], 1, 2)
    out = np.eye(4)
    offset = back @ (position[mine] - chain.flange_position[mine])[:, :, None]
    out[:3, 3] = offset[:, :, 0].mean(axis=0)
    turned = back @ rotation[mine]
    posed = np.isfinite(turned).all(axis=(1, 2))
    if posed.any():
        out[:3, :3] = _mean_rotation(turned[posed])
    return out, bool(posed.any())


def _mean_rotation(rotations: Array) -> Array:
    u, _, vt = np.linalg.svd(rotations.sum(axis=0))
    u[:, 2] *= np.sign(np.linalg.det(u @ vt))
    mean: Array = u @ vt
    return mean
