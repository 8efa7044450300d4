"""The one way from rows to a posterior: linearise at the mean, condition the prior, move, again.

Updates, transfers and touches differ in their rows, their robust weights and where they stop. A row
is weighed by how far it lies from what the belief predicts (before conditioning), or from what all
other rows predict (:func:`left_out_lengths`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from robotrue.calibration.belief import Belief, condition
from robotrue.calibration.new_rows import NewRows, Piece, whiten
from robotrue.calibration.robust import Loss, weights
from robotrue.core.arrays import Array, IntArray
from robotrue.core.units import MM
from robotrue.errors import ConvergenceError

LINEARISATIONS: Final = 3
"""Steps that take a posterior near its prior to rest."""


def condition_on_rows(
    prior: Belief,
    rows: NewRows,
    noise: Array,
    row_weights: Array,
    *,
    start: Belief | None = None,
    steps: int = LINEARISATIONS,
    still: float = 0.0,
) -> tuple[Belief, NewRows]:
    """Returns the posterior of the rows, linearised at its own mean, and the rows moved there.

    Args:
        prior: With the nuisances of the rows at its end.
        rows: The rows.
        noise: (2,) white variance of lengths and angles.
        row_weights: (n,) robust weights.
        start: Where the mean already is; one linearisation is then enough.
        steps: Most linearisations.
        still: m and rad; nuisances that move by less are at rest. Zero: all steps are taken.

    Raises:
        ConvergenceError: Nuisances that still move by more than ``still`` after all steps.
    """
    at, size = (prior if start is None else start), 0.0
    for _ in range(steps if start is None else 1):
        columns, values = whiten(rows.pieces(at), noise, row_weights)
        at = condition(prior, columns, values)
        step = at.mean[at.end :]
        rows = rows.moved(step)
        size = float(np.abs(step).max(initial=0.0))
        if size < still:
            return at, rows
    if still > 0.0:
        raise ConvergenceError(
            f"the frames still move by {size / MM:.3g} mm (or mrad) after {steps} linearisations.",
            hint="give start frames nearer to the parts, or touch more points.",
        )
    return at, rows


def weigh_innovations(
    belief: Belief,
    pieces: Sequence[Piece],
    noise: Array,
    count: int,
    loss: Loss,
    inflation: float = 1.0,
) -> Array:
    """Returns the robust weight (n,) of rows by how far they lie from what the belief predicts."""
    out = np.ones(count)
    for piece in pieces:
        n, m, p = piece.columns.shape
        half = (piece.columns.reshape(n * m, p) @ belief.root.T).reshape(n, m, -1)
        spread = half @ np.swapaxes(half, 1, 2)
        total = inflation * (spread + piece.covariance + (noise @ piece.white) * np.eye(m))
        off = piece.values - piece.columns @ belief.mean
        solved = np.linalg.solve(total, off[:, :, None])[:, :, 0]
        length = np.sqrt(np.maximum((off * solved).sum(axis=1), 0.0))
        out[piece.rows] = weights(length, m, loss)
    return out


def left_out_lengths(
    total: Array, offset: Array, blocks: Sequence[IntArray], plain: Array
) -> Array:
    """Returns the whitened length (b,) of each block of numbers, predicted from all others.

    With P the inverse of the covariance of all numbers, ``e = P_bb^-1 (P y)_b`` has the covariance
    ``P_bb^-1`` (Rasmussen and Williams 2006, eq. 5.10-5.12, in blocks).

    Args:
        total: (m, m) covariance of all numbers, noise over weight included.
        offset: (m,) y, measured minus expected.
        blocks: Numbers of each block.
        plain: (m, m) what full weight would take from the noise in ``total``: a block without
            weight is compared as one that had full weight.
    """
    precision = np.linalg.inv(total)
    force = precision @ offset
    out = np.empty(len(blocks))
    for i, mine in enumerate(blocks):
        own = np.linalg.inv(precision[np.ix_(mine, mine)])
        off = own @ force[mine]
        own = own + plain[np.ix_(mine, mine)]
        out[i] = np.sqrt(max(float(off @ np.linalg.solve(own, off)), 0.0))
    return out
