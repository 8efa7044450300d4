"""The force of milling, mechanistic: over time, its mean over a turn, and along a path.

Each edge is cut into axial slices; a slice of height dz with chip h and edge length ds takes::

    dF_t = (K_t h + K_te) ds ...    with h the chip's thickness along the surface's normal

Sources: Altintas 2012, Manufacturing Automation, eq. 2.15-2.19 (flat); Lee and Altintas 1996, Int.
J. Mach. Tools Manufact. 36(9), eq. 4-9 (ball). Chip thickness with runout as the least distance to
the path of any earlier tooth (circular paths).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.provenance import Provenance
from robotrue.core.units import MM
from robotrue.dynamics.cutter import CutterEngagement, CuttingCoefficients, EndMill, engagement
from robotrue.dynamics.force import ForceRecord
from robotrue.errors import ConfigurationError
from robotrue.program.cut_path import CutPath

CALCULATED: Final = Provenance(simulated=True, instrument="milling model")
"""Of forces that were not measured."""
_SLICE_LAG: Final = float(np.deg2rad(1.0))
_FEWEST: Final = {"flat": 4, "ball": 24}
_TURN: Final = 2.0 * np.pi


def milling_force(
    cutter: EndMill,
    cut: CutterEngagement,
    coefficients: CuttingCoefficients,
    angle: Array,
    *,
    slices: int | None = None,
) -> Array:
    """Returns the force on the tool (n, 3) N: along the feed, to its left, along the tool up.

    Args:
        cutter: The tool.
        cut: What it takes away.
        coefficients: Of the material.
        angle: (n,) rad, of tooth 0 at the tip, clockwise from +y.
        slices: Axial slices; default: 1 deg of helix each, at least 4 (flat) or 24 (ball).

    Raises:
        ConfigurationError: Wider than the tool.

    Fails when: the feed per tooth is a good part of the radius (paths are then not circles), or
    the tool moves along its axis.
    """
    height, length, sine, cosine = _edge(cutter, cut, slices)
    entry, leave = engagement(cutter, cut, height)
    lag = cutter.lag(height)
    force = np.zeros((len(angle), 3))
    for k in range(len(height)):
        if leave[k] <= entry[k]:
            continue
        radius_of = _runout(cutter, lag[k])
        for j in range(cutter.teeth):
            phi = np.mod(angle + _TURN * j / cutter.teeth - lag[k], _TURN)
            cuts = np.flatnonzero((phi > entry[k]) & (phi < leave[k]))
            if not cuts.size:
                continue
            phi = phi[cuts]
            chip = _chip(np.sin(phi), cut.feed_per_tooth, radius_of, j) * sine[k]
            force[cuts] += _on_edge(phi, chip, sine[k], cosine[k], length[k], coefficients)
    return force


def force_over_time(
    cutter: EndMill,
    cut: CutterEngagement,
    coefficients: CuttingCoefficients,
    *,
    rate: float,
    duration: float,
) -> ForceRecord:
    """Returns the steady force as a record in the axes of the feed (labelled simulated).

    Args:
        cutter: The tool.
        cut: What it takes away.
        coefficients: Of the material.
        rate: Samples per second.
        duration: s.

    Raises:
        ConfigurationError: Fewer than eight samples from tooth to tooth.
    """
    passing = cut.spindle * cutter.teeth
    if rate < 8.0 * passing:
        raise ConfigurationError(
            f"{rate:g} samples/s for teeth that pass at {passing:g} Hz; eight from tooth to tooth "
            "are the least.",
            hint=f"{np.ceil(20.0 * passing):g} samples/s.",
        )
    count = round(duration * rate)
    if count < 2:
        raise ConfigurationError(f"{duration:g} s at {rate:g} samples/s hold no record.")
    angle = np.asarray(_TURN * cut.spindle * np.arange(count) / rate, dtype=np.float64)
    force = milling_force(cutter, cut, coefficients, angle)
    return ForceRecord(
        start=0.0,
        rate=rate,
        force=force,
        source="milling model (simulated)",
        provenance=CALCULATED,
    )


def mean_force(cutter: EndMill, cut: CutterEngagement, coefficients: CuttingCoefficients) -> Array:
    """Returns the mean force over a turn (3,) N, axes as ``milling_force``.

    In closed form for a flat end mill whose teeth all cut (Altintas 2012, eq. 2.17-2.19; neither
    helix nor, then, runout changes it); from a turn of ``milling_force`` otherwise.

    Raises:
        ConfigurationError: Wider than the tool.
    """
    if cutter.kind == "ball" or cutter.runout > 0.0:
        turn = np.asarray(_TURN * (np.arange(3600) + 0.5) / 3600, dtype=np.float64)
        return np.asarray(milling_force(cutter, cut, coefficients, turn).mean(axis=0))
    entry, leave = engagement(cutter, cut, np.array([0.0]))
    phi = np.array([entry[0], leave[0]])
    swept = 2.0 * phi - np.sin(2.0 * phi)
    k = coefficients
    area = cutter.teeth * cut.depth * cut.feed_per_tooth / (8.0 * np.pi)
    edge = cutter.teeth * cut.depth / _TURN
    feed = area * (k.tangential * np.cos(2.0 * phi) - k.radial * swept) + edge * (
        k.radial_edge * np.cos(phi) - k.tangential_edge * np.sin(phi)
    )
    left = area * (k.tangential * swept + k.radial * np.cos(2.0 * phi)) - edge * (
        k.tangential_edge * np.cos(phi) + k.radial_edge * np.sin(phi)
    )
    up = -4.0 * area * k.axial * np.cos(phi) + edge * k.axial_edge * phi
    return np.array([np.diff(part)[0] for part in (feed, left, up)])


@dataclass(frozen=True, slots=True, kw_only=True)
class MillingAlongPath(Columns):
    """Mean force of milling by the length of the path; a ``ProcessForce``.

    Attributes:
        cutter: The tool.
        coefficients: Of the material.
        cut: Mode, feed per tooth and spindle; its depth and width are those of the table.
        along: (k,) m of feeding path, rising.
        depth: (k,) m, along the tool; zero where it does not cut.
        width: (k,) m, radial; zero where it does not cut.
    """

    cutter: EndMill
    coefficients: CuttingCoefficients
    cut: CutterEngagement
    along: Annotated[Array, Column("n", unit="m")]
    depth: Annotated[Array, Column("n", unit="m")]
    width: Annotated[Array, Column("n", unit="m")]

    def _check_rules(self) -> None:
        """Checks the values."""
        along = self.along
        if len(along) < 2 or (np.diff(along) <= 0.0).any():
            raise ConfigurationError("lengths of an engagement table have to rise, two or more.")
        for name in ("depth", "width"):
            values = getattr(self, name)
            if (values < 0.0).any():
                k = int(np.argmax(values < 0.0))
                raise ConfigurationError(
                    f"{name} is {values[k] / MM:g} mm at {along[k] / MM:g} mm of the path, "
                    "expected zero or more."
                )

    def at(self, along: Array) -> Array:
        """Returns the mean force (n, 3) N in path axes at lengths (n,) m.

        Engagement is interpolated; before the first length and after the last nothing is cut.
        """
        depth = np.interp(along, self.along, self.depth, left=0.0, right=0.0)
        width = np.interp(along, self.along, self.width, left=0.0, right=0.0)
        out = np.zeros((len(along), 3))
        cuts = np.isfinite(along) & (depth > 0.0) & (width > 0.0)
        pairs, which = np.unique(
            np.column_stack([depth[cuts], width[cuts]]), axis=0, return_inverse=True
        )
        widest = self.cutter.diameter
        cuts_of = [replace(self.cut, depth=a, width=min(b, widest)) for a, b in pairs.tolist()]
        forces = [mean_force(self.cutter, cut, self.coefficients) for cut in cuts_of]
        if forces:
            out[cuts] = np.array(forces)[which.ravel()]
        return out

    def wrench(self, path: CutPath) -> Array:
        """Returns (n, 6) N, N m on the tool, at the tool point, in base axes; never NaN."""
        force = self.at(np.where(path.cutting, path.along, np.nan))
        frames = path.path_frames()
        known = np.isfinite(frames).all(axis=(1, 2))
        out = np.zeros((len(path), 6))
        out[known, :3] = np.einsum("nij,nj->ni", frames[known], force[known])
        return out


def _edge(
    cutter: EndMill, cut: CutterEngagement, slices: int | None
) -> tuple[Array, Array, Array, Array]:
    """Middle height m, length m, sine and cosine of the surface's tilt, each (k,), tip first."""
    if slices is not None and slices < 1:
        raise ConfigurationError(f"{slices} axial slices, expected one or more.")
    parts = []
    shaft = cut.depth
    if cutter.kind == "ball":
        # Even steps of the tilt: at the tip the sphere is flat and even heights would be coarse.
        ball = min(cut.depth, cutter.radius)
        shaft = cut.depth - ball
        steepest = np.arccos(1.0 - ball / cutter.radius)
        count = slices or _count(cutter, ball, "ball")
        tilt = (np.arange(count) + 0.5) * steepest / count
        length = np.full(count, cutter.radius * steepest / count)
        parts.append((cutter.radius * (1.0 - np.cos(tilt)), length, np.sin(tilt), np.cos(tilt)))
    if shaft > 0.0:
        count = slices or _count(cutter, shaft, "flat")
        height = cut.depth - shaft + (np.arange(count) + 0.5) * shaft / count
        step = np.full(count, shaft / count)
        parts.append((height, step, np.ones(count), np.zeros(count)))
    height, length, sine, cosine = (np.concatenate(part) for part in zip(*parts, strict=True))
    return height, length, sine, cosine


