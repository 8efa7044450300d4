"""The uncertainty budget of a compensated tool point, contribution by contribution (GUM).

The measurand is the position of the tool point along one axis of the base, at a pose of the check;
every number is the root mean square over the axes and the poses::

    u_i = c_i value_i / divisor_i,   u_c^2 = sum u_i^2,   U = k u_c,   k = 2

Contributions are independent by construction: the model's covariance holds parameters and learned
residual with all their correlations and is one line. The instrument took part in the fit and is in
that line, too; its own lines count only where one reading is compared with a prediction.

Source: JCGM 100:2008 (GUM), equations 10 (combination) and 18 (expansion), 4.3 (bounds).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

import numpy as np

from robotrue.calibration.model import ErrorModel, Query
from robotrue.calibration.settings import RP_PER_SIGMA
from robotrue.core.arrays import Array
from robotrue.core.poses import propagate_covariance
from robotrue.errors import ShapeError
from robotrue.measurement.tracker import TrackerSpecification
from robotrue.robot.forward import forward

COVERAGE_FACTOR: Final = 2.0
PROBE_FORCE: Final = 100.0
"""N, of the difference quotient over a process force; the model is linear in it."""

Name: TypeAlias = Literal[
    "model", "repeatability", "white", "registration", "force", "range", "angle", "instrument"
]
Distribution: TypeAlias = Literal["normal", "bound", "repeatability"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Contribution:
    """One line of the budget.

    Attributes:
        name: Which.
        value: Of the input, in ``unit``.
        evaluation: ``A`` from data, ``B`` from what is stated (GUM 4.2, 4.3).
        unit: ``m`` or ``N``.
        distribution: ``normal``: value is a standard deviation; ``bound``: an instrument's limits,
            read by ``divisor``; ``repeatability``: ISO 9283 RP.
        divisor: Value over this is the input's standard uncertainty.
        sensitivity: Of the measurand, m per unit, root mean square.
        in_target: Whether it counts for a compensated target; the others only for a check reading.
    """

    name: Name
    value: float
    evaluation: Literal["A", "B"]
    unit: str = "m"
    distribution: Distribution = "normal"
    divisor: float = 1.0
    sensitivity: float = 1.0
    in_target: bool = True

    @property
    def standard_uncertainty(self) -> float:
        """Contribution to the measurand, m."""
        return self.sensitivity * self.value / self.divisor


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """All lines.

    Attributes:
        contributions: The lines.
        poses: Number of poses.
        worst: m, largest expanded uncertainty (per axis, k = 2) of one pose: model, repeatability
            and noise there, with the other lines as they are.
    """

    contributions: tuple[Contribution, ...]
    poses: int
    worst: float

    @property
    def combined(self) -> float:
        """Combined standard uncertainty of a compensated target along one axis, m."""
        return _root_sum(c for c in self.contributions if c.in_target)

    @property
    def expanded(self) -> float:
        """``k = 2`` times :attr:`combined`, m."""
        return COVERAGE_FACTOR * self.combined

    @property
    def combined_check(self) -> float:
        """Combined standard uncertainty of one reading minus its prediction, m."""
        return _root_sum(self.contributions)


def uncertainty_budget(
    model: ErrorModel,
    query: Query,
    *,
    repeatability: float,
    instrument: tuple[Contribution, ...],
    T_base_part: Array | None = None,
    part_covariance: Array | None = None,
    force_sigma: float = 0.0,
) -> Budget:
    """Returns the budget over the poses of a query.

    Args:
        model: Any error model.
        query: The poses, with their loads.
        repeatability: m, ISO 9283 RP stated for the model.
        instrument: From :func:`tracker_lines` or :func:`stated_line`.
        T_base_part: (4, 4) m of the registered part; None without one.
        part_covariance: (6, 6) of its origin and left rotation vector, base axes.
        force_sigma: N per axis, standard deviation of the process force about the planned one.

    Raises:
        ShapeError: No poses, or half of a registration.
    """
    n = len(query.joints)
    if not n:
        raise ShapeError("no poses for an uncertainty budget.")
    if (T_base_part is None) != (part_covariance is None):
        raise ShapeError("a part frame and its covariance go together: one is missing.")
    covariance = model.predict(query).covariance
    learned = _model_lines(model, covariance, repeatability)
    lines = []
    if T_base_part is not None and part_covariance is not None:
        at = forward(model.robot.nominal(), query.joints)[:, :3, 3]
        spread = propagate_covariance(part_covariance, at - T_base_part[:3, 3])
        lines.append(Contribution(name="registration", value=_per_axis(spread), evaluation="A"))
    c = force_sensitivity(model, query)
    lines.append(
        Contribution(name="force", value=force_sigma, unit="N", sensitivity=c, evaluation="B")
    )
    worst = float(np.trace(covariance, axis1=1, axis2=2).max()) / 3.0
    return Budget(
        contributions=(*learned, *lines, *instrument),
        poses=n,
        worst=COVERAGE_FACTOR * float(np.sqrt(worst + _root_sum(lines) ** 2)),
    )


def tracker_lines(specification: TrackerSpecification, distance: Array) -> tuple[Contribution, ...]:
    """Returns the lines of a tracker at ranges (n,) m: along the sight, and the two across it.

    One of three axes is along the line of sight, two are across: c^2 = 1/3 and 2/3.
    """
    shares: tuple[tuple[Name, float, Array], ...] = (
        ("range", 1.0 / 3.0, specification.sigma_range(distance)),
        ("angle", 2.0 / 3.0, specification.sigma_angle(distance)),
    )
    return tuple(
        Contribution(
            name=name,
            value=float(np.sqrt(np.mean(sigma**2))) * specification.divisor,
            distribution="normal" if specification.divisor == 1.0 else "bound",
            divisor=specification.divisor,
            sensitivity=float(np.sqrt(c)),
            evaluation="B",
            in_target=False,
        )
        for name, c, sigma in shares
    )


def stated_line(covariance: Array) -> tuple[Contribution, ...]:
    """Returns the one line of readings that came with their own covariance (n, 3, 3) m^2."""
    value = _per_axis(covariance)
    return (Contribution(name="instrument", value=value, evaluation="B", in_target=False),)


def force_sensitivity(model: ErrorModel, query: Query) -> float:
    """Returns the deflection along one axis per N along one axis, root mean square, m/N."""
    base = model.predict(query).error
    size = 0.0
    for axis in range(3):
        wrench = np.array(np.broadcast_to(query.load.wrench, (len(query.joints), 6)))
        wrench[:, axis] += PROBE_FORCE
        load = replace(query.load, wrench=wrench)
        pushed = model.predict(replace(query, load=load)).error
        size += float(np.mean(np.sum((pushed - base) ** 2, axis=1)))
    return float(np.sqrt(size / 3.0)) / PROBE_FORCE


def _model_lines(model: ErrorModel, covariance: Array, repeatability: float) -> list[Contribution]:
    """The model's own line, then those of scatter; one line where it cannot be divided."""
    physics = model.belief()
    if physics is None:
        return [Contribution(name="model", value=_per_axis(covariance), evaluation="A")]
    factor, stated = physics.inflation, physics.repeatability
    parameters = np.sqrt(
        max(_per_axis(covariance) ** 2 - factor * (stated**2 + physics.white**2), 0.0)
    )
    scale = float(np.sqrt(factor))
    return [
        Contribution(name="model", value=float(parameters), evaluation="A"),
        Contribution(
            name="repeatability",
            value=repeatability,
            distribution="repeatability",
            divisor=repeatability / stated if stated > 0.0 else RP_PER_SIGMA,
            sensitivity=scale,
            evaluation="B",
        ),
        Contribution(name="white", value=physics.white, sensitivity=scale, evaluation="A"),
    ]


def _per_axis(covariance: Array) -> float:
    return float(np.sqrt(np.trace(covariance, axis1=1, axis2=2).mean() / 3.0))


def _root_sum(lines: Iterable[Contribution]) -> float:
    return float(np.sqrt(sum(c.standard_uncertainty**2 for c in lines)))
