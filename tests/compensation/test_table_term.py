"""A calibrated rotary table: targets on it are compensated at their angle, in every language."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final

import cases
import numpy as np
import pytest
import test_external_chain
from test_external_chain import (
    COUNT,
    E2_DEG,
    JOINTS,
    TABLE,
    TURN,
    fanuc,
    jbi,
    krl,
    rapid,
    read,
)

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.model import Query
from robotrue.calibration.terms.rotary_table import SIZE, RotaryTable
from robotrue.compensation import CompensationSettings, Status, compensate
from robotrue.core.conditions import no_conditions
from robotrue.core.poses import inverse
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.program.external_axes import ExternalAxis, move_frames
from robotrue.robot.forward import forward

PLANTED: Final = (4e-4, -3e-4, 5e-4, 6e-4, 5e-5)
"""Tilt, offset and scale."""


def with_table(axis: ExternalAxis) -> CalibratedModel:
    """An arm without errors beside a table that is tilted, off, and runs out."""
    values = np.concatenate([PLANTED, np.linspace(-3e-5, 3e-5, SIZE - len(PLANTED))])
    robot = cases.kr160()
    size = len(robot.errors)
    return CalibratedModel(
        robot=robot,
        errors=np.zeros(size),
        covariance=np.zeros((size, size)),
        repeatability=1e-5,
        white=0.0,
        terms=(RotaryTable(axes=(axis,), low=np.array([-1.0]), high=np.array([1.0])),),
        values=values,
        columns=np.zeros(1),
        root=np.zeros((1, 1)),
    )


def turned_frames() -> np.ndarray:
    """The work frame (n, 4, 4) in base as the stated axis turns it."""
    frames = np.tile(cases.FRAME, (COUNT, 1, 1))
    move_frames(frames, TURN, E2_DEG * DEG)
    return frames


def jbi_on_station(T: np.ndarray, turned: bool) -> str:
    """A job whose station axis is the first external one that its moves name."""
    text = re.sub(
        r"BC(\d+)=.*", lambda match: f"EC{match[1]}={E2_DEG[int(match[1])]}\r", jbi(T, turned)
    )
    text = text.replace("NPOS 40,40,0,0,0,0", "NPOS 40,0,40,0,0,0")
    return text.replace(" BC", " EC").replace("RB1,BS1", "RB1\r\n///GROUP2 ST1")


@pytest.mark.parametrize(
    ("name", "make"),
    [("krl", krl), ("rapid", rapid), ("fanuc_ls", fanuc), ("jbi", jbi_on_station)],
)
def test_targets_on_the_table_are_compensated_at_their_angle(
    name: str, make: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(test_external_chain, "E1_MM", np.zeros(COUNT))
    axis = replace(TURN, number=1) if name == "jbi" else TURN
    model = with_table(axis)
    wanted = inverse(turned_frames()) @ forward(model.robot, JOINTS)
    data = make(wanted, True).encode()  # type: ignore[operator]
    table = replace(TABLE, external=(axis,))
    program = read(name, data, table)
    assert not program.reason.any(), program.notes
    assert program.external is not None
    np.testing.assert_allclose(program.external[:, axis.number - 1], E2_DEG * DEG, atol=1e-12)
    result = compensate(model, program, settings=CompensationSettings(home=JOINTS[0]))
    assert (result.status == Status.COMPENSATED).all()
    conditions = replace(no_conditions(COUNT), external=program.external)
    told = model.predict(Query(joints=result.joints, conditions=conditions))
    landed = forward(model.robot, result.joints)[:, :3, 3] + told.error
    target = (turned_frames() @ wanted)[:, :3, 3]
    assert np.linalg.norm(landed - target, axis=1).max() < 1e-3 * MM
    size = np.linalg.norm(result.shift, axis=1)
    assert size.max() > 0.3 * MM
    assert np.ptp(size) > 0.2 * MM


def test_the_correction_is_the_motion_of_the_part(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(test_external_chain, "E1_MM", np.zeros(COUNT))
    model = with_table(TURN)
    values = np.array(model.values)
    values[5:] = 0.0
    model = replace(model, values=values)
    term = model.terms[0]
    assert isinstance(term, RotaryTable)
    direction, point = term.actual_axis(0, values)
    actual = replace(TURN, direction=direction, point=point)
    wanted = inverse(turned_frames()) @ forward(model.robot, JOINTS)
    program = read("krl", krl(wanted, True).encode(), replace(TABLE, external=(TURN,)))
    result = compensate(model, program, settings=CompensationSettings(home=JOINTS[0]))
    true = np.tile(cases.FRAME, (COUNT, 1, 1))
    angle = TURN.at + (E2_DEG * DEG - TURN.at) * (1.0 + values[4])
    move_frames(true, actual, angle)
    landed = forward(model.robot, result.joints)
    off = np.linalg.norm((landed - true @ wanted)[:, :3, 3], axis=1)
    # The motion is linear in tilt and offset, which are half a milliradian and a millimetre.
    assert off.max() < 2e-3 * MM
    assert np.abs((landed - true @ wanted)[:, :3, :3]).max() < 3e-6


def test_targets_beside_the_table_are_those_of_the_arm(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(test_external_chain, "E1_MM", np.zeros(COUNT))
    model = with_table(TURN)
    wanted = inverse(cases.FRAME[None]) @ forward(model.robot, JOINTS)
    beside = replace(TURN, frames=())
    program = read("krl", krl(wanted, False).encode(), replace(TABLE, external=(beside,)))
    assert program.external is not None
    assert np.isnan(program.external).all()
    result = compensate(model, program, settings=CompensationSettings(home=JOINTS[0]))
    assert np.linalg.norm(result.shift, axis=1).max() < 1e-9


def test_a_cell_with_the_axis_elsewhere_is_refused() -> None:
    model = with_table(TURN)
    model.require_axes([TURN])
    model.require_axes([])
    for other in (replace(TURN, at=0.0), replace(TURN, point=np.array([1.2, 0.101, 0.3]))):
        with pytest.raises(ConfigurationError, match="a rotary table E2, and the cell states its"):
            model.require_axes([other])
    tilting = ExternalAxis(
        number=1, direction=np.eye(3)[1], point=np.zeros(3), frames=TURN.frames[:1]
    )
    with pytest.raises(ConfigurationError, match="use the cell it was calibrated with"):
        model.require_axes([tilting, TURN])
