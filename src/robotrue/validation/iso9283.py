"""Pose and path characteristics with the symbols of ISO 9283:1998.

Pose accuracy AP (clause 7.2.1), pose repeatability RP (7.2.2), path accuracy AT (8.2), path
repeatability RT (8.3). These need *repeated* visits to commanded poses; one visit each of many
poses, the usual calibration data, gives error statistics but no AP or RP.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray, frozen
from robotrue.core.rotations import wrap
from robotrue.errors import ShapeError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.configuration import controller_axes
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseCharacteristics:
    """Accuracy and repeatability at one commanded pose, from n cycles.

    Attributes:
        n: Cycles.
        AP_p: m, positioning accuracy, distance of the barycentre from the command.
        AP_xyz: (3,) m, AP_x, AP_y, AP_z, signed.
        AP_abc: (3,) rad, AP_a, AP_b, AP_c, signed; NaN without orientations.
        RP_l: m, positioning repeatability.
        RP_abc: (3,) rad, RP_a, RP_b, RP_c (plus or minus); NaN without orientations.
        barycentre: (3,) m, mean attained position.
    """

    n: int
    AP_p: float
    AP_xyz: Array
    AP_abc: Array
    RP_l: float
    RP_abc: Array
    barycentre: Array


def pose_characteristics(
    commanded: Array,
    attained: Array,
    *,
    commanded_abc: Array | None = None,
    attained_abc: Array | None = None,
) -> PoseCharacteristics:
    """Returns AP and RP at one pose.

    With attained positions p_i, barycentre p_bar and command p_c::

        AP_p = |p_bar - p_c|            AP_x = x_bar - x_c, ...
        l_i  = |p_i - p_bar|            S_l  = sqrt(sum (l_i - l_bar)^2 / (n - 1))
        RP_l = l_bar + 3 S_l
        AP_a = a_bar - a_c              RP_a = 3 sqrt(sum (a_i - a_bar)^2 / (n - 1))

    Args:
        commanded: (3,) m.
        attained: (n, 3) m, one row per cycle; the standard requires n = 30.
        commanded_abc: (3,) rad, Euler angles of the command.
        attained_abc: (n, 3) rad, in the same order of angles.

    Raises:
        ShapeError: Fewer than two cycles, or only one of the two orientations given.

    Fails when: the second Euler angle is near +-90 deg; the angles then jump though the tool does
    not. Choose axes in which it is not.
    """
    target = frozen(commanded, (3,), "commanded")
    points = frozen(attained, (None, 3), "attained")
    _enough_cycles(len(points))
    centre = points.mean(axis=0)
    lengths = np.linalg.norm(points - centre, axis=1)
    angle_accuracy, angle_repeatability = np.full(3, np.nan), np.full(3, np.nan)
    if (commanded_abc is None) != (attained_abc is None):
        raise ShapeError(
            "orientations of the command and of the cycles go together: one is missing."
        )
    if commanded_abc is not None and attained_abc is not None:
        # Differences are wrapped before averaging: 179 and -179 deg are neighbours.
        aim = frozen(commanded_abc, (3,), "commanded_abc")
        turned = wrap(frozen(attained_abc, (len(points), 3), "attained_abc") - aim)
        angle_accuracy = turned.mean(axis=0)
        angle_repeatability = 3.0 * turned.std(axis=0, ddof=1)
    return PoseCharacteristics(
        n=len(points),
        AP_p=float(np.linalg.norm(centre - target)),
        AP_xyz=frozen(centre - target, (3,), "AP_xyz"),
        AP_abc=frozen(angle_accuracy, (3,), "AP_abc", allow_nan=True),
        RP_l=float(lengths.mean() + 3.0 * lengths.std(ddof=1)),
        RP_abc=frozen(angle_repeatability, (3,), "RP_abc", allow_nan=True),
        barycentre=frozen(centre, (3,), "barycentre"),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class PathCharacteristics:
    """Accuracy and repeatability along a path, from n cycles at m stations.

    Attributes:
        n: Cycles.
        AT_p: m, path accuracy: the largest distance of a barycentre from the command.
        RT_p: m, path repeatability: the largest spread.
        AT_p_at: (m,) m, distance of the barycentre at each station.
        RT_p_at: (m,) m, ``l_bar + 3 S_l`` at each station.
        AT_station: Index of the station that gives AT_p.
        RT_station: Index of the station that gives RT_p.
    """

    n: int
    AT_p: float
    RT_p: float
    AT_p_at: Array
    RT_p_at: Array
    AT_station: int
    RT_station: int


def path_characteristics(commanded: Array, attained: Array) -> PathCharacteristics:
    """Returns AT and RT of a path.

    At each station i along the command, in the plane normal to it::

        AT_p = max_i |p_bar_i - p_c_i|
        RT_p = max_i (l_bar_i + 3 S_l_i),   l_ij = |p_ij - p_bar_i|

    Args:
        commanded: (m, 3) m, stations on the commanded path.
        attained: (n, m, 3) m, where each cycle crosses the normal plane of each station; the
            standard requires n = 10.

    Raises:
        ShapeError: Fewer than two cycles, or shapes that do not match.
    """
    stations = frozen(commanded, (None, 3), "commanded")
    cycles = frozen(attained, (None, len(stations), 3), "attained")
    _enough_cycles(len(cycles))
    if not len(stations):
        raise ShapeError("a path without stations.")
    centre = cycles.mean(axis=0)
    lengths = np.linalg.norm(cycles - centre, axis=2)
    accuracy = np.linalg.norm(centre - stations, axis=1)
    repeatability = lengths.mean(axis=0) + 3.0 * lengths.std(axis=0, ddof=1)
    return PathCharacteristics(
        n=len(cycles),
        AT_p=float(accuracy.max()),
        RT_p=float(repeatability.max()),
        AT_p_at=frozen(accuracy, (None,), "AT_p_at"),
        RT_p_at=frozen(repeatability, (None,), "RT_p_at"),
        AT_station=int(np.argmax(accuracy)),
        RT_station=int(np.argmax(repeatability)),
    )


def _enough_cycles(n: int) -> None:
    if n < 2:
        raise ShapeError(
            f"{n} cycle(s), repeatability needs at least 2 (the standard asks for 30 poses, 10 "
            "paths)."
        )


CYCLES: Final = 30
"""Cycles required by ISO 9283 at each pose; with fewer its symbols are not used."""
SAME: Final = 1e-6
"""rad; joints that differ by less were commanded alike (0.001 mm at 1 m)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RepeatedPose:
    """One pose visited several times.

    Attributes:
        rows: Rows of the check.
        axes: (dof,) rad, commanded, as the controller displays them.
        characteristics: Of the visits, against the nominal arm.
        compensated: m, distance of the mean from the prediction; NaN without predictions.
    """

    rows: IntArray
    axes: Array
    characteristics: PoseCharacteristics
    compensated: float

    @property
    def is_standard(self) -> bool:
        """True if the number of cycles meets ISO 9283."""
        return len(self.rows) >= CYCLES


def repeated_poses(
    robot: RobotModel, measured: MeasurementSet, after: Array
) -> tuple[RepeatedPose, ...]:
    """Returns every pose that was visited twice or more, in the order of first visits.

    Visits of one pose have the same joints, payload and wrench.

    Args:
        robot: The nominal arm with the measured tool.
        measured: Rows in base.
        after: (n, 3) m, measured minus predicted.
    """
    key = np.column_stack(
        [
            np.round(measured.joints / SAME),
            np.nan_to_num(measured.payload_mass, nan=-1.0),
            measured.wrench,
        ]
    )
    _, first, group = np.unique(key, axis=0, return_index=True, return_inverse=True)
    found = []
    for g in np.argsort(first, kind="stable"):
        rows = np.flatnonzero(group.ravel() == g)
        if len(rows) < 2:
            continue
        joints = measured.joints[rows[0]]
        commanded = forward(robot.nominal(), joints[None])[0, :3, 3]
        found.append(
            RepeatedPose(
                rows=rows,
                axes=controller_axes(robot, joints),
                characteristics=pose_characteristics(commanded, measured.position[rows]),
                compensated=float(np.linalg.norm(after[rows].mean(axis=0))),
            )
        )
    return tuple(found)
