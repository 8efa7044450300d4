"""Where the estimator starts: tracker frames, further reflectors and target orientation."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.calibration.parameters import Layout, State
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, fit_rigid, inverse, pose
from robotrue.errors import ImplausibleDataError, ObservabilityError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import ChainState, walk
from robotrue.robot.model import RobotModel

IMPLAUSIBLE: Final = 0.03
"""Median distance from the nominal robot, over its reach, that no real arm has."""
TURNED: Final = 0.02
"""rad; a target turned by more against the tool frame defines the tool's orientation."""


def start_state(
    robot: RobotModel, measurements: MeasurementSet
) -> tuple[RobotModel, Layout, State]:
    """Returns the robot, the layout of the parameter vector and the state to start from.

    Tracker frames start at the best rigid fit to the nominal arm, further reflectors at the mean
    of where they are seen on the flange. A station whose every point is its own origin (0, 0, 0) is
    a place, such as a socket that the tool was put into several times: it only shifts. A 6-D target
    whose axes are turned against the tool frame gives its orientation to the returned robot's tool;
    the tool point stays.

    Raises:
        ObservabilityError: A station without enough points of reflector 0.
        ImplausibleDataError: Points that cannot be this robot's.
    """
    if not len(measurements):
        raise ObservabilityError("no measurements.", hint="check the file and the screening.")
    chain = walk(robot, measurements.joints)
    stations = _stations(chain, measurements)
    position = measurements.position.copy()
    rotation = measurements.rotation.copy()
    for k, T in stations.items():
        mine = measurements.station == k
        position[mine] = apply(inverse(T), position[mine])
        rotation[mine] = T[:3, :3].T @ rotation[mine]
    _check_plausible(robot, chain, position, measurements)
    robot = _turned_tool(robot, chain, rotation, measurements)
    targets, sizes = {}, []
    for k in np.unique(measurements.target[measurements.target > 0]).tolist():
        mine = measurements.target == k
        targets[k], posed = _target(chain, position, rotation, mine)
        sizes.append((k, 6 if posed else 3))
    layout = Layout(
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


def _stations(chain: ChainState, measurements: MeasurementSet) -> dict[int, Array]:
    if measurements.frame == "base":
        return {}
    out = {}
    places = _places(measurements)
    for k in np.unique(measurements.station).tolist():
        mine = (measurements.station == k) & (measurements.target == 0)
        points = chain.position[mine]
        if k in places and len(points):
            out[k] = pose(np.eye(3), -points.mean(axis=0))
            continue
        centred = points - points.mean(axis=0) if len(points) else points
        if len(points) < 3 or np.linalg.svd(centred, compute_uv=False)[1] < 0.01:
            raise ObservabilityError(
                f"tracker station {k} has {len(points)} points of reflector 0; its frame needs 3 "
                "that are not on one line.",
                hint="measure more poses from that station.",
            )
        out[k] = fit_rigid(points, measurements.position[mine])
    return out


def _check_plausible(
    robot: RobotModel, chain: ChainState, position: Array, measurements: MeasurementSet
) -> None:
    mine = measurements.target == 0
    if not mine.any():
        raise ObservabilityError(
            "no row of reflector 0, the robot's own tool.", hint="number the reflectors from 0."
        )
    distance = float(np.median(np.linalg.norm(position[mine] - chain.position[mine], axis=1)))
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
