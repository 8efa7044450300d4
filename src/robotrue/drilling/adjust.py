"""One move that squares the spindle, or the reasons why no move is commanded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, get_args

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM
from robotrue.drilling.campaign import Clamps
from robotrue.drilling.correction import CorrectedReadings
from robotrue.drilling.drill_defaults import LIMIT_DEG, Position
from robotrue.drilling.foot_model import NormalModel, estimate_tilt
from robotrue.drilling.head import HeadMove, normal_from_tilt, squaring_move
from robotrue.errors import ImplausibleDataError

MARGIN: Final = 0.1
"""Share of the campaign's range by which force and tilt may lie outside it."""
SURE: Final = 5.0
"""Deviations of the plane's residual or height beyond which a sensor is at fault."""
HARD_DEG: Final = 1.0
"""Tilt that one faulty sensor may cause, at which no move is given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HoleAdjustment:
    """The move of one hole.

    Attributes:
        tilt: (2,) rad, of the surface in the spindle's frame, corrected.
        covariance: (2, 2) rad^2.
        move: What the five axes do.
        theoretical: (2,) rad, where A and B would go by the readings as they are.
        notes: What the operator should know.
    """

    tilt: Array
    covariance: Array
    move: HeadMove
    theoretical: Array
    notes: tuple[str, ...]


def adjustment(model: NormalModel, clamps: Clamps, axes: Array) -> HoleAdjustment:
    """Returns the one move of a clamp.

    Args:
        model: Learned from a campaign.
        clamps: One clamp: readings less their zero, force, height.
        axes: (2,) rad, A and B now, as the machine counts them.

    Raises:
        ImplausibleDataError: An impossible reading, or a force or tilt outside the model's range:
            no move is commanded on a guess.
    """
    _refuse_readings(model, clamps)
    _refuse_force(model, clamps)
    found = estimate_tilt(model, clamps)
    _refuse_plane(model, found)
    _refuse_height(model, found)
    move, uncorrected = (
        squaring_move(model.head, axes, normal_from_tilt(model.head.order, tilt[0]))
        for tilt in (found.tilt, found.seen)
    )
    return HoleAdjustment(
        tilt=found.tilt[0],
        covariance=found.covariance[0],
        move=move,
        theoretical=uncorrected.axes,
        notes=_notes(model, clamps, found),
    )


def surface_document(found: HoleAdjustment) -> dict[str, float]:
    """Returns tilts and their standard deviations, deg."""
    a, b = (found.tilt / DEG).tolist()
    a_sigma, b_sigma = (np.sqrt(np.diag(found.covariance)) / DEG).tolist()
    return {"a_deg": a, "b_deg": b, "a_sigma_deg": a_sigma, "b_sigma_deg": b_sigma}


def move_document(move: HeadMove) -> dict[str, float]:
    """Returns where the axes of a head go, in deg and mm; NaN for a shift that is not known."""
    return {
        **{f"{n}_deg": v / DEG for n, v in zip("AB", move.axes.tolist(), strict=True)},
        **{f"d{n}_deg": v / DEG for n, v in zip("AB", move.turn.tolist(), strict=True)},
        **{f"d{n}_mm": v / MM for n, v in zip("XYZ", move.shift.tolist(), strict=True)},
    }


def targets_document(found: HoleAdjustment) -> dict[str, float]:
    """Returns targets of A and B by the readings as they are, and what is added to them, deg."""
    added = found.move.axes - found.theoretical
    return {
        **{f"{n}_theoretical_deg": v / DEG for n, v in zip("AB", found.theoretical, strict=True)},
        **{f"{n}_compensation_deg": v / DEG for n, v in zip("AB", added, strict=True)},
    }


def _refuse_readings(model: NormalModel, clamps: Clamps) -> None:
    """A sensor at the end of its range reads its stop, not the skin."""
    low, high = model.foot.reading_range
    for k, reading in enumerate(clamps.readings[0].tolist()):
        if not low < reading < high:
            raise ImplausibleDataError(
                f"sensor {k + 1} reads {reading / MM:.4f} mm, at or beyond its stop ({low / MM:g} "
                f"to {high / MM:g} mm): no skin under it, an edge, or a sensor that is stuck.",
                hint="look at the foot, then clamp again.",
            )


def _refuse_force(model: NormalModel, clamps: Clamps) -> None:
    force, (low, high) = float(clamps.force[0]), model.envelope.force
    margin = MARGIN * (high - low) + 1e-9
    if not low - margin <= force <= high + margin:
        raise ImplausibleDataError(
            f"clamp force is {force:g} N, the campaign covers {low:g} to {high:g} N.",
            hint="clamp within it, or add clamps at this force to the campaign.",
        )


def _refuse_plane(model: NormalModel, found: CorrectedReadings) -> None:
    tilt = float(np.hypot(*found.tilt[0]))
    limit = min(model.foot.max_tilt, model.envelope.tilt * (1.0 + MARGIN) + 0.1 * DEG)
    if tilt > limit:
        raise ImplausibleDataError(
            f"the surface is {tilt / DEG:.3f} deg off the spindle; the foot and its campaign reach "
            f"{limit / DEG:.3f} deg.",
            hint="move the head nearer to the nominal normal and clamp again; an edge under one "
            "sensor looks like this, too.",
        )
    residual = found.residual[0]
    worst = int(np.argmax(np.abs(residual)))
    allowed = SURE * float(np.maximum(model.correction.noise, model.foot.reading_sigma).max())
    if abs(residual[worst]) > allowed:
        raise ImplausibleDataError(
            f"the readings lie on no plane: sensor {worst + 1} is {residual[worst] / MM:.4f} mm "
            f"off, {allowed / MM:.4f} mm are allowed.",
            hint="a sensor that is stuck or disturbed, an edge, or a skin more curved than stated.",
        )


def _refuse_height(model: NormalModel, found: CorrectedReadings) -> None:
    """Three sensors lie on a plane always: that one is wrong shows in the height of the plane."""
    off, tilt = _height_off(model, found)
    if tilt > HARD_DEG * DEG:
        raise ImplausibleDataError(
            f"the plane of the readings is {off / MM:+.4f} mm off its place in the campaign: one "
            f"sensor may be {abs(off) * len(model.foot.radius) / MM:.3f} mm off, which tilts the "
            f"normal by {tilt / DEG:.2f} deg.",
            hint="a sensor that is disturbed or wired in reverse, an edge under it, or a "
            "zero of another foot: look at the foot, then `drill zero`.",
        )


def _height_off(model: NormalModel, found: CorrectedReadings) -> tuple[float, float]:
    """Height (m) off the campaign's, and the tilt (rad) if one sensor alone is the cause.

    Both are 0 within what the campaign's own heights vary by.
    """
    off = float(found.height[0])
    noise = float(np.maximum(model.correction.noise, model.foot.reading_sigma).max())
    if not abs(off) > SURE * noise:
        return 0.0, 0.0
    return off, 2.0 * abs(off) / float(np.mean(model.foot.radius))


def _notes(model: NormalModel, clamps: Clamps, found: CorrectedReadings) -> tuple[str, ...]:
    notes = []
    known = model.envelope.approach
    if clamps.approach[0] not in known:
        notes.append(
            f"the foot came down {clamps.approach[0] or 'in the usual way'!r}, the campaign has "
            f"{', '.join(repr(a or 'the usual way') for a in known)}: friction may leave a tenth "
            "of a degree."
        )
    height, (low, high) = float(clamps.height[0]), model.envelope.height
    if not low <= height <= high:
        notes.append(
            f"height is {height / MM:g} mm, the campaign covers {low / MM:g} to {high / MM:g} mm."
        )
    off, tilt = _height_off(model, found)
    if tilt > LIMIT_DEG * DEG:
        notes.append(
            f"the plane of the readings is {off / MM:+.4f} mm off its place in the campaign: if "
            f"one sensor has shifted, the normal is {tilt / DEG:.2f} deg off. Try: `drill zero`."
        )
    return (*notes, *_zero_notes(model), *_position_notes(model, clamps))


def _zero_notes(model: NormalModel) -> list[str]:
    """A zero taken since the campaign, whose error no campaign has learned."""
    if model.new_zero is None:
        return []
    a, b = (model.zero_sigma / DEG).tolist()
    said = "the zero is not that of the campaign"
    if not a or not b:
        return [
            f"{said}, and the foot file does not state its repeatability: the stated deviation "
            "does not include it. Try: `drill zero` with 5 seats or more."
        ]
    return [
        f"{said}: it leaves {a:.4f} deg in a and {b:.4f} deg in b "
        "uncertain, which the stated deviation includes."
    ]


def _position_notes(model: NormalModel, clamps: Clamps) -> list[str]:
    """Machine positions that the correction uses, outside what its campaign covered."""
    here = np.concatenate([clamps.place[0], clamps.axes[0]]).tolist()
    limits = dict(
        zip(get_args(Position), zip(here, model.envelope.positions, strict=True), strict=True)
    )
    notes = []
    for name in model.correction.inputs:
        value, (low, high) = limits[name]
        size, unit = (MM, "mm") if name in "XY" else (DEG, "deg")
        if not low <= value <= high:
            notes.append(
                f"{name} is {value / size:g} {unit}, the campaign covers {low / size:g} to "
                f"{high / size:g} {unit}."
            )
    return notes
