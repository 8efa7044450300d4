"""Evidence of a hypothesis about measured rows, in closed form.

    y ~ N(0, K),   K = H H' + geometry + ripple + smooth + joints + C + white

with one learned scale each. Columns Z of a hypothesis with sd s add ``s^2 Z Z'``; their Bayes
factor against nothing needs only ``A = Z' K^-1 Z`` and ``b = Z' K^-1 y``:

    log B = -1/2 log |1 + s^2 A| + 1/2 b' (1 / s^2 + A)^-1 b.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Literal, Protocol, TypeAlias

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import gammaln

from robotrue.core.arrays import Array, IntArray
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel
from robotrue.validation.doctor_case import JOINT_SD, Case, spread_blocks

WIDTHS: Final = np.array([0.1e-3, 0.5e-3, 2e-3, 10e-3, 100e-3])
"""m, sd of the effect of a hypothesis on a point; each is as likely."""
WHITE: Final = 2e-5
"""m per axis, white noise beyond instrument and repeatability that is usual."""
FACTORS: Final = (4.0, 2.0, 2.0, 1.4, 1.4, 1.2)
"""Steps by which scales are searched, one round each; from known scales the last four."""
HEALTHY_JOINTS: Final = 3e-4
"""rad, 0.017 deg: scatter of a drive that no healthy arm exceeds, unmodelled ripple included."""
LOOSENESS: Final = 1.5
"""Sd of the logarithm of a scale about its usual size."""
GEOMETRY_LOOSENESS: Final = 0.7
"""The same of geometry: else errors of the file pass for links that are centimetres off."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scales:
    """Factors on the usual sizes of what a clean arm may show.

    Attributes:
        geometry: On the priors of geometry and compliance.
        ripple: On the usual ripple.
        smooth: Smooth residual, over 0.1 mm.
        joints: Scatter of the joints, over :data:`JOINT_SD`.
        white: White noise, over :data:`WHITE`.
    """

    geometry: float
    ripple: float
    smooth: float
    joints: float
    white: float


USUAL: Final = Scales(geometry=1.0, ripple=1.0, smooth=0.3, joints=0.3, white=1.0)
NAMES: Final = ("white", "geometry", "smooth", "ripple", "joints")


@dataclass(frozen=True)
class Evidence:
    """The rows under one hypothesis about their covariance.

    Attributes:
        case: The rows.
        scales: Learned.
        lower: (m, m) Cholesky factor of K; m = 3 n.
        log_evidence: Log density of the rows, with that of the scales.
        extra: (m, q) columns of a hypothesis that K holds, over their sd; q = 0 for a clean set.
    """

    case: Case
    scales: Scales
    lower: Array
    log_evidence: float
    extra: Array

    @cached_property
    def root(self) -> Array:
        """(m, m) L^-1."""
        size = len(self.lower)
        return np.asarray(solve_triangular(self.lower, np.eye(size), lower=True))

    @cached_property
    def white_values(self) -> Array:
        """(m,) L^-1 y."""
        return np.asarray(self.root @ self.case.values.ravel())

    @cached_property
    def pull(self) -> Array:
        """(m,) K^-1 y."""
        return np.asarray(self.root.T @ self.white_values)

    @cached_property
    def precision(self) -> Array:
        """(m, m) K^-1."""
        return np.asarray(self.root.T @ self.root)

    def predict_left_out(self) -> tuple[Array, Array]:
        """Returns residual (n, 3) m of each row predicted from all others, its covariance."""
        n = len(self.case.values)
        blocks = self.precision.reshape(n, 3, n, 3)[np.arange(n), :, np.arange(n), :]
        covariance = np.asarray(np.linalg.inv(blocks))
        gap = covariance @ self.pull.reshape(n, 3, 1)
        return gap[:, :, 0], covariance

    def coefficients(self) -> Array:
        """Returns the mean (q,) of the coefficients of ``extra``, over their sd."""
        return np.asarray(self.extra.T @ self.pull)


