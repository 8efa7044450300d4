"""Rows that do not belong: found by a robust rule, named with file, line and reason.

In whitened coordinates z = L^-1 r, C = L L^T, the centre is the median and the scale of each axis
1.4826 MAD, never below one: a model that is better than promised does not make outliers. The
distance of a row is ``|(z - centre) / scale|``, in sigma.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, IntArray, frozen
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError, ShapeError
from robotrue.measurement.measurement_set import MeasurementSet

_SMALL_GROUP = 12  # fewer rows do not determine their own scale


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One row and what is odd about it.

    Attributes:
        row: Index into the measurement set.
        group: Name of its set.
        source: File it came from; empty if made in code.
        line: One-based line in that file.
        reason: One sentence, with numbers and units.
        dropped: The row is not used; otherwise it is only reported.
    """

    row: int
    group: str
    source: str
    line: int
    reason: str
    dropped: bool

    def __str__(self) -> str:
        where = f"{self.source}:{self.line}" if self.source else f"{self.group}, line {self.line}"
        return f"{where}: {self.reason}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Screening:
    """The outcome of :func:`screen`.

    Attributes:
        kept: (n,) True for rows to use.
        findings: In row order.
        scale: (3,) robust scale of the whitened residuals over all rows, 1 = as promised.
    """

    kept: npt.NDArray[np.bool_]
    findings: tuple[Finding, ...]
    scale: Array


def screen(
    measurements: MeasurementSet,
    residuals: Array,
    covariance: Array,
    *,
    limit: float = 6.0,
    most: float = 0.02,
) -> Screening:
    """Returns which rows to use, and a finding for every one that is odd.

    A row is dropped if its residual is more than ``limit`` robust sigma from the middle of its
    group, or if it repeats an earlier row to the last digit. Two visits to one pose that differ by
    more than ``limit`` sigma are reported.

    Args:
        measurements: n rows.
        residuals: (n, 3) m, measured minus predicted.
        covariance: (n, 3, 3) m^2 of the residuals: instrument, repeatability and model.
        limit: Robust sigma.
        most: Largest part of the rows that may go.

    Raises:
        ImplausibleDataError: More rows than that are odd: the model is wrong, not the rows.
        ShapeError: Shapes differ, or a covariance is not positive definite.
    """
    n = len(measurements)
    residuals = frozen(residuals, (n, 3), "residuals")
    covariance = frozen(covariance, (n, 3, 3), "covariance")
    try:
        factor = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        raise ShapeError("covariance of the residuals is not positive definite.") from None
    white = np.linalg.solve(factor, residuals[:, :, None])[:, :, 0]
    distance, scale = _distances(white, measurements.group)
    kept = np.ones(n, dtype=bool)
    findings: dict[int, Finding] = {}
    for first, row in duplicate_rows(measurements):
        kept[row] = False
        reason = f"the same as line {int(measurements.source_row[first])} to the last digit"
        findings[row] = _finding(measurements, row, reason, dropped=True)
    size = np.linalg.norm(residuals, axis=1)
    for row in (int(i) for i in np.flatnonzero(kept & (distance > limit))):
        kept[row] = False
        reason = f"residual {size[row] / MM:.3f} mm, {distance[row]:.1f} sigma (limit {limit:g})"
        findings[row] = _finding(measurements, row, reason, dropped=True)
    for row, reason in _unlike_repeats(measurements, covariance * scale.max() ** 2, limit):
        findings.setdefault(row, _finding(measurements, row, reason, dropped=False))
    ordered = tuple(findings[row] for row in sorted(findings))
    _refuse_too_many(ordered, kept, most)
    return Screening(kept=kept, findings=ordered, scale=scale)


def duplicate_rows(measurements: MeasurementSet) -> list[tuple[int, int]]:
    """Returns (first, later) rows with equal joints, position and load, to the last digit."""
    if not len(measurements):
        return []
    table = np.column_stack(
        [measurements.joints, measurements.position, measurements.wrench, measurements.target]
    )
    first, later = _find_repeats(table)
    return list(zip(first.tolist(), later.tolist(), strict=True))


def _find_repeats(table: Array) -> tuple[IntArray, IntArray]:
    """Rows equal to an earlier one: the first of them, and each later."""
    _, first, inverse = np.unique(table, axis=0, return_index=True, return_inverse=True)
    origin = first[inverse.reshape(-1)]
    later = np.flatnonzero(origin != np.arange(len(table)))
    return origin[later], later


def _distances(white: Array, group: npt.NDArray[np.int64]) -> tuple[Array, Array]:
    """Returns (n,) distances in robust sigma and the (3,) scale over all rows."""
    centre, scale = _middle(white)
    out = np.linalg.norm((white - centre) / scale, axis=1)
    for index in np.unique(group):
        rows = np.flatnonzero(group == index)
        if len(rows) >= _SMALL_GROUP:
            own_centre, own_scale = _middle(white[rows])
            out[rows] = np.linalg.norm((white[rows] - own_centre) / own_scale, axis=1)
    return out, scale


def _middle(white: Array) -> tuple[Array, Array]:
    centre = np.median(white, axis=0)
    mad = np.median(np.abs(white - centre), axis=0)
    return np.asarray(centre), np.maximum(1.4826 * mad, 1.0)


def _unlike_repeats(
    measurements: MeasurementSet, covariance: Array, limit: float
) -> list[tuple[int, str]]:
    """Returns rows that visit the pose of an earlier row under the same load and land elsewhere."""
    pose = np.column_stack(
        [
            measurements.joints,
            measurements.wrench,
            measurements.approach,
            measurements.target,
            measurements.station,
            measurements.group,
        ]
    )
    first, later = _find_repeats(pose)
    gap = measurements.position[later] - measurements.position[first]
    joint = covariance[later] + covariance[first]
    sigma = np.sqrt(np.einsum("ni,ni->n", gap, np.linalg.solve(joint, gap[:, :, None])[:, :, 0]))
    out = []
    for k in np.flatnonzero(sigma > limit):
        apart = np.linalg.norm(gap[k]) / MM
        line = int(measurements.source_row[first[k]])
        reason = f"the pose of line {line} again, {apart:.3f} mm apart ({sigma[k]:.1f} sigma)"
        out.append((int(later[k]), reason))
    return out


def _finding(measurements: MeasurementSet, row: int, reason: str, *, dropped: bool) -> Finding:
    return Finding(
        row=row,
        group=measurements.group_names[int(measurements.group[row])],
        source=measurements.file_of(row),
        line=int(measurements.source_row[row]),
        reason=reason,
        dropped=dropped,
    )


def _refuse_too_many(
    findings: tuple[Finding, ...], kept: npt.NDArray[np.bool_], most: float
) -> None:
    gone = int((~kept).sum())
    # A handful of bad rows in a small set is not yet a wrong model.
    if gone <= max(most * len(kept), 2):
        return
    dropped = [finding for finding in findings if finding.dropped]
    shown = "; ".join(str(finding) for finding in dropped[:3])
    raise ImplausibleDataError(
        f"{gone} of {len(kept)} rows are odd, at most {most:.1%} may be dropped. First: {shown}.",
        source=dropped[0].source or None,
        line=dropped[0].line,
        hint="look at these rows; if they are right, the robot model or the frame is wrong.",
    )
