"""``robotrue warm-up``: compiles the numeric kernels once and keeps the machine code.

Without it the first program of an installation waits for the compiler, about a minute.
"""

from __future__ import annotations

import time

import numpy as np

from robotrue.calibration.rigid_flexible import RigidFlexibleModel
from robotrue.cli.console import say
from robotrue.compensation.compensate import compensate
from robotrue.program.formats import dialect
from robotrue.program.program import FrameTable
from robotrue.simulation.flange_hole import FlangeHole, hole_program
from robotrue.simulation.presets import deng2022


def run() -> None:
    """Compensates a small program of the virtual cell and throws the result away."""
    start = time.perf_counter()
    robot = deng2022(1, exact=True).robot.actual
    size = len(robot.errors)
    model = RigidFlexibleModel(
        robot=robot.nominal(),
        errors=robot.errors,
        covariance=np.zeros((size, size)),
        repeatability=0.0,
        white=0.0,
    )
    krl = dialect("krl")
    program = krl.read(hole_program(FlangeHole(), robot), name="warm_up.src", frames=FrameTable())
    krl.write(program, compensate(model, program).replacement)
    say(f"kernels ready after {time.perf_counter() - start:.0f} s")