def _count(cutter: EndMill, depth: float, kind: str) -> int:
    lag = abs(float(cutter.lag(np.array(depth))))
    return max(_FEWEST[kind], int(np.ceil(lag / _SLICE_LAG)))


def _runout(cutter: EndMill, lag: float) -> Array:
    """Deviation of each tooth's radius (teeth,) m at one height."""
    place = _TURN * np.arange(cutter.teeth) / cutter.teeth - lag
    return np.asarray(cutter.runout * np.cos(place - cutter.runout_angle))


def _chip(sine: Array, feed: float, radius_of: Array, tooth: int) -> Array:
    """Least radial distance (n,) m to the paths of the teeth before, none below zero."""
    teeth = len(radius_of)
    chip = teeth * feed * sine
    for before in range(1, teeth):
        # The tooth ahead in the turning sense cut here last: j + 1, as angles grow with j.
        gap = radius_of[tooth] - radius_of[(tooth + before) % teeth]
        np.minimum(chip, before * feed * sine + gap, out=chip)
    return np.maximum(chip, 0.0)


def _on_edge(
    phi: Array, chip: Array, sine: float, cosine: float, length: float, k: CuttingCoefficients
) -> Array:
    """Force (n, 3) N on one slice of one edge; nothing where no chip is."""
    bites = chip > 0.0
    tangential = length * (k.tangential * chip + k.tangential_edge * bites)
    radial = length * (k.radial * chip + k.radial_edge * bites)
    axial = length * (k.axial * chip + k.axial_edge * bites)
    outward = axial * cosine - radial * sine
    sin, cos = np.sin(phi), np.cos(phi)
    return np.column_stack(
        [
            outward * sin - tangential * cos,
            outward * cos + tangential * sin,
            axial * sine + radial * cosine,
        ]
    )
