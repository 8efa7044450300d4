"""Rotary table next to a calibrated arm: a separate block in the posterior of the model.

    y = (1 + motion(e; v)) M(e) p + noise        v ~ prior,   p: where each point is on the table

Rows are taken to base through the tracker frames that the model has. Errors of the arm are stated
in that same base, so the uncertainty of those frames moves arm and table together, and the two
blocks are independent. Scales of the harmonics and noise maximise the evidence; a factor on the
covariance comes from readings at held-out angles.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.calibrated_model import CalibratedModel, Reflector, model_of
from robotrue.calibration.evidence import (
    PriorGroup,
    Sums,
    Weights,
    posterior,
    spread,
    sums_of,
)
from robotrue.calibration.model import history, merged_document, model_hash
from robotrue.calibration.observations import station_poses
from robotrue.calibration.scale_learning import find_scales
from robotrue.calibration.table_axes import choose_axes, require_small
from robotrue.calibration.terms.rotary_table import RotaryTable
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import apply, inverse
from robotrue.core.robust import consistency, weights
from robotrue.core.rotations import skew
from robotrue.core.units import DEG, MM
from robotrue.errors import ImplausibleDataError, ObservabilityError
from robotrue.measurement.table_set import TableSet
from robotrue.program.external_axes import ExternalAxis, move_frames

FEWEST_ANGLES: Final = 5
LEAST_SPAN: Final = 60.0 * DEG
FEWEST_POINTS: Final = 3
LEAST_WIDTH: Final = 0.05
"""m, of the points across their line; nearer to it they do not show a turn about it."""
SAME_ANGLE: Final = 0.01 * DEG
PLACE_SD: Final = 0.1
"""m, of a point about its mean place on the table."""
IMPLAUSIBLE: Final = 0.02
"""m, median distance from a circle about the stated axis."""
ROUNDS: Final = 6
"""Of weights, and of the places of the points."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rows:
    """Readings in base.

    Attributes:
        term: The table.
        T: (n, 4, 4) stated motion of each reading.
        position: (n, 3) m.
        whiten: (n, 3, 3) inverse Cholesky factor of the instrument's covariance.
        external: (n, 6) rad.
        point: (n,) numbers.
        block: (n,) number of the setting of the table.
    """

    term: RotaryTable
    T: Array
    position: Array
    whiten: Array
    external: Array
    point: IntArray
    block: IntArray

    def places(self, kept: BoolArray) -> Array:
        """Returns the mean place (p, 3) m of every point on the table; NaN where none is kept."""
        on_table = apply(inverse(self.T), self.position)
        out = np.full((int(self.point.max()) + 1, 3), np.nan)
        for k in np.unique(self.point[kept]).tolist():
            out[k] = on_table[kept & (self.point == k)].mean(axis=0)
        return out

    def linear(self, place: Array) -> tuple[Array, Array]:
        """Returns columns (n, 3, k + 3 p) and values (n, 3), whitened, about places (p, 3) m."""
        stated = apply(self.T, place[self.point])
        by_point = np.concatenate([np.tile(np.eye(3), (len(stated), 1, 1)), -skew(stated)], axis=2)
        moved = by_point @ self.term.twists(self.external)
        at = np.zeros((len(stated), 3, len(place), 3))
        at[np.arange(len(stated)), :, self.point] = self.T[:, :3, :3]
        columns = np.concatenate([moved, at.reshape(len(stated), 3, -1)], axis=2)
        values = (self.position - stated)[:, :, None]
        return self.whiten @ columns, (self.whiten @ values)[:, :, 0]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fit:
    """A solved table.

    Attributes:
        term: With its scatter.
        fit: Posterior over parameters and places.
        weight: (n,) of the readings.
        before: m, mean error of readings at angles left out, by the stated axis.
        after: m, the same by the fit of the others.
        factor: On the covariance.
        settings: Number of settings of the table in the readings.
    """

    term: RotaryTable
    fit: Weights
    weight: Array
    before: float
    after: float
    factor: float
    settings: int


def calibrate_table(
    model: CalibratedModel, rows: TableSet, axes: Sequence[ExternalAxis]
) -> CalibratedModel:
    """Returns the model with the errors of the table; those of the arm stay as they are.

    Args:
        model: Of the arm, in the tracker set-ups of the rows or in base.
        rows: Points on the table at several angles.
        axes: External axes of the cell, from the floor up.

    Raises:
        ConfigurationError: An axis that is not described, or is no rotary one; a rail.
        ObservabilityError: Too few angles or points.
        ImplausibleDataError: Points that do not turn about the stated axis.
        ModelMismatchError: A tracker set-up that the model does not know.
    """
    used = choose_axes(model, rows, axes)
    term = RotaryTable(
        axes=used,
        low=np.array([rows.external[:, axis.number - 1].min() for axis in used]),
        high=np.array([rows.external[:, axis.number - 1].max() for axis in used]),
    )
    readings = _in_base(model, rows, term)
    _require_shown(rows, readings)
    solved = _solve(readings)
    require_small(solved.term, solved.fit.mean[: solved.term.size])
    return _join(model, rows, solved)


