"""A calibration as a Gaussian over all its coefficients: what new measurements are added to.

    w = [robot errors, parameters of each term, nuisances]      w ~ N(mean, R'R)

R is any root of the covariance. Rows ``z = H w + e``, e ~ N(0, I), change it without ever forming
the covariance: with R H' = U diag(s) V' (thin)

    R  <-  R - U diag(1 - 1/sqrt(1 + s^2)) U' R

which is the exact square root of ``S - S H' (H S H' + I)^-1 H S`` (Andrews 1968; Bierman 1977,
ch. V). Nothing can become indefinite, and the order of the rows does not matter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.linalg import qr, svd
from scipy.linalg.blas import dsyrk
from scipy.linalg.lapack import dpotrf

from robotrue.calibration.terms.backlash import Backlash
from robotrue.calibration.terms.ripple import Ripple
from robotrue.calibration.terms.smooth import SmoothBasis, SmoothResidual, no_basis
from robotrue.calibration.terms.term import Carry, Term
from robotrue.core.arrays import Array, IntArray
from robotrue.robot.model import RobotModel, parameter_slice

ROWS: Final = 300
"""Numbers conditioned on at a time."""
CERTAIN: Final = 1e-14
"""Eigenvalue of a covariance, over the largest one, from which a direction is known."""
LEAST_PIVOT: Final = 1e-4
"""Share of a column's sd beside those before it below which squares lose too many digits."""
WIDE: Final = 1.3
"""Rows of the root over its columns from which it is made square again."""


class StandardTerms:
    """What has the terms that every model has, if only with no parameters.

    Attributes:
        terms: Ripple, backlash, smooth residual, then others.
    """

    __slots__ = ()

    terms: tuple[Term, ...]

    @property
    def ripple(self) -> Ripple:
        """The ripple of the gears."""
        return next(term for term in self.terms if isinstance(term, Ripple))

    @property
    def smooth(self) -> SmoothResidual:
        """The smooth residual."""
        return next(term for term in self.terms if isinstance(term, SmoothResidual))


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief(StandardTerms):
    """A calibrated arm as mean and root over named columns.

    Attributes:
        robot: The nominal arm.
        terms: Beyond the robot's error vector: ripple, backlash, smooth residual, then others.
        mean: (p,) SI, in the order of the module's first line.
        root: (r, p) R.
        white: m, sd per axis of white noise beyond instrument and repeatability.
        repeatability: m, sd per axis.
        inflation: Factor on the covariance of predictions.
        T_tracker_base: Of the set-ups the model knows.
        reflectors: Further reflectors of the last rows: where, and the root (r, 3) over the place,
            along its own axes. What moves the root afterwards must leave them out.
        nuisances: Columns at the end that leave with the rows that brought them.
    """

    robot: RobotModel
    terms: tuple[Term, ...]
    mean: Array
    root: Array
    white: float
    repeatability: float
    inflation: float
    T_tracker_base: Mapping[int, Array]
    nuisances: int = 0
    reflectors: Mapping[int, tuple[Array, Array]] = field(default_factory=dict)

    def place(self, name: str) -> slice:
        """Returns the place of the parameters of a term; an empty slice where it has none."""
        start = len(self.robot.errors)
        for term in self.terms:
            if term.name == name:
                return slice(start, start + term.size)
            start += term.size
        return slice(start, start)

    @property
    def end(self) -> int:
        """First column of the nuisances, or the number of columns."""
        return len(self.robot.errors) + sum(term.size for term in self.terms)

    @property
    def errors(self) -> Array:
        """Robot errors at the mean (9 dof + 12,) SI."""
        return self.mean[: len(self.robot.errors)]

    @property
    def values(self) -> Array:
        """Parameters of all terms at the mean (k,) SI."""
        return self.mean[len(self.robot.errors) : self.end]

    @property
    def actual(self) -> RobotModel:
        """The arm with the errors of the mean."""
        return self.robot.with_errors(self.errors)

    @property
    def variance(self) -> Array:
        """(p,) variance of every column."""
        return np.asarray(np.einsum("ij,ij->j", self.root, self.root))

    @property
    def noise(self) -> Array:
        """(2,) white variance of lengths (m^2); that of angles is zero."""
        return np.array([self.white**2, 0.0])

    @property
    def visit(self) -> float:
        """Variance per axis of one visit, m^2."""
        return self.white**2 + self.repeatability**2

    def columns_by_carry(self, carry: Carry) -> IntArray:
        """Returns the columns (k,) of the terms that carry over in one way; see :data:`Carry`."""
        places = [self.place(t.name) for t in self.terms if t.carry == carry]
        ranges = [np.arange(p.start, p.stop) for p in places]
        return np.concatenate([np.zeros(0, dtype=np.int64), *ranges])


