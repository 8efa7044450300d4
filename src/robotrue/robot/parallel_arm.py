"""The arm whose axes 2, 3 and 4 are parallel: most light arms, Universal Robots among them.

Axes 5 and 6 meet in a point; axis 5 is perpendicular to axes 4 and 6, axis 1 to axis 2. The inverse
has eight closed branches, numbered as those of :mod:`robotrue.robot.inverse`:

* ``shoulder`` 0: the meeting point of axes 5 and 6 is on the side of axis 1 where it is with all
  joints at zero, 1: on the other.
* ``elbow`` 0: the forearm is turned in the positive sense of axis 2 against the upper arm.
* ``wrist_flip`` 0: axis 5 turns axis 6 away from axis 4 in its positive sense.

Everything follows from the joint axes at q = 0, so a DH table of any convention or a URDF is
enough. The joints are solved one by one: joint 1 from the distance of the meeting point to the
plane of the arm, joint 5 from the angle between axes 4 and 6, joint 6 from the direction of axis 4
in the hand, and joints 2 to 4 from a plane triangle (the subproblems of Paden 1986 and Kahan 1983;
Murray, Li, Sastry 1994, section 3.3). Arc cosines are taken as arc tangents of both sides, so that
a stretched arm and a straight wrist keep their digits.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import inverse as inverse_pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.robot.forward import forward, walk
from robotrue.robot.model import Convention, RobotModel
from robotrue.robot.opw import TOLERANCE, bare_arm, is_unimodular, pack_table

STRAIGHT: Final = 1e-9
"""Sine of the wrist below which joint 6 is open, and the previous one is kept."""
_ROUNDING: Final = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class ParallelGeometry(Columns):
    """An arm with axes 2 to 4 parallel, at zero joints.

    Attributes:
        axis: (6, 3) unit vectors in base.
        point: (6, 3) m, a point on each axis, in base.
        centre: (3,) m, where axes 5 and 6 meet, in base.
        T_base_flange: (4, 4).
        ahead: +1 or -1: the side of axis 1 that counts as ahead, along axis 1 x axis 2.
        joint_map: (6, 6) of the robot, integer with an integer inverse.
    """

    axis: Annotated[Array, Column("6 3")]
    point: Annotated[Array, Column("6 3", unit="m")]
    centre: Annotated[Array, Column("3", unit="m")]
    T_base_flange: Annotated[Array, Column("4 4")]
    ahead: float
    joint_map: Annotated[Array, Column("6 6")]

    def angles(self, joints: Array) -> Array:
        """Returns the turn of each axis (..., 6) rad from q (..., 6) rad."""
        return np.asarray(joints @ self.joint_map.T)

    def joints(self, angles: Array) -> Array:
        """Returns q (..., 6) rad from the turn of each axis (..., 6) rad."""
        return np.asarray(angles @ np.rint(np.linalg.inv(self.joint_map)).T)

    @property
    def sense(self) -> Array:
        """(3,) +1 or -1: axes 2, 3 and 4 against axis 2."""
        return np.asarray(np.sign(self.axis[1:4] @ self.axis[1]))

    @property
    def links(self) -> Array:
        """(4,) complex m, across axis 2: axis 1 to 2, 2 to 3, 3 to 4, axis 4 to the centre.

        The real part is along axis 1, the imaginary part along axis 2 x axis 1.
        """
        stops = np.stack([self.point[0], *self.point[1:4], self.centre])
        return self._across(np.diff(stops, axis=0))

    @property
    def stretch(self) -> float:
        """Metres from axis 2 to the centre with everything in line."""
        return float(np.abs(self.links[1:]).sum())

    def span(self, T_base_flange: Array) -> Array:
        """Returns the least distance of the centre from axis 2 in the plane of the arm, (n,) m."""
        moved = T_base_flange @ inverse_pose(self.T_base_flange)
        away = moved[:, :3, :3] @ self.centre + moved[:, :3, 3] - self.point[0]
        up, aside = away @ self.axis[0], (self.centre - self.point[0]) @ self.axis[1]
        out = np.sqrt(np.maximum((away**2).sum(axis=1) - up**2 - aside**2, 0.0))
        shoulder = self.links[0]
        return np.asarray(np.hypot(up - shoulder.real, out - abs(shoulder.imag)))

    def singular_measures(self, joints: Array) -> Array:
        """Returns sine of wrist, sine of elbow (signs dropped) and m from axis 1, (..., 3).

        The determinant of the Jacobian is their product times a constant.
        """
        return np.asarray(np.abs(np.stack(self._posture(joints), axis=-1)))

    def branches(self, joints: Array) -> IntArray:
        """Returns the branch numbers (n,) of joints (n, 6) rad, see the head of this module."""
        wrist, elbow, ahead = self._posture(np.asarray(joints, dtype=np.float64))
        return np.asarray(4 * (wrist < 0.0) + 2 * (ahead < 0.0) + (elbow < 0.0), dtype=np.int64)

    def _posture(self, joints: Array) -> tuple[Array, Array, Array]:
        """Sine of the wrist, sine of the elbow, and m that the centre is ahead of axis 1."""
        angles = self.angles(joints)
        turn = np.cumsum(angles[..., 1:4] * self.sense, axis=-1)
        first, *rest = self.links
        along = first + (np.exp(1j * turn) * np.array(rest)).sum(axis=-1)
        fold = turn[..., 1] - turn[..., 0] + self._fold_at_zero()
        return (
            np.sin(angles[..., 4] - self._wrist_at_zero()),
            np.sin(fold),
            -self.ahead * along.imag,
        )

    def _fold_at_zero(self) -> float:
        return float(np.angle(self.links[2] / self.links[1]))

    def _wrist_at_zero(self) -> float:
        """Turn of axis 5 that lays axis 6 along axis 2."""
        _, _, _, _, five, six = self.axis
        return float(np.arctan2(self.axis[1] @ np.cross(five, six), self.axis[1] @ six))

    def _across(self, vectors: Array) -> Array:
        one, two = self.axis[:2]
        return np.asarray(vectors @ one + 1j * (vectors @ np.cross(two, one)))


def solve_branches(arm: ParallelGeometry, T_base_flange: Array, near: Array) -> Array:
    """Returns the joints of all eight branches (n, 8, 6) rad, turns not wrapped; NaN without one.

    Args:
        arm: The arm.
        T_base_flange: (n, 4, 4).
        near: (n, 6) rad; supplies joint 6 where the wrist is straight.
    """
    moved = T_base_flange @ inverse_pose(arm.T_base_flange)
    known6 = arm.angles(near)[:, 5]
    out = np.empty((len(moved), 8, 6))
    for shoulder, first in enumerate(_first_angles(arm, moved)):
        seen = _turn_back(arm, first, moved)
        for flip, sign in enumerate((1.0, -1.0)):
            fifth, sixth = _wrist_angles(arm, seen, sign, known6)
            for elbow, plane in enumerate(_plane_angles(arm, seen, fifth, sixth)):
                all_six = np.stack([first, *plane, fifth, sixth], axis=1)
                all_six[np.isnan(all_six).any(axis=1)] = np.nan
                out[:, 4 * flip + 2 * shoulder + elbow] = all_six
    return arm.joints(out)


def _first_angles(arm: ParallelGeometry, moved: Array) -> list[Array]:
    """Joint 1 of both shoulders: it brings the centre to its distance from the arm's plane."""
    one, two = arm.axis[:2]
    away = moved[:, :3, :3] @ arm.centre + moved[:, :3, 3] - arm.point[0]
    aside = (arm.centre - arm.point[0]) @ two
    across, beside = away @ np.cross(one, two), away @ two
    rest = across**2 + beside**2 - aside**2
    with np.errstate(invalid="ignore"):
        ahead = arm.ahead * np.sqrt(np.where((rest < 0.0) & (rest > -_ROUNDING), 0.0, rest))
    heading = np.arctan2(across, beside)
    return [heading - np.arctan2(ahead, aside), heading - np.arctan2(-ahead, aside)]


