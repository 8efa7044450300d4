"""Passes of the virtual milling arm: where, the force of the cut, and what a dynamometer reads.

20,000 samples a second. **Assumed**: how depth and material vary along the pass, and the errors of
the dynamometer.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.signal import lfilter

from robotrue.core.arrays import Array
from robotrue.simulation.milling_arm import draw_cutter, force_table

LENGTH: Final = 0.4953
SPACING: Final = 0.9076
"""The windows of the printed pass end at LENGTH u^SPACING, u even: fitted to Tables 2 and 3."""
WINDOWS: Final = 93
SHIFTS: Final = ((0.0, 0.0), (0.25, 0.0), (-0.25, 0.0), (0.0, 0.2), (0.0, -0.2), (0.4, -0.15))
"""m in y and z: the printed pass, then five more at untrained poses."""
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
_DEPTHS: Final = np.array([0.95, 1.0, 1.05])
_COARSE: Final = 2000  # places of the slow waves; straight lines between


def window_edges() -> Array:
    """Returns where the windows begin and end along a pass (94,) m."""
    return np.asarray(LENGTH * np.linspace(0.0, 1.0, WINDOWS + 1) ** SPACING)


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
    cutter = draw_cutter(rng)
    below, middle, above = (force_table(cutter, float(part), 1) for part in _DEPTHS)
    return Tooling(
        table=middle,
        by_depth=(above - below) / (_DEPTHS[2] - _DEPTHS[0]),
        gain=1.0 + GAIN * rng.standard_normal(3),
    )


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
