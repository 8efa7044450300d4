"""Do the stated 95 % regions of tool point, tool axis, datums and 3-2-1 hold the truth? Simulated.

    python benchmarks/tool_calibration.py [--cells N] [--wide]

Cells of robotrue_reproductions.feng2018.machining_cell, touched from the front, the wrist leaning
by 5 deg. What is believed of the arm is the spread the cells are drawn with; ``--wide`` takes
robotrue's own priors of a production arm instead, which are wider than these arms.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from dataclasses import replace

import numpy as np
from registration_coverage import drawn_scales, drawn_spread
from scipy.stats import chi2

from robotrue.calibration.nominal import NominalModel
from robotrue.cell.part import PartFrame
from robotrue.cell.registration.fit import Noise
from robotrue.cell.registration.touches import fit_touches
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.forward import forward
from robotrue.simulation.virtual_robot import drive_shift
from robotrue.validation.datum_touches import check_part
from robotrue.validation.part_registration import register
from robotrue.validation.registration_frame import RegistrationSettings, tips
from robotrue.validation.tool_calibration import axis_between, axis_on_plane, calibrate_tool
from robotrue_reproductions.feng2018.example_files import with_tool
from robotrue_reproductions.feng2018.machining_cell import (
    SIZE,
    TOOL,
    FengCell,
    attitude,
    compensated_joints,
    feng_cell,
    joints_touching,
    machine,
    nominal_joints,
    touch,
)

TABLE = np.array([[10, 0, 10], [390, 0, 10], [10, 0, 390], [390, 0, 390], [200, 0, 200]]) * MM
PIN = np.array([[100.0, 0.0, 120.0]]) * MM
LEAN = 5.0 * DEG
SIX = np.array([[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1], [0, 1, 0]]) * 25.0 * DEG
GAUGE = 150.0 * MM
SQUARE = 0.05 * DEG
SPINS = np.array([-0.4, -0.15, 0.15, 0.4])
FACES = np.array([[40, 0, 40], [360, 0, 60], [80, 0, 350], [60, 100, 400], [350, 80, 400]]) * MM
LAST = np.array([[0.0, 120.0, 200.0]]) * MM
NORMALS = np.array([[0, -1, 0]] * 3 + [[0, 0, 1]] * 2 + [[-1, 0, 0]], dtype=float)


def touches(cell: FengCell, points: Array, leans: Array, rng: np.random.Generator) -> ProbingSet:
    """Returns touches of part points with stated leans of the wrist."""
    scatter = np.hypot(cell.sizes.touch, cell.sizes.repeatability)
    aim = apply(cell.T_base_part, points) + scatter * rng.normal(size=points.shape)
    turned = matrix_from_rotation_vector(leans) @ attitude("R")
    names = tuple(f"t{k}" for k in range(len(points)))
    return ProbingSet(names=names, point=points, joints=joints_touching(cell, aim, turned, "R"))


def squared(cell: FengCell, normal: Array, axis: Array, rng: np.random.Generator) -> ProbingSet:
    """Returns poses at which the true tool axis stands on a plane, as well as it is squared."""
    v = np.cross([0.0, 0.0, 1.0], -normal)
    v /= np.linalg.norm(v)
    across = np.stack([v, np.cross(-normal, v), -normal], axis=1)
    d = np.array([1.0, 0.0, 0.0]) - axis[0] * axis
    d /= np.linalg.norm(d)
    own = np.stack([d, np.cross(axis, d), axis], axis=1)
    begin = across.T @ attitude("R") @ own
    angle = np.arctan2(begin[1, 0], begin[0, 0]) + SPINS
    spun = matrix_from_rotation_vector(np.outer(angle, [0.0, 0.0, 1.0]))
    error = matrix_from_rotation_vector(SQUARE * rng.normal(size=(len(SPINS), 3)))
    want = error @ across @ spun @ own.T
    shown, at = want, np.tile(apply(cell.T_base_part, PIN[0]), (len(SPINS), 1))
    for _ in range(4):
        joints = nominal_joints(cell.nominal, pose(shown, at), "R")
        shown = want @ np.swapaxes(true_attitude(cell, joints), 1, 2) @ shown
    return ProbingSet(
        names=tuple(f"s{k}" for k in range(len(SPINS))),
        point=np.zeros((len(SPINS), 3)),
        joints=joints,
    )


def true_attitude(cell: FengCell, joints: Array) -> Array:
    """Returns R_base_flange (n, 3, 3) as the arm truly stands; the dead weight left out."""
    robot = cell.robot.actual
    still = np.zeros_like(joints)
    shift = drive_shift(cell.robot.effects, joints, still, robot.error("compliance"), still)
    return forward(robot, joints, shift)[:, :3, :3]


def run_cell(seed: int, wide: bool, out: dict[str, list[tuple[float, float, float]]]) -> None:
    """Adds error, region and squared length over covariance of every kind in one cell."""
    cell, rng = feng_cell(seed), np.random.default_rng([seed, 91])
    arm = NominalModel(robot=cell.nominal)
    settings = RegistrationSettings(
        T_flange_tool=TOOL, arm=drawn_scales(cell), belief=None if wide else drawn_spread(cell)
    )
    if wide:
        settings = replace(
            settings, arm=replace(settings.arm, scales=RegistrationSettings().arm.scales)
        )

    def add(kind: str, error: Array, covariance: Array, region: float) -> None:
        square = float(error @ np.linalg.pinv(covariance, rcond=1e-6) @ error)
        out[kind].append((float(np.linalg.norm(error)), region, square))

    table = ProbingSet(
        names=tuple("abcde"), point=TABLE, joints=touch(cell, TABLE, "R", rng, tilt=LEAN)
    )
    at = tips(arm, table.joints, settings)
    fit = fit_touches(table, at, noise=Noise(touch=settings.touch, robot=0.35 * MM))
    frame = PartFrame(
        name="part", T_base_part=fit.T_base_part, covariance=fit.covariance, touches=5,
        rms=fit.rms, verdict="GO",
    )  # fmt: skip
    pin = ProbingSet(names=("pin",), point=PIN, joints=touch(cell, PIN, "R", rng, tilt=LEAN))
    check, _ = check_part(arm, frame, pin, used=table, tolerance=MM, settings=settings)
    add("datum", check.deviation[0], check.covariance[0], check.resolution)

    tip = np.array([8.0, -5.0, 240.0]) * MM + MM * rng.normal(size=3)
    other = with_tool(cell, tip)
    leans = rng.normal(size=(5, 3))
    five = touches(other, TABLE, leans * LEAN / np.linalg.norm(leans, axis=1)[:, None], rng)
    for kind, rows in (("tool, 1 touch of the table", [4]), ("tool, 5 touches", range(5))):
        found = calibrate_tool(arm, five.subset(np.array(rows)), table=table, settings=settings)
        add(kind, found.p_flange_tool - tip, found.covariance, found.region)
    short = touches(other, np.tile(TABLE[4], (6, 1)), SIX, rng)
    pivot = calibrate_tool(arm, short, settings=settings)
    add("tool, fixed point, 6 leans", pivot.p_flange_tool - tip, pivot.covariance, pivot.region)
    axis = np.array([0.02, -0.01, 1.0]) / np.linalg.norm([0.02, -0.01, 1.0])
    long = touches(with_tool(cell, tip + GAUGE * axis), np.tile(TABLE[4], (6, 1)), SIX, rng)
    between = axis_between(arm, short, long, settings=settings)
    add("axis, two gauges", between.axis_in_flange - axis, between.covariance, between.region)
    normal = cell.T_base_part[:3, :3] @ np.array([0.0, -1.0, 0.0])
    flush = axis_on_plane(
        arm, squared(cell, normal, axis, rng), normal, sigma=SQUARE, settings=settings
    )
    add("axis, squared", flush.axis_in_flange - axis, flush.covariance, flush.region)
    _three_two_one(cell, arm, settings, rng, add)
    own = np.random.default_rng([seed, 92])
    leans = own.normal(size=(2, 5, 3))
    leans *= LEAN / np.linalg.norm(leans, axis=2, keepdims=True)
    gauges = [
        touches(with_tool(cell, tip + size * axis), TABLE, lean, own)
        for size, lean in zip((0.0, GAUGE), leans, strict=True)
    ]
    on_table = axis_between(arm, gauges[0], gauges[1], table=table, settings=settings)
    add("axis, gauges on a table", on_table.axis_in_flange - axis, on_table.covariance,
        on_table.region)  # fmt: skip


def _three_two_one(cell, arm, settings, rng, add) -> None:  # type: ignore[no-untyped-def]
    points = np.vstack([FACES, LAST])
    assert (points <= SIZE).all()
    joints = touch(cell, points, "R", rng, tilt=LEAN)
    six = ProbingSet(names=tuple("ABCDEF"), point=points, normal=NORMALS, joints=joints)
    made = register(arm, six, settings=replace(settings, method="three-two-one")).frames[0]
    T = made.registration.T_base_part
    # what register states is of the touched posture: the wrist leans as it did at that touch
    shown = forward(cell.nominal, joints[:1])[:, :3, :3]
    wanted = pose(shown, apply(T, points[:1]))
    ran = machine(cell, compensated_joints(cell.nominal, wanted, "R"), rng)
    error = T[:3, :3].T @ (ran - apply(cell.T_base_part, points[:1]))[0]
    add("3-2-1, machined point", error, made.machined[0], float(made.region[0]))


def main() -> None:
    """Prints a row a kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=200)
    parser.add_argument("--wide", action="store_true")
    asked = parser.parse_args()
    out: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
    for seed in range(1, asked.cells + 1):
        run_cell(seed, asked.wide, out)
    print(f"simulated, {asked.cells} cells, {'own' if asked.wide else 'drawn'} priors of the arm")
    print("kind | error, median | p95 | region, median | in the 95 % region")
    for kind, rows in out.items():
        error, region, square = np.array(rows).T
        angle = kind.startswith("axis")
        inside = (square <= chi2.ppf(0.95, 2 if angle else 3)).mean()
        unit, name = (DEG, "deg") if angle else (MM, "mm")
        print(
            f"{kind} | {np.median(error) / unit:.3f} {name} | "
            f"{np.percentile(error, 95) / unit:.3f} | "
            f"{np.median(region) / unit:.3f} | {100.0 * inside:.1f} %"
        )


if __name__ == "__main__":
    main()
