"""Make a KRL program for a vase cut from two sides, from its CL files and STL."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import trimesh

from robotrue.core.files import write_atomic
from robotrue.core.poses import apply, pose
from robotrue.core.surfaces import read_mesh
from robotrue.core.units import MM
from robotrue.planning.machining import MachiningSettings, Side, job_moves, plan_machining
from robotrue.program.contour import contour_of, keep_inside, side_direction
from robotrue.program.formats.toolpaths import read_toolpath
from robotrue.program.posts import read_posts
from robotrue.program.posts.machining_moves import JobSpeeds
from robotrue.program.posts.post_writer import write_machining
from robotrue.simulation.presets import deng2022
from robotrue.simulation.virtual_robot import actual_pose

T_BASE_PART = pose(np.eye(3), np.array([1.05, 0.0, 0.45]))  # as registered by probing


def radius(z):
    """Returns the half width of the vase in mm at height z mm; the depth is 2/3 of the width."""
    return 60 + 35 * np.sin(z / 45.0) - 0.08 * z


def write_apt(path, sign):
    """Writes lines across the whole blank with lifts between them, like a relief CAM."""
    lines = [f"PARTNO VASE {path.stem}", "UNITS/MM", "SPINDL/12000,RPM,CLW", "MULTAX/ON"]
    for z in np.arange(5, 300, 10):
        x, wide = np.linspace(-110, 110, 56), radius(z)
        depth = sign * wide / 1.5 * np.sqrt(np.maximum(1 - (x / wide) ** 2, 0.0))
        text = [f"GOTO/{p:.3f},{q:.3f},{z:.3f},0,{sign},0" for p, q in zip(x, depth, strict=True)]
        above = [f"GOTO/{p:.3f},{sign * 140},{z:.3f},0,{sign},0" for p in (x[0], x[-1])]
        lines += ["RAPID", above[0], "FEDRAT/1500,MMPM", *text, "RAPID", above[1]]
    write_atomic(path, "\n".join([*lines, "FINI", ""]).encode())


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    virtual = deng2022(seed=1)
    cell, robot = virtual.known, virtual.known.robot
    z = np.linspace(0, 300, 61)
    profile = np.stack([[0, *radius(z), 0], [0, *z, 300]], axis=1)
    solid = trimesh.creation.revolve(profile, sections=96)
    solid.apply_scale([1, 1 / 1.5, 1]).export(out / "vase.stl")
    mesh, sides = read_mesh(out / "vase.stl"), []
    figure, axes = plt.subplots(1, 2, figsize=(7, 4), sharey=True)
    for ax, name, sign in zip(axes, ("front", "back"), (-1, 1), strict=True):
        write_apt(out / f"{name}.apt", sign)
        path = read_toolpath(out / f"{name}.apt")
        kept = keep_inside(path, contour := contour_of(mesh, side_direction(path)))
        sides.append(Side(path=kept, T_base_part=T_BASE_PART))
        for each, style in ((path, "r."), (kept, "b.")):
            ax.plot(*(each.position[each.cutting] / MM)[:, [0, 2]].T, style, markersize=2)
        around = contour.outlines[0] @ contour.across / MM
        ax.fill(around[:, 0], around[:, 2], fill=False)
        ax.set(title=f"{name}: kept blue, dropped red", xlabel="x, mm", aspect="equal")
    job = plan_machining(cell, sides, MachiningSettings(), mesh=mesh)
    program = write_machining(read_posts()["krl"], job_moves(job, robot, "vase", JobSpeeds()))
    for name, data in program.files.items():
        write_atomic(out / name, data)
    figure.savefig(out / "09_from_cam.png", bbox_inches="tight")
    size = []  # errors of the uncompensated program on the virtual arm
    for s in job.sides:
        tip = actual_pose(virtual.robot, s.joints, T_flange_tool=robot.T_flange_tool)[:, :3, 3]
        size.append(np.linalg.norm(tip - apply(T_BASE_PART, s.path.position), axis=1) / MM)
    error = np.concatenate(size)
    print(f"{len(error)} points, off by {error.mean():.2f} +- {error.std():.2f} mm (simulated)")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "example-out"))
