"""Detects readable numbers that contradict their stated meaning, before a fit uses them.

The commanded poses are the reference: a rigid motion must take them to the measured points up to
the robot's errors. Each check is one way in which it does not.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.poses import apply, fit_rigid
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ImplausibleDataError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.screening import duplicate_rows

FEWEST_POSES: Final = 6
"""Poses that a set needs, unless an operation requires fewer."""
MISFIT: Final = 0.05
"""Part of the reach: more than this is left by another robot (UR5 for UR10: 0.06 to 0.1 on measured
data), not by an unstated reflector of 100 mm (0.01)."""
FEWEST_SHAPES: Final = 4
"""Points from which a shape can be compared: three are always nearly congruent to three others."""
_SHIFT: Final = 0.2
"""Part of the reach by which the base frame or the reflector may be off."""
_TURN: Final = 10.0 * DEG
_BETTER: Final = 0.3
"""Another reading of the data must leave less than this part of the misfit to be accepted."""
_FLOOR: Final = 5.0 * MM
"""Below this misfit nothing is wrong that a calibration would not find."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Evidence:
    """The measured and the commanded points, and the rms of their fit, m."""

    measured: Array
    commanded: Array
    reach: float
    frame: str
    place: str
    ratio: float
    misfit: float

    @property
    def bad(self) -> bool:
        return self.misfit > MISFIT * self.reach


def check_plausible(
    measurements: MeasurementSet,
    commanded: Array,
    reach: float,
    *,
    forward: Callable[[Array], Array] | None = None,
    minimum: int = FEWEST_POSES,
) -> tuple[str, ...]:
    """Returns harmless oddities, one sentence each; anything else raises.

    Args:
        measurements: The set as read.
        commanded: (n, 3) m, nominal positions of the measured point in base at the same joints.
        reach: m, of the robot with the measured point.
        forward: Joints (n, dof) rad to nominal positions (n, 3) m; separates a mix-up of degrees
            and radians from a wrong robot.
        minimum: Fewest poses that can be checked.

    Raises:
        ImplausibleDataError: Too few or equal poses, millimetres for metres, degrees for radians,
            mirrored or permuted axes, another robot, another frame than stated.
        ShapeError: ``commanded`` has another shape.

    Fails when: the points lie on one line or plane; a mirror image then fits as well and is not
    found.
    """
    commanded = frozen(commanded, (len(measurements), 3), "commanded")
    place = _files(measurements)
    _enough(measurements, commanded, place, minimum)
    if len(measurements) < FEWEST_SHAPES:
        _check_few(measurements, commanded, reach, place)
        return ()
    stations = np.unique(measurements.station)
    if measurements.frame == "base" or len(stations) == 1:
        _check_station(measurements, commanded, reach, place, forward)
    else:
        for station in stations:
            rows = np.flatnonzero(measurements.station == station)
            if len(rows) >= max(minimum, FEWEST_SHAPES):
                part = measurements.subset(rows)
                _check_station(part, commanded[rows], reach, place, forward)
    pairs = duplicate_rows(measurements)
    if not pairs:
        return ()
    shown = ", ".join(f"{measurements.source_row[j]}" for _, j in pairs[:5])
    return (
        f"{len(pairs)} rows repeat an earlier one to the last digit (lines {shown}"
        f"{', ...' if len(pairs) > 5 else ''} of {place}).",
    )


def _check_few(measurements: MeasurementSet, commanded: Array, reach: float, place: str) -> None:
    """Raises for points in base that are not where the arm was sent; a shape they have none."""
    distance = np.linalg.norm(measurements.position - commanded, axis=1)
    row = int(distance.argmax())
    if measurements.frame == "base" and distance[row] > MISFIT * reach:
        raise ImplausibleDataError(
            f"a point {_mm(distance[row])} from where the arm was sent, allowed "
            f"{_mm(MISFIT * reach)}.",
            source=place,
            line=int(measurements.source_row[row]),
            hint="check units, joint signs, the robot and the frame of the positions.",
        )


def _check_station(
    measurements: MeasurementSet,
    commanded: Array,
    reach: float,
    place: str,
    forward: Callable[[Array], Array] | None,
) -> None:
    """Raises for what is wrong with points that share one frame."""
    _stray_rows(measurements, commanded, reach)
    evidence = _evidence(measurements, commanded, reach, place)
    _unit_of_length(evidence)
    _at_rest("measured", measurements.position, 1.0 * MM, place)
    if evidence.bad and forward is not None:
        _unit_of_angle(evidence, measurements.joints, forward)
    _check_mirrored(evidence)
    if evidence.bad:
        raise _wrong_robot(evidence)
    if measurements.frame == "base":
        _other_frame(evidence)


