"""Register a part by probing without a tracker, up to the verdict. All data are simulated."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from robotrue.calibration.nominal import NominalModel
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose
from robotrue.core.units import MM
from robotrue.measurement.formats.part_points import read_points, write_points
from robotrue.measurement.probing_set import ProbingSet
from robotrue.validation.part_registration import register
from robotrue.validation.registered_part import RegisteredPart
from robotrue.validation.registration_frame import RegistrationSettings
from robotrue_reproductions.feng2018 import machining_cell as virtual

COUNTS = (3, 6, 9, 12, 18, 24, 30)
BOTH: tuple[virtual.Posture, ...] = ("R", "L")


def session(cell: virtual.FengCell, path: Path) -> ProbingSet:
    """Probes thirty points, front, back and top in turn; writes them to a file and reads it."""
    rng = np.random.default_rng(8)
    sides = {side: virtual.touch_points(side, 10, rng) for side in virtual.START}
    joints = {side: virtual.touch(cell, points, side, rng) for side, points in sides.items()}
    turn = [(side, i) for i in range(10) for side in sides]
    touches = ProbingSet(
        names=tuple(f"{side}{i + 1}" for side, i in turn),
        point=np.array([sides[side][i] for side, i in turn]),
        joints=np.array([joints[side][i] for side, i in turn]),
    )
    write_points(path, touches)
    return read_points(path).touches


def cut(cell: virtual.FengCell, found: RegisteredPart) -> Array:
    """Returns errors (40,) mm of points cut from both sides with the model of the frame."""
    rng, T, errors = np.random.default_rng(9), found.frames[0].registration.T_base_part, []
    for side in BOTH:
        points = virtual.touch_points(side, 20, rng)
        poses = pose(np.broadcast_to(virtual.attitude(side), (20, 3, 3)), apply(T, points))
        joints = virtual.compensated_joints(found.refined or cell.nominal, poses, side)
        hit = virtual.machine(cell, joints, rng)
        errors.append(np.linalg.norm(hit - apply(cell.T_base_part, points), axis=1))
    return np.concatenate(errors) / MM


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    cell, settings = virtual.feng_cell(seed=5), RegistrationSettings(tolerance=0.3 * MM)
    touches = session(cell, out / "points.csv")
    arm, stated, done = NominalModel(robot=cell.nominal), [], []
    for n in COUNTS:
        found = register(arm, touches.subset(np.arange(n)), settings=settings)
        stated.append(found.frames[0].region.max() / MM)
        done.append(cut(cell, found))
        print(f"{n} touches, {found.route}: {stated[-1]:.2f} mm with 95 %, {found.verdict}")
    figure, axes = plt.subplots(figsize=(6, 3))
    axes.semilogy(COUNTS, stated, label="stated, 95 %, worst point")
    axes.semilogy(COUNTS, [np.percentile(e, 95) for e in done], "o", label="then cut, 95 %")
    axes.set(xlabel="probing points", ylabel="mm (simulated)")
    axes.set_yticks([0.2, 0.5, 1.0, 2.0, 4.0], ["0.2", "0.5", "1", "2", "4"])
    axes.set_yticks([], minor=True)
    axes.legend()
    figure.savefig(out / "10_register.png", bbox_inches="tight")
    error = done[-1].std(ddof=1) / np.sqrt(len(done[-1]))
    print(f"{found.verdict}: cut to {done[-1].mean():.3f} +- {error:.3f} mm (simulated)")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "example-out"))