def standard_terms(dof: int, cycles: Array | None = None) -> tuple[Term, ...]:
    """Returns the terms every model has, with ripple of some cycles and no smooth residual."""
    waves = np.zeros(0) if cycles is None else cycles
    return Ripple(dof=dof, cycles=waves), Backlash(dof=dof), SmoothResidual(basis=no_basis(dof))


def condition(belief: Belief, columns: Array, values: Array) -> Belief:
    """Returns the belief after whitened rows ``values = columns @ w + e``, e ~ N(0, I).

    Args:
        belief: Before.
        columns: (m, p).
        values: (m,).
    """
    mean, root = belief.mean.copy(), belief.root
    for start in range(0, len(values), ROWS):
        part = slice(start, start + ROWS)
        left, size, right = svd(root @ columns[part].T, full_matrices=False, lapack_driver="gesdd")
        turned = left.T @ root
        off = right @ (values[part] - columns[part] @ mean)
        mean = mean + turned.T @ (size / (1.0 + size**2) * off)
        removed = left @ ((1.0 - 1.0 / np.sqrt(1.0 + size**2))[:, None] * turned)
        root = np.subtract(root, removed, out=removed)
    return replace(belief, mean=mean, root=root)


def add_variance(belief: Belief, variance: Array) -> Belief:
    """Returns the belief with independent variance (p,) added to its columns."""
    if not variance.any():
        return belief
    return replace(belief, root=_add_rows(belief.root, 1.0, variance))


def _add_rows(root: Array, factor: float | Array, variance: Array) -> Array:
    """A root times a factor, with independent variance (p,) as further rows; made in one pass."""
    extra = np.flatnonzero(variance > 0.0)
    longer = np.zeros((len(root) + len(extra), root.shape[1]))
    np.multiply(root, factor, out=longer[: len(root)])
    longer[len(root) + np.arange(len(extra)), extra] = np.sqrt(variance[extra])
    return longer


def carry_belief(belief: Belief, keep: Array, trust: float, variance: Array) -> Belief:
    """Returns the belief with every column times ``keep``, its sd also times ``trust``.

    Args:
        belief: Before.
        keep: (p,) factors.
        trust: Factor on what is not known.
        variance: (p,) independent variance that is added.
    """
    root = _add_rows(belief.root, trust * keep, variance)
    return replace(belief, mean=keep * belief.mean, root=root)


def with_nuisances(belief: Belief, sd: Array) -> Belief:
    """Returns the belief with columns of zero mean and the given sd (k,) added at its end."""
    r, p = belief.root.shape
    root = np.zeros((r + len(sd), p + len(sd)))
    root[:r, :p] = belief.root
    root[r + np.arange(len(sd)), p + np.arange(len(sd))] = sd
    mean = np.concatenate([belief.mean, np.zeros(len(sd))])
    return replace(belief, mean=mean, root=root, nuisances=belief.nuisances + len(sd))


def with_tool(belief: Belief, T_flange_tool: Array) -> Belief:
    """Returns the belief with another tool (4, 4), of which nothing was learned: zero, certain."""
    tool = parameter_slice(belief.robot.dof, "tool")
    mean, root = belief.mean.copy(), belief.root.copy()
    mean[tool], root[:, tool] = 0.0, 0.0
    return replace(belief, robot=belief.robot.with_tool(T_flange_tool), mean=mean, root=root)


def widen_tool(belief: Belief, sd: float) -> Belief:
    """Returns the belief with its tool point less certain by ``sd`` m per axis."""
    variance = np.zeros(len(belief.mean))
    variance[parameter_slice(belief.robot.dof, "tool")][:3] = sd**2
    return add_variance(belief, variance)


def drop_nuisances(belief: Belief) -> Belief:
    """Returns the belief without the columns at its end that rows brought."""
    end = belief.end
    return replace(belief, mean=belief.mean[:end], root=belief.root[:, :end], nuisances=0)


