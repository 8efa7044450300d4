"""Two-sided slot test and datum check, with their limits.

Slots are cut from one side to beyond the middle and from the other side to meet; where they meet,
the two halves differ by a step. With one clamping and one frame both halves move together when the
frame is wrong: the step does not change at all. It contains the tip error, twice where the tool is
turned half round, and the difference of the arm's errors in the two postures. A datum that was not
used for the frame, touched again, checks the frame; a small fit residual does not, since the
touches of a frame agree with it by construction.

Source of the test: Feng, Liang, Xi 2018, J. Xiamen Univ. Nat. Sci. 57(5), section 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np
from scipy.stats import chi2, f, t

from robotrue.cell.registration.fit import Noise, name_touches
from robotrue.core.arrays import Array, frozen
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import apply, inverse, propagate_covariance
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ImplausibleDataError, ShapeError

Frames: TypeAlias = Literal["shared", "one per side"]
"""Whether both sides were cut in one frame and one clamping, or each in its own."""

PARALLEL: Final = 1e-6
MOST_STEP: Final = 0.1
"""m; a larger step is not a step of a slot but a wrong unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SlotTest(Columns):
    """Steps measured between the halves of slots cut from two sides.

    Attributes:
        step: (k, n) m, first side less second, across the slot, at n places of k slots; NaN where
            not measured.
        names: Of the slots.
        across: (3,) direction the step is measured in, part axes.
        R_part_first: (3, 3) attitude of the tool at the first side, in part.
        R_part_second: (3, 3) at the second.
        frames: ``"shared"``: one clamping, one frame.
    """

    step: Annotated[Array, Column("k _", unit="m", nan=True)]
    names: Annotated[tuple[str, ...], Column("k")]
    across: Annotated[Array, Column("3")]
    R_part_first: Annotated[Array, Column("3 3")]
    R_part_second: Annotated[Array, Column("3 3")]
    frames: Frames = "shared"

    def __post_init__(self) -> None:
        """Checks readings and sizes, makes the direction unit.

        Raises:
            ShapeError: A slot without a single reading, or a direction of length zero.
            ImplausibleDataError: A step above 100 mm.
            ConfigurationError: ``frames`` is neither word.
        """
        self._check_columns(k=len(self.names))
        empty = [n for n, row in zip(self.names, self.step, strict=True) if np.isnan(row).all()]
        if empty or not self.names:
            raise ShapeError(f"slots without a reading: {', '.join(empty) or 'all'}.")
        largest = float(np.nanmax(np.abs(self.step)))
        if largest > MOST_STEP:
            raise ImplausibleDataError(
                f"a step of {largest / MM:g} mm, allowed up to {MOST_STEP / MM:g} mm.",
                hint="steps are in m here and in mm in files.",
            )
        if self.frames not in ("shared", "one per side"):
            raise ConfigurationError(
                f"frames is {self.frames!r}, expected 'shared' or 'one per side'."
            )
        length = float(np.linalg.norm(self.across))
        if not length > 0.0:
            raise ShapeError("across has no direction.")
        self._set_column("across", self.across / length)


@dataclass(frozen=True, slots=True, kw_only=True)
class SlotEvaluation:
    """Result of a slot test.

    Attributes:
        slots: (k,) m, mean step of each slot, signed.
        mismatch: m, mean of their sizes, the number usually quoted.
        mean: m, signed mean over the slots.
        spread: m, standard deviation between slots (n - 1); NaN with one slot.
        interval: (2,) m, 95 % interval of the signed mean from the spread between slots; NaN with
            one slot.
        uneven: Probability that readings as scattered as those within a slot make the slots
            differ this much; small: the step changes over the part, so the arm has a share in it.
            NaN without repeated readings.
        per_tip: (3,) step per error of the tool tip, tool axes: up to 2 across the tool.
        per_frame: Step per shift of the frame: 0 with a shared frame, 1 with one per side.
        tip: m, error of the tip across the tool that alone would make the mean step; NaN where the
            test cannot see the tip.
        sees: What changes the number, in sentences.
        blind: What does not.
    """

    slots: Array
    mismatch: float
    mean: float
    spread: float
    interval: Array
    uneven: float
    per_tip: Array
    per_frame: float
    tip: float
    sees: tuple[str, ...]
    blind: tuple[str, ...]


