"""A calibrated rail: every target is compensated for where the arm is on it, in every language."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import cases
import numpy as np
import pytest
from test_external_chain import (
    BOTH,
    E1_MM,
    JOINTS,
    RAIL,
    TABLE,
    TURN,
    fanuc,
    frames_in_base,
    jbi,
    krl,
    rapid,
    read,
)

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.model import Query
from robotrue.calibration.terms.rail_guide import WAVES, RailGuide
from robotrue.compensation import CompensationSettings, Status, compensate
from robotrue.core.conditions import no_conditions
from robotrue.core.poses import inverse
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.robot.forward import forward

GUIDE: Final = RailGuide(number=1, direction=RAIL.direction, low=-0.3, high=0.9)


def railed() -> CalibratedModel:
    """An arm without errors on a rail that bends, turns and is 1 mm/m off."""
    values = np.zeros((6, WAVES))
    values[:, 0] = [1.2e-3, 4e-4, -3e-4, 1e-4, -2e-4, 3e-4]
    values[1, 1:3] = 2e-4, 1e-4
    robot = cases.kr160()
    size = len(robot.errors)
    return CalibratedModel(
        robot=robot,
        errors=np.zeros(size),
        covariance=np.zeros((size, size)),
        repeatability=1e-5,
        white=0.0,
        terms=(GUIDE,),
        values=values.ravel(),
        columns=np.zeros(1),
        root=np.zeros((1, 1)),
    )


@pytest.mark.parametrize(
    ("name", "make"), [("krl", krl), ("rapid", rapid), ("fanuc_ls", fanuc), ("jbi", jbi)]
)
def test_targets_are_compensated_where_the_arm_is_on_its_rail(name, make) -> None:
    model = railed()
    wanted = inverse(frames_in_base(False)) @ forward(model.robot, JOINTS)
    table = replace(BOTH, external=(RAIL, replace(TURN, frames=())))
    program = read(name, make(wanted, False).encode(), table)
    assert program.external is not None
    np.testing.assert_allclose(program.external[:, 0], E1_MM * MM, atol=1e-12)
    result = compensate(model, program, settings=CompensationSettings(home=JOINTS[0]))
    assert (result.status == Status.COMPENSATED).all()
    conditions = replace(no_conditions(len(JOINTS)), external=program.external)
    told = model.predict(Query(joints=result.joints, conditions=conditions))
    landed = forward(model.robot, result.joints)[:, :3, 3] + told.error
    target = (frames_in_base(False) @ wanted)[:, :3, 3]
    assert np.linalg.norm(landed - target, axis=1).max() < 1e-3 * MM
    assert np.ptp(np.linalg.norm(result.shift, axis=1)) > 0.3 * MM


def test_a_program_that_does_not_state_the_place_is_refused() -> None:
    model = railed()
    program = cases.program_of(forward(model.robot, JOINTS))
    settings = CompensationSettings(home=JOINTS[0])
    with pytest.raises(ConfigurationError, match="40 of 40 targets do not state where the arm is"):
        compensate(model, program, settings=settings)
    external = np.full((1, 6), np.nan)
    external[0, 0] = 0.5
    there = model.under(replace(no_conditions(), external=external))
    assert (compensate(there, program, settings=settings).status == Status.COMPENSATED).all()


def test_a_cell_without_a_rail_states_no_place() -> None:
    wanted = inverse(frames_in_base(False)) @ forward(cases.kr160(), JOINTS)
    program = read("krl", krl(wanted, False).encode(), TABLE)
    assert program.external is None
