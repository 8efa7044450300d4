"""Rounds at the machine in the virtual cell: their number, their final pose. Simulated.

Four ways to begin: where the drawing has the block, half a millimetre off, a fifth of it off, and
in the best frame there is for the three points. The error is the worst of the three points, tip
less part, without the scatter of one more visit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.cell.registration.rounds import MOST_ROUNDS, RoundFit, adjust_in_rounds
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, fit_rigid, pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue_reproductions.feng2018.machining_cell import (
    T_BASE_DRAWN,
    attitude,
    feng_cell,
    joints_touching,
    touch,
)
from robotrue_reproductions.feng2018.registration_ways import CORNER, tips

STARTS: Final = ("as drawn", "0.5 mm and 0.1 deg off", "0.2 mm and 0.03 deg off", "best")
TILT: Final = 5.0 * DEG
"""Lean of the wrist from touch to touch."""
SIGMA: Final = 0.12 * MM
"""Of one touch against the next round's: touch 0.1, repeatability 0.03, the lean."""
NAMES: Final = ("K", "L", "M")


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundsEnd:
    """Where the rounds of one cell ended from one start.

    Attributes:
        start: Of :data:`STARTS`.
        rounds: That were needed.
        verdict: The last one.
        error: (rounds + 1,) m, worst of the three points in the frame of each run and at the end.
        floor: m, as reported.
    """

    start: str
    rounds: int
    verdict: str
    error: Array
    floor: float


def run_rounds(seed: int, method: RoundFit) -> list[RoundsEnd]:
    """Returns the rounds of one cell from every start, all with the same touches."""
    cell = feng_cell(seed)
    rng = np.random.default_rng([seed, 77])
    turn = np.broadcast_to(attitude("R"), (3, 3, 3))
    exact = tips(cell.nominal, joints_touching(cell, apply(cell.T_base_part, CORNER), turn, "R"))
    best = fit_rigid(CORNER, exact)
    begun = (
        T_BASE_DRAWN,
        _displace(best, 0.5 * MM, 0.1 * DEG, rng),
        _displace(best, 0.2 * MM, 0.03 * DEG, rng),
        best,
    )
    touched = np.array(
        [
            tips(cell.nominal, touch(cell, CORNER, "R", rng, tilt=TILT))
            for _ in range(MOST_ROUNDS + 1)
        ]
    )
    out = []
    for start, T in zip(STARTS, begun, strict=True):
        for k in range(1, len(touched) + 1):
            found = adjust_in_rounds(
                CORNER, T, touched[:k], sigma=SIGMA, names=NAMES, method=method
            )
            if found.adjustment.verdict != "run again":
                break
        frames = [*found.frames, found.adjustment.T_base_part]
        error = [float(np.linalg.norm(apply(F, CORNER) - exact, axis=1).max()) for F in frames]
        out.append(
            RoundsEnd(
                start=start,
                rounds=k,
                verdict=found.adjustment.verdict,
                error=np.array(error),
                floor=found.adjustment.floor,
            )
        )
    return out


def _displace(T: Array, shift: float, turn: float, rng: np.random.Generator) -> Array:
    """A frame turned about the middle of the points and shifted, by normal numbers."""
    middle = apply(T, CORNER.mean(axis=0))
    R = matrix_from_rotation_vector(turn * rng.normal(size=3))
    return pose(R @ T[:3, :3], middle + R @ (T[:3, 3] - middle) + shift * rng.normal(size=3))