def _turn_back(arm: ParallelGeometry, first: Array, moved: Array) -> Array:
    """Returns the required motion of joints 2 to 6, (n, 4, 4): ``moved`` without joint 1."""
    back = matrix_from_rotation_vector(-first[:, None] * arm.axis[0])
    out = moved.copy()
    out[:, :3, :3] = back @ moved[:, :3, :3]
    away = moved[:, :3, 3] - arm.point[0]
    out[:, :3, 3] = (back @ away[:, :, None])[:, :, 0] + arm.point[0]
    return out


def _wrist_angles(
    arm: ParallelGeometry, seen: Array, sign: float, known6: Array
) -> tuple[Array, Array]:
    """Joints 5 and 6: the angle between axes 4 and 6, and the direction of axis 4 in the hand."""
    two, five, six = arm.axis[1], arm.axis[4], arm.axis[5]
    along6 = seen[:, :3, :3] @ six
    cosine = along6 @ two
    sine = np.linalg.norm(along6 - cosine[:, None] * two, axis=1)
    fifth = arm._wrist_at_zero() + sign * np.arctan2(sine, cosine)
    in_hand = np.swapaxes(seen[:, :3, :3], 1, 2) @ two
    wanted = matrix_from_rotation_vector(-fifth[:, None] * five) @ two
    turned = (np.cross(in_hand, wanted) @ six, (in_hand * wanted).sum(axis=1))
    level = turned[1] - (in_hand @ six) * (wanted @ six)
    return fifth, np.where(sine < STRAIGHT, known6, np.arctan2(turned[0], level))


