"""What has to vary in a pass for the eigenvalues of Jin et al. 2022, Table 2. All SIMULATED.

    python benchmarks/paper_eigenvalues.py [ARMS]

Ninety-three windows along the printed line; peak and mean force across the feed come from
the cutting model of :mod:`robotrue.dynamics.milling_force`, window by window, with what
varies stated in each row. The joints are those of the line, the same in all rows. Seconds.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM, UM
from robotrue.dynamics.cutter import CutterEngagement, EndMill
from robotrue.dynamics.milling_force import milling_force
from robotrue.dynamics.paper_learners import components_of
from robotrue.simulation.milling_arm import (
    COEFFICIENTS,
    DEPTH,
    FEED,
    RUNOUT,
    SPINDLE,
    TEETH,
    pass_joints,
)
from robotrue_reproductions.jin2022.jin_tables import EIGENVALUES
from robotrue_reproductions.jin2022.milling_pass import WINDOWS, slow, window_edges

PRINTED_CORRELATION: Final = -0.157
"""Of peak and mean, from tables 2 and 3."""
PRINTED_FORCE: Final = np.array(
    [
        [74.643, -4.826], [78.672, -4.921], [81.949, -5.041], [77.540, -5.019], [79.618, -5.033],
        [80.122, -4.948], [80.828, -5.067], [83.012, -5.348], [82.366, -5.540], [80.622, -5.612],
    ]
)  # fmt: skip
"""N, peak and mean of table 1."""
NEAR: Final = 0.1
WIDTH: Final = 6 * MM
SAMPLES: Final = 360
"""Of a turn of the spindle."""
STEPS: Final = {"width": 0.02 * WIDTH, "runout": 0.25 * RUNOUT, "depth": 0.02 * DEPTH}
"""For the slopes of peak and mean force."""
_EVEN: Final = {"material": 0.03, "slow": 0.0}
"""No wear and no slow waves of depth and material."""
CASES: Final[Mapping[str, Mapping[str, float]]] = {
    "as simulated: depth, material, wear": {},
    "and width by 3 %": {"width": 0.03},
    "and width by 10 %": {"width": 0.10},
    "and runout by 1 um": {"runout": 1 * UM},
    "and the sensor's zero by 0.1 N": {"zero": 0.1},
    "and the sensor's zero by 0.3 N": {"zero": 0.3},
    "width by 10 % and zero by 0.3 N": {"width": 0.10, "zero": 0.3},
    "width by 10 %, no wear, no slow waves": {"width": 0.10, **_EVEN},
    "width by 20 %, strip bowed by 0.05 mm": {"width": 0.20, "bow": 0.05, **_EVEN},
    "and tilted by 0.02 mm": {"width": 0.20, "bow": 0.05, "tilt": 0.02, **_EVEN},
    "width by 20 % in waves of 50 mm, bowed": {
        "width": 0.20, "waves": 50 * MM, "bow": 0.04, **_EVEN,
    },
    "zero by 0.9 N in waves of 50 mm, bowed": {
        "zero": 0.9, "waves": 50 * MM, "bow": 0.04, **_EVEN,
    },
}  # fmt: skip
"""One standard deviation of a window, each drawn anew, or of waves along the strip (a process of
squared exponentials of that length). Bow and tilt of the strip are parts of the depth from its
lowest to its highest point: deeper at the ends than in the middle, at the far end than at the near
one."""


def peak_and_mean(runout: float, angle: float, depth: float, width: float) -> Array:
    """Returns largest size and mean (2,) N of the force across the feed over a turn."""
    cutter = EndMill(
        kind="flat", diameter=16 * MM, teeth=TEETH, helix=30 * DEG, runout=runout,
        runout_angle=angle,
    )  # fmt: skip
    cut = CutterEngagement(
        mode="up", depth=depth, width=width, feed_per_tooth=FEED / (SPINDLE * TEETH),
        spindle=SPINDLE,
    )  # fmt: skip
    turn = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    force = milling_force(cutter, cut, COEFFICIENTS, turn, slices=4)[:, 1]
    return np.array([np.abs(force).max(), -force.mean()])


def eigenvalues(seed: int, varied: Mapping[str, float]) -> tuple[Array, Array]:
    """Returns the eigenvalues (8,), and of peak and mean (5,) what goes with them.

    That is their correlation, their standard deviations, and how far they go from window to window
    as the standard deviation of a white number.
    """
    rng = np.random.default_rng([seed, 7])
    edges = window_edges()
    joints = pass_joints(0.5 * (edges[1:] + edges[:-1]))
    angle, runout = rng.uniform(0.0, 2.0 * np.pi), RUNOUT * np.exp(0.15 * rng.standard_normal())
    own = peak_and_mean(runout, angle, DEPTH, WIDTH)
    slope = {
        "width": (peak_and_mean(runout, angle, DEPTH, WIDTH + STEPS["width"]) - own) / 0.02,
        "runout": (peak_and_mean(runout + STEPS["runout"], angle, DEPTH, WIDTH) - own)
        / STEPS["runout"],
        "depth": (peak_and_mean(runout, angle, DEPTH + STEPS["depth"], WIDTH) - own) / 0.02,
    }
    progress = np.linspace(0.0, 1.0, WINDOWS)
    waves, way = varied.get("slow", 1.0), varied.get("material", 0.01)
    factor = 1.0 + waves * (0.03 * slow(progress, rng) + 0.04 * progress)
    factor += way * rng.standard_normal(WINDOWS)
    along = 2.0 * progress - 1.0
    depth = 0.04 * waves * slow(progress, rng)
    depth += varied.get("bow", 0.0) * (along**2 - 1.0 / 3.0) + 0.5 * varied.get("tilt", 0.0) * along
    force = own + depth[:, None] * slope["depth"]
    wander = wave_root(0.5 * (edges[1:] + edges[:-1]), varied.get("waves", 0.0))
    for name in ("width", "runout"):
        drawn = wander @ rng.standard_normal(WINDOWS)
        force = force + (varied.get(name, 0.0) * drawn)[:, None] * slope[name]
    force = force * factor[:, None]
    force[:, 1] += varied.get("zero", 0.0) * (wander @ rng.standard_normal(WINDOWS))
    found = components_of(np.column_stack([joints, force]))
    step = np.sqrt(0.5 * (np.diff(force, axis=0) ** 2).mean(axis=0))
    return found.eigenvalues, np.array([np.corrcoef(force.T)[0, 1], *force.std(axis=0), *step])


def wave_root(place: Array, length: float) -> Array:
    """Returns the matrix (n, n) that turns white numbers into waves of a length (m) along places.

    A length of zero leaves them white.
    """
    if length == 0.0:
        return np.eye(len(place))
    value, vector = np.linalg.eigh(np.exp(-0.5 * ((place[:, None] - place) / length) ** 2))
    return np.asarray((vector * np.sqrt(np.maximum(value, 0.0))) @ vector.T)


def main(arguments: list[str]) -> None:
    arms = int(arguments[0]) if arguments else 20
    print(f"SIMULATED, median of {arms} arms")
    print(f"{'':46s}      1      2      3      4      r     sd peak, mean N  step")
    for name, varied in CASES.items():
        rows = [eigenvalues(seed, varied) for seed in range(1, arms + 1)]
        found = np.array([values[:4] for values, _ in rows])
        middle = np.median(found, axis=0)
        near = int((np.abs(found - EIGENVALUES[:4]) <= NEAR).all(axis=1).sum())
        joined = np.median([r for _, r in rows], axis=0)
        numbers = "".join(f"{v:7.3f}" for v in [*middle, *joined])
        print(f"{name:46s}{numbers}   {near} arms within {NEAR:g} of all four")
    rows = np.sqrt(0.5 * (np.diff(PRINTED_FORCE, axis=0) ** 2).mean(axis=0))
    printed = [*EIGENVALUES[:4], PRINTED_CORRELATION, *[np.nan] * 2, *rows]
    print(f"{'printed':46s}" + "".join(f"{v:7.3f}" for v in printed))


if __name__ == "__main__":
    main(sys.argv[1:])