def evaluate_slots(test: SlotTest) -> SlotEvaluation:
    """Returns the step, its spread, and what the test can and cannot have seen.

    Fails when: the slots were measured along another direction than ``across``.
    """
    slots = np.nanmean(test.step, axis=1)
    k, mean = len(slots), float(slots.mean())
    spread = float(slots.std(ddof=1)) if k > 1 else float("nan")
    half = float(t.ppf(0.975, k - 1)) * spread / np.sqrt(k) if k > 1 else float("nan")
    per_tip = tip_sensitivity(test.R_part_first, test.R_part_second, test.across)
    gain = float(np.linalg.norm(per_tip))
    seen = gain > PARALLEL
    sees, blind = _sentences(test.frames, gain)
    return SlotEvaluation(
        slots=frozen(slots, (k,), "slots"),
        mismatch=float(np.abs(slots).mean()),
        mean=mean,
        spread=spread,
        interval=frozen([mean - half, mean + half], (2,), "interval", allow_nan=True),
        uneven=_uneven(test.step, slots),
        per_tip=frozen(per_tip, (3,), "per_tip"),
        per_frame=0.0 if test.frames == "shared" else 1.0,
        tip=mean / gain if seen else float("nan"),
        sees=sees,
        blind=blind,
    )


def tip_sensitivity(R_part_first: Array, R_part_second: Array, across: Array) -> Array:
    """Returns the step per error of the tool tip (3,), tool axes: across (R_first - R_second).

    Its length is 2 where the tool is turned half round about an axis at right angles to
    ``across``, and 0 where it is turned about ``across`` itself: then the test is blind to the tip.
    """
    direction = np.asarray(across) / np.linalg.norm(across)
    return np.asarray(direction @ (np.asarray(R_part_first) - np.asarray(R_part_second)))


def _uneven(step: Array, slots: Array) -> float:
    """Probability of the variance between slots given that within, one-way analysis."""
    counts = (~np.isnan(step)).sum(axis=1)
    k, within = len(slots), int(counts.sum()) - len(slots)
    if k < 2 or within < 1:
        return float("nan")
    inside = float(np.nansum((step - slots[:, None]) ** 2)) / within
    overall = float(counts @ slots) / float(counts.sum())
    between = float(counts @ (slots - overall) ** 2) / (k - 1)
    if inside == 0.0:
        return 1.0 if between == 0.0 else 0.0
    return float(f.sf(between / inside, k - 1, within))


def _sentences(frames: Frames, gain: float) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Returns which errors the step detects, and which it does not."""
    sees = [
        "The difference of the arm's error between the two postures, across the slot.",
    ]
    blind = [
        "Everything along and into the slot: the step is one direction of three.",
        "Errors common to both sides: the slot may be displaced and its halves still meet.",
    ]
    if gain > PARALLEL:
        sees.insert(0, f"The tool tip, {gain:.2f} times its error across the tool.")
    else:
        blind.append("The tool tip: the tool was rotated about the measured direction.")
    if frames == "shared":
        blind.insert(
            0,
            "The frame: both halves move with it, so a frame error of millimetres gives no step. "
            "Probe a datum that was not used for it.",
        )
    else:
        sees.append(
            "The difference of the two frames, in full; their common error is not detected."
        )
    return tuple(sees), tuple(blind)


DatumVerdict: TypeAlias = Literal["holds", "is off", "undecided"]

CERTAIN: Final = 0.99
"""Probability of "is off", over all datums together."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DatumCheck:
    """Datums that were not used for the frame, touched again.

    Attributes:
        names: Of the datums.
        deviation: (n, 3) m, touched less nominal, part axes.
        covariance: (n, 3, 3) m^2 of it if the frame is right: frame, touch and arm.
        probability: (n,) of a deviation this large if the frame is right.
        tolerance: m, permitted deviation of the part.
        resolution: m, largest 95 % half axis of ``covariance``: smaller errors are not detected.
        verdict: ``"is off"``: beyond the tolerance and its uncertainty; ``"undecided"``: the check
            resolves less than the tolerance, or chance may explain it; ``"holds"``: neither.
        reason: One sentence with the numbers.
    """

    names: tuple[str, ...]
    deviation: Array
    covariance: Array
    probability: Array
    tolerance: float
    resolution: float
    verdict: DatumVerdict
    reason: str

    @property
    def distance(self) -> Array:
        """(n,) m, length of each deviation."""
        return np.asarray(np.linalg.norm(self.deviation, axis=1))


