"""Prior for the changes between a calibration and the rows it is transferred to.

The source's posterior N(m, S) becomes the target's prior

    w = D m + e,    e ~ N(0, k^2 D S D + sum_g s_g^2 diag(unit_g^2) + (I - D^2) P)

Groups g are physical: base and reflector, joint zeros, link lengths and angles, gears, compliance.
D carries learned shapes (ripple with backlash, smooth residual) over with a correlation rho between
the two campaigns, P is their prior variance: rho = cos(f), tan(f) is the relative drift. k is the
trust in S itself. Every scale has a default from physics for each relation; the target rows move it
by marginal likelihood, held by a log-normal of sd ``LOG_SD`` about the default. With few rows a
scale is uncertain; what the mean would do if it were different is added to the covariance (Kass and
Steffey 1989, eq. 3.5, with the delta method for the mean's derivative).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Final, Literal, TypeAlias, get_args

import numpy as np

from robotrue.calibration.belief import Belief, carry_belief, with_amplitude
from robotrue.core.arrays import Array, IntArray
from robotrue.errors import ConfigurationError
from robotrue.robot.model import parameter_slice

Relation: TypeAlias = Literal["region", "campaign", "unit"]
RELATIONS: Final[tuple[Relation, ...]] = get_args(Relation)
TRUST: Final = "trust"
NOISE: Final = "noise"
RIPPLE: Final = "ripple"
SMOOTH: Final = "smooth"
FIELD: Final = "field"
LOG_SD: Final = 1.6
"""sd of the natural logarithm of a drift scale about its default: a factor of five."""
NOISE_LOG_SD: Final = 0.4
TRUST_LOG_SD: Final = 0.2
FIXED: Final = 1e-6
"""Scale, and sd of its logarithm, of what does not drift in a relation."""
WHITE_FLOOR: Final = 1e-7
"""m, white noise below which nothing is measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftScales:
    """Prior distance of a target from its source; standard deviations.

    Attributes:
        base: m, base or tracker registration, both in base.
        base_rotation: rad.
        tool: m, the reflector mounted again.
        tool_rotation: rad.
        theta: rad, joint zeros.
        length: m, d and a.
        angle: rad, alpha and beta.
        gear: Relative.
        compliance: Relative to the compliance.
        ripple: tan(f) of ripple and backlash; 0 is the same and stays so, 1 half the variance.
        smooth: tan(f) of the smooth residual.
        field: m, amplitude of a smooth residual where the source has none.
    """

    base: float
    base_rotation: float
    tool: float
    tool_rotation: float
    theta: float
    length: float
    angle: float
    gear: float
    compliance: float
    ripple: float
    smooth: float
    field: float


_BY_RELATION: Final[Mapping[str, tuple[float, float, float]]] = {  # in the order of RELATIONS
    "base": (2e-6, 2e-4, 2e-2),
    "base_rotation": (2e-6, 1e-4, 2e-2),
    "tool": (1e-6, 2e-4, 1e-2),
    "tool_rotation": (2e-6, 1e-3, 2e-2),
    "theta": (2e-6, 2e-5, 1e-3),
    "length": (2e-6, 2e-5, 5e-4),
    "angle": (2e-6, 1e-5, 5e-4),
    "gear": (1e-7, 1e-6, 2e-5),
    "compliance": (1e-3, 0.02, 0.2),
    "ripple": (0.0, 0.1, 10.0),
    "smooth": (0.0, 0.3, 3.0),
    "field": (3e-5, 3e-5, 5e-5),
}
DEFAULTS: Final[Mapping[Relation, DriftScales]] = {
    relation: DriftScales(**{name: scales[k] for name, scales in _BY_RELATION.items()})
    for k, relation in enumerate(RELATIONS)
}
"""Same campaign: half an hour of warming. Months: the stand, the reflector and the encoders
referenced again, 1 to 2 K (12 um per m and K). Another arm of the type: tolerances of manufacture,
another base; its gears are alike in kind and not in phase."""


