"""Targets per CPU-second of the whole compensation chain, one thread, without file input or output.

Inverse kinematics, branch, inversion of the calibrated arm under load, guards and the command of
every target: the compiled route, the same through a vectorised ``predict``, and as a floor the
nominal inverse and forward alone in py-opw-kinematics (if it is installed).

    OMP_NUM_THREADS=1 python benchmarks/compensation_chain.py [TARGETS]

Simulated errors; seeds are printed. CPU time of the process, best of three; compilation is timed
by itself (an empty folder in NUMBA_CACHE_DIR shows all of it).
"""

from __future__ import annotations

import importlib.util
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "compensation"))
import cases

from robotrue.compensation import CompensationSettings, compensate
from robotrue.core.sines import sines
from robotrue.core.units import UM
from robotrue.program.program import Motion
from robotrue.robot.forward import forward
from robotrue.robot.statics import Load

SEED = 3
COUNT = 192
LOW = np.radians([-60.0, -60.0, -60.0, -170.0, 15.0, -170.0])
HIGH = np.radians([60.0, 40.0, 60.0, 170.0, 115.0, 170.0])


def seconds(task) -> float:
    best = np.inf
    for _ in range(3):
        start = time.process_time()
        task()
        best = min(best, time.process_time() - start)
    return best


def measure(name: str, model, joints: np.ndarray, motion: Motion) -> None:
    program = cases.program_of(forward(model.robot, joints), motion=motion)
    settings = CompensationSettings(
        load=Load(mass=np.array([60.0]), com=np.array([[0.05, 0.0, 0.15]])),
        wrench=np.array([100.0, -200.0, 50.0, 1.0, 2.0, 3.0]),
        home=joints[0],
    )
    result = compensate(model, program, settings=settings)
    best = seconds(lambda: compensate(model, program, settings=settings))
    left = np.linalg.norm(result.predicted_error_after, axis=1)
    done = result.replacement.changed
    print(
        f"{name:58s} {len(joints) / best / 1e6:8.4f} M/s  "
        f"left at most {left[done].max() / UM:.3f} um, {done.mean():.2%} compensated"
    )


def calibration() -> None:
    """Prints the speed of a fixed loop, to compare figures from machines busy with other things."""
    angle, out = np.linspace(-3.0, 3.0, COUNT), np.zeros(2 * COUNT)
    sines(angle, COUNT, out)

    def loop() -> None:
        for _ in range(20_000):
            sines(angle, COUNT, out)

    rate = 20_000 * COUNT / seconds(loop) / 1e6
    print(f"{'calibration: sine and cosine':58s} {rate:8.1f} M/s")


def floor(joints: np.ndarray, robot) -> None:
    if importlib.util.find_spec("py_opw_kinematics") is None:
        print("nominal inverse and forward alone: py-opw-kinematics is not installed, row left out")
        return
    from py_opw_kinematics import KinematicModel, Robot

    lengths = {"a1": 250, "a2": 70, "b": 0, "c1": 500, "c2": 610, "c3": 710, "c4": 215}
    arm = Robot(
        KinematicModel(
            **lengths, offsets=(0, 0, -np.pi / 2, 0, 0, 0),
            flip_axes=(False, True, True, False, True, False),
        ),
        "xyz",
    )  # fmt: skip
    told = arm.batch_forward(joints)
    best = seconds(lambda: arm.batch_forward(arm.batch_inverse(told)))
    print(f"{'floor: py-opw-kinematics, nominal only':58s} {len(joints) / best / 1e6:8.4f} M/s")


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    print(f"{count} targets, KR160 R1570 with tool, seed {SEED} (errors), 5 (path), 1 (scatter)")
    path = cases.path_joints(count)
    scatter = np.random.default_rng(1).uniform(LOW, HIGH, size=(count, 6))
    start = time.process_time()
    compensate(cases.rigid_model(SEED), cases.program_of(np.eye(4)[None]))
    print(f"first call, compilation or its cache: {time.process_time() - start:.2f} CPU-s")
    calibration()
    few = max(count // 50, 100)
    for title, model in (
        ("geometry + compliance", cases.rigid_model(SEED)),
        ("with ripple 6 x 64 and 500 smooth centres", cases.rich_model(SEED)),
    ):
        measure(f"compiled: {title}, path", model, path, Motion.LIN)
        measure(f"compiled: {title}, scattered", model, scatter, Motion.PTP)
        hidden = cases.TableModel(tables=model.tables, flat=False)
        measure(f"NumPy: {title}, path", hidden, path[:few], Motion.LIN)
    floor(path, cases.kr160())


if __name__ == "__main__":
    main()
