"""One model from several fits of the same rows; its covariance includes their spread.

With weights a_k over models of mean m_k and covariance f_k S_k the average has

    mean  sum a_k m_k        covariance  f sum a_k (S_k + (m_k - mean)(m_k - mean)')

the first two moments of their mixture (Yao, Vehtari, Simpson and Gelman 2018, "Using stacking to
average Bayesian predictive distributions"), times one factor f from the rows that all models were
held out of (:mod:`robotrue.calibration.held_out_blocks`). Where a model does not carry such rows,
as after a transfer, S_k keeps its own factor and f is one.

All models are linear in the same coefficients, so the average is one of them: mean and root over
robot errors and terms. A term that a model does not have is zero in it, without variance. An
average is used like a single fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotrue.calibration.belief import (
    Belief,
    stack_roots,
    with_centres,
    with_harmonics,
    with_term,
)
from robotrue.calibration.calibrated_model import CalibratedModel, Reflector, model_of
from robotrue.calibration.held_out_blocks import (
    NUMBERS_PER_ROW,
    HeldOutRows,
    average_held_out,
    widen,
)
from robotrue.calibration.learned_assembly import describe_width
from robotrue.calibration.terms.smooth import SmoothResidual
from robotrue.calibration.terms.term import Term
from robotrue.calibration.training_summary import describe_parameters
from robotrue.core.arrays import Array
from robotrue.core.poses import inverse, pose
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.errors import ConfigurationError
from robotrue.robot.model import MOMENTS, moment_slice, parameter_slice


@dataclass(frozen=True, slots=True, kw_only=True)
class _Member:
    """A model in the average.

    Attributes:
        model: The model.
        weight: Its share.
        inflation: Factor on its covariance, one where all have one in common.
        belief: Over the terms of all models.
        places: (r, 3) root over the place of each further reflector, beside that of the belief.
    """

    model: CalibratedModel
    weight: float
    inflation: float
    belief: Belief
    places: dict[int, Array]

    @property
    def scale(self) -> float:
        """Factor of its root in the root of the average."""
        return float(np.sqrt(self.weight * self.inflation))


def average_models(models: Sequence[CalibratedModel], weights: Array) -> CalibratedModel:
    """Returns the average of models of the same rows.

    Its summary is that of the first model, with parameters and noise of the average.

    Args:
        models: One or more; the others' tracker frames are counted from those of the first.
        weights: (k,) positive; only their ratios count.

    Raises:
        ConfigurationError: Models of different tool points, or terms that cannot be averaged.
    """
    first = models[0]
    if len(models) == 1:
        return first
    refuse_strangers(models)
    share = np.asarray(weights, dtype=np.float64) / float(np.sum(weights))
    width = _common_width(models, share)
    factors = np.array([1.0 if width else model.inflation for model in models])
    members = _align_members(models, share, factors)
    shifts = {k: _station_shifts(models, k) for k in sorted(first.T_tracker_base)}
    means = _share_moments(members, share)
    if shifts:  # the first station defines the base
        base = parameter_slice(first.robot.dof, "base")
        off = next(iter(shifts.values()))
        means[:, base] += off - share @ off
    mean = share @ means
    apart = np.sqrt(share)[:, None] * (means - mean)
    visit = sum(m.scale**2 * (m.model.white**2 + m.model.repeatability**2) for m in members)
    average = replace(
        members[0].belief,
        mean=mean,
        root=stack_roots([*((m.scale, m.belief.root) for m in members), (1.0, apart)]),
        white=float(np.sqrt(max(visit - first.repeatability**2, 0.0))),
        inflation=width.inflation if width else 1.0,
        T_tracker_base={
            k: first.T_tracker_base[k] @ _small_pose(share @ off) for k, off in shifts.items()
        },
        reflectors={k: _average_place(members, k) for k in sorted(first.reflectors)},
    )
    said = describe_width(width) if width else {}
    return replace(_renew_parameters(average, members, said), held_out=width)


def _common_width(models: Sequence[CalibratedModel], share: Array) -> HeldOutRows | None:
    """The held-out rows of the average with its factor; None where a model has none."""
    rows = [model.held_out for model in models if model.held_out is not None]
    if len(rows) < len(models) or len({len(held_out.error) for held_out in rows}) > 1:
        return None
    return widen(average_held_out(rows, share), numbers_per_row=NUMBERS_PER_ROW)


def refuse_strangers(models: Sequence[CalibratedModel]) -> None:
    """Refuses models that have no average with the first one.

    Raises:
        ConfigurationError: Models of different tool points, without the tracker frames or the
            reflectors of the first one, or with different smooth residuals.
    """
    first = models[0]
    if any(not np.array_equal(m.robot.T_flange_tool, first.robot.T_flange_tool) for m in models):
        raise ConfigurationError("models of different tool points cannot be averaged.")
    for what, keys in (
        ("tracker frames", [m.T_tracker_base.keys() for m in models]),
        ("reflectors", [m.reflectors.keys() for m in models]),
    ):
        if any(not keys[0] <= others for others in keys):
            raise ConfigurationError(f"models without the {what} of the first have no average.")
    _only_smooth([model.belief() for model in models])


def _align_members(
    models: Sequence[CalibratedModel], share: Array, factors: Array
) -> list[_Member]:
    """The models over the terms of all, in one order, their covariances times a factor of each."""
    beliefs = [model.belief() for model in models]
    count = max(len(belief.ripple.cycles) for belief in beliefs)
    beliefs = [with_harmonics(belief, count) for belief in beliefs]
    smooth = _only_smooth(beliefs)
    terms: dict[str, Term] = {}
    for belief in beliefs:
        for term in belief.terms:
            known = terms.setdefault(term.name, term)
            if not isinstance(term, SmoothResidual) and term.size != known.size:
                raise ConfigurationError(f"models with different terms {term.name!r}: no average.")
    if smooth is not None:
        amplitude = sum(
            a * belief.smooth.amplitude**2
            for a, belief in zip((share * factors).tolist(), beliefs, strict=True)
        )
        terms[smooth.name] = replace(smooth, amplitude=float(np.sqrt(amplitude)))
    members = []
    for model, belief, weight, factor in zip(
        models, beliefs, share.tolist(), factors.tolist(), strict=True
    ):
        root, places = _add_places(model, belief.root)
        belief = replace(belief, root=root)
        if smooth is not None:
            belief = _widen_smooth(belief, smooth)
        more = np.zeros((len(belief.root) - len(root), 3))
        places = {k: np.vstack([place, more]) for k, place in places.items()}
        aligned = _arrange(belief, tuple(terms.values()))
        members.append(
            _Member(model=model, weight=weight, inflation=factor, belief=aligned, places=places)
        )
    return members


def _share_moments(members: Sequence[_Member], share: Array) -> Array:
    """The means (k, p) of the members, moments of links by the compliance they act through.

    A moment bends the joints of its link and of those before it, and a model predicts the product.
    A member with stiff joints does not determine the moment: the mean of the others replaces it.
    """
    means = np.array([member.belief.mean for member in members])
    dof = members[0].model.robot.dof
    reach = np.cumsum(np.abs(means[:, parameter_slice(dof, "compliance")]), axis=1)
    most = np.max(reach, axis=0)
    acts = np.divide(reach, most, out=np.ones_like(reach), where=most > 0.0)
    acts = np.tile(acts, len(MOMENTS))
    moments = means[:, moment_slice(dof)]
    mean = share @ (acts * moments) / (share @ acts)
    means[:, moment_slice(dof)] = mean + acts * (moments - mean)
    return means


def _only_smooth(beliefs: Sequence[Belief]) -> SmoothResidual | None:
    """The smooth residual that some of the models have; its basis begins with those of all."""
    found = [belief.smooth for belief in beliefs if belief.smooth.size]
    if not found:
        return None
    longest = max(found, key=lambda smooth: smooth.size)
    for smooth in found:
        first = longest.basis.centres[: len(smooth.basis.centres)]
        if not (
            np.array_equal(smooth.basis.scale, longest.basis.scale)
            and np.array_equal(smooth.basis.centres, first)
        ):
            raise ConfigurationError("models with different smooth residuals cannot be averaged.")
    return longest


def _widen_smooth(belief: Belief, smooth: SmoothResidual) -> Belief:
    """The belief over the centres of another's residual; where it has one, as unsure there."""
    own = belief.smooth
    if not own.size:
        return with_term(belief, smooth, np.arange(0))
    if own.size == smooth.size:
        return belief
    return with_centres(belief, smooth.basis, own.amplitude)


