"""Registration on simulated arms: floor and oscillation of the recursion; outliers. All simulated.

    python benchmarks/registration.py [--arms N] [--runs N]

Arm: KR160 with a 300 mm tool. The true one differs by a and d N(0, .3 mm), alpha and theta
N(0, .02 deg), beta of link 2 the same, two gravity compliances |N(0, .02 deg)| per m of moment and
harmonics of .008 deg in every joint. Block 400 x 200 x 400 mm around (1000, 0, 600), posed with
3 deg and 6 mm; K, L, M 380 mm apart on its front. Error: the worst of the three points, where the
tip truly goes when the model's points are run.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace

import numpy as np

from robotrue.cell.registration.fit import Noise
from robotrue.cell.registration.recursion import adjust_recursively
from robotrue.cell.registration.robust import fit_points_robust
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, fit_rigid, pose, pose_from_xyz_abc
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.errors import RobotrueError
from robotrue.robot.forward import forward
from robotrue.robot.inverse import branch_of, inverse_batch
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.presets import preset

FRONT = np.array([-27.2, -29.9, -1.4, 75.0, -113.0, 55.6]) * DEG
TOOL = pose(np.eye(3), np.array([0.0, 0.0, 0.3]))
HALF = np.array([0.2, 0.1, 0.2])
TRIANGLE = np.array([[-0.19, -0.1, -0.19], [0.19, -0.1, -0.19], [-0.19, -0.1, 0.19]])
GRID = np.stack(np.meshgrid(*[np.linspace(-1, 1, 5)] * 3, indexing="ij"), -1).reshape(-1, 3) * HALF
CENTRE = np.array([1.0, 0.0, 0.6])
PASSES = 20


class Arm:
    """A true arm behind a nominal one, used as a probe."""

    def __init__(
        self,
        rng: np.random.Generator,
        *,
        touch: float,
        repeat: float,
        tilt: float,
        tip: float,
        scale: float = 1.0,
    ) -> None:
        nominal = preset("KUKA KR160 R1570").with_tool(TOOL)
        errors = np.zeros_like(nominal.errors)
        for group, sigma in (
            ("a", 0.3 * MM),
            ("d", 0.3 * MM),
            ("alpha", 0.02 * DEG),
            ("theta", 0.02 * DEG),
        ):
            errors[parameter_slice(6, group)] = scale * sigma * rng.normal(size=6)
        errors[parameter_slice(6, "beta")][1] = scale * 0.02 * DEG * rng.normal()
        tool = TOOL.copy()
        tool[:3, 3] += tip * rng.normal(size=3)
        # Joint limits left aside: one branch then serves every point of the block.
        self.nominal: RobotModel = replace(
            nominal.nominal(), limits=np.tile([-2.0 * np.pi, 2.0 * np.pi], (6, 1))
        )
        self.true: RobotModel = nominal.with_tool(tool).with_errors(errors)
        self.sag = -scale * np.abs(0.02 * DEG * rng.normal(size=2))
        self.wave = scale * 0.008 * DEG * np.abs(rng.normal(size=6))
        self.order, self.phase = rng.integers(2, 9, 6), rng.uniform(0, 2 * np.pi, 6)
        self.branch = branch_of(self.nominal, FRONT)
        self.attitude = forward(self.nominal, FRONT[None])[0, :3, :3]
        self.rng, self.touch, self.repeat, self.tilt = rng, touch, repeat, tilt
        self.part = np.empty((3, 3))
        self.errors: list[float] = []

    def reached(self, points: Array, attitude: Array) -> Array:
        """Where the tip truly goes, (n, 3) m."""
        poses = pose(np.broadcast_to(attitude, (len(points), 3, 3)), points)
        q = inverse_batch(self.nominal, poses, near=FRONT, branch=self.branch)
        angle = q + self.nominal.theta
        a2, a3 = angle[:, 1], angle[:, 1] + angle[:, 2]
        m3 = -0.71 * np.sin(a3) + 0.07 * np.cos(a3)
        m2 = 0.61 * np.cos(a2) + m3 + 0.3 * 0.61 * np.cos(a2)
        shift = self.wave * np.sin(self.order * q + self.phase)
        shift[:, 1] += self.sag[0] * m2
        shift[:, 2] += self.sag[1] * m3
        return forward(self.true, q, shift)[:, :3, 3]

    def probe(self, run: Array) -> Array:
        """The part's K, L, M as this arm reads them; notes how far off it ran."""
        ran = self.reached(run, self.attitude) + self.repeat * self.rng.normal(size=(3, 3))
        self.errors.append(float(np.linalg.norm(ran - self.part, axis=1).max()))
        lean = self.rng.normal(size=3)
        lean *= self.tilt / np.linalg.norm(lean)
        attitude = matrix_from_rotation_vector(lean) @ self.attitude
        aim = self.part + np.hypot(self.touch, self.repeat) * self.rng.normal(size=(3, 3))
        command = aim.copy()
        for _ in range(4):
            command += aim - self.reached(command, attitude)
        return command


