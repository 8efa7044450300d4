"""Lengths as observations: from the reflector to an anchor, or between two poses of the arm.

With v from the other end to the reflector a length is |v|, and its derivative v/|v| dv. An anchor
is a place of the layout, a station without axes: its columns shift it. Nothing turns with the
whole, so the turn of the base is not seen, and its place only together with the anchors'.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotrue.calibration.observations import (
    IN_BASE,
    ArmVisits,
    Entries,
    Linearisation,
    seen_points,
)
from robotrue.calibration.parameters import ParameterLayout, State
from robotrue.core.arrays import Array, IntArray
from robotrue.errors import ImplausibleDataError
from robotrue.measurement.length_set import LengthSet
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
