"""Reasons not to trust a number, found by rule and said in words."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.calibration.training_summary import TrainingSummary
from robotrue.core.arrays import Array, IntArray
from robotrue.core.files import sha256
from robotrue.core.units import DEG, MM
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.validation.metrics import Coverage, ErrorStatistics

FEW_POINTS: Final = 20
"""With 20 points the interval of a 95 % coverage is 24 points wide; fewer decide nothing."""
REPEATABILITY: Final = 0.03 * MM
"""m, 3-D, the best an industrial arm repeats to; part of every single visit."""
REGION_MARGIN: Final = 2.0 * DEG


def physical_floor(instrument_covariance: Array) -> float:
    """Returns the least error in m one visit per pose can show: instrument and repeatability.

    Root sum of squares of the instrument's 3-D sigma and :data:`REPEATABILITY`.

    Args:
        instrument_covariance: (n, 3, 3) m^2.
    """
    instrument = float(np.mean(np.trace(instrument_covariance, axis1=1, axis2=2)))
    return float(np.hypot(np.sqrt(instrument), REPEATABILITY))


def outside_training_region(summary: TrainingSummary, joints: Array) -> IntArray:
    """Returns the rows with a joint more than 2 deg outside the range the model was trained in.

    Without a joint range in the summary no row is returned.

    Args:
        summary: :meth:`ErrorModel.training_summary`.
        joints: (n, dof) rad.
    """
    stated = summary.joint_range
    if stated is None or stated.shape != (2, joints.shape[1]):
        return np.zeros(0, dtype=np.int64)
    low, high = stated
    outside = (joints < low - REGION_MARGIN) | (joints > high + REGION_MARGIN)
    rows: IntArray = np.flatnonzero(outside.any(axis=1))
    return rows


def find_doubts(
    *,
    after: ErrorStatistics,
    aligned: ErrorStatistics | None,
    coverage: Coverage,
    outside: int,
    floor: float,
    summary: TrainingSummary,
    measured: MeasurementSet,
) -> tuple[str, ...]:
    """Returns every reason found not to take the result at its word, one sentence each."""
    found: list[str] = []
    found.extend(_overlap_doubt(summary, measured))
    if after.n < FEW_POINTS:
        found.append(
            f"Only {after.n} poses: the largest error and the coverage mean little; at least "
            f"{FEW_POINTS} are asked for."
        )
    if outside:
        found.append(
            f"{outside} of {after.n} poses have a joint outside the range the model was trained "
            "in: there it extrapolates."
        )
    if after.mean < floor:
        found.append(
            f"A mean of {after.mean / MM:.3f} mm is below the {floor / MM:.3f} mm that instrument "
            f"and repeatability ({REPEATABILITY / MM:.2f} mm) allow for one visit per pose: "
            "averaged, simulated, or seen by the fit."
        )
    if aligned is not None and after.mean >= aligned.mean:
        found.append(
            f"Correcting base and tool alone gives {aligned.mean / MM:.3f} mm on these poses, the "
            f"model {after.mean / MM:.3f} mm: the model is no better than a frame correction here."
        )
    found.extend(_coverage_doubt(coverage))
    found.extend(summary.warnings)
    return tuple(found)


def _overlap_doubt(summary: TrainingSummary, measured: MeasurementSet) -> tuple[str, ...]:
    if summary.data_sha256 == sha256(measured.joints.tobytes() + measured.position.tobytes()):
        return (
            "The fit saw exactly these poses: the errors say how well the model bends, not how "
            "well it predicts. Validate on poses held back.",
        )
    shared = sorted(set(summary.sources) & set(measured.sources))
    if not shared:
        return ()
    return (
        f"The fit used rows of the same file ({', '.join(shared)}): the numbers hold only if these "
        "poses were held back.",
    )


def _coverage_doubt(coverage: Coverage) -> tuple[str, ...]:
    if coverage.is_honest:
        return ()
    direction = "too small" if coverage.share < coverage.level else "too large"
    return (
        f"The stated {100 * coverage.level:.0f} % regions hold {100 * coverage.share:.1f} % of the "
        f"poses (interval {100 * coverage.low:.1f} to {100 * coverage.high:.1f} %): the stated "
        f"uncertainty is {direction} here.",
    )
