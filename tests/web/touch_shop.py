"""A part that somebody touches, simulated: its list of features, its cell, and readings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import apply
from robotrue.core.units import DEG, MM
from robotrue_reproductions.feng2018 import machining_cell as virtual

CELL = """\
schema = 1
[robot]
preset = "KUKA KR160 R1570"
[tool]
xyz_mm = [0, 0, 300]
[repeatability]
mm = 0.06
[base]
xyz_mm = [800, -100, 400]
"""
FEATURES = """\
name,px_mm,py_mm,pz_mm,ax,ay,az
front 1,10,0,10,0,-1,0
front 2,390,0,10,0,-1,0
front 3,390,0,390,0,-1,0
front 4,10,0,390,0,-1,0
front 5,200,0,200,0,-1,0
top 1,20,20,400,0,0,1
top 2,380,20,400,0,0,1
top 3,380,180,400,0,0,1
top 4,20,180,400,0,0,1
top 5,200,100,400,0,0,1
"""
TOLERANCE_MM = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """A simulated arm with a block in front of it."""

    cell: virtual.FengCell
    rng: np.random.Generator

    def joints(self, point_mm: list[float], planned_deg: list[float]) -> Array:
        """Joints (6,) deg, in the model's sense, at which the true tip meets a point of the block.

        Commanded near the planned ones: in their attitude.
        """
        nominal, q = self.cell.nominal, np.array([planned_deg]) * DEG
        wanted = apply(self.cell.T_base_part, np.array([point_mm]) * MM)
        wanted = wanted + 0.05 * MM * self.rng.normal(size=(1, 3))
        from robotrue.core.poses import pose
        from robotrue.robot.forward import forward
        from robotrue.robot.inverse_numeric import solve

        R = forward(nominal.nominal(), q)[:, :3, :3]
        shown = wanted
        for _ in range(3):  # the error hardly changes
            q = solve(nominal.nominal(), pose(R, shown), q).joints
            shown = shown + wanted - virtual.machine(self.cell, q)
        return np.asarray(q[0] / DEG)

    def line(self, point_mm: list[float], axes_deg: list[float]) -> str:
        """What a KUKA shows after touching, from the axes the page asks for."""
        controller = self.cell.nominal.controller
        assert controller is not None
        planned = controller.to_model(np.array(axes_deg) * DEG) / DEG
        axes = controller.to_controller(self.joints(point_mm, planned.tolist()) * DEG) / DEG
        return "{E6AXIS: " + ", ".join(f"A{k + 1} {v:.5f}" for k, v in enumerate(axes)) + "}"


def touch_bench() -> Bench:
    """The bench of the tests."""
    return Bench(cell=virtual.feng_cell(seed=5), rng=np.random.default_rng(11))


def write_touch_files(folder: Path) -> None:
    """cell.toml and the features, which say that they are simulated."""
    (folder / "cell.toml").write_text(CELL)
    (folder / "block simulated.csv").write_text("# robotrue SIMULATED: block\n" + FEATURES)
