"""The smooth residual: what neither geometry, compliance nor ripple explain, as it varies in space.

Three Gaussian processes with one kernel, one per axis of the base frame,

    k(q, q') = amplitude^2 exp(-|s(q) - s(q')|^2 / 2),   s(q) = [sin q, cos q] / length

Lengths are learned (marginal likelihood) on a part of the rows. The process is
then carried by a few hundred centres c (pivoted Cholesky: the next centre is the training pose
whose value the centres so far predict worst), as the linear model w ~ N(0, amplitude^2) over the
columns L^-1 k(c, q), L L' = k(c, c) / amplitude^2. The variance that the centres do not carry,
1 - |L^-1 k(c, q)|^2, is added back in prediction, so far from all data the mean is zero and the
variance the prior's (Quinonero-Candela and Rasmussen 2005, section 5).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, ClassVar, Final, Self

import numpy as np
from scipy.linalg import solve_triangular

from robotrue.calibration.evidence import PriorGroup
from robotrue.calibration.learners.process import centre_rows, log_evidence
from robotrue.calibration.learners.search import search_theta
from robotrue.calibration.terms.term import ArmPostures, Carry, Effect, MeanTables, Term
from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.document_decoder import decode
from robotrue.errors import ArchiveError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import Sensitivity
from robotrue.robot.model import RobotModel

NUGGET: Final = 1e-8
"""Added to k(c, c), relative to its diagonal: part of the model, not of the arithmetic alone."""
STEPS: Final = 60
"""Most steps of L-BFGS-B."""
SHORTEST: Final = 0.1
LONGEST: Final = 30.0
"""Range of lengths, in units of sin and cos."""
START: Final = 1e-4
REST: Final = 1e-7
"""m, amplitude where learning starts, and of a smooth residual without support by the data."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SmoothBasis(Columns):
    """Centres and lengths of the smooth residual.

    Attributes:
        centres: (m, 2 dof) scaled features of the centres.
        scale: (2 dof,) 1 / length.
    """

    centres: Annotated[Array, Column("m f")]
    scale: Annotated[Array, Column("f")]

    def lower(self) -> Array:
        """Returns L (m, m) with L L' = k(c, c) per unit amplitude."""
        kernel = unit_kernel(self.centres, self.centres)
        kernel[np.diag_indices(len(kernel))] += NUGGET
        return np.asarray(np.linalg.cholesky(kernel), dtype=np.float64)

    def columns(self, joints: Array) -> Array:
        """Returns L^-1 k(c, q), shape (n, m)."""
        kernel = unit_kernel(self.centres, features(joints) * self.scale)
        return np.ascontiguousarray(solve_triangular(self.lower(), kernel, lower=True).T)

    def table_weights(self, weights: Array) -> Array:
        """Returns W (m, 3) m, so that the mean is sum_m W[m] exp(-|s - c_m|^2 / 2)."""
        return np.asarray(solve_triangular(self.lower(), weights, lower=True, trans=1))


@dataclass(frozen=True, slots=True, kw_only=True)
class SmoothScales:
    """Scales learned on the sample.

    Attributes:
        length: (2 dof,) of sin q, then of cos q.
        amplitude: m.
        noise: m.
        gain: Log evidence beyond that of white noise.
    """

    length: Array
    amplitude: float
    noise: float
    gain: float


def features(joints: Array) -> Array:
    """Returns [sin q, cos q], shape (n, 2 dof)."""
    return np.concatenate([np.sin(joints), np.cos(joints)], axis=1)


def unit_kernel(a: Array, b: Array) -> Array:
    """Returns exp(-|a - b|^2 / 2) of scaled features, shape (len(a), len(b))."""
    square = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2.0 * a @ b.T
    kernel: Array = np.exp(-0.5 * np.maximum(square, 0.0))
    return kernel