NO_DRIFT: Final = DriftScales(**{scale.name: 0.0 for scale in fields(DriftScales)})
"""Nothing has changed: source and target are one campaign."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftGroup:
    """One scale: its name, its columns and its default.

    Attributes:
        name: For reports.
        columns: Where it acts.
        unit: (len(columns),) sd of each column at scale one.
        rest: Default scale.
    """

    name: str
    columns: Array
    unit: Array
    rest: float


def drift_groups(belief: Belief, scales: DriftScales) -> list[DriftGroup]:
    """Returns the additive groups that act on the physical columns of a belief."""
    dof = belief.robot.dof
    covered = belief.variance[: len(belief.errors)] > 0.0
    out = []

    def add(name: str, places: list[slice], unit: float | Array, rest: float) -> None:
        columns = np.concatenate([np.arange(p.start, p.stop) for p in places])
        units = np.broadcast_to(unit, columns.shape)
        kept = covered[columns] & (units > 0.0)
        if kept.any() and rest > 0.0:
            out.append(DriftGroup(name=name, columns=columns[kept], unit=units[kept], rest=rest))

    def place(*names: str) -> list[slice]:
        return [parameter_slice(dof, name) for name in names]

    for frame in ("base", "tool"):
        start = parameter_slice(dof, frame).start
        turn = f"{frame}_rotation"
        add(frame, [slice(start, start + 3)], 1.0, getattr(scales, frame))
        add(turn, [slice(start + 3, start + 6)], 1.0, getattr(scales, turn))
    add("theta", place("theta"), 1.0, scales.theta)
    add("length", place("d", "a"), 1.0, scales.length)
    add("angle", place("alpha", "beta"), 1.0, scales.angle)
    add("gear", place("gear"), 1.0, scales.gear)
    stiffness = place("compliance")
    size = np.abs(belief.errors[stiffness[0]])
    spread = np.sqrt(belief.variance[stiffness[0]])
    add("compliance", stiffness, np.maximum(size, spread), scales.compliance)
    return out


def shape_variance(belief: Belief) -> tuple[Array, Array]:
    """Returns the prior variance (p,) of drive errors, and of the smooth residual."""
    variance = belief.variance
    prior = {"waves": np.zeros(len(variance)), "field": np.zeros(len(variance))}
    for term in belief.terms:
        place = belief.place(term.name)
        if term.carry in prior:
            prior[term.carry][place] = term.prior_variance(belief.mean[place], variance[place])
    return prior["waves"], prior["field"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceDrift:
    """A source's belief, what may have changed, and the scales of that.

    Attributes:
        belief: The source.
        groups: Additive groups.
        field: Columns of the smooth residual that the source does not have.
        rest: Natural logarithm of the defaults of trust, noise, ripple, smooth, field, then of
            every group.
        log_sd: Of the log-normals about them.
        log_scale: Base and reflector.
        log_cov: Covariance of ``log_scale``.
        waves: (p,) prior variance of ripple and backlash.
        smooths: (p,) prior variance of the source's smooth residual.
    """

    belief: Belief
    groups: tuple[DriftGroup, ...]
    field: IntArray
    rest: Array
    log_sd: Array
    log_scale: Array
    log_cov: Array
    waves: Array
    smooths: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Name of every scale."""
        return (TRUST, NOISE, RIPPLE, SMOOTH, FIELD, *(g.name for g in self.groups))

    @property
    def scales(self) -> dict[str, float]:
        """Scale by name: factors for trust, tan(f) for ripple and smooth, else SI."""
        return dict(zip(self.names, np.exp(self.log_scale).tolist(), strict=True))

    @property
    def white(self) -> float:
        """White noise of lengths, m."""
        return float(np.exp(self.log_scale[1]))


def prior_of(drift: SourceDrift) -> Belief:
    """Returns the target's prior: the source carried over with the drift's scales."""
    belief = drift.belief
    scale = np.exp(drift.log_scale)
    keep, variance = carry_over(drift, scale)
    if len(drift.field):
        belief = with_amplitude(belief, float(scale[4]))
    carried = carry_belief(belief, keep, float(scale[0]), variance)
    return replace(carried, white=float(scale[1]), inflation=1.0)


def prior_mean(drift: SourceDrift) -> Belief:
    """Returns the mean of :func:`prior_of`, as if it were certain."""
    keep, _ = carry_over(drift, np.exp(drift.log_scale))
    belief = drift.belief
    return replace(belief, mean=keep * belief.mean, root=belief.root[:0])


def carry_over(drift: SourceDrift, scale: Array) -> tuple[Array, Array]:
    """Returns D (p,) and the variance (p,) the drift adds, at scales as in ``Drift.names``."""
    belief = drift.belief
    angle = np.arctan(scale[2:4])
    keep = np.ones(len(belief.mean))
    keep[belief.columns_by_carry("waves")] = np.cos(angle[0])
    keep[belief.columns_by_carry("field")] = np.cos(angle[1])
    variance = np.sin(angle[0]) ** 2 * drift.waves + np.sin(angle[1]) ** 2 * drift.smooths
    variance[drift.field] = scale[4] ** 2
    for group, s in zip(drift.groups, scale[5:], strict=True):
        variance[group.columns] += (s * group.unit) ** 2
    return keep, variance


def drift_of(
    belief: Belief, relation: Relation, scales: DriftScales | None = None, *, field_from: int = -1
) -> SourceDrift:
    """Returns the drift of a relation at its default scales.

    Args:
        belief: The source, with the centres of the target already among its columns.
        relation: How the target belongs to the source.
        scales: Defaults other than :data:`DEFAULTS`.
        field_from: First smooth column that belongs to the target alone; -1 if there is none.

    Raises:
        ConfigurationError: No such relation.
    """
    if relation not in RELATIONS:
        raise ConfigurationError(
            f"no relation {relation!r} between source and target; relations are {list(RELATIONS)}."
        )
    chosen = DEFAULTS[relation] if scales is None else scales
    groups = drift_groups(belief, chosen)
    end = belief.place("smooth").stop
    fresh = np.arange(field_from, end) if field_from >= 0 else np.arange(0)
    amplitude = belief.smooth.amplitude
    fields = amplitude if amplitude > 0.0 else chosen.field
    white = belief.inflation * belief.visit
    rest = np.array(
        [
            np.sqrt(max(belief.inflation, 1.0)),
            np.sqrt(max(white - belief.repeatability**2, WHITE_FLOOR**2)),
            chosen.ripple,
            chosen.smooth,
            fields,
            *(g.rest for g in groups),
        ]
    )
    log_sd = np.array(
        [TRUST_LOG_SD, NOISE_LOG_SD, LOG_SD, LOG_SD, LOG_SD, *(LOG_SD for _ in groups)]
    )
    waves, smooths = shape_variance(belief)
    smooths[fresh] = 0.0
    fixed = rest == 0.0
    if chosen.ripple == 0.0:
        waves[:] = 0.0
    if chosen.smooth == 0.0:
        smooths[:] = 0.0
    rest[fixed], log_sd[fixed] = FIXED, FIXED
    return SourceDrift(
        waves=waves,
        smooths=smooths,
        belief=replace(belief, inflation=1.0),
        groups=tuple(groups),
        field=fresh,
        rest=np.log(rest),
        log_sd=log_sd,
        log_scale=np.log(rest),
        log_cov=np.diag(log_sd**2),
    )
