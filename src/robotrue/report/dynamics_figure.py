"""Figures of the dynamic error: the response and its coherence, a force and what it does."""

from __future__ import annotations

import io
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from robotrue.core.arrays import Array
from robotrue.core.provenance import mark_title, merge, simulation_mark
from robotrue.core.units import UM
from robotrue.dynamics.frf import AXES, FrequencyResponse
from robotrue.dynamics.interpolation import ResponseCurve
from robotrue.dynamics.predict import DeflectionPrediction
from robotrue.errors import ConfigurationError

_FORMATS: Final = (".png", ".svg", ".pdf")
_COLOURS: Final = {"x": "#1f6feb", "y": "#d1662b", "z": "#2f8f5b"}
_POINTS: Final = 4000
"""Samples drawn at most; longer records are drawn as the envelope of as many spans."""


def response_figure(
    frf: FrequencyResponse, suffix: str, curve: ResponseCurve | None = None
) -> bytes:
    """Returns size, phase and, where measured, coherence of all pairs as a picture.

    Args:
        frf: The response.
        suffix: ``.png``, ``.svg`` or ``.pdf``.
        curve: Also what is used between the lines.

    Raises:
        ConfigurationError: Another suffix.
    """
    rows = 2 if frf.coherence is None else 3
    figure = Figure(figsize=(9.0, 2.6 * rows), layout="constrained")
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    _response(frf, axes[0], axes[1], None if rows == 2 else axes[2], curve)
    axes[-1].set_xlabel("frequency, Hz")
    title = f"Receptance of the tool ({frf.source.rsplit('/', 1)[-1]})"
    figure.suptitle(mark_title(title, frf.provenance), x=0.01, ha="left")
    return _picture(figure, suffix)


def prediction_figure(curve: ResponseCurve, found: DeflectionPrediction, suffix: str) -> bytes:
    """Returns response, force and predicted error as a picture.

    Raises:
        ConfigurationError: Another suffix than ``.png``, ``.svg`` or ``.pdf``.
    """
    figure = Figure(figsize=(9.0, 9.5), layout="constrained")
    mark = simulation_mark(merge([curve.frf.provenance, found.record.provenance]))
    if mark:
        figure.suptitle(mark, x=0.01, ha="left")
    top, middle, bottom, begin = figure.subplots(4, 1)
    _response(curve.frf, top, None, None, curve)
    top.set_xlabel("frequency, Hz")
    time = found.record.time
    for k, axis in enumerate(AXES):
        _along(middle, time, found.record.force[:, k], axis)
        if np.isfinite(found.error[:, k]).all():
            _along(bottom, time, found.error[:, k] / UM, axis)
    middle.set_ylabel("force, N")
    bottom.set_ylabel("error, um")
    _beginning(begin, found)
    for ax in (middle, bottom):
        ax.legend(loc="upper right", ncols=3)
    begin.set_xlabel("time, s")
    return _picture(figure, suffix)


def _response(
    frf: FrequencyResponse,
    size: Axes,
    phase: Axes | None,
    coherence: Axes | None,
    curve: ResponseCurve | None,
) -> None:
    low, high = frf.valid
    first = float(frf.frequency[frf.frequency > 0.0][0])
    ends = max(0.5 * low, first), min(1.3 * high, float(frf.frequency[-1]))
    shown = (frf.frequency >= ends[0]) & (frf.frequency <= ends[1])
    for pair in frf.pairs:
        i, j = frf.index(pair)
        lines, values = frf.frequency[shown], frf.response[shown, i, j]
        direct = pair[0] == pair[1]
        look = "-" if direct else ":"
        width = 1.2 if direct else 0.7
        size.loglog(lines, np.abs(values) / UM, look, label=pair, color=_COLOURS[pair[0]], lw=width)
        if phase is not None and direct:
            phase.semilogx(
                lines, np.degrees(np.angle(values)), ".", color=_COLOURS[pair[0]], ms=1.5
            )
        if coherence is not None and frf.coherence is not None and direct:
            coherence.semilogx(lines, frf.coherence[shown, i, j], color=_COLOURS[pair[0]], lw=0.8)
    if curve is not None and curve.modes is not None:
        grid = np.geomspace(max(low, first), high, 2000)
        for k, pair in enumerate(frf.pairs):
            i, j = frf.index(pair)
            between = np.abs(curve.at(grid)[:, i, j]) / UM
            label = "modes" if k == 0 else None
            size.loglog(grid, between, color="#222222", lw=0.5, label=label)
    for ax in (size, phase, coherence):
        if ax is not None:
            ax.set_xlim(*ends)
            for outside in ((ends[0], low), (high, ends[1])):
                if outside[0] < outside[1]:
                    ax.axvspan(*outside, color="#999999", alpha=0.25, lw=0)
            ax.grid(True, which="major", lw=0.4)
    size.set_ylabel("um/N")
    size.legend(loc="lower left", ncols=4, fontsize="small")
    if phase is not None:
        phase.set_ylabel("phase, deg")
        phase.set_yticks([-180, -90, 0, 90, 180])
    if coherence is not None:
        coherence.set_ylabel("coherence")
        coherence.set_ylim(0.0, 1.05)


def _along(ax: Axes, time: Array, values: Array, axis: str) -> None:
    if len(values) <= _POINTS:
        ax.plot(time, values, color=_COLOURS[axis], lw=0.8, label=axis)
    else:
        edge = np.linspace(0, len(values), _POINTS // 2, endpoint=False).astype(np.int64)
        low, high = np.minimum.reduceat(values, edge), np.maximum.reduceat(values, edge)
        ax.fill_between(time[edge], low, high, color=_COLOURS[axis], lw=0.0, alpha=0.7, label=axis)
    ax.grid(True, lw=0.4)


def _beginning(ax: Axes, found: DeflectionPrediction) -> None:
    """The first part of the record, padded and circular: what leaving out the zeros costs."""
    last = min(len(found.error), max(16, round(0.5 * found.rings * found.record.rate)))
    moved = np.nan_to_num(np.abs(found.circular - found.error)[:last]).max(axis=0)
    k = int(np.argmax(moved))
    time = found.record.time[:last]
    ax.plot(
        time, found.circular[:last, k] / UM, color="#999999", lw=0.8, label="circular, as printed"
    )
    ax.plot(time, found.error[:last, k] / UM, color=_COLOURS[AXES[k]], lw=0.9, label="with padding")
    ax.set_ylabel(f"error {AXES[k]}, um")
    ax.legend(loc="upper right", ncols=2)
    ax.grid(True, lw=0.4)


def _picture(figure: Figure, suffix: str) -> bytes:
    if suffix.lower() not in _FORMATS:
        raise ConfigurationError(
            f"picture of suffix {suffix!r}, expected one of {', '.join(_FORMATS)}."
        )
    out = io.BytesIO()
    figure.savefig(out, format=suffix.lower()[1:], dpi=130)
    return out.getvalue()
