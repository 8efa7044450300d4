"""Observations of the arm, each with its residual, analytic Jacobian and covariance.

``residual = measured - predicted`` and ``jacobian = d predicted / d parameters``, so a Gauss-Newton
step solves ``jacobian @ step = residual``. Covariances hold the instrument and the repeatability;
``white`` marks where the learned white noise (of lengths, of angles) adds to them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Final, Protocol, TypeAlias

import numpy as np

from robotrue.calibration.arm import term_columns
from robotrue.calibration.parameters import ParameterLayout, State
from robotrue.calibration.terms.term import ArmPostures, Term
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import EMPTY, Column
from robotrue.core.poses import apply, inverse
from robotrue.core.rotations import rotation_vector_from_matrix, skew
from robotrue.errors import ModelMismatchError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import parameter_jacobian, walk
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.statics import Load, add_moments, stated_torque

Entries: TypeAlias = slice | IntArray
"""Which entries of an observation."""
IN_BASE: Final = -1
"""Station number of a row that is measured in the robot base."""
CHANNELS: Final = 2
"""Learned white noise: of lengths (m^2) and of angles (rad^2)."""
CHUNK: Final = 2048
"""Rows linearised at a time: bounds the memory of the chain walk."""
ROWS: Final = 128
"""Rows at a time where terms have separate columns: their memory is reused, not returned."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Linearisation:
    """An observation at a state: n rows of m numbers, P parameters.

    Attributes:
        residual: (n, m) measured minus predicted.
        jacobian: (n, m, P) derivative of the prediction.
        covariance: (n, m, m) of the residual without learned noise.
        white: (2, m) multiples of the learned length and angle variances in each number.
    """

    residual: Array
    jacobian: Array
    covariance: Array
    white: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmVisits(ArmPostures):
    """n visits of the arm, which determine the place of a reflector on the flange.

    Attributes:
        target: (n,) reflector.
        station: (n,) tracker set-up, or ``IN_BASE``.
        carried: (n, 3) m, base axes: displacement of the arm by a rail from its stated base.
    """

    target: Annotated[IntArray, Column("n")]
    station: Annotated[IntArray, Column("n")]
    carried: Annotated[Array, Column("n 3", unit="m", fill=0.0)] = EMPTY