def learn_smooth(joints: Array, residual: Array) -> SmoothScales:
    """Returns lengths, amplitude and noise of greatest marginal likelihood.

    Args:
        joints: (n, dof) rad; n of some hundred (the cost is n^3 per step).
        residual: (n, 3) m, base frame.

    Fails when: the residual is exactly zero.
    """
    x = features(joints)
    unit = max(float(np.sqrt((residual**2).mean())), 1e-12)
    y = residual / unit
    data = centre_rows(x, y, np.ones(len(x)), isotropic=False, mean="zero", prior=False)
    start = np.log([*np.full(x.shape[1], 1.5), 0.5, 0.7])
    bounds = np.log([*[[SHORTEST, LONGEST]] * x.shape[1], [1e-3, 10.0], [1e-3, 10.0]])
    theta = search_theta(partial(log_evidence, data), start, bounds, steps=STEPS)
    white = -0.5 * (y.size * np.log(2.0 * np.pi * (y**2).mean()) + y.size)
    length, (amplitude, noise) = np.exp(theta[:-2]), (unit * np.exp(theta[-2:])).tolist()
    gain = float(log_evidence(data, theta)[0] - white)
    return SmoothScales(length=length, amplitude=amplitude, noise=noise, gain=gain)


def choose_centres(joints: Array, length: Array, *, most: int, enough: float) -> SmoothBasis:
    """Returns centres among the poses (n, dof) rad for lengths (2 dof,), as :func:`add_centres`."""
    scale = 1.0 / np.asarray(length)
    empty = SmoothBasis(centres=np.zeros((0, len(scale))), scale=scale)
    return add_centres(empty, joints, most=most, enough=enough)


def add_centres(basis: SmoothBasis, joints: Array, *, most: int, enough: float) -> SmoothBasis:
    """Returns the basis with further centres among some poses, by pivoted Cholesky.

    The next centre is always the pose carried worst.

    Args:
        basis: Before.
        joints: (n, dof) rad.
        most: Largest number of further centres.
        enough: Share of a pose's prior variance that may stay uncarried everywhere.
    """
    scaled = features(joints) * basis.scale
    rows: list[Array] = list(basis.columns(joints).T)
    left = np.maximum(1.0 - sum((row**2 for row in rows), np.zeros(len(scaled))), 0.0)
    chosen: list[int] = []
    while len(chosen) < min(most, len(scaled)):
        pivot = int(np.argmax(left))
        if left[pivot] <= enough:
            break
        row = unit_kernel(scaled[[pivot]], scaled)[0]
        if rows:
            made = np.asarray(rows)
            row = row - made[:, pivot] @ made
        row /= np.sqrt(left[pivot])
        rows.append(row)
        chosen.append(pivot)
        left = np.maximum(left - row**2, 0.0)
    return SmoothBasis(centres=np.vstack([basis.centres, scaled[chosen]]), scale=basis.scale)