def _plane_angles(
    arm: ParallelGeometry, seen: Array, fifth: Array, sixth: Array
) -> list[tuple[Array, Array, Array]]:
    """Joints 2, 3 and 4 of both elbows: a triangle across axis 2."""
    five, six = arm.axis[4], arm.axis[5]
    hand = matrix_from_rotation_vector(-sixth[:, None] * six)
    hand = hand @ matrix_from_rotation_vector(-fifth[:, None] * five)
    rotation = seen[:, :3, :3] @ hand
    turn = np.angle(arm._across(rotation @ arm.axis[0]))
    lever = hand @ (arm.point[3] - arm.centre) + arm.centre
    wrist = (seen[:, :3, :3] @ lever[:, :, None])[:, :, 0] + seen[:, :3, 3]
    place = arm._across(wrist - arm.point[1])
    _, upper, fore, _ = arm.links
    product = abs(upper) * abs(fore)
    cosine = (np.abs(place) ** 2 - abs(upper) ** 2 - abs(fore) ** 2) / (2.0 * product)
    rest = 1.0 - cosine**2
    with np.errstate(invalid="ignore"):
        sine = np.sqrt(np.where((rest < 0.0) & (rest > -2.0 * _ROUNDING), 0.0, rest))
    out = []
    for sign in (1.0, -1.0):
        fold = sign * np.arctan2(sine, cosine) - arm._fold_at_zero()
        lead = np.angle(place) - np.angle(upper + np.exp(1j * fold) * fore)
        two, three, four = arm.sense[:, None] * np.stack([lead, fold, turn - lead - fold])
        out.append((two, three, four))
    return out


def parallel_geometry(robot: RobotModel) -> ParallelGeometry | None:
    """Returns the geometry of the nominal arm, or None if it is not of this kind.

    Errors, compliance and the tool of ``robot`` are left aside. The result is checked on eight
    postures to 1e-9 m before it is returned.

    Fails when: the table holds right angles rounded coarser than 1e-9 rad (1.5708), or a
    manufacturer's calibration: such an arm is not of this kind to the accuracy promised.
    """
    if robot.dof != 6 or not is_unimodular(robot.joint_map):
        return None
    return _from_table(robot.convention, pack_table(robot))


@lru_cache(maxsize=64)
def _from_table(convention: Convention, table: bytes) -> ParallelGeometry | None:
    bare = bare_arm(convention, table)
    arm = _read_axes(bare)
    if arm is None:
        return None
    probes = 2.0 * np.sin(7.0 * np.linspace(-2.9, 2.9, 48).reshape(8, 6))
    poses = forward(bare, probes)
    found = solve_branches(arm, poses, probes)[np.arange(8), arm.branches(probes)]
    gap = np.abs(forward(bare, found) - poses).max()
    return arm if gap < TOLERANCE * max(1.0, bare.reach) else None


def _read_axes(bare: RobotModel) -> ParallelGeometry | None:
    state = walk(bare, np.zeros((1, 6)))
    axis, point = state.joint_axis[0], state.joint_origin[0]
    one, two, three, four, five, six = axis
    parallel = max(float(np.linalg.norm(np.cross(two, each))) for each in (three, four))
    square = max(abs(float(each)) for each in (one @ two, two @ five, five @ six))
    normal = np.cross(five, six)
    apart = abs(float(normal @ (point[5] - point[4])))
    if max(parallel, square, apart) > TOLERANCE:
        return None
    along = np.stack([five, -six, normal], axis=1)
    centre = point[4] + np.linalg.solve(along, point[5] - point[4])[0] * five
    side = float((centre - point[0]) @ np.cross(one, two))
    arm = ParallelGeometry(
        axis=axis,
        point=point,
        centre=centre,
        T_base_flange=state.transforms[0],
        ahead=-1.0 if side < -TOLERANCE else 1.0,
        joint_map=bare.joint_map,
    )
    return arm if np.abs(arm.links[1:3]).min() > TOLERANCE else None