_ARM: Final = ("geometry", "ripple", "smooth")


def learn(case: Case, extra: Array | None = None, start: Scales | None = None, *,
          noise: Array | None = None) -> Evidence:  # fmt: skip
    """Returns the rows with the scales that make them most likely.

    Args:
        case: The rows.
        extra: (n, 3, q) columns of a hypothesis, over their sd.
        start: Where the search begins; then one round of small steps is done.
        noise: (n, 3, 3) m^2 of a hypothesis about the noise.
    """
    m = case.values.size
    columns = np.zeros((m, 0)) if extra is None else extra.reshape(m, -1)
    fixed = columns @ columns.T
    if noise is not None:
        fixed = fixed + spread_blocks(noise)
    parts = {**case.covariances, "loose": case.covariances["loose"] + fixed}
    scales = USUAL if start is None else start
    best = _density(case, parts, scales)
    for factor in FACTORS if start is None else FACTORS[2:]:
        for name in NAMES:
            scales, best = _search(case, parts, scales, best, name, factor)
    lower = np.asarray(np.linalg.cholesky(_total(parts, scales)))
    return Evidence(case=case, scales=scales, lower=lower, log_evidence=best, extra=columns)


def fit_rows(case: Case) -> Evidence:
    """Returns the unchanged rows; searched as long as every hypothesis about them is."""
    return learn(case, start=learn(case).scales)


def weigh_noise(case: Case, scales: Scales, noise: Array | None = None) -> float:
    """Returns the log density of the rows with scales held and noise (n, 3, 3) m^2 added."""
    parts = case.covariances
    if noise is not None:
        parts = {**parts, "loose": parts["loose"] + spread_blocks(noise)}
    return _density(case, parts, scales)


def _search(
    case: Case, parts: dict[str, Array], scales: Scales, best: float, name: str, factor: float
) -> tuple[Scales, float]:
    """Moves one scale as long as the rows become more likely."""
    for way in (factor, 1.0 / factor):
        moved = False
        for _ in range(8):
            trial = replace(scales, **{name: getattr(scales, name) * way})
            if trial.joints * JOINT_SD > HEALTHY_JOINTS:
                break
            density = _density(case, parts, trial)
            if density <= best:
                break
            scales, best, moved = trial, density, True
        if moved:
            break
    return scales, best


def _density(case: Case, parts: dict[str, Array], scales: Scales) -> float:
    """Log density of the rows and of the scales."""
    try:
        lower = np.linalg.cholesky(_total(parts, scales))
    except np.linalg.LinAlgError:
        return -np.inf
    white = solve_triangular(lower, case.values.ravel(), lower=True, check_finite=False)
    away = (np.log(scales.geometry / USUAL.geometry) / GEOMETRY_LOOSENESS) ** 2 + sum(
        (np.log(getattr(scales, name) / getattr(USUAL, name)) / LOOSENESS) ** 2
        for name in NAMES
        if name != "geometry"
    )
    log_det = float(np.log(np.diagonal(lower)).sum())
    return float(-0.5 * white @ white - log_det - 0.5 * away)


def _total(parts: dict[str, Array], scales: Scales) -> Array:
    total = parts["loose"].copy()
    for name in _ARM:
        total += getattr(scales, name) ** 2 * parts[name]
    total += scales.joints**2 * parts["joints"]
    total[np.diag_indices(len(total))] += (scales.white * WHITE) ** 2
    return total


def column_odds(precision: Array, right: Array, widths: Array = WIDTHS) -> tuple[Array, IntArray]:
    """Returns log Bayes factors (k,) of columns against none, and which width is likeliest.

    Args:
        precision: (k, q, q) Z' K^-1 Z.
        right: (k, q) Z' K^-1 y.
        widths: (w,) sd of the coefficients, each as likely.
    """
    values, vectors = np.linalg.eigh(precision)
    values = np.maximum(values, 0.0)
    turned = np.einsum("kpq,kp->kq", vectors, right)
    size = values[:, None, :] * widths[None, :, None] ** 2
    gain = 0.5 * (turned[:, None, :] ** 2 * widths[None, :, None] ** 2 / (1.0 + size)).sum(axis=2)
    each = gain - 0.5 * np.log1p(size).sum(axis=2)
    top = each.max(axis=1)
    odds = top + np.log(np.exp(each - top[:, None]).mean(axis=1))
    return np.asarray(odds), np.asarray(each.argmax(axis=1))


