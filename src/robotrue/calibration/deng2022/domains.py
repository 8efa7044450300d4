"""Source and target domains, sub-spaces, mapped pairs, and the rule about overlap (section 2.4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from robotrue.calibration.deng2022.features import turned_features
from robotrue.calibration.deng2022.readings import AttitudeReading
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.regions import CylinderRegion, contains, divided, turned
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ObservabilityError

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
    """Which source row each target row of a sub-space is the image of (rule 1).

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
            f"the source spans {width / DEG:g} deg, the target only {span / DEG:g} deg."
        )
    gap = (span - count * width) / (count - 1) if count > 1 else 0.0
    if count == 1:
        low = 0.5 * (target.angle[0] + target.angle[1] - width)
        return Domains(
            source=source, target=target, sub_spaces=(turned(source, low - source.angle[0]),)
        )
    return Domains(source=source, target=target, sub_spaces=divided(target, count, gap=gap))


def members(domains: Domains, points: Array) -> BoolArray:
    """Returns (k, n) True where a point (n, 3) m of base lies in a sub-space."""
    return np.stack([contains(s, points) for s in domains.sub_spaces])


def shared(domains: Domains, points: Array) -> BoolArray:
    """Returns (n,) True for points (n, 3) m that lie in two sub-spaces or more, eq. 19."""
    out: BoolArray = members(domains, points).sum(axis=0) > 1
    return out


def check_overlap(domains: Domains, features: Array) -> None:
    """Checks rule 4: no overlap where attitudes vary, three shared data where they do not.

    Args:
        domains: Sub-spaces.
        features: (n, 6) m and rad of the target poses.

    Raises:
        ConfigurationError: The rule is broken; the message says how.
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
    count = int(shared(domains, features[:, :3]).sum())
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