def _arrange(belief: Belief, terms: tuple[Term, ...]) -> Belief:
    """The belief over other terms in another order; those it does not have are zero and certain."""
    if [(t.name, t.size) for t in belief.terms] == [(t.name, t.size) for t in terms]:
        return replace(belief, terms=terms)
    size = len(belief.errors)
    whole = size + sum(term.size for term in terms)
    mean, root = np.zeros(whole), np.zeros((len(belief.root), whole))
    mean[:size], root[:, :size] = belief.errors, belief.root[:, :size]
    start = size
    for term in terms:
        place = belief.place(term.name)
        stop = start + place.stop - place.start
        mean[start:stop], root[:, start:stop] = belief.mean[place], belief.root[:, place]
        start += term.size
    return replace(belief, terms=terms, mean=mean, root=root)


def _station_shifts(models: Sequence[CalibratedModel], station: int) -> Array:
    """Returns the base of each model, (k, 6) m and rad, relative to that of the first."""
    back = inverse(models[0].T_tracker_base[station])
    moved = [back @ model.T_tracker_base[station] for model in models]
    turns = rotation_vector_from_matrix(np.stack([T[:3, :3] for T in moved]))
    return np.hstack([np.stack([T[:3, 3] for T in moved]), turns])


def _small_pose(step: Array) -> Array:
    return pose(matrix_from_rotation_vector(step[3:]), step[:3])


