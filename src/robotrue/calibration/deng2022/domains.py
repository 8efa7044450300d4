"""The paper's poses with their errors, its domains and sub-spaces, mapped pairs, the overlap rule.

``x = (px, py, pz, rx, ry, rz)`` in m and rad: the tool point and the attitude Rz(rz) Ry(ry) Rx(rx)
in base (section 2.4). The Euler triple nearest to a reference is taken, so that a region has no
jump in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np
from scipy.spatial import cKDTree

from robotrue.calibration.deng2022.readings import AttitudeReading
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.regions import CylinderRegion, contains, divide_region, turn_region
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ModelMismatchError, ObservabilityError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel

PRINTED_UNITS = np.array([MM, MM, MM, DEG, DEG, DEG])
"""(6,) divide by it: the mm and deg the paper computes in."""


def attitude_reference(robot: RobotModel, joints: Array) -> Array:
    """Returns A, B, C (3,) rad of the pose in the middle of a set, by angle about joint 1.

    Args:
        robot: Nominal arm with the measured point as its tool.
        joints: (n, dof) rad, at least one row.
    """
    poses = forward(robot.nominal(), joints)
    angle = np.arctan2(poses[:, 1, 3], poses[:, 0, 3])
    middle = int(np.argsort(angle)[len(angle) // 2])
    return abc_from_matrix(poses[middle, :3, :3])


def pose_features(poses: Array, reference: Array) -> Array:
    """Returns x (n, 6) in m and rad of nominal poses T_base_tool (n, 4, 4).

    Args:
        poses: (n, 4, 4).
        reference: (3,) rad, A, B, C; the Euler triple nearest to it is taken.

    Fails when: the attitude is near ry = +-90 deg; rx and rz then jump between neighbours.
    """
    abc = abc_from_matrix(poses[:, :3, :3], near=reference)
    return np.concatenate([poses[:, :3, 3], abc[:, ::-1]], axis=1)


def turned_features(features: Array, angle: float, attitude: AttitudeReading) -> Array:
    """Returns x (n, 6) of the poses turned by an angle in rad about the base's z axis.

    Args:
        features: (n, 6) m and rad.
        angle: rad.
        attitude: ``turning``: the tool turns with the arm. ``fixed``: its attitude stays.
    """
    out = np.array(features)
    c, s = np.cos(angle), np.sin(angle)
    out[:, 0] = c * features[:, 0] - s * features[:, 1]
    out[:, 1] = s * features[:, 0] + c * features[:, 1]
    if attitude == "turning":
        out[:, 5] += angle
    return out


LEVER: Final = 0.5
"""m per rad: what an attitude counts when distances between poses are compared."""
LEAST_SHARED: Final = 3
"""Rule 4: data an overlap must hold."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Domains:
    """A measured region and the regions its errors are carried to.

    Attributes:
        source: The completely sampled region.
        target: The whole target domain.
        sub_spaces: Its k parts, each of the source's size.
    """

    source: CylinderRegion
    target: CylinderRegion
    sub_spaces: tuple[CylinderRegion, ...]

    @property
    def angles(self) -> Array:
        """(k,) rad: turn about joint 1 that takes the source to each sub-space, eq. 11."""
        return np.array([s.angle[0] - self.source.angle[0] for s in self.sub_spaces])

    @property
    def overlap(self) -> float:
        """Angle neighbours share, rad; negative where a gap is between them."""
        pairs = zip(self.sub_spaces[:-1], self.sub_spaces[1:], strict=True)
        return max((a.angle[1] - b.angle[0] for a, b in pairs), default=-np.inf)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pairs:
    """Source row of which each target row of a sub-space is the image (rule 1).

    Attributes:
        source: (m,) rows of the source.
        target: (m,) rows of the target.
        distance: (m,) m between the turned source pose and the target pose, attitude times
            :data:`LEVER` included; zero where rule 1 was kept.
    """

    source: IntArray
    target: IntArray
    distance: Array


def divide_target(source: CylinderRegion, target: CylinderRegion, count: int) -> Domains:
    """Returns the domains with the target divided into sub-spaces of the source's width.

    They are spread evenly over the target's angles, first and last at its ends: with a gap where
    they are narrow, with an overlap where they are wide.

    Raises:
        ConfigurationError: Radii or heights differ, or one sub-space is wider than the target.
    """
    if source.radius != target.radius or source.height != target.height:
        raise ConfigurationError(
            f"source radius {source.radius}, height {source.height} m; target radius "
            f"{target.radius}, height {target.height} m; the map between them only turns.",
            hint="the same radii and heights for both.",
        )
    width = source.angle[1] - source.angle[0]
    span = target.angle[1] - target.angle[0]
    if width > span + 1e-12:
        raise ConfigurationError(
            f"the source spans {width / DEG:.4g} deg, the target only {span / DEG:.4g} deg.",
            hint="the source is the narrow region, sampled completely: are source and target "
            "exchanged?",
        )
    gap = (span - count * width) / (count - 1) if count > 1 else 0.0
    if count == 1:
        low = 0.5 * (target.angle[0] + target.angle[1] - width)
        return Domains(
            source=source, target=target, sub_spaces=(turn_region(source, low - source.angle[0]),)
        )
    return Domains(source=source, target=target, sub_spaces=divide_region(target, count, gap=gap))


