"""A correction that turns the tool by more than ``max_turn`` is never commanded, on any route."""

from __future__ import annotations

import io
from dataclasses import replace

import cases
import numpy as np
import pytest
from test_compensate_file import text
from test_split import TOLERANCE, Case

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.terms.term import rigid_tables
from robotrue.compensation import CompensationSettings, Status, compensate
from robotrue.compensation.compensate_file import compensate_file
from robotrue.compensation.split_deviation import measure_moves
from robotrue.compensation.split_shapes import job_moves
from robotrue.core.units import DEG
from robotrue.program.formats import read_job
from robotrue.program.program import FrameTable, Motion
from robotrue.program.program_file import outline_job
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.presets import preset

TURN = 2.0 * DEG
COUNT = 40
KR_HOME = np.array([10.0, -25.0, 20.0, 30.0, 55.0, 40.0]) * DEG
UR_HOME = np.array([10.0, -70.0, 80.0, -100.0, -80.0, 40.0]) * DEG


def turned(robot: RobotModel) -> RobotModel:
    """The arm with a tool turned about its own point: a pure turn, no shift to bound."""
    errors = np.zeros(len(robot.errors))
    errors[parameter_slice(robot.dof, "tool")][3:] = [0.0, TURN, 0.0]
    return robot.with_errors(errors)


def ur10() -> RobotModel:
    return preset("ur10").with_tool(cases.TOOL)


@pytest.mark.parametrize(
    ("robot", "flat"),
    [(cases.kr160(), True), (ur10(), True), (cases.kr160(), False), (ur10(), False)],
    ids=["compiled", "iterated", "predicted", "predicted, iterated"],
)
@pytest.mark.parametrize("axes", [False, True], ids=["poses", "axis targets"])
def test_a_larger_turn_is_not_commanded(robot, flat, axes):
    model = cases.TableModel(tables=rigid_tables(turned(robot)), flat=flat)
    home = UR_HOME if robot.name == "UR10" else KR_HOME
    joints = home + 0.1 * (cases.path_joints(COUNT) - KR_HOME)  # far from a straight wrist
    program = (
        cases.axis_program(joints)
        if axes
        else cases.program_of(forward(robot, joints), motion=Motion.PTP)
    )
    settings = CompensationSettings(home=joints[0], max_turn=0.9 * TURN, axis_targets=axes)
    refused = compensate(model, program, settings=settings)
    assert (refused.status == Status.UNCHANGED_STEP).all()
    assert not refused.replacement.changed.any()
    wide = replace(settings, max_turn=1.1 * TURN)
    done = compensate(model, program, settings=wide)
    assert (done.status == Status.COMPENSATED).all()
    np.testing.assert_allclose(done.turn, TURN, rtol=1e-3)


def test_a_larger_turn_is_not_streamed(tmp_path):
    robot = cases.kr160()
    source = tmp_path / "part.src"
    source.write_bytes(text(COUNT))
    model = CalibratedModel(
        robot=robot,
        errors=turned(robot).errors,
        covariance=np.zeros((len(robot.errors), len(robot.errors))),
        repeatability=1e-5,
        white=0.0,
    )
    (program,) = read_job(source, FrameTable())
    (found,) = outline_job(source, FrameTable(), targets=8)
    counts = {}
    for factor in (0.9, 1.1):
        how = CompensationSettings(home=cases.path_joints(COUNT)[0], max_turn=factor * TURN)
        one = compensate(model, program, settings=how)
        many = compensate_file(model, found, source, io.BytesIO(), settings=how, workers=1)
        assert many.summary()["status"] == one.summary()["status"]
        counts[factor] = many.summary()["compensated"]
    assert counts[0.9] == 0
    assert counts[1.1] > COUNT // 2


def test_a_larger_turn_between_targets_is_not_split():
    case = Case("krl")
    tight = [replace(s, max_turn=1e-6) for s in case.settings]
    loose = [
        compensate(case.model, p, settings=s)
        for p, s in zip(case.programs, case.settings, strict=True)
    ]
    rows = np.flatnonzero(case.deviation.size > TOLERANCE)
    whole = np.ones(len(rows), dtype=np.int64)
    good = job_moves(case.model, case.programs, case.moves, loose, case.settings)
    assert (measure_moves(good, rows, whole).status == Status.COMPENSATED).all()
    bounded = job_moves(case.model, case.programs, case.moves, loose, tight)
    assert (measure_moves(bounded, rows, whole).status == Status.UNCHANGED_STEP).all()
    plan = case.plan()
    case.settings = tight
    split, results, _ = case.split(plan)
    assert sum(len(p) for p in split.programs) > sum(len(p) for p in case.programs)
    for result in results:
        assert not (result.status == Status.COMPENSATED).any()
        assert (result.status == Status.UNCHANGED_STEP).any()