def no_basis(dof: int) -> SmoothBasis:
    """Returns a basis without centres."""
    return SmoothBasis(centres=np.zeros((0, 2 * dof)), scale=np.ones(2 * dof))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SmoothResidual(Term):
    """The smooth residual over a basis; parameters centre by centre, x, y and z.

    Attributes:
        basis: Centres and lengths; without centres there is no residual.
        amplitude: m, prior sd at any posture.
    """

    name: ClassVar[str] = "smooth"
    carry: ClassVar[Carry] = "field"
    export_name: ClassVar[str] = "residual"
    basis: SmoothBasis
    amplitude: float = 0.0

    @property
    def parameters(self) -> tuple[str, ...]:
        """``smooth1_x ..``."""
        return tuple(
            f"smooth{centre + 1}_{axis}"
            for centre in range(len(self.basis.centres))
            for axis in "xyz"
        )

    @property
    def size(self) -> int:
        """Three for each centre."""
        return 3 * len(self.basis.centres)

    @property
    def unit(self) -> str:
        """Unit of every parameter."""
        return "m"

    def with_basis(self, basis: SmoothBasis) -> tuple[SmoothResidual, IntArray]:
        """Returns the term over a basis that begins with its own, and its parameters' places.

        The columns of a basis are nested: the first ones do not change when centres are added.
        """
        return replace(self, basis=basis), np.arange(self.size)

    def columns(self, robot: RobotModel, at: ArmPostures, by: Sensitivity, values: Array) -> Array:
        """Returns d(observed)/d(weights), shape (n, m, k)."""
        n, m, _ = by.shift.shape
        carried = self.basis.columns(at.joints)[:, None, :, None]
        return (carried * by.shift[:, :, None, :]).reshape(n, m, self.size)

    def effect(self, robot: RobotModel, at: ArmPostures, values: Array) -> Effect:
        """Returns the shift of the tool point, and the variance no centre carries."""
        if not self.size:
            return Effect()
        carried = self.basis.columns(at.joints)
        left = np.maximum(1.0 - (carried**2).sum(axis=1), 0.0)
        return Effect(
            tip_shift=carried @ values.reshape(-1, 3),
            uncarried=self.amplitude**2 * left,
            other_tool=self.amplitude**2,
        )

    def uncarried_covariance(self, at: ArmPostures, other: ArmPostures) -> Array | None:
        """Returns the covariance (n, k) m^2 per axis of what no centre carries."""
        if not self.size:
            return None
        scale, basis = self.basis.scale, self.basis
        kernel = unit_kernel(features(at.joints) * scale, features(other.joints) * scale)
        left = kernel - basis.columns(at.joints) @ basis.columns(other.joints).T
        return np.asarray(self.amplitude**2 * left)

    def groups(self, *, few: bool) -> Sequence[PriorGroup]:
        """Returns one group, or none without centres."""
        columns = np.arange(self.size)
        return (
            [PriorGroup(name=self.name, columns=columns, sd=START, rest=REST)] if self.size else []
        )

    def prior_variance(self, values: Array, variance: Array) -> Array:
        """Returns the square of the amplitude."""
        return np.full(self.size, self.amplitude**2)

    def in_tables(self, tables: MeanTables, values: Array) -> MeanTables:
        """Returns the tables with this residual."""
        if not self.size:
            return tables
        return replace(
            tables,
            centres=self.basis.centres,
            scale=self.basis.scale,
            weights=self.basis.table_weights(values.reshape(-1, 3)),
        )

    @staticmethod
    def out_of_tables(tables: MeanTables) -> MeanTables:
        """Returns the tables without a residual."""
        return replace(tables, weights=np.zeros_like(tables.weights))

    @classmethod
    def begin(cls, robot: RobotModel, measurements: MeasurementSet, few: bool) -> Self:
        """Returns the term without centres: they are chosen where everything else leaves errors."""
        return cls(basis=no_basis(robot.dof))

    def arrays(self, values: Array) -> Mapping[str, Array]:
        """Returns basis and parameters."""
        return {
            "smooth_centres": self.basis.centres,
            "smooth_scale": self.basis.scale,
            "smooth_weights": values.reshape(-1, 3),
        }

    def document(self) -> Mapping[str, object]:
        """Returns the amplitude."""
        return {"amplitude": self.amplitude}

    @classmethod
    def restore(
        cls, robot: RobotModel, document: Mapping[str, object], arrays: Mapping[str, Array]
    ) -> tuple[Self, Array]:
        """Returns the term and its parameters.

        Raises:
            ArchiveError: A damaged basis.
        """
        centres, scale = arrays["smooth_centres"], arrays["smooth_scale"]
        amplitude = decode(float, document["amplitude"], key="amplitude")
        size = 2 * robot.dof
        if (
            centres.ndim != 2
            or centres.shape[1] != size
            or scale.shape != (size,)
            or not (scale > 0.0).all()
            or not 0.0 <= amplitude < 1.0
            or arrays["smooth_weights"].shape != (len(centres), 3)
        ):
            raise ArchiveError("the smooth part of the learned error is damaged.")
        basis = SmoothBasis(centres=centres, scale=scale)
        return cls(basis=basis, amplitude=amplitude), arrays["smooth_weights"].ravel()
