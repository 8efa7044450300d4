"""An arm that loses the zero of an axis, to practise on. Simulated.

    python -m robotrue.simulation.mastering_practice FOLDER
    python -m robotrue.simulation.mastering_practice FOLDER --touch PLANNED.csv --lost A3=0.12

The first writes ``cell.toml`` and ``measured.csv``: 60 poses that a tracker measured while the arm
was good. The second touches the planned postures after the zeros were lost, and writes
``touched.csv``. Axes and senses are those of the pendant.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.csv_text import axis_names
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.measurement.formats.canonical import write_canonical
from robotrue.measurement.formats.part_points import write_points
from robotrue.measurement.formats.sheet_file import read_sheet
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.configuration import axis_relation
from robotrue.robot.model import parameter_slice
from robotrue.simulation.plans import random_joints
from robotrue.simulation.presets import (
    SPINDLE,
    TARGET_SIGMA,
    VirtualCell,
    deng2022,
    reflector_at_tool,
)
from robotrue.simulation.virtual_robot import VirtualRobot, actual_pose
from robotrue.simulation.virtual_tracker import measure

POINT: Final = np.array([1050.0, 150.0, 750.0]) * MM
"""In base, roughly; it truly is 1 to 3 mm off."""
TOUCH: Final = 0.05 * MM
"""One touch, per axis."""
POSES: Final = 60
STEP: Final = 1e-6
"""rad, of the differences that move the tip to the point."""


def practice_cell(seed: int, *, level: float = 1.0) -> VirtualCell:
    """Returns the cell: a KR160 with a probe at its spindle, the reflector in its place."""
    return reflector_at_tool(deng2022(seed, level=level))


def measure_good(cell: VirtualCell) -> MeasurementSet:
    """Returns 60 poses of the whole work area, measured while the arm was good."""
    joints = random_joints(cell.known.measured_robot, POSES, seed=cell.seed)
    return measure(
        cell.robot, cell.tracker, joints, seed=cell.seed, T_flange_tool=cell.T_flange_target
    )


def lose_zeros(cell: VirtualCell, offset: Array) -> VirtualRobot:
    """Returns the arm whose true joints are ``offset`` (6,) rad beyond their readings."""
    robot = cell.robot.actual
    errors = np.array(robot.errors)
    errors[parameter_slice(robot.dof, "theta")] += robot.joint_map @ offset
    actual = robot.with_errors(errors).with_tool(cell.T_flange_target)
    return replace(cell.robot, actual=actual)


def touch_point(
    robot: VirtualRobot, planned: Array, point: Array, rng: np.random.Generator
) -> Array:
    """Returns the readings (n, 6) rad at which the true tip touches the point, with scatter.

    Args:
        robot: The truth; its tool touches.
        planned: (n, 6) rad, postures near the point.
        point: (3,) m in base.
        rng: Of the scatter.
    """
    sigma = np.hypot(TOUCH, robot.repeatability)
    aim = point + sigma * rng.standard_normal((len(planned), 3))
    joints = planned.copy()
    for _ in range(4):
        at = actual_pose(robot, joints)[:, :3, 3]
        slopes = np.stack(
            [(actual_pose(robot, joints + STEP * e)[:, :3, 3] - at) / STEP for e in np.eye(6)],
            axis=2,
        )
        joints = joints + (np.linalg.pinv(slopes) @ (aim - at)[:, :, None])[:, :, 0]
    return joints


def parse_lost(text: str, sign: Array) -> Array:
    """Returns offsets (6,) rad of the joints from e.g. ``A3=0.12,A5=-0.05`` in deg.

    Raises:
        ConfigurationError: Another form, or no such axis.
    """
    offset = np.zeros(6)
    for part in filter(None, text.split(",")):
        name, _, value = part.partition("=")
        try:
            axis, size = int(name.removeprefix("A")) - 1, float(value)
        except ValueError:
            axis, size = -1, 0.0
        if not 0 <= axis < 6:
            raise ConfigurationError(f"--lost {text!r}: {part!r}.", hint="--lost A3=0.12")
        offset[axis] = sign[axis] * size * DEG
    return offset


def write_cell(folder: Path, cell: VirtualCell) -> None:
    """Writes ``cell.toml`` and ``measured.csv``."""
    x, y, z = cell.known.T_flange_target[:3, 3] / MM
    (folder / "cell.toml").write_text(
        f"""schema = 1
[robot]
preset = "KUKA KR160 R1570"
[tool]  # the probe's tip
xyz_mm = [{x:g}, {y:g}, {z:g}]
[target]  # the reflector in its place
xyz_mm = [{x:g}, {y:g}, {z:g}]
sigma_mm = {TARGET_SIGMA / MM:g}
[payload]
mass_kg = {SPINDLE.mass[0]:g}
centre_of_mass_mm = [0, 0, {SPINDLE.com[0, 2] / MM:g}]
[repeatability]
mm = {cell.known.repeatability / MM:.4f}
""",
        encoding="utf-8",
    )
    write_canonical(folder / "measured.csv", measure_good(cell))


def write_touches(folder: Path, cell: VirtualCell, planned: Path, lost: str) -> None:
    """Writes ``touched.csv``: the planned touches as the arm without its zeros reads them."""
    sheet = read_sheet(planned)
    joints = axis_relation(cell.known.robot)(sheet.numbers(axis_names(6)) * DEG)
    rng = np.random.default_rng([cell.seed, 71])
    robot = lose_zeros(cell, parse_lost(lost, cell.known.robot.controller.sign))
    point = POINT + 2.0 * MM * rng.standard_normal(3)
    touched = ProbingSet(
        names=sheet.words("name"),
        point=np.zeros((len(joints), 3)),
        joints=touch_point(robot, joints, point, rng),
        provenance=Provenance(simulated=True, instrument="virtual arm"),
    )
    write_points(folder / "touched.csv", touched)


def main(arguments: Sequence[str] | None = None) -> None:
    """Writes the requested files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--touch", type=Path)
    parser.add_argument("--lost", default="A3=0.12")
    parser.add_argument("--seed", type=int, default=3)
    asked = parser.parse_args(arguments)
    asked.folder.mkdir(parents=True, exist_ok=True)
    cell = practice_cell(asked.seed)
    if asked.touch is None:
        write_cell(asked.folder, cell)
    else:
        write_touches(asked.folder, cell, asked.touch, asked.lost)


if __name__ == "__main__":
    main()