def _evidence(
    measurements: MeasurementSet, commanded: Array, reach: float, place: str
) -> _Evidence:
    measured = measurements.position
    return _Evidence(
        measured=measured,
        commanded=commanded,
        reach=reach,
        frame=measurements.frame,
        place=place,
        ratio=_spread(measured) / _spread(commanded),
        misfit=_misfit(measured, commanded),
    )


def _spread(points: Array) -> float:
    return float(np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1))))


def _misfit(measured: Array, commanded: Array) -> float:
    """Returns the rms distance in m after the best rigid motion."""
    gap = apply(fit_rigid(commanded, measured), commanded) - measured
    return float(np.sqrt(np.mean(np.sum(gap**2, axis=1))))


def _mm(length: float) -> str:
    return f"{length / MM:.4g} mm"


def _files(measurements: MeasurementSet) -> str:
    names = dict.fromkeys(source.split(" sha256:")[0] for source in measurements.sources)
    return ", ".join(Path(name).name for name in names) or "measurements"


def _enough(measurements: MeasurementSet, commanded: Array, place: str, minimum: int) -> None:
    if len(measurements) < minimum:
        raise ImplausibleDataError(
            f"{len(measurements)} poses, at least {minimum} are needed.",
            source=place,
            hint="measure more poses, spread over the workspace.",
        )
    if len(measurements) < FEWEST_SHAPES:
        return
    # Metres read as millimetres make everything small; its unit is reported, not as a residual.
    for what, points, least in (
        ("commanded", commanded, 1.0 * MM),
        ("measured", measurements.position, 1e-5 * _spread(commanded)),
    ):
        _at_rest(what, points, least, place)
    distinct = len(measurements) - len(duplicate_rows(measurements))
    if distinct < minimum:
        raise ImplausibleDataError(
            f"{len(measurements)} rows, but only {distinct} different ones; at least {minimum} are "
            "needed.",
            source=place,
            hint="export the measurements again.",
        )


def _at_rest(what: str, points: Array, least: float, place: str) -> None:
    spread = _spread(points)
    if spread <= least:
        raise ImplausibleDataError(
            f"all {len(points)} {what} positions lie within {_mm(spread)} rms of one point.",
            source=place,
            hint="look for a column that was filled down, or a log of a robot at rest.",
        )


def _stray_rows(measurements: MeasurementSet, commanded: Array, reach: float) -> None:
    """Raises if a few rows lie where the arm cannot go; if many do, it is the unit or the frame."""
    points = measurements.position
    in_base = measurements.frame == "base"
    centre = np.zeros(3) if in_base else np.median(points, axis=0)
    allowed = (1.0 + _SHIFT) * reach * (1.0 if in_base else 2.0)
    distance = np.linalg.norm(points - centre, axis=1)
    # A frame that is merely shifted takes the outermost rows out of reach; their neighbours agree.
    gap = points - commanded if in_base else points
    alone = np.linalg.norm(gap - np.median(gap, axis=0), axis=1) > _SHIFT * reach
    far = np.flatnonzero((distance > allowed) & alone)
    if not 0 < far.size <= 0.1 * len(points):
        return
    row = int(far[0])
    lines = ", ".join(str(int(i)) for i in measurements.source_row[far[:5]])
    origin = "the base" if in_base else "the middle of the data"
    raise ImplausibleDataError(
        f"a point {_mm(distance[row])} from {origin}, the arm reaches {_mm(reach)} "
        f"({far.size} such row{'s' if far.size > 1 else ''}: line {lines}).",
        source=measurements.file_of(row) or None,
        line=int(measurements.source_row[row]),
        hint="correct or delete these rows.",
    )


def _unit_of_length(evidence: _Evidence) -> None:
    scaled = evidence.measured / evidence.ratio
    fits = _misfit(scaled, evidence.commanded) < 2.0 * MISFIT * evidence.reach
    mirrored = _misfit(scaled * [1.0, 1.0, -1.0], evidence.commanded)
    if not (fits or mirrored < MISFIT * evidence.reach):
        return
    for factor, read, written in (
        (1000.0, "metres", "millimetres"),
        (1e-3, "millimetres", "metres"),
        (1e6, "metres", "micrometres"),
        (1.0 / 25.4, "millimetres", "inches"),
    ):
        if 0.8 < evidence.ratio / factor < 1.25:
            raise ImplausibleDataError(
                f"distances between points are {evidence.ratio:.6g} times those of the commanded "
                f"poses: {written} were read as {read}.",
                source=evidence.place,
                hint=f"state the unit of the position columns ({written}).",
            )


