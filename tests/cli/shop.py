"""A small shop for the tests of the commands: a cell, simulated measurements, a program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from robotrue.core.arrays import Array
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load, deflect_arm

CELL = """schema = 1
[robot]
preset = "KUKA KR160 R1570"
stiffness_Nm_per_rad = [1.75e6, 1.72e6, 1.95e6, 3.73e5, 2.11e5, 1.74e5]
[tool]
xyz_mm = [60, 40, 250]
[payload]
mass_kg = 50
centre_of_mass_mm = [20, 0, 120]
[tracker]
frame = "base"
sigma_um = 5
sigma_um_per_m = 2
[repeatability]
mm = 0.05
"""
STIFFNESS = np.array([1.75e6, 1.72e6, 1.95e6, 3.73e5, 2.11e5, 1.74e5])
TOOL = np.array([0.06, 0.04, 0.25])
PAYLOAD = Load(mass=np.array([50.0]), com=np.array([[0.02, 0.0, 0.12]]))
COLUMNS = [f"j{i}_deg" for i in range(1, 7)] + ["x_mm", "y_mm", "z_mm"]
FORCE = np.array([0.0, 300.0, -150.0, 0.0, 0.0, 0.0])
PROGRAM = """&ACCESS RVP
DEF part()
$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}
$TOOL={X 60,Y 40,Z 250,A 0,B 0,C 0}
PTP {A1 0,A2 -80,A3 80,A4 0,A5 40,A6 0}
LIN {X 1200.0,Y 200.0,Z 900.0,A 0,B 120,C 0}
LIN {X 1200.0,Y -200.0,Z 900.0,A 0,B 120,C 0}
LIN {X 9800.0,Y -200.0,Z 900.0,A 0,B 120,C 0}
LIN {X 1150.0,Y -200.0,Z 850.0,A 0,B 120,C 0}
END
"""


def nominal() -> RobotModel:
    tool = np.eye(4)
    tool[:3, 3] = TOOL
    return preset("KUKA KR160 R1570").with_tool(tool)


def actual() -> RobotModel:
    """The arm with errors of a few tenths of a millimetre and its compliance, fixed seed."""
    rng = np.random.default_rng(7)
    robot = nominal()
    errors = np.zeros(len(robot.errors))
    for group, sd in (("theta", 3e-4), ("d", 3e-4), ("a", 3e-4), ("alpha", 3e-4)):
        errors[parameter_slice(6, group)] = sd * rng.standard_normal(6)
    errors[parameter_slice(6, "compliance")] = 1.0 / STIFFNESS
    return robot.with_errors(errors)


def postures(n: int, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    axes = np.deg2rad([[-90, 90], [-110, -40], [40, 120], [-120, 120], [-100, 100], [-150, 150]])
    low, high = np.sort(nominal().controller.to_model(axes.T).T, axis=1).T
    return low + (high - low) * rng.random((n, 6))


def points(joints: Array, wrench: Array | None = None, noise_seed: int | None = None) -> Array:
    """(n, 3) m where the reflector is; with a seed, as measured."""
    load = (
        PAYLOAD
        if wrench is None
        else Load(mass=PAYLOAD.mass, com=PAYLOAD.com, wrench=np.atleast_2d(wrench))
    )
    position = deflect_arm(actual(), joints, load)[0].position
    if noise_seed is None:
        return position
    return position + 1.5e-5 * np.random.default_rng(noise_seed).standard_normal(position.shape)


def commanded(joints: Array) -> Array:
    return forward(nominal(), joints)[:, :3, 3]


def write_csv(
    path: Path,
    joints: Array,
    position: Array | None,
    extra: Mapping[str, Sequence[object] | Array] | None = None,
) -> Path:
    """A canonical CSV; ``extra`` columns as they are to be printed."""
    columns: dict[str, Sequence[object] | Array] = dict(
        zip(COLUMNS, np.rad2deg(joints).T, strict=False)
    )
    if position is not None:
        columns |= dict(zip(COLUMNS[6:], position.T * 1e3, strict=True))
    columns |= extra or {}
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(_cell(v) for v in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _cell(value: object) -> str:
    return f"{value:.9f}" if isinstance(value, float) else str(value)