def _add_places(model: CalibratedModel, root: Array) -> tuple[Array, dict[int, Array]]:
    """A root of the arm with the places of the further reflectors in addition.

    Where a model keeps covariances alone, a place is predicted from the arm's other errors, plus an
    independent remainder.
    """
    places: dict[int, Array] = {}
    tool = parameter_slice(model.robot.dof, "tool")
    for k in sorted(model.reflectors):
        reflector = model.reflectors[k]
        if reflector.root is not None:
            places[k] = reflector.root
            continue
        whole = reflector.covariance
        arm = np.setdiff1d(np.arange(len(whole)), np.r_[tool])
        place = tool.start + np.arange(3)
        gain = whole[np.ix_(place, arm)] @ np.linalg.pinv(whole[np.ix_(arm, arm)], hermitian=True)
        left = whole[np.ix_(place, place)] - gain @ whole[np.ix_(arm, place)]
        values, vectors = np.linalg.eigh(left)
        own = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
        said = root[:, arm] @ gain.T
        root = np.vstack([root, np.zeros((3, root.shape[1]))])
        places = {n: np.vstack([p, np.zeros((3, 3))]) for n, p in places.items()}
        places[k] = np.vstack([said, own])
    return root, places


def _average_place(members: Sequence[_Member], number: int) -> tuple[Array, Array]:
    """Returns the place of a further reflector, and its root covariance along its own axes."""
    stated: list[Reflector] = [m.model.reflectors[number] for m in members]
    share = np.array([m.weight for m in members])
    points = np.array([r.T_flange_tool[:3, 3] for r in stated])
    T = stated[0].T_flange_tool.copy()
    T[:3, 3] = share @ points
    apart = np.sqrt(share)[:, None] * ((points - T[:3, 3]) @ T[:3, :3])
    return T, np.vstack([*(m.scale * m.places[number] for m in members), apart])


def _renew_parameters(
    average: Belief, members: Sequence[_Member], width: Mapping[str, object]
) -> CalibratedModel:
    """The model of the average with the summary of its first member, what changed in it renewed."""
    model = members[0].model
    known = model.training_summary().parameters or {}
    sd = np.sqrt(average.variance[: len(known)])
    noise = sum(m.weight * m.model.white**2 for m in members)
    parameters = describe_parameters(
        known, average.errors[: len(known)], sd, [entry.kind for entry in known.values()]
    )
    summary = {
        **model.summary,
        **width,
        "parameters": parameters,
        "white_sd_m": float(np.sqrt(noise)),
    }
    return model_of(average, summary)
