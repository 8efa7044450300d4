"""Drift check: whether the robot has changed since its calibration, from a few poses.

With residuals r = measured - predicted (all poses in one vector) and their covariance C (joint
uncertainty of the model at these poses, scatter, instrument)::

    X = r' C^-1 r ~ chi2(3 n)                                nothing has changed
    d = (A' C^-1 A)^-1 A' C^-1 r,  G = d' (A' C^-1 A) d ~ chi2(k)    one cause of k numbers
    X - G ~ chi2(3 n - k)                                     that cause explains all of it

A is the derivative of the tool point by the cause: the base moved (6), the tool or its reflector
moved (3), one joint slipped (1 each), one reading is wrong (3 each). The level is divided: half for
X, half among the m causes (Bonferroni), so that an unchanged robot is reported as changed with no
more than the stated probability.

Fails when: poses are few or alike. A cause that hardly moves the measured points is not tried, and
two that move them alike (joint 1 slipped, base turned about its axis) cannot be separated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Final, Literal, NamedTuple, TypeAlias

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.special import chdtrc

from robotrue.calibration.arm import prepare_arm
from robotrue.calibration.belief import Belief
from robotrue.calibration.model import ErrorModel, Query
from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.errors import ConfigurationError, ObservabilityError, ShapeError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import POSE_TERMS, parameter_slice
from robotrue.robot.statics import Load
from robotrue.validation.evaluation import Evaluation, evaluate, row_loads
from robotrue.validation.metrics import squared_distance
from robotrue.validation.validation_defaults import DRIFT_LEVEL, FEWEST_DRIFT_POSES

Verdict: TypeAlias = Literal["keep", "update", "recalibrate", "measure again"]
Kind: TypeAlias = Literal["base", "tool", "joint", "reading"]
SEEN_LENGTH: Final = 1e-4
SEEN_ANGLE: Final = 1e-4
"""m and rad: a cause is tried if the poses know it to this standard deviation."""
TOGETHER: Final = 10.0
"""How much worse each number of a cause of several may be known."""
ILL_CONDITIONED: Final = 1e12
_KINDS: Final[dict[str, Kind]] = {"base": "base", "tool": "tool"}


class _Way(NamedTuple):
    """A cause that is tried."""

    name: str
    kind: Kind
    terms: tuple[str, ...]
    columns: Array
    """(3n, k), whitened."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause(Columns):
    """One thing that may have happened.

    Attributes:
        name: ``base``, ``tool``, ``joint 3`` or ``reading 5``.
        kind: Which of the four.
        terms: Name of each number of ``shift``.
        shift: (k,) m and rad, what explains the residuals best.
        sd: (k,) of it.
        gain: G of the module's formula.
        p: Probability of such a gain where nothing has changed, corrected for the number of causes.
        p_left: Probability of what is left, if the cause is true.
        explains: Whether the gain is beyond chance and what is left is not.
    """

    name: str
    kind: Kind
    terms: Annotated[tuple[str, ...], Column("k")]
    shift: Annotated[Array, Column("k")]
    sd: Annotated[Array, Column("k")]
    gain: float
    p: float
    p_left: float
    explains: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftCheck:
    """Result of measuring a few poses again for a stored model.

    Attributes:
        verdict: ``keep``; ``update``: one cause explains it, a transfer with these poses is enough;
            ``recalibrate``: changed, and no single cause explains it; ``measure again``: one
            reading explains it.
        chi2: X of the module's formula.
        degrees: Of freedom.
        p: Probability of such an X where nothing has changed.
        level: Probability of calling a robot changed that has not.
        causes: Most likely first.
        not_seen: Causes these poses cannot show.
        residual: (n, 3) m in base, measured minus predicted.
        sigmas: (n,) length of each residual, whitened by its own covariance.
        source_row: (n,) line of each pose.
    """

    verdict: Verdict
    chi2: float
    degrees: int
    p: float
    level: float
    causes: tuple[Cause, ...]
    not_seen: tuple[str, ...]
    residual: Array
    sigmas: Array
    source_row: Array

    @property
    def changed(self) -> bool:
        """True if the verdict is that the robot has changed."""
        return self.verdict != "keep"

    @property
    def best(self) -> Cause | None:
        """The most likely cause, if one explains what is seen."""
        return next((c for c in self.causes if c.explains), None)


def drift_check(
    model: ErrorModel,
    measurements: MeasurementSet,
    *,
    payload: Load | None = None,
    level: float = DRIFT_LEVEL,
) -> DriftCheck:
    """Returns whether the poses are those of the robot the model was made of.

    Args:
        model: With a joint covariance: from a fit, an update or a transfer.
        measurements: 5 to 10 poses, in base or from a station the model knows.
        payload: Used where a row does not state its own.
        level: Probability of a false alarm.

    Raises:
        ConfigurationError: A level outside 0 to 0.5, a model without joint covariance, or
            rows of a further reflector.
        ObservabilityError: Fewer than four poses.
        ModelMismatchError: Another robot, or an unknown station.
    """
    if not 0.0 < level <= 0.5:
        raise ConfigurationError(f"level {level:g}, expected above 0 and up to 0.5.")
    if len(measurements) < FEWEST_DRIFT_POSES:
        raise ObservabilityError(
            f"{len(measurements)} poses; a drift check needs {FEWEST_DRIFT_POSES} or more.",
            hint="measure 5 to 10 poses that are far apart.",
        )
    others = measurements.source_row[measurements.target != 0]
    if len(others):
        raise ConfigurationError(
            f"{len(others)} of {len(measurements)} rows are of other reflectors than 0 (row "
            f"{int(others[0])} first); a drift check compares the robot's own tool.",
            hint="leave those rows out.",
        )
    seen = evaluate(model, measurements, payload=payload)
    query = query_of(seen, payload)
    root = cholesky(_covariance(model, seen, query), lower=True)
    white = solve_triangular(root, seen.after.ravel(), lower=True)
    chi2, degrees = float(white @ white), len(white)
    p = float(chdtrc(degrees, chi2))
    ways, not_seen = _ways(model, query, root, len(seen.after))
    causes = _causes(ways, white, chi2, allowed=level / 2.0)
    changed = p < level / 2.0 or any(c.p < level / 2.0 for c in causes)
    return DriftCheck(
        verdict=_verdict(changed, causes),
        chi2=chi2,
        degrees=degrees,
        p=p,
        level=level,
        causes=causes,
        not_seen=not_seen,
        residual=seen.after,
        sigmas=np.sqrt(squared_distance(seen.after, seen.covariance)),
        source_row=seen.measured.source_row.astype(np.float64),
    )