def recursion(arms: int) -> None:
    """Prints floor and oscillation for arms with more and more that is wrong."""
    cases = {
        "no noise, same posture": dict(touch=0.0, repeat=0.0, tilt=0.0, tip=0.0),
        "touch .1, repeatability .03": dict(touch=0.1 * MM, repeat=0.03 * MM, tilt=0.0, tip=0.0),
        "+ tilt 5 deg": dict(touch=0.1 * MM, repeat=0.03 * MM, tilt=5 * DEG, tip=0.0),
        "+ tip .3 mm": dict(touch=0.1 * MM, repeat=0.03 * MM, tilt=5 * DEG, tip=0.3 * MM),
        "+ tip 1 mm": dict(touch=0.1 * MM, repeat=0.03 * MM, tilt=5 * DEG, tip=MM),
        "touch .3": dict(touch=0.3 * MM, repeat=0.03 * MM, tilt=5 * DEG, tip=0.3 * MM),
        "arm 3x worse": dict(
            touch=0.1 * MM, repeat=0.03 * MM, tilt=5 * DEG, tip=0.3 * MM, scale=3.0
        ),
    }
    print(f"\nrecursion, {arms} simulated arms, {PASSES} passes; mm, medians")
    print(f"{'case':30s} start  it 1  floor [p5 p95]   oscillation  own report: floor, osc, passes")
    for name, case in cases.items():
        rows = []
        for seed in range(arms):
            rng = np.random.default_rng(seed)
            arm = Arm(rng, **case)
            T = pose_from_xyz_abc(
                CENTRE + 6 * MM * rng.normal(size=3), 3 * DEG * rng.normal(size=3)
            )
            arm.part = apply(T, TRIANGLE)
            # A tilt of the wrist changes tip and arm errors (1.2 mm) by its sine.
            wrist = case["tilt"] * (case["tip"] + 1.2 * MM * case.get("scale", 1.0))
            sigma = float(np.linalg.norm([case["touch"], case["repeat"], wrist]))
            common = dict(sigma=sigma, position_tolerance=0.0)
            drawn = pose(np.eye(3), CENTRE)
            adjust_recursively(TRIANGLE, drawn, arm.probe, settled=99, most=PASSES, **common)
            seen = np.array(arm.errors) / MM
            own = adjust_recursively(TRIANGLE, drawn, arm.probe, **common)
            late = seen[5:]
            rows.append(
                [
                    seen[0],
                    seen[1],
                    late.mean(),
                    late.std(),
                    own.floor / MM,
                    own.oscillation / MM,
                    len(own.passes),
                ]
            )
        r = np.array(rows)
        mid = np.nanmedian(r, axis=0)
        low, high = np.percentile(r[:, 2], [5, 95])
        print(
            f"{name:30s} {mid[0]:5.1f}  {mid[1]:.2f}  {mid[2]:.2f} [{low:.2f} {high:.2f}]"
            f"   {mid[3]:.2f}         {mid[4]:.2f} {mid[5]:.2f} {mid[6]:.0f}",
            flush=True,
        )


def outliers(runs: int) -> None:
    """Prints the frame error of plain and robust fits with 2 to 15 mm outliers, sigma .12 mm."""
    print(f"outliers, {runs} simulated runs; rms over the block, mm: median / p95 / share > .5")
    for n, wrong in ((8, 0), (8, 1), (8, 2), (8, 3), (20, 5), (20, 8)):
        rng = np.random.default_rng(0)
        rows, refused = [], 0
        for _ in range(runs):
            points = rng.uniform(-1, 1, (n, 3)) * HALF
            axis = rng.integers(0, 3, n)
            points[np.arange(n), axis] = np.sign(points[np.arange(n), axis]) * HALF[axis]
            T = pose_from_xyz_abc(CENTRE, 3 * DEG * rng.normal(size=3))
            touched = apply(T, points) + 0.12 * MM * rng.normal(size=(n, 3))
            bad = rng.choice(n, wrong, replace=False)
            way = rng.normal(size=(wrong, 3))
            way /= np.linalg.norm(way, axis=1)[:, None]
            touched[bad] += way * rng.uniform(2, 15, (wrong, 1)) * MM
            good = np.setdiff1d(np.arange(n), bad)
            try:
                found = fit_points_robust(points, touched, noise=Noise(touch=0.12 * MM, robot=0.0))
            except RobotrueError:
                refused += 1
                continue
            frames = (
                fit_rigid(points, touched),
                found.T_base_part,
                fit_rigid(points[good], touched[good]),
            )
            rows.append(
                [
                    np.sqrt(((apply(f, GRID) - apply(T, GRID)) ** 2).sum(axis=1).mean()) / MM
                    for f in frames
                ]
            )
        r = np.array(rows)
        columns = []
        for label, v in zip(("plain", "robust", "wrong ones known"), r.T, strict=True):
            share = 100.0 * np.mean(v > 0.5)
            columns.append(
                f"{label} {np.median(v):.3f} / {np.percentile(v, 95):.3f} / {share:.1f} %"
            )
        text = "   ".join(columns)
        print(f"{n:2d} points, {wrong} wrong: {text}   refused {refused}", flush=True)


def main(arguments: list[str]) -> None:
    """Runs both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--arms", type=int, default=100)
    parser.add_argument("--runs", type=int, default=400)
    chosen = parser.parse_args(arguments)
    outliers(chosen.runs)
    recursion(chosen.arms)


if __name__ == "__main__":
    main(sys.argv[1:])
