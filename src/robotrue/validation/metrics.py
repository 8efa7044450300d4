"""Statistics of error vectors and the honesty of their stated covariances."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final

import numpy as np
from scipy.special import chdtr, chdtri, gammaln, ndtri

from robotrue.core.arrays import Array, frozen
from robotrue.core.json_values import json_values
from robotrue.core.units import MM
from robotrue.errors import ShapeError

FREEDOM: Final = 8.0
"""Degrees of Student's law by which candidates are scored."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorStatistics:
    """Statistics of n error vectors. Lengths ``e_i = |error_i|`` in m.

    Attributes:
        n: Number of points.
        mean: Mean length.
        max: Largest length.
        p95: 95th percentile of the lengths (linear interpolation).
        std: Standard deviation of the lengths, n - 1 (0 for one point).
        rms: Root mean square length.
        three_sigma: ``mean + 3 std``, the form ISO 9283 uses for repeatability.
        axis_mean: (3,) mean per base axis, signed.
        axis_std: (3,) standard deviation per axis, n - 1.
        axis_max: (3,) largest absolute value per axis.
    """

    n: int
    mean: float
    max: float
    p95: float
    std: float
    rms: float
    three_sigma: float
    axis_mean: Array
    axis_std: Array
    axis_max: Array

    def document(self) -> dict[str, object]:
        """Returns JSON values, lengths in mm."""
        lengths = (f.name for f in fields(self) if f.name != "n")
        return {"n": self.n, **{f"{k}_mm": json_values(getattr(self, k) / MM) for k in lengths}}