def check_datums(
    T_base_part: Array,
    covariance: Array,
    in_part: Array,
    in_base: Array,
    *,
    noise: Noise,
    tolerance: float,
    names: tuple[str, ...] | None = None,
    used: tuple[str, ...] = (),
) -> DatumCheck:
    """Returns whether datums agree with the frame, within the uncertainty of touching them.

    Touch them with the model and the posture used for cutting: the check then detects a wrong
    frame, a part that moved, exchanged features, and the arm's error in that posture.

    Args:
        T_base_part: (4, 4) the frame to be checked.
        covariance: (6, 6) of it: origin (m) and left rotation vector (rad), base axes.
        in_part: (n, 3) m, nominal datums.
        in_base: (n, 3) m, touched.
        noise: Of a touch: probe, and the arm's own error from place to place.
        tolerance: m.
        names: One per datum.
        used: Names of the touches the frame was made of.

    Raises:
        ConfigurationError: A datum that the frame was made of, or no tolerance.
        ShapeError: Wrong shapes, or no datum.
    """
    lever = np.asarray(in_part, dtype=np.float64) @ T_base_part[:3, :3].T
    known = propagate_covariance(np.asarray(covariance), lever)
    turn = T_base_part[:3, :3]
    return judge_datums(
        T_base_part,
        in_part,
        in_base,
        covariance=turn.T @ (known + noise.sigma**2 * np.eye(3)) @ turn,
        tolerance=tolerance,
        names=names,
        used=used,
    )


def judge_datums(
    T_base_part: Array,
    in_part: Array,
    in_base: Array,
    *,
    covariance: Array,
    tolerance: float,
    names: tuple[str, ...] | None = None,
    used: tuple[str, ...] = (),
) -> DatumCheck:
    """Returns the check of datums whose covariance is known.

    Args:
        T_base_part: (4, 4) the frame to be checked.
        in_part: (n, 3) m, nominal datums.
        in_base: (n, 3) m, touched.
        covariance: (n, 3, 3) m^2 in part, of touched less nominal if the frame is right.
        tolerance: m.
        names: One per datum.
        used: Names of the touches the frame was made of.

    Raises:
        ConfigurationError: As :func:`check_datums`.
        ShapeError: As :func:`check_datums`.
    """
    part: Array = frozen(in_part, (None, 3), "in_part")
    base: Array = frozen(in_base, (len(part), 3), "in_base")
    labels = name_touches(names, len(part))
    if not len(part):
        raise ShapeError("no datum to check.")
    if not tolerance > 0.0:
        raise ConfigurationError(f"tolerance {tolerance / MM:g} mm, expected more than 0.")
    common = sorted(set(labels) & set(used))
    if common:
        raise ConfigurationError(
            f"datum {', '.join(common)} was used for the frame and agrees with it by construction.",
            hint="touch another feature of the part.",
        )
    deviation = apply(inverse(T_base_part), base) - part
    square = np.einsum("ni,nij,nj->n", deviation, np.linalg.inv(covariance), deviation)
    probability = chi2.sf(square, 3)
    resolution = float(np.sqrt(chi2.ppf(0.95, 3) * np.linalg.eigvalsh(covariance)[:, -1].max()))
    verdict, reason = _check_deviation(deviation, probability, resolution, tolerance, labels)
    return DatumCheck(
        names=labels,
        deviation=frozen(deviation, (len(part), 3), "deviation"),
        covariance=frozen(covariance, (len(part), 3, 3), "covariance"),
        probability=frozen(probability, (len(part),), "probability"),
        tolerance=tolerance,
        resolution=resolution,
        verdict=verdict,
        reason=reason,
    )


def _check_deviation(
    deviation: Array,
    probability: Array,
    resolution: float,
    tolerance: float,
    names: tuple[str, ...],
) -> tuple[DatumVerdict, str]:
    distance = np.linalg.norm(deviation, axis=1)
    unlikely = probability < (1.0 - CERTAIN) / len(names)
    beyond = distance > tolerance
    worst = int(np.argmax(distance))
    found = f"datum {names[worst]} is off by {distance[worst] / MM:.3f} mm"
    allowed = f"tolerance {tolerance / MM:.3f} mm"
    if (unlikely & beyond).any():
        return "is off", f"{found}, {allowed}: more than the uncertainty of frame, touch and arm."
    if resolution > tolerance:
        return (
            "undecided",
            f"{found}, {allowed}, but the check resolves {resolution / MM:.3f} mm only.",
        )
    if unlikely.any():
        return (
            "holds",
            f"{found}, {allowed}: within it, but more than the stated uncertainty.",
        )
    if beyond.any():
        return "undecided", f"{found}, {allowed}: beyond it, but within its uncertainty."
    return "holds", f"{found}, {allowed}."
