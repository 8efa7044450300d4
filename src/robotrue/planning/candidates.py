"""Postures that can be taken, entered and seen, drawn evenly over the joint limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.regions import Region, contains
from robotrue.core.units import DEG
from robotrue.errors import ReachError
from robotrue.planning.arm_scene import Scene, collisions, hidden
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel

STEP: Final = 1e-4 * DEG
"""Drawn joints are rounded to what a program prints."""
BATCH: Final = 4096
MOST: Final = 2**17
"""Postures drawn at most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidates:
    """Candidates that passed all checks.

    Attributes:
        joints: (n, dof) rad.
        drawn: Number of postures looked at.
        rejected: (reason, count), in the order of the checks; a posture counts once, so that
            candidates and rejected ones add up to those drawn.
    """

    joints: Array
    drawn: int
    rejected: tuple[tuple[str, int], ...]


class Rejections:
    """Mask of valid candidates, and the number rejected per reason.

    Args:
        n: How many there are.

    Attributes:
        good: (n,) not left out yet.
    """

    def __init__(self, n: int) -> None:
        self.good: BoolArray = np.ones(n, dtype=bool)
        self._counts: dict[str, int] = {}

    def leave_out(self, reason: str, bad: BoolArray) -> None:
        """Leaves out candidates (n,); those that were still good are counted under the reason."""
        self.count(reason, int((bad & self.good).sum()))
        self.good[bad] = False

    def count(self, reason: str, number: int) -> None:
        """Counts further ones under a reason."""
        self._counts[reason] = self._counts.get(reason, 0) + number

    def add(self, other: Rejections) -> None:
        """Counts what another one left out."""
        for reason, number in other._counts.items():
            self.count(reason, number)

    @property
    def rejected(self) -> tuple[tuple[str, int], ...]:
        """(reason, count), in the order of the checks."""
        return tuple((reason, number) for reason, number in self._counts.items() if number)


def draw_postures(robot: RobotModel, n: int, *, seed: int, margin: float) -> Array:
    """Returns n (a power of two) Sobol postures (n, dof) rad inside the limits less a margin.

    Joints that turn more than once stay within half a turn of the middle of their limits.

    Raises:
        ReachError: The margin leaves nothing of a joint.
    """
    middle = robot.limits.mean(axis=1)
    half = np.minimum(np.diff(robot.limits, axis=1)[:, 0] / 2.0 - margin, np.pi)
    if (half <= 0.0).any():
        joint = int(np.argmin(half))
        raise ReachError(
            f"joint {joint + 1} moves {np.degrees(np.diff(robot.limits[joint])[0]):.1f} deg; a "
            f"margin of {np.degrees(margin):.1f} deg at both ends leaves no range.",
            hint="a smaller margin.",
        )
    from scipy.stats import qmc  # takes longer to import than most commands run

    draws = qmc.Sobol(robot.dof, scramble=True, rng=np.random.default_rng([seed, 41]))
    unit = draws.random_base2(int(np.ceil(np.log2(n))))
    return np.asarray(np.round((middle + (2.0 * unit - 1.0) * half) / STEP) * STEP)


def reachable_in(
    robot: RobotModel, n: int, *, seed: int, margin: float, region: Region | None
) -> Array:
    """Returns up to n postures (k, dof) rad whose tool point lies in a region; may be fewer."""
    joints = draw_postures(robot, MOST if region is not None else n, seed=seed, margin=margin)
    found: list[Array] = []
    for start in range(0, len(joints), BATCH):
        part = joints[start : start + BATCH]
        if region is not None:
            part = part[contains(region, forward(robot, part)[:, :3, 3])]
        found.append(part)
        if sum(map(len, found)) >= n:
            break
    return np.concatenate(found)[:n]


def usable(scene: Scene, joints: Array, *, pre: Array | None = None) -> Rejections:
    """Returns which postures (n,) can be taken, entered and seen, and why the others cannot.

    Args:
        scene: The arm and its surroundings.
        joints: (n, dof) rad.
        pre: (n, dof) rad, where each is entered from; not looked at if not given.
    """
    rejections = Rejections(len(joints))
    low, high = scene.robot.limits.T
    rejections.leave_out("joint limits", ((joints < low) | (joints > high)).any(axis=1))
    for reason, bad in {**collisions(scene, joints), **hidden(scene, joints)}.items():
        rejections.leave_out(reason, bad)
    if pre is not None:
        at_limit = ((pre < low) | (pre > high)).any(axis=1)
        rejections.leave_out("pre-position at a limit", at_limit)
        for bad in collisions(scene, pre).values():
            rejections.leave_out("pre-position in collision", bad)
    return rejections


def draw_candidates(
    scene: Scene,
    n: int,
    *,
    seed: int,
    margin: float,
    region: Region | None,
    step_back: Array | None,
) -> Candidates:
    """Returns up to n usable postures.

    Args:
        scene: The arm and its surroundings.
        n: Requested number.
        seed: Of the draw.
        margin: rad, distance from the joint limits.
        region: Region of the reflector; anywhere if not given.
        step_back: (dof,) rad from a pose to its pre-position; none if not given.

    Raises:
        ReachError: No posture is left; the message states the causes.
    """
    joints = draw_postures(scene.robot, MOST, seed=seed, margin=margin)
    found = [np.empty((0, scene.robot.dof))]
    total = Rejections(0)
    drawn = 0
    for start in range(0, len(joints), BATCH):
        part = joints[start : start + BATCH]
        drawn += len(part)
        if region is not None:
            inside = contains(region, forward(scene.robot, part)[:, :3, 3])
            total.count("outside the region", int((~inside).sum()))
            part = part[inside]
        if not len(part):
            continue
        checked = usable(scene, part, pre=None if step_back is None else part + step_back)
        total.add(checked)
        found.append(part[checked.good])
        if sum(map(len, found)) >= n:
            break
    kept = np.concatenate(found)
    total.count("more than requested", len(kept[n:]))
    if not len(kept):
        raise nothing_left(drawn, total)
    return Candidates(joints=kept[:n], drawn=drawn, rejected=total.rejected)


def nothing_left(drawn: int, rejections: Rejections) -> ReachError:
    """Returns the error for a draw without valid candidates, with the commonest reasons."""
    ordered = sorted(rejections.rejected, key=lambda item: -item[1])
    why = ", ".join(f"{reason} {number}" for reason, number in ordered[:4])
    return ReachError(
        f"not one of {drawn} postures can be measured ({why}).",
        hint="check the region, the tracker's place, the reflector's axis and the obstacles.",
    )