def _unit_of_angle(evidence: _Evidence, joints: Array, forward: Callable[[Array], Array]) -> None:
    for factor, read, written in ((DEG, "radians", "degrees"), (1.0 / DEG, "degrees", "radians")):
        other = _misfit(evidence.measured, forward(joints * factor))
        if other < _BETTER * evidence.misfit and other < MISFIT * evidence.reach:
            raise ImplausibleDataError(
                f"joints up to {np.abs(joints).max():.4g} rad leave {_mm(evidence.misfit)} rms; "
                f"multiplied by {factor:.4g} they leave {_mm(other)}: {written} were read as "
                f"{read}.",
                source=evidence.place,
                hint=f"state the unit of the joint columns ({written}).",
            )


def _check_mirrored(evidence: _Evidence) -> None:
    if evidence.misfit < _FLOOR:
        return
    other = _misfit(evidence.measured * [1.0, 1.0, -1.0], evidence.commanded)
    if other > _BETTER * evidence.misfit or other > MISFIT * evidence.reach:
        return
    found = _signed_axes(evidence) if evidence.frame == "base" else None
    raise ImplausibleDataError(
        f"the mirror image of the measured points fits the commanded ones to {_mm(other)} rms, the "
        f"points themselves to {_mm(evidence.misfit)}: mirrored or exchanged axes.",
        source=evidence.place,
        hint=f"read the position columns as {found}."
        if found
        else "change the sign of one axis or exchange two: the frame is left-handed.",
    )


def _wrong_robot(evidence: _Evidence) -> ImplausibleDataError:
    size = ""
    if not 0.9 < evidence.ratio < 1.1:
        size = f", and the points lie {evidence.ratio:.3g} times as far apart"
    return ImplausibleDataError(
        f"measured and commanded positions differ by {_mm(evidence.misfit)} rms after the best "
        f"rigid fit, for a reach of {_mm(evidence.reach)}{size}: this is not the measured robot, "
        "or joints and positions do not belong together.",
        source=evidence.place,
        hint="number the tracker set-ups in a station column."
        if evidence.frame == "tracker" and ", " in evidence.place
        else "check the robot, the order of the joint columns and [target] in the cell file.",
    )


def _other_frame(evidence: _Evidence) -> None:
    """Raises if the stated frame is the base and the points are in another."""
    gap = evidence.measured - evidence.commanded
    direct = float(np.sqrt(np.mean(np.sum(gap**2, axis=1))))
    transform = fit_rigid(evidence.commanded, evidence.measured)
    turn = float(np.linalg.norm(rotation_vector_from_matrix(transform[:3, :3])))
    shift = float(np.linalg.norm(gap.mean(axis=0)))
    if evidence.misfit > _BETTER * direct:
        return
    if turn < _TURN and shift < _SHIFT * evidence.reach:
        return
    found = _signed_axes(evidence) if turn >= _TURN else None
    tilt = float(transform[2, 2])
    kind = f"turned by {turn / DEG:.1f} deg and " if turn >= _TURN else ""
    if tilt < -0.9:
        kind = "upside down and "
    hint = '[tracker] frame = "unknown" lets the calibration estimate the frame'
    raise ImplausibleDataError(
        f"the positions are not in the robot base: they lie {_mm(direct)} rms from the commanded "
        f"ones, and {_mm(evidence.misfit)} once the frame is {kind}moved by "
        f"{_mm(float(np.linalg.norm(transform[:3, 3])))}.",
        source=evidence.place,
        hint=f"{hint}; or read the columns as {found}." if found else f"{hint}.",
    )


def _signed_axes(evidence: _Evidence) -> str | None:
    """Returns e.g. ``y, x, z`` or ``-x, y, z``: how the columns fit without any rotation."""
    measured = evidence.measured - evidence.measured.mean(axis=0)
    commanded = evidence.commanded - evidence.commanded.mean(axis=0)
    best, words = MISFIT * evidence.reach, None
    for order in itertools.permutations(range(3)):
        for sign in itertools.product((1.0, -1.0), repeat=3):
            gap = measured[:, order] * sign - commanded
            rms = float(np.sqrt(np.mean(np.sum(gap**2, axis=1))))
            if rms < best:
                signs = ("" if s > 0 else "-" for s in sign)
                best = rms
                words = ", ".join(f"{s}{'xyz'[k]}" for s, k in zip(signs, order, strict=True))
    return words
