"""Whether a smooth residual can predict blocks left out, before it is fitted with all the rest.

At fixed scales a block left out is a closed formula of one factorisation (Rasmussen and Williams
2006, eq. 5.10-5.12, in blocks). With whitened rows y = F w + Z v + e and T T' = F C F', C the
posterior covariance without v,

    K^-1 = 1 - T T',    V = K^-1 Z,    K2^-1 = K^-1 - V (1 / a^2 + Z'V)^-1 V'
    residual of block B = (K^-1)_BB^-1 (K^-1 y)_B,  and the same with K2

The scales are those of all rows, the blocks left out among them, and of several amplitudes a the
best counts: where even so no block is predicted better, learning all scales anew without each block
finds the same at a hundred times the cost.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from robotrue.calibration.design import Design
from robotrue.calibration.evidence import Weights
from robotrue.calibration.held_out_blocks import label_blocks
from robotrue.core.arrays import Array, BoolArray, IntArray

AMPLITUDES: Final = (1.0, 0.5, 0.25)
"""Tried, in units of the amplitude that was learned on the held-out errors."""
MOST_NUMBERS: Final = 20_000
"""Numbers beyond which the rows are not kept in memory side by side."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _WhiteRows:
    """All rows with weight, whitened, weighed and by their learned noise: N numbers.

    Attributes:
        known: (N, p) columns of the fit.
        smooth: (N, k) columns of the smooth residual.
        residual: (N,) K^-1 y.
        row: (N,) row of the set.
        lower: (rows of the set, 3, 3) takes whitened positions back to m.
        unit: (N,) what weight and noise have scaled a number by.
        position: (N,) axis of the number, 0 to 2; 3 to 5 of an angle.
    """

    known: Array
    smooth: Array
    residual: Array
    row: IntArray
    lower: Array
    unit: Array
    position: IntArray


def compare_left_out(
    design: Design, weights: Weights, amplitude: float
) -> tuple[float, float] | None:
    """Returns the mean errors of rows left out in blocks, without and with a smooth residual, m.

    Args:
        design: With the centres of the smooth residual.
        weights: The fit without them.
        amplitude: m, largest amplitude that is tried.

    Returns:
        None where that cannot be said: too many rows, or a block that nothing else determines.
    """
    counted = design.weights > 0.0
    rows = _collect_rows(design, weights, counted)
    if rows is None:
        return None
    turned = rows.known @ weights.root.T
    pulled = rows.smooth - turned @ (turned.T @ rows.smooth)
    gram, force = rows.smooth.T @ pulled, rows.smooth.T @ rows.residual
    block = label_blocks(len(design.weights))[rows.row]
    scales = [amplitude * share for share in AMPLITUDES]
    inner = [np.linalg.inv(np.eye(len(gram)) / a**2 + gram) for a in scales]
    plain, richer = np.zeros(len(rows.row)), np.zeros((len(scales), len(rows.row)))
    try:
        for k in np.unique(block):
            mine = block == k
            part, residual = pulled[mine], rows.residual[mine]
            solved = _solve_left_out(turned[mine], np.column_stack([residual, part]))
            plain[mine] = solved[:, 0]
            for i, weight in enumerate(inner):
                # (A - V W V')^-1 (e - V W f), A solved above
                middle = np.linalg.inv(weight) - part.T @ solved[:, 1:]
                start = solved[:, 0] - solved[:, 1:] @ (weight @ force)
                richer[i, mine] = start + solved[:, 1:] @ np.linalg.solve(middle, part.T @ start)
    except LinAlgError:
        return None
    return _mean_length(rows, plain, counted), min(_mean_length(rows, r, counted) for r in richer)


def _collect_rows(design: Design, weights: Weights, counted: BoolArray) -> _WhiteRows | None:
    """The rows side by side; None if they are too many."""
    place = design.place("smooth")
    fresh = np.zeros(len(design.active), dtype=bool)
    fresh[place] = True
    fresh = fresh[design.active]
    numbers = sum(o.covariance.shape[1] * len(o.rows) for o in design.observations)
    if numbers > MOST_NUMBERS:
        return None
    known, smooth, residual, row, unit, position = [], [], [], [], [], []
    lower = np.zeros((len(counted), 3, 3))
    for item in design.rows(counted):
        n, m = item.values.shape
        scale = np.sqrt(design.weights[item.rows][:, None] / np.repeat(weights.noise, 3)[:m])
        columns = item.columns * scale[:, :, None]
        flat = columns[:, :, ~fresh].reshape(n * m, -1)
        known.append(flat)
        smooth.append(columns[:, :, fresh].reshape(n * m, -1))
        residual.append((item.values * scale).ravel() - flat @ weights.mean)
        row.append(np.repeat(item.rows, m))
        unit.append(scale.ravel())
        position.append(np.tile(np.arange(m), n))
        lower[item.rows] = item.lower[:, :3, :3]
    return _WhiteRows(
        known=np.concatenate(known),
        smooth=np.concatenate(smooth),
        residual=np.concatenate(residual),
        row=np.concatenate(row),
        lower=lower,
        unit=np.concatenate(unit),
        position=np.concatenate(position),
    )


def _solve_left_out(turned: Array, values: Array) -> Array:
    """(1 - T T')^-1 values, in the smaller of the two spaces."""
    numbers, columns = turned.shape
    if numbers <= columns:
        matrix = np.eye(numbers) - turned @ turned.T
        return np.asarray(cho_solve(cho_factor(matrix, lower=True), values))
    matrix = np.eye(columns) - turned.T @ turned
    return np.asarray(
        values + turned @ cho_solve(cho_factor(matrix, lower=True), turned.T @ values)
    )


def _mean_length(rows: _WhiteRows, residual: Array, counted: BoolArray) -> float:
    """Mean length of the position errors behind whitened residuals (N,), m."""
    off = np.zeros((len(counted), 3))
    lengths = rows.position < 3
    off[rows.row[lengths], rows.position[lengths]] = (residual / rows.unit)[lengths]
    error = (rows.lower[counted] @ off[counted][:, :, None])[:, :, 0]
    return float(np.linalg.norm(error, axis=1).mean())
