"""Compile the numeric kernels once, so that the first program does not wait for them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Note, PlainResult
from robotrue.app.request import Request

if TYPE_CHECKING:
    from robotrue.online.sensing import Sensing


class WarmUpRequest(Request):
    """Nothing: all kernels are compiled."""


@operation(has_document=False)
def run(request: WarmUpRequest, context: Context) -> PlainResult:
    """Compensates a small program of the virtual cell, senses two samples, and saves neither.

    Without it the first program and the first ``sense`` of an installation wait for the compiler,
    a minute in all.
    """
    import time

    from robotrue.online.service_run import compile_kernels

    start = time.perf_counter()
    _compensate_program()
    compile_kernels(_sensing())
    return PlainResult(
        shown=(Note(f"kernels ready after {time.perf_counter() - start:.0f} s"),),
    )


def _compensate_program() -> None:
    """A small program of the virtual cell, read, compensated and written."""
    import numpy as np

    from robotrue.calibration.calibrated_model import CalibratedModel
    from robotrue.compensation.compensate import compensate
    from robotrue.program.lang import find_language
    from robotrue.program.program import FrameTable
    from robotrue.simulation.flange_hole import FlangeHole, hole_program
    from robotrue.simulation.presets import deng2022

    robot = deng2022(1, exact=True).robot.actual
    size = len(robot.errors)
    model = CalibratedModel(
        robot=robot.nominal(),
        errors=robot.errors,
        covariance=np.zeros((size, size)),
        repeatability=0.0,
        white=0.0,
    )
    krl = find_language("krl")
    program = krl.read(hole_program(FlangeHole(), robot), name="warm_up.src", frames=FrameTable())
    krl.write(program, compensate(model, program).replacement)


def _sensing() -> Sensing:
    """The estimator of the virtual milling arm, with a response."""
    import numpy as np

    from robotrue.online.sensing import Sensing
    from robotrue.online.sensing_models import (
        JointCompliance,
        MeasuredResponse,
        SensingModels,
        SensingSettings,
    )
    from robotrue.simulation.milling_arm import milling_arm

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
