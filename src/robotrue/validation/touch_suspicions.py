"""What may be wrong with a reading that is not as expected: place, unit, sign, ball, repeat."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.forward import forward
from robotrue.validation.next_touch import CheckedTouch, TouchBelief, judged_reading
from robotrue.validation.registration_frame import GOOD

Kind: TypeAlias = Literal["feature", "radians", "scale", "sign", "ball", "repeated"]
SCALES: Final[tuple[tuple[str, float], ...]] = (
    ("inch", 25.4),
    ("m", 1000.0),
    ("um", 1e-3),
)
"""Units a position may have been read in, and mm of one of them."""
SAME: Final = 1e-9
"""m and rad; nobody touches twice that alike."""
ALONG: Final = 0.95
"""Cosine from which an offset counts as along the approach."""
BALL: Final = (0.4 * MM, 15.0 * MM)
"""Radii and lift-offs of probes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Suspicion:
    """One thing that would explain a reading.

    Attributes:
        kind: What it is.
        name: Feature that was touched, unit it was read in, number whose sign is wrong.
        length: m, signed, where it is a length.
        sigmas: What is left of the offset if it is so; NaN where nothing was tried.
    """

    kind: Kind
    name: str = ""
    length: float = float("nan")
    sigmas: float = float("nan")


def suspicions(
    known: TouchBelief,
    touch: ProbingSet,
    judged: CheckedTouch,
    *,
    others: ProbingSet,
    before: ProbingSet | None,
    tip_axis: Array,
) -> tuple[Suspicion, ...]:
    """Returns what would explain a reading, the best explanation first; nothing if nothing does.

    Args:
        known: After the touches before it.
        touch: The reading, one touch.
        judged: What was found of it.
        others: The other features of the part, with joints where joints are read.
        before: Readings made before.
        tip_axis: (3,) the way from the flange to the tip, in the tool frame.
    """
    found = [
        *_elsewhere(known, touch, others),
        *(_other_joints(known, touch) if touch.has_joints else _other_units(known, touch)),
    ]
    found = [each for each in found if each.sigmas <= min(GOOD, 0.5 * judged.sigmas)]
    found.sort(key=lambda each: each.sigmas)
    return (*_find_repeats(touch, before), *found[:3], *_ball(known, touch, judged, tip_axis))


def _elsewhere(known: TouchBelief, touch: ProbingSet, others: ProbingSet) -> list[Suspicion]:
    out = []
    for k in range(len(others)):
        there = replace(
            touch, names=(others.names[k],), point=others.point[[k]],
            normal=others.normal[[k]], part=others.part[[k]],
        )  # fmt: skip
        sigmas = judged_reading(known, there).sigmas
        out.append(Suspicion(kind="feature", name=others.names[k], sigmas=sigmas))
    return sorted(out, key=lambda each: each.sigmas)[:1]


def _other_joints(known: TouchBelief, touch: ProbingSet) -> list[Suspicion]:
    out = []
    if np.abs(touch.joints).max() < 2.0 * np.pi * DEG:
        turned = replace(touch, joints=touch.joints / DEG)
        out.append(Suspicion(kind="radians", sigmas=judged_reading(known, turned).sigmas))
    for k in range(touch.joints.shape[1]):
        joints = touch.joints.copy()
        joints[0, k] *= -1.0
        sigmas = judged_reading(known, replace(touch, joints=joints)).sigmas
        out.append(Suspicion(kind="sign", name=f"{k + 1}", sigmas=sigmas))
    return out


def _other_units(known: TouchBelief, touch: ProbingSet) -> list[Suspicion]:
    out = []
    for name, factor in SCALES:
        sigmas = judged_reading(known, replace(touch, position=factor * touch.position)).sigmas
        out.append(Suspicion(kind="scale", name=name, sigmas=sigmas))
    for k, axis in enumerate("xyz"):
        position = touch.position.copy()
        position[0, k] *= -1.0
        sigmas = judged_reading(known, replace(touch, position=position)).sigmas
        out.append(Suspicion(kind="sign", name=axis, sigmas=sigmas))
    return out


def _find_repeats(touch: ProbingSet, before: ProbingSet | None) -> tuple[Suspicion, ...]:
    if before is None:
        return ()
    read, earlier = (
        (touch.joints, before.joints) if touch.has_joints else (touch.position, before.position)
    )
    same = np.flatnonzero(np.abs(earlier - read).max(axis=1) < SAME)
    return tuple(Suspicion(kind="repeated", name=before.names[k]) for k in same[:1])


def _ball(
    known: TouchBelief, touch: ProbingSet, judged: CheckedTouch, tip_axis: Array
) -> tuple[Suspicion, ...]:
    """An offset straight along the way of the approach: radius, tip length, or not at the part."""
    way = known.T_base_part[int(touch.part[0])][:3, :3] @ np.nan_to_num(touch.normal[0])
    if touch.full[0]:
        if not touch.has_joints:
            return ()
        robot = known.arm.robot.nominal()
        tool = known.settings.T_flange_tool
        robot = robot if tool is None else robot.with_tool(tool)
        way = -(forward(robot, touch.joints)[0, :3, :3] @ tip_axis)
    length = float(judged.off @ way)
    if abs(length) < ALONG * judged.distance or not BALL[0] < abs(length) < BALL[1]:
        return ()
    return (Suspicion(kind="ball", length=length),)