def error_statistics(errors: Array) -> ErrorStatistics:
    """Returns the statistics of error vectors (n, 3) m.

    Raises:
        ShapeError: No rows, another shape, or values that are not finite.
    """
    errors = frozen(errors, (None, 3), "errors")
    n = len(errors)
    if n == 0:
        raise ShapeError("no points for the statistics.", hint="check the selection of rows.")
    length = np.linalg.norm(errors, axis=1)
    spread = 1 if n > 1 else 0
    mean, std = float(length.mean()), float(length.std(ddof=spread))
    return ErrorStatistics(
        n=n,
        mean=mean,
        max=float(length.max()),
        p95=float(np.percentile(length, 95.0)),
        std=std,
        rms=float(np.sqrt(np.mean(length**2))),
        three_sigma=mean + 3.0 * std,
        axis_mean=frozen(errors.mean(axis=0), (3,), "axis_mean"),
        axis_std=frozen(errors.std(axis=0, ddof=spread), (3,), "axis_std"),
        axis_max=frozen(np.abs(errors).max(axis=0), (3,), "axis_max"),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """Share of residuals inside their stated regions.

    Attributes:
        level: Stated probability.
        n: Number of points.
        share: Observed share inside the 3-D ellipsoids.
        low: Lower end of the 95 % Wilson interval of ``share``.
        high: Upper end.
        axis_share: (3,) observed share inside the interval of each axis alone.
    """

    level: float
    n: int
    share: float
    low: float
    high: float
    axis_share: Array

    @property
    def is_honest(self) -> bool:
        """True when the stated level lies in the interval of the observed share."""
        return self.low <= self.level <= self.high


def squared_distance(residuals: Array, covariances: Array) -> Array:
    """Returns the squared Mahalanobis distance r' C^-1 r of each row, shape (n,).

    Args:
        residuals: (n, 3) m.
        covariances: (n, 3, 3) m^2.

    Raises:
        ShapeError: A covariance that is not positive definite.
    """
    residuals = frozen(residuals, (None, 3), "residuals")
    covariances = frozen(covariances, (len(residuals), 3, 3), "covariances")
    try:
        factor = np.linalg.cholesky(covariances)
    except np.linalg.LinAlgError:
        smallest = np.linalg.eigvalsh(covariances).min(axis=1)
        row = int(np.argmin(smallest))
        raise ShapeError(
            f"covariance of row {row} is not positive definite (smallest eigenvalue "
            f"{smallest[row]:.3g} m^2): coverage needs a spread in every direction.",
            hint="state the instrument and the repeatability.",
        ) from None
    white = np.linalg.solve(factor, residuals[..., None])[..., 0]
    out: Array = np.sum(white**2, axis=1)
    return out


def coverage(residuals: Array, covariances: Array, level: float = 0.95) -> Coverage:
    """Returns the number of residuals in the ``level`` ellipsoids of their covariances.

    A residual is inside when ``r' C^-1 r <= chi2_3(level)``; an axis alone when ``|r_k|`` is below
    the two-sided normal quantile times its standard deviation.

    Args:
        residuals: (n, 3) m, measured minus predicted.
        covariances: (n, 3, 3) m^2, of the residual: prediction plus instrument.
        level: Stated probability.

    Raises:
        ShapeError: No rows, or a covariance that is not positive definite.
    """
    distance = squared_distance(residuals, covariances)
    if not len(distance):
        raise ShapeError("no points for the coverage.")
    inside = distance <= chi2_quantile(level, 3)
    sigma = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    axis = np.abs(residuals) <= ndtri(0.5 + level / 2.0) * sigma
    low, high = wilson_interval(int(inside.sum()), len(inside))
    return Coverage(
        level=level,
        n=len(inside),
        share=float(inside.mean()),
        low=low,
        high=high,
        axis_share=frozen(axis.mean(axis=0), (3,), "axis_share"),
    )


def coverage_probability(residuals: Array, covariances: Array) -> Array:
    """Returns for each row the probability of the smallest region that holds it, shape (n,).

    Uniform on 0..1 when the covariances are honest.
    """
    out: Array = np.asarray(chdtr(3.0, squared_distance(residuals, covariances)))
    return out


def log_density(residuals: Array, covariances: Array) -> Array:
    """Returns the log density log N(r; 0, C) of each residual, shape (n,), in log(1/m^3)."""
    distance = squared_distance(residuals, covariances)
    log_det = np.linalg.slogdet(covariances)[1]
    out: Array = -0.5 * (distance + log_det + 3.0 * np.log(2.0 * np.pi))
    return out


def student_scores(residuals: Array, covariances: Array) -> Array:
    """Returns the log density (n,) of residuals (n, 3) m under Student's law, in log(1/m^3).

    On :data:`FREEDOM` degrees, so that no single row decides.

    Args:
        residuals: Measured minus predicted.
        covariances: (n, 3, 3) m^2, scale of the law.

    Raises:
        ShapeError: A covariance that is not positive definite.
    """
    distance = squared_distance(residuals, covariances)
    size = np.linalg.slogdet(covariances)[1]
    constant = gammaln((FREEDOM + 3.0) / 2.0) - gammaln(FREEDOM / 2.0)
    constant -= 1.5 * np.log(np.pi * FREEDOM)
    tail = -0.5 * (FREEDOM + 3.0) * np.log1p(distance / FREEDOM)
    return np.asarray(constant - 0.5 * size + tail)


def chi2_quantile(level: float, degrees: int) -> float:
    """Returns the value a chi-square variable of ``degrees`` stays below with ``level``."""
    return float(chdtri(float(degrees), 1.0 - level))


def wilson_interval(inside: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    """Returns the Wilson score interval of a share ``inside / n``.

    Unlike the normal interval it stays within 0..1 and is fair for few points (Wilson 1927).

    Raises:
        ShapeError: n is zero, or inside is not within 0..n.
    """
    if not 0 <= inside <= n or n == 0:
        raise ShapeError(f"{inside} of {n} points, expected 0 <= inside <= n and n > 0.")
    z = float(ndtri(0.5 + confidence / 2.0))
    share = inside / n
    centre = (share + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * np.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
    return max(0.0, float(centre - half)), min(1.0, float(centre + half))