class Observation(Protocol):
    """Anything that can be linearised and has a posture in every row: points, lengths, touches."""

    @property
    def visits(self) -> ArmVisits:
        """Postures of the rows."""
        ...

    @property
    def rows(self) -> IntArray:
        """(n,) row of the measurement set each entry came from."""
        ...

    def linearise(
        self, layout: ParameterLayout, state: State, part: Entries = ...
    ) -> Linearisation:
        """Returns residual, Jacobian and covariance of the rows in ``part``."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class PointObservation:
    """Points that an instrument has seen, or full poses of a target: point and orientation.

    Attributes:
        visits: Postures and loads.
        position: (n, 3) m in the frame of the visit's station.
        rotation: (n, 3, 3) in that frame; None: points alone.
        covariance: (n, 3, 3) m^2, of poses (n, 6, 6) m^2 and rad^2 (left rotation vector):
            instrument and repeatability, same frame.
        rows: (n,) rows of the measurement set.
    """

    visits: ArmVisits
    position: Array
    rotation: Array | None = None
    covariance: Array
    rows: IntArray

    def linearise(
        self, layout: ParameterLayout, state: State, part: Entries = slice(None)
    ) -> Linearisation:
        """Returns the linearised rows; residual (n, 3) m, or (n, 6): m, then rad."""
        posed = self.rotation is not None
        point, rotation, jacobian = seen_points(layout, state, self.visits, part, rotations=posed)
        residual = self.position[part] - point
        if self.rotation is not None:
            angle = rotation_vector_from_matrix(self.rotation[part] @ np.swapaxes(rotation, 1, 2))
            jacobian[:, 3:] = _right_inverse(angle) @ jacobian[:, 3:]
            residual = np.concatenate([residual, angle], axis=1)
        return Linearisation(
            residual=residual,
            jacobian=jacobian,
            covariance=self.covariance[part],
            white=np.repeat(np.eye(2), 3, axis=1)[:, : residual.shape[1]],
        )


def linearise_all(
    observations: Sequence[Observation], layout: ParameterLayout, state: State
) -> tuple[Linearisation, ...]:
    """Returns all rows linearised, in chunks."""
    return tuple(
        o.linearise(layout, state, slice(start, start + CHUNK))
        for o in observations
        for start in range(0, len(o.rows), CHUNK)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearRows:
    """Rows of one kind, z = H x + noise: n rows of m numbers, p coefficients.

    Attributes:
        columns: (n, m, p) H.
        values: (n, m) z.
        covariance: (n, m, m) of instrument and repeatability.
        white: (2, m) multiples of the white noise of lengths and of angles in each number.
        rows: (n,) rows of the set.
    """

    columns: Array
    values: Array
    covariance: Array
    white: Array
    rows: IntArray

    def total(self, noise: Array) -> Array:
        """Returns the covariance (n, m, m) with white variance (2,) of lengths and angles."""
        out: Array = self.covariance + (noise @ self.white) * np.eye(self.values.shape[1])
        return out


def linear_rows(
    observations: Sequence[Observation],
    layout: ParameterLayout,
    state: State,
    about: Array,
    terms: Sequence[Term],
    values: Array,
    chosen: BoolArray | None = None,
) -> Iterator[LinearRows]:
    """Yields rows over all coefficients: those of the layout, then the terms'; ROWS at a time.

    Args:
        observations: Of one measurement set.
        layout: Physical parameters.
        state: Where they are linearised.
        about: (P,) their values there.
        terms: Beyond them.
        values: (k,) their parameters, where those that are not linear are linearised.
        chosen: Mask over the rows of the set; all if None.
    """
    for observation in observations:
        entries = np.arange(len(observation.rows))
        if chosen is not None:
            entries = entries[chosen[observation.rows]]
        for start in range(0, len(entries), ROWS):
            part = entries[start : start + ROWS]
            item = observation.linearise(layout, state, part)
            at = observation.visits.take(part)
            learned, shift = term_columns(state.robot, at, item.jacobian, terms, values)
            yield LinearRows(
                columns=np.concatenate([item.jacobian, *learned], axis=2),
                values=item.residual + item.jacobian @ about - shift,
                covariance=item.covariance,
                white=item.white,
                rows=observation.rows[part],
            )


def join_chunks(parts: list[Array], observations: Sequence[Observation]) -> tuple[Array, ...]:
    """Returns joined chunks, one array per observation."""
    out, start = [], 0
    for o in observations:
        count = -(-len(o.rows) // CHUNK)
        out.append(np.concatenate(parts[start : start + count]))
        start += count
    return tuple(out)


def observations_of(
    robot: RobotModel,
    measurements: MeasurementSet,
    payload: Load,
    *,
    repeatability: float,
    rotation_sd: float,
) -> tuple[PointObservation, ...]:
    """Returns the set as observations: rows with a full pose and rows with a point.

    Args:
        robot: Nominal arm; only its posture and masses are used, for the torques.
        measurements: The set, in base or in a tracker frame.
        payload: Load of rows that state none.
        repeatability: m, sd per axis of one visit.
        rotation_sd: rad per axis, where a row states no covariance of its orientation.
    """
    loads = payload.fill_rows(
        measurements.payload_mass, measurements.wrench, measurements.payload_com
    )
    torque, weight = stated_torque(robot, measurements.joints, loads)
    in_base = np.full(len(torque), IN_BASE)
    covariance = measurements.covariance + repeatability**2 * np.eye(3)
    posed = measurements.has_rotation
    visits = ArmVisits(
        joints=measurements.joints,
        torque=torque,
        weight=weight,
        approach=measurements.approach,
        conditions=measurements.conditions,
        target=measurements.target,
        station=measurements.station if measurements.frame == "tracker" else in_base,
        carried=measurements.carried,
    )
    points, poses = np.flatnonzero(~posed), np.flatnonzero(posed)
    out: list[PointObservation] = []
    if len(points):
        out.append(
            PointObservation(
                visits=visits.take(points),
                position=measurements.position[points],
                covariance=covariance[points],
                rows=points,
            )
        )
    if len(poses):
        angular = measurements.rotation_covariance[poses]
        known = np.isfinite(angular).all(axis=(1, 2), keepdims=True)
        full = np.zeros((len(poses), 6, 6))
        full[:, :3, :3] = covariance[poses]
        full[:, 3:, 3:] = np.where(known, angular, rotation_sd**2 * np.eye(3))
        out.append(
            PointObservation(
                visits=visits.take(poses),
                position=measurements.position[poses],
                rotation=measurements.rotation[poses],
                covariance=full,
                rows=poses,
            )
        )
    return tuple(out)


def _right_inverse(vector: Array) -> Array:
    """Jr^-1 (n, 3, 3) with log(exp(r) exp(-e)) = r - Jr^-1(r) e for small e."""
    angle = np.linalg.norm(vector, axis=1)
    small = angle < 1e-3
    safe = np.where(small, 1.0, angle)
    exact = 1.0 / safe**2 - 1.0 / (2.0 * safe * np.tan(safe / 2.0))
    second = np.where(small, 1.0 / 12.0 + angle**2 / 720.0, exact)[:, None, None]
    turn = skew(vector)
    out: Array = np.eye(3) + 0.5 * turn + second * (turn @ turn)
    return out


def seen_points(
    layout: ParameterLayout, state: State, visits: ArmVisits, part: Entries, *, rotations: bool
) -> tuple[Array, Array, Array]:
    """Returns point (n, 3), rotation (n, 3, 3) and Jacobian (n, 3 or 6, P), in the station's frame.

    Args:
        layout: The parameter vector.
        state: Where the Jacobian is taken.
        visits: ArmPostures, loads, stations.
        part: Which of them.
        rotations: Whether the Jacobian has the three rows of the rotation.
    """
    robot, joints, weight = state.robot, visits.joints[part], visits.weight[part]
    target, station = visits.target[part], visits.station[part]
    torque = visits.torque[part] + add_moments(weight, robot.moments)
    chain = walk(robot, joints, torque * robot.error("compliance"))
    count = 6 if rotations else 3
    rotation = chain.rotation.copy() if state.T_flange_target else chain.rotation
    point = chain.position.copy() if state.T_flange_target else chain.position
    for k, T in state.T_flange_target.items():
        mine = target == k
        rotation[mine] = chain.flange_rotation[mine] @ T[:3, :3]
        point[mine] = chain.flange_position[mine] + chain.flange_rotation[mine] @ T[:3, 3]
    shifted = replace(chain, position=point)
    moved = parameter_jacobian(robot, shifted, joints, torque, weight)[:, :count]
    out = np.zeros((len(joints), count, layout.size))
    out[:, :, : layout.robot_size] = moved
    blocks = layout.blocks
    for k in state.T_flange_target:
        mine = target == k
        place = blocks[f"target/{k}"]
        out[mine, :, parameter_slice(layout.dof, "tool")] = 0.0
        out[mine, :3, place.start : place.start + 3] = chain.flange_rotation[mine]
        if rotations and place.stop - place.start == 6:
            out[mine, 3:, place.start + 3 : place.stop] = chain.flange_rotation[mine]
    if visits.carried.any():
        point = point + visits.carried[part]
    for k, T in state.T_tracker_base.items():
        _into_station(out, point, rotation, np.equal(station, k), T, blocks[f"station/{k}"])
    return point, rotation, out


def _into_station(
    jacobian: Array, point: Array, rotation: Array, mine: BoolArray, T: Array, place: slice
) -> None:
    """Transforms the chosen rows from base to the tracker frame, in place."""
    turn = T[:3, :3]
    lever = point[mine] @ turn.T
    rows = jacobian[mine]
    for start in range(0, rows.shape[1], 3):
        rows[:, start : start + 3] = turn @ rows[:, start : start + 3]
    rows[:, :3, place.start : place.start + 3] = np.eye(3)
    if place.stop - place.start == 6:  # a place only shifts
        rows[:, :3, place.start + 3 : place.stop] = -skew(lever)
        if rows.shape[1] == 6:
            rows[:, 3:, place.start + 3 : place.stop] = np.eye(3)
    jacobian[mine] = rows
    point[mine] = lever + T[:3, 3]
    rotation[mine] = turn @ rotation[mine]


def station_poses(station: IntArray, T_tracker_base: Mapping[int, Array]) -> Array:
    """Returns T_tracker_base (n, 4, 4) of the set-ups of n rows.

    Raises:
        ModelMismatchError: A station that is not known.
    """
    unknown = sorted(set(station.tolist()) - set(T_tracker_base))
    if unknown:
        raise ModelMismatchError(
            f"tracker station {unknown[0]} is not in the model, which has "
            f"{sorted(T_tracker_base)}.",
            hint="calibrate with rows of that station, or register it first.",
        )
    return np.stack([T_tracker_base[int(k)] for k in station])


def take_to_base(
    measurements: MeasurementSet, T_tracker_base: Mapping[int, Array]
) -> MeasurementSet:
    """Returns the set with positions, orientations and covariances in base.

    Args:
        measurements: In tracker frames; a set in base comes back as it is.
        T_tracker_base: (4, 4) of every set-up that is known.

    Raises:
        ModelMismatchError: A station that is not known.
    """
    if measurements.frame == "base":
        return measurements
    T = inverse(station_poses(measurements.station, T_tracker_base))
    turn = T[:, :3, :3]
    back = np.swapaxes(turn, 1, 2)
    return replace(
        measurements,
        frame="base",
        position=apply(T, measurements.position) - measurements.carried,
        covariance=turn @ measurements.covariance @ back,
        rotation=turn @ measurements.rotation,
        rotation_covariance=turn @ measurements.rotation_covariance @ back,
    )
