"""Residues of given poles: linear least squares in the frequency domain, residual terms and all.

Per pair of axes, with s = j omega and real unknowns Re R, Im R, upper, lower::

    G(s) = sum_k [ R_k / (s - p_k) + conj(R_k) / (s - conj(p_k)) ] + upper + lower / s^2

A static deflection is one more line, at s = 0, and then there is no lower residual.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.dynamics.frf import ComplexArray


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
    """What least squares found, per pair.

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
