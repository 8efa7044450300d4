"""Choice of poses: greedy I-optimal, D-optimal by exchange, and the next pose.

Everything is in the whitened coordinates of :mod:`robotrue.planning.information`, in which the
covariance before measuring is I. With P the covariance now and A (3, k) the rows of a candidate,

    P+ = P - P A' (I + A P A')^-1 A P                             measuring it once
    I:  tr(G P G') - tr(G P+ G') = tr[(I + A P A')^-1 A P W P A']     W = mean of G' G
    D:  log det P - log det P+   = log det(I + A P A')

(Fedorov 1972, sections 2.2 and 3.3; I-optimal is also called V- or IMSE-optimal.) All candidates
share P, and one chosen pose changes ``A P V`` (V V' = W) and ``A P A'`` of all of them by products
with three columns: a step costs little more than reading the rows once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.errors import ConfigurationError
from robotrue.planning.plan_defaults import CRITERION, Criterion

CRITERIA: Final = ("I", "D")
EXCHANGES: Final = 30
"""Poses tried by the exchange at most, one whole pass at least."""
BETTER: Final = 1e-6
"""Relative gain below which an exchange is none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """Poses chosen one after the other.

    Attributes:
        chosen: (n,) rows of the candidates, in the order of choice.
        variance: (n + 1,) m^2, mean over the evaluation postures of the trace of what is left to
            learn, after 0, 1, ..., n of them.
        log_det: (n + 1,) -log det P after 0, 1, ..., n of them.
    """

    chosen: IntArray
    variance: Array
    log_det: Array


class _Posterior:
    """P and the terms of every candidate's gain, updated by low-rank steps."""

    def __init__(self, rows: Array, weight: Array, covariance: Array | None = None) -> None:
        n, m, size = rows.shape
        values, vectors = np.linalg.eigh(weight)
        self.covariance = np.eye(size) if covariance is None else covariance.copy()
        self.directions = vectors * np.sqrt(np.maximum(values, 0.0))  # V with V V' = W
        self.rows, self.flat = rows, rows.reshape(n * m, size)
        seen = self.flat if covariance is None else self.flat @ self.covariance
        self.projected = seen @ self.directions  # A P V
        projected = self.projected.reshape(n, m, -1)
        self.outer = np.einsum("nik,njk->nij", projected, projected)  # A P W P A'
        self.inner = np.einsum("nik,njk->nij", seen.reshape(n, m, size), rows) + np.eye(m)

    @property
    def variance(self) -> float:
        """tr(P W), m^2."""
        return float(np.einsum("ij,ij->", self.covariance @ self.directions, self.directions))

    def gains(self, criterion: Criterion) -> Array:
        """(n,) what each candidate would gain: m^2 for I, nats for D."""
        if criterion == "D":
            return np.asarray(np.linalg.slogdet(self.inner)[1])
        return np.asarray(np.linalg.solve(self.inner, self.outer).trace(axis1=1, axis2=2))

    def add(self, index: int) -> None:
        """Measures a candidate once more.

        Measurements are never taken back: where a pose is all that is known of a direction, what
        remains without it is the difference of numbers that agree to many digits.
        """
        m = self.rows.shape[1]
        mine = self.rows[index]
        ahead = self.covariance @ mine.T  # P a'
        inverse = np.linalg.inv(np.eye(m) + mine @ ahead)
        share = inverse @ ahead.T
        common = self.flat @ ahead  # A P a'
        shown = share @ self.directions
        # (T - C S)(T - C S)' = T T' - C (T S' - C S S' / 2)' - (...) C'
        half = self.projected @ shown.T - common @ (0.5 * shown @ shown.T)
        self.projected -= common @ shown
        cross = _blocks(common, half, m)
        self.outer -= cross + np.swapaxes(cross, 1, 2)
        self.inner -= _blocks(common, common @ inverse, m)
        self.covariance -= ahead @ share


def _blocks(a: Array, b: Array, m: int) -> Array:
    """Diagonal blocks (n, m, m) of a b' for a, b (n m, few)."""
    shape = (-1, m, a.shape[1])
    return np.asarray(a.reshape(shape) @ np.swapaxes(b.reshape(shape), 1, 2))