def query_of(seen: Evaluation, payload: Load | None) -> Query:
    """Returns the query a comparison was made with."""
    return Query(
        joints=seen.measured.joints,
        load=row_loads(seen.measured, payload),
        approach=seen.measured.approach,
        conditions=seen.measured.conditions,
    )


def cause_columns(model: ErrorModel, query: Query) -> dict[str, tuple[tuple[str, ...], Array]]:
    """Returns the derivative of the tool points by each cause: terms and (n, 3, k).

    The base in base axes, the tool in its own; SI. Readings are not among them.

    Raises:
        ConfigurationError: A model without physics.
    """
    belief = _checkable(model)
    jacobian = prepare_arm(belief.actual).linearise(query.joints, query.load).columns
    dof = model.robot.dof
    base, tool = parameter_slice(dof, "base"), parameter_slice(dof, "tool")
    found = {
        "base": (POSE_TERMS, jacobian[:, :3, base]),
        "tool": (POSE_TERMS[:3], jacobian[:, :3, tool][:, :, :3]),
    }
    theta = parameter_slice(dof, "theta").start
    for j in range(dof):
        place = slice(theta + j, theta + j + 1)
        found[f"joint {j + 1}"] = ((f"theta{j + 1}",), jacobian[:, :3, place])
    return found


def _covariance(model: ErrorModel, seen: Evaluation, query: Query) -> Array:
    _checkable(model)
    total = model.joint_covariance(query)
    for i, instrument in enumerate(seen.measured.covariance):
        place = slice(3 * i, 3 * i + 3)
        total[place, place] += instrument
    try:
        np.linalg.cholesky(total)
    except np.linalg.LinAlgError:
        raise ShapeError(
            "the covariance of these poses is singular.",
            hint="state the instrument and the repeatability in the cell.",
        ) from None
    return total


def _checkable(model: ErrorModel) -> Belief:
    """The belief of a model whose drift can be checked."""
    belief = model.belief()
    if belief is None:
        raise ConfigurationError(
            f"a {type(model).__name__} keeps no joint covariance: its drift cannot be checked.",
            hint="calibrate with a method of `robotrue calibrate`.",
        )
    return belief


def _ways(
    model: ErrorModel, query: Query, root: Array, n: int
) -> tuple[list[_Way], tuple[str, ...]]:
    """Causes to try, and those the poses cannot show."""
    ways, hidden = [], []
    for name, (terms, columns) in cause_columns(model, query).items():
        white = solve_triangular(root, columns.reshape(3 * n, -1), lower=True)
        if _well_seen(white, terms):
            ways.append(_Way(name, _KINDS.get(name, "joint"), terms, white))
        else:
            hidden.append(name)
    white = solve_triangular(root, np.eye(3 * n), lower=True)
    for i in range(n):
        own = white[:, 3 * i : 3 * i + 3]
        ways.append(_Way(f"reading {i + 1}", "reading", POSE_TERMS[:3], own))
    return ways, tuple(hidden)


def _well_seen(white: Array, terms: Sequence[str]) -> bool:
    """True if every number of a cause, the others free, is determined well enough to report it."""
    size = np.array([SEEN_LENGTH if term in POSE_TERMS[:3] else SEEN_ANGLE for term in terms])
    information = white.T @ white * np.outer(size, size)
    if np.linalg.cond(information) > ILL_CONDITIONED:
        return False
    sd = np.sqrt(np.diagonal(np.linalg.inv(information)))
    # Six numbers of a base that moved show together; each alone may be less well known.
    return bool((sd < (TOGETHER if len(terms) > 1 else 1.0)).all())


def _causes(
    ways: Sequence[_Way],
    white: Array,
    chi2: float,
    *,
    allowed: float,
) -> tuple[Cause, ...]:
    out = []
    for name, kind, terms, columns in ways:
        k = len(terms)
        information = columns.T @ columns
        factor = cholesky(information, lower=True), True
        shift = cho_solve(factor, columns.T @ white)
        gain = float(shift @ information @ shift)
        p = min(1.0, len(ways) * float(chdtrc(k, gain)))
        p_left = float(chdtrc(len(white) - k, max(chi2 - gain, 0.0)))
        out.append(
            Cause(
                name=name,
                kind=kind,
                terms=tuple(terms),
                shift=shift,
                sd=np.sqrt(np.diagonal(cho_solve(factor, np.eye(k)))),
                gain=gain,
                p=p,
                p_left=p_left,
                explains=p < allowed <= p_left,
            )
        )
    return tuple(sorted(out, key=lambda c: (not c.explains, c.p, -c.gain)))


def _verdict(changed: bool, causes: Sequence[Cause]) -> Verdict:
    if not changed:
        return "keep"
    best = causes[0]
    if not best.explains:
        return "recalibrate"
    return "measure again" if best.kind == "reading" else "update"
