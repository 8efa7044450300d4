"""What a two-sided slot test does not see, shown on cells whose truth is known. Simulated."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.cell.registration.fit import Noise, Registration, fit_points
from robotrue.core.poses import pose, pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.robot.model import RobotModel
from robotrue.validation.slot_test import DatumCheck, check_datums
from robotrue_reproductions.feng2018.machining_cell import (
    SIZE,
    CellSizes,
    FengCell,
    feng_cell,
    touch,
    with_tip,
)
from robotrue_reproductions.feng2018.registration_ways import Session, session, tips, together
from robotrue_reproductions.feng2018.slot_experiment import both_sides, cut_slots
from robotrue_reproductions.reproduction import Figure, figure

KNOCKED: Final = 1.0 * MM
"""By which the block is knocked after it was registered, for the datum check."""
DATUMS: Final = np.array([[60.0, 0.0, 60.0], [340.0, 0.0, 340.0], [60.0, 0.0, 340.0]]) * MM
"""Datums on the front (3, 3) m, no touch of the frame."""
TOLERANCE: Final = 0.5 * MM
ARM_SHARE: Final = 0.1 * MM
"""m per axis: what a calibrated arm still does from place to place."""


def blind_figures(seeds: range) -> list[Figure]:
    """Returns what the step does under errors of frame and tip, and what a datum does."""
    exact = CellSizes(arm=0.0, tip=0.0, touch=0.0, repeatability=0.0)
    cell = feng_cell(0, exact)
    off = pose_from_xyz_abc(np.full(3, 6.0 * MM), np.full(3, 3.0 * DEG))
    centre = pose(np.eye(3), 0.5 * SIZE)
    back = pose(np.eye(3), -0.5 * SIZE)
    wrong = cell.T_base_part @ centre @ off @ back
    out = []
    for name, place, tip in (
        ("frame off by 6 mm and 3 deg about each axis", wrong, 0.0),
        ("tip off by 0.35 mm across the tool", cell.T_base_part, 0.35),
        ("tip off by 10 mm across the tool", cell.T_base_part, 10.0),
    ):
        result = cut_slots(
            *both_sides(with_tip(cell, np.array([0.0, tip * MM, 0.0])), cell.nominal, place),
            np.random.default_rng(0),
        )
        out.append(figure("blind", name, "step", "mm", None, result.mismatch / MM))
        out.append(figure("blind", name, "rms", "mm", None, result.rms / MM))
    seen = [_check_block(session(seed), seed) for seed in seeds]
    for k, (name, quantity, unit) in enumerate(
        (
            ("block at rest", "step", "mm"),
            ("block at rest", "datum says off", "%"),
            ("block knocked by 1 mm", "step", "mm"),
            ("block knocked by 1 mm", "rms", "mm"),
            ("block knocked by 1 mm", "datum says off", "%"),
        )
    ):
        values = np.array([row[k] for row in seen])
        ours = 100.0 * values.mean() if unit == "%" else values / MM
        out.append(figure("blind", name, quantity, unit, None, ours))
    return out


def register_block(model: ErrorModel | RobotModel, s: Session) -> Registration:
    """Returns the frame from ten touches on each of three sides, through a model."""
    touched = together(s.sides, 30)
    sigma = Noise(touch=s.cell.sizes.touch, robot=ARM_SHARE).sigma
    return fit_points(touched.points, tips(model, touched.joints), sigma=sigma)


def touch_datums(
    cell: FengCell,
    model: ErrorModel | RobotModel,
    frame: Registration,
    rng: np.random.Generator,
) -> DatumCheck:
    """Returns the check of a frame by :data:`DATUMS`, touched in posture R through its model."""
    return check_datums(
        frame.T_base_part,
        frame.covariance,
        DATUMS,
        tips(model, touch(cell, DATUMS, "R", rng)),
        noise=Noise(touch=cell.sizes.touch, robot=ARM_SHARE),
        tolerance=TOLERANCE,
        names=("A", "B", "C"),
        used=frame.names,
    )


def knock_block(cell: FengCell, rng: np.random.Generator) -> FengCell:
    """Returns the cell with its block pushed by :data:`KNOCKED` in a random direction."""
    direction = rng.normal(size=3)
    knock = pose(np.eye(3), KNOCKED * direction / np.linalg.norm(direction))
    return replace(cell, T_base_part=knock @ cell.T_base_part)


def _check_block(s: Session, seed: int) -> tuple[float, float, float, float, float]:
    """Step and datum at rest; step, rms and datum after the block was knocked."""
    model = s.calibrated or s.nominal
    frame = register_block(model, s)
    rng = np.random.default_rng([seed, 59])
    found: list[float] = []
    for cell in (s.cell, knock_block(s.cell, rng)):
        slots = cut_slots(*both_sides(cell, model, frame.T_base_part), rng)
        check = touch_datums(cell, model, frame, rng)
        found += [slots.mismatch, slots.rms, float(check.verdict == "is off")]
    return found[0], found[2], found[3], found[4], found[5]
