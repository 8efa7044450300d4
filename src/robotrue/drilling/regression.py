"""Linear corrections: the patent's regression, with interactions, and ridge polynomials."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.drilling.campaign import Conditions
from robotrue.drilling.drill_defaults import CORRECTS, Corrects, Position
from robotrue.errors import ObservabilityError

Family: TypeAlias = Literal["patent", "interactions", "quadratic", "cubic"]
STRENGTHS: Final = np.logspace(-8.0, 2.0, 41)
"""Ridge strengths tried, in units of the columns' own scatter."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearCorrection(Columns):
    """Coefficients of each sensor's error.

    Attributes:
        family: Which terms.
        coefficients: (p, k) m per unit of the term.
        covariance: (p, p) of the coefficients over the square of a sensor's noise.
        sigma: (k,) m, deviation of one reading that the terms do not explain.
        inputs: Machine positions among the terms.
        corrects: What the errors are of.
    """

    family: Family
    coefficients: Annotated[Array, Column("p k")]
    covariance: Annotated[Array, Column("p p")]
    sigma: Annotated[Array, Column("k")]
    inputs: tuple[Position, ...] = ()
    corrects: Corrects = CORRECTS

    @property
    def noise(self) -> Array:
        """(k,) m, deviation of one reading that the terms do not explain."""
        return self.sigma

    def predict(self, c: Conditions) -> tuple[Array, Array]:
        """Returns the expected error (m, k) m and its variance (m, k) m^2, the noise left out."""
        _, x = columns(self.family, c, self.inputs)
        share = np.einsum("ij,jk,ik->i", x, self.covariance, x)
        return x @ self.coefficients, share[:, None] * self.sigma**2


def fit_linear(
    family: Family,
    causes: Conditions,
    errors: Array,
    *,
    inputs: tuple[Position, ...] = (),
    corrects: Corrects = CORRECTS,
) -> LinearCorrection:
    """Returns the least-squares fit of the patent's step 7, or a ridge for the polynomials.

    Ridge acts on every term but the constant; its strength is the one of least error when each
    clamp is predicted from the others.

    Args:
        family: Which terms.
        causes: n clamps.
        errors: (n, k) m, measured less theoretical readings.
        inputs: Machine positions among the terms.
        corrects: What the errors are of.

    Raises:
        ObservabilityError: Fewer clamps than terms, or terms that the campaign cannot separate.
    """
    names, x = columns(family, causes, inputs)
    n, p = x.shape
    if family in ("quadratic", "cubic"):
        return replace(_ridge(family, x, errors), inputs=inputs, corrects=corrects)
    if n <= p:
        raise ObservabilityError(
            f"{n} clamps for the {p} terms {', '.join(names)}.",
            hint="clamp more often, or take a correction with fewer terms.",
        )
    left, spread, right = np.linalg.svd(x, full_matrices=False)
    if not spread[-1] > 1e-10 * spread[0]:
        weak = names[int(np.argmax(np.abs(right[-1])))]
        raise ObservabilityError(
            f"the campaign does not separate the term {weak!r} from the others.",
            hint="vary tilt, force and height independently.",
        )
    inverse = (right.T / spread) @ left.T
    coefficients = inverse @ errors
    rest = errors - x @ coefficients
    return LinearCorrection(
        family=family,
        coefficients=coefficients,
        covariance=inverse @ inverse.T,
        sigma=np.sqrt(np.sum(rest**2, axis=0) / (n - p)),
        inputs=inputs,
        corrects=corrects,
    )


def _ridge(family: Family, x: Array, errors: Array) -> LinearCorrection:
    n, p = x.shape
    scale = np.concatenate([[1.0], np.maximum(np.sqrt(np.mean(x[:, 1:] ** 2, axis=0)), 1e-12)])
    z = x / scale
    held = np.diag(np.concatenate([[0.0], np.ones(p - 1)]))
    chosen, lowest = None, np.inf
    for strength in STRENGTHS * n:
        inverse = np.linalg.inv(z.T @ z + strength * held)
        hat = z @ inverse @ z.T
        rest = (errors - hat @ errors) / (1.0 - np.diag(hat))[:, None]
        loss = float(np.sum(rest**2))
        if loss < lowest:
            chosen, lowest = (inverse, rest), loss
    if chosen is None:
        raise ObservabilityError("the campaign holds no clamps.", hint="clamp at least 15 times.")
    inverse, rest = chosen
    coefficients = inverse @ z.T @ errors
    return LinearCorrection(
        family=family,
        coefficients=coefficients / scale[:, None],
        covariance=inverse / np.outer(scale, scale),
        sigma=np.sqrt(np.mean(rest**2, axis=0)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Significance:
    """Coefficient of a term of one sensor, with its significance.

    Attributes:
        term: Its name.
        coefficient: (k,) m per unit.
        deviation: (k,) m per unit.
        t: (k,) coefficient over deviation.
    """

    term: str
    coefficient: Array
    deviation: Array
    t: Array


def significance(fitted: LinearCorrection, causes: Conditions) -> tuple[Significance, ...]:
    """Returns each term's coefficient, deviation and t, of a least-squares fit."""
    names, _ = columns(fitted.family, causes, fitted.inputs)
    deviation = np.sqrt(np.diag(fitted.covariance))[:, None] * fitted.sigma
    return tuple(
        Significance(
            term=name,
            coefficient=fitted.coefficients[i],
            deviation=deviation[i],
            t=fitted.coefficients[i] / deviation[i],
        )
        for i, name in enumerate(names)
    )


def columns(
    family: Family, c: Conditions, inputs: tuple[Position, ...] = ()
) -> tuple[tuple[str, ...], Array]:
    """Returns the names of a family's terms and their columns (n, p), the constant first.

    ``patent`` are the terms of the patent's step 7; ``interactions`` adds F a, F b and F^2;
    ``quadratic`` and ``cubic`` are all products of two and three. Machine positions enter all of
    them in addition to a, b, F and z.
    """
    named: list[tuple[str, Array]] = [("1", np.ones(len(c.a)))]
    single = [("a", c.a), ("b", c.b), ("F", c.force), ("z", c.height)]
    single += zip(inputs, c.positions(inputs).T, strict=True)
    named += single
    if family == "interactions":
        named += [("F a", c.force * c.a), ("F b", c.force * c.b), ("F F", c.force**2)]
    if family in ("quadratic", "cubic"):
        named += _products(single, 2)
    if family == "cubic":
        named += _products(single, 3)
    return tuple(name for name, _ in named), np.stack([value for _, value in named], axis=-1)


def _products(single: list[tuple[str, Array]], degree: int) -> list[tuple[str, Array]]:
    """All products of ``degree`` of the single terms, repetition allowed."""
    return [
        (" ".join(name for name, _ in chosen), np.prod([value for _, value in chosen], axis=0))
        for chosen in combinations_with_replacement(single, degree)
    ]
