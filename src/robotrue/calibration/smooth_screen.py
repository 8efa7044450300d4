"""Whether a smooth residual can predict parts of the rows that are left out, before the joint fit.

At fixed scales and linearisation a part left out costs one factorisation of what the other rows
state about the columns F of the fit; those of the smooth residual, Z, follow from it by blocks.
With S the sums of the other rows over their noise, D the prior sd and amplitudes a,

    A = D^-2 + S_FF,    (S_ZZ - S_ZF A^-1 S_FZ + 1 / a^2) v = s_Z - S_ZF A^-1 s_F

is the smooth residual v, and v = 0 is the fit without it. The scales are those of all rows, the
parts left out among them, and of several amplitudes the best counts: where even so no part is
predicted better, learning all scales again without each part gives the same at ten times the cost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from robotrue.calibration.design import Design, WhitenedRows
from robotrue.calibration.evidence import Sums, Weights, prior_sd
from robotrue.calibration.held_out_blocks import label_blocks, sums_without
from robotrue.core.arrays import Array, BoolArray

AMPLITUDES: Final = (1.0, 0.5, 0.25)
"""Tried, in units of the amplitude that was learned on the held-out errors."""


def compare_left_out(
    design: Design,
    sums: Sequence[Sums],
    fit: Weights,
    amplitude: float,
    parts: Sequence[BoolArray] = (),
    kept: Sequence[WhitenedRows] = (),
) -> tuple[float, float] | None:
    """Returns the mean errors of parts left out, without and with a smooth residual, m.

    The mean over the parts of the mean error of each.

    Args:
        design: With the centres of the smooth residual.
        sums: Of all rows, over its columns.
        fit: Without the smooth residual.
        amplitude: m, largest amplitude that is tried.
        parts: Masks over the measurement set; five contiguous blocks if there are none.
        kept: All rows, from :meth:`Design.keep_rows`.

    Returns:
        None if no part can be placed: tracker set-ups that the other rows do not have.
    """
    if not parts:
        block = label_blocks(len(design.weights))
        parts = [block == k for k in np.unique(block)]
    station = np.zeros(len(design.weights), dtype=np.int64)
    for observation in design.observations:
        station[observation.rows] = observation.visits.station
    groups = design.groups(fit.scales() | {"smooth": 1.0})
    sd = prior_sd(groups, len(sums[0].pull))
    means = []
    for part in parts:
        counted = part & (design.weights > 0.0)
        if not counted.any() or not np.isin(station[part], station[~part]).all():
            continue
        others = sums_without(design, sums, part, kept)
        columns = sd[:, None] * _solve_amplitudes(design, others, fit.noise, sd, amplitude)
        lengths = []
        for item in design.rows(counted, kept):
            off = item.values[:, :3, None] - item.columns[:, :3] @ columns
            lengths.append(np.linalg.norm(item.lower[:, :3, :3] @ off, axis=1))
        means.append(np.concatenate(lengths).mean(axis=0))
    if not means:
        return None
    plain, *richer = np.mean(means, axis=0).tolist()
    return plain, min(richer)


def add_smooth_columns(
    design: Design, sums: Sequence[Sums], kept: Sequence[WhitenedRows] = ()
) -> list[Sums]:
    """Returns the sums of all rows over the columns of a design with a smooth residual.

    Args:
        design: With the centres of the smooth residual.
        sums: Over the columns of the same design without them: these are not multiplied again.
        kept: All rows, from :meth:`Design.keep_rows`.
    """
    if any(s.few for s in sums):
        return design.sums(kept=kept)
    smooth = _mask_smooth(design)
    size, count = len(smooth), int(smooth.sum())
    products = np.zeros((len(sums), size, count + 1))
    for item in design.rows(kept=kept):
        root = np.sqrt(design.weights[item.rows])[:, None]
        for channel in range(item.values.shape[1] // 3):
            place = slice(3 * channel, 3 * channel + 3)
            columns = (item.columns[:, place] * root[:, :, None]).reshape(-1, size)
            values = (item.values[:, place] * root).reshape(-1)
            products[channel] += columns.T @ np.column_stack([columns[:, smooth], values])
    out = []
    for known, product in zip(sums, products, strict=True):
        gram = np.empty((size, size))
        gram[np.ix_(~smooth, ~smooth)] = known.gram
        gram[:, smooth], gram[smooth] = product[:, :count], product[:, :count].T
        out.append(replace(known, gram=gram, pull=product[:, count]))
    return out


def _mask_smooth(design: Design) -> BoolArray:
    """The smooth residual's columns among those in use."""
    smooth = np.zeros(len(design.active), dtype=bool)
    smooth[design.place("smooth")] = True
    return smooth[design.active]


def _solve_amplitudes(
    design: Design, sums: Sequence[Sums], noise: Array, sd: Array, amplitude: float
) -> Array:
    """Weights (p, 4) over their prior sd: without a smooth residual, and by amplitude."""
    smooth = _mask_smooth(design)
    order = np.argsort(smooth, kind="stable")
    known = int((~smooth).sum())
    gram = np.zeros((len(sd), len(sd)))
    for s, t in zip(sums, noise, strict=True):
        gram += s.whole_gram() * (sd / t)
    gram *= sd[:, None]
    if (np.diff(order) != 1).any():
        gram = gram[np.ix_(order, order)]
    pull = (sd * sum(s.pull / t for s, t in zip(sums, noise, strict=True)))[order]
    cross, corner = gram[:known, known:], gram[known:, known:]
    gram[np.diag_indices(known)] += 1.0
    factor = cho_factor(gram[:known, :known], lower=True)
    solved = cho_solve(factor, np.column_stack([pull[:known], cross]))
    left, force = corner - cross.T @ solved[:, 1:], pull[known:] - cross.T @ solved[:, 0]
    values = [np.zeros(len(corner))]
    for share in AMPLITUDES:
        inverse = np.eye(len(corner)) / (share * amplitude) ** 2
        values.append(np.linalg.solve(left + inverse, force))
    out = np.zeros((len(order), len(values)))
    out[order] = [
        *(solved[:, :1] - solved[:, 1:] @ np.transpose(values)),
        *np.transpose(values),
    ]
    return out
