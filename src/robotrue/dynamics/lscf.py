"""Poles of a measured response: least squares in the complex frequency domain, order by order.

Every curve is a polynomial over one common denominator in z = e^{j theta}, theta running once
round the circle over the band; the denominator's roots are the poles. Poles of the structure come
back at every order, those of the noise do not. The band is worked through in parts, so that modes
at 10 Hz and at 2 kHz are both seen finely.

Source: Guillaume, Verboven, Vanlanduit 1998 (ISMA 23), Frequency-domain maximum likelihood
identification of modal parameters with confidence intervals, sect. 4; Verboven 2002,
Frequency-domain system identification for modal analysis, ch. 3. Complex coefficients, since only
positive frequencies are mapped.
"""

from __future__ import annotations

import itertools
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
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
    """How near two poles are one and the same: part of the half width of the resonance."""
    return np.asarray(np.maximum(0.5 * -poles.real, 0.002 * np.abs(poles)))


def _without_twins(picked: list[complex]) -> list[complex]:
    """Poles found in two parts of the band count once."""
    kept: list[complex] = []
    for p in sorted(picked, key=lambda q: q.imag):
        if not any(abs(p - q) < float(_reach(np.array([p]))[0]) for q in kept):
            kept.append(p)
    return kept
