"""The ortho-parallel arm with a spherical wrist: seven lengths, six signs, six offsets.

Most heavy industrial arms are of this kind: joint 1 vertical, joints 2 and 3 parallel and at right
angles to it, three wrist axes through one point. Their inverse has eight closed branches
(:mod:`robotrue.robot.inverse`). The geometry is read off the joint axes of the nominal arm, so a
standard or modified DH table with any choice of zero and sense is enough.

Source of the parameters: Brandstoetter, Angerer, Hofbaur 2014, "An analytical solution of the
inverse kinematics problem of industrial serial manipulators with an ortho-parallel basis and a
spherical wrist", fig. 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import inverse as inverse_pose
from robotrue.core.poses import pose
from robotrue.core.rotations import wrap
from robotrue.robot.forward import forward, walk
from robotrue.robot.model import Convention, RobotModel

TOLERANCE: Final = 1e-9
"""m or rad by which an axis may miss the ideal; a table rounded coarser is not ortho-parallel."""
_PROBES: Final = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class OpwGeometry(Columns):
    """An ortho-parallel arm. All angles zero: arm and forearm point straight up.

    ``theta_opw = sign * (joint_map @ q) + offset``; for an arm without a parallelogram
    ``joint_map`` is the identity.

    Attributes:
        a1: m, axis 1 to axis 2, horizontally; never negative.
        a2: m, axis 3 to the forearm axis; positive on the side the forearm folds to.
        b: m, sideways offset of the wrist point.
        c1: m, height of axis 2.
        c2: m, axis 2 to axis 3.
        c3: m, axis 3 to the wrist point along the forearm.
        c4: m, wrist point to the flange along axis 6.
        sign: (6,) +1 or -1.
        offset: (6,) rad.
        T_opw_flange: (4, 4) constant pose of the DH table's flange in the OPW flange (z along
            axis 6, x in the arm plane at zero); most often a rotation about z.
        joint_map: (6, 6) of the robot, integer with an integer inverse.
    """

    a1: float
    a2: float
    b: float
    c1: float
    c2: float
    c3: float
    c4: float
    sign: Annotated[Array, Column("6")]
    offset: Annotated[Array, Column("6", unit="rad")]
    T_opw_flange: Annotated[Array, Column("4 4")]
    joint_map: Annotated[Array, Column("6 6")]

    def angles(self, joints: Array) -> Array:
        """Returns theta_opw (..., 6) rad from q (..., 6) rad."""
        return self.sign * (joints @ self.joint_map.T) + self.offset

    def joints(self, angles: Array) -> Array:
        """Returns q (..., 6) rad from theta_opw (..., 6) rad, turns not wrapped."""
        serial = self.sign * (angles - self.offset)
        out: Array = serial @ np.rint(np.linalg.inv(self.joint_map)).T
        return out

    def wrist_point(self, angles: Array) -> tuple[Array, Array]:
        """Returns where the wrist point is in the frame turned with joint 1: forward and up.

        Args:
            angles: (..., 6) rad, theta_opw.

        Returns:
            Distance forward of axis 1 in the arm plane (...,) m, height over the base (...,) m.
        """
        length, lead = np.hypot(self.a2, self.c3), np.arctan2(self.a2, self.c3)
        upper, fore = angles[..., 1], angles[..., 1] + angles[..., 2] + lead
        forward_m = self.a1 + self.c2 * np.sin(upper) + length * np.sin(fore)
        return forward_m, self.c1 + self.c2 * np.cos(upper) + length * np.cos(fore)

    @property
    def stretch(self) -> float:
        """Metres from axis 1 to the wrist point with everything in line."""
        return self.a1 + self.c2 + float(np.hypot(self.a2, self.c3))

    def span(self, T_base_flange: Array) -> Array:
        """Returns the distance of the wrist point from the middle of the shoulder, (n,) m."""
        axis6 = T_base_flange[:, :3, :3] @ self.T_opw_flange[:3, :3].T[:, 2]
        wrist = T_base_flange[:, :3, 3] - self.c4 * axis6
        return np.asarray(np.linalg.norm(wrist - [0.0, 0.0, self.c1], axis=1))

    def singular_measures(self, joints: Array) -> Array:
        """Returns sine of wrist, sine of elbow (signs dropped) and m from axis 1, (..., 3).

        The determinant of the Jacobian is their product times a constant.
        """
        bend, fold, ahead = self.posture(joints)
        return np.asarray(np.abs(np.stack([np.sin(bend), np.sin(fold), ahead], axis=-1)))

    def branches(self, joints: Array) -> IntArray:
        """Returns the branch numbers (n,) of joints (n, 6) rad.

        :mod:`robotrue.robot.inverse` defines them.
        """
        bend, fold, ahead = self.posture(joints)
        return np.asarray(4 * (bend < 0.0) + 2 * (ahead < 0.0) + (fold < 0.0), dtype=np.int64)

    def posture(self, joints: Array) -> tuple[Array, Array, Array]:
        """Returns the quantities that define the branch of joints (..., 6) rad.

        Returns:
            Turn of axis 5 and fold of the elbow, both (...,) rad in (-pi, pi], and the distance of
            the wrist point ahead of axis 1, (...,) m.
        """
        angles = self.angles(np.asarray(joints, dtype=np.float64))
        ahead, _ = self.wrist_point(angles)
        fold = wrap(angles[..., 2] + np.arctan2(self.a2, self.c3))
        return wrap(angles[..., 4]), fold, ahead


def opw_forward(geometry: OpwGeometry, joints: Array) -> Array:
    """Returns T_base_flange (n, 4, 4) from q (n, 6) rad by the closed OPW form."""
    angles = geometry.angles(np.asarray(joints, dtype=np.float64))
    ahead, up = geometry.wrist_point(angles)
    cosine, sine = np.cos(angles[:, 0]), np.sin(angles[:, 0])
    centre = np.stack(
        [cosine * ahead - sine * geometry.b, sine * ahead + cosine * geometry.b, up], axis=1
    )
    rotation = forearm_rotation(angles) @ _zyz(angles[:, 3], angles[:, 4], angles[:, 5])
    out: Array = pose(rotation, centre + geometry.c4 * rotation[:, :, 2]) @ geometry.T_opw_flange
    return out


def forearm_rotation(angles: Array) -> Array:
    """Returns Rz(theta1) Ry(theta2 + theta3), the forearm in base, (n, 3, 3)."""
    return _zyz(angles[:, 0], angles[:, 1] + angles[:, 2], np.zeros(len(angles)))


def _zyz(first: Array, second: Array, third: Array) -> Array:
    ca, sa, cb, sb = np.cos(first), np.sin(first), np.cos(second), np.sin(second)
    cc, sc = np.cos(third), np.sin(third)
    out = np.empty((len(first), 3, 3))
    out[:, 0, 0], out[:, 0, 1], out[:, 0, 2] = (
        ca * cb * cc - sa * sc,
        -ca * cb * sc - sa * cc,
        ca * sb,
    )
    out[:, 1, 0], out[:, 1, 1], out[:, 1, 2] = (
        sa * cb * cc + ca * sc,
        -sa * cb * sc + ca * cc,
        sa * sb,
    )
    out[:, 2, 0], out[:, 2, 1], out[:, 2, 2] = -sb * cc, sb * sc, cb
    return out


def opw_geometry(robot: RobotModel) -> OpwGeometry | None:
    """Returns the ortho-parallel geometry of the nominal arm, or None if it is not of that kind.

    Errors, compliance and the tool of ``robot`` are left aside. The result is checked against
    :func:`robotrue.robot.forward.forward` on eight postures to 1e-9 m before it is returned.

    Fails when: the table holds right angles rounded coarser than 1e-9 rad (1.5708): such an arm is
    not ortho-parallel to the accuracy promised, and None is returned.
    """
    if robot.dof != 6 or not is_unimodular(robot.joint_map):
        return None
    return _from_table(robot.convention, pack_table(robot))


def pack_table(robot: RobotModel) -> bytes:
    """Returns the nominal table of an arm and its joint map, to keep by what is read from it."""
    table = [robot.theta, robot.d, robot.a, robot.alpha, robot.beta, robot.joint_map.ravel()]
    return np.concatenate(table).tobytes()


def bare_arm(convention: Convention, table: bytes) -> RobotModel:
    """Returns the nominal arm of six joints of a table from :func:`pack_table`, without a tool."""
    theta, d, a, alpha, beta, *rod = np.frombuffer(table).reshape(-1, 6)
    return RobotModel(
        name="bare", convention=convention, theta=theta, d=d, a=a, alpha=alpha,
        beta=beta, joint_map=np.array(rod),
    )  # fmt: skip


@lru_cache(maxsize=64)
def _from_table(convention: Convention, table: bytes) -> OpwGeometry | None:
    """Kept by table: every inverse needs it, and deriving it costs as much as 1000 inverses."""
    bare = bare_arm(convention, table)
    geometry = _read_axes(bare)
    if geometry is None:
        return None
    span = np.linspace(-2.9, 2.9, 6 * _PROBES)
    probes = np.sin(7.0 * span.reshape(_PROBES, 6)) * np.pi
    gap = np.abs(opw_forward(geometry, probes) - forward(bare, probes)).max()
    return geometry if gap < TOLERANCE * max(1.0, bare.reach) else None


def is_unimodular(matrix: Array) -> bool:
    """True if whole turns of q are whole turns of theta and vice versa."""
    whole = bool(np.all(matrix == np.rint(matrix)))
    return whole and bool(np.isclose(abs(np.linalg.det(matrix)), 1.0))


def _read_axes(bare: RobotModel) -> OpwGeometry | None:
    """Reads lengths, senses and zeros off the joint axes at q = 0."""
    state = walk(bare, np.zeros((1, 6)))
    axis, origin = state.joint_axis[0], state.joint_origin[0]
    ez = np.array([0.0, 0.0, 1.0])
    on_axis_1 = np.hypot(*origin[0, :2]) < TOLERANCE and np.hypot(*axis[0, :2]) < TOLERANCE
    right_angles = max(
        abs(axis[1] @ ez), abs(axis[3] @ axis[2]), abs(axis[4] @ axis[3]), abs(axis[5] @ axis[4])
    )
    skewed = np.linalg.norm(np.cross(axis[1], axis[2]))
    centre = _common_point(axis[3:], origin[3:])
    if not on_axis_1 or right_angles > TOLERANCE or skewed > TOLERANCE or centre is None:
        return None
    turn1, ex, ey = _arm_plane(axis[1], origin[1])
    plane = np.stack([ex, ez])  # (2, 3): forward, up
    shoulder, elbow, wrist = plane @ origin[1], plane @ origin[2], plane @ centre
    upper = elbow - shoulder
    fore_axis = plane @ axis[3]
    along = fore_axis @ (wrist - elbow)
    fore = fore_axis if along >= 0.0 else -fore_axis
    pitch2, pitch23 = np.arctan2(*upper), np.arctan2(*fore)
    side = np.array([fore[1], -fore[0]])  # forearm x: forearm z turned by +90 deg about y
    forearm = _zyz(*(np.array([v]) for v in (turn1, pitch23, 0.0)))[0]
    turn4 = _half_turn(forearm.T @ axis[4])
    before5 = forearm @ _zyz(np.array([turn4]), np.zeros(1), np.zeros(1))[0]
    reach6 = axis[5] @ (state.position[0] - centre)
    out = axis[5] if reach6 > -TOLERANCE else -axis[5]
    local = before5.T @ out
    turn5 = np.arctan2(local[0], local[2])
    hand = before5 @ _zyz(np.zeros(1), np.array([turn5]), np.zeros(1))[0]
    c4 = abs(float(reach6))
    T_base_opw = pose(hand, centre + c4 * hand[:, 2])
    sense = [
        axis[0] @ ez, axis[1] @ ey, axis[2] @ ey,
        axis[3] @ forearm[:, 2], axis[4] @ before5[:, 1], axis[5] @ out,
    ]  # fmt: skip
    return OpwGeometry(
        a1=float(shoulder[0]),
        a2=float(side @ (wrist - elbow)),
        b=float(centre @ ey),
        c1=float(shoulder[1]),
        c2=float(np.hypot(*upper)),
        c3=abs(float(along)),
        c4=c4,
        sign=np.sign(sense),
        offset=np.array([turn1, pitch2, pitch23 - pitch2, turn4, turn5, 0.0]),
        T_opw_flange=inverse_pose(T_base_opw) @ state.transforms[0],
        joint_map=bare.joint_map,
    )


def _arm_plane(axis2: Array, point2: Array) -> tuple[float, Array, Array]:
    """Returns theta1 at q = 0 and the plane's x and y, with axis 2 ahead of axis 1."""
    turn = _half_turn(axis2)
    if np.array([np.cos(turn), np.sin(turn)]) @ point2[:2] < -TOLERANCE:
        turn += np.pi if turn <= 0.0 else -np.pi
    ex = np.array([np.cos(turn), np.sin(turn), 0.0])
    return turn, ex, np.array([-ex[1], ex[0], 0.0])


def _half_turn(lateral: Array) -> float:
    """Returns the turn about z in (-90, 90] deg that takes y onto +-lateral (xy part)."""
    turn = float(np.arctan2(-lateral[0], lateral[1]))
    if turn > np.pi / 2 + TOLERANCE:
        return turn - np.pi
    return turn + np.pi if turn <= -np.pi / 2 + TOLERANCE else turn


def _common_point(axes: Array, points: Array) -> Array | None:
    """Returns the point all three lines pass through within the tolerance, else None."""
    project = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    point: Array = np.linalg.solve(project.sum(0), np.einsum("kij,kj->i", project, points))
    miss = np.einsum("kij,kj->ki", project, point - points)
    return point if float(np.abs(miss).max()) < TOLERANCE else None