def members(domains: Domains, points: Array) -> BoolArray:
    """Returns (k, n) True where a point (n, 3) m of base lies in a sub-space."""
    return np.stack([contains(s, points) for s in domains.sub_spaces])


def overlap_members(domains: Domains, points: Array) -> BoolArray:
    """Returns (n,) True for points (n, 3) m that lie in two sub-spaces or more, eq. 19."""
    out: BoolArray = members(domains, points).sum(axis=0) > 1
    return out


def check_overlap(domains: Domains, features: Array) -> None:
    """Checks rule 4: no overlap where attitudes vary, three shared data where they do not.

    Args:
        domains: Sub-spaces.
        features: (n, 6) m and rad of the target poses.

    Raises:
        ConfigurationError: The rule is violated; the message states how.
    """
    vary = bool(np.ptp(_own_attitude(features), axis=0).max() > 1e-6)
    if len(domains.sub_spaces) < 2:
        return
    if vary and domains.overlap > 1e-9:
        raise ConfigurationError(
            f"sub-spaces overlap by {domains.overlap / DEG:g} deg although the attitudes vary; "
            "rule 4 allows an overlap only with a fixed attitude.",
            hint="fewer or narrower sub-spaces.",
        )
    count = int(overlap_members(domains, features[:, :3]).sum())
    if not vary and count < LEAST_SHARED * (len(domains.sub_spaces) - 1):
        raise ConfigurationError(
            f"with a fixed attitude neighbours must share {LEAST_SHARED} data or more (rule 4); "
            f"{count} target poses lie in two sub-spaces.",
            hint="more sub-spaces, so that they overlap, or poses in the overlaps.",
        )


def mapped_pairs(
    domains: Domains,
    j: int,
    source: Array,
    target: Array,
    attitude: AttitudeReading,
    *,
    exact: bool = False,
) -> Pairs:
    """Returns the source row whose turned pose is each target pose of sub-space j.

    Args:
        domains: Where.
        j: Number of the sub-space.
        source: (n, 6) features of the source, m and rad.
        target: (m, 6) features of all target rows.
        attitude: What the turn does to the attitude.
        exact: Refuse target poses that are not the image of a source pose.

    Raises:
        ObservabilityError: No target pose lies in the sub-space, or one has no image.
    """
    rows = np.flatnonzero(contains(domains.sub_spaces[j], target[:, :3], slack=1e-6))
    if not len(rows):
        low, high = np.array(domains.sub_spaces[j].angle) / DEG
        raise ObservabilityError(
            f"no target pose in sub-space {j + 1}, angles {low:g} to {high:g} deg.",
            hint="a few poses there, or fewer sub-spaces.",
        )
    image = turned_features(source, float(domains.angles[j]), attitude)
    scale = np.array([1.0, 1.0, 1.0, LEVER, LEVER, LEVER])
    found = cKDTree(image * scale).query(target[rows] * scale)
    distance = np.asarray(found[0], dtype=np.float64)
    if exact and distance.max() > 1e-6:
        worst = int(rows[np.argmax(distance)])
        raise ObservabilityError(
            f"target pose {worst + 1} is {distance.max() / MM:.3g} mm from the image of any source "
            "pose; rule 1 asks for a one-to-one map.",
            hint="plan the target poses with sampling.target_images.",
        )
    return Pairs(source=np.asarray(found[1], dtype=np.int64), target=rows, distance=distance)


def _own_attitude(features: Array) -> Array:
    """rx, ry and rz less the angle about joint 1, or rz itself if that varies less."""
    angle = np.arctan2(features[:, 1], features[:, 0])
    turning = features[:, 5] - angle
    rz = min(features[:, 5], turning, key=np.ptp)
    return np.column_stack([features[:, 3:5], rz])


@dataclass(frozen=True, slots=True, kw_only=True)
class Labelled(Columns):
    """Poses and their errors: the paper's D = {x, y}.

    Attributes:
        features: (n, 6) m and rad.
        errors: (n, 3) m, measured minus commanded, base.
        covariance: (n, 3, 3) m^2 of the measurement.
    """

    features: Annotated[Array, Column("n 6", unit="m, rad")]
    errors: Annotated[Array, Column("n 3", unit="m")]
    covariance: Annotated[Array, Column("n 3 3", unit="m^2")]


def label_poses(robot: RobotModel, measurements: MeasurementSet, reference: Array) -> Labelled:
    """Returns poses and errors of a set in base.

    Args:
        robot: Nominal arm whose tool is the measured point.
        measurements: In base.
        reference: (3,) rad, A, B, C near which attitudes are read.

    Raises:
        ModelMismatchError: Another number of joints, or a set in a tracker frame.
    """
    if measurements.dof != robot.dof:
        raise ModelMismatchError(
            f"the measurements have {measurements.dof} joints, {robot.name} has {robot.dof}."
        )
    if measurements.frame != "base":
        raise ModelMismatchError(
            "the measurements are in a tracker frame; the paper's method has no registration.",
            hint="register the tracker to the base first.",
        )
    poses = forward(robot.nominal(), measurements.joints)
    return Labelled(
        features=pose_features(poses, reference),
        errors=measurements.position - poses[:, :3, 3],
        covariance=measurements.covariance,
    )
