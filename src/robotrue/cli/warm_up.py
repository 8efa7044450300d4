"""``robotrue warm-up``: compiles the numeric kernels once and keeps the machine code.

Without it the first program and the first ``sense`` of an installation wait for the compiler, a
minute in all.
"""

from __future__ import annotations

import time

import numpy as np

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.cli.console import say
from robotrue.cli.sense import warmed
from robotrue.compensation.compensate import compensate
from robotrue.online.sensing import Sensing
from robotrue.online.sensing_models import JointCompliance, MeasuredResponse, SensingModels
from robotrue.online.sensing_settings import SensingSettings
from robotrue.program.formats import dialect
from robotrue.program.program import FrameTable
from robotrue.simulation.flange_hole import FlangeHole, hole_program
from robotrue.simulation.milling_arm import milling_arm
from robotrue.simulation.presets import deng2022


def run() -> None:
    """Compensates a small program of the virtual cell, senses two samples, and keeps neither."""
    start = time.perf_counter()
    _compensated()
    warmed(_sensing())
    say(f"kernels ready after {time.perf_counter() - start:.0f} s")


def _compensated() -> None:
    """A small program of the virtual cell, read, compensated and written."""
    robot = deng2022(1, exact=True).robot.actual
    size = len(robot.errors)
    model = CalibratedModel(
        robot=robot.nominal(),
        errors=robot.errors,
        covariance=np.zeros((size, size)),
        repeatability=0.0,
        white=0.0,
    )
    krl = dialect("krl")
    program = krl.read(hole_program(FlangeHole(), robot), name="warm_up.src", frames=FrameTable())
    krl.write(program, compensate(model, program).replacement)


def _sensing() -> Sensing:
    """The estimator of the virtual milling arm, with a response."""
    arm = milling_arm(1)
    compliance = 1.0 / arm.arm.stiffness
    robot = arm.arm.robot
    models = SensingModels(
        robot=robot,
        rate=20e3,
        compliance=JointCompliance(compliance=compliance, covariance=np.diag(compliance**2)),
        response=MeasuredResponse(
            oscillators=arm.tool, joints=robot.limits.mean(axis=1), frame="base"
        ),
    )
    return Sensing(models, SensingSettings())