def _in_base(model: CalibratedModel, rows: TableSet, term: RotaryTable) -> _Rows:
    position, covariance = rows.position, rows.covariance
    if rows.frame == "tracker":
        T = inverse(station_poses(rows.station, model.T_tracker_base))
        turn = T[:, :3, :3]
        position, covariance = apply(T, position), turn @ covariance @ np.swapaxes(turn, 1, 2)
    moved = np.tile(np.eye(4), (len(rows), 1, 1))
    for axis in reversed(term.axes):  # the axis nearest to the part moves it first
        move_frames(moved, axis, rows.external[:, axis.number - 1])
    angles = rows.external[:, [axis.number - 1 for axis in term.axes]]
    _, block = np.unique(np.round(angles / SAME_ANGLE), axis=0, return_inverse=True)
    return _Rows(
        term=term,
        T=moved,
        position=position,
        whiten=np.linalg.inv(np.linalg.cholesky(covariance)),
        external=rows.external,
        point=rows.point,
        block=block.reshape(-1).astype(np.int64),
    )


def _require_shown(rows: TableSet, readings: _Rows) -> None:
    """Refuses readings that do not show the errors of the table."""
    for axis in readings.term.axes:
        angle = readings.external[:, axis.number - 1]
        count, span = len(np.unique(np.round(angle / SAME_ANGLE))), float(np.ptp(angle))
        if count < FEWEST_ANGLES or span < LEAST_SPAN:
            raise ObservabilityError(
                f"the points were measured at {count} angles of E{axis.number} over "
                f"{span / DEG:.1f} deg; at least {FEWEST_ANGLES} over {LEAST_SPAN / DEG:.0f} deg "
                "are needed.",
                source=rows.source or None,
                hint="measure them at 8 to 12 angles, evenly over the range that programs use.",
            )
    place = readings.places(np.ones(len(rows), dtype=np.bool_))
    off = readings.position - apply(readings.T, place[rows.point])
    typical = float(np.median(np.linalg.norm(off, axis=1)))
    if typical > IMPLAUSIBLE:
        raise ImplausibleDataError(
            f"the points are {typical / MM:.1f} mm (median) off circles about the stated axis; at "
            f"most {IMPLAUSIBLE / MM:.0f} mm are plausible.",
            source=rows.source or None,
            hint="check about, its sign, through_mm and the station of the tracker.",
        )
    seen = [k for k in range(len(place)) if len(np.unique(readings.block[rows.point == k])) > 1]
    width = 0.0
    if len(seen) >= FEWEST_POINTS:
        centred = place[seen] - place[seen].mean(axis=0)
        width = float(np.linalg.svd(centred, compute_uv=False)[1] / np.sqrt(len(seen)))
    if width < LEAST_WIDTH:
        raise ObservabilityError(
            f"{len(seen)} points were measured at several angles, {width / MM:.0f} mm wide across "
            f"their line; at least {FEWEST_POINTS} points and {LEAST_WIDTH / MM:.0f} mm are "
            "needed.",
            source=rows.source or None,
            hint="measure 4 points near the rim of the table, one of them at another height.",
        )


def _solve(rows: _Rows) -> _Fit:
    """Returns the posterior of greatest evidence, and its check by held-out readings."""
    kept = np.ones(len(rows.point), dtype=np.bool_)
    place, size = rows.places(kept), rows.term.size
    seen = np.flatnonzero(np.isfinite(place[:, 0]))
    place = np.where(np.isfinite(place), place, 0.0)
    order = size + (3 * seen[:, None] + np.arange(3)).ravel()
    groups: list[PriorGroup] = [*rows.term.groups(few=False)]
    groups.append(PriorGroup(name="places", columns=order, sd=PLACE_SD))
    weight, noise = np.ones(len(kept)), np.ones(1)
    for _ in range(ROUNDS):
        columns, values = rows.linear(place)
        fit = find_scales([_sums(columns, values, weight)], groups, noise, steps=40).with_root()
        groups, noise = list(fit.groups), fit.noise
        left = np.linalg.norm(values - columns @ fit.mean, axis=1) / np.sqrt(noise[0])
        weight = weights(left, 3, "huber")
        place = place + fit.mean[size:].reshape(-1, 3)
    columns, values = rows.linear(place)
    whole = _sums(columns, values, weight)
    fit = posterior([whole], groups, noise)
    fit = fit.with_root() if fit.few is not None else fit
    before, after, factor = _predict_left_out(rows, columns, values, weight, whole, fit)
    beyond = max(float(fit.noise[0]) - 1.0, 0.0) / np.mean(
        np.einsum("nij,nij->n", rows.whiten, rows.whiten) / 3.0
    )
    term = replace(rows.term, scatter=float(np.sqrt(beyond)))
    return _Fit(
        term=term,
        fit=fit,
        weight=weight,
        before=before,
        after=after,
        factor=factor,
        settings=int(rows.block.max()) + 1,
    )


