"""Modes of a measured response: poles by LSCF, residues by LSFD, both then refined together.

Nothing is picked by hand: poles that recur at successive orders are used, those that do not improve
the fit are dropped, a mode with two directions at once is split in two, and the remaining ones are
refined by least squares on the poles with the residues solved at every step (variable projection).
Modes above the band contribute more than a constant: up to two poles beyond its end represent them
where the lines require it.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import least_squares

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.dynamics.frf import ComplexArray, FrequencyResponse
from robotrue.dynamics.modal import ModalModel
from robotrue.dynamics.modal_poles import (
    Curves,
    Residues,
    find_stable_poles,
    fit_residues,
    misfit_slopes,
)
from robotrue.errors import ObservabilityError

_FLOOR: Final = 0.1
"""Part of a curve's local size below which its lines (antiresonances) weigh no more."""
_WINDOW: Final = 9
_GRID: Final = 300
_NEAR: Final = 4.0
"""Half widths about a pole within which every line takes part in the polishing."""
_STATIC_LINES: Final = 1000.0
"""Lines that a static deflection weighs."""
_STEPS: Final = 30
_SPLITS: Final = 2
"""Modes at most that are tried as two."""
_BEYOND: Final = (1.1, 1.25, 1.6)
"""Where, over the end of the band, a mode beyond it is looked for first."""
_BEYOND_DAMPING: Final = 0.1
_MOST_BEYOND: Final = 2
_DRAGGED: Final = 0.02
"""Rms misfit, over the lines, from which poles beyond the band are looked for; they have to halve
it, which they cannot do to noise."""
_DAMPED: Final = 0.2
"""Damping beyond which a pole describes the background of the curve and not a mode."""


def fit_modes(frf: FrequencyResponse, *, lower: bool | None = None) -> ModalModel:
    """Returns the modes of a measured response.

    Args:
        frf: Measured response; its static deflection is included.
        lower: Whether a lower residual is fitted; default: where there is no static deflection
            and the lines demand it (by Schwarz's criterion).

    Raises:
        ObservabilityError: No pole recurs, or fewer than sixteen lines in the band.

    Fails when: two modes lie closer than a tenth of their width and the pairs do not separate them;
    or the spacing of the lines exceeds the width of a mode.
    """
    curves = _measured_curves(frf)
    poles = find_stable_poles(curves.frequency, curves.values, curves.weight)
    if not poles.size:
        raise ObservabilityError(
            "no pole comes back from one order to the next.",
            source=frf.source,
            hint="a cleaner or finer spectrum; without modes the lines themselves are used.",
        )
    allowed = curves.static is None and lower is not False
    poles = _select_poles(curves, poles, allowed)
    poles = _with_beyond(curves, _polish_poles(curves, poles, allowed), allowed)
    poles = _split(curves, _select_poles(curves, poles, allowed), allowed, frf.present)
    found = fit_residues(curves, poles, lower=allowed)
    if allowed and lower is None:
        without = fit_residues(curves, poles, lower=False)
        if _criterion(without, len(poles)) < _criterion(found, len(poles)):
            found = without
    return _model(frf, poles, found)


def _measured_curves(frf: FrequencyResponse) -> Curves:
    """Returns the lines of the band, measured pairs side by side, with their weights.

    A line weighs one over the local size of its curve, times its coherence's trust.

    Raises:
        ObservabilityError: Fewer than sixteen lines.
    """
    band = frf.in_band
    values = frf.response[band][:, frf.present]
    if len(values) < 16:
        raise ObservabilityError(
            f"{len(values)} lines in the band, sixteen are the least.", source=frf.source
        )
    size = np.abs(values)
    local = np.column_stack([median_filter(column, _WINDOW, mode="nearest") for column in size.T])
    weight = 1.0 / np.maximum(np.maximum(size, _FLOOR * local), 1e-3 * np.median(size, axis=0))
    if frf.coherence is not None:
        trust = frf.coherence[band][:, frf.present].clip(0.05, 0.999)
        weight *= np.sqrt(trust / (1.0 - trust)) / np.sqrt(0.999 / 0.001)
    static = heavy = None
    if frf.static is not None and np.isfinite(frf.static[frf.present]).any():
        known = np.isfinite(frf.static[frf.present])
        static = np.where(known, frf.static[frf.present], 0.0)
        least = 0.02 * np.abs(static).max()
        heavy = known * np.sqrt(_STATIC_LINES) / np.maximum(np.abs(static), least)
    return Curves(
        frequency=frf.frequency[band],
        values=values,
        weight=weight,
        static=static,
        static_weight=heavy,
    )


def _select_poles(curves: Curves, poles: ComplexArray, lower: bool) -> ComplexArray:
    """Poles without which the lines are described worse, by Schwarz's criterion."""
    sample = curves.take(_lines(curves.frequency, poles))
    best = _criterion(fit_residues(sample, poles, lower=lower), len(poles))
    while len(poles) > 1:
        trials = [
            _criterion(fit_residues(sample, np.delete(poles, k), lower=lower), len(poles) - 1)
            for k in range(len(poles))
        ]
        k = int(np.argmin(trials))
        if trials[k] > best:
            break
        best, poles = trials[k], np.delete(poles, k)
    return poles