def greedy(
    rows: Array,
    weight: Array,
    n: int,
    *,
    criterion: Criterion = CRITERION,
    covariance: Array | None = None,
    allowed: BoolArray | None = None,
    enough: float = 0.0,
    on_step: Callable[[int], None] | None = None,
) -> Choice:
    """Returns up to n candidates, each the best after those before; none is used twice.

    Args:
        rows: (c, m, k) whitened rows of the candidates.
        weight: (k, k) m^2, W: mean of G' G over the evaluation postures.
        n: Largest number.
        criterion: ``"I"`` or ``"D"``.
        covariance: (k, k) P before the first; I if not given.
        allowed: (c,) allowed candidates; all if not given.
        enough: m^2; stops when the best candidate lowers the mean variance by less.
        on_step: Called with the number chosen, before each.

    Raises:
        ConfigurationError: More poses are requested than there are candidates.
    """
    free = np.ones(len(rows), dtype=bool) if allowed is None else np.array(allowed)
    if n > free.sum():
        raise ConfigurationError(
            f"{n} poses are requested, {int(free.sum())} candidates are left.",
            hint="draw more candidates, or ask for fewer poses.",
        )
    at = _Posterior(rows, weight, covariance)
    chosen: list[int] = []
    variance, log_det = [at.variance], [0.0]
    while len(chosen) < n:
        if on_step is not None:
            on_step(len(chosen))
        gains = np.where(free, at.gains(criterion), -np.inf)
        best = int(np.argmax(gains))
        step = float(np.linalg.slogdet(at.inner[best])[1])
        at.add(best)
        left = at.variance
        if variance[-1] - left < enough:
            break
        free[best] = False
        chosen.append(best)
        variance.append(left)
        log_det.append(log_det[-1] + step)
    return Choice(
        chosen=np.array(chosen, dtype=np.int64),
        variance=np.array(variance),
        log_det=np.array(log_det),
    )


def exchange_poses(
    rows: Array,
    weight: Array,
    start: IntArray,
    *,
    criterion: Criterion = CRITERION,
    sweeps: int | None = None,
    on_step: Callable[[int], None] | None = None,
) -> Choice:
    """Returns the start with single poses exchanged as long as the criterion improves.

    Each chosen pose in turn is replaced by the best candidate for its place, which may be itself,
    so no exchange makes the plan worse (Mitchell and Miller's form of Fedorov's algorithm).

    Args:
        rows: (c, m, k) whitened rows of the candidates.
        weight: (k, k) m^2.
        start: (n,) rows of the candidates to start from.
        criterion: ``"I"`` or ``"D"``.
        sweeps: Most passes over the plan; as many as :data:`EXCHANGES` allow if not given.
        on_step: Called with the number of exchanges tried, before each.
    """
    free = np.ones(len(rows), dtype=bool)
    chosen = [int(k) for k in start]
    free[chosen] = False
    most = passes(len(chosen)) if sweeps is None else sweeps
    for sweep in range(most):
        moved = False
        for place, old in enumerate(chosen):
            if on_step is not None:
                on_step(sweep * len(chosen) + place)
            others = rows[chosen[:place] + chosen[place + 1 :]]
            without = _Posterior(rows, weight, covariance_after(others))
            gains = without.gains(criterion)
            best = int(np.argmax(np.where(free, gains, -np.inf)))
            if gains[best] > gains[old] * (1.0 + BETTER):
                free[old], free[best] = True, False
                chosen[place] = best
                moved = True
        if not moved:
            break
    return follow(rows, weight, np.array(chosen, dtype=np.int64))


def passes(n: int) -> int:
    """Returns the largest number of passes of :func:`exchange_poses` over n poses."""
    return max(1, EXCHANGES // max(n, 1))


def follow(rows: Array, weight: Array, order: IntArray) -> Choice:
    """Returns the remaining uncertainty after each pose of a given order."""
    mine = rows[order]
    at = _Posterior(mine, weight)
    variance, log_det = [at.variance], [0.0]
    for k in range(len(order)):
        log_det.append(log_det[-1] + float(np.linalg.slogdet(at.inner[k])[1]))
        at.add(k)
        variance.append(at.variance)
    return Choice(chosen=order, variance=np.array(variance), log_det=np.array(log_det))


def covariance_after(rows: Array, covariance: Array | None = None) -> Array:
    """Returns P (k, k) after measuring all of the rows (n, m, k) once."""
    size = rows.shape[2]
    flat = rows.reshape(-1, size)
    before = np.eye(size) if covariance is None else covariance
    ahead = before @ flat.T
    inner = np.eye(len(flat)) + flat @ ahead
    return np.asarray(before - ahead @ np.linalg.solve(inner, ahead.T))


def next_pose(
    measured: Array,
    rows: Array,
    weight: Array,
    *,
    criterion: Criterion = CRITERION,
    allowed: BoolArray | None = None,
) -> tuple[int, float]:
    """Returns the best candidate to measure next, and its decrease of the mean variance, m^2.

    Args:
        measured: (n, m, k) whitened rows of the poses measured so far; may be none.
        rows: (c, m, k) whitened rows of the candidates.
        weight: (k, k) m^2.
        criterion: ``"I"`` or ``"D"``.
        allowed: (c,) allowed candidates; all if not given.

    Raises:
        ConfigurationError: No candidate is left.
    """
    found = greedy(
        rows,
        weight,
        1,
        criterion=criterion,
        covariance=covariance_after(measured),
        allowed=allowed,
    )
    return int(found.chosen[0]), float(found.variance[0] - found.variance[1])
