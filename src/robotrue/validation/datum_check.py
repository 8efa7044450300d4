"""Datum check: a feature that had no part in a frame, touched again, shows whether the frame holds.

What a two-sided slot test cannot see. A small fit residual cannot show it either: the touches a
frame was made of agree with it by construction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np
from scipy.stats import chi2

from robotrue.cell.registration.fit import Noise, name_touches
from robotrue.core.arrays import Array, frozen
from robotrue.core.poses import apply, inverse
from robotrue.core.rotations import skew
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ShapeError

DatumVerdict: TypeAlias = Literal["holds", "is off", "cannot tell"]

CERTAIN: Final = 0.99
"""Probability behind "is off", over all datums together."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DatumCheck:
    """Datums that had no part in the frame, touched again.

    Attributes:
        names: Of the datums.
        deviation: (n, 3) m, touched less nominal, part axes.
        covariance: (n, 3, 3) m^2 of it if the frame is right: frame, touch and arm.
        probability: (n,) of a deviation this large if the frame is right.
        tolerance: m, what the part may be off.
        resolution: m, largest 95 % half axis of ``covariance``: smaller errors are not seen.
        verdict: ``"is off"``: beyond the tolerance and too far for its uncertainty; ``"cannot
            tell"``: the check resolves less than the tolerance, or chance may explain it;
            ``"holds"``: neither.
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
    """Returns whether datums lie where the frame says, within what touching them can tell.

    Touch them with the model, and in the posture, the part will be cut with: the check then sees
    the frame, a part that moved, exchanged features, and the arm's error in that posture.

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
    turn = T_base_part[:3, :3]
    lever = part @ turn.T
    jacobian = np.concatenate([np.broadcast_to(np.eye(3), (len(part), 3, 3)), -skew(lever)], -1)
    known = jacobian @ np.asarray(covariance) @ np.swapaxes(jacobian, -1, -2)
    total = turn.T @ (known + noise.sigma**2 * np.eye(3)) @ turn
    deviation = apply(inverse(T_base_part), base) - part
    square = np.einsum("ni,nij,nj->n", deviation, np.linalg.inv(total), deviation)
    probability = chi2.sf(square, 3)
    resolution = float(np.sqrt(chi2.ppf(0.95, 3) * np.linalg.eigvalsh(total)[:, -1].max()))
    verdict, reason = _check_deviation(deviation, probability, resolution, tolerance, labels)
    return DatumCheck(
        names=labels,
        deviation=frozen(deviation, (len(part), 3), "deviation"),
        covariance=frozen(total, (len(part), 3, 3), "covariance"),
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
        return "is off", f"{found}, {allowed}: more than frame, touch and arm explain."
    if resolution > tolerance:
        return (
            "cannot tell",
            f"{found}, {allowed}, but the check resolves {resolution / MM:.3f} mm only.",
        )
    if unlikely.any():
        return (
            "holds",
            f"{found}, {allowed}: within it, yet more than the stated uncertainty explains.",
        )
    if beyond.any():
        return "cannot tell", f"{found}, {allowed}: beyond it, but so may chance be."
    return "holds", f"{found}, {allowed}."
