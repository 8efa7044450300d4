"""Poles and residues of a measured response by linear least squares in the frequency domain.

Poles (LSCF): every curve is a polynomial over one common denominator in z = e^{j theta}, theta
running once round the circle over the band; the denominator's roots are the poles. Poles of the
structure come back at every order, those of the noise do not. The band is worked through in parts,
so that modes at 10 Hz and at 2 kHz are both seen finely. Complex coefficients, since only positive
frequencies are mapped.

Residues (LSFD) of given poles, per pair of axes, with s = j omega and real unknowns Re R, Im R,
upper, lower::

    G(s) = sum_k [ R_k / (s - p_k) + conj(R_k) / (s - conj(p_k)) ] + upper + lower / s^2

A static deflection is one more line, at s = 0, and then there is no lower residual.

Source: Guillaume, Verboven, Vanlanduit 1998 (ISMA 23), Frequency-domain maximum likelihood
identification of modal parameters with confidence intervals, sect. 4; Verboven 2002,
Frequency-domain system identification for modal analysis, ch. 3.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.dynamics.frf import ComplexArray

_RATIO: Final = 4.0
"""Highest over lowest frequency of a part of the band."""
_LINES: Final = 64
"""Fewest lines of a part."""
_MOST_LINES: Final = 2000
_OVERLAP: Final = 0.15
_SWEEP: Final = 0.9
"""Part of the circle the band takes: less than all, its two ends are not neighbours."""
MOST_ORDER: Final = 32
_SAME_FREQUENCY: Final = 0.01
_SAME_DAMPING: Final = 0.2
_DAMPING: Final = (2e-4, 0.4)
_OFTEN: Final = 0.35
"""Part of the orders at which a pole has to come back."""


def find_stable_poles(frequency: Array, curves: ComplexArray, weight: Array) -> ComplexArray:
    """Returns the poles (k,) rad/s, by rising size, that come back order after order.

    Args:
        frequency: (m,) Hz above zero.
        curves: (m, c), any unit.
        weight: (m, c), one over the error to be expected of each value.
    """
    picked: list[complex] = []
    for part in _parts(frequency):
        by_order = _by_order(frequency[part], curves[part], weight[part])
        picked += _clusters(_stable(by_order), len(by_order))
    return np.array(sorted(_without_twins(picked), key=abs), dtype=np.complex128)


def _parts(frequency: Array) -> list[slice]:
    """Overlapping runs of lines, each some octaves wide and rich enough in lines."""
    parts, start = [], 0
    while True:
        stop = int(np.searchsorted(frequency, _RATIO * frequency[start]))
        stop = min(max(stop, start + _LINES), len(frequency))
        if len(frequency) - stop < _LINES // 2:
            stop = len(frequency)
        parts.append(slice(start, stop, max(1, (stop - start) // _MOST_LINES)))
        if stop == len(frequency):
            return parts
        start = max(start + 1, stop - max(8, round(_OVERLAP * (stop - start))))


def _by_order(frequency: Array, curves: ComplexArray, weight: Array) -> list[list[complex]]:
    """Poles inside the band (rad/s) at each order of the denominator."""
    low, high = frequency[0], frequency[-1]
    period = _SWEEP / (high - low)
    most = min(MOST_ORDER, len(frequency) // 3)
    basis = np.exp(2j * np.pi * period * np.outer(frequency - low, np.arange(most + 1)))
    blocks = []
    for k in range(curves.shape[1]):
        x = weight[:, k, None] * basis
        y = -(weight[:, k] * curves[:, k])[:, None] * basis
        blocks.append((x.conj().T @ x, x.conj().T @ y, y.conj().T @ y))
    found = []
    for n in range(2, most + 1):
        size = n + 1
        normal = np.zeros((size, size), dtype=np.complex128)
        for r, s, t in blocks:
            cross = s[:size, :size]
            normal += (
                t[:size, :size]
                - cross.conj().T @ np.linalg.lstsq(r[:size, :size], cross, rcond=None)[0]
            )
        # The lowest coefficient is one: roots that only fit noise then fall outside the circle.
        rest = np.linalg.lstsq(normal[1:, 1:], -normal[1:, 0], rcond=None)[0]
        roots = np.roots(np.concatenate([rest[::-1], [1.0]]))
        roots = roots[np.abs(roots) > 1e-6]
        pole = np.log(roots) / period
        turn = 2.0 * np.pi / period
        pole = pole.real + 1j * np.mod(pole.imag, turn) + 2j * np.pi * low
        found.append(_plausible(pole, low, high))
    return found


def _plausible(poles: ComplexArray, low: float, high: float) -> list[complex]:
    damping = -poles.real / np.abs(poles)
    frequency = np.abs(poles) / (2.0 * np.pi)
    keep = (damping > _DAMPING[0]) & (damping < _DAMPING[1])
    keep &= (frequency >= low) & (frequency <= high)
    return [complex(p) for p in poles[keep]]


def _stable(by_order: list[list[complex]]) -> ComplexArray:
    """Poles that the order below has, too."""
    pairs = itertools.pairwise(by_order)
    again = [p for below, some in pairs for p in some if any(_same(p, q) for q in below)]
    return np.array(again, dtype=np.complex128)


def _same(p: complex, q: complex) -> bool:
    one, two = -p.real / abs(p), -q.real / abs(q)
    return (
        abs(abs(p) - abs(q)) < _SAME_FREQUENCY * abs(p)
        and abs(one - two) < _SAME_DAMPING * max(one, two) + 1e-4
    )


def _clusters(poles: ComplexArray, orders: int) -> list[complex]:
    """Medians of the groups of stable poles that came back often enough."""
    picked = []
    while poles.size:
        near = np.abs(poles[:, None] - poles[None, :]) < _reach(poles)[None, :]
        best = int(np.argmax(near.sum(axis=0)))
        group = poles[near[:, best]]
        if len(group) < max(3, _OFTEN * orders):
            break
        picked.append(complex(np.median(group.real), np.median(group.imag)))
        poles = poles[~near[:, best]]
    return picked


def _reach(poles: ComplexArray) -> Array:
    """Distance within which two poles count as one: a share of the resonance's half width."""
    return np.asarray(np.maximum(0.5 * -poles.real, 0.002 * np.abs(poles)))