def columns_fit(evidence: Evidence, columns: Array, widths: Array = WIDTHS) -> tuple[float, float]:
    """Returns the log Bayes factor of columns (n, 3, q) and the likeliest width."""
    m = len(evidence.lower)
    flat = columns.reshape(m, -1)
    white = evidence.root @ flat
    odds, which = column_odds(
        (white.T @ white)[None], (white.T @ evidence.white_values)[None], widths
    )
    return float(odds[0]), float(widths[which[0]])


def log_choices(total: int, picked: Sequence[int] | IntArray) -> float:
    """Returns the log prior of one subset of rows: its size uniform, then any as likely."""
    count = len(picked)
    ways = gammaln(total + 1) - gammaln(count + 1) - gammaln(total - count + 1)
    return float(-ways - np.log(total + 1))


CauseName: TypeAlias = Literal[
    "instrument-moved", "drift", "reflector", "scale", "payload", "one-direction",
    "joints-early", "clock", "shifted-rows", "joint-sign", "joint-turn", "joint-offset",
    "joints-exchanged", "preset", "duplicates", "stale-points", "outliers",
]  # fmt: skip
"""Names of causes, as ``--cure`` takes them."""
HOPELESS: Final = -3.0
"""Log Bayes factor of a cheap test below which a hypothesis is dropped."""


@dataclass(frozen=True, kw_only=True)
class Hypothesis:
    """One possible fault of rows, with its correction.

    Attributes:
        cause: Its name.
        text: The fault, with numbers and units; no rows, no full stop.
        log_odds: Log Bayes factor against clean rows, with the price of its freedom.
        rows: (k,) affected rows of the whole set; all if the whole file is affected.
        cure: Returns the whole corrected set; None where the cure is outside the rows.
        robot: The corrected robot, where that is the cure.
        columns: (n, 3, q) m, effect of the hypothesis on the examined rows, over its sd; None where
            ``log_odds`` follow from a separate fit.
        price: Log of the choices that were made to find it, in ``log_odds`` already.
        revise: From coefficients (q,) of ``columns`` to the hypothesis that has them.
        refine: From corrected rows, fitted again, to the hypothesis that corrects them better: a
            large effect is not linear. Its text, ``cure`` and ``refine`` replace those.
        rival: Returns the same fault of all other rows instead, where that is another hypothesis.
        advice: Action in the shop, an imperative sentence.
    """

    cause: CauseName
    text: str
    log_odds: float
    rows: IntArray
    cure: Callable[[], MeasurementSet] | None
    advice: str
    robot: RobotModel | None = None
    columns: Array | None = None
    price: float = 0.0
    revise: Callable[[Array], Hypothesis] | None = None
    refine: Callable[[Evidence], Hypothesis | None] | None = None
    rival: Callable[[], Hypothesis] | None = None

    @cached_property
    def cured(self) -> MeasurementSet | None:
        """The whole corrected set."""
        return None if self.cure is None else self.cure()


class DataSuspicion(Protocol):
    """A group of causes that are looked for together."""

    def look(self, residuals: Evidence) -> Sequence[Hypothesis]:
        """Returns the likeliest hypotheses of this group, by cheap tests.

        Args:
            residuals: The examined rows under "clean", with their case.
        """
        ...


def move_points(rows: MeasurementSet, shift: Array) -> MeasurementSet:
    """Returns rows with positions (n, 3) m moved by ``-shift``."""
    return replace(rows, position=rows.position - shift)
