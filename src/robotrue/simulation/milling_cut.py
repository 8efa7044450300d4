"""The cutting force of a virtual milling pass at 20,000 samples a second, and what is read of it.

Source: Jin et al. 2022 for the cut. **Assumed**: cutting coefficients of aluminium, runout, how
depth and material vary along the pass, and the errors of the dynamometer; and that the material
stands to the right of the feed (the tool turns the other way round): in up-milling only then do the
signs of the printed mean force and error go together in the axes of this arm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.signal import lfilter

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM, UM
from robotrue.dynamics.cutter import CutterEngagement, CuttingCoefficients, EndMill
from robotrue.dynamics.milling_force import milling_force
from robotrue.simulation.milling_arm import FEED

RATE: Final = 20e3
SPINDLE: Final = 60.0
TURN: Final = RATE / SPINDLE
"""Samples per turn of the spindle; three turns are a whole number of samples."""
TEETH: Final = 2
DEPTH: Final = 1 * MM
COEFFICIENTS: Final = CuttingCoefficients(
    tangential=1.35 * 796e6,
    radial=1.35 * 169e6,
    axial=1.35 * 222e6,
    tangential_edge=1.35 * 27.7e3,
    radial_edge=1.35 * 30.8e3,
    axial_edge=1.35 * 1.4e3,
)
RUNOUT: Final = 8 * UM
RUNOUT_SPREAD: Final = 0.15
DEPTH_SLOW: Final = 0.04
MATERIAL_SLOW: Final = 0.03
WEAR: Final = 0.04
MATERIAL_NOISE: Final = 0.04
MATERIAL_MEMORY: Final = 0.9995
"""Of one sample on the next: a tenth of a second."""
GAIN: Final = 0.01
DRIFT: Final = 0.6
"""N, at the end of a pass: the dynamometer is zeroed before each."""
NOISE: Final = 0.5
"""N, of each sample."""
_SLICES: Final = 4
_DEPTHS: Final = np.array([0.95, 1.0, 1.05])
_MIRROR: Final = np.array([1.0, -1.0, 1.0])
_TURNS: Final = 3
_COARSE: Final = 2000  # places of the slow waves; straight lines between


@dataclass(frozen=True, slots=True, kw_only=True)
class Tooling:
    """What stays the same from pass to pass of one seed.

    Attributes:
        table: (1000, 3) N over three turns at the nominal depth, base axes.
        by_depth: (1000, 3) N that a depth of twice the nominal would add.
        gain: (3,) of the dynamometer.
    """

    table: Array
    by_depth: Array
    gain: Array


def tooling(seed: int) -> Tooling:
    """Returns cutter and dynamometer of a seed."""
    rng = np.random.default_rng([seed, 102])
    cutter = _cutter(rng)
    below, middle, above = (_table(cutter, float(part), 1) for part in _DEPTHS)
    return Tooling(
        table=middle,
        by_depth=(above - below) / (_DEPTHS[2] - _DEPTHS[0]),
        gain=1.0 + GAIN * rng.standard_normal(3),
    )


def milling_table(seed: int, finer: int) -> Array:
    """Returns the force (1000 finer, 3) N over three turns, ``finer`` times the sampling rate."""
    return _table(_cutter(np.random.default_rng([seed, 102])), 1.0, finer)


def _cutter(rng: np.random.Generator) -> EndMill:
    return EndMill(
        kind="flat",
        diameter=16 * MM,
        teeth=TEETH,
        helix=30 * DEG,
        runout=RUNOUT * float(np.exp(RUNOUT_SPREAD * rng.standard_normal())),
        runout_angle=float(rng.uniform(0.0, 2.0 * np.pi)),
    )


def _table(cutter: EndMill, part: float, finer: int) -> Array:
    count = round(_TURNS * TURN * finer)
    angle = np.asarray(2.0 * np.pi * np.arange(count) / (TURN * finer), dtype=np.float64)
    cut = CutterEngagement(
        mode="up",
        depth=DEPTH * part,
        width=6 * MM,
        feed_per_tooth=FEED / (SPINDLE * TEETH),
        spindle=SPINDLE,
    )
    return np.asarray(_MIRROR * milling_force(cutter, cut, COEFFICIENTS, angle, slices=_SLICES))


def pass_force(tools: Tooling, samples: int, rng: np.random.Generator) -> Array:
    """Returns the force on the tool (n, 3) N in base axes: x along the feed, z up."""
    progress = np.linspace(0.0, 1.0, _COARSE)
    slowly = 1.0 + MATERIAL_SLOW * slow(progress, rng) + WEAR * progress
    depth = DEPTH_SLOW * slow(progress, rng)
    step = np.sqrt(1.0 - MATERIAL_MEMORY**2) * rng.standard_normal(samples)
    step[0] = rng.standard_normal()
    factor = lfilter([MATERIAL_NOISE], [1.0, -MATERIAL_MEMORY], step)
    factor += 1.0
    at = np.linspace(0.0, 1.0, samples)
    factor *= np.interp(at, progress, slowly)
    period = len(tools.table)
    turns = -(-samples // period)
    out = np.tile(tools.by_depth, (turns, 1))[:samples]
    out *= np.interp(at, progress, depth)[:, None]
    out += np.tile(tools.table, (turns, 1))[:samples]
    out *= factor[:, None]
    return out


def read_force(tools: Tooling, force: Array, rng: np.random.Generator) -> Array:
    """Returns what the dynamometer reads (n, 3) N: gain, drift over the pass, noise."""
    out = rng.standard_normal(force.shape)
    out *= NOISE
    out += force * tools.gain
    out += np.linspace(0.0, 1.0, len(force))[:, None] * (DRIFT * rng.standard_normal(3))
    return out


def slow(progress: Array, rng: np.random.Generator) -> Array:
    """Returns a slow wave (n,) between about -1 and 1: one to four periods in a pass."""
    out = np.zeros(len(progress))
    for cycles in (1.0, 2.3, 4.1):
        out += np.sin(2.0 * np.pi * (cycles * progress + rng.uniform()))
    return np.asarray(out / np.sqrt(3.0))