def _polish_poles(curves: Curves, poles: ComplexArray, lower: bool) -> ComplexArray:
    """Poles of least squares on all pairs, residues solved at every step."""
    sample = curves.take(_lines(curves.frequency, poles))
    k = len(poles)
    start = np.concatenate([np.log(poles.imag), np.log(-poles.real)])

    def at(x: Array) -> tuple[ComplexArray, ComplexArray]:
        turn, loss = np.exp(x[:k]), np.exp(x[k:])
        moves = np.vstack([np.diag(1j * turn), np.diag(-loss + 0j)])
        return np.asarray(-loss + 1j * turn, dtype=np.complex128), moves

    def misfit(x: Array) -> Array:
        return np.asarray(fit_residues(sample, at(x)[0], lower=lower).misfit.ravel())

    def slopes(x: Array) -> Array:
        return misfit_slopes(sample, *at(x), lower=lower).reshape(-1, 2 * k)

    width = np.concatenate([-poles.real / poles.imag, np.full(k, 1.0)])
    reach = 1.5 * np.maximum(width, 0.01)
    solved = least_squares(
        misfit,
        start,
        jac=slopes,
        bounds=(start - reach, start + reach),
        x_scale=np.maximum(width, 1e-3),
        max_nfev=_STEPS,
    ).x
    polished = at(solved)[0]
    return np.asarray(polished[np.argsort(np.abs(polished))], dtype=np.complex128)


def _with_beyond(curves: Curves, poles: ComplexArray, lower: bool) -> ComplexArray:
    """Poles with those above the band without which its upper end drags the others along."""
    end = 2.0 * np.pi * curves.frequency[-1]
    for _ in range(_MOST_BEYOND):
        before = least = _mean(fit_residues(curves, poles, lower=lower))
        chosen = poles
        if before < _DRAGGED**2:
            break
        for place in _BEYOND:
            start = np.append(poles, place * end * (1j - _BEYOND_DAMPING))
            more = _polish_poles(curves, start, lower)
            found = _mean(fit_residues(curves, more, lower=lower))
            if found < least:
                least, chosen = found, more
        if least > before / 4.0:
            break
        poles = chosen
    return poles


def _split(curves: Curves, poles: ComplexArray, lower: bool, present: BoolArray) -> ComplexArray:
    """Poles with those divided that are two modes side by side.

    One mode moves the tool along one line, whatever pushes it: its residue matrix has rank one.
    """
    if min(present.shape) < 2 or not present.all():
        return poles
    matrices = fit_residues(curves, poles, lower=lower).residues.reshape(-1, *present.shape)
    size = np.linalg.svd(matrices, compute_uv=False)
    for p in poles[np.argsort(-size[:, 1] / size[:, 0])][:_SPLITS]:
        if -p.real / abs(p) > _DAMPED:
            continue
        k = int(np.argmin(np.abs(poles - p)))
        apart = 0.3j * -poles[k].real
        two = np.append(np.delete(poles, k), [poles[k] - apart, poles[k] + apart])
        two = _polish_poles(curves, two, lower)
        sample = curves.take(_lines(curves.frequency, two))
        before = _criterion(fit_residues(sample, poles, lower=lower), len(poles))
        if _criterion(fit_residues(sample, two, lower=lower), len(two)) < before:
            poles = two
    return poles


def _lines(frequency: Array, poles: ComplexArray) -> IntArray:
    """Rows that take part: all about the poles, and a logarithmic grid between them."""
    grid = np.geomspace(frequency[0], frequency[-1], _GRID)
    keep = np.zeros(len(frequency), dtype=np.bool_)
    keep[np.searchsorted(frequency, grid).clip(max=len(frequency) - 1)] = True
    for p in poles:
        centre, half = abs(p) / (2.0 * np.pi), -p.real / (2.0 * np.pi)
        near = np.flatnonzero(np.abs(frequency - centre) < _NEAR * half)
        keep[near[:: max(1, len(near) // 60)]] = True
    return np.asarray(np.flatnonzero(keep), dtype=np.int64)


def _mean(found: Residues) -> float:
    return float((found.misfit**2).mean() * 2.0)


def _criterion(found: Residues, poles: int) -> float:
    """Schwarz's criterion; a pole costs two numbers and two more in every pair."""
    n, pairs = found.misfit.shape
    lower = pairs if found.lower.any() else 0
    parameters = 2 * poles + pairs * (2 * poles + 1) + lower
    lines = float(n * pairs)
    size = float(np.log((found.misfit**2).mean() + 1e-24))
    return float(lines * size + parameters * np.log(lines))


def _model(frf: FrequencyResponse, poles: ComplexArray, found: Residues) -> ModalModel:
    r, e = frf.present.shape

    def spread(values: ComplexArray | Array) -> ComplexArray:
        out = np.zeros((*values.shape[:-1], r, e), dtype=np.complex128)
        out[..., frf.present] = values
        return out

    return ModalModel(
        poles=poles,
        residues=spread(found.residues),
        upper=spread(found.upper).real,
        lower=spread(found.lower).real,
        static=frf.static,
        response_axes=frf.response_axes,
        excitation_axes=frf.excitation_axes,
        valid=frf.valid,
        source=frf.source,
        provenance=frf.provenance,
    )
