"""A few poses that show best which of several causes changed an arm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import solve_triangular

from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell
from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM
from robotrue.planning.arm_scene import scene_of
from robotrue.planning.candidates import STEP, draw_candidates, nothing_left, usable
from robotrue.planning.criteria import greedy
from robotrue.planning.order import short_order

EXPECTED: Final = 1e-4
"""m and rad: the size of a change that is to be seen (0.1 mm, 0.006 deg)."""
CANDIDATES: Final = 512
DRAWN: Final = 8192
CLEARANCE: Final = 50.0 * MM
MARGIN: Final = 5.0 * DEG


@dataclass(frozen=True, slots=True, kw_only=True)
class DiscriminatingPoses:
    """Chosen poses.

    Attributes:
        joints: (n, dof) rad, in a short order.
        sd: Standard deviation (k,) of each cause's numbers if that cause alone acts, SI.
    """

    joints: Array
    sd: Mapping[str, Array]


def draw_drift_candidates(model: ErrorModel, cell: Cell, *, seed: int) -> Array:
    """Returns postures (n, dof) rad that can be measured, within the trained ranges if known.

    They are reachable, free of collisions and visible to the instrument as far as the cell states.

    Raises:
        ReachError: Nothing can be measured.
    """
    scene = scene_of(cell, clearance=CLEARANCE)
    trained = model.training_summary().joint_range
    if trained is None or trained.shape != (2, model.robot.dof):
        candidates = draw_candidates(
            scene, CANDIDATES, seed=seed, margin=MARGIN, region=None, step_back=None
        )
        return candidates.joints
    low, high = trained
    from scipy.stats import qmc  # takes longer to import than most commands run

    draws = qmc.Sobol(model.robot.dof, rng=np.random.default_rng([seed, 43]))
    joints = np.round((low + draws.random(DRAWN) * (high - low)) / STEP) * STEP
    checked = usable(scene, joints)
    if not checked.good.any():
        raise nothing_left(DRAWN, checked)
    return np.asarray(joints[checked.good][:CANDIDATES])


def choose_discriminating(
    drawn: Array, noise: Array, columns: Mapping[str, Array], poses: int
) -> DiscriminatingPoses:
    """Returns the D-optimal poses for telling causes apart.

    Args:
        drawn: (n, dof) rad, to choose from.
        noise: (n, 3, 3) m^2, of one reading at each.
        columns: Per cause (n, 3, k), what a unit of its numbers moves.
        poses: How many.

    Raises:
        ConfigurationError: More poses than there are.
    """
    root = np.linalg.cholesky(noise)
    white = {
        name: np.stack([solve_triangular(r, a, lower=True) for r, a in zip(root, c, strict=True)])
        for name, c in columns.items()
    }
    rows = np.concatenate(list(white.values()), axis=2) * EXPECTED
    choice = greedy(rows, np.eye(rows.shape[2]), poses, criterion="D").chosen
    sd = {}
    for name, whitened in white.items():
        design = whitened[choice].reshape(-1, whitened.shape[2])
        sd[name] = np.sqrt(np.diagonal(np.linalg.pinv(design.T @ design)))
    return DiscriminatingPoses(joints=drawn[choice[short_order(drawn[choice])]], sd=sd)
