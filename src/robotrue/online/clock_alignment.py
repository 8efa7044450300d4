"""Offset of the force clock from the joint clock, estimated from a jog that both recorded.

A tool held in the sensor is weighed: as the wrist turns, gravity turns in the sensor's axes, and
the mass resists where it is accelerated. Both are smooth functions of the joints::

    F(t) = A c(q(t - d)) + B q''(t - d) + noise

with c the products of cosines and sines of the joints that moved, of which every rotation is made,
and A, B unknown, so neither mass nor mounting nor arm has to be known. The shift d is the one at
which the joints explain the force best: a cross-correlation over all channels at once. It is
searched for over the whole range, then refined together with its drift by Gauss-Newton. Joints are
interpolated, never held: holding would add half of their interval.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.files import read_bytes, sha256, write_atomic
from robotrue.core.units import DEG
from robotrue.errors import (
    ArchiveError,
    ConfigurationError,
    FormatError,
    ImplausibleDataError,
    ObservabilityError,
)
from robotrue.online.sensing_chain import StreamShift

MOST: Final = 1.0
"""s searched to either side."""
WORST: Final = 5e-3
"""s, standard deviation beyond which a jog has shown too little."""
LEAST_TURN: Final = 1.0 * DEG
"""A joint that moves less does not determine the alignment."""
SMOOTH: Final = 0.02
"""s, standard deviation of the bell that both streams are smoothed by, alike."""
RIVAL: Final = (0.7, 1.5)
"""A rival explains as well if it explains this share of what the best does, and leaves less than so
many times what the best leaves."""
_WHOLE: Final = 3
"""Joints up to which all products are taken; of more, those of two."""
_RANK: Final = 1e-6
"""Directions of the joints' functions that are this much weaker than the first are left out."""
_WIDER: Final = 2.0
"""Errors scatter by this factor more than the force noise predicts: the joints have noise and
jitter, too. Determined on simulated jogs, where the true offset is known."""
_MODEL: Final = 0.15e-3
"""s, what is left of the inertia that no function here has; found likewise, 18.5 kg at 0.35 m."""
_SETTLED: Final = 1e-7
"""s; a step shorter than this ends the refinement."""
_COARSE: Final = 4
"""Of the grid's samples, every how-many-eth is searched with; shifts likewise."""
_GRID: Final = 200.0
"""Samples per second of the search."""
_LONG: Final = 10.0
"""s; a drift is estimated where jogs lie farther apart."""
_PACE: Final = 100e-6
"""Drift of a quartz against another, one standard deviation before the jog."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockAlignment:
    """Correction that converts force times to joint times.

    Attributes:
        offset: s at ``at``.
        offset_sd: s, standard deviation.
        drift: s/s, by which the offset grows; 0 where the jogs are too near to each other.
        drift_sd: s/s.
        at: s, time of the force.
        explained: Share of the force's variance that the joints explain.
        rival: Share that the best shift elsewhere explains.
        moved: s of the jog in which joints moved.
    """

    offset: float
    offset_sd: float
    drift: float
    drift_sd: float
    at: float
    explained: float
    rival: float
    moved: float


def align_streams(
    joint_time: Array,
    joints: Array,
    force_time: Array,
    force: Array,
    *,
    most: float = MOST,
    worst: float = WORST,
) -> ClockAlignment:
    """Returns the shift between two streams that recorded one jog.

    Args:
        joint_time: (n,) s, rising.
        joints: (n, dof) rad, finite.
        force_time: (m,) s, rising.
        force: (m, k) forces, or forces and moments, each channel in any unit.
        most: s to search to either side.
        worst: s, the standard deviation up to which the result is given.

    Raises:
        ImplausibleDataError: Times that fall, values that are not finite, records that do not
            overlap.
        ObservabilityError: Too little moved, the force does not follow it, or two shifts explain
            it about as well.

    Fails when: the jog repeats itself with a period shorter than ``most``, or the tool weighs
    nothing against the noise.
    """
    _check(joint_time, joints, "joints")
    _check(force_time, force, "force")
    moves = np.ptp(joints, axis=0) >= LEAST_TURN
    if not moves.any():
        raise ObservabilityError(
            f"no joint turns by {LEAST_TURN / DEG:g} deg or more; the largest turns by "
            f"{np.ptp(joints, axis=0).max() / DEG:.2g} deg.",
            hint="jog joints 4 to 6 by 20 deg or more, there and back, unevenly.",
        )
    begin = max(joint_time[0], force_time[0]) + most + 4.0 * SMOOTH
    end = min(joint_time[-1], force_time[-1]) - most - 4.0 * SMOOTH
    if end - begin < 1.0:
        raise ImplausibleDataError(
            f"the streams have {max(0.0, end - begin):.3g} s in common that can be shifted by "
            f"{most:g} s, expected 1 s or more.",
            hint="record for longer, or both on one clock; --most-s for a narrower search.",
        )
    grid = np.arange(begin, end, 1.0 / _GRID)
    seen = _smooth(force_time, force, grid)
    seen = seen - seen.mean(axis=0)
    seen /= np.maximum(seen.std(axis=0), 1e-300)
    track = _Track(joint_time, joints[:, moves], begin - most, end + most)
    return _refine_fit(grid, seen, track, *_search_shift(grid, seen, track, most), worst=worst)


class _Track:
    """Functions of the smoothed joints at any time, from an even grid."""

    def __init__(self, time: Array, joints: Array, begin: float, end: float) -> None:
        self.step = 1.0 / _GRID
        self.begin = begin - 2.0 * self.step
        count = int(np.ceil((end - begin) / self.step)) + 6
        grid: Array = self.begin + self.step * np.arange(count, dtype=np.float64)
        values = _smooth(time, joints, grid)
        bend = np.gradient(np.gradient(values, self.step, axis=0), self.step, axis=0)
        own = np.hstack([_products(values), bend])
        own = own - own.mean(axis=0)
        own /= np.maximum(own.std(axis=0), 1e-300)
        left, size, _ = np.linalg.svd(own, full_matrices=False)
        self.values: Array = left[:, size > _RANK * size[0]] * np.sqrt(count)

    def near(self, time: Array) -> Array:
        """Returns functions (n, k) at the points of the grid next to some times."""
        place = np.round((time - self.begin) / self.step).astype(np.int64)
        return np.asarray(self.values[np.clip(place, 0, len(self.values) - 1)])

    def at(self, time: Array) -> tuple[Array, Array]:
        """Returns functions (n, k) and their derivatives by time, by the cubic through four."""
        place = (time - self.begin) / self.step
        k = np.clip(np.floor(place).astype(np.int64), 1, len(self.values) - 3)
        u = (place - k)[:, None]
        p0, p1, p2, p3 = (self.values[k + i] for i in (-1, 0, 1, 2))
        a = 0.5 * (p3 - p0) + 1.5 * (p1 - p2)
        b = p0 - 2.5 * p1 + 2.0 * p2 - 0.5 * p3
        c = 0.5 * (p2 - p0)
        return ((a * u + b) * u + c) * u + p1, ((3.0 * a * u + 2.0 * b) * u + c) / self.step


def _products(joints: Array) -> Array:
    """Returns the products of cosines and sines, one factor of each joint at most."""
    n, dof = joints.shape
    single = [np.stack([np.cos(q), np.sin(q)], axis=1) for q in joints.T]
    if dof <= _WHOLE:
        found = np.ones((n, 1))
        for pair in single:
            both = found[:, :, None] * np.hstack([np.ones((n, 1)), pair])[:, None, :]
            found = both.reshape(n, -1)
        return found[:, 1:]
    pairs = [
        (single[i][:, :, None] * single[j][:, None, :]).reshape(n, 4)
        for i in range(dof)
        for j in range(i)
    ]
    return np.hstack([*single, *pairs])


def _search_shift(grid: Array, seen: Array, track: _Track, most: float) -> tuple[float, float]:
    """Returns the best shift on a coarse grid, and what its best rival explains."""
    thin = slice(None, None, _COARSE)
    reach = int(np.floor(most * _GRID / _COARSE))
    shifts = np.arange(-reach, reach + 1.0) * _COARSE / _GRID
    share = np.array([_explained_share(seen[thin], track.near(grid[thin] + s)) for s in shifts])
    best = int(np.argmax(share))
    if best in (0, len(share) - 1):
        raise ObservabilityError(
            f"the joints explain the force best at the edge of the search, {shifts[best]:+.3f} s.",
            hint="--most-s for a wider search, or a jog with more motion.",
        )
    # the peak goes down to either side; what rises again behind is a rival
    low, high = best, best
    while low > 0 and share[low - 1] <= share[low]:
        low -= 1
    while high < len(share) - 1 and share[high + 1] <= share[high]:
        high += 1
    others = np.where((np.arange(len(share)) < low) | (np.arange(len(share)) > high), share, -1.0)
    other = int(np.argmax(others))
    rival = max(0.0, float(others[other]))
    if rival > RIVAL[0] * share[best] and 1.0 - rival < RIVAL[1] * (1.0 - share[best]):
        raise ObservabilityError(
            f"two shifts explain the force equally well: {shifts[best]:+.3f} s "
            f"({100 * share[best]:.1f} %) and {shifts[other]:+.3f} s ({100 * rival:.1f} %).",
            hint="jog unevenly: one swing long, one short, with a stop between.",
        )
    return float(shifts[best]), rival


def _refine_fit(
    grid: Array, seen: Array, track: _Track, shift: float, rival: float, *, worst: float
) -> ClockAlignment:  # fmt: skip
    """Gauss-Newton on shift and drift, the way F follows q solved along with it."""
    speed = np.abs(np.diff(track.at(grid + shift)[0], axis=0, append=np.nan)).max(axis=1)
    moving = speed > 0.05 * np.nanmax(speed)
    at = float(grid[moving].mean())
    apart = float(np.ptp(grid[moving]))
    scale = grid - at
    drifts = apart >= _LONG
    step, drift = np.full(2, np.inf), 0.0
    slope = np.empty((len(grid), seen.shape[1]))
    for _ in range(20):
        value, rate = track.at(grid + shift + drift * scale)
        full = np.hstack([np.ones((len(grid), 1)), value])
        basis, upper = np.linalg.qr(full)
        gain = np.linalg.solve(upper, basis.T @ seen)
        rest = seen - full @ gain
        slope = rate @ gain[1:]
        # what the other unknowns could do instead is no evidence of a shift
        columns = [slope, slope * scale[:, None]] if drifts else [slope]
        free = np.stack([c - basis @ (basis.T @ c) for c in columns])
        weight = 1.0 / np.maximum((rest**2).mean(axis=0), 1e-12)
        normal = np.einsum("aij,bij,j->ab", free, free, weight)
        if drifts:
            normal[1, 1] += _PACE**-2
        right = np.einsum("aij,ij,j->a", free, rest, weight)
        right[1:] -= drift * _PACE**-2
        step = np.linalg.solve(normal, right)
        shift += float(step[0])
        drift += float(step[1]) if drifts else 0.0
        if np.abs(step[0]) < _SETTLED:
            break
    sd = _deviation(normal, free, rest, weight)
    explained = _explained_share(seen, track.at(grid + shift + drift * scale)[0])
    if not sd[0] <= worst:
        raise ObservabilityError(
            f"the jog shows the shift to {1e3 * sd[0]:.2g} ms only, expected {1e3 * worst:.2g} ms "
            f"or better; the joints explain {100 * explained:.1f} % of the force.",
            hint="a heavier tool, larger and faster swings, or a longer jog.",
        )
    return ClockAlignment(
        offset=shift,
        offset_sd=float(sd[0]),
        drift=drift,
        drift_sd=float(sd[1]) if drifts else _PACE,
        at=at,
        explained=explained,
        rival=rival,
        moved=float(moving.sum() / _GRID),
    )


def _deviation(normal: Array, free: Array, rest: Array, weight: Array) -> Array:
    """Standard deviations, for residuals whose samples are not independent of their neighbours."""
    score = np.einsum("aij,ij,j->ai", free, rest, weight)
    n, lags = len(rest), min(len(rest) // 4, int(0.5 * _GRID))
    middle = score @ score.T
    for lag in range(1, lags):
        joint = score[:, lag:] @ score[:, :-lag].T
        middle += (1.0 - lag / lags) * (joint + joint.T)
    inverse = np.linalg.inv(normal)
    covariance = inverse @ middle @ inverse
    lost = n / max(1, n - free.shape[0])
    # never below what independent samples would give
    sd = np.sqrt(np.maximum(np.diag(covariance) * lost, np.diag(inverse)))
    sd = _WIDER * sd
    sd[0] = np.hypot(sd[0], _MODEL)
    return np.asarray(sd)


def _explained_share(seen: Array, value: Array) -> float:
    """Share of the variance of (n, k) that functions (n, j) of the joints explain."""
    basis = np.linalg.qr(value - value.mean(axis=0))[0]
    centred = seen - seen.mean(axis=0)
    return float(((basis.T @ centred) ** 2).sum() / (centred**2).sum())


def _smooth(time: Array, values: Array, grid: Array) -> Array:
    """Values (n, k) at the times of an even grid, smoothed by a bell that shifts nothing."""
    fine = 1.0 / max(_GRID, 5.0 / SMOOTH)
    begin = grid[0] - 4.0 * SMOOTH
    count = int(np.ceil((grid[-1] + 4.0 * SMOOTH - begin) / fine)) + 1
    # mean of each cell, so that no sample of a fast stream is left out
    even = begin + fine * np.arange(count)
    edges = np.append(even - 0.5 * fine, even[-1] + 0.5 * fine)
    area = np.vstack(
        [
            np.zeros((1, values.shape[1])),
            np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time)[:, None], axis=0),
        ]
    )
    half = int(np.ceil(4.0 * SMOOTH / fine))
    bell = np.exp(-0.5 * (np.arange(-half, half + 1) * fine / SMOOTH) ** 2)
    bell /= bell.sum()
    out = np.empty((len(grid), values.shape[1]))
    for k in range(values.shape[1]):
        cells = np.diff(_integral(time, values[:, k], area[:, k], edges)) / fine
        padded = np.pad(cells, half, mode="edge")
        out[:, k] = np.interp(grid, even, np.convolve(padded, bell, mode="valid"))
    return out


def _integral(time: Array, values: Array, area: Array, at: Array) -> Array:
    """Integral of the straight lines through samples up to some times; level beyond the ends."""
    inside = np.clip(at, time[0], time[-1])
    k = np.clip(np.searchsorted(time, inside, side="right") - 1, 0, len(time) - 2)
    width, u = time[k + 1] - time[k], inside - time[k]
    slope = np.where(width > 0.0, (values[k + 1] - values[k]) / np.where(width > 0.0, width, 1), 0)
    found = area[k] + (values[k] + 0.5 * slope * u) * u
    return np.asarray(
        found
        + np.minimum(at - time[0], 0.0) * values[0]
        + np.maximum(at - time[-1], 0.0) * values[-1]
    )


def _check(time: Array, values: Array, what: str) -> None:
    ends = time.ndim == 1 and len(time) == len(values) and len(time) >= 10
    if not ends or not np.isfinite(time).all() or not np.isfinite(values).all():
        raise ImplausibleDataError(
            f"{len(time)} samples of the {what}, expected ten or more finite ones.",
            hint="leave samples out that are marked invalid.",
        )
    falls: BoolArray = np.diff(time) < 0.0
    if falls.any():
        row = int(np.argmax(falls)) + 1
        raise ImplausibleDataError(
            f"time of the {what} goes from {time[row - 1]:.6f} to {time[row]:.6f} s at sample "
            f"{row}.",
            hint="leave samples out that came out of order.",
        )


KIND: Final = "robotrue-clock"
SCHEMA: Final = 1


def clock_document(
    found: ClockAlignment, *, host: bool, sources: dict[str, str]
) -> dict[str, object]:
    """Returns the content of a clock file.

    Args:
        found: The alignment.
        host: Both records have the host's times; else the recorders' own.
        sources: SHA-256 of the two records by role.
    """
    return {
        "kind": KIND,
        "schema": SCHEMA,
        "clock": "host" if host else "recorder",
        "offset_s": found.offset,
        "offset_sd_s": found.offset_sd,
        "drift_ppm": found.drift * 1e6,
        "drift_sd_ppm": found.drift_sd * 1e6,
        "at_s": found.at,
        "explained": found.explained,
        "rival": found.rival,
        "moved_s": found.moved,
        "sources": sources,
    }


def write_clock(path: str | Path, document: dict[str, object]) -> None:
    """Writes a clock file whole or not at all."""
    write_atomic(path, (json.dumps(document, indent=1, sort_keys=True) + "\n").encode())


def read_clock(path: str | Path, *, live: bool) -> tuple[StreamShift, str]:
    """Returns what to add to force times, and the file's SHA-256.

    Args:
        path: Of :func:`write_clock`.
        live: Whether the streams are live: the clocks of recorders are not theirs, and a drift
            of the host's times to themselves is none.

    Raises:
        FormatError: Cannot be read, or not a clock file.
        ArchiveError: Of a newer robotrue.
        ConfigurationError: Clocks of recorders, for live streams.
    """
    data = read_bytes(path)
    try:
        document = json.loads(data)
        kind, schema, clock = document["kind"], int(document["schema"]), document["clock"]
        numbers = [float(document[k]) for k in ("offset_s", "drift_ppm", "at_s")]
    except (ValueError, KeyError, TypeError) as cause:
        raise FormatError(f"not a clock file ({cause}).", source=path, hint="sense align") from None
    if kind != KIND:
        raise FormatError(f"not a clock file but {kind!r}.", source=path, hint="sense align")
    if schema > SCHEMA:
        raise ArchiveError(f"clock file schema {schema}, expected {SCHEMA}.", source=path)
    if live and clock != "host":
        raise ConfigurationError(
            "the clocks of two recorders, but the streams are live and have other clocks.",
            source=path,
            hint="record the jog with sense --record, export it, and align that.",
        )
    offset, drift, at = numbers
    drift = 0.0 if live else drift * 1e-6
    return StreamShift(offset=offset, drift=drift, at=at), sha256(data)
