"""Identifiability: determined and undetermined combinations, and measurements that help.

In coordinates scaled by the prior an eigenvalue of the data's information is the number of times
the data know a direction better than the prior does. Directions below :data:`UNSEEN` are the
prior's alone. To each, ever richer imagined measurements are tried until one shows it; what none
shows are parameters that move the arm alike, of which only a combination exists.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

import numpy as np

from robotrue.calibration.parameters import ParameterLayout
from robotrue.calibration.terms.error_vector import supposed_masses
from robotrue.core.arrays import Array, IntArray
from robotrue.robot.forward import drive_jacobian, parameter_jacobian, walk
from robotrue.robot.model import RobotModel, moment_slice, parameter_slice
from robotrue.robot.statics import Load, torque_at, weight_torque

UNSEEN: Final = 0.1
"""Information below this, in units of the prior's, is none: the sd shrinks by less than 5 %."""
SEEN: Final = 9.0
"""Information above this is enough: the sd is less than a third of the prior's."""
PROBES: Final = 50
_NAMED: Final = 0.08
"""Coefficients below this share of the largest are not named."""
_STATED: Final = 1e-6
"""Coefficients below this share are rounding. The ones between are part of the direction: without
them it is another one, which the data do see, and what it costs a prediction comes out too small.
"""
_EXACT: Final = 2e-3