def with_term(belief: Belief, term: Term, kept: IntArray) -> Belief:
    """Returns the belief with the term of a name replaced by a larger one.

    Args:
        belief: Before.
        term: Of a name the belief has.
        kept: (k,) indices of the old parameters in the new term; the others are zero, without
            variance yet.
    """
    place = belief.place(term.name)
    terms = tuple(term if old.name == term.name else old for old in belief.terms)
    fresh = np.setdiff1d(np.arange(term.size), kept)
    if not len(fresh):
        return replace(belief, terms=terms)
    size = len(belief.mean) + len(fresh)
    places = np.setdiff1d(np.arange(size), place.start + fresh)
    mean = np.zeros(size)
    mean[places] = belief.mean
    return replace(belief, terms=terms, mean=mean, root=spread_columns(belief.root, places, size))


def spread_columns(root: Array, places: IntArray, size: int) -> Array:
    """Returns a root (r, size) with the columns of another at ``places``, zero elsewhere.

    Run by run, which takes a tenth of the time of an index. Of places named twice the last counts.
    """
    out = np.zeros((len(root), size))
    ends = np.unique([0, *np.flatnonzero(np.diff(places) != 1) + 1, len(places)])
    for start, stop in pairwise(ends.tolist()):
        out[:, places[start] : places[start] + stop - start] = root[:, start:stop]
    return out


def with_centres(belief: Belief, basis: SmoothBasis, sd: float = 0.0) -> Belief:
    """Returns the belief over a basis that begins with the centres it had.

    Args:
        belief: Before.
        basis: With the centres added.
        sd: m, of the weights of centres that are added.
    """
    wider = with_term(belief, *belief.smooth.with_basis(basis))
    variance = np.zeros(len(wider.mean))
    variance[belief.place("smooth").stop : wider.place("smooth").stop] = sd**2
    return add_variance(wider, variance)


def with_amplitude(belief: Belief, amplitude: float) -> Belief:
    """Returns the belief with another prior sd of the smooth residual, m."""
    smooth = replace(belief.smooth, amplitude=amplitude)
    return with_term(belief, smooth, np.arange(smooth.size))


def with_harmonics(belief: Belief, count: int) -> Belief:
    """Returns the belief with at least ``count`` harmonics; new ones at zero without variance."""
    if count <= len(belief.ripple.cycles):
        return belief
    return with_term(belief, *belief.ripple.with_cycles(count))


def root_of_covariance(covariance: Array) -> Array:
    """Returns R (p, e) with R'R the covariance (e, e), without directions that are certain.

    Parameters of several units, kg m beside rad/(N m), are scaled to one another first.
    """
    sd = np.sqrt(np.diagonal(covariance))
    scale = np.where(sd > 0.0, sd, 1.0)
    values, vectors = np.linalg.eigh(covariance / scale[:, None] / scale)
    alive = values > CERTAIN * values[-1]
    return np.asarray(np.sqrt(values[alive])[:, None] * vectors[:, alive].T * scale)


def compress_root(root: Array) -> Array:
    """Returns a root with no more rows than non-zero columns, where that saves much."""
    used = np.flatnonzero(root.any(axis=0))
    if len(root) <= WIDE * len(used):
        return root
    if len(used) == root.shape[1]:
        return _triangle(root)
    triangle = _triangle(root[:, used])
    out = np.zeros((len(triangle), root.shape[1]))
    out[:, used] = triangle
    return out


def _triangle(root: Array) -> Array:
    """Returns the upper triangle T with T'T = R'R, at most as many rows as columns.

    By Cholesky, which takes a third of the time of a QR decomposition: rows of one number, the
    variances that were added, cost it nothing. Where it would lose digits, by QR.
    """
    alone = np.count_nonzero(root, axis=1) == 1
    gram = dsyrk(1.0, (root[~alone] if alone.any() else root).T)  # its upper triangle
    gram[np.diag_indices(len(gram))] += (root[alone] ** 2).sum(axis=0)
    sd = np.sqrt(np.diagonal(gram))
    gram /= sd[:, None]
    gram /= sd
    factor, fault = dpotrf(gram, lower=0, clean=1, overwrite_a=1)
    if fault or np.diagonal(factor).min() < LEAST_PIVOT:
        return np.asarray(qr(root, mode="r")[0][: root.shape[1]])
    factor *= sd
    return np.ascontiguousarray(factor)


def stack_roots(parts: Sequence[tuple[float, Array]]) -> Array:
    """Returns roots (r, p) one above the other, each times its factor; made in one pass."""
    rows = np.cumsum([0, *(len(root) for _, root in parts)])
    stacked = np.empty((rows[-1], parts[0][1].shape[1]))
    for (factor, root), start in zip(parts, rows[:-1].tolist(), strict=True):
        np.multiply(root, factor, out=stacked[start : start + len(root)])
    return stacked
