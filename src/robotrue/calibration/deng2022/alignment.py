"""Carrying the source to a sub-space: the turn T_j and the label map H_j (eq. 11-15).

Points are rows here, as in eq. 15, so the 4 x 4 that multiplies them from the right is the
transpose of eq. 11.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.calibration.deng2022.domains import PRINTED_UNITS, turned_features
from robotrue.calibration.deng2022.readings import AlignmentInputs, DengReadings, TransformReading
from robotrue.core.arrays import Array, IntArray
from robotrue.core.units import MM
from robotrue.errors import ObservabilityError, ShapeError

RIDGES: Final = 10.0 ** np.arange(-8.0, 5.0)
"""lambda tried by leave-one-out, positions and errors in mm, angles in deg."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """T_j and H_j of one sub-space.

    Attributes:
        angle: rad, turn about joint 1 read off T_j.
        transform: (4, 4) T_j for row vectors in m.
        labels: (7, 3) or (10, 3) H_j: from position (and attitude), error and 1 to the error; mm,
            deg and mm as printed.
        ridge: lambda used.
        distance: (m,) m between each target pose and the turned source pose it is paired with.
    """

    angle: float
    transform: Array
    labels: Array
    ridge: float
    distance: Array


def row_transform(
    reading: TransformReading,
    angle: float,
    *,
    source: Array,
    mapped_source: Array,
    mapped_target: Array,
) -> Array:
    """Returns T_j (4, 4) for homogeneous row vectors in m, eq. 11-12.

    Args:
        reading: See :class:`DengReadings`.
        angle: rad between source and sub-space, for ``known-angle``.
        source: (n, 3) m, all source points.
        mapped_source: (m, 3) m, those with an image in the sub-space.
        mapped_target: (m, 3) m, their images.

    Raises:
        ShapeError: The literal reading with n other than m: eq. 12 cannot be multiplied.
        ObservabilityError: The mapped points do not span space.
    """
    if reading == "known-angle":
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]).T
    left = _homogeneous(source if reading == "literal" else mapped_source)
    right, image = _homogeneous(mapped_source), _homogeneous(mapped_target)
    if len(left) != len(right):
        raise ShapeError(
            f"eq. 12 multiplies X_sd' (4 x {len(left)}: all source points) with X_sd,td "
            f"({len(right)} x 4: mapped points only); not conformable.",
            hint="transform='least-squares' uses the mapped points in both places.",
        )
    moment = left.T @ right
    if np.linalg.cond(moment) > 1e12:
        raise ObservabilityError(
            f"{len(right)} mapped points that lie in a plane; eq. 12 has no solution.",
            hint="four points or more that span space, or transform='known-angle'.",
        )
    return np.asarray(np.linalg.solve(moment, right.T @ image))


def design(features: Array, errors: Array, inputs: AlignmentInputs) -> Array:
    """Returns D = (X T_j, Y, L) (n, 7) or (n, 10) in mm, deg, mm and 1.

    Args:
        features: (n, 6) m and rad, already turned into the sub-space.
        errors: (n, 3) m, measured in the source.
        inputs: Positions only, or all six pose numbers.
    """
    count = 3 if inputs == "positions" else 6
    x = features[:, :count] / PRINTED_UNITS[:count]
    return np.column_stack([x, errors / MM, np.ones(len(x))])


def ridge_solution(
    D: Array, Y: Array, ridge: float, *, rows: Array | None = None, centre: Array | None = None
) -> Array:
    """Returns H (p, 3) that minimises ``|D H - Y|^2 + ridge |H - centre|^2``, eq. 14.

    Args:
        D: (m, p).
        Y: (m, 3).
        ridge: lambda.
        rows: (m,) weights of the rows; equal if not given.
        centre: (p, 3); zero, as printed, if not given.
    """
    start = np.zeros((D.shape[1], Y.shape[1])) if centre is None else centre
    root = np.ones(len(D)) if rows is None else np.sqrt(rows)
    # The stacked form instead of the normal equations: D has columns of millimetres and of ones.
    tall = np.concatenate([root[:, None] * D, np.sqrt(ridge) * np.eye(D.shape[1])])
    wanted = np.concatenate([root[:, None] * (Y - D @ start), np.zeros_like(start)])
    solution: Array = start + np.linalg.lstsq(tall, wanted, rcond=None)[0]
    return solution


def leave_one_out(
    D: Array, Y: Array, ridge: float, *, rows: Array | None = None, centre: Array | None = None
) -> float:
    """Returns the sum of squared leave-one-out residuals, mm^2, in closed form.

    The residual of a row the solution never saw is its residual over ``1 - h``, with h the row's
    entry on the diagonal of the hat matrix.

    Fails when: a row alone determines a combination of H and lambda is zero; h is 1 there.
    """
    weight = np.ones(len(D)) if rows is None else rows
    u, s, _ = np.linalg.svd(np.sqrt(weight)[:, None] * D, full_matrices=False)
    leverage = np.einsum("ik,k->i", u**2, s**2 / (s**2 + ridge))
    residual = Y - D @ ridge_solution(D, Y, ridge, rows=rows, centre=centre)
    return float(np.sum(weight[:, None] * (residual / (1.0 - leverage)[:, None]) ** 2))


def weighted_columns(D: Array, Y: Array, ridge: float, weights: Array, centre: Array) -> Array:
    """Returns H (p, 3) of eq. 13 with omega_m as printed: a weight on each output column.

    Equation 13 weighs column a of the residual by w_a, the penalty of eq. 14 with it; both sides
    then carry the same factor. A weight of zero leaves its column at the centre.

    Args:
        D: (m, p).
        Y: (m, 3).
        ridge: lambda.
        weights: (3,) omega_m.
        centre: (p, 3).
    """
    used = weights > 0.0
    out = centre.copy()
    scaled = ridge_solution(D, Y * weights, ridge, centre=centre * weights)
    out[:, used] = scaled[:, used] / weights[used]
    return out


def turned_labels(angle: float, inputs: AlignmentInputs) -> Array:
    """Returns the H of "the error turns with the pose", (7, 3) or (10, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    count = 3 if inputs == "positions" else 6
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.concatenate([np.zeros((count, 3)), turn.T, np.zeros((1, 3))])


def align(
    readings: DengReadings,
    angle: float,
    *,
    source: Array,
    source_errors: Array,
    mapped: IntArray,
    target: Array,
    target_errors: Array,
    covariance: Array,
    distance: Array,
) -> Alignment:
    """Returns T_j and H_j of one sub-space, eq. 11-14.

    Args:
        readings: Which reading of each equation.
        angle: rad between source and sub-space.
        source: (n, 6) features of all source rows, m and rad.
        source_errors: (n, 3) m.
        mapped: (m,) source row of each target row.
        target: (m, 6) features of the target rows of the sub-space.
        target_errors: (m, 3) m.
        covariance: (m, 3, 3) m^2 of the target measurements, for omega_m.
        distance: (m,) m of the pairs, see :class:`robotrue.calibration.deng2022.domains.Pairs`.

    Raises:
        ShapeError: The literal eq. 12.
        ObservabilityError: The least-squares T_j of points in one plane.
    """
    transform = row_transform(
        readings.transform,
        angle,
        source=source[:, :3],
        mapped_source=source[mapped, :3],
        mapped_target=target[:, :3],
    )
    found = float(np.arctan2(transform[0, 1], transform[0, 0]))
    D = design(
        moved_features(source[mapped], transform, found, readings),
        source_errors[mapped],
        readings.inputs,
    )
    Y = target_errors / MM
    to_zero = readings.shrink_to == "zero"
    turn = turned_labels(found, readings.inputs)
    centre = np.zeros_like(turn) if to_zero else turn
    rows = None
    if readings.alignment_weights == "rows":
        rows = 1.0 / np.trace(covariance, axis1=1, axis2=2)
        rows = rows / rows.mean()
    ridge = readings.ridge_value
    if readings.ridge == "leave-one-out":
        loss = [leave_one_out(D, Y, value, rows=rows, centre=centre) for value in RIDGES]
        ridge = float(RIDGES[int(np.argmin(loss))])
    if readings.alignment_weights == "columns":
        weights = measurement_weights(target_errors, covariance).mean(axis=0)
        labels = weighted_columns(D, Y, ridge, weights, centre)
    else:
        labels = ridge_solution(D, Y, ridge, rows=rows, centre=centre)
    return Alignment(
        angle=found, transform=transform, labels=labels, ridge=ridge, distance=distance
    )


def moved_features(
    features: Array, transform: Array, angle: float, readings: DengReadings
) -> Array:
    """Returns source features (n, 6) in a sub-space: X T_j, and the attitude by the switch."""
    out = turned_features(features, angle, readings.attitude)
    out[:, :3] = (_homogeneous(features[:, :3]) @ transform)[:, :3]
    return out


def carry_source(
    alignment: Alignment, readings: DengReadings, features: Array, errors: Array
) -> tuple[Array, Array]:
    """Returns the source in the sub-space, eq. 15: features (n, 6) and errors (n, 3) m."""
    moved = moved_features(features, alignment.transform, alignment.angle, readings)
    return moved, design(moved, errors, readings.inputs) @ alignment.labels * MM


def measurement_weights(errors: Array, covariance: Array) -> Array:
    """Returns omega_m (n, 3): robot error over tracker deviation, for each pose and axis.

    Section 2.1: zero where the tracker's deviation exceeds the robot's error; the threshold by
    which it may come near to it is not in the paper, and zero here.

    Args:
        errors: (n, 3) m.
        covariance: (n, 3, 3) m^2 of the measurement.
    """
    deviation = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    size = np.abs(errors)
    out: Array = np.where(size > deviation, size / deviation, 0.0)
    return out


def _homogeneous(points: Array) -> Array:
    return np.column_stack([points, np.ones(len(points))])