Reveal: TypeAlias = Literal["poses", "side load", "orientation", "another tool", "root", "nothing"]
CURES: Final[dict[Reveal, str]] = {
    "poses": "add poses spread further over the joint ranges and tool orientations",
    "side load": "measure some poses under a known horizontal force, or state the stiffness",
    "orientation": "for its orientation and for other tools, use a reflector away from that axis, "
    "several reflectors, or a 6-D probe",
    "another tool": "nothing for the measured tool; register any other tool separately, or "
    "measure several reflectors",
    "root": "nothing inside the cell; to know it against the robot root, measure the root",
    "nothing": "nothing: these have the same effect on the arm, only their combination exists",
}
STATED_STIFFNESS: Final = (
    "measure some poses under a known horizontal force; until then the stated stiffness is used"
)
"""The cure of undetermined compliance where a stiffness is stated."""
ASSUMED_WEIGHT: Final = (
    "unloaded poses determine the product of link weight and drive compliance, not each factor; "
    "measure some poses under a known force or a second payload, or state the link masses"
)
"""The cure of a drive's compliance that trades off with the weight it carries."""
LONGEST: Final = 4
"""Parameters a combination is named by; ``terms`` holds all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Direction:
    """A combination of parameters that the data cannot see.

    Attributes:
        name: For one parameter its name; for two the combination that *is* seen
            (``theta1 + base_rz``); for more the names that trade off, the largest first.
        terms: (name, coefficient) of the unseen direction, SI, the first one 1.
        reveal: The kind of measurement that would show it.
        cure: Remedy, in words.
        harmless: True where no position of the measured reflector depends on it.
    """

    name: str
    terms: tuple[tuple[str, float], ...]
    reveal: Reveal
    cure: str
    harmless: bool

    def __str__(self) -> str:
        return f"{self.name}: {self.cure}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Identifiability:
    """The analysis of one fit.

    Attributes:
        names: (P,) parameters of the ``robot`` block that are estimated.
        sd_ratio: (P,) posterior over prior standard deviation of each.
        information: (P,) eigenvalues in prior-scaled coordinates, falling.
        unseen: Directions the data cannot see.
        determinable: Largest number of directions that points without extra load could determine.
    """

    names: tuple[str, ...]
    sd_ratio: Array
    information: Array
    unseen: tuple[Direction, ...]
    determinable: int

    @property
    def classes(self) -> dict[str, str]:
        """Each parameter: ``"seen"``, ``"weakly seen"`` or ``"prior only"``."""
        return dict(zip(self.names, map(visibility, self.sd_ratio.tolist()), strict=True))

    @property
    def harmful(self) -> tuple[Direction, ...]:
        """Unseen directions that predictions do depend on."""
        return tuple(d for d in self.unseen if not d.harmless)

    def document(self) -> list[dict[str, object]]:
        """Returns the unseen directions as JSON values; terms where predictions depend on them."""
        return [
            {"name": d.name, "cure": d.cure, "harmless": d.harmless}
            | ({} if d.harmless else {"terms": dict(d.terms)})
            for d in self.unseen
        ]


def visibility(sd_ratio: float) -> str:
    """Returns ``seen``, ``weakly seen`` or ``prior only`` of a posterior over a prior sd."""
    seen, unseen = (1.0 + SEEN) ** -0.5, (1.0 + UNSEEN) ** -0.5
    return "seen" if sd_ratio < seen else "weakly seen" if sd_ratio < unseen else "prior only"


def analyse(
    robot: RobotModel,
    layout: ParameterLayout,
    information: Array,
    prior_sd: Array,
    payload: Load,
    *,
    stiffness_stated: bool = False,
) -> Identifiability:
    """Returns the identifiability of the ``robot`` block.

    Args:
        robot: The arm at the solution.
        layout: The parameter vector; with stations the base is not known.
        information: (P, P) J^T W J of the data, SI.
        prior_sd: (P,) physical scales, zero where fixed.
        payload: Of the imagined measurements.
        stiffness_stated: The compliance prior is a stiffness the user stated.
    """
    cures = {**CURES, "side load": STATED_STIFFNESS} if stiffness_stated else CURES
    size, moments = layout.robot_size, moment_slice(robot.dof)
    every = np.flatnonzero(prior_sd[:size] > 0.0)
    known, ratio = _weigh_information(information, prior_sd, every)
    free, values, vectors = every, *known
    if robot.link_mass.any():  # a narrow prior that data need not add to
        free = every[(every < moments.start) | (every >= moments.stop)]
        (values, vectors), _ = _weigh_information(information, prior_sd, free)
    sd, dark = prior_sd[free], vectors[:, values < UNSEEN]
    every_name = layout.names
    names = tuple(every_name[i] for i in free)
    kinds = _imagine_campaigns(robot, free, sd, payload, base_known=not layout.stations)
    unseen: list[Direction] = []
    for kind, gram in kinds:
        if not dark.shape[1]:
            break
        strength, turn = np.linalg.eigh(dark.T @ gram @ dark)
        turned = dark @ turn
        lit = strength > 1.0
        unseen += _name_directions(turned[:, lit], names, sd, kind, robot, cures)
        dark = turned[:, ~lit]
    unseen += _name_directions(dark, names, sd, "nothing", robot, cures)
    geometry = (free < moments.start) | (free >= moments.stop)
    reachable = np.linalg.eigvalsh(kinds[0][1][np.ix_(geometry, geometry)])
    return Identifiability(
        names=tuple(every_name[i] for i in every),
        sd_ratio=ratio,
        information=known[0][::-1],
        unseen=tuple(unseen),
        determinable=int((reachable > 1.0).sum()),
    )


def _weigh_information(
    information: Array, prior_sd: Array, free: IntArray
) -> tuple[tuple[Array, Array], Array]:
    """Returns eigenvalues and -vectors of the scaled information, and sd over prior sd of each."""
    values, vectors = np.linalg.eigh(_marginal(information, prior_sd, free))
    variance = np.einsum("ij,j,ij->i", vectors, 1.0 / (1.0 + np.maximum(values, 0.0)), vectors)
    return (values, vectors), np.sqrt(variance)


def _marginal(information: Array, prior_sd: Array, free: IntArray) -> Array:
    """Information on the free robot parameters, all others integrated out, prior-scaled."""
    nuisance = np.setdiff1d(np.flatnonzero(prior_sd > 0.0), free)
    sd, other = prior_sd[free], prior_sd[nuisance]
    out: Array = sd[:, None] * information[np.ix_(free, free)] * sd
    if len(nuisance):
        cross = sd[:, None] * information[np.ix_(free, nuisance)] * other
        own = other[:, None] * information[np.ix_(nuisance, nuisance)] * other
        out = out - cross @ np.linalg.solve(own + np.eye(len(nuisance)), cross.T)
    return 0.5 * (out + out.T)


def _imagine_campaigns(
    robot: RobotModel, free: IntArray, sd: Array, payload: Load, *, base_known: bool
) -> list[tuple[Reveal, Array]]:
    """Information of ever richer campaigns of PROBES poses, 0.05 mm and 0.1 mrad per axis."""
    rng = np.random.default_rng(0)
    low, high = np.clip(robot.limits, -np.pi, np.pi).T
    joints = low + (high - low) * rng.random((PROBES, robot.dof))
    state = walk(robot, joints)
    heavy = float(supposed_masses(robot).sum() * np.linalg.norm(robot.gravity))
    push = np.zeros((PROBES, 6))
    push[:, :3] = 0.1 * max(heavy, 200.0) * rng.standard_normal((PROBES, 3))
    quiet = Load(mass=payload.mass, com=payload.com)
    loaded = replace(payload, wrench=push)
    scale = np.repeat([1.0 / 5e-5, 1.0 / 1e-4], 3)[None, :, None]
    weight = weight_torque(robot, state)
    torque = torque_at(robot, state, quiet)
    still = scale * parameter_jacobian(robot, state, joints, torque, weight)
    pushed = still.copy()
    pushed[:, :, parameter_slice(robot.dof, "compliance")] = (
        scale * drive_jacobian(robot, state) * torque_at(robot, state, loaded)[:, None, :]
    )
    bare = pushed.copy()
    bare[:, :, parameter_slice(robot.dof, "tool")] = 0.0
    out: list[tuple[Reveal, Array]] = []
    campaigns: tuple[tuple[Reveal, Array], ...] = (
        ("poses", still[:, :3]),
        ("side load", pushed[:, :3]),
        ("orientation", pushed),
        ("another tool", bare),
    )
    base = parameter_slice(robot.dof, "base")
    for kind, jacobian in campaigns:
        flat = jacobian[:, :, free].reshape(-1, len(free)) * sd
        if not base_known:
            frame = jacobian[:, :, base].reshape(len(flat), 6)
            q, _ = np.linalg.qr(frame)
            flat = flat - q @ (q.T @ flat)
        out.append((kind, flat.T @ flat))
    if not base_known:
        flat = pushed[:, :, free].reshape(-1, len(free)) * sd
        out.append(("root", flat.T @ flat))
    return out


def _name_directions(
    directions: Array,
    names: tuple[str, ...],
    sd: Array,
    kind: Reveal,
    robot: RobotModel,
    cures: Mapping[Reveal, str],
) -> list[Direction]:
    out: list[Direction] = []
    if not directions.shape[1]:
        return out
    # Names read best where a milliradian weighs as much as a millimetre, whatever the prior.
    even = np.array(
        [
            s if n.startswith(("compliance", "moment")) else 1e-3
            for n, s in zip(names, sd, strict=True)
        ]
    )
    for row in _sparse(directions * (sd / even)[:, None]):
        order = np.flatnonzero(np.abs(row) > _STATED).tolist()
        physical = row[order] * even[order]
        largest = np.abs(row[order]) > _NAMED
        terms = tuple(
            (names[i], float(value / physical[0])) for i, value in zip(order, physical, strict=True)
        )
        named = tuple(term for term, large in zip(terms, largest, strict=True) if large)
        cure = cures[kind]
        if kind == "side load" and any(name.startswith("moment") for name, _ in named):
            cure = ASSUMED_WEIGHT
        out.append(
            Direction(
                name=_name(named),
                terms=terms,
                reveal=kind,
                cure=_reason(named, kind, robot) + cure,
                harmless=kind not in ("poses", "side load"),
            )
        )
    return out


def _sparse(directions: Array) -> Array:
    """Rows (k, P) that span the columns with few terms each.

    Single parameters first, then pairs (those with the base or the tool before others), the others
    as an echelon form with complete pivoting.
    """
    out: list[Array] = []
    basis = np.linalg.qr(directions)[0]
    while basis.shape[1]:
        row = _short(basis)
        if row is None:
            break
        out.append(row)
        inside = basis.T @ row
        keep = np.linalg.qr(inside[:, None], mode="complete")[0][:, 1:]
        basis = basis @ keep
    return np.array([*out, *_echelon(basis.T.copy())]).reshape(-1, len(directions))


def _short(basis: Array) -> Array | None:
    """A direction of one or two terms that lies in the span of ``basis``, if there is one."""
    size = len(basis)
    away = np.eye(size) - basis @ basis.T
    own = np.diagonal(away)
    out = np.zeros(size)
    if own.min() < _EXACT:
        out[int(np.argmin(own))] = 1.0
        return out
    mean, half = (own[:, None] + own) / 2.0, (own[:, None] - own) / 2.0
    rest = mean - np.hypot(half, away)
    rest[np.tri(size, dtype=np.bool_)] = np.inf
    # The later parameters are base and tool: prefer them where several pairs fit.
    fits = np.argwhere(rest < _EXACT)
    if not len(fits):
        return None
    i, j = fits[np.argmax(fits[:, 1])]
    pair = np.linalg.eigh(away[np.ix_([i, j], [i, j])])[1][:, 0]
    out[[i, j]] = pair / np.abs(pair).max()
    return out


def _echelon(rows: Array) -> Array:
    for i in range(len(rows)):
        flat = int(np.argmax(np.abs(rows[i:])))
        r, c = i + flat // rows.shape[1], flat % rows.shape[1]
        rows[[i, r]] = rows[[r, i]]
        rows[i] /= rows[i, c]
        for k in range(len(rows)):
            if k != i:
                rows[k] -= rows[k, c] * rows[i]
    return rows


def _name(terms: tuple[tuple[str, float], ...]) -> str:
    if len(terms) == 2:
        (first, _), (second, value) = terms
        seen = -1.0 / value
        size = "" if abs(abs(seen) - 1.0) < 0.02 else f"{abs(seen):.3g} "
        return f"{first} {'+' if seen > 0 else '-'} {size}{second}"
    if len(terms) <= LONGEST:
        return " ~ ".join(name for name, _ in terms)
    largest = sorted(terms, key=lambda term: -abs(term[1]))[: LONGEST - 1]
    return " ~ ".join(name for name, _ in largest) + f" ~ {len(terms) - len(largest)} more"


def _reason(terms: tuple[tuple[str, float], ...], kind: Reveal, robot: RobotModel) -> str:
    """Why a lone compliance is not seen, where gravity is the reason."""
    if len(terms) != 1 or kind != "side load" or not terms[0][0].startswith("compliance"):
        return ""
    joint = terms[0][0].removeprefix("compliance")
    return f"no torque about axis {joint} in these poses (gravity does not load a vertical axis); "