def _without_twins(picked: list[complex]) -> list[complex]:
    """Poles found in two parts of the band count once."""
    kept: list[complex] = []
    for p in sorted(picked, key=lambda q: q.imag):
        if not any(abs(p - q) < float(_reach(np.array([p]))[0]) for q in kept):
            kept.append(p)
    return kept


@dataclass(frozen=True, slots=True, kw_only=True)
class Curves(Columns):
    """Lines to fit, all pairs side by side.

    Attributes:
        frequency: (n,) Hz above zero.
        values: (n, c) m/N.
        weight: (n, c) one over the error to be expected.
        static: (c,) m/N or None.
        static_weight: (c,) likewise.
    """

    frequency: Annotated[Array, Column("n", unit="Hz")]
    values: Annotated[ComplexArray, Column("n c", unit="m/N")]
    weight: Annotated[Array, Column("n c")]
    static: Annotated[Array | None, Column("c", unit="m/N")]
    static_weight: Annotated[Array | None, Column("c")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Residues:
    """Residues by least squares, per pair.

    Attributes:
        residues: (k, c) m/(N s).
        upper: (c,) m/N.
        lower: (c,) 1/kg.
        misfit: (2 m [+ 1], c) weighted differences, real parts first.
    """

    residues: ComplexArray
    upper: Array
    lower: Array
    misfit: Array


def fit_residues(curves: Curves, poles: ComplexArray, *, lower: bool) -> Residues:
    """Returns residues and residual terms of poles (k,) rad/s, pair by pair.

    Args:
        curves: What was measured.
        poles: In the upper half plane.
        lower: Whether there is a lower residual.
    """
    design = _design(curves.frequency, poles, lower)
    at_rest = None if curves.static is None else _at_rest(poles, lower)
    found, misfit = [], []
    for c in range(curves.values.shape[1]):
        a, b = _weight_rows(curves, c, design, at_rest)
        scale = np.linalg.norm(a, axis=0)
        scale[scale == 0.0] = 1.0
        x = np.linalg.lstsq(a / scale, b, rcond=None)[0] / scale
        found.append(x)
        misfit.append(a @ x - b)
    x, k = np.array(found).T, len(poles)
    return Residues(
        residues=x[:k] + 1j * x[k : 2 * k],
        upper=x[2 * k],
        lower=x[2 * k + 1] if lower else np.zeros(x.shape[1]),
        misfit=np.array(misfit).T,
    )


def misfit_slopes(
    curves: Curves, poles: ComplexArray, moves: ComplexArray, *, lower: bool
) -> Array:
    """Returns how the misfit of :func:`fit_residues` changes with the poles (rows, c, parameters).

    Residues follow the poles: the slopes are those of variable projection in Kaufman's form
    (BIT 15, 1975).

    Args:
        curves: What was measured.
        poles: (k,) rad/s.
        moves: (parameters, k) rad/s, what a unit of each parameter does to the poles.
        lower: Whether there is a lower residual.
    """
    design = _design(curves.frequency, poles, lower)
    at_rest = None if curves.static is None else _at_rest(poles, lower)
    s = 2j * np.pi * curves.frequency[:, None]
    one, two = 1.0 / (s - poles) ** 2, 1.0 / (s - poles.conj()) ** 2
    slopes = []
    for c in range(curves.values.shape[1]):
        a, b = _weight_rows(curves, c, design, at_rest)
        scale = np.linalg.norm(a, axis=0)
        q, upper = np.linalg.qr(a / scale)
        x = np.linalg.lstsq(upper, q.T @ b, rcond=None)[0] / scale
        residue = x[: len(poles)] + 1j * x[len(poles) : 2 * len(poles)]
        change = one @ (residue * moves).T + two @ (residue * moves).conj().T
        weight = np.tile(curves.weight[:, c], 2)[:, None]
        slope = np.vstack([change.real, change.imag]) * weight
        if curves.static_weight is not None:
            rest = 2.0 * (moves @ (residue / poles**2)).real * curves.static_weight[c]
            slope = np.vstack([slope, rest])
        slopes.append(slope - q @ (q.T @ slope))
    return np.stack(slopes, axis=1)


def _weight_rows(
    curves: Curves, c: int, design: Array, at_rest: Array | None
) -> tuple[Array, Array]:
    """Weighted rows and right-hand side of one pair, real parts first, at rest last."""
    weight = np.tile(curves.weight[:, c], 2)
    a = design * weight[:, None]
    b = np.concatenate([curves.values[:, c].real, curves.values[:, c].imag]) * weight
    if at_rest is not None and curves.static is not None and curves.static_weight is not None:
        a = np.vstack([a, at_rest * curves.static_weight[c]])
        b = np.append(b, curves.static[c] * curves.static_weight[c])
    return a, b


def _design(frequency: Array, poles: ComplexArray, lower: bool) -> Array:
    s = 2j * np.pi * frequency[:, None]
    one, two = 1.0 / (s - poles), 1.0 / (s - poles.conj())
    columns = [one + two, 1j * (one - two), np.ones_like(s)]
    if lower:
        columns.append(1.0 / s**2)
    whole = np.hstack(columns)
    return np.vstack([whole.real, whole.imag])


def _at_rest(poles: ComplexArray, lower: bool) -> Array:
    one = -1.0 / poles
    row = np.concatenate([2.0 * one.real, -2.0 * one.imag, [1.0]])
    return np.append(row, 0.0) if lower else row