def _sums(columns: Array, values: Array, weight: Array) -> Sums:
    root = np.sqrt(weight)[:, None]
    count = 3.0 * consistency(3, "huber") * float((weight > 0.0).sum())
    flat = (columns * root[:, :, None]).reshape(-1, columns.shape[2])
    sums = sums_of([(flat, (values * root).ravel(), count)], columns.shape[2])
    return replace(sums, least=1.0)


def _predict_left_out(
    rows: _Rows, columns: Array, values: Array, weight: Array, whole: Sums, fit: Weights
) -> tuple[float, float, float]:
    """Returns mean errors (m) of readings at settings left out, stated and fitted, and the factor.

    The places of their points come from the other settings.
    """
    before, after, squares = [], [], []
    for block in range(int(rows.block.max()) + 1):
        mine = rows.block == block
        others = ~mine & (weight > 0.0)
        mine = mine & (weight > 0.0) & np.isin(rows.point, rows.point[others])
        if not mine.any():
            continue
        part = _sums(columns[mine], values[mine], weight[mine])
        left = posterior([whole.without(part)], fit.groups, fit.noise)
        off = values[mine] - columns[mine] @ left.mean
        total = spread(left.root, columns[mine]) + fit.noise[0] * np.eye(3)
        squares.append(np.einsum("ni,ni->n", off, np.linalg.solve(total, off[:, :, None])[:, :, 0]))
        lengths = np.linalg.solve(rows.whiten[mine], off[:, :, None])[:, :, 0]
        after.append(np.linalg.norm(lengths, axis=1))
        stated = apply(rows.T[mine], rows.places(others)[rows.point[mine]])
        before.append(np.linalg.norm(rows.position[mine] - stated, axis=1))
    mean, fitted, square = (float(np.concatenate(e).mean()) for e in (before, after, squares))
    return mean, fitted, max(square / 3.0, 1.0)


def _join(model: CalibratedModel, rows: TableSet, solved: _Fit) -> CalibratedModel:
    """Returns the model with the table as last term, in place of one that it had."""
    belief, size = model.belief(), solved.term.size
    old = belief.place(RotaryTable.name)
    mean = np.delete(belief.mean, np.arange(old.start, old.stop))
    root = np.delete(belief.root, np.arange(old.start, old.stop), axis=1)
    block = solved.fit.root[:, :size] * np.sqrt(solved.factor / model.inflation)
    whole = np.zeros((len(root) + len(block), len(mean) + size))
    whole[: len(root), : len(mean)], whole[len(root) :, len(mean) :] = root, block
    terms = tuple(term for term in belief.terms if not isinstance(term, RotaryTable))
    joined = model_of(
        replace(
            belief,
            terms=(*terms, solved.term),
            mean=np.concatenate([mean, solved.fit.mean[:size]]),
            root=whole,
        ),
        _summary(model, rows, solved),
        compact=False,
    )
    said = (
        f"table, points at angles that the fit left out: {solved.before / MM:.3f} mm off in the "
        f"mean about the stated axes, {solved.after / MM:.3f} mm with its errors learned"
    )
    summary = {**joined.summary, "terms": [*joined.training_summary().terms, said]}
    return replace(
        joined,
        held_out=model.held_out,
        summary=summary,
        reflectors={k: _longer(each, len(block)) for k, each in model.reflectors.items()},
    )


def _longer(reflector: Reflector, more: int) -> Reflector:
    if reflector.root is None:
        return reflector
    return replace(reflector, root=np.vstack([reflector.root, np.zeros((more, 3))]))


def _summary(model: CalibratedModel, rows: TableSet, solved: _Fit) -> Mapping[str, object]:
    """Returns the summary of the model with the table's rows, its check and its warnings."""
    known = model.training_summary()
    screened = np.flatnonzero(solved.weight == 0.0)
    doubts = list(known.warnings)
    if len(screened):
        doubts.append(
            f"{len(screened)} of {len(rows)} readings of the table carry no weight (line "
            f"{int(rows.lines[screened[0]])} first)."
        )
    step = {
        "step": "table",
        "parents_sha256": [model_hash(model)],
        "rows": len(rows),
        "data_sha256": "",
        "sources": [rows.source] if rows.source else [],
        "screened_rows": screened.tolist(),
        "settings": {},
    }
    table = {
        "rows": len(rows),
        "points": len(rows.names),
        "settings": solved.settings,
        "held_out_before_m": solved.before,
        "held_out_after_m": solved.after,
        "covariance_factor": solved.factor,
    }
    return {
        **known,
        "doubts": doubts,
        "table": table,
        "lineage": [*history(model), step],
        "provenance": merged_document([model], rows.provenance),
    }
